"""Draws of curves near a posterior, with their density, for importance sampling.

With the shape s = ln(c1 c2/c3) the curve is c1 f(λ), f = 1 − e^(−c2 λ) − c2 e^(−s) λ, and J a
square in c1: c1 integrates out. The density of (ln c2, ln s) that is left is a bent ridge where the
peak was not reached. It is evaluated on a grid whose frame turns and zooms in until it resolves the
ridge; (ln c2, ln s) come from the cells, c1 from its normal density given both.
"""

from typing import NamedTuple

import numpy as np
import scipy
from numpy.typing import NDArray

from adhesion_can.arrays import Array
from adhesion_can.estimation.tracker.curve_sums import interpolation
from adhesion_can.estimation.tracker.layout import DOF, X_RANGE, A, B, C, D, E, Z
from adhesion_can.estimation.tracker.prior import Prior
from adhesion_can.estimation.tracker.settings import C1_MAX

COARSE, FINE = 20, 48
"""Number of cells of the grid along each axis: while it zooms in, and at last."""
DEPTH = 12.0
"""Log density below its maximum down to which the grid reaches."""
ZOOMS = 20
"""Largest number of grids, each over the part of the last one that matters."""
RESOLVED = 0.15
"""Share of the cells that matter from which the grid resolves the density."""
NEAREST = 0.04
"""Share of the cells that the next grid is laid about where fewer matter: those that a line through
the grid passes, of 20 by 20. By their rank, since how far they are below the top says little: their
middles pass a ridge thinner than a cell at some distance."""
SHAPE_RANGE = (0.05, 60.0)
"""Range of the shape s."""
SPREAD = 1.3
"""Factor on the standard deviation of c1, for Student's tails and errors of J."""
TEMPER = 0.8
"""Exponent on the density of the cells, so that weights stay bounded at its flanks."""
UNIFORM = 0.1
"""Share of the draws that are spread evenly over the grid (defensive mixture; Hesterberg,
Technometrics 37, 1995)."""
_LEVEL_MEAN, _LEVEL_STD = 0.35, 0.5
"""Normal prior of c1 for the draws alone; it bounds them where data are uninformative."""
_LEAST_LEVEL = 1e-4


class Proposal(NamedTuple):
    """Curves drawn near a posterior.

    Attributes:
        phi: (ln c1, ln c2, ln s) of the curves, shape (n, 3).
        log_density: Log density of the draw in (ln c1, ln c2, ln s), shape (n,).
        good: Whether a curve has a level within its range, shape (n,).

    """

    phi: Array
    log_density: Array
    good: NDArray[np.bool_]


class _Frame(NamedTuple):
    """Parallelogram in (ln c2, ln s).

    Attributes:
        corner: Its first corner, shape (2,).
        edges: Its edges as columns, shape (2, 2).

    """

    corner: Array
    edges: Array

    def points(self, u: Array) -> Array:
        """Points of places (n, 2) in the unit square, shape (n, 2)."""
        return np.asarray(self.corner + u @ self.edges.T)

    @property
    def area(self) -> float:
        """Area in (ln c2, ln s)."""
        return float(abs(np.linalg.det(self.edges)))


_WHOLE = _Frame(
    np.array([X_RANGE[0], np.log(SHAPE_RANGE[0])]),
    np.diag([X_RANGE[1] - X_RANGE[0], np.log(SHAPE_RANGE[1] / SHAPE_RANGE[0])]),
)
LOWEST = -1e300
"""Log density of what is out of range."""


def _clip(places: Array) -> Array:
    """Nearest (ln c2, ln s) within their ranges, shape (n, 2)."""
    lowest = _WHOLE.corner
    return np.clip(places, lowest, lowest + _WHOLE.edges.diagonal())


def _middles(cells: int) -> Array:
    """Middles of the cells in the unit square, shape (cells², 2)."""
    along = (np.arange(cells) + 0.5) / cells
    return np.stack(np.meshgrid(along, along, indexing="ij"), axis=-1).reshape(-1, 2)


_COARSE_CELLS, _FINE_CELLS = _middles(COARSE), _middles(FINE)


class _Segment(NamedTuple):
    """What the density of a curve rests on: sums, prior of the curve and of the noise."""

    sums: Array
    noise_var: float
    noise_freedom: float
    prior: Prior

    def level(self, places: Array, noise_var: float) -> tuple[Array, Array, Array]:
        """Mean and standard deviation of c1, and J at this mean; each of shape (n,).

        Args:
            places: (ln c2, ln s), shape (n, 2).
            noise_var: Variance of the adhesion noise.

        """
        sums = self.sums
        at_x = interpolation(places[:, 0])
        c2, s = np.exp(places).T
        ratio = c2 * np.exp(-s)
        a, b, c = (at_x @ sums[part] for part in (A, B, C))
        # Corrected scores may leave a sum of squares below zero where c2 is not determined.
        square = np.maximum(a + ratio * (2.0 * b + ratio * sums[D]), 0.0)
        product = c + ratio * sums[E]
        precision = square / noise_var + _LEVEL_STD**-2.0
        mean = (product / noise_var + _LEVEL_MEAN * _LEVEL_STD**-2.0) / precision
        at = np.clip(mean, _LEAST_LEVEL, C1_MAX)
        cost = sums[Z] + at * (at * square - 2.0 * product)
        return mean, 1.0 / np.sqrt(precision), np.maximum(cost, 0.0)

    def log_density(self, frame: _Frame, cells: Array, noise_var: float) -> tuple[Array, float]:
        """Log density at the middles of cells up to a constant, (n,), and σ² at its maximum.

        Args:
            frame: Parallelogram of the cells.
            cells: Middles of the cells in the unit square, shape (n, 2).
            noise_var: Variance of the adhesion noise.

        """
        middles = frame.points(cells)
        # A cell that the range cuts counts where it is within.
        places = _clip(middles)
        reach = np.abs(frame.edges).sum(axis=1) / np.sqrt(len(cells))
        within = (np.abs(middles - places) <= 0.5 * reach).all(axis=1)
        mean, std, cost = self.level(places, noise_var)
        c1 = np.clip(mean, _LEAST_LEVEL, C1_MAX)
        total = self.noise_freedom * self.noise_var + cost
        freedom = self.noise_freedom + self.sums[DOF]
        phi = np.column_stack([np.log(c1), places])
        log_m = -0.5 * freedom * np.log(total) + np.log(std / c1) + self.prior.log_density(phi)
        # The prior of c1 for the draws alone, where it holds c1 away from the best one.
        log_m -= 0.5 * ((mean - c1) / std) ** 2
        log_m = np.where(within, log_m, LOWEST)
        return log_m, float(total[int(np.argmax(log_m))] / freedom)


def propose(
    sums: Array, noise_var: float, noise_freedom: float, prior: Prior, size: int
) -> Proposal:
    """Draw curves near the posterior of a segment.

    Args:
        sums: Sums of the segment's samples, shape (LENGTH,).
        noise_var: Prior variance σ0² of the adhesion noise.
        noise_freedom: Its degrees of freedom.
        prior: Prior of the curve.
        size: Number of curves.

    """
    segment = _Segment(sums, noise_var, noise_freedom, prior)
    frame, found_var = _WHOLE, noise_var
    for _ in range(ZOOMS):
        # The noise is what the best cell of the grid before leaves.
        log_m, found_var = segment.log_density(frame, _COARSE_CELLS, found_var)
        top = log_m.max()
        if (log_m >= top - DEPTH).mean() >= RESOLVED:
            break
        nearest = np.quantile(log_m[log_m > LOWEST], 1.0 - NEAREST)
        frame = _closer(frame, log_m >= min(top - DEPTH, nearest))
    log_m, found_var = segment.log_density(frame, _FINE_CELLS, found_var)
    u, log_cells = _draw_from_cells(log_m, size)
    places = frame.points(u)
    mean, std, _ = segment.level(places, found_var)
    std = SPREAD * std
    step = scipy.special.ndtri(_quasi_random(size)[1])
    c1 = mean + std * step
    good = (c1 > 0.0) & (c1 < C1_MAX) & (places == _clip(places)).all(axis=1)
    log_c1 = np.log(np.where(good, c1, 1.0))
    log_density = log_cells - np.log(frame.area)
    log_density += -0.5 * step * step - np.log(std) - 0.5 * np.log(2 * np.pi) + log_c1
    # Those out of range have no weight; their numbers must be ones all the same.
    return Proposal(np.column_stack([log_c1, _clip(places)]), log_density, good)


def _closer(frame: _Frame, inside: NDArray[np.bool_]) -> _Frame:
    """Parallelogram about the cells that matter, along their principal axes."""
    u = _COARSE_CELLS[inside]
    middle = u.mean(axis=0)
    spread = (u - middle).T @ (u - middle) / len(u) + np.eye(2) / (12 * COARSE * COARSE)
    _, axes = np.linalg.eigh(spread)
    along = (u - middle) @ axes
    # A cell more on each side: between two middles the density may be higher.
    margin = 1.0 / COARSE
    low, high = along.min(axis=0) - margin, along.max(axis=0) + margin
    corner = middle + axes @ low
    return _Frame(frame.corner + frame.edges @ corner, frame.edges @ axes @ np.diag(high - low))


def _draw_from_cells(log_m: Array, size: int) -> tuple[Array, Array]:
    """Places in the unit square drawn by the cells, shape (n, 2), and their log density, (n,)."""
    mass = np.exp(TEMPER * (log_m - log_m.max())).reshape(FINE, FINE)
    mass = (1.0 - UNIFORM) * mass / mass.sum() + UNIFORM / mass.size
    rows = np.concatenate([[0.0], mass.sum(axis=1).cumsum()])
    edges = np.arange(FINE + 1) / FINE
    # Evenly along the first axis, in a low-discrepancy sequence along the second.
    first = np.interp((np.arange(size) + 0.5) / size * rows[-1], rows, edges)
    row = np.minimum((first * FINE).astype(np.int64), FINE - 1)
    within = np.concatenate([np.zeros((FINE, 1)), mass.cumsum(axis=1)], axis=1)
    within = within / within[:, -1:]
    share = _quasi_random(size)[0]
    column = np.minimum((within[row, 1:] < share[:, None]).sum(axis=1), FINE - 1)
    low, high = within[row, column], within[row, column + 1]
    second = (column + (share - low) / (high - low)) / FINE
    return np.column_stack([first, second]), np.log(mass[row, column] * mass.size)


def _quasi_random(size: int) -> tuple[Array, Array]:
    """Two-dimensional low-discrepancy sequence in 0..1 (the R2 sequence; Roberts 2018)."""
    k = np.arange(1, size + 1)
    steps = np.array([[0.7548776662466927], [0.5698402909980532]])
    first, second = (0.5 + k * steps) % 1.0
    return first, second
