"""What the regression is prepared with: blocks, weights, errors of the speed, corrected slips."""

from math import ceil
from types import SimpleNamespace

import numpy as np
import pytest

from adhesion_can.diagnosis.regression.candidate import Candidate
from adhesion_can.diagnosis.regression.effect_derivatives import compute_signature
from adhesion_can.diagnosis.regression.gram_matrices import number_blocks
from adhesion_can.diagnosis.regression.model import (
    EvaluatedModel,
    Model,
    RegressionData,
    evaluate_model,
)
from adhesion_can.diagnosis.regression.prepare_regression import (
    _find_runs,
    _saturated_residual,
    choose_block_length,
    design_speed_errors,
    prepare_regression,
)
from adhesion_can.diagnosis.regression.segment_curves import SegmentCurves
from adhesion_can.physics.curves import Conditions
from adhesion_can.physics.effects import effect_by_id
from adhesion_can.physics.readings import Role
from adhesion_can.sampling.traces import Trace
from tests.diagnosis.diagnosis_helpers import (
    C1,
    C2,
    C3,
    SyntheticDrive,
    build_table_drive,
    burckhardt,
)
from tests.diagnosis.test_slip_noise import true_contact

CURVE = SegmentCurves(np.array([[C1, np.log(C2), C3]]))
BLOCK_S = 4.0


# ------------------------------------------------------------------------ length of the blocks


def recording(window_s):
    return SimpleNamespace(
        independent=False, table=False, speed_error=SimpleNamespace(window_s=window_s)
    )


def table(t_s):
    exact = SimpleNamespace(window_s=0.0)
    return SimpleNamespace(independent=False, table=True, t_s=np.asarray(t_s), speed_error=exact)


class Points(SimpleNamespace):
    def __init__(self, rows):
        super().__init__(independent=True, table=True, rows=rows)

    def __len__(self):
        return self.rows


@pytest.mark.parametrize(
    ("drives", "length_s"),
    [
        ([recording(0.5)], 4.0),
        ([recording(0.5), recording(3.5)], 7.0),
        ([recording(3.0), table([0.0, 1.0])], 6.0),
        # 120 blocks of what was driven, without its pauses.
        ([table(np.arange(0.0, 240.05, 0.05))], 2.0),
        ([table(np.arange(0.0, 120.05, 0.05)), table(np.arange(0.0, 60.05, 0.05))], 1.5),
        ([table([*np.arange(0.0, 240.05, 0.05), 9000.0])], 2.0),
        ([table(np.arange(0.0, 5.05, 0.05))], 0.2),
        ([table(np.arange(0.0, 3600.0, 0.5))], 4.0),
        ([table([0.0, 500.0, 1000.0])], 4.0),
        # Points stand 10 s apart: one a block, and at most 400 blocks.
        ([Points(60)], 10.0),
        ([Points(400)], 10.0),
        ([Points(300), Points(101)], 20.0),
        ([Points(1200)], 30.0),
    ],
)
def test_a_block_is_as_long_as_errors_of_the_speed_last_or_a_table_allows(drives, length_s):
    assert choose_block_length(drives) == pytest.approx(length_s)


# ------------------------------------------------------------------ errors of the vehicle speed


class Rows:
    """Rows at given times, with a speed and an error of it for each drive."""

    def __init__(self, *drives):
        self.drives = []
        for t_s, speed, std, window_s in drives:
            one = Points(len(t_s))
            one.t_s, one.speed = np.asarray(t_s), np.asarray(speed)
            one.speed_error = SimpleNamespace(std=std, window_s=window_s)
            self.drives.append(one)

    def __len__(self):
        return sum(map(len, self.drives))

    def column(self, name):
        return np.concatenate([getattr(drive, name) for drive in self.drives])

    observed = column


def evaluated(slip):
    one = np.ones(len(slip))
    return EvaluatedModel(0 * slip, slip, one, 0 * slip, Conditions(one))


def test_an_error_of_the_speed_moves_the_residual_by_slope_and_slip():
    """ω r / v − 1 with v that reads high by δ is lower by ω r δ / v²; the curve is by its slope."""
    rng, n = np.random.default_rng(1), 200
    t_s, speed, slip = np.sort(rng.uniform(0, 12, n)), rng.uniform(5, 20, n), rng.normal(0, 0.1, n)
    slope = rng.uniform(-1.0, 20.0, n)
    design = design_speed_errors(Rows((t_s, speed, 0.03, 1.0)), evaluated(slip), slope, BLOCK_S)
    by_hand = slope * (1.0 + slip) * speed / speed**2 * 0.03
    assert design.sum(axis=1) == pytest.approx(by_hand)
    # A line from knot to knot: two neighbouring ones share a row, by its distances to them.
    assert design.shape == (n, 9)
    share = design / by_hand[:, None]
    place = share @ np.arange(9.0)
    assert place == pytest.approx(t_s % BLOCK_S / BLOCK_S * 8.0)
    assert ((share > 1e-12).sum(axis=1) <= 2).all()
    assert share.min() >= -1e-12


@pytest.mark.parametrize(
    ("window_s", "knots"), [(100.0, 4), (2.7, 4), (2.0, 5), (1.1, 9), (0.7, 13), (0.1, 14)]
)
def test_knots_stand_half_a_window_apart(window_s, knots):
    assert min(max(ceil(2 * BLOCK_S / window_s) + 1, 4), 14) == knots
    rows = Rows((np.arange(10.0), np.full(10, 9.0), 0.02, window_s))
    design = design_speed_errors(rows, evaluated(np.zeros(10)), np.ones(10), BLOCK_S)
    assert design.shape == (10, knots)


def test_a_drive_whose_speed_is_exact_has_no_errors_and_sets_no_knots():
    t_s, speed = np.arange(10.0), np.full(10, 9.0)
    exact, noisy = (t_s, speed, 0.0, 0.05), (t_s, speed, 0.02, 2.0)
    design = design_speed_errors(Rows(exact, noisy), evaluated(np.zeros(20)), np.ones(20), BLOCK_S)
    assert design.shape == (20, 5)
    assert not design[:10].any()
    assert design[10:].sum(axis=1) == pytest.approx(np.full(10, 0.02 / 9.0))
    none = design_speed_errors(Rows(exact), evaluated(np.zeros(10)), np.ones(10), BLOCK_S)
    assert none.shape == (10, 0)


# ------------------------------------------------------------------------- the whole of a drive


@pytest.fixture(scope="module")
def prepared():
    """A drive with a vehicle speed that wanders by 0.03 m/s, and what it is prepared with."""
    rng, drive = np.random.default_rng(1), SyntheticDrive(30.0, axles=3)
    traces = drive.traces(rng)
    speed = traces[Role.VEHICLE_SPEED, 0]
    t_s = (speed.t_us - speed.t_us[0]) / 1e6
    wander = 0.03 * (np.sin(2 * np.pi * t_s / 3.1) + np.sin(2 * np.pi * t_s / 4.3 + 1.0))
    traces[Role.VEHICLE_SPEED, 0] = Trace(speed.t_us, speed.value + wander)
    data = drive.build_drive_data(traces=traces).select_rows(slice(None, None, 2))
    rows = RegressionData((data,), np.zeros(len(data), dtype=np.int64), 1)
    block = number_blocks(data.t_s, BLOCK_S)
    candidates = (Candidate(effect_by_id("load_dependence")), Candidate(effect_by_id("slow_drift")))
    found = prepare_regression(rows, CURVE, block, candidates, BLOCK_S)
    true_slip = np.concatenate(
        [drive.slip(axle, data.t_s[data.axle == axle]) for axle in (1, 2, 3)]
    )
    return found, true_slip


def test_whitened_residuals_have_unit_variance_and_little_correlation(prepared):
    found, _ = prepared
    regression = found.regression
    residual = regression.without_speed_errors(regression.residual(found.plain.model))
    white = regression.whiten(residual[:, None])[:, 0]
    assert np.mean(white**2) == pytest.approx(1.0, abs=0.35)
    same = np.diff(regression.data.column("axle")) == 0
    correlation = np.sum((white[1:] * white[:-1])[same]) / np.sum(white**2)
    assert abs(correlation) < 0.15


def test_the_scale_is_that_of_the_effort_where_the_curve_is_flat_and_of_the_slip_elsewhere(
    prepared,
):
    """1 % of the load, and slope times the noise of the slip: variances add up."""
    found, _ = prepared
    regression = found.regression
    at = evaluate_model(regression.data, found.plain.model.curves)
    slope = CURVE.slope(at.slip, regression.data.surface, at.conditions)
    std = regression.data.column("wheel_slip_std")
    effort = 1.0 / regression.scale[np.abs(slope) < 0.5]
    assert effort == pytest.approx(np.full(len(effort), 0.0105), rel=0.3)
    noise = float(np.median(effort))
    of_slip = (slope * std) ** 2
    assert 1.0 / regression.scale**2 == pytest.approx(noise**2 + of_slip, rel=0.1)
    share = of_slip / (noise**2 + of_slip)
    assert regression.slip_variance_share == pytest.approx(share, abs=0.02)


def test_slips_are_corrected_by_what_all_axles_show(prepared):
    """The speed reads high by 0.06 m/s at most: slips of all axles read low by up to 0.007."""
    found, true_slip = prepared
    regression = found.regression
    read = evaluate_model(regression.data, found.plain.model.curves).slip
    error = true_slip - read
    correction = regression.slip_correction
    steep = np.abs(true_slip) < 0.03
    assert np.corrcoef(correction[steep], error[steep])[0, 1] > 0.6
    left = np.std((error - correction)[steep]) / np.std(error[steep])
    assert left < 0.85
    assert 0.0 < regression.speed_error_std[0] <= regression.data.drives[0].speed_error.largest_std


def test_the_plain_fit_is_the_curve_that_the_drive_was_made_with(prepared):
    found, _ = prepared
    slip = np.linspace(0.005, 0.1, 20)
    fitted, true = (
        theta[0] * (1 - np.exp(-np.exp(theta[1]) * slip)) - theta[2] * slip
        for theta in (found.plain.model.curves.values[0], CURVE.values[0])
    )
    assert fitted == pytest.approx(true, abs=0.02)


def test_signatures_are_those_at_the_corrected_slips(prepared):
    found, _ = prepared
    regression = found.regression
    assert len(found.signatures) == len(found.candidates) == 2
    for candidate, signature in zip(found.candidates, found.signatures, strict=True):
        wanted = compute_signature(
            *(regression.data, found.plain.model, candidate, candidate.null_values),
            regression.slip_correction,
        )
        assert signature[:, 0] == pytest.approx(wanted, rel=1e-9, abs=1e-15)


def test_the_slips_of_a_table_have_the_noise_that_rows_show_which_decide():
    """A third is held out, and reads its slips with five times the noise."""
    rows, std = 4500, 2e-3
    t_s, slip, adhesion, speed = true_contact(rows)
    rng = np.random.default_rng(2)
    held = np.arange(rows) % 900 >= 600
    read = slip + np.where(held, 5.0, 1.0) * std * rng.standard_normal(rows)
    drive = build_table_drive(read, adhesion + 0.005 * rng.standard_normal(rows), t_s, speed=speed)
    data = RegressionData((drive,), np.zeros(rows, dtype=np.int64), 1)
    number = number_blocks(drive.t_s, 12.0)
    block = np.where(held, -1 - number, number)
    start = SegmentCurves(np.array([[1.0, np.log(25.0), 0.5]]))
    regression = prepare_regression(data, start, block, (), 12.0).regression
    steep = np.abs(read) < 0.005
    ratio = (24.0 * std / 0.005) ** 2
    assert np.median(regression.slip_variance_share[steep]) == pytest.approx(
        ratio / (1.0 + ratio), abs=0.03
    )
    assert regression.slip_variance_share.max() <= 1.0
    # At the steep start of the curve, 24 times the noise of the slip beside that of the adhesion.
    wanted = np.hypot(0.005, 24.0 * std)
    assert np.median(1.0 / regression.scale[steep]) == pytest.approx(wanted, rel=0.15)
    assert not regression.speed_error_design.size


def test_runs_end_with_their_drive_and_points_are_runs_of_their_own():
    """Also where the stamps go on from drive to drive, and where a drive has no rows."""
    lines = [SimpleNamespace(rows=rows, independent=rows == 2) for rows in (3, 4, 0, 2, 0)]

    class Lines(SimpleNamespace):
        def __len__(self):
            return self.rows

    data = Lines(rows=9, drives=[Lines(**vars(line)) for line in lines])
    data.column = lambda name: np.arange(9) * 0.1 if name == "t_s" else np.ones(9)
    assert _find_runs(data).starts.tolist() == [0, 3, 7, 8]


def test_where_all_rows_are_on_the_steep_start_their_own_noise_counts():
    rng, t_s = np.random.default_rng(3), np.arange(3000) * 0.05
    slip = 0.004 * np.sin(t_s)
    drive = build_table_drive(slip, burckhardt(slip) + 0.01 * rng.standard_normal(3000), t_s)
    data = RegressionData((drive,), np.zeros(3000, dtype=np.int64), 1)
    found = prepare_regression(data, CURVE, number_blocks(t_s, 2.0), (), 2.0).regression
    assert 1.0 / found.scale == pytest.approx(np.full(3000, 0.01), rel=0.1)


def test_what_any_effect_may_explain_is_left_out_of_the_noise():
    """Adhesion that falls by half where the load doubles, beside noise of 0.01."""
    rng, t_s = np.random.default_rng(4), np.arange(4000) * 0.05
    slip = 0.11 * np.sin(2 * np.pi * t_s / 7.0)
    load = np.exp(0.35 * np.sin(t_s / 3.0))
    adhesion = burckhardt(slip) / load + 0.01 * rng.standard_normal(4000)
    drive = build_table_drive(slip, adhesion, t_s, load=load)
    data = RegressionData((drive,), np.zeros(4000, dtype=np.int64), 1)
    block = number_blocks(t_s, 2.0)
    regression = prepare_regression(data, CURVE, block, (), 2.0).regression
    candidates = (Candidate(effect_by_id("load_dependence")),)
    left = _saturated_residual(regression, Model(CURVE), candidates)
    plain = evaluate_model(data, CURVE).residual
    assert np.std(plain) > 0.04
    assert np.std(left) == pytest.approx(0.01, rel=0.1)
