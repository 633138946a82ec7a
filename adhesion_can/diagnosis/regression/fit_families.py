"""Start curves of a family for every surface, and the Burckhardt curve nearest to a curve."""

import numpy as np
import scipy

from adhesion_can.arrays import Array
from adhesion_can.diagnosis.regression.model import RegressionData
from adhesion_can.diagnosis.regression.segment_curves import SegmentCurves
from adhesion_can.estimation.variable_projection import fit_least_squares
from adhesion_can.physics.burckhardt import SLIP_MAX, CurveParameters
from adhesion_can.physics.curves import Conditions, CurveFamily, bounds, within_bounds

MOST_ROWS, TRIED, STEPS = 1500, 3, 40
"""Rows to which a surface is thinned, starts that are refined, and evaluations of each."""
LEAST_ROWS = 10
"""Rows without which a surface gets the family's typical curve."""
NEAR = (0.1, 5.0)
"""Range of slip around the peak in which a Burckhardt curve is near another one, in λ_m."""
NEAR_POINTS = 60


def fit_family_curves(data: RegressionData, family: CurveFamily) -> SegmentCurves:
    """Curves of a family to start with: plain least squares on some rows of each surface."""
    names = ("slip", "adhesion", "speed", "load")
    slip, adhesion, speed, load = map(data.observed, names)
    known = np.concatenate([np.full(len(drive), drive.has_load) for drive in data.drives])
    conditions = Conditions(speed, np.where(known, load, np.nan))
    found = []
    for number in range(data.surfaces):
        rows = np.flatnonzero(data.surface == number)
        if len(rows) < LEAST_ROWS:
            found.append([p.typical for p in family.parameters])
            continue
        rows = rows[:: max(len(rows) // MOST_ROWS, 1)]
        found.append(_fit_points(family, slip[rows], adhesion[rows], conditions.select(rows)))
    return SegmentCurves.from_parameters(family, np.array(found, dtype=np.float64))


def _fit_points(
    family: CurveFamily, slip: Array, adhesion: Array, conditions: Conditions
) -> list[float]:
    """Values of a family's curve through points, by least squares from its best starts."""
    lower, upper = bounds(family)
    inside = 1e-9 * (upper - lower)

    def residual(values: Array) -> Array:
        return family.adhesion(slip, values, conditions) - adhesion

    def jacobian(values: Array) -> Array:
        return family.gradient(slip, values, conditions).T

    given = family.starts(slip, adhesion, conditions)
    starts = [np.array(within_bounds(family, start)) for start in given]
    starts.sort(key=lambda start: float(np.sum(residual(start) ** 2)))
    fits = [
        scipy.optimize.least_squares(
            residual,
            np.clip(start, lower + inside, upper - inside),
            jac=jacobian,
            bounds=(lower, upper),
            x_scale="jac",
            max_nfev=STEPS,
        )
        for start in starts[:TRIED]
    ]
    best = min(fits, key=lambda fit: float(fit.cost))
    return [float(value) for value in best.x]


def find_nearest_burckhardt(
    family: CurveFamily, values: Array, conditions: Conditions, slip_max: float = SLIP_MAX
) -> CurveParameters:
    """(c1, c2, c3) of the Burckhardt curve nearest to a curve, by least squares.

    It is a denominator, so it is near over a wide range; `physics.curves.nearest_burckhardt` meets
    the peak exactly and may reach zero within that range.

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
