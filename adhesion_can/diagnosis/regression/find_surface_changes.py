"""Step 2, find surface changes: times between which one adhesion curve holds (a nuisance here).

Candidate times come from the segmentation of `identify`. Backward elimination keeps a change only
where nothing else explains it: without it the sum of squares must be larger even when every effect
of the library is fitted too, linearised, and splines in slip and creep speed, which stand for a
curve of another family. A surface change is sudden and large; what an effect does over a drive
looks like many small ones.
"""

from dataclasses import replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from adhesion_can.arrays import Array
from adhesion_can.diagnosis.drive.drive_data import DriveData
from adhesion_can.diagnosis.regression.candidate import Candidate
from adhesion_can.diagnosis.regression.channel_splines import Channel, ChannelKind
from adhesion_can.diagnosis.regression.effect_derivatives import compute_signature
from adhesion_can.diagnosis.regression.gram_matrices import solve_normal_equations
from adhesion_can.diagnosis.regression.model import (
    EXCLUDED,
    Model,
    RegressionData,
    compute_curve_jacobian,
    evaluate_model,
)
from adhesion_can.diagnosis.regression.segment_curves import SegmentCurves
from adhesion_can.estimation.batch_fit import SegmentationSettings, change_points, fit
from adhesion_can.physics import burckhardt
from adhesion_can.physics.samples import Samples

SETTINGS = SegmentationSettings(chunk_s=0.2, shortest_s=6.0, penalty=4.0, noise_gain=0.05)
LEAST_INCREASE = 0.04
"""Share by which the sum of squares must rise without a change for the change to be kept."""
LEAST_ROWS, MOST_ROWS = 500, 6_000
"""Rows of a drive without which no change is looked for, and to which it is thinned."""
EXCLUDED_AROUND_S = 2.0
"""Rows this close to a change are left out, since each axle meets it at its own time, s."""
PASSES = 3
"""Largest number of Gauss-Newton passes over the curves of a trial."""
LEAST_CURVE_ROWS, MOST_CURVE_ROWS = 10, 3_000
"""Rows without which no curve is fitted, and to which a surface is thinned for its start curve."""
DEFAULT_CURVE = (0.3, 40.0, 0.1)
"""Curve parameters c1, c2 and c3 of a surface with too few rows."""


def build_samples(drive: DriveData, rows: NDArray[np.int64] | slice = slice(None)) -> Samples:
    """Rows of a drive as samples, in the order of `rows`."""
    observed = drive.observe()
    plain = Samples.curve(observed.slip[rows], observed.adhesion[rows])
    t_us = np.round(drive.t_s[rows] * 1e6).astype(np.int64)
    return replace(plain, t_us=t_us, axle=drive.axle[rows], speed=observed.speed[rows])


def find_surface_changes(drive: DriveData, candidates: tuple[Candidate, ...]) -> list[float]:
    """Times at which the surface changed, s since the drive's first row, ascending.

    Args:
        drive: Drive data; a sample table has no changes.
        candidates: Effects that may explain the data instead of a change.

    """
    if drive.table or len(drive) < LEAST_ROWS:
        return []
    thin = _thin_rows(drive)
    order = np.argsort(thin.t_s, kind="stable")
    samples = build_samples(thin, order)
    times = [float(samples.t_us[row]) / 1e6 for row in change_points(samples, SETTINGS)]
    if not times:
        return []
    times = _eliminate_changes(_ChangeTrial(thin, times, candidates), times)
    return _refine_change_times(thin, _refine_change_times(thin, times))


def _eliminate_changes(trial: "_ChangeTrial", times: list[float]) -> list[float]:
    """Remove the least important change, again and again, until each one left is needed."""
    times = list(times)
    while times:
        square = trial.mean_square(times)
        without = [trial.mean_square(times[:i] + times[i + 1 :]) for i in range(len(times))]
        least = int(np.argmin(without))
        if without[least] > (1.0 + LEAST_INCREASE) * square:
            break
        del times[least]
    return times


def _refine_change_times(drive: DriveData, times: list[float]) -> list[float]:
    """Move each change to the time that separates the curves around it best, s."""
    data = build_regression_data((drive,), [times])
    curves = fit_start_curves(data).values
    adhesion, slip = drive.observe().adhesion, drive.observe().slip
    order = np.argsort(drive.t_s, kind="stable")
    t_s = drive.t_s[order]
    bounds = [t_s[0], *times, t_s[-1]]
    refined = []
    for number, time in enumerate(times):
        low, high = (bounds[number] + time) / 2, (bounds[number + 2] + time) / 2
        rows = order[(t_s >= low) & (t_s < high)]
        squares = []
        for c1, log_c2, c3 in curves[number : number + 2]:
            curve = burckhardt.adhesion(slip[rows], c1, np.exp(log_c2), c3)
            squares.append((adhesion[rows] - curve) ** 2)
        cost = np.cumsum(squares[0] - squares[1])
        refined.append(float(drive.t_s[rows[int(np.argmin(cost))]]) if len(rows) else time)
    return sorted(refined)


def _thin_rows(drive: DriveData) -> DriveData:
    """Every k-th row, so that about `MOST_ROWS` are left."""
    step = max(len(drive) // MOST_ROWS, 1)
    return drive.select_rows(slice(None, None, step))


def build_regression_data(
    drives: tuple[DriveData, ...], change_times: list[list[float]]
) -> RegressionData:
    """Regression data with a surface for each segment between changes.

    Args:
        drives: Drive data of each recording.
        change_times: Times of the surface changes in each drive, s.

    """
    numbers, base = [], 0
    for drive, times in zip(drives, change_times, strict=True):
        number = np.searchsorted(times, drive.t_s, side="right") + base
        for time in times:
            number[np.abs(drive.t_s - time) < EXCLUDED_AROUND_S] = EXCLUDED
        numbers.append(number)
        base += len(times) + 1
    surface = np.concatenate(numbers) if numbers else np.empty(0, dtype=np.int64)
    return RegressionData(drives, surface.astype(np.int64), base)


def fit_start_curves(data: RegressionData) -> SegmentCurves:
    """Curve parameters to start with: the fit of `identify` to each surface."""
    return SegmentCurves(np.array([_fit_curve(data, number) for number in range(data.surfaces)]))


def _fit_curve(data: RegressionData, number: int) -> Array:
    """(c1, ln c2, c3) of one surface by the fit of `identify` to some of its rows, shape (3,)."""
    rows = np.flatnonzero(data.surface == number)
    if len(rows) < LEAST_CURVE_ROWS:
        c1, c2, c3 = DEFAULT_CURVE
        return np.array([c1, np.log(c2), c3])
    rows = rows[:: max(len(rows) // MOST_CURVE_ROWS, 1)]
    estimate = fit(Samples.curve(data.observed("slip")[rows], data.observed("adhesion")[rows]))
    return np.array([estimate.c1, np.log(max(estimate.c2, 1.0)), estimate.c3])


class _ChangeTrial:
    """Sums of squares with a curve for each segment, every effect and any shape, linearised.

    Args:
        drive: Drive data, thinned.
        times: Candidate times of changes, s.
        candidates: Effects that may explain the data instead of a change.

    """

    def __init__(
        self, drive: DriveData, times: list[float], candidates: tuple[Candidate, ...]
    ) -> None:
        self._drive = drive
        self._curves: dict[tuple[float, float], Array] = {}
        data, model = self._start(times)
        signatures = [compute_signature(data, model, c, c.null_values)[:, None] for c in candidates]
        self._signatures = np.column_stack([*signatures, *_shape_splines(data, model)])
        # Many columns, and few rows that are left out: their products are made once.
        self._gram = self._signatures.T @ self._signatures

    def mean_square(self, times: list[float]) -> float:
        """Mean square of the residual with changes at given times, s."""
        data, model = self._start(times)
        used = data.surface != EXCLUDED
        left_out = self._signatures[~used]
        gram = self._gram - left_out.T @ left_out
        square = np.inf
        for _ in range(PASSES):
            evaluation = evaluate_model(data, model.curves)
            jacobian = compute_curve_jacobian(data, model.curves, evaluation) * used[:, None]
            residual = evaluation.residual * used
            cross = jacobian.T @ self._signatures
            answer = solve_normal_equations(
                np.block([[jacobian.T @ jacobian, cross], [cross.T, gram]]),
                np.concatenate([residual @ jacobian, residual @ self._signatures]),
            )
            curves = jacobian.shape[1]
            explained = jacobian @ answer[:curves] + self._signatures @ answer[curves:]
            reached = float(np.sum((residual - explained)[used] ** 2))
            if reached >= square:
                break
            square = reached
            # The effects stay linear; the curves move to where the effects need them.
            model = model.with_parameters(model.parameter_vector + answer[:curves])
        return square / max(int(used.sum()), 1)

    def _start(self, times: list[float]) -> tuple[RegressionData, Model]:
        """Data and start model with changes at given times; each segment's curve is fitted once."""
        data = build_regression_data((self._drive,), [times])
        bounds = list(pairwise([-np.inf, *times, np.inf]))
        for number, ends in enumerate(bounds):
            if ends not in self._curves:
                self._curves[ends] = _fit_curve(data, number)
        return data, Model(SegmentCurves(np.array([self._curves[ends] for ends in bounds])))


def _shape_splines(data: RegressionData, model: Model) -> list[Array]:
    """Changes of the prediction by splines in slip and creep speed, shape (n, columns) each.

    The best Burckhardt curve of a contact of another family depends on the slips and speeds that
    were driven, and so on the time: to a segmentation that is a surface that changes.
    """
    evaluation = evaluate_model(data, model.curves)
    size = np.abs(evaluation.slip)
    creep_speed = size * np.asarray(evaluation.conditions.speed)
    channels = [
        Channel(name, ChannelKind.FACTOR, values)
        for name, values in (("slip", size), ("creep_speed", creep_speed))
    ]
    return [channel.build_basis(evaluation) for channel in channels if not channel.constant]
