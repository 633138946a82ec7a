"""Errors that the vehicle speed gives to the slips of all axles at once; `curve_sums` says why."""

import numpy as np

from adhesion_can.arrays import Array
from adhesion_can.estimation.tracker.curve_sums import (
    Points,
    curvature_at,
    residual_at,
    slope_at,
    slope_by_adhesion,
)
from adhesion_can.estimation.tracker.order_of_sums import sum_in_order
from adhesion_can.physics.burckhardt import CurveParameters


def common_errors(points: Points, weight: Array) -> tuple[Array, Array]:
    """Errors of the slips by the vehicle speed, each with its variance.

    Args:
        points: Samples on one branch.
        weight: Weight of each sample in the mean place of its group, shape (n,).

    Returns:
        Error of each slip by one unit of each of k errors, shape (k, n): those of the groups, then
        the changes across them; and their variances, shape (k,).

    """
    group, share = points.group, points.share
    first = np.ones(len(group), dtype=np.bool_)
    np.not_equal(group[1:], group[:-1], out=first[1:])
    starts, member = first.nonzero()[0], first.cumsum() - 1
    var = points.common_var[starts]
    inside = member == np.arange(len(starts))[:, None]
    level = inside * points.sign
    if share is None or share.max() == share.min():
        return level, var
    mean = inside * weight
    middle = sum_in_order(mean * share) / np.maximum(sum_in_order(mean), 1e-300)
    change = level * (share - middle[:, None])
    return np.concatenate([level, change]), np.concatenate([var, 2.0 * var])


def common_shift(points: Points, theta: CurveParameters, noise_var: float) -> Points:
    """Samples without the error of each vehicle speed, estimated from the current curve.

    A group's error e minimises Σ (z − μ(λ − e))²/(σ² + a² p) + e²/q (Gauss-Newton), and so does the
    change across the group. They only move the point of linearisation: with the slope a there and
    z − a e in place of z, `increment` counts e as unknown all the same.

    Args:
        points: Samples on one branch.
        theta: Parameters (c1, c2, c3) of the current curve.
        noise_var: Variance σ² of the adhesion noise.

    Returns:
        Samples with λ − e in place of λ.

    """
    h, _, p, _, further, *_ = points
    b = slope_by_adhesion(points, theta)
    weight = 1.0 / (noise_var + b * b * p + further)
    a = slope_at(points, theta)
    shape, var = common_errors(points, a * a * weight)
    var = np.maximum(var, 1e-30)
    error = np.zeros(len(var))
    moved = points
    for _ in range(2):
        a = slope_at(moved, theta)
        drift = 1.5 * a * curvature_at(points, a, theta) * p * weight
        pull = shape @ (a * weight * residual_at(moved, theta) - drift) + error / var
        error = error - pull / ((shape * shape) @ (a * a * weight) + 1.0 / var)
        error = np.clip(error, -3.0 * np.sqrt(var), 3.0 * np.sqrt(var))
        moved = points._replace(slip=h - error @ shape)
    return moved
