"""Posterior of μ_max from the samples and the prior, integrated on a grid: no estimator is better.

The mean of ln μ_max has the least mean square error of all estimators that know the prior and the
noise but not which share of μ_max was used. With r = c2 e^(−s) the curve is c1 times
f = 1 − e^(−c2 λ) − r λ, so that J is a square in c1: (ln c2, ln s) stand on a grid that zooms in
and leans with the ridge of the density, c1 on the nodes of Gauss and Hermite about its
least-squares value. No code of the tracker's.
"""

from typing import NamedTuple

import numpy as np

from adhesion_can.estimation.tracker.prior import FREEDOM
from adhesion_can.estimation.tracker.settings import C1_MAX, C2_RANGE

SLIP_BINS = 400
"""Bins of the slips: the curve is straight within one."""
COARSE, FINE = 80, 240
"""Cells of the grid along each axis, while it zooms in and at last."""
DEPTH = 14.0
"""Log density below the largest one down to which the grid reaches."""
KEPT = 0.05
"""Depth of the cells that the next grid is laid about in any case, as a share of the median's: a
ridge that is thinner than a cell must not be cut off."""
ZOOMS = 16
SHAPES = (0.5, 60.0)
"""Range of s."""
_NODES, _WEIGHTS = np.polynomial.hermite_e.hermegauss(9)


class ExactPosterior(NamedTuple):
    """Posterior of ln μ_max.

    Attributes:
        mean: Mean of ln μ_max.
        std: Standard deviation of ln μ_max.
        share_below: Probability of a smaller μ_max than the true one.

    """

    mean: float
    std: float
    share_below: float


class _Sums(NamedTuple):
    """Samples by bins of their slip: mean slip, number, sum of the adhesion; shape (n,) each."""

    slip: np.ndarray
    count: np.ndarray
    adhesion: np.ndarray


def exact_posterior(slip, adhesion, noise_std, parts, largest_slip, truth):
    """Posterior of ln μ_max of one surface.

    Args:
        slip: Slips of the samples, at least 0, shape (n,).
        adhesion: Adhesion of the samples, shape (n,).
        noise_std: Standard deviation of its noise.
        parts: Weight, centre and scale of each component of the prior.
        largest_slip: Largest λ_m of a surface.
        truth: The true ln μ_max.

    """
    sums = _bin(slip, adhesion)
    data = sums, noise_std**2, parts, largest_slip
    frame = _Frame(np.log([C2_RANGE[0], SHAPES[0]]), np.log([C2_RANGE[1], SHAPES[1]]), 0.0)
    for _ in range(ZOOMS):
        places = frame.places(COARSE)
        log_density = _evaluate(*data, *places)[0].max(axis=0)
        top, known = log_density.max(), log_density[log_density > -np.inf]
        kept = log_density >= top - max(DEPTH, KEPT * (top - np.median(known)))
        closer = _closer(*places, kept, frame)
        done = np.prod(closer.high - closer.low) > 0.6 * np.prod(frame.high - frame.low)
        frame = closer
        if done:
            break
    log_density, log_peak = _evaluate(*data, *frame.places(FINE))
    weight = np.exp(log_density - log_density.max())
    weight /= weight.sum()
    mean = float((weight * log_peak).sum())
    std = float(np.sqrt((weight * (log_peak - mean) ** 2).sum()))
    return ExactPosterior(mean, std, float(weight[log_peak < truth].sum()))


def _bin(slip, adhesion):
    place = np.minimum((slip * (SLIP_BINS / slip.max())).astype(int), SLIP_BINS - 1)
    count = np.bincount(place, minlength=SLIP_BINS).astype(float)
    some = count > 0
    mean = np.bincount(place, slip, SLIP_BINS)[some] / count[some]
    return _Sums(mean, count[some], np.bincount(place, adhesion, SLIP_BINS)[some])


class _Frame(NamedTuple):
    """Parallelogram of (ln c2, ln s − lean · ln c2) from `low` to `high`."""

    low: np.ndarray
    high: np.ndarray
    lean: float

    def places(self, cells):
        """ln c2 and ln s of the middles of the cells, shape (cells, cells) each."""
        middle = (np.arange(cells) + 0.5) / cells
        x, y = (a + (b - a) * middle for a, b in zip(self.low, self.high, strict=True))
        return np.broadcast_to(x[:, None], (cells, cells)), y + self.lean * x[:, None]


def _closer(log_c2, log_s, kept, frame):
    """Frame about the cells that are kept, along their line of regression."""
    x, y = log_c2[kept], log_s[kept]
    step = (frame.high - frame.low) / COARSE
    lean = ((x - x.mean()) @ (y - y.mean())) / ((x - x.mean()) @ (x - x.mean()) + step[0] ** 2)
    level = y - lean * x
    wide = step[1] + abs(lean - frame.lean) * step[0]
    low = np.array([x.min() - 1.5 * step[0], level.min() - 1.5 * wide])
    high = np.array([x.max() + 1.5 * step[0], level.max() + 1.5 * wide])
    return _Frame(low, high, lean)


def _evaluate(sums, var, parts, largest_slip, log_c2, log_s):
    """Log density and ln μ_max at the nodes of c1 on the grid, shape (nodes, n, n) each."""
    h, count, z = sums
    c2, s = np.exp(log_c2), np.exp(log_s)
    rise = -np.expm1(-c2[:, :1] * h)
    ratio = c2 * np.exp(-s)
    square = ((rise * rise) @ count)[:, None] - 2.0 * ratio * (rise @ (count * h))[:, None]
    square += ratio * ratio * (count @ (h * h))
    product = (rise @ z)[:, None] - ratio * (h @ z)
    best, std = product / square, np.sqrt(var / square)
    c1 = best + std * _NODES[:, None, None]
    good = (c1 > 0.0) & (c1 < C1_MAX) & (s < largest_slip * c2)
    good &= (c2 >= C2_RANGE[0]) & (c2 <= C2_RANGE[1]) & (s >= SHAPES[0]) & (s <= SHAPES[1])
    log_c1 = np.log(np.where(good, c1, 1.0))
    phi = np.stack(np.broadcast_arrays(log_c1, log_c2, log_s), axis=-1)
    # J = −P²/Q + Q (c1 − P/Q)² + const; the nodes' weights carry the second term.
    log_density = 0.5 * product * product / square / var + np.log(std) - log_c1
    log_density = log_density + np.log(_WEIGHTS)[:, None, None] + _log_prior(phi, parts)
    log_peak = log_c1 + np.log(1.0 - np.exp(-s) * (1.0 + s))
    return np.where(good, log_density, -np.inf), np.broadcast_to(log_peak, log_density.shape)


def _log_prior(phi, parts):
    """Log density of the mixture of Student's t in (ln c1, ln c2, ln s), up to a constant."""
    logs = []
    for weight, centre, scale in parts:
        square = (((phi - centre) / scale) ** 2).sum(axis=-1)
        log_t = -0.5 * (FREEDOM + len(scale)) * np.log1p(square / FREEDOM)
        logs.append(np.log(weight) - np.log(scale).sum() + log_t)
    return np.logaddexp.reduce(logs, axis=0)
