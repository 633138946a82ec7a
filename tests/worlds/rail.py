"""The rail: Burckhardt curves, drawn at random, and where one surface follows another."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.floating[Any]]
Ints = NDArray[np.int64]


@dataclass(frozen=True)
class Rail:
    """Surfaces and the moments they begin at.

    Attributes:
        curves: c1, c2, c3 of each surface, shape (surfaces, 3).
        begins_s: first moment of each surface, s; the first one holds from before the drive.
        tops: Lowest and highest slip that sweeps go to; None: beyond the peak, 0.15 to 0.25.

    """

    curves: Floats
    begins_s: tuple[float, ...]
    tops: tuple[float, float] | None = None

    def surface_at(self, t: Floats) -> Ints:
        """Number of the surface at each moment, shape of `t`."""
        return np.searchsorted(np.array(self.begins_s[1:]), t, side="right")


def curve(c: Floats, slip: Floats) -> Floats:
    """Adhesion at |slip|: c1 (1 − e^(−c2 |λ|)) − c3 |λ|, odd in λ.

    Args:
        c: c1, c2, c3 in the last axis, shape (3,) or (n, 3) for slips of shape (n, axles).
        slip: λ, signed.

    """
    if c.ndim == 2:
        c = c[:, None, :]
    size = np.abs(slip)
    return np.sign(slip) * (c[..., 0] * -np.expm1(-c[..., 1] * size) - c[..., 2] * size)


def draw_curve(rng: np.random.Generator) -> Floats:
    """A plausible surface: peak 0.15-0.45 at a slip of 0.03-0.15, no collapse beyond it."""
    while True:
        mu_max = rng.uniform(0.15, 0.45)
        lambda_m = float(np.exp(rng.uniform(np.log(0.03), np.log(0.15))))
        k = rng.uniform(3.0, 7.0)
        # c3 follows from the slope being zero at the peak, c1 from its height.
        c1 = mu_max / (1.0 - np.exp(-k) * (1.0 + k))
        c = np.array([c1, k / lambda_m, c1 * k / lambda_m * np.exp(-k)])
        if curve(c, np.array(0.25)) >= 0.5 * mu_max:
            return c


def peak(c: Floats) -> tuple[float, float]:
    """Height of a curve's peak and the slip it stands at."""
    at = float(np.log(c[0] * c[1] / c[2]) / c[1]) if c[2] > 0 else 1.0
    return float(curve(c, np.array(at))), at


def one_surface(rng: np.random.Generator) -> Rail:
    """A rail that stays as it is."""
    return Rail(draw_curve(rng)[None], (0.0,))


def several_surfaces(rng: np.random.Generator, duration_s: float) -> Rail:
    """Two to four abrupt changes, at least a ninth of the drive apart, each one to be felt."""
    changes = int(rng.integers(2, 5))
    apart = duration_s / 9
    while True:
        begins = np.sort(rng.uniform(apart, duration_s - apart, changes))
        if np.all(np.diff(begins) > apart):
            break
    curves = [draw_curve(rng)]
    while len(curves) <= changes:
        new = draw_curve(rng)
        if abs(peak(new)[0] / peak(curves[-1])[0] - 1) > 0.25:
            curves.append(new)
    # A change falls on a sampling instant: between two of them nobody could tell.
    return Rail(np.array(curves), (0.0, *(round(float(t), 2) for t in begins)))
