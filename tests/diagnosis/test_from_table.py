"""TABLEs as courses: rows, times, axles, segments, covariates."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from adhesion_can.diagnosis.drive.from_table import _monotonic_times
from adhesion_can.diagnosis.regression.model import compute_factor
from adhesion_can.physics.effects import ActiveEffect, effect_by_id
from adhesion_can.physics.effects.formula import formula_of
from adhesion_can.physics.instruments import Instruments
from tests.diagnosis.diagnosis_helpers import build_table_drive, burckhardt

N = 600
LAGGING = formula_of("1 + a * lag(row, b)", {"a": 1e-3, "b": 0.1})


def columns(seed=1, n=N):
    rng = np.random.default_rng(seed)
    slip = rng.uniform(-0.2, 0.2, n)
    return {
        "slip": slip,
        "adhesion": burckhardt(slip) + 0.01 * rng.standard_normal(n),
        "speed": rng.uniform(5, 20, n),
        "load": rng.uniform(1e3, 5e3, n),
    }


def drive(given, t_s, axle=None, segment=None, **covariates):
    number = np.arange(len(t_s), dtype=float)
    return build_table_drive(
        given["slip"],
        given["adhesion"],
        t_s,
        axle=axle,
        speed=given["speed"],
        load=given["load"],
        segment=segment,
        covariates={"row": number, **covariates},
    )


def same_rows(made, given):
    """Every row says what it says in the table, wherever it stands now."""
    row = made.covariates["row"].astype(int)
    seen = made.observe()
    assert seen.slip == pytest.approx(given["slip"][row], abs=1e-9)
    assert seen.speed == pytest.approx(given["speed"][row], rel=1e-9)
    assert seen.load == pytest.approx(given["load"][row], rel=1e-9)
    assert seen.adhesion == pytest.approx(given["adhesion"][row], abs=1e-9)
    assert seen.creep_speed == pytest.approx((given["slip"] * given["speed"])[row], abs=1e-6)


ALTERNATING = np.arange(N) % 2
TIMES = {
    "one axle": (np.arange(N) * 0.01, None),
    "backwards": (np.arange(N)[::-1] * 0.01, None),
    "in any order": (np.random.default_rng(5).permutation(N) * 0.01, None),
    "axle after axle": (np.arange(N) * 0.01, np.repeat([4, 9], N // 2)),
    "axles in turn": (np.arange(N) * 0.01, ALTERNATING),
    "axles at the same times": (np.repeat(np.arange(N // 2), 2) * 0.01, ALTERNATING),
    "axles one after the other, same times": (
        np.tile(np.arange(N // 2), 2) * 0.01,
        np.repeat([1, 2], N // 2),
    ),
    "every stamp twice": (np.repeat(np.arange(N // 2), 2) * 0.01, None),
    "one stamp for all": (np.zeros(N), None),
}


@pytest.mark.parametrize("kind", TIMES)
def test_rows_stand_as_the_table_has_them(kind):
    given = columns()
    t_s, axle = TIMES[kind]
    made = drive(given, t_s, axle)
    assert len(made) == N
    assert sorted(made.covariates["row"]) == list(range(N))
    same_rows(made, given)


def test_rows_out_of_range_are_left_out_and_counted():
    given = columns()
    given["slip"][:7] = 0.9
    given["speed"][7:12] = 0.0
    given["load"][12:16] = -5.0
    given["speed"][16] = np.nan
    given["load"][17] = np.nan
    made = drive(given, np.arange(N) * 0.01)
    assert len(made) == N - 18
    assert sum(made.lost.values()) == 18
    same_rows(made, given)


def test_times_only_run_forwards_and_pauses_stay_apart():
    t = np.concatenate([np.arange(200) * 0.01, 50 + np.arange(200) * 0.01, np.arange(200) * 0.01])
    made = drive(columns(), t)
    step = np.diff(made.t_s)
    cuts = np.flatnonzero(step > 1.0) + 1
    assert cuts.tolist() == [200, 400]
    assert np.delete(step, cuts - 1) == pytest.approx(0.01)
    assert made.covariates["row"].tolist() == list(range(N))
    # What was travelled in a pause nobody knows; within a sweep it is the speed's integral.
    moved = np.diff(made.position)
    speed = made.observe().speed
    assert np.delete(moved, cuts - 1) == pytest.approx(np.delete(0.01 * speed[1:], cuts - 1))


@pytest.mark.parametrize(
    ("cycle_s", "pause_s"), [(0.01, 0.1), (0.01, 1.0), (0.05, 0.5), (1.0, 3.0)]
)
def test_a_pause_is_one_by_the_tables_own_cycle(cycle_s, pause_s):
    """Sweeps of a rig a second apart were taken for one."""
    t = np.arange(N) * cycle_s + np.repeat([0.0, pause_s], N // 2)
    made = drive(columns(), t)
    step = np.diff(made.t_s)
    assert step[N // 2 - 1] >= 10.0
    assert np.delete(step, N // 2 - 1) == pytest.approx(cycle_s)
    lost = np.delete(np.arange(N + 4), slice(N // 2, N // 2 + 4)) * 0.01
    assert np.diff(drive(columns(), lost).t_s).max() == pytest.approx(0.05)


@pytest.mark.parametrize(
    ("effect", "values"),
    [(effect_by_id("adhesion_recovery"), (4e-7, 3.0)), (LAGGING, (1e-3, 0.1))],
    ids=["adhesion_recovery", "formula"],
)
def test_lags_begin_anew_after_every_pause(effect, values):
    """They went on over a pause of up to a second: the answer hung on the length of the pause."""
    first = np.arange(N) * 0.01
    given, active = columns(), ActiveEffect(effect, values)

    def factor(pause_s):
        t = first + np.repeat([0.0, pause_s], N // 2)
        return compute_factor(drive(given, t), active)

    joined, *paused = [factor(pause_s) for pause_s in (0.0, 0.1, 1.0, 5.0)]
    for one in paused:
        np.testing.assert_allclose(one, paused[0], rtol=1e-12)
        assert not np.allclose(one[N // 2 :], joined[N // 2 :])


def test_segments_are_not_joined():
    t = np.arange(N) * 0.01
    made = drive(columns(), t, segment=np.arange(N) // 150)
    assert (np.flatnonzero(np.diff(made.t_s) > 1.0) + 1).tolist() == [150, 300, 450]


@pytest.mark.parametrize("numbers", [(2, 5, 6), (0, 1, 2), (-4, 3, 10), (1, 2, 900)])
def test_axles_keep_their_numbers_where_these_can_be_axles_and_stand_together(numbers):
    made = drive(columns(), np.arange(N) * 0.01, axle=np.array(numbers)[np.arange(N) % 3])
    plausible = min(numbers) > 0 and max(numbers) < 100
    assert np.unique(made.axle).tolist() == (list(numbers) if plausible else [1, 2, 3])
    assert len(made.radius) == made.axle.max()
    assert (np.diff(made.axle) >= 0).all()
    row = made.covariates["row"].astype(int)
    assert np.unique(made.axle)[row % 3].tolist() == made.axle.tolist()
    for number in np.unique(made.axle):
        assert (np.diff(made.t_s[made.axle == number]) > 0).all()


def test_a_covariate_with_a_hole_is_not_used():
    x = np.sin(np.arange(N) / 50)
    holed = x.copy()
    holed[5] = np.nan
    infinite = x.copy()
    infinite[9] = np.inf
    made = drive(columns(), np.arange(N) * 0.01, whole=x, holed=holed, infinite=infinite)
    assert set(made.covariates) == {"row", "whole"}


def test_a_hole_beside_the_rows_that_are_used_does_no_harm():
    given = columns()
    given["slip"][3] = 0.9
    holed = np.ones(N)
    holed[3] = np.nan
    made = drive(given, np.arange(N) * 0.01, holed=holed)
    assert "holed" in made.covariates


def test_without_speed_and_load_it_is_marked():
    slip = columns()["slip"]
    bare = build_table_drive(slip, burckhardt(slip))
    assert not bare.has_speed
    assert not bare.has_load
    full = drive(columns(), np.arange(N) * 0.01)
    assert full.has_speed
    assert full.has_load


def test_a_late_effort_is_read_later_along_its_own_axle():
    """Slips of 50 ms ago stand beside the adhesion of now, as a delay of the effort means."""
    given = columns()
    t = np.arange(N) * 0.01
    given["speed"][:], given["load"][:] = 10.0, 4000.0
    given["slip"] = 0.1 * np.sin(2 * np.pi * t / 3)
    made = drive(given, t)
    seen = made.observe(Instruments(effort_delay=0.05))
    assert seen.slip[5:] == pytest.approx(0.1 * np.sin(2 * np.pi * (t[5:] - 0.05) / 3), abs=1e-9)
    assert seen.adhesion == pytest.approx(given["adhesion"], abs=1e-9)


@settings(max_examples=40)
@given(
    st.lists(st.floats(-1e3, 1e3), min_size=1, max_size=60),
    st.integers(1, 4),
    st.integers(0, 1000),
)
def test_any_times_and_axles_give_every_row_once(times, axles, seed):
    rng = np.random.default_rng(seed)
    n = len(times)
    given = columns(seed, n)
    made = drive(given, np.array(times), rng.integers(0, axles, n), rng.integers(0, 3, n))
    assert sorted(made.covariates["row"]) == list(range(n))
    for number in np.unique(made.axle):
        assert (np.diff(made.t_s[made.axle == number]) >= 0).all()
    assert np.isfinite(made.observe().adhesion).all()
    assert np.isfinite(made.position).all()


@pytest.mark.parametrize("rows", [0, 1, 2])
def test_hardly_any_rows(rows):
    made = drive(columns(1, rows), np.arange(rows) * 0.01)
    assert len(made) == rows
    assert len(made.observe().slip) == rows


# --- several axles


def test_axles_of_one_clock_are_at_the_same_time_in_every_block():
    """A pause of one axle alone moved its rows to the blocks of other times."""
    given = columns(n=2 * N)
    t_s = np.tile(np.arange(N) * 0.05, 2)
    axle = np.repeat([1, 2], N)
    there = np.ones(2 * N, dtype=bool)
    there[N + 200 : N + 400] = False  # axle 2 for 10 s
    made = drive({name: values[there] for name, values in given.items()}, t_s[there], axle[there])
    times = [made.t_s[made.axle == number] for number in (1, 2)]
    row = [made.covariates["row"][made.axle == number] for number in (1, 2)]
    of_first = dict(zip(row[0].tolist(), times[0].tolist(), strict=True))
    kept = np.flatnonzero(there) % N
    assert len(times[1]) == N - 200
    for place, time in zip(kept[N:], times[1], strict=True):
        assert time == pytest.approx(of_first[float(place)], abs=1e-9)


def test_an_axle_that_was_measured_later_shares_no_time_with_the_first():
    given = columns(n=2 * N)
    t_s = np.concatenate([np.arange(N) * 0.05, 3600.0 + np.arange(N) * 0.05])
    made = drive(given, t_s, np.repeat([1, 2], N))
    first, second = (made.t_s[made.axle == number] for number in (1, 2))
    assert second.min() > first.max() + 1.0


def test_each_axle_travels_from_its_own_start():
    given = columns(n=2 * N)
    made = drive(given, np.tile(np.arange(N) * 0.05, 2), np.repeat([1, 2], N))
    first, second = (made.position[made.axle == number] for number in (1, 2))
    assert first[0] == second[0] == 0.0
    assert second[-1] == pytest.approx(first[-1], rel=0.1)


@given(
    st.lists(st.tuples(st.integers(1, 3), st.integers(0, 40)), min_size=2, max_size=60),
    st.booleans(),
)
def test_times_of_each_axle_rise_whatever_the_clock_does(rows, in_order):
    axle = np.array([number for number, _ in rows])
    t_s = np.array([0.5 * stamp for _, stamp in rows])
    if in_order:
        t_s.sort()
    made = _monotonic_times(t_s, np.zeros(len(rows), dtype=np.int64), axle)
    for number in np.unique(axle):
        own = made[axle == number]
        assert (np.diff(own) > 0.0).all()


def test_a_column_with_an_empty_cell_is_said_to_be_incomplete():
    wind = np.full(N, 5.0)
    wind[7] = np.nan
    made = build_table_drive(
        columns()["slip"], columns()["adhesion"], np.arange(N) * 0.05, covariates={"wind": wind}
    )
    assert "wind" not in made.covariates
    assert made.lost["channel wind"] == 1
