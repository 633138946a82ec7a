"""Posterior of a curve given the sums of a segment, by importance sampling.

A set of curves is drawn once, and only weighted again as sums grow: J of every curve is linear in
the sums. The draws come from an approximation of the posterior on a grid (`proposal`). The
importance weights correct the rest, so that many data, few, and a multimodal prior need no case of
their own.

The noise variance is unknown. With an inverse gamma prior it integrates out to Student's t,
ln p(data | θ) = −(ν + n)/2 · ln(ν σ0² + J(θ)) + const.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
from math import hypot
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from adhesion_can.arrays import Array
from adhesion_can.estimation.tracker import curve_sums
from adhesion_can.estimation.tracker.curve_sums import coefficients, interpolation
from adhesion_can.estimation.tracker.layout import DOF
from adhesion_can.estimation.tracker.order_of_sums import sum_in_lanes
from adhesion_can.estimation.tracker.prior import Prior, from_shape_coordinates
from adhesion_can.estimation.tracker.proposal import propose
from adhesion_can.normal_quantiles import NORMAL_90
from adhesion_can.physics.burckhardt import peak
from adhesion_can.values import Value

FEWEST = 8
"""Least number of curves with a peak in a draw; with fewer the prior is drawn from."""
FEWEST_SAMPLES = 1.0
"""Least degrees of freedom for a draw from the posterior; with fewer the prior is drawn from."""
_FIRST, _SECOND = np.array([[0, 0, 0, 1, 1, 2, 3, 4], [0, 1, 2, 1, 2, 2, 3, 4]])
"""Pairs of the columns of curves whose covariances a summary has."""
_COVARIANCE = np.array([[0, 1, 2], [1, 3, 4], [2, 4, 5]])
"""Which of them stands where in the covariance of (c1, c2, c3)."""


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
class Curves(Value):
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
        columns: c1, c2, c3, `mu_max` and `lambda_m`, shape (5, n).

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
    columns: Array = field(init=False)

    def __post_init__(self) -> None:
        # Once here: an estimate at each update needs them.
        order = np.argsort(self.peaks, axis=1)
        limited = np.stack([self.mu_max, self.lambda_m])
        derived = {
            "order": order,
            "peaks_in_order": np.take_along_axis(self.peaks, order, axis=1),
            "limited_in_order": np.take_along_axis(limited, order[:2], axis=1),
            "columns": np.concatenate([self.theta.T, limited]),
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
    drawn = propose(sums, noise.var, noise.freedom, prior, size)
    if drawn.good.sum() < FEWEST:
        # No curve fits, as with forces against the slip.
        return _draw_from_prior(prior, slip_max, size)
    phi = drawn.phi
    log_base = np.where(drawn.good, prior.log_density(phi) - drawn.log_density, -np.inf)
    return _curves(from_shape_coordinates(phi), interpolation(phi[:, 1]), log_base, slip_max)


def _draw_from_prior(prior: Prior, slip_max: float, size: int) -> Curves:
    """Curves drawn from the prior, with a fixed seed."""
    theta = prior.sample(size, np.random.default_rng(size))
    return _curves(theta, interpolation(np.log(theta[:, 1])), np.zeros(size), slip_max)


def _curves(theta: Array, at_x: Array, log_base: Array, slip_max: float) -> Curves:
    c1, c2, c3 = theta.T
    top, s = peak(c1, c2, c3, slip_max), np.log(c1 * c2 / c3)
    peaks = np.stack([c1 * (1.0 - np.exp(-s) * (1.0 + s)), s / c2, s])
    return Curves(theta, at_x, coefficients(theta), log_base, top.mu_max, top.lambda_m, peaks)


def join_parts(parts: list[tuple[Curves, Array]]) -> tuple[Curves, Array]:
    """Curves of several distributions as one, with normalised weights."""
    weights = np.concatenate([weights for _, weights in parts])
    return join_curves([curves for curves, _ in parts]), weights / weights.sum()


def summarise(curves: Curves, weights: Array) -> "CurveSummary":
    """Summary of curves with normalised weights."""
    in_order = weights[curves.order]
    shares = np.add.accumulate(in_order, axis=1) - 0.5 * in_order
    mu_m, slip_m, shape = map(_value_at, [0.5] * 3, shares, curves.peaks_in_order)
    mu_max, lambda_m = map(_quantiles, shares[:2], curves.limited_in_order)
    mean = sum_in_lanes(weights * curves.columns)
    deviation = curves.columns - mean[:, None]
    weighted = weights * deviation
    products = np.empty((len(_FIRST) + 1, len(weights)))
    np.multiply(weighted[_FIRST], deviation[_SECOND], out=products[:-1])
    np.multiply(weights, weights, out=products[-1])
    sums = sum_in_lanes(products)
    mu_max_var, lambda_m_var, squares = sums[-3:].tolist()
    return CurveSummary(
        mu_m,
        slip_m,
        shape,
        mu_max,
        lambda_m,
        sums[_COVARIANCE],
        mean.item(2),
        mu_max_var,
        lambda_m_var,
        1.0 / squares,
    )


def _quantiles(shares: Array, values: Array) -> tuple[float, float, float]:
    """5, 50 and 95 % quantiles of values."""
    return (
        _value_at(0.05, shares, values),
        _value_at(0.5, shares, values),
        _value_at(0.95, shares, values),
    )


def _value_at(probability: float, shares: Array, values: Array) -> float:
    """Value at a probability, linear between the shares below the values, which ascend."""
    place = int(shares.searchsorted(probability, side="right")) - 1
    if place < 0 or place == len(values) - 1:
        return values.item(max(place, 0))
    begin, end = shares.item(place), shares.item(place + 1)
    low, high = values.item(place), values.item(place + 1)
    return (high - low) / (end - begin) * (probability - begin) + low


class CurveSummary(NamedTuple):
    """Weighted curves in a few numbers.

    Attributes:
        mu_m: Median of the peak's height μ_m.
        slip_m: Median of the peak's slip ratio, also beyond the range of slip.
        shape: Median of the shape s = c2 λ_m.
        mu_max: 5, 50 and 95 % quantiles of μ_max.
        lambda_m: 5, 50 and 95 % quantiles of λ_m.
        covariance: Covariance of (c1, c2, c3), shape (3, 3).
        fall: Mean of c3.
        mu_max_var: Variance of μ_max.
        lambda_m_var: Variance of λ_m.
        effective: Effective number of curves 1/Σ w² (Kish, "Survey Sampling", 1965).

    """

    mu_m: float
    slip_m: float
    shape: float
    mu_max: tuple[float, float, float]
    lambda_m: tuple[float, float, float]
    covariance: Array
    fall: float
    mu_max_var: float
    lambda_m_var: float
    effective: float


def widened_interval(
    quantiles: tuple[float, float, float], extra_std: float
) -> tuple[float, float]:
    """Interval from the 5 to the 95 % quantile, widened by an independent error."""
    low, middle, high = quantiles
    more = NORMAL_90 * extra_std
    return middle - hypot(middle - low, more), middle + hypot(high - middle, more)
