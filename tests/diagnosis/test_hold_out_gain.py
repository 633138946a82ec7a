"""The interval of a gain against Monte Carlo, and what a gain is reckoned from."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from scipy import stats
from scipy.signal import lfilter

from adhesion_can.diagnosis.gain_result import Gain, GainMethod
from adhesion_can.diagnosis.inference.hold_out_gain import (
    HoldOutResult,
    HoldOutUnits,
    _compute_gains,
    _left_out_residuals,
    compute_gain,
    compute_leave_one_out_gain,
    evaluate_hold_out,
    gain_interval,
    group_hold_out,
    interval_where_it_acts,
    is_significant,
)
from adhesion_can.diagnosis.inference.split_hold_out import (
    held_blocks,
    split_by_length,
    split_hold_out,
)
from adhesion_can.diagnosis.regression.candidate import Candidate
from adhesion_can.diagnosis.regression.model import (
    Model,
    RegressionData,
    compute_curve_jacobian,
    evaluate_model,
)
from adhesion_can.diagnosis.regression.segment_curves import SegmentCurves
from adhesion_can.diagnosis.regression.whitened_regression import WhitenedRegression, fit_model
from adhesion_can.diagnosis.regression.whitening import ContiguousRuns, Whitener
from adhesion_can.physics.effects import effect_by_id
from tests.diagnosis.diagnosis_helpers import build_table_drive, burckhardt


def residuals(rng, units, rows, effect, memory, spread):
    """Noise that remembers, louder in some units, and an effect that is stronger in some."""
    n = units * rows
    noise = lfilter([np.sqrt(1 - memory**2)], [1, -memory], rng.standard_normal(n + 500))[500:]
    loud = np.repeat(np.exp(spread * rng.standard_normal(units)), rows)
    strong = np.repeat(1 + 2 * spread * rng.standard_normal(units), rows)
    after = loud * noise
    before = after + effect * strong * np.sin(np.arange(n) / 3)
    return before, after, np.repeat(np.arange(units), rows)


@pytest.mark.parametrize("units", [6, 12, 40])
@pytest.mark.parametrize(("memory", "spread"), [(0.0, 0.0), (0.9, 0.15)])
def test_the_interval_covers_the_gain_of_ever_so_many_units(units, memory, spread):
    rng = np.random.default_rng(1)
    before, after, _ = residuals(rng, 20_000, 60, 0.8, memory, spread)
    true = 100 * (1 - np.sqrt(np.mean(after**2) / np.mean(before**2)))
    inside = []
    for _ in range(400):
        drawn = residuals(rng, units, 60, 0.8, memory, spread)
        low, high = gain_interval(*drawn)
        inside.append(low <= true <= high)
    # It covers in 93 to 95 of 100 (3000 draws each); beyond these bounds in one of 10^5 seeds.
    assert 0.87 <= np.mean(inside) <= 0.995


def test_rows_are_no_units():
    """With noise that lasts, an interval that took each row for itself would be far too short."""
    rng, ratios = np.random.default_rng(2), []
    for _ in range(40):
        before, after, unit = residuals(rng, 20, 200, 0.5, 0.98, 0.1)
        by_units = np.diff(gain_interval(before, after, unit))[0]
        by_rows = np.diff(gain_interval(before, after, np.arange(len(before))))[0]
        ratios.append(by_units / by_rows)
    # 2.05 with a standard deviation of 0.4 (300 draws): seven standard errors of the mean.
    assert np.mean(ratios) > 1.6


def acting_in_a_few(rng, *, units=14, acting=4, rows=400, effect=0.7, memory=0.6):
    """Residuals of an effect that acts in a few units alone, as in bends."""
    n = units * rows
    noise = lfilter([np.sqrt(1 - memory**2)], [1, -memory], rng.standard_normal(n + 500))[500:]
    unit = np.repeat(np.arange(units), rows)
    by_effect = effect * np.sin(np.arange(n) / 3) * (unit < acting)
    return noise + by_effect, noise, unit


def test_what_acts_in_few_units_gains_for_certain_where_it_acts():
    """In three of 14: over units the interval always holds 0, on these data in one draw of four."""
    rng, over_units, here = np.random.default_rng(5), [], []
    for _ in range(200):
        drawn = acting_in_a_few(rng, acting=3)
        over_units.append(gain_interval(*drawn)[0] > 0.0)
        here.append(interval_where_it_acts(*drawn)[0] > 0.0)
    # 0.00 and 0.74 in 1000 draws: 0.6 is four standard errors away.
    assert np.mean(over_units) < 0.1
    assert np.mean(here) > 0.6


def test_the_interval_where_it_acts_covers_the_gain_of_other_noise():
    rng, inside = np.random.default_rng(6), []
    for _ in range(600):
        before, after, unit = acting_in_a_few(rng, memory=0.0, acting=6)
        true = 100 * (1 - 1 / np.sqrt(1 + np.mean((before - after) ** 2)))
        low, high = interval_where_it_acts(before, after, unit)
        inside.append(low <= true <= high)
    # 0.95 in 3000 draws.
    assert 0.9 < np.mean(inside) < 0.99


def test_a_model_of_noise_gains_nowhere_for_certain():
    """Predictions that have nothing to do with what was held out: one in 200 draws at most."""
    rng, gaining = np.random.default_rng(7), 0
    for _ in range(400):
        noise = rng.standard_normal(1400)
        made_up = 0.1 * rng.standard_normal(1400) * np.repeat(rng.integers(0, 2, 14), 100)
        found = interval_where_it_acts(noise, noise - made_up, np.repeat(np.arange(14), 100))
        gaining += found is not None and found[0] > 0.0
    assert gaining <= 8


@pytest.mark.parametrize("acting", [0, 1])
def test_less_than_two_units_that_act_give_no_interval(acting):
    drawn = acting_in_a_few(np.random.default_rng(8), acting=acting)
    assert interval_where_it_acts(*drawn) is None


def test_numbers_of_units_are_names_only():
    rng = np.random.default_rng(3)
    before, after, unit = residuals(rng, 9, 50, 0.5, 0.5, 0.1)
    order = rng.permutation(len(unit))
    named = (unit * 37 - 5)[order]
    assert gain_interval(before[order], after[order], named) == pytest.approx(
        gain_interval(before, after, unit)
    )


def test_a_loss_has_an_interval_below_zero():
    rng = np.random.default_rng(4)
    before, after, unit = residuals(rng, 30, 100, 1.0, 0.0, 0.0)
    low, high = gain_interval(after, before, unit)
    assert low < high < 0


@pytest.mark.parametrize("units", [0, 1])
def test_one_unit_gives_no_interval(units):
    n = 50 * units
    low, high = gain_interval(np.ones(n), 0.5 * np.ones(n), np.zeros(n, dtype=np.int64))
    assert low == -np.inf
    assert high == 100.0


def test_a_gain_is_of_the_root_of_the_mean_square():
    held = HoldOutResult(
        np.arange(4), np.array([3.0, -3.0, 5.0, -5.0]), np.array([1.0, 1.0, 2.0, -2.0])
    )
    gain = compute_gain(held, HoldOutUnits(np.array([0, 0, 1, 1]), "two", ()), 0.5)
    assert gain.rmse_before == pytest.approx(np.sqrt(17))
    assert gain.rmse_after == pytest.approx(np.sqrt(2.5))
    assert gain.percent == pytest.approx(100 * (1 - np.sqrt(2.5 / 17)))
    assert gain.interval[0] < gain.percent < gain.interval[1]


# --- held out


def build_regression(drive, block):
    n, zero = len(drive), np.zeros(len(drive))
    data = RegressionData((drive,), np.zeros(n, dtype=np.int64), 1)
    whitener = Whitener(np.array([1.0]), ContiguousRuns(np.zeros(1, dtype=np.int64), n))
    return WhitenedRegression(
        data, np.ones(n), zero, np.zeros((n, 0)), np.zeros(1), zero, whitener, np.ones(n), block
    )


def humid_table(rng, n=3000):
    t = np.arange(n) * 0.05
    humidity = 65 + 20 * np.sin(2 * np.pi * t / 37)
    slip = 0.11 * np.sin(2 * np.pi * t / 7.0)
    mu = (1 - 0.006 * (humidity - 60)) * burckhardt(slip) + 0.01 * rng.standard_normal(n)
    return build_table_drive(slip, mu, t, covariates={"relative_humidity_percent": humidity}), t


def table_of(duration_s, step_s):
    t = np.arange(0.0, duration_s, step_s)
    slip = 0.11 * np.sin(2 * np.pi * t / 7.0)
    return build_table_drive(slip, burckhardt(slip), t)


def test_a_drive_is_short_by_its_time_and_not_by_its_rows():
    slow, quick, short = table_of(200.0, 0.2), table_of(200.0, 0.05), table_of(60.0, 0.02)
    assert len(slow) < len(short) < len(quick)
    assert split_by_length([slow, quick, short]) == ([slow, quick], [short])
    block = np.split(split_hold_out([slow, short], [False, False], 4.0), [len(slow)])
    held = [np.mean(own < 0) for own in block]
    assert held == pytest.approx([1 / 3, 1 / 2], abs=0.05)


def test_a_pause_is_no_time_of_a_drive():
    t = np.arange(0.0, 60.0, 0.05)
    slip = 0.11 * np.sin(2 * np.pi * t / 7.0)
    paused = build_table_drive(slip, burckhardt(slip), np.where(t < 30.0, t, t + 500.0))
    assert split_by_length([paused, table_of(200.0, 0.05)])[1] == [paused]


@pytest.mark.parametrize("other_drives", [False, True])
def test_what_was_held_out_had_no_part_in_the_fit(other_drives):
    """Whatever stands in the rows held out, the effect that is judged stays the same."""
    drive, t = humid_table(np.random.default_rng(5))
    number = np.floor(t / 10).astype(np.int64)
    block = np.where(number % 3 == 1, -1 - number, number)
    regression = build_regression(drive, block)
    plain = fit_model(regression, Model(SegmentCurves(np.array([[0.3, 3.5, 0.3]])))).model
    extended = fit_model(regression, plain.with_effect(Candidate(effect_by_id("humidity")))).model
    held = evaluate_hold_out(regression, plain, extended, None, other_drives=other_drives)
    assert held.rows.tolist() == np.flatnonzero(block < 0).tolist()
    # 1000 rows: six standard errors.
    assert np.std(held.after) == pytest.approx(0.01, rel=0.14)
    assert np.std(held.before) > 1.5 * np.std(held.after)
    # Noise on top of them shows in full: nothing was fitted to it.
    noise = 0.05 * np.random.default_rng(6).standard_normal(len(drive)) * (block < 0)
    regression = build_regression(replace(drive, effort=drive.effort + noise), block)
    again = fit_model(regression, plain.with_effect(Candidate(effect_by_id("humidity")))).model
    assert again.parameter_vector == pytest.approx(extended.parameter_vector)
    louder = evaluate_hold_out(regression, plain, again, None, other_drives=other_drives)
    assert np.std(louder.after) == pytest.approx(np.hypot(0.01, 0.05), rel=0.14)


@pytest.mark.parametrize("other_drives", [False, True])
def test_rows_of_another_law_do_not_move_the_model_that_predicts_them(other_drives):
    """Where humidity raises the adhesion of the rows held out, the model predicts a fall.

    A model that has seen them finds a law between both, and misses them by less.
    """
    drive, t = humid_table(np.random.default_rng(5))
    number = np.floor(t / 10).astype(np.int64)
    held = number % 3 == 1
    humidity = drive.covariates["relative_humidity_percent"]
    turned = (1 + 0.006 * (humidity - 60)) / (1 - 0.006 * (humidity - 60))
    drive = replace(drive, effort=np.where(held, turned, 1.0) * drive.effort)
    regression = build_regression(drive, np.where(held, -1 - number, number))
    plain = fit_model(regression, Model(SegmentCurves(np.array([[0.3, 3.5, 0.3]])))).model
    extended = fit_model(regression, plain.with_effect(Candidate(effect_by_id("humidity")))).model
    assert extended.active_effects[0].values == pytest.approx([-0.006], rel=0.1)
    result = evaluate_hold_out(regression, plain, extended, None, other_drives=other_drives)
    # Twice the slope between truth and prediction; curves of their own take off its mean.
    gap = 0.012 * (humidity[held] - (humidity[held].mean() if other_drives else 60))
    missed = gap * burckhardt(0.11 * np.sin(2 * np.pi * t[held] / 7.0))
    assert np.std(result.after) == pytest.approx(np.hypot(np.std(missed), 0.01), rel=0.15)


@pytest.mark.parametrize(
    ("percent", "low", "is_sure"),
    [
        (5.0, 1.0, True),
        (5.0, -1.0, False),
        (5.0, 0.0, False),
        (-1.0, -2.0, False),
        (5.0, -np.inf, True),
    ],
)
def test_a_gain_is_significant_where_its_interval_leaves_zero_out(percent, low, is_sure):
    assert is_significant(Gain(1.0, 0.95, 0.5, percent, (low, 9.0), "", ())) is is_sure


def test_another_drive_has_a_surface_of_its_own():
    """Twice the adhesion on the drive held out: its own curve takes that, for both models."""
    rng = np.random.default_rng(7)
    drive, t = humid_table(rng)
    late = t > 75
    drive = replace(drive, effort=np.where(late, 2 * drive.effort, drive.effort))
    number = np.floor(t / 10).astype(np.int64)
    regression = build_regression(drive, np.where(late, -1 - number, number))
    plain = fit_model(regression, Model(SegmentCurves(np.array([[0.3, 3.5, 0.3]])))).model
    extended = fit_model(regression, plain.with_effect(Candidate(effect_by_id("humidity")))).model
    same_surface = evaluate_hold_out(regression, plain, extended, None, other_drives=False)
    own_surface = evaluate_hold_out(regression, plain, extended, None, other_drives=True)
    assert np.std(own_surface.after) == pytest.approx(0.02, rel=0.1)
    assert np.std(own_surface.before) > 1.5 * np.std(own_surface.after)
    assert np.std(same_surface.after) > 0.1


def test_where_an_effect_acts_in_some_units_there_is_a_second_interval():
    """The same gain, and the interval of these very data; none where less than two units act."""
    for acting, methods in (
        (4, [GainMethod.PLAIN, GainMethod.WHERE_IT_ACTS]), (1, [GainMethod.PLAIN])
    ):  # fmt: skip
        before, after, unit = acting_in_a_few(np.random.default_rng(3), acting=acting)
        result = HoldOutResult(np.arange(len(unit)), before, after)
        units = HoldOutUnits(unit, "blocks", ())
        gains = list(_compute_gains(result, units, 0.5, GainMethod.PLAIN))
        assert [gain.method for gain in gains] == methods
        assert len({gain.percent for gain in gains}) == 1
        if acting > 1:
            assert gains[1].interval == interval_where_it_acts(before, after, unit)


@pytest.mark.parametrize("strata", [[0] * 7, [0, 0, 0, 1, 1, 1, 1], [0, 0, 0, 0, 1, 1, 2]])
def test_the_interval_is_that_of_stratified_sums_of_squares(strata):
    """Cochran's formulas unit by unit; one of a drive by itself counts with all of its share."""
    rng, stratum = np.random.default_rng(11), np.array(strata)
    unit = np.repeat(np.arange(7) * 3 + 5, 20)
    after = rng.standard_normal(140)
    before = 1.2 * after + 0.5 * rng.standard_normal(140)
    b, a = (np.array([np.sum(one[unit == u] ** 2) for u in np.unique(unit)])
            for one in (before, after))  # fmt: skip
    share, variance, freedom = a / a.sum() - b / b.sum(), 0.0, 0
    for one in set(strata):
        own = share[stratum == one]
        n = len(own)
        middle = own.mean() if 1 < n < 7 else 0.0
        variance += n / max(n - 1, 1) * np.sum((own - middle) ** 2)
        freedom += n - 1
    reach = stats.t.ppf(0.975, freedom) * np.sqrt(variance)
    ratio = np.log(a.sum() / b.sum())
    wanted = [100 * (1 - np.exp((ratio + side * reach) / 2)) for side in (1, -1)]
    assert gain_interval(before, after, unit, np.repeat(stratum, 20)) == pytest.approx(wanted)


def test_a_model_that_leaves_nothing_has_no_interval_where_it_acts():
    unit = np.repeat(np.arange(5), 10)
    assert interval_where_it_acts(np.ones(50), np.zeros(50), unit) is None
    assert interval_where_it_acts(np.zeros(50), np.ones(50), unit) is None


# ------------------------------------------------------------------ points, each left out in turn


def left_out_by_hand(design, residual, block):
    """Residuals by the least squares of the other blocks."""
    out = np.empty(len(residual))
    for b in np.unique(block):
        own = block == b
        out[own] = (
            residual[own]
            - design[own] @ np.linalg.lstsq(design[~own], residual[~own], rcond=None)[0]
        )
    return out


def points(block, scale=1.0, weight=1.0):
    """A regression of independent points, of which its columns are given as models."""
    n = len(block)
    return SimpleNamespace(
        block=block, used=block >= 0, scale=np.full(n, scale), weight=np.full(n, weight),
        build_columns=lambda columns: columns.copy(), whiten=lambda columns: columns,
    )  # fmt: skip


def fitted_columns(rng, rows, effect=0.0):
    """Columns of a fitted model and its residual, and a further column with an effect in it."""
    design, further = rng.standard_normal((rows, 3)), rng.standard_normal((rows, 1))
    response = effect * further[:, 0] + rng.standard_normal(rows)
    residual = response - design @ np.linalg.lstsq(design, response, rcond=None)[0]
    return np.column_stack([design, residual]), further


@pytest.mark.parametrize("size", [1, 4])
def test_each_block_is_predicted_from_the_others(size):
    columns, _ = fitted_columns(np.random.default_rng(12), 24)
    block = np.repeat(np.arange(24 // size), size)
    found = _left_out_residuals(points(block, 8.0, 0.5), columns)
    assert found == pytest.approx(left_out_by_hand(columns[:, :-1], columns[:, -1], block) / 4.0)


@pytest.mark.parametrize(("size", "what"), [(1, "each point in turn"), (4, "each random group")])
def test_the_gain_of_points_is_that_of_all_of_them_left_out_in_turn(size, what):
    columns, further = fitted_columns(np.random.default_rng(13), 40, effect=2.0)
    block = np.repeat(np.arange(40 // size), size)
    channel = SimpleNamespace(basis=further)
    found = compute_leave_one_out_gain(points(block), columns, columns, channel, 0.7)
    design, residual = columns[:, :-1], columns[:, -1]
    before = left_out_by_hand(design, residual, block)
    after = left_out_by_hand(np.column_stack([design, further]), residual, block)
    rms = [np.sqrt(np.mean(one**2)) for one in (before, after)]
    assert (found.rmse_before, found.rmse_after) == pytest.approx(rms)
    assert found.percent == pytest.approx(100.0 * (1.0 - rms[1] / rms[0]))
    assert found.percent > 40.0
    assert what in found.units
    same = compute_leave_one_out_gain(points(block), columns, columns, None, 0.7)
    assert (same.percent, same.interval) == (0.0, (0.0, 0.0))


# --------------------------------------------------------------------- groups of what is held out


@pytest.mark.parametrize("by_drive", [False, True])
def test_a_channel_in_another_drive_leaves_nothing_that_its_own_curve_explains(by_drive):
    """The curve of the drive that was held out is fitted again, after the channel."""
    data, regression, plain, wave = channel_beside_a_drive(by_drive)
    channel = SimpleNamespace(spline_change=wave, prediction_change=0.0 * wave)
    found = evaluate_hold_out(regression, plain, plain, channel, other_drives=True)
    assert found.rows.tolist() == np.flatnonzero(data.drive_number == 1).tolist()
    jacobian = compute_curve_jacobian(data, plain.curves, evaluate_model(data, plain.curves))
    own = jacobian[found.rows]
    cosines = own.T @ found.after / np.linalg.norm(own, axis=0) / np.linalg.norm(found.after)
    assert np.abs(cosines).max() < 0.02
    assert np.std(found.after) < (0.6 if by_drive else 1.001) * np.std(found.before)


def channel_beside_a_drive(with_wave):
    """Two drives, the second held out, on which a wave of the adhesion may lie."""
    drives = []
    for seed in (1, 2):
        rng, t_s = np.random.default_rng(seed), np.arange(2000) * 0.05
        slip = 0.11 * np.sin(2 * np.pi * t_s / 7.0)
        wave = 0.03 * np.sin(t_s)
        mu = burckhardt(slip) + with_wave * wave + 0.01 * rng.standard_normal(2000)
        drives.append(build_table_drive(slip, mu, t_s))
    data = RegressionData(tuple(drives), np.zeros(4000, dtype=np.int64), 1)
    number = np.repeat([0, 1], 2000) * 100 + np.floor(data.column("t_s") / 2.0).astype(int)
    whitener = Whitener(np.array([1.0]), ContiguousRuns(np.array([0, 2000]), 4000))
    zero = np.zeros(4000)
    regression = WhitenedRegression(
        data, np.full(4000, 100.0), zero, np.zeros((4000, 0)), np.zeros(2), zero, whitener,
        np.ones(4000), np.where(data.drive_number == 1, -1 - number, number),
    )  # fmt: skip
    start = Model(SegmentCurves(np.array([[0.3, 3.5, 0.3]])))
    waves = np.tile(0.03 * np.sin(np.arange(2000) * 0.05), 2) * with_wave
    return data, regression, fit_model(regression, start).model, waves


def test_spans_are_those_of_blocks_that_were_held_out_together():
    """Two spans of three blocks of 2 s in a drive of 40 s, on the clock of the recording."""
    _, regression, _, _ = channel_beside_a_drive(False)
    drive = regression.data.drives[0]
    data = RegressionData((drive,), np.zeros(2000, dtype=np.int64), 1)
    width = held_blocks(1)
    number = np.floor(drive.t_s / 2.0).astype(int)
    held = np.isin(number // width, [1, 3])
    one = replace(regression, data=data, block=np.where(held, -1 - number, number))
    found = group_hold_out(one, np.flatnonzero(held), block_length_s=2.0, other_drives=False)
    start_s = drive.first_us / 1e6
    spans = [(k * 2.0 * width, (k + 1) * 2.0 * width - 0.05) for k in (1, 3)]
    assert [one[0] for one in found.spans] == [drive.name] * 2
    for (_, first, last), wanted in zip(found.spans, spans, strict=True):
        assert (first - start_s, last - start_s) == pytest.approx(wanted, abs=1e-6)
    assert set(found.unit) == set(number[held])
    share = round(100 * held.sum() / 2000)
    assert found.description == (
        f"this drive only: 2 spans of {2.0 * width:.1f} s, {share} % of the rows"
    )
    assert not found.whole


@pytest.mark.parametrize(("drives", "each_is_one"), [(2, False), (3, True)])
def test_three_recordings_are_units_of_their_own(drives, each_is_one):
    _, regression, _, _ = channel_beside_a_drive(False)
    one = regression.data.drives[0]
    many = RegressionData((one,) * (drives + 1), np.zeros(2000 * (drives + 1), dtype=np.int64), 1)
    number = many.drive_number * 100 + np.floor(many.column("t_s") / 2.0).astype(int)
    held = many.drive_number > 0
    regression = replace(regression, data=many, block=np.where(held, -1 - number, number))
    rows = np.flatnonzero(held)
    found = group_hold_out(regression, rows, block_length_s=2.0, other_drives=True)
    wanted = many.drive_number if each_is_one else number
    assert found.unit.tolist() == wanted[rows].tolist()
    assert found.whole
    assert found.description.startswith(f"{drives} of {drives + 1} recordings: table")
