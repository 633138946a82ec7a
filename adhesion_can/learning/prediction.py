"""How a model and the plain curve predict spans of readings that neither was fitted to.

Both have their curve fitted to the readings of a minute before, as the service fits its own, with
the same rows, weights and filter; the model's effects stay as they were found.
"""

from dataclasses import dataclass

import numpy as np

from adhesion_can.diagnosis.drive.drive_data import DriveData
from adhesion_can.diagnosis.drive.thinning import thin_drive
from adhesion_can.diagnosis.evaluate import model_curves, model_effects, require_effects_apply
from adhesion_can.diagnosis.inference.split_hold_out import number_blocks_of_drives
from adhesion_can.diagnosis.regression.find_surface_changes import (
    build_regression_data,
    fit_start_curves,
)
from adhesion_can.diagnosis.regression.model import Model, evaluate_model
from adhesion_can.diagnosis.regression.prepare_regression import (
    choose_block_length,
    prepare_regression,
)
from adhesion_can.diagnosis.regression.whitened_regression import fit_model
from adhesion_can.errors import InputError
from adhesion_can.estimation.extended.model import ExtendedModel

LEAST_TRAINING_ROWS = 500
"""Least number of rows that the curves are fitted to."""
LEAST_ROWS = 60
"""Least number of rows of a span that distinguishes models."""
LEAST_DIFFERENCE = 0.1
"""Least difference of two predictions, in standard deviations of the noise (RMS of a span), for
the span to distinguish them. It depends on the predictions, not on their errors."""


@dataclass(frozen=True, slots=True)
class PredictedSpan:
    """A span of readings as two models predict it.

    Attributes:
        to_us: End of the span, µs.
        plain: Weighted mean square of the plain curve's prediction error.
        extended: The same of the model.

    """

    to_us: int
    plain: float
    extended: float

    @property
    def is_better(self) -> bool:
        """Whether the model predicts the span better."""
        return self.extended < self.plain


def predict_spans(
    drive: DriveData, model: ExtendedModel, from_us: int, span_us: int, spans: int
) -> list[PredictedSpan]:
    """Spans that distinguish a model from the plain curve, with the errors of both predictions.

    Args:
        drive: Drive data of the spans and of the time before, to which the curves are fitted.
        model: Extended model.
        from_us: Start of the first span, µs.
        span_us: Length of a span, µs.
        spans: Number of spans, one after the other.

    Raises:
        InputError: The drive lacks what an effect of the model needs, or has too few rows.

    """
    require_effects_apply(model, drive)
    thin = thin_drive(drive)
    t_us = thin.first_us + thin.time_s * 1e6
    number = np.floor((t_us - from_us) / span_us)
    if not (number < 0).sum() >= LEAST_TRAINING_ROWS:
        raise InputError(drive.name, "too few rows to fit a curve to", "record a longer drive")
    data = build_regression_data((thin,), [[]])
    length_s = choose_block_length((thin,))
    block = np.concatenate(number_blocks_of_drives((thin,), length_s))
    block = np.where(number < 0, block, -1 - block)
    prepared = prepare_regression(data, fit_start_curves(data), block, (), length_s)
    effects = model_effects(model)
    start = Model(model_curves(model, data.surfaces), fixed=effects)
    extended = fit_model(prepared.regression, start).model
    scale = prepared.regression.scale
    before = scale * evaluate_model(data, prepared.plain.model.curves).residual
    after = scale * evaluate_model(data, extended.curves, effects).residual
    predicted = []
    for place in range(spans):
        rows = (number == place) & np.isfinite(before) & np.isfinite(after)
        if rows.sum() < LEAST_ROWS:
            continue
        if np.sqrt(np.mean((before[rows] - after[rows]) ** 2)) < LEAST_DIFFERENCE:
            continue
        errors = (float(np.mean(residual[rows] ** 2)) for residual in (before, after))
        predicted.append(PredictedSpan(from_us + (place + 1) * span_us, *errors))
    return predicted
