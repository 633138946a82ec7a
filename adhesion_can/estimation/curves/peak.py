"""Peaks of fitted curves and of curves on a grid, and the Burckhardt curve nearest to a curve."""

from math import inf, log, sqrt

import numpy as np

from adhesion_can.arrays import Array
from adhesion_can.estimation.variable_projection import fit_least_squares
from adhesion_can.physics.burckhardt import SLIP_MAX, CurveParameters, Peak
from adhesion_can.physics.curves import Conditions, CurveFamily

NEAR = (0.1, 5.0)
"""Range of slip around the peak in which a Burckhardt curve is near another one, in λ_m."""
NEAR_POINTS = 60


def peak_errors(
    family: CurveFamily, values: Array, conditions: Conditions, peak: Peak, covariance: Array
) -> tuple[float, float]:
    """Standard deviations of μ_max and λ_m by the delta method.

    At an interior peak dμ/dλ = 0: μ_max moves with the values as μ at λ_m does (envelope theorem),
    λ_m by the slope's change over its own derivative (implicit function theorem).
    """
    place = float(peak.lambda_m)
    if not place > 0.0:
        return inf, inf
    rows = family.gradient(place, values, conditions)
    mu_std = sqrt(max(float(rows @ covariance @ rows), 0.0))
    step = 1e-4 * place
    ends = np.array([place + step, place - step])
    slopes, gradients = (f(ends, values, conditions) for f in (family.slope, family.gradient))
    curvature = float(slopes[0] - slopes[1])
    if not peak.interior or not curvature < 0.0:
        return mu_std, inf
    move = (gradients[:, 0] - gradients[:, 1]) / curvature
    return mu_std, sqrt(max(float(move @ covariance @ move), 0.0))


def nearest_burckhardt(
    family: CurveFamily, values: Array, conditions: Conditions, slip_max: float = SLIP_MAX
) -> CurveParameters:
    """(c1, c2, c3) of the Burckhardt curve nearest to a curve, by least squares.

    It is a denominator, so it is near over a wide range; `burckhardt_with_same_peak`
    in `physics.curves` meets the peak exactly and may reach zero within that range.

    Args:
        family: Family of the curve.
        values: Values of the family's parameters.
        conditions: Speed and load.
        slip_max: Largest slip ratio of the model.

    """
    lambda_m = max(float(family.peak(values, conditions, slip_max).lambda_m), 1e-4)
    slip = np.linspace(NEAR[0] * lambda_m, min(NEAR[1] * lambda_m, slip_max), NEAR_POINTS)
    c1, c2, c3 = fit_least_squares(slip, family.adhesion(slip, values, conditions))
    return float(c1), float(c2), float(c3)


def find_top(grid: Array, curves: Array) -> Array:
    """Height, place and relative curvature of the largest value of curves; shape (3, ..).

    The curvature is −d² ln μ/d(ln λ)²; the place is that of the parabola through three points.

    Args:
        grid: Slip ratios, even in ln λ, shape (n,).
        curves: Adhesion on the grid, shape (.., n).

    """
    top = np.argmax(curves, axis=-1)
    step = log(grid[1] / grid[0])
    inner = np.clip(top, 1, len(grid) - 2)
    left, middle, right = (
        np.take_along_axis(curves, (inner + k)[..., None], axis=-1)[..., 0] for k in (-1, 0, 1)
    )
    second = (2.0 * middle - left - right) / step**2
    curvature = np.maximum(second / middle, 1e-3)
    interior = (inner == top) & (second > 0.0)
    shift = 0.5 * (right - left) / step / np.where(interior, second, 1.0)
    heights = np.take_along_axis(curves, top[..., None], axis=-1)[..., 0]
    return np.stack(
        [
            np.where(interior, middle + 0.5 * second * shift * shift, heights),
            np.where(interior, grid[inner] * np.exp(np.where(interior, shift, 0.0)), grid[top]),
            curvature,
        ]
    )
