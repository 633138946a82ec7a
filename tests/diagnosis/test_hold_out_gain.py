"""The interval of a gain against Monte Carlo, and what a gain is reckoned from."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import lfilter

from adhesion_can.diagnosis.gain_result import Gain, GainMethod
from adhesion_can.diagnosis.inference.hold_out_gain import (
    HoldOutResult,
    HoldOutUnits,
    _compute_gains,
    compute_gain,
    evaluate_hold_out,
    gain_interval,
    interval_where_it_acts,
    is_significant,
)
from adhesion_can.diagnosis.inference.split_hold_out import split_by_length, split_hold_out
from adhesion_can.diagnosis.regression.candidate import Candidate
from adhesion_can.diagnosis.regression.model import Model, RegressionData
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
