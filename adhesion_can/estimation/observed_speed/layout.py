"""Places of the quantities in the state of the filter, and constants that its parts share."""

from dataclasses import dataclass

from adhesion_can.values import Value

SPEED, DISTURBANCE, LOG_HALF, FIRST_SLIP = 0, 1, 2, 3
"""Places of ln v, of the disturbance acceleration (m/s²), of the curve's ln a, and of the slips."""
LOWEST_SPEED = 1.0
"""Speed below which no slip ratio is formed, m/s."""
REPEATED_BLOCKS = 20.0
"""Blocks of a relief, in which the same error of a free axle's slip or of the curve repeats itself.

An error that stays is not white: its variance counts so many times.
"""


@dataclass(frozen=True, slots=True)
class SpeedStateLayout(Value):
    """Places in the state of a vehicle with a number of axles.

    Attributes:
        axles: Number of axles.

    """

    axles: int

    @property
    def size(self) -> int:
        """Number of states."""
        return FIRST_SLIP + 2 * self.axles

    @property
    def slips(self) -> slice:
        """Places of ln(1 + λ) of each axle."""
        return slice(FIRST_SLIP, FIRST_SLIP + self.axles)

    @property
    def radii(self) -> slice:
        """Places of the logarithms of true over nominal radius."""
        return slice(FIRST_SLIP + self.axles, FIRST_SLIP + 2 * self.axles)
