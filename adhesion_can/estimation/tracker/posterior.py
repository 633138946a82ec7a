"""Posterior of a curve given the sums of a segment, by importance sampling.

A set of curves is drawn once, and only weighted anew as sums grow: J of every curve is linear in
the sums. The draws are Rao-Blackwellised: ln c2 comes from its marginal density, on a grid that
zooms in until it resolves it; c3 and c1 then come from their normal density given c2. For some of
the curves c3 comes from the prior of the shape, and c1 from its density given both, which covers
data that leave c3 open. The importance weights correct the rest, so that many data, none, and a
multimodal prior need no case of their own.

The noise variance is unknown. With an inverse gamma prior it integrates out to Student's t,
ln p(data | θ) = −(ν + n)/2 · ln(ν σ0² + J(θ)) + const.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
from math import hypot
from typing import NamedTuple

import numpy as np
import scipy
from numpy.typing import NDArray

from adhesion_can.arrays import Array
from adhesion_can.estimation.tracker import curve_sums
from adhesion_can.estimation.tracker.curve_sums import DOF, X_RANGE, coefficients, interpolation
from adhesion_can.estimation.tracker.prior import Prior, shape_coordinates
from adhesion_can.estimation.tracker.settings import C1_MAX
from adhesion_can.physics.burckhardt import peak

GRID = 48
"""Number of cells of the grid over ln c2."""
DEPTH = 14.0
"""Log density below its maximum down to which the grid over ln c2 reaches."""
ZOOMS = 8
"""Largest number of grids, each over the part of the last one that matters."""
FEWEST = 8
"""Least number of curves with a peak in a draw; with fewer the prior is drawn from."""
FEWEST_SAMPLES = 1.0
"""Least degrees of freedom for a draw from the posterior; with fewer the prior is drawn from."""
SPREAD = 1.3
"""Factor on the standard deviations of the draws, for Student's tails and errors of J."""
FALL_DETERMINED = 3.0
"""c3 over its standard deviation from which the data determine it better than the prior."""
SHARES = (0.05, 0.5, 0.95)
"""Probabilities of the quantiles of an interval."""

_SURROGATE_MEAN, _SURROGATE_STD = np.array([0.35, 0.15]), np.array([0.5, 0.5])
"""Normal prior of (c1, c3) for the draws alone; it bounds them where data are uninformative."""


class NoisePrior(NamedTuple):
    """Inverse gamma prior of the variance of the adhesion noise.

    Attributes:
        var: Prior variance σ0², 1.
        freedom: Degrees of freedom ν, the number of samples that the prior is worth.

    """

    var: float
    freedom: float

    def posterior_var(self, cost: float, dof: float) -> float:
        """Noise variance σ² given samples, (ν σ0² + J)/(ν + n)."""
        return (self.freedom * self.var + max(cost, 0.0)) / (self.freedom + dof)


@dataclass(frozen=True, slots=True)
class Curves:
    """Curves drawn for a posterior, to be weighted by sums.

    Attributes:
        theta: Parameters (c1, c2, c3), shape (n, 3).
        at_x: Interpolation matrix at the curves' ln c2, shape (n, NODES).
        factors: Coefficients of the sums in the curves' J, shape (5, n).
        log_base: Log of prior density over density of the draw, shape (n,).
        mu_max: Largest adhesion within the model's range of slip, 1, shape (n,).
        lambda_m: Slip ratio of the largest adhesion, shape (n,).
        peaks: (μ_m, λ_m, s = c2 λ_m) of the peak, also beyond the range of slip, shape (3, n).
        order: Indices that sort the curves by each row of `peaks`, shape (3, n).
        peaks_in_order: Rows of `peaks`, each in its order, shape (3, n).
        limited_in_order: `mu_max` and `lambda_m` in the orders of μ_m and λ_m, shape (2, n).
        values: c1, c2, c3, `mu_max` and `lambda_m`, shape (n, 5).

    """

    theta: Array
    at_x: Array
    factors: Array
    log_base: Array
    mu_max: Array
    lambda_m: Array
    peaks: Array
    order: NDArray[np.int64] = field(init=False)
    peaks_in_order: Array = field(init=False)
    limited_in_order: Array = field(init=False)
    values: Array = field(init=False)

    def __post_init__(self) -> None:
        # Once here: an estimate at each update needs them.
        order = np.argsort(self.peaks, axis=1)
        limited = np.stack([self.mu_max, self.lambda_m])
        derived = {
            "order": order,
            "peaks_in_order": np.take_along_axis(self.peaks, order, axis=1),
            "limited_in_order": np.take_along_axis(limited, order[:2], axis=1),
            "values": np.column_stack([self.theta, *limited]),
        }
        for name, value in derived.items():
            object.__setattr__(self, name, value)

    def costs(self, sums: Array) -> Array:
        """Sum of squares J of each curve, shape (n,)."""
        return curve_sums.costs(sums, self.at_x, self.factors)


def join_curves(parts: Sequence[Curves]) -> Curves:
    """Several draws as one, without their weights."""

    def column(name: str, axis: int = 0) -> Array:
        return np.concatenate([getattr(part, name) for part in parts], axis=axis)

    return Curves(
        column("theta"),
        column("at_x"),
        column("factors", axis=1),
        column("log_base"),
        column("mu_max"),
        column("lambda_m"),
        column("peaks", axis=1),
    )


def log_weights(log_base: Array, costs: Array, dof: float | Array, noise: NoisePrior) -> Array:
    """Logarithm of the posterior weights of curves, not normalised.

    Args:
        log_base: Log of prior density over density of the draw, shape (.., n).
        costs: Sums of squares J of the curves, shape (.., n).
        dof: Degrees of freedom of J, broadcast against it.
        noise: Prior of the noise variance.

    """
    total = noise.freedom * noise.var + np.maximum(costs, 0.0)
    return np.asarray(log_base - 0.5 * (noise.freedom + dof) * np.log(total))


def normalise(log_weights: Array) -> Array:
    """Weights that add up to 1 along the last axis."""
    weights = np.exp(log_weights - log_weights.max(axis=-1, keepdims=True))
    return np.asarray(weights / weights.sum(axis=-1, keepdims=True))


def effective_size(weights: Array) -> float:
    """Effective sample size 1/Σ w² (Kish, "Survey Sampling", 1965)."""
    return float(1.0 / (weights @ weights))


def draw(sums: Array, noise: NoisePrior, prior: Prior, slip_max: float, size: int) -> Curves:
    """Curves for the posterior of a segment.

    Args:
        sums: Sums of the segment's samples, shape (LENGTH,); zeros without samples.
        noise: Prior of the noise variance.
        prior: Prior of the curve.
        slip_max: Largest slip ratio of the model.
        size: Number of curves, even.

    """
    if sums[DOF] < FEWEST_SAMPLES:
        return _draw_from_prior(prior, slip_max, size)
    x, log_q, noise_var = _draw_steepness(sums, noise, prior, size)
    at_x = interpolation(x)
    c2 = np.exp(x)
    c1, c3, log_q_rest = _draw_level_and_fall(sums, noise_var, prior, at_x, c2)
    good = (c1 > 0) & (c1 < C1_MAX) & (c3 > 0) & (c1 * c2 > c3)
    c1, c3 = np.where(good, c1, 1.0), np.where(good, c3, 0.5)
    theta = np.column_stack([c1, c2, c3])
    phi = shape_coordinates(theta)
    good &= np.isfinite(phi).all(axis=1)
    phi = np.where(good[:, None], phi, 0.0)
    if good.sum() < FEWEST:
        # No curve fits, as with forces against the slip.
        return _draw_from_prior(prior, slip_max, size)
    # From (ln c1, ln c2, ln s) to (c1, ln c2, c3): |d ln s/d c3| = 1/(s c3), d ln c1/d c1 = 1/c1.
    log_prior = prior.log_density(phi) - phi[:, 2] - np.log(c1 * c3)
    log_base = np.where(good, log_prior - log_q - log_q_rest, -np.inf)
    return _curves(theta, at_x, log_base, slip_max)


def _draw_from_prior(prior: Prior, slip_max: float, size: int) -> Curves:
    """Curves drawn from the prior, with a fixed seed."""
    theta = prior.sample(size, np.random.default_rng(size))
    return _curves(theta, interpolation(np.log(theta[:, 1])), np.zeros(size), slip_max)


def _curves(theta: Array, at_x: Array, log_base: Array, slip_max: float) -> Curves:
    c1, c2, c3 = theta.T
    top, s = peak(c1, c2, c3, slip_max), np.log(c1 * c2 / c3)
    peaks = np.stack([c1 * (1.0 - np.exp(-s) * (1.0 + s)), s / c2, s])
    return Curves(theta, at_x, coefficients(theta), log_base, top.mu_max, top.lambda_m, peaks)


def _normal_equations(sums: Array, w: Array, noise_var: float) -> tuple[Array, ...]:
    """Precision ((a, b), (b, d)) and right side (r1, r3) of (c1, c3) at each row of `w`."""
    a, b, c = (w @ sums[part] / noise_var for part in (curve_sums.A, curve_sums.B, curve_sums.C))
    d, e = sums[curve_sums.D] / noise_var, sums[curve_sums.E] / noise_var
    p1, p3 = _SURROGATE_STD**-2.0
    m1, m3 = _SURROGATE_MEAN
    # Corrected scores may leave a sum of squares below zero where the slips do not determine c2.
    return np.maximum(a, 0.0) + p1, b, max(d, 0.0) + p3, c + p1 * m1, e + p3 * m3


def _log_marginal(sums: Array, noise: NoisePrior, prior: Prior, x: Array) -> tuple[Array, float]:
    """Log density of ln c2 up to a constant, and σ² at its maximum."""
    w = interpolation(x)
    noise_var = noise.var
    log_m = np.zeros(len(x))
    for _ in range(2):  # the second time with the noise that the first one found
        a, b, d, r1, r3 = _normal_equations(sums, w, noise_var)
        det = np.maximum(a * d - b * b, 1e-9 * a * d)
        c1, c3 = (d * r1 - b * r3) / det, np.maximum((a * r3 - b * r1) / det, 0.0)
        c1 = np.where(c3 > 0, c1, r1 / a)
        theta = np.column_stack([c1, np.exp(x), c3])
        cost = curve_sums.costs(sums, w, coefficients(theta))
        total = noise.freedom * noise.var + np.maximum(cost, 0.0)
        log_m = -0.5 * (noise.freedom + sums[DOF]) * np.log(total) - 0.5 * np.log(det)
        # Surrogate prior of the draw, where c1 or c3 leave its bounds.
        away = (np.column_stack([c1, c3]) - _SURROGATE_MEAN) / _SURROGATE_STD
        log_m = log_m - 0.5 * np.einsum("ij,ij->i", away, away) + prior.log_marginal(1, x)
        best = int(np.argmax(log_m))
        noise_var = noise.posterior_var(float(cost[best]), float(sums[DOF]))
    return log_m, noise_var


def _draw_steepness(
    sums: Array, noise: NoisePrior, prior: Prior, size: int
) -> tuple[Array, Array, float]:
    """Quantiles of ln c2 at even probabilities, their log density, and σ²."""
    low, high = X_RANGE
    for zoom in range(ZOOMS):
        edges = np.linspace(low, high, GRID + 1)
        centres = 0.5 * (edges[1:] + edges[:-1])
        log_m, noise_var = _log_marginal(sums, noise, prior, centres)
        inside = np.flatnonzero(log_m >= log_m.max() - DEPTH)
        if inside[-1] - inside[0] >= GRID // 3 or zoom == ZOOMS - 1:
            break
        step = edges[1] - edges[0]
        low = max(edges[inside[0]] - step, X_RANGE[0])
        high = min(edges[inside[-1] + 1] + step, X_RANGE[1])
    # Tempered, with a uniform part, so that the importance weights stay bounded (defensive mixture;
    # Hesterberg, Technometrics 37, 1995).
    mass = np.exp(0.8 * (log_m - log_m.max()))
    mass = 0.9 * mass / mass.sum() + 0.1 / GRID
    cumulative = np.concatenate([[0.0], np.cumsum(mass)])
    share = (np.arange(size) + 0.5) / size * cumulative[-1]
    x = np.interp(share, cumulative, edges)
    cell = np.clip(np.searchsorted(edges, x, side="right") - 1, 0, GRID - 1)
    return x, np.log(mass[cell] / (edges[1] - edges[0])), noise_var


def _draw_level_and_fall(
    sums: Array, noise_var: float, prior: Prior, w: Array, c2: Array
) -> tuple[Array, Array, Array]:
    """c1 and c3 given c2 = exp(x), and the log density of that draw; each of shape (n,)."""
    a, b, d, r1, r3 = _normal_equations(sums, w, noise_var)
    det = np.maximum(a * d - b * b, 1e-9 * a * d)
    m1, m3 = (d * r1 - b * r3) / det, (a * r3 - b * r1) / det
    std3 = SPREAD * np.sqrt(a / det)
    std1 = SPREAD / np.sqrt(a)
    first, second = _quasi_random(len(c2))
    # Where the data determine the fall, few curves need the prior of the shape.
    every = 8 if float(np.median(m3 / std3)) > FALL_DETERMINED else 2
    by_shape = np.arange(len(c2)) % every == 0
    # Normal density cut off at c3 = 0.
    floor = scipy.special.ndtr(-m3 / std3)
    c3_free = m3 + std3 * scipy.special.ndtri(
        np.clip(floor + (1 - floor) * first, 1e-300, 1 - 1e-16)
    )
    c3_free = np.maximum(np.where(np.isfinite(c3_free), c3_free, 0.0), 1e-12)
    c1_free = m1 - b / a * (c3_free - m3) + std1 * scipy.special.ndtri(second)
    ratio = c2 * np.exp(-np.exp(_shape_quantile(prior, first)))
    std_shaped, mean_shaped = _level_given_ratio(sums, noise_var, w, ratio)
    c1_shaped = mean_shaped + std_shaped * scipy.special.ndtri(second)
    c1 = np.where(by_shape, c1_shaped, c1_free)
    c3 = np.where(by_shape, np.maximum(c1_shaped, 1e-12) * ratio, c3_free)
    # Density of the mixture of both proposals, whichever a curve came from.
    log_free = _log_normal(c3, m3, std3) - scipy.special.log_ndtr(m3 / std3)
    log_free += _log_normal(c1, m1 - b / a * (c3 - m3), std1)
    peaked = (c1 > 0) & (c3 > 0) & (c1 * c2 > c3)
    ratio = np.where(peaked, c3 / np.where(peaked, c1, 1.0), 1e-3)
    log_s = np.log(np.maximum(np.log(c2 / ratio), 1e-9))
    std_shaped, mean_shaped = _level_given_ratio(sums, noise_var, w, ratio)
    log_shaped = _log_normal(c1, mean_shaped, std_shaped) + _log_shape(prior, log_s)
    log_shaped -= log_s + np.log(np.maximum(c3, 1e-12))
    share = 1.0 / every
    return c1, c3, np.logaddexp(np.log1p(-share) + log_free, np.log(share) + log_shaped)


def _level_given_ratio(
    sums: Array, noise_var: float, w: Array, ratio: Array
) -> tuple[Array, Array]:
    """Standard deviation and mean of c1 where c3 = ratio · c1."""
    a, b, c = (w @ sums[part] / noise_var for part in (curve_sums.A, curve_sums.B, curve_sums.C))
    d, e = sums[curve_sums.D] / noise_var, sums[curve_sums.E] / noise_var
    p1 = _SURROGATE_STD[0] ** -2.0
    precision = np.maximum(a + 2 * ratio * b + ratio * ratio * d, 0.0) + p1
    mean = (c + ratio * e + p1 * _SURROGATE_MEAN[0]) / precision
    return SPREAD / np.sqrt(precision), mean


def _shape_quantile(prior: Prior, share: Array) -> Array:
    """Quantiles of ln s by the prior, with a logistic in place of the t distribution."""
    centre, spread = prior.shape_summary
    return np.asarray(centre + spread * np.log(share / (1.0 - share)))


def _log_shape(prior: Prior, log_s: Array) -> Array:
    """Log density of the ln s that `_shape_quantile` gives."""
    centre, spread = prior.shape_summary
    u = np.abs(log_s - centre) / spread
    return np.asarray(-u - np.log(spread) - 2.0 * np.log1p(np.exp(-u)))


def _log_normal(value: Array, mean: Array, std: Array) -> Array:
    u = (value - mean) / std
    return np.asarray(-0.5 * u * u - np.log(std) - 0.5 * np.log(2 * np.pi))


def _quasi_random(size: int) -> tuple[Array, Array]:
    """Two-dimensional low-discrepancy sequence in 0..1 (the R2 sequence; Roberts 2018)."""
    k = np.arange(1, size + 1)
    steps = np.array([[0.7548776662466927], [0.5698402909980532]])
    first, second = (0.5 + k * steps) % 1.0
    return first, second


def join_parts(parts: list[tuple[Curves, Array]]) -> tuple[Curves, Array]:
    """Curves of several distributions as one, with normalised weights."""
    weights = np.concatenate([weights for _, weights in parts])
    return join_curves([curves for curves, _ in parts]), weights / weights.sum()


def shares_below(curves: Curves, weights: Array) -> Array:
    """Cumulative weight at each curve in the three orders, shape (3, n)."""
    in_order = weights[curves.order]
    return np.asarray(in_order.cumsum(axis=1) - 0.5 * in_order)


def compute_moments(curves: Curves, weights: Array) -> tuple[Array, Array]:
    """Mean and covariance of `Curves.values` with normalised weights, shapes (5,) and (5, 5)."""
    mean = weights @ curves.values
    deviation = curves.values - mean
    return mean, (deviation * weights[:, None]).T @ deviation


def widened_interval(in_order: Array, share_below: Array, extra_std: float) -> tuple[float, float]:
    """Interval from the 5 to the 95 % quantile, widened by an independent error."""
    low, middle, high = np.interp(SHARES, share_below, in_order)
    more = 1.645 * extra_std
    return float(middle - hypot(middle - low, more)), float(middle + hypot(high - middle, more))
