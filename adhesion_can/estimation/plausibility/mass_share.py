"""How much of its forces moves the vehicle: its mass over that of the train, from the drive."""

from adhesion_can.estimation.plausibility.course import COURSE, MEMORY
from adhesion_can.values import Stateful

FORCE_SLACK = 1.5
"""Factor on what the forces do to the vehicle that is still motion."""
MASS_KNOWN = 5.0
"""Share of the forces that moves the vehicle, in standard deviations, from which it is known."""


class MassShare(Stateful):
    """Share of the vehicle's own acceleration by its adhesion forces that the train follows.

    It is the vehicle's mass over the train's: regression of the deviations of the speed on those of
    the forces, which gradients and resistance leave alone.

    Args:
        configured: Share by the configured masses.

    """

    def __init__(self, configured: float) -> None:
        self._configured = configured
        self._square = self._product = self._rest = 0.0

    def add(self, speed: float, force: float) -> None:
        """Add the deviations of speed and forces of a cycle, m/s."""
        keep = 1.0 - 1.0 / MEMORY
        self._square = keep * self._square + force * force
        self._product = keep * self._product + speed * force
        self._rest = keep * self._rest + speed * speed

    @property
    def _is_known(self) -> bool:
        # Neighbouring cycles have a window in common: as many as it has count as one.
        return (
            self._product > 0.0
            and self._product**2
            > MASS_KNOWN**2 * COURSE * (self._rest * self._square - self._product**2) / MEMORY
        )

    @property
    def value(self) -> float:
        """The share, as the drive shows it; the configured one where it does not."""
        return self._product / self._square if self._is_known else self._configured

    @property
    def largest(self) -> float:
        """Largest share of the forces that is still motion."""
        return FORCE_SLACK * (self.value if self._is_known else 1.0)
