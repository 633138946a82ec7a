"""Least-squares fit of a curve of any family, with the peak and its standard deviation.

Errors of the slip count by their effective variance: a point weighs 1/(σ² + (dμ/dλ)² var(λ)), with
slope and σ from the fit before (J. Orear, "Least squares when both variables have uncertainties",
Am. J. Phys. 50 (1982) 912). The covariance is that of generalised least squares for errors that are
correlated over a short time: (J'WJ)⁻¹ times the long-run variance of the residuals.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from adhesion_can.arrays import Array
from adhesion_can.estimation.curves.gauss_newton import NormalEquations, minimise, normal_equations
from adhesion_can.estimation.curves.peak import peak_errors
from adhesion_can.estimation.curves.points import CurvePoints, correlation_factor
from adhesion_can.physics.burckhardt import SLIP_MAX
from adhesion_can.physics.curves import Conditions, CurveFamily, bounds
from adhesion_can.physics.samples import Samples

REWEIGHTINGS = 3
"""Fits with weights from the one before; the variances settle within them."""
LEAST_NOISE = 0.05
"""Least share of the residual variance that counts as noise of the adhesion."""
AT_BOUND = 1e-6
"""Distance from a bound, as a share of the range, at which a value counts as fixed there."""


@dataclass(frozen=True, slots=True)
class FittedCurve:
    """Curve of one family, fitted to samples.

    Attributes:
        family: Family of the curve.
        values: Values of the family's parameters.
        covariance: Covariance of the values, shape (k, k); 0 for a value at its bound.
        noise_std: Standard deviation of the measured adhesion about the curve.
        rmse: Root mean square of the residuals, errors of the slip included.
        conditions: Speed and load at which the peak is given: the samples' means.
        mu_max: Adhesion at the peak.
        mu_max_std: Standard deviation of μ_max; inf where unknown.
        lambda_m: Slip ratio of the peak.
        lambda_m_std: Standard deviation of λ_m; inf where the curve has no peak in its range.
        interior: Whether the curve has its peak within the range of slip.

    """

    family: CurveFamily
    values: tuple[float, ...]
    covariance: Array
    noise_std: float
    rmse: float
    conditions: Conditions
    mu_max: float
    mu_max_std: float
    lambda_m: float
    lambda_m_std: float
    interior: bool

    def to_dict(self) -> dict[str, Any]:
        """Values and peak as JSON has them; the standard deviation of what is unknown is None."""
        stds = np.sqrt(np.maximum(self.covariance.diagonal(), 0.0))
        return {
            "parameters": {
                p.name: {"value": value, "std": _number(std), "unit": p.unit}
                for p, value, std in zip(self.family.parameters, self.values, stds, strict=True)
            },
            "rmse": self.rmse,
            "noise_std": self.noise_std,
            "mu_max": {"value": self.mu_max, "std": _number(self.mu_max_std)},
            "lambda_m": {"value": self.lambda_m, "std": _number(self.lambda_m_std)},
        }


def _number(std: float) -> float | None:
    return float(std) if np.isfinite(std) else None


def fit_family(
    samples: Samples, family: CurveFamily, *, slip_max: float = SLIP_MAX, independent: bool = False
) -> FittedCurve:
    """Fit a curve of a family to samples.

    Args:
        samples: Samples in the order of their stamps, finite, at least as many as the family has
            parameters.
        family: Family of the curve.
        slip_max: End of the range in which the peak is looked for, slip ratio.
        independent: Whether the errors of the samples are independent of each other.

    """
    every = CurvePoints.from_samples(samples)
    points = every.compressed()
    values, noise_var = fit_values(points, family)
    residual = standardised_residual(every, family, values, noise_var)
    factor = 1.0 if independent else correlation_factor(residual, samples)
    covariance = factor * _covariance(points, family, values, noise_var)
    conditions = mean_conditions(every)
    peak = family.peak(values, conditions, slip_max)
    mu_std, lambda_std = peak_errors(family, values, conditions, peak, covariance)
    squares = (every.adhesion - family.adhesion(every.slip, values, every.conditions)) ** 2
    return FittedCurve(
        family=family,
        values=tuple(map(float, values)),
        covariance=covariance,
        noise_std=float(np.sqrt(noise_var)),
        rmse=float(np.sqrt(squares.mean())),
        conditions=conditions,
        mu_max=float(peak.mu_max),
        mu_max_std=mu_std,
        lambda_m=float(peak.lambda_m),
        lambda_m_std=lambda_std,
        interior=bool(peak.interior),
    )


def fit_values(
    points: CurvePoints, family: CurveFamily, starts: Sequence[Sequence[float]] | None = None
) -> tuple[Array, float]:
    """Values of the best curve of a family, shape (k,), and the variance σ² of the adhesion.

    Args:
        points: Points to fit, at least one.
        family: Family of the curve.
        starts: Starting values; None: those that the family finds.

    """
    if starts is None:
        starts = family.starts(points.slip, points.adhesion, points.conditions)
    weights = points.count
    tried = [_minimise(points, family, weights, np.array(start)) for start in starts]
    values, _ = min(tried, key=lambda attempt: attempt[1])
    noise_var = noise_variance(points, family, values)
    if points.slip_var.any():
        for _ in range(REWEIGHTINGS):
            weights = points.count / effective_variance(points, family, values, noise_var)
            values, _ = _minimise(points, family, weights, values)
            noise_var = noise_variance(points, family, values)
    lower, upper = bounds(family)
    near = AT_BOUND * (upper - lower)
    values = np.where(values < lower + near, lower, np.where(values > upper - near, upper, values))
    return values, noise_var


def _minimise(
    points: CurvePoints, family: CurveFamily, weights: Array, start: Array
) -> tuple[Array, float]:
    """Values of least weighted squares from a start, and their cost."""

    def evaluate(values: Array) -> NormalEquations:
        residual = points.adhesion - family.adhesion(points.slip, values, points.conditions)
        gradient = family.gradient(points.slip, values, points.conditions)
        return normal_equations(residual, gradient, weights)

    values, best = minimise(evaluate, start, bounds(family), steps=150, converged=1e-9)
    return values, best.cost


def mean_square_residual(points: CurvePoints, family: CurveFamily, values: Array) -> Array:
    """Mean square of the samples' residuals in each point, shape (n,)."""
    curve = family.adhesion(points.slip, values, points.conditions)
    return np.asarray(np.maximum(points.square + curve * (curve - 2.0 * points.adhesion), 0.0))


def effective_variance(
    points: CurvePoints, family: CurveFamily, values: Array, noise_var: float
) -> Array:
    """Effective variance of a sample in each point, shape (n,)."""
    slope = family.slope(points.slip, values, points.conditions)
    return np.asarray(noise_var + slope**2 * points.slip_var)


def noise_variance(points: CurvePoints, family: CurveFamily, values: Array) -> float:
    """Variance of the adhesion about a curve: what errors of the slip leave of the residuals'.

    Args:
        points: Points, at least one.
        family: Family of the curve.
        values: Values of its parameters, shape (k,).

    """
    squares = mean_square_residual(points, family, values)
    by_slip = effective_variance(points, family, values, 0.0)
    samples = float(points.count.sum())
    freedom = max(samples - len(values), 1.0) / samples
    whole = float(points.count @ squares) / samples / freedom
    # Points on the steep part say little of σ, so each weighs by the inverse of its variance.
    share = points.count / np.maximum(by_slip + LEAST_NOISE * whole, 1e-30)
    left = float(share @ (squares / freedom - by_slip)) / float(share.sum())
    return max(left, LEAST_NOISE * whole, 1e-18)


def standardised_residual(
    points: CurvePoints, family: CurveFamily, values: Array, noise_var: float
) -> Array:
    """Residuals over their standard deviations, shape (n,)."""
    curve = family.adhesion(points.slip, values, points.conditions)
    spread = np.sqrt(effective_variance(points, family, values, noise_var))
    return np.asarray((points.adhesion - curve) / spread)


def log_density(points: CurvePoints, family: CurveFamily, values: Array, noise_var: float) -> Array:
    """Logarithm of the normal density of the adhesion of each sample, shape (n,)."""
    variance = effective_variance(points, family, values, noise_var)
    squares = mean_square_residual(points, family, values)
    return np.asarray(-0.5 * (np.log(2.0 * np.pi * variance) + squares / variance))


def mean_conditions(points: CurvePoints) -> Conditions:
    """Mean speed and load of all samples; the load is NaN where it is unknown."""
    total = float(points.count.sum())
    speed = float(points.count @ np.asarray(points.conditions.speed)) / total
    return Conditions(speed, float(points.count @ np.asarray(points.conditions.load)) / total)


def _covariance(points: CurvePoints, family: CurveFamily, values: Array, noise_var: float) -> Array:
    """Inverse Fisher information of the values that are not at a bound, shape (k, k)."""
    weights = points.count / effective_variance(points, family, values, noise_var)
    gradient = family.gradient(points.slip, values, points.conditions)
    lower, upper = bounds(family)
    norms = np.sqrt((gradient**2 * weights).sum(axis=1))
    free = (values > lower) & (values < upper) & (norms > 0.0)
    scaled = gradient[free] / norms[free, None]
    eigenvalues, vectors = np.linalg.eigh((scaled * weights) @ scaled.T)
    # What the points hardly determine keeps a large variance and not an infinite one.
    inverse = (vectors / np.maximum(eigenvalues, 1e-10)) @ vectors.T
    covariance = np.zeros((len(values), len(values)))
    covariance[np.ix_(free, free)] = inverse / np.outer(norms[free], norms[free])
    return covariance
