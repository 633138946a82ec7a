"""The arithmetic of the tracker's updates on plain arrays, compiled where the extra `fast` is.

`active` is the implementation in use: `compiled` where numba is installed, else `plain`. Both give
the same bits. `ADHESION_CAN_COMPILED=0` in the environment leaves numba alone. All is compiled or
loaded when this is imported, so that nothing is while a bus waits.
"""

import logging
import os
from collections.abc import Callable
from typing import cast

from adhesion_can.estimation.tracker.kernels import plain
from adhesion_can.estimation.tracker.kernels.interface import NONE, Kernels

__all__ = ["NONE", "SWITCH", "Kernels", "active", "choose"]

SWITCH = "ADHESION_CAN_COMPILED"
"""Variable of the environment; with '0' nothing is compiled."""


def _import_compiled() -> Kernels:
    from adhesion_can.estimation.tracker.kernels import compiled  # noqa: PLC0415  an extra

    return cast(Kernels, compiled)


def choose(import_compiled: Callable[[], Kernels] = _import_compiled) -> Kernels:
    """Implementation to use: the compiled one where it is wanted and can be had."""
    if os.environ.get(SWITCH) == "0":
        return cast(Kernels, plain)
    try:
        return import_compiled()
    except ModuleNotFoundError:
        pass
    except Exception as error:  # noqa: BLE001  numba may refuse NumPy, LLVM the processor
        logging.getLogger(__name__).warning(
            "numba cannot be used; the estimator continues without it: %s", error
        )
    return cast(Kernels, plain)


active: Kernels = choose()
"""Implementation in use."""
