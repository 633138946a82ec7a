"""Types of the arrays that every package passes on."""

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
"""Array of 64-bit floats of any shape."""
