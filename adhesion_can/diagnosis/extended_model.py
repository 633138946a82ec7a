"""Extended model as a file can hold it, and the curves of every segment with and without it."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from adhesion_can.arrays import Array
from adhesion_can.diagnosis.drive.drive_data import DriveData
from adhesion_can.diagnosis.inference.find_residual_channels import ResidualChannel
from adhesion_can.diagnosis.peak_spread import NO_SPREAD, PeakSpread, compare_peaks
from adhesion_can.diagnosis.regression.model import (
    EvaluatedModel,
    Model,
    RegressionData,
    evaluate_model,
)
from adhesion_can.diagnosis.regression.prepare_regression import PreparedRegression
from adhesion_can.diagnosis.regression.segment_curves import BURCKHARDT
from adhesion_can.diagnosis.regression.whitened_regression import FittedModel, fit_model
from adhesion_can.diagnosis.result import SegmentResult
from adhesion_can.diagnosis.shape_result import estimate_fitted_curve, find_conditions
from adhesion_can.estimation.batch_fit import fit as fit_curve
from adhesion_can.estimation.curves.peak import nearest_burckhardt
from adhesion_can.estimation.extended.model import BaseCurve, ExtendedModel, Matrix
from adhesion_can.estimation.identifiability import IdentifiabilitySettings
from adhesion_can.physics.burckhardt import CurveParameters
from adhesion_can.physics.channels import model_channel
from adhesion_can.physics.curves import Conditions, CurveFamily
from adhesion_can.physics.curves.burckhardt_family import curve_with_peak
from adhesion_can.physics.effects import ActiveEffect
from adhesion_can.physics.effects.empirical import Empirical
from adhesion_can.physics.estimate import Estimate
from adhesion_can.physics.samples import Samples

REFERENCE_EXPONENT = 5.5
"""c2·λ_m of the Burckhardt curve to which a curve of another family is related: with 3 its fall is
not to be distinguished from the factor's, with 7 its rise is too steep for the errors of the
slips."""
LEAST_ROWS, MOST_ROWS = 10, 20_000
"""Rows without which a segment gets no curve, and to which it is thinned."""
LEAST_FACTOR = 0.05
"""Factor of the adhesion below which a row carries no information about the curve."""


def build_spline(residual_channel: ResidualChannel) -> Empirical | None:
    """The spline of a residual channel as part of a model; None where a model cannot have it."""
    channel = residual_channel.channel
    name = model_channel(channel.name)
    if not name or channel.period:
        return None
    knots = tuple(map(float, channel.knots))
    coefficients = residual_channel.spline_coefficients
    if channel.levels is not None or len(coefficients) != len(knots) - 4:
        return None
    spline = Empirical(name, "factor", knots, tuple(map(float, coefficients)))
    # A constant factor belongs to the curve: the spline is 0 on average.
    mean = float(np.mean(spline.at(channel.values)))
    if mean <= LEAST_FACTOR - 1.0:
        return None
    return replace(
        spline, coefficients=tuple(float((c - mean) / (1.0 + mean)) for c in coefficients)
    )


def refit_with_spline(prepared: PreparedRegression, model: Model, spline: Empirical) -> Model:
    """The model of the curves fitted again, with a given spline."""
    curves = Model(model.curves, fixed=(ActiveEffect(spline, ()),))
    return fit_model(prepared.regression.last_fit, curves).model


@dataclass(frozen=True, eq=False)
class SegmentFits:
    """Fits from which the curves of the segments are taken.

    Attributes:
        plain: Fit of Burckhardt's curves without effects.
        extended: Fit of curves and named effects.
        other_forms: Models with curves of other forms, by which the peak may differ.

    """

    plain: FittedModel
    extended: FittedModel
    other_forms: tuple[Model, ...] = ()


def estimate_segments(
    data: RegressionData, change_times: list[list[float]], extended: Model, fits: SegmentFits
) -> tuple[tuple[SegmentResult, ...], SegmentResult | None, tuple[int, int]]:
    """Estimate the curves of every segment, plain and extended.

    Args:
        data: Rows of all drives.
        change_times: Times of the surface changes in each drive, s.
        extended: Model with effects.
        fits: Fits of the curves, with their covariances.

    Returns:
        Results of the segments; result, drive number and surface number of the one with most rows.

    """
    evaluation = evaluate_model(data, extended.curves, extended.active_effects)
    results: list[SegmentResult] = []
    longest, place_of_longest, most = None, (0, 0), -1
    first = number = 0
    for place, (drive, times) in enumerate(zip(data.drives, change_times, strict=True)):
        rows = slice(first, first + len(drive))
        first += len(drive)
        for _ in range(len(times) + 1):
            rows_of_segment = np.flatnonzero(data.surface[rows] == number) + rows.start
            if len(rows_of_segment) >= LEAST_ROWS:
                result = _estimate_segment(drive, rows_of_segment, rows.start, evaluation)
                result = _take_fitted_curves(result, data, number, extended, fits, evaluation)
                results.append(result)
                if len(rows_of_segment) > most:
                    longest, place_of_longest, most = result, (place, number), len(rows_of_segment)
            number += 1
    return tuple(results), longest, place_of_longest


def _take_fitted_curves(
    result: SegmentResult,
    data: RegressionData,
    surface: int,
    extended: Model,
    fits: SegmentFits,
    evaluation: EvaluatedModel,
) -> SegmentResult:
    """Result of a segment with the curves of the regression, which knows errors of the slips."""
    rows_of_surface = data.surface == surface
    share = 1.0 - IdentifiabilitySettings().reach
    reached = float(np.quantile(np.abs(evaluation.slip[rows_of_surface]), share))
    conditions = find_conditions(data, surface)
    spread = compare_peaks(fits.extended.model, fits.other_forms, surface, conditions)
    plain = fits.plain.model.curves
    # Without an extension both are the same curve, which is as uncertain.
    of_plain = spread if fits.extended is fits.plain else NO_SPREAD
    return replace(
        result,
        base=estimate_fitted_curve(
            result.base, fits.plain, plain, surface, conditions, reached, of_plain
        ),
        extended=estimate_fitted_curve(
            result.extended, fits.extended, extended.curves, surface, conditions, reached, spread
        ),
    )


def _estimate_segment(
    drive: DriveData, rows: NDArray[np.int64], start: int, evaluation: EvaluatedModel
) -> SegmentResult:
    """Estimate the curves of one segment, its rows taken as independent.

    Args:
        drive: Drive data of the recording.
        rows: Indices of the segment's rows among those of all drives, shape (m,).
        start: Index of the drive's first row among those of all drives.
        evaluation: Extended model evaluated on all rows.

    """
    rows = rows[:: max(len(rows) // MOST_ROWS, 1)]
    observed = drive.observe()
    rows_of_drive = rows - start
    clear = np.abs(evaluation.factor[rows]) > LEAST_FACTOR
    plain = _fit_estimate(observed.slip[rows_of_drive], observed.adhesion[rows_of_drive])
    extended = plain
    if clear.sum() >= LEAST_ROWS:
        corrected = evaluation.adhesion[rows][clear] / evaluation.factor[rows][clear]
        extended = _fit_estimate(evaluation.slip[rows][clear], corrected)
    return SegmentResult(
        drive.name,
        drive.first_us / 1e6 + float(drive.time_s[rows_of_drive].min()),
        drive.first_us / 1e6 + float(drive.time_s[rows_of_drive].max()),
        plain,
        extended,
    )


def _fit_estimate(slip: Array, adhesion: Array) -> Estimate:
    return fit_curve(Samples.curve(slip, adhesion))


def build_extended_model(
    extended: Model,
    fitted: FittedModel,
    surface: int,
    spline: Empirical | None,
    conditions: Conditions,
    spread: PeakSpread = NO_SPREAD,
) -> ExtendedModel | None:
    """Build the model as a file contains it; None where the data give no curve with a peak.

    Args:
        extended: Model with effects and spline.
        fitted: Fit of curves and effects, with their covariance.
        surface: Number of the surface whose curve becomes the base curve.
        spline: Spline of an unexplained channel; None where there is none.
        conditions: Speed and load at which the Burckhardt curve is related to the base curve.
        spread: Differences of the peak to that of another form of the base curve.

    """
    curves, model = extended.curves, fitted.model
    of_surface = slice(curves.size * surface, curves.size * (surface + 1))
    scale = np.diag(curves.scales[surface])
    covariance = _to_matrix(scale @ fitted.covariance[of_surface, of_surface] @ scale)
    curve = None
    values = tuple(map(float, curves.parameters[surface]))
    if curves.family is BURCKHARDT:
        c1, c2, c3 = values
    else:
        curve = BaseCurve(curves.family, values, covariance, (spread.mu_max, spread.lambda_m))
        c1, c2, c3 = _find_reference(curves.family, np.array(values), conditions)
        covariance = None
    if not (c1 > 0 and c3 >= 0 and c1 * c2 > c3):
        return None
    return ExtendedModel(
        base=(c1, c2, c3),
        base_covariance=covariance,
        effects=tuple(candidate.active(values) for candidate, values in model.estimates),
        covariances=_effect_covariances(fitted),
        splines=() if spline is None else (spline,),
        curve=curve,
    )


def _find_reference(family: CurveFamily, values: Array, conditions: Conditions) -> CurveParameters:
    """(c1, c2, c3) of the Burckhardt curve that a curve of another family is a factor of.

    It has the same peak where there is one. So what is left of a drive without the factor has its
    peak where it was driven, and an estimator of Burckhardt's curve finds it there.
    """
    top = family.peak(values, conditions, IdentifiabilitySettings().slip_max)
    if bool(top.interior):
        return curve_with_peak(float(top.mu_max), float(top.lambda_m), REFERENCE_EXPONENT)
    return nearest_burckhardt(family, values, conditions)


def _effect_covariances(fitted: FittedModel) -> tuple[Matrix | None, ...]:
    """Covariance of each effect's parameters, 0 for those that are not estimated."""
    covariances: list[Matrix | None] = []
    first = fitted.model.curves.values.size
    for candidate in fitted.model.candidates:
        of_effect = slice(first, first + candidate.size)
        first += candidate.size
        full = np.zeros((len(candidate.effect.parameters),) * 2)
        free = [i for i, p in enumerate(candidate.effect.parameters) if p.free]
        full[np.ix_(free, free)] = fitted.covariance[of_effect, of_effect]
        covariances.append(_to_matrix(full))
    return tuple(covariances)


def _to_matrix(values: Array) -> Matrix | None:
    """A covariance as a model has it; None where it is not finite."""
    if not np.isfinite(values).all():
        return None
    even = (values + values.T) / 2
    return tuple(tuple(float(x) for x in row) for row in even)
