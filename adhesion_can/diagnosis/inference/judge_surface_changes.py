"""Whether the data need surface changes: the same drives explained without any."""

from dataclasses import replace

import numpy as np

from adhesion_can.diagnosis.inference.curve_shape import LARGEST_LOSS
from adhesion_can.diagnosis.inference.findings import Findings
from adhesion_can.diagnosis.regression.model import EXCLUDED, RegressionData
from adhesion_can.diagnosis.regression.whitened_regression import fit_model


def explains_without_changes(changing: Findings, steady: Findings) -> bool:
    """Whether effects or the shape of the curve explain the data as well as surface changes do.

    Its RMSE is about the same or it predicts blocks from the others at least as well, on the same
    rows, weights and filter: many short segments bend to what they were fitted to.

    Args:
        changing: Findings with surface changes.
        steady: Findings without any.

    """
    best, other = changing.selection.best, steady.selection.best
    if not other.ids and steady.shape is None:
        return False
    if other.rmse <= (1.0 + LARGEST_LOSS) * best.rmse:
        return True
    regression = changing.regression
    merged = replace(regression, data=merge_surfaces(regression.data))
    refitted = fit_model(merged, other.model)
    return refitted.cross_validated_square <= best.cross_validated_square


def merge_surfaces(data: RegressionData) -> RegressionData:
    """The same rows with one surface for each drive."""
    surface = np.where(data.surface == EXCLUDED, EXCLUDED, data.drive_number)
    return replace(data, surface=surface, surfaces=len(data.drives))
