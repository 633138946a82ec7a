"""The posterior of a curve given the sums of a stretch: weighted curves, wide or narrow.

A set of curves is drawn once and then only weighted anew as sums grow: J of every curve is linear
in the sums. The draw is made of what is known exactly: ln c2 from its own marginal density, on a
grid that zooms in until it resolves it; then c3 and c1 from the normal density that they have given
c2, or, for some of the curves, c3 from the prior of the shape and c1 given both, which reaches
where the data leave c3 open. The weights take out whatever that misses, so neither many data nor
none, nor a prior of several humps, needs a case of its own.

The noise is unknown: with an inverse gamma prior it integrates to Student's t,
ln p(data | θ) = −(ν + n)/2 · ln(ν σ0² + J(θ)) + const.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import scipy
from numpy.typing import NDArray

from adhesion_can.arrays import Array
from adhesion_can.estimation.tracker import curve_sums as segments
from adhesion_can.estimation.tracker.curve_sums import DOF, X_RANGE, coefficients, interpolation
from adhesion_can.estimation.tracker.prior import C1_MAX, Prior, shape_coordinates
from adhesion_can.physics.burckhardt import peak

GRID = 48
DEPTH = 14.0
"""ln of the density below its maximum to which the grid over ln c2 reaches."""
ZOOMS = 8
FEWEST = 8
"""Fewer curves with a peak than these are no draw."""
FEWEST_SAMPLES = 1.0
"""Fewer samples leave the prior as it is."""
SPREAD = 1.3
"""Draws are spread so many times wider than the normal density: Student's tails, errors of J."""
FALL_TOLD = 3.0
"""c3 over its standard deviation from which the data tell the fall better than the prior does."""

_SURROGATE_MEAN, _SURROGATE_STD = np.array([0.35, 0.15]), np.array([0.5, 0.5])
"""Of (c1, c3), for the draw alone: it keeps it in bounds where the data say nothing."""


class Noise(NamedTuple):
    """What is known of the noise beforehand: σ² of the adhesion, and what that is worth.

    Attributes:
        var: σ0².
        freedom: ν, samples that the knowledge is worth.

    """

    var: float
    freedom: float

    def given(self, cost: float, dof: float) -> float:
        """σ² with the samples: (ν σ0² + J)/(ν + n)."""
        return (self.freedom * self.var + max(cost, 0.0)) / (self.freedom + dof)


@dataclass(frozen=True, slots=True)
class Curves:
    """Curves drawn for a posterior, to be weighted by sums.

    Attributes:
        theta: (c1, c2, c3), shape (n, 3).
        at_x: `interpolation` at their ln c2, shape (n, NODES).
        factors: `coefficients` of them, shape (5, n).
        log_base: ln of prior over density of the draw, shape (n,).
        mu_max: of each, within the model's range, shape (n,).
        lambda_m: likewise.
        peaks: (μ_m, λ_m, s = c2 λ_m) of each, wherever its peak lies, shape (3, n).
        order: of the curves by each of these, shape (3, n).

    """

    theta: Array
    at_x: Array
    factors: Array
    log_base: Array
    mu_max: Array
    lambda_m: Array
    peaks: Array
    order: NDArray[np.int64]

    def costs(self, sums: Array) -> Array:
        """J of each curve, shape (n,)."""
        return segments.costs(sums, self.at_x, self.factors)


def joined(parts: Sequence[Curves]) -> Curves:
    """Several draws as one; what they weigh in it is up to the caller."""

    def column(name: str, axis: int = 0) -> Array:
        return np.concatenate([getattr(part, name) for part in parts], axis=axis)

    peaks = column("peaks", axis=1)
    return Curves(
        column("theta"),
        column("at_x"),
        column("factors", axis=1),
        column("log_base"),
        column("mu_max"),
        column("lambda_m"),
        peaks,
        np.argsort(peaks, axis=1),
    )


def log_weights(log_base: Array, costs: Array, dof: float | Array, noise: Noise) -> Array:
    """Logarithm of the posterior weights of curves, not normalised.

    Args:
        log_base: of the curves, shape (.., n).
        costs: J of the curves, (.., n).
        dof: degrees of freedom of J, broadcast against it.
        noise: see there.

    """
    total = noise.freedom * noise.var + np.maximum(costs, 0.0)
    return np.asarray(log_base - 0.5 * (noise.freedom + dof) * np.log(total))


def normalised(log_weights: Array) -> Array:
    """Weights that add up to 1 along the last axis."""
    weights = np.exp(log_weights - log_weights.max(axis=-1, keepdims=True))
    return np.asarray(weights / weights.sum(axis=-1, keepdims=True))


def effective(weights: Array) -> float:
    """Number of curves that carry the weight, 1/Σ w²."""
    return float(1.0 / (weights @ weights))


def draw(sums: Array, noise: Noise, prior: Prior, slip_max: float, size: int) -> Curves:
    """Curves for the posterior of a stretch.

    Args:
        sums: of the stretch, shape (LENGTH,); zeros for none.
        noise: see there.
        prior: see there.
        slip_max: end of the model's range.
        size: number of curves, even.

    """
    if sums[DOF] < FEWEST_SAMPLES:
        return _of_the_prior(prior, slip_max, size)
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
        # Forces against the slip, say: no curve is near.
        return _of_the_prior(prior, slip_max, size)
    # From (ln c1, ln c2, ln s) to (c1, ln c2, c3): |d ln s/d c3| = 1/(s c3), d ln c1/d c1 = 1/c1.
    log_prior = prior.log_density(phi) - phi[:, 2] - np.log(c1 * c3)
    log_base = np.where(good, log_prior - log_q - log_q_rest, -np.inf)
    return _curves(theta, at_x, log_base, slip_max)


def _of_the_prior(prior: Prior, slip_max: float, size: int) -> Curves:
    """Curves of the prior itself, always the same ones."""
    theta = prior.sample(size, np.random.default_rng(size))
    return _curves(theta, interpolation(np.log(theta[:, 1])), np.zeros(size), slip_max)


def _curves(theta: Array, at_x: Array, log_base: Array, slip_max: float) -> Curves:
    c1, c2, c3 = theta.T
    top, s = peak(c1, c2, c3, slip_max), np.log(c1 * c2 / c3)
    peaks = np.stack([c1 * (1.0 - np.exp(-s) * (1.0 + s)), s / c2, s])
    return Curves(
        theta,
        at_x,
        coefficients(theta),
        log_base,
        top.mu_max,
        top.lambda_m,
        peaks,
        np.argsort(peaks, axis=1),
    )


def _normal_equations(sums: Array, w: Array, noise_var: float) -> tuple[Array, ...]:
    """Precision ((a, b), (b, d)) and right side (r1, r3) of (c1, c3) at each row of `w`."""
    a, b, c = (w @ sums[part] / noise_var for part in (segments.A, segments.B, segments.C))
    d, e = sums[segments.D] / noise_var, sums[segments.E] / noise_var
    p1, p3 = _SURROGATE_STD**-2.0
    m1, m3 = _SURROGATE_MEAN
    # Corrected scores may leave a sum of squares below zero where the slips say nothing of c2.
    return np.maximum(a, 0.0) + p1, b, max(d, 0.0) + p3, c + p1 * m1, e + p3 * m3


def _log_marginal(sums: Array, noise: Noise, prior: Prior, x: Array) -> tuple[Array, float]:
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
        cost = segments.costs(sums, w, coefficients(theta))
        total = noise.freedom * noise.var + np.maximum(cost, 0.0)
        log_m = -0.5 * (noise.freedom + sums[DOF]) * np.log(total) - 0.5 * np.log(det)
        # What a draw by the surrogate pays where c1 or c3 leave its bounds.
        away = (np.column_stack([c1, c3]) - _SURROGATE_MEAN) / _SURROGATE_STD
        log_m = log_m - 0.5 * np.einsum("ij,ij->i", away, away) + prior.log_marginal(1, x)
        best = int(np.argmax(log_m))
        noise_var = noise.given(float(cost[best]), float(sums[DOF]))
    return log_m, noise_var


def _draw_steepness(
    sums: Array, noise: Noise, prior: Prior, size: int
) -> tuple[Array, Array, float]:
    """Values of ln c2 at even shares of its marginal distribution, their log density, and σ²."""
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
    first, second = _points(len(c2))
    # Where the data tell the fall, few curves need to look for it elsewhere.
    every = 8 if float(np.median(m3 / std3)) > FALL_TOLD else 2
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
    # Density of the mixture of both ways, whichever way a curve came.
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
    a, b, c = (w @ sums[part] / noise_var for part in (segments.A, segments.B, segments.C))
    d, e = sums[segments.D] / noise_var, sums[segments.E] / noise_var
    p1 = _SURROGATE_STD[0] ** -2.0
    precision = np.maximum(a + 2 * ratio * b + ratio * ratio * d, 0.0) + p1
    mean = (c + ratio * e + p1 * _SURROGATE_MEAN[0]) / precision
    return SPREAD / np.sqrt(precision), mean


def _shape_quantile(prior: Prior, share: Array) -> Array:
    """Shape ln s of the prior at shares of its distribution: a logistic stands in for the t."""
    centre, spread = prior.shape_summary
    return np.asarray(centre + spread * np.log(share / (1.0 - share)))


def _log_shape(prior: Prior, log_s: Array) -> Array:
    """Log density of `_shape_quantile`'s draw."""
    centre, spread = prior.shape_summary
    u = np.abs(log_s - centre) / spread
    return np.asarray(-u - np.log(spread) - 2.0 * np.log1p(np.exp(-u)))


def _log_normal(value: Array, mean: Array, std: Array) -> Array:
    u = (value - mean) / std
    return np.asarray(-0.5 * u * u - np.log(std) - 0.5 * np.log(2 * np.pi))


def _points(size: int) -> tuple[Array, Array]:
    """Two even, unrelated sequences in 0..1 (Roberts' R2), always the same."""
    k = np.arange(1, size + 1)
    steps = np.array([[0.7548776662466927], [0.5698402909980532]])
    first, second = (0.5 + k * steps) % 1.0
    return first, second
