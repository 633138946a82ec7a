"""A wheel/rail law of the catalogue's own: adhesion rises with slip and falls with creep speed.

μ(λ, v) = a (1 − e^(−|λ|/λ0)) (f + (1 − f) e^(−|λ| v/w0)), with the sign of λ: the contact saturates
with the slip ratio, and friction falls with the creep speed |λ| v towards a share f. The peak thus
moves with the speed.
"""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Rail:
    """A surface.

    Attributes:
        level: Adhesion a that the contact would reach without the fall.
        rise: Slip ratio λ0 over which the contact saturates.
        share: Share f of the friction that is left at high creep speed.
        fall: Creep speed w0 over which the friction falls, m/s.

    """

    level: float
    rise: float
    share: float
    fall: float

    @property
    def values(self) -> tuple[float, float, float, float]:
        """The four numbers of the law."""
        return self.level, self.rise, self.share, self.fall


DRY = Rail(0.405, 1 / 58, 0.72, 4.5)
SLIPS = np.linspace(0.0, 0.4, 4001)
SPEEDS = np.linspace(0.5, 60.0, 239)


def adhesion(slip: Floats, speed: Floats | float, rail: Rail) -> Floats:
    """Adhesion at slip ratios, with their sign."""
    size = np.abs(slip)
    rising = -np.expm1(-size / rail.rise)
    falling = rail.share + (1 - rail.share) * np.exp(-size * speed / rail.fall)
    return np.asarray(np.copysign(rail.level * rising * falling, slip))


@lru_cache(64)
def _peaks(rail: Rail) -> tuple[Floats, Floats]:
    """Largest adhesion and its slip ratio at each of `SPEEDS`."""
    curves = adhesion(SLIPS[None, :], SPEEDS[:, None], rail)
    top = np.clip(curves.argmax(axis=1), 1, len(SLIPS) - 2)
    rows = np.arange(len(SPEEDS))
    before, at, after = (curves[rows, top + k] for k in (-1, 0, 1))
    # The vertex of the parabola through three points of the grid.
    away = 0.5 * (before - after) / (before - 2 * at + after)
    slip = SLIPS[top] + away * (SLIPS[1] - SLIPS[0])
    return at - 0.25 * (before - after) * away, slip


def peak(rail: Rail, speed: Floats) -> tuple[Floats, Floats]:
    """Largest adhesion, and the slip ratio that has it, at some speeds, m/s."""
    most, slip = _peaks(rail)
    return np.interp(speed, SPEEDS, most), np.interp(speed, SPEEDS, slip)
