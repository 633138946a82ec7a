"""Sums of the samples of an update: what `curve_sums` defines, weighted by their errors."""

from typing import NamedTuple

import numpy as np

from adhesion_can.arrays import Array
from adhesion_can.estimation.tracker.common_errors import common_errors
from adhesion_can.estimation.tracker.curve_sums import Points
from adhesion_can.estimation.tracker.layout import (
    BINS,
    C2_NODES,
    C2_SQUARES,
    CORRECTED,
    COUNT,
    DOF,
    HISTOGRAM,
    LENGTH,
    NODES,
    A,
    B,
    C,
    D,
    E,
    Z,
)
from adhesion_can.estimation.tracker.order_of_sums import sum_in_order

LARGEST_EXPONENT = 8.0
"""Largest exponent of e^(−c2 λ): a slip below zero is an error, which must not become 1e20."""
TOO_WIDE = 0.1
"""c2² p from which the private error is so wide that the correction of the sums is limited."""
_RATES: Array = np.concatenate([np.zeros(3), -C2_NODES])
"""Exponents per slip of the regressors 1, λ, μ and e^(−c2 λ): one exponential is of them all."""


def increment(
    points: Points,
    slope: Array,
    noise_var: float,
    slip_max: float,
    weight_slope: Array | None = None,
    curvature: Array | None = None,
    reached: Array | None = None,
) -> Array:
    """Sums of samples with corrected scores, and with the slips as measured; shape (2, LENGTH).

    Corrected scores remove the private errors. Without them these dilute the slope, and J is a sum
    of squares. Where slips have no private error, both are the same.

    Args:
        points: Samples on one branch.
        slope: Slope dμ/dλ of the current curve at the samples, shape (n,).
        noise_var: Variance σ² of the adhesion noise; J/DOF of the sums estimates it.
        slip_max: Upper end of the histogram of slip.
        weight_slope: Slope for the weight of the private error, from another source than the slip
            with the error, shape (n,): a weight correlated with the error biases the curve. None:
            `slope`.
        curvature: Curvature −d²μ/dλ² of the current curve at the samples, shape (n,), for the
            correlation of slope and private error; None: it is not corrected.
        reached: Slips that were surely reached, shape (n,); None: those of the points.

    """
    reached = points.surely_reached if reached is None else reached
    both = np.empty((2, LENGTH))
    places = (reached * (BINS / slip_max)).clip(0, BINS - 1).astype(np.int64)
    both[:, HISTOGRAM] = np.bincount(places, minlength=BINS)
    both[:, COUNT] = both[:, DOF] = len(reached)
    if points.exact:
        _add_up_exact(both, points)
        return both
    weight_slope = slope if weight_slope is None else weight_slope
    private_scatter = weight_slope * weight_slope * points.private_var
    weight = 1.0 / (1.0 + (private_scatter + points.transient_var) / noise_var)
    moments = _moments(points, slope, weight, noise_var, curvature)
    _assemble(both, moments, points.private_var)
    both[CORRECTED, DOF] -= sum_in_order(moments.precision * private_scatter) / noise_var
    return both


def _add_up_exact(both: Array, points: Points) -> None:
    """Write the sums of samples whose slips have no error."""
    h, z = points.slip, points.adhesion
    f1 = -np.expm1(-np.multiply.outer(h, C2_NODES))
    both[:, A] = np.einsum("ij,ij->j", f1, f1)
    both[:, B], both[:, C] = -(h @ f1), z @ f1
    both[:, D], both[:, E], both[:, Z] = h @ h, -(h @ z), z @ z


class _Moments(NamedTuple):
    """Sums of the samples times (1, λ, μ, e^(−c2 λ) at each node), with several weights.

    Attributes:
        precision: Diagonal of the inverse covariance, σ² being 1, shape (n,).
        kappa: What each of k common errors takes away from the square of its sums, shape (k,).
        single: Sums with the weight, with its products with λ and μ, and with `precision`, shape
            (4, 3 + NODES).
        squares: Sums of e^(−2 c2 λ) with the weight and with `precision`, shape (2, NODES).
        common: Sums with each common error, shape (k, 3 + NODES).
        curved: Sums with what the curvature adds to these, shape (k, 3 + NODES), or none.

    """

    precision: Array
    kappa: Array
    single: Array
    squares: Array
    common: Array
    curved: Array


def _moments(
    points: Points, slope: Array, weight: Array, noise_var: float, curvature: Array | None
) -> _Moments:
    """Sums of samples; `weight` is that beside their own errors, 1 without any, shape (n,)."""
    slip, adhesion = points.slip, points.adhesion
    error, var = common_errors(points, slope * slope * weight)
    in_group = error * (slope * weight)
    s2 = var / noise_var
    # The inverse of the covariance, by Sherman and Morrison.
    kappa = s2 / (1.0 + s2 * sum_in_order(in_group * error * slope))
    precision = weight - (kappa[:, None] * (in_group * in_group)).sum(axis=0)
    rows = [weight, weight * slip, weight * adhesion, precision, *in_group]
    if curvature is not None:
        rows += [*(error * (points.private_var * curvature * weight))]
    weights = np.array(rows)
    regressors = np.exp(np.minimum(slip[:, None] * _RATES, LARGEST_EXPONENT))
    regressors[:, 1], regressors[:, 2] = slip, adhesion
    # Along the samples, one after the other: the regressors are the fast axis.
    sums = (weights[:, :, None] * regressors).sum(axis=1)
    decay = regressors[:, 3:]
    squares = (weights[:4:3, :, None] * (decay * decay)).sum(axis=1)
    end = 4 + len(kappa)
    return _Moments(precision, kappa, sums[:4], squares, sums[4:end], sums[end:])


def _assemble(both: Array, moments: _Moments, private_var: Array) -> None:
    """Write A, B, C, D, E and Z of samples, of both kinds.

    Args:
        both: Vectors of sums to write to, shape (2, LENGTH).
        moments: Sums of the samples.
        private_var: Variance of the slips by the wheel speeds, shape (n,).

    """
    # By their factors: w weight, q precision, h slip, z adhesion, e = e^(−c2 λ).
    _, kappa, single, (wee, qee), common, curved = moments
    (weight, by_slip, by_adhesion, by_precision), (we, whe, wze, qe) = single[:, :3], single[:, 3:]
    # The samples' mean variance: one sensor, nearly one speed. That of the slips as measured is 0.
    private, corrected, shrink = np.zeros(2), np.zeros((2, NODES)), np.ones((2, NODES))
    private[CORRECTED] = p = float(sum_in_order(private_var)) / len(private_var)
    # Curves that bend within the error itself are corrected less: the series diverges there, and a
    # correction from few samples may exceed the sum.
    corrected[CORRECTED] = p / (1.0 + (p / TOO_WIDE) * C2_SQUARES)
    # e^(−c2 λ) has the expectation e^(−c2 λ) / shrink.
    shrink[CORRECTED] = np.exp(-0.5 * corrected[CORRECTED] * C2_SQUARES)
    square = shrink * shrink
    # Of the common errors: f1, f2 and the adhesion, of shapes (2, k, NODES), (2, k) and (k,).
    f1 = common[:, :1] - shrink[:, None] * common[:, 3:]
    f2 = np.array([common[:, 1], common[:, 1]])
    if len(curved):
        f1[CORRECTED] += curved[:, 3:] * (shrink[CORRECTED] * C2_NODES)
        f2[CORRECTED] += curved[:, 0]
    z = common[:, 2]
    kf2, kz = kappa * f2, kappa * z
    f1_f1 = (kappa[:, None] * (f1 * f1)).sum(axis=1)
    wee = square * wee + (square * (square - 1.0)) * qee
    whe = shrink * whe + (corrected * C2_NODES * shrink) * qe
    both[:, A] = weight[0] - 2.0 * (shrink * we) + wee - f1_f1
    both[:, B] = whe - weight[1] + (kf2[:, :, None] * f1).sum(axis=1)
    both[:, C] = weight[2] - shrink * wze - (kz[:, None] * f1).sum(axis=1)
    both[:, D] = by_slip[1] - sum_in_order(kf2 * f2) - private * by_precision[0]
    both[:, E] = sum_in_order(kz * f2) - by_slip[2]
    both[:, Z] = by_adhesion[2] - sum_in_order(kz * z)
