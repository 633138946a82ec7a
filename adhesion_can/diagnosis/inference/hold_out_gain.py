"""Gain of an extended model on held-out data, with a confidence interval (for step 7).

The gain is the share by which the RMSE of the adhesion falls on data that had no part in fitting or
selecting the model. Its interval comes from the scatter over units that were held out whole (blocks
or recordings), since rows within a unit are correlated.

Two things hide a gain that is there. What acts in a few bends alone gains in few units, and the
scatter over units is wide: then the interval is that of the gain on these very data. And where an
error of the vehicle speed is larger than everything else, the gain of what acts beside it shows
only once that error is taken off, in both models alike. `Gain.method` says which it is.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
import scipy
from numpy.typing import NDArray

from adhesion_can.arrays import Array
from adhesion_can.diagnosis.gain_result import Gain, GainMethod
from adhesion_can.diagnosis.inference.find_residual_channels import ResidualChannel
from adhesion_can.diagnosis.inference.split_hold_out import held_blocks
from adhesion_can.diagnosis.regression.gram_matrices import solve_normal_equations
from adhesion_can.diagnosis.regression.model import (
    EXCLUDED,
    Model,
    compute_curve_jacobian,
    evaluate_model,
)
from adhesion_can.diagnosis.regression.whitened_regression import WhitenedRegression, fit_model

CONFIDENCE = 0.95
"""Confidence level of the interval."""
LEAST_UNITS = 2.0
"""Least number of units in which a model acts, for their scatter to say something."""
LEAST_RECORDINGS = 3
"""Least number of held-out recordings for each one to be a unit of its own."""


@dataclass(frozen=True, eq=False)
class HoldOutResult:
    """Residuals on the held-out rows.

    Attributes:
        rows: Indices of the held-out rows, shape (m,).
        before: Residuals of the plain model, adhesion; shape (m,).
        after: Residuals of the extended model, adhesion; shape (m,).

    """

    rows: NDArray[np.int64]
    before: Array
    after: Array


@dataclass(frozen=True, eq=False)
class HoldOutUnits:
    """Units that were held out whole.

    Attributes:
        unit: Unit number of each held-out row, shape (m,).
        description: Description of the data that were held out, a clause for reports.
        spans: Recording, start and end of each span of units, s on the recording's clock.
        stratum: Number of the drive of each held-out row, where parts of each drive were held out;
            None: all are drawn alike. Shape (m,).
        whole: Whether they are parts of recordings that were held out whole.

    """

    unit: NDArray[np.int64]
    description: str
    spans: tuple[tuple[str, float, float], ...]
    stratum: NDArray[np.int64] | None = None
    whole: bool = False


def compute_hold_out_gain(
    regression: WhitenedRegression,
    plain: Model,
    extended: Model,
    channel: ResidualChannel | None,
    *,
    other_drives: bool,
    noise_floor: float,
    block_length_s: float,
) -> Gain:
    """Gain of an extended model over the plain one on the held-out rows.

    Args:
        regression: Regression on which both models were fitted.
        plain: Smaller model; with effects where a further one is judged beside them.
        extended: Larger model.
        channel: Residual channel that is added to the extended model; None: none.
        other_drives: Whether whole recordings were held out.
        noise_floor: RMSE on the deciding data with the effects and a spline in every channel.
        block_length_s: Length of a block, s.

    """
    if not regression.held_out.used.any():
        return compute_leave_one_out_gain(regression, plain, extended, channel, noise_floor)
    result = evaluate_hold_out(regression, plain, extended, channel, other_drives=other_drives)
    units = group_hold_out(
        regression, result.rows, block_length_s=block_length_s, other_drives=other_drives
    )
    results = [(result, GainMethod.PLAIN)]
    if regression.speed_error_design.shape[1]:
        # Both models without errors of the vehicle speed, each by its own residuals.
        residuals = np.zeros((2, len(regression.data)))
        residuals[:, result.rows] = result.before, result.after
        before, after = map(regression.held_out.without_speed_errors, residuals)
        without = HoldOutResult(result.rows, before[result.rows], after[result.rows])
        results.append((without, GainMethod.WITHOUT_SPEED_ERRORS))
    gains = [
        gain
        for each, method in results
        for gain in _compute_gains(each, units, noise_floor, method)
    ]
    return next(filter(is_significant, gains), gains[0])


def _compute_gains(
    result: HoldOutResult, units: HoldOutUnits, noise_floor: float, method: GainMethod
) -> Iterator[Gain]:
    """The gain with the interval over units, and with that on these very data."""
    gain = replace(compute_gain(result, units, noise_floor), method=method)
    yield gain
    interval = interval_where_it_acts(result.before, result.after, units.unit)
    if interval is not None:
        yield replace(gain, interval=interval, method=method | GainMethod.WHERE_IT_ACTS)


def is_significant(gain: Gain) -> bool:
    """Whether a gain is positive, with its interval where there is one.

    What is found in noise often gains something: in sixty drives without an effect six findings
    did, five with 0 in the interval. Of 128 that were there three had it, all of them shapes.
    """
    low = gain.interval[0]
    return gain.percent > 0.0 and (low > 0.0 or low == -np.inf)


def compute_leave_one_out_gain(
    regression: WhitenedRegression,
    plain: Model,
    extended: Model,
    channel: ResidualChannel | None,
    noise_floor: float,
) -> Gain:
    """Gain of an extended model where no row is held out: each block in turn (case deletion).

    Args:
        regression: Regression on independent points.
        plain: Smaller model; with effects where a further one is judged beside them.
        extended: Larger model.
        channel: Residual channel that is added to the extended model; None: none.
        noise_floor: RMSE on the deciding data with the effects and a spline in every channel.

    """
    rows = np.flatnonzero(regression.used)
    before = _left_out_residuals(regression, regression.build_columns(plain))
    columns = regression.build_columns(extended)
    if channel is not None:
        added = regression.whiten(channel.basis)
        columns = np.column_stack([columns[:, :-1], added, columns[:, -1]])
        step = solve_normal_equations(columns[:, :-1].T @ columns[:, :-1],
                                      columns[:, :-1].T @ columns[:, -1])  # fmt: skip
        columns[:, -1] -= columns[:, :-1] @ step
    after = _left_out_residuals(regression, columns)
    block = regression.block[rows]
    what = "point" if len(np.unique(block)) == len(block) else "random group of points"
    units = HoldOutUnits(
        block,
        f"each {what} in turn, predicted from the others ({len(rows)} points); the model was "
        "chosen with all of them",
        (),
    )
    return compute_gain(HoldOutResult(rows, before[rows], after[rows]), units, noise_floor)


def _left_out_residuals(regression: WhitenedRegression, columns: Array) -> Array:
    """Residual of each row by the parameters of the other blocks, adhesion; shape (n,).

    To first order the parameters change by −(G − G_b)⁻¹ X_bᵀ e_b without block b (Cook and
    Weisberg, Residuals and Influence in Regression, 1982).

    Args:
        regression: Regression whose whitening filter has order 0.
        columns: Whitened Jacobian of a fitted model and its residual, shape (n, p + 1).

    """
    design, residual = columns[:, :-1], columns[:, -1]
    total = design.T @ design
    left_out = residual.copy()
    for number in np.unique(regression.block[regression.used]):
        rows = np.flatnonzero(regression.block == number)
        design_of_block = design[rows]
        change = solve_normal_equations(
            total - design_of_block.T @ design_of_block, design_of_block.T @ residual[rows]
        )
        left_out[rows] += design_of_block @ change
    return np.asarray(left_out / (regression.scale * regression.weight))


def evaluate_hold_out(
    regression: WhitenedRegression,
    plain: Model,
    extended: Model,
    channel: ResidualChannel | None,
    *,
    other_drives: bool,
) -> HoldOutResult:
    """Residuals of both models on the held-out rows.

    Args:
        regression: Regression on which both models were fitted.
        plain: Smaller model; with effects where a further one is judged beside them.
        extended: Larger model.
        channel: Residual channel that is added to the extended model; None: none.
        other_drives: Whether whole recordings were held out. Their surfaces are their own, so both
            models get curves fitted to them; the effects stay as they were fitted.

    """
    data, held_out = regression.data, regression.held_out
    if other_drives:
        plain, extended = (
            fit_model(held_out, Model(model.curves, fixed=model.active_effects)).model
            for model in (plain, extended)
        )
    rows = np.flatnonzero(held_out.used)
    effects = extended.active_effects
    before = evaluate_model(data, plain.curves, plain.active_effects).residual
    after = evaluate_model(data, extended.curves, effects).residual
    if channel is not None and other_drives:
        after = after - channel.spline_change
        # At the estimated true slips, as the channel was fitted.
        corrected = evaluate_model(data, extended.curves, effects, regression.slip_correction)
        jacobian = compute_curve_jacobian(data, extended.curves, corrected)
        held_jacobian = jacobian[rows]
        after = after - jacobian @ solve_normal_equations(
            held_jacobian.T @ held_jacobian, held_jacobian.T @ after[rows]
        )
    elif channel is not None:
        after = after - channel.prediction_change
    return HoldOutResult(rows, before[rows], after[rows])


def group_hold_out(
    regression: WhitenedRegression,
    rows: NDArray[np.int64],
    *,
    block_length_s: float,
    other_drives: bool,
) -> HoldOutUnits:
    """Group the held-out rows into blocks, or into recordings where at least three are held out.

    Blocks that follow each other make up a span.

    Args:
        regression: Regression whose rows are in blocks.
        rows: Indices of the held-out rows, shape (m,).
        block_length_s: Length of a block, s.
        other_drives: Whether whole recordings were held out.

    """
    data = regression.data
    width = held_blocks(len(data.drives))
    number = -1 - regression.block[rows]
    span = number // width
    drive_number = data.drive_number[rows]
    t_s = data.column("time_s")[rows]
    held = np.unique(drive_number)
    if other_drives and len(held) >= LEAST_RECORDINGS:
        number = span = drive_number
    spans = []
    for unit in np.unique(span):
        in_span = span == unit
        drive = data.drives[int(drive_number[in_span][0])]
        start = drive.first_us / 1e6
        spans.append(
            (drive.name, start + float(t_s[in_span].min()), start + float(t_s[in_span].max()))
        )
    if other_drives:
        names = ", ".join(data.drives[int(i)].name for i in held)
        description = f"{len(held)} of {len(data.drives)} recordings: {names}"
    else:
        share = len(rows) / max(int((data.surface != EXCLUDED).sum()), 1)
        what = "this drive only" if len(data.drives) == 1 else "parts of all drives"
        description = (
            f"{what}: {len(spans)} spans of {width * block_length_s:.1f} s, "
            f"{100 * share:.0f} % of the rows"
        )
    stratum = np.zeros_like(drive_number) if other_drives else drive_number
    return HoldOutUnits(number, description, tuple(spans), stratum, other_drives)


def compute_gain(result: HoldOutResult, units: HoldOutUnits, noise_floor: float) -> Gain:
    """Gain with its interval.

    Args:
        result: Residuals on the held-out rows.
        units: Units that were held out whole.
        noise_floor: RMSE on the deciding data with the effects and a spline in every channel.

    """
    before = float(np.sqrt(np.mean(result.before**2)))
    after = float(np.sqrt(np.mean(result.after**2)))
    percent, interval = 0.0, (0.0, 0.0)
    if not np.array_equal(result.before, result.after):
        percent = 100.0 * (1.0 - after / max(before, 1e-300))
        interval = gain_interval(result.before, result.after, units.unit, units.stratum)
    return Gain(
        before, after, noise_floor, percent, interval, units.description, units.spans,
        whole=units.whole,
    )  # fmt: skip


def gain_interval(
    before: Array,
    after: Array,
    unit: NDArray[np.int64],
    stratum: NDArray[np.int64] | None = None,
) -> tuple[float, float]:
    """95 % confidence interval of the gain, %, by Student's t over units that were held out whole.

    The logarithm of the ratio of the mean squares is linearised in the units' sums of squares
    (delta method). Units that stem from different drives are a stratified sample: what the drives
    differ by is no scatter (Cochran, Sampling Techniques, 1977, ch. 5).

    Args:
        before: Residuals of the plain model, adhesion; shape (m,).
        after: Residuals of the extended model, adhesion; shape (m,).
        unit: Unit number of each row, shape (m,).
        stratum: Drive of each row; None: one for all. Shape (m,).

    """
    numbers = np.unique(unit, return_inverse=True)[1]
    b, a = np.bincount(numbers, before**2), np.bincount(numbers, after**2)
    units = len(b)
    if units < 2 or b.sum() == 0.0 or a.sum() == 0.0:
        return -np.inf, 100.0
    share = a / a.sum() - b / b.sum()
    variance, freedom = 0.0, 0
    drive = np.zeros(units, dtype=np.int64)
    if stratum is not None:
        drive[numbers] = stratum
    for shares in (share[drive == number_of_drive] for number_of_drive in np.unique(drive)):
        # A single unit says nothing of its drive's scatter: all of its share counts as such.
        size = len(shares)
        mean = float(shares.mean()) if size > 1 and units > size else 0.0
        variance += size / max(size - 1, 1) * float(np.sum((shares - mean) ** 2))
        freedom += max(size - 1, 0)
    if freedom < 1:
        return -np.inf, 100.0
    return _around(a.sum() / b.sum(), float(np.sqrt(variance)), freedom)


def interval_where_it_acts(
    before: Array, after: Array, unit: NDArray[np.int64]
) -> tuple[float, float] | None:
    """95 % confidence interval of the gain on these data, %; None where the models hardly differ.

    That an effect acts in some units and not in others is no uncertainty. A unit gains in
    proportion to the square by which the two models differ in it; what it gains more or less than
    that counts as scatter (ratio estimator; Cochran, Sampling Techniques, 1977, ch. 6). Where they
    differ in fewer than two units, nothing is known of how another one would do.

    Args:
        before: Residuals of the plain model, adhesion; shape (m,).
        after: Residuals of the extended model, adhesion; shape (m,).
        unit: Unit number of each row, shape (m,).

    """
    numbers = np.unique(unit, return_inverse=True)[1]
    b, a, acting = (
        np.bincount(numbers, residual**2).astype(np.float64)
        for residual in (before, after, before - after)
    )
    square = float(np.sum(acting**2))
    units = float(acting.sum()) ** 2 / square if square else 0.0
    if units < LEAST_UNITS or not (a.any() and b.any()):
        return None
    gain = b - a
    beside = gain - gain.sum() / acting.sum() * acting
    variance = units / (units - 1.0) * float(np.sum(beside**2))
    return _around(a.sum() / b.sum(), float(np.sqrt(variance) / b.sum()), units - 1.0)


def _around(ratio: float, std: float, freedom: float) -> tuple[float, float]:
    """Interval of the gain, %, around a ratio of mean squares whose logarithm has a given std."""
    middle = float(np.log(ratio))
    reach = float(scipy.stats.t.ppf((1.0 + CONFIDENCE) / 2, freedom)) * std
    low, high = (100.0 * (1.0 - np.exp((middle + side * reach) / 2)) for side in (1.0, -1.0))
    return float(low), float(high)
