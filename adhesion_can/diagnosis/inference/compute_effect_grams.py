"""Gram matrices of all candidates of a prepared regression, for a diagnosis of many drives."""

import numpy as np

from adhesion_can.diagnosis.effect_grams import EffectGrams, EffectKey, project_grams
from adhesion_can.diagnosis.regression.candidate import Candidate
from adhesion_can.diagnosis.regression.prepare_regression import PreparedRegression


def compute_effect_grams(prepared: PreparedRegression, rmse: float) -> EffectGrams:
    """Gram matrices of all candidates, on all rows of the drives.

    Args:
        prepared: Whitened regression with the plain fit and the signatures.
        rmse: RMSE of the adhesion with the plain curves.

    """
    regression = prepared.regression.all_data
    columns = regression.build_columns(prepared.plain.model)
    curve = columns.shape[1] - 1
    signatures = np.column_stack([np.empty((len(columns), 0)), *prepared.signatures])
    white = regression.whiten(signatures)
    grams = regression.compute_grams(np.column_stack([columns[:, :-1], white, columns[:, -1]]))
    keys = tuple(_key(candidate) for candidate in prepared.candidates)
    return project_grams(grams, curve, keys, rmse)


def _key(candidate: Candidate) -> EffectKey:
    size = candidate.free_parameters[0]
    effect = candidate.effect
    return EffectKey(effect.id, effect.form, candidate.axle, size.name, size.unit, size.typical)
