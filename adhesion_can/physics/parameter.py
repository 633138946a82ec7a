"""One number of an effect or of a curve family, with unit, range and meaning."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from enum import Enum, auto
from math import isfinite
from typing import NamedTuple

AT_BOUND = 1e-6
"""Distance from the end of a parameter's range, as a share of the range, that counts as none."""


class Wheelset(NamedTuple):
    """Data of a vehicle's wheelset.

    Attributes:
        load: Mean load, N.
        radius: Mean wheel radius, m.
        inertia: Configured inertia at the wheel, kg·m².

    """

    load: float
    radius: float
    inertia: float


PlausibleRange = Callable[[Wheelset], tuple[float, float]]
"""Smallest and largest value that a vehicle with such a wheelset may have."""


class SearchStart(Enum):
    """Values of a further parameter at which a search starts."""

    SCALES = auto()
    """Multiples of the typical value."""
    STEP_TIME = auto()
    """Time at which the slips of all axles step."""
    WHEEL_PHASE = auto()
    """Phase of what the axle's wheel speed shows once a turn."""


class NormalPrior(NamedTuple):
    """What is expected of a parameter before any sample: normal, or lognormal.

    Attributes:
        mean: Value in the middle.
        std: Standard deviation of the value, or of its logarithm.
        logarithmic: Whether the logarithm of the value is normal; a fit moves it, too.

    """

    mean: float
    std: float
    logarithmic: bool


@dataclass(frozen=True, slots=True)
class Parameter:
    """One number of an effect or of a curve family.

    Attributes:
        name: Name as in the literature.
        unit: SI unit; '1' for a ratio.
        typical: Value where none is given.
        lower: Smallest value that makes sense.
        upper: Largest value that makes sense.
        meaning: Meaning in one line.
        axle: Whether the value is the number of an axle; the diagnosis tries each axle.
        given: Whether `typical` is the value in a diagnosis, which does not estimate it.
        plausible: Range beyond which no vehicle has the value: a fit that ends there names no
            cause. None: from `lower` to `upper`.
        starts: Values at which a diagnosis starts its search, relative to `typical`; of the size
            it needs none.
        search: Values at which a search starts, where the parameter is not the size.
        step: Step of a numerical derivative, in `unit`; 0: a share of `typical`.
        prior: What is expected of the value; None where no fit uses it.
        linear: Whether a diagnosis fits the value itself; else it fits the logarithm of a value
            that is always positive.

    """

    name: str
    unit: str
    typical: float
    lower: float
    upper: float
    meaning: str
    axle: bool = False
    given: bool = False
    plausible: PlausibleRange | None = None
    starts: tuple[float, ...] = (0.3, 1.0, 3.0)
    search: SearchStart = SearchStart.SCALES
    step: float = 0.0
    prior: NormalPrior | None = None
    linear: bool = False

    def normal(self, mean: float, std: float) -> "Parameter":
        """The parameter with a prior: its value is normal about `mean`."""
        return replace(self, prior=NormalPrior(mean, std, logarithmic=False))

    def lognormal(self, mean: float, std: float) -> "Parameter":
        """The parameter with a prior: its logarithm is normal about that of `mean`."""
        return replace(self, prior=NormalPrior(mean, std, logarithmic=True))

    @property
    def free(self) -> bool:
        """Whether a diagnosis estimates the value."""
        return not (self.axle or self.given)

    def is_at_bound(self, value: float) -> bool:
        """Whether a value is at an end of the range that is neither 0 nor infinite."""
        reach = self.upper - self.lower
        ends = (end for end in (self.lower, self.upper) if end != 0.0 and isfinite(end))
        return isfinite(reach) and any(abs(value - end) <= AT_BOUND * reach for end in ends)
