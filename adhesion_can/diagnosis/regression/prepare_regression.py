"""Step 3, prepare the regression: row weights, shared speed errors, whitening, plain fit.

Weights and filter come from the residual of a saturated model (curves, all effects and all channel
splines), so that what a missing effect leaves is not mistaken for noise.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from adhesion_can.arrays import Array
from adhesion_can.diagnosis.drive.drive_data import DriveData
from adhesion_can.diagnosis.drive.from_table import SEPARATION_S
from adhesion_can.diagnosis.regression.candidate import Candidate
from adhesion_can.diagnosis.regression.channel_splines import build_channels
from adhesion_can.diagnosis.regression.estimate_slip_noise import estimate_slip_noise
from adhesion_can.diagnosis.regression.gram_matrices import solve_normal_equations
from adhesion_can.diagnosis.regression.model import (
    EXCLUDED,
    EvaluatedModel,
    Model,
    RegressionData,
    compute_curve_jacobian,
    evaluate_model,
)
from adhesion_can.diagnosis.regression.segment_curves import SegmentCurves
from adhesion_can.diagnosis.regression.speed_error_scale import estimate_speed_error_scale
from adhesion_can.diagnosis.regression.whitened_regression import (
    FittedModel,
    WhitenedRegression,
    fit_model,
)
from adhesion_can.diagnosis.regression.whitening import ContiguousRuns, Whitener
from adhesion_can.physics.lag_states import PAUSE_S

FLAT_SLOPE, LEAST_FLAT = 2.0, 0.02
"""Slope dμ/dλ below which slip errors hardly matter, so that the residual is the noise of the
effort; and the least share of such rows."""
LEAST_NOISE = 1e-9
"""Least standard deviation of the adhesion's noise."""
BLOCK_WINDOWS = 2.0
"""Length of a block in smoothing windows of the vehicle speed."""
BLOCK_S = 4.0
"""Least length of a block, s."""
KNOTS = (4, 14)
"""Least and largest number of knots of the vehicle speed's error in a block."""
TABLE_BLOCKS, TABLE_BLOCK_S = 120, (0.2, 4.0)
"""Blocks of a sample table, and their least and largest length, s."""
POINT_BLOCKS = 400
"""Largest number of blocks of independent points; fewer points are blocks of one point each."""
FIRST_ITERATIONS = 30
"""Largest number of steps of the first fit of a curve, which may start far from it."""


@dataclass(frozen=True, eq=False)
class PreparedRegression:
    """Whitened regression with the plain fit, and the signatures of the candidates.

    Attributes:
        regression: Data with weights, filter and blocks.
        plain: Fit of the curves without effects.
        candidates: Effects that can be tested.
        signatures: Signature of each candidate, adhesion per unit of size; shape (n, 1) each.

    """

    regression: WhitenedRegression
    plain: FittedModel
    candidates: tuple[Candidate, ...]
    signatures: tuple[Array, ...]


def choose_block_length(drives: Sequence[DriveData]) -> float:
    """Length of a block, s: errors of the vehicle speed do not last much longer.

    The rows of a sample table have no such errors, and are often few: it is cut into about
    120 blocks.
    """
    if all(drive.independent for drive in drives):
        rows = sum(map(len, drives))
        return SEPARATION_S * float(np.ceil(rows / POINT_BLOCKS))
    if all(drive.table for drive in drives):
        steps = np.concatenate([np.diff(drive.t_s) for drive in drives])
        steps = steps[(steps > 0) & (steps <= PAUSE_S)]
        return float(np.clip(steps.sum() / TABLE_BLOCKS, *TABLE_BLOCK_S)) if len(steps) else BLOCK_S
    windows = [drive.speed_error.window_s for drive in drives]
    return max(BLOCK_S, BLOCK_WINDOWS * max(windows, default=0.0))


def prepare_regression(
    data: RegressionData,
    start: SegmentCurves,
    block: NDArray[np.int64],
    candidates: tuple[Candidate, ...],
    block_length_s: float,
) -> PreparedRegression:
    """Weight and whiten the data, fit the curves, and compute the signatures of the effects.

    Args:
        data: Rows of all drives.
        start: Curve parameters to start with.
        block: Block number of each row, negative in rows that are held out; shape (n,).
        candidates: Effects that can be tested.
        block_length_s: Length of a block, s.

    """
    n = len(data)
    zero = np.zeros(n)
    regression = WhitenedRegression(
        data, np.ones(n), zero, np.zeros((n, 0)), np.zeros(len(data.drives)), zero,
        Whitener(np.array([1.0]), _find_runs(data)), np.ones(n), block,
    )  # fmt: skip
    model = fit_model(regression, Model(start), FIRST_ITERATIONS).model
    regression = _weight_rows(regression, model, block_length_s)
    model = fit_model(regression, model).model
    if any(drive.table for drive in data.drives):
        # Of many slips about one value, as in coasting, the noisy ones are near it on average. A
        # spline at the slips as read would follow that, and hide it from the correction.
        residual = evaluate_model(data, model.curves).residual
        correction = _estimate_slip_correction(regression, model, residual)
        regression = replace(regression, slip_correction=correction)
    residual = _saturated_residual(regression, model, candidates)
    regression = _scale_speed_errors(regression, residual)
    correction = _estimate_slip_correction(regression, model, residual)
    regression = replace(regression, slip_correction=correction)
    regression = regression.refit_whitening(_saturated_residual(regression, model, candidates))
    plain = fit_model(regression, model)
    known = regression.evaluate_corrected(plain.model)
    signatures = tuple(
        regression.compute_signature(plain.model, c, known=known) for c in candidates
    )
    return PreparedRegression(regression, plain, candidates, signatures)


def _find_runs(data: RegressionData) -> ContiguousRuns:
    """Gap-free runs of rows, none of which reaches from one drive into the next."""
    lengths = [len(drive) for drive in data.drives]
    starts = np.cumsum([0, *lengths])[:-1]
    breaks = np.zeros(len(data), dtype=np.bool_)
    breaks[starts[np.array(lengths) > 0]] = True
    for drive, start in zip(data.drives, starts, strict=True):
        if drive.independent:
            breaks[start : start + len(drive)] = True
    return ContiguousRuns.find(data.column("t_s"), data.column("axle"), breaks)


def _weight_rows(
    regression: WhitenedRegression, model: Model, block_length_s: float
) -> WhitenedRegression:
    """Row weights from the wheel speed's noise, and the design matrix of vehicle speed errors."""
    data = regression.data
    evaluation = evaluate_model(data, model.curves)
    slope = model.curves.slope(evaluation.slip, data.surface, evaluation.conditions)
    flat = regression.used & (np.abs(slope) < FLAT_SLOPE)
    if flat.sum() < LEAST_FLAT * regression.used.sum():
        flat = regression.used
    noise = max(float(np.sqrt(np.mean(evaluation.residual[flat] ** 2))), LEAST_NOISE)
    variance_ratio = (slope * _slip_std(regression, evaluation, slope) / noise) ** 2
    return replace(
        regression,
        scale=1.0 / (noise * np.sqrt(1.0 + variance_ratio)),
        slip_variance_share=variance_ratio / (1.0 + variance_ratio),
        speed_error_design=design_speed_errors(data, evaluation, slope, block_length_s),
        speed_error_std=np.array([drive.speed_error.std for drive in data.drives]),
    )


def _scale_speed_errors(regression: WhitenedRegression, residual: Array) -> WhitenedRegression:
    """Errors of the vehicle speed as large as all axles show them, drive by drive.

    Args:
        regression: Data with weights, blocks, and errors as large as the readings show them.
        residual: Residual of the saturated model, adhesion; shape (n,).

    """
    data = regression.data
    design = regression.speed_error_design.copy()
    scaled = design * regression.scale[:, None]
    std = regression.speed_error_std.copy()
    for number in range(len(data.drives)):
        drive_rows = data.drive_number == number
        block = np.where(drive_rows & regression.used, regression.block, EXCLUDED)
        if not std[number]:
            continue
        factor = estimate_speed_error_scale(residual * regression.scale, scaled, block)
        # What the readings rule out is no error of theirs, however much it looks like one.
        factor = min(factor, data.drives[number].speed_error.largest_std / std[number])
        design[drive_rows] *= factor
        std[number] *= factor
    return replace(regression, speed_error_design=design, speed_error_std=std)


def _slip_std(regression: WhitenedRegression, evaluation: EvaluatedModel, slope: Array) -> Array:
    """Standard deviation of the slip's white noise: stated, or that of a table; shape (n,)."""
    data = regression.data
    std = data.column("wheel_slip_std").copy()
    for number, drive in enumerate(data.drives):
        if drive.table and not drive.independent:
            rows = data.drive_number == number
            std[rows] = estimate_slip_noise(
                evaluation.slip,
                evaluation.residual,
                slope,
                regression.whitener.runs,
                rows & regression.used,
            )
    return std


def design_speed_errors(
    data: RegressionData, evaluation: EvaluatedModel, slope: Array, block_length_s: float
) -> Array:
    """Change of each residual by errors of the vehicle speed, of one standard deviation each.

    The error is piecewise linear over a block (B-splines of degree 1; de Boor 1978).

    Args:
        data: Rows of all drives.
        evaluation: Plain model evaluated at the measured slips.
        slope: Slope dμ/dλ of the curve in each row, shape (n,).
        block_length_s: Length of a block, s.

    Returns:
        Design matrix, adhesion; shape (n, knots).

    """
    speeds = data.observed("speed")
    errors = [drive.speed_error for drive in data.drives]
    std = np.concatenate(
        [np.full(len(drive), e.std) for drive, e in zip(data.drives, errors, strict=True)]
    )
    window_s = max((e.window_s for e in errors if e.std > 0.0), default=0.0)
    if window_s <= 0.0:
        return np.zeros((len(data), 0))
    sensitivity = slope * (1.0 + evaluation.slip) / speeds * std
    knots = int(np.clip(np.ceil(2.0 * block_length_s / window_s) + 1, *KNOTS))
    place = (data.column("t_s") / block_length_s) % 1.0 * (knots - 1)
    hats = np.maximum(1.0 - np.abs(place[:, None] - np.arange(knots)), 0.0)
    return np.asarray(hats * sensitivity[:, None])


def _saturated_residual(
    regression: WhitenedRegression, model: Model, candidates: tuple[Candidate, ...]
) -> Array:
    """Residual of the saturated, linearised model (all effects, all splines), adhesion; (n,)."""
    data = regression.data
    corrected = regression.evaluate_corrected(model)
    columns = [compute_curve_jacobian(data, model.curves, corrected)]
    columns += [regression.compute_signature(model, c, known=corrected) for c in candidates]
    columns += [channel.build_basis(corrected) for channel in build_channels(data, corrected)]
    residual = evaluate_model(data, model.curves).residual
    whole = np.column_stack([*columns, residual])
    del columns  # an hour of six axles has GB of them
    total = regression.compute_grams(regression.whiten(whole)).total
    return np.asarray(
        residual - whole[:, :-1] @ solve_normal_equations(total[:-1, :-1], total[:-1, -1])
    )


def _estimate_slip_correction(
    regression: WhitenedRegression, model: Model, residual: Array
) -> Array:
    """Predict the errors of the measured slips from residuals (best linear unbiased prediction).

    The error of the vehicle speed shows in all axles at once, most where the curve is steep. The
    wheel speed gets its share of the variance of the remaining residual.

    Args:
        regression: Data with weights and blocks.
        model: Plain model.
        residual: Residual of the saturated model, adhesion; shape (n,).

    Returns:
        Correction of the slip ratio, shape (n,).

    """
    data = regression.data
    evaluation = evaluate_model(data, model.curves)
    slope = model.curves.slope(evaluation.slip, data.surface, evaluation.conditions)
    # A surface that is held out whole had no part in the saturated model, which is arbitrary there.
    known = np.isin(data.surface, data.surface[regression.used])
    residual = np.where(known, residual, evaluation.residual)
    by_speed = residual - regression.without_speed_errors(residual)
    safe = np.where(np.abs(slope) > 1e-3, slope, np.inf)
    by_wheel = regression.slip_variance_share * (residual - by_speed) / safe
    # A residual of s·δ means that the slip reads low by δ.
    return np.asarray(by_speed / safe + by_wheel)
