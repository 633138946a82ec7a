"""Start curves of a family for every surface."""

import numpy as np

from adhesion_can.diagnosis.regression.model import RegressionData
from adhesion_can.diagnosis.regression.segment_curves import SegmentCurves
from adhesion_can.estimation.curves.fit import fit_values
from adhesion_can.estimation.curves.points import CurvePoints
from adhesion_can.physics.curves import Conditions, CurveFamily

MOST_ROWS = 1500
"""Rows to which a surface is thinned."""
LEAST_ROWS = 10
"""Rows without which a surface gets the family's typical curve."""


def fit_family_curves(data: RegressionData, family: CurveFamily) -> SegmentCurves:
    """Curves of a family to start with: plain least squares on some rows of each surface."""
    names = ("slip", "adhesion", "speed", "load")
    slip, adhesion, speed, load = map(data.observed, names)
    known = np.concatenate([np.full(len(drive), drive.has_load) for drive in data.drives])
    conditions = Conditions(speed, np.where(known, load, np.nan))
    parameters = []
    for number in range(data.surfaces):
        rows = np.flatnonzero(data.surface == number)
        if len(rows) < LEAST_ROWS:
            parameters.append([p.typical for p in family.parameters])
            continue
        rows = rows[:: max(len(rows) // MOST_ROWS, 1)]
        points = CurvePoints.exact(slip[rows], adhesion[rows], conditions.select(rows))
        parameters.append(fit_values(points, family)[0].tolist())
    return SegmentCurves.from_parameters(family, np.array(parameters, dtype=np.float64))
