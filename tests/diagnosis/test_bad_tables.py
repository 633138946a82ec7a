"""TABLEs that allow no verdict, or not all of it: no crash, no name, and a reason."""

import numpy as np
import pytest

from tests.diagnosis.diagnosis_helpers import burckhardt, diagnosed, sweeps, write_table

N = 2400


def columns(seed=1, rows=N, **more):
    """A null table; other columns beside."""
    made = sweeps(np.random.default_rng(seed), rows)
    return {**made, **more}


def by_slip(slip, seed=9):
    """A null table with slips of one's own."""
    noise = 0.01 * np.random.default_rng(seed).standard_normal(len(slip))
    return columns(slip=slip, adhesion=burckhardt(slip) + noise)


T = columns()["time_s"]
SLIP = columns()["slip"]
RNG = np.random.default_rng(3)


def run(folder, given, *others):
    """Diagnosis of a table in which nothing is hidden: nothing may be named."""
    answer = diagnosed(folder, write_table(folder / "t.csv", given), *others)
    assert answer.status == 0, answer.err
    assert answer.named == set(), answer.out
    return answer


def holed(values, share, seed=4):
    values = np.array(values, dtype=float)
    values[np.random.default_rng(seed).random(len(values)) < share] = np.nan
    return values


def spikes(values):
    values = np.array(values)
    values[RNG.random(len(values)) < 0.001] = 1e6
    return values


SOUND = {
    "as it is": columns(),
    "a column of text": columns(note=["dry"] * N),
    "a channel that does not move": columns(x=np.full(N, 3.0)),
    "a channel that is never there": columns(x=np.full(N, np.nan)),
    "adhesion not there in places": columns(adhesion=holed(columns()["adhesion"], 0.3)),
    "speed not there in places": columns(speed_mps=holed(10 + np.sin(T / 9), 0.3)),
    "load not there in places": columns(normal_load_N=holed(4000 + 300 * np.sin(T / 9), 0.3)),
    "wild values": columns(adhesion=spikes(columns()["adhesion"])),
    "one load": columns(normal_load_N=np.full(N, 4000.0)),
    "every time twice": columns(time_s=np.repeat(T[::2], 2)),
    "time backwards": columns(time_s=T[::-1]),
    "times in any order": columns(time_s=RNG.permutation(T)),
    "rows five seconds apart": columns(time_s=T * 100),
    "two axles": columns(axle=np.repeat([1, 2], N // 2)),
    "axles in turn at other speeds": columns(
        axle=np.tile([1, 2], N // 2), speed_mps=np.tile([6.0, 15.0], N // 2)
    ),
    "odd numbers of axles": columns(axle=np.tile([-3, 70, 900, 2, 5], N // 5)),
    "segments": columns(segment=np.arange(N) // 100),
    "a segment for each row": columns(segment=np.arange(N)),
    "traction alone": by_slip(np.abs(SLIP)),
    "low creep alone": by_slip(0.1 * SLIP),
    "nothing below the peak": by_slip(0.1 + 0.1 * np.abs(SLIP)),
    "slips of three levels": by_slip(np.sign(SLIP) * np.round(np.abs(SLIP), 1)),
    "noise alone": columns(adhesion=0.1 * RNG.standard_normal(N)),
    "no noise": columns(adhesion=burckhardt(SLIP)),
    "sand that does nothing": columns(sanding_active=np.floor(T / 20) % 2),
    "a slip angle that does nothing": columns(slip_angle_deg=5 * np.sin(T / 31)),
}


@pytest.mark.costly
@pytest.mark.parametrize("kind", SOUND)
def test_nothing_is_found_where_nothing_is(kind, tmp_path):
    assert run(tmp_path, SOUND[kind]).verdict == "nothing_found"


EMPTY = {
    "five rows": (columns(rows=5), "usable rows"),
    "one row": (columns(rows=1), "usable rows"),
    "59 rows": (columns(rows=59), "usable rows"),
    "one constant slip": (by_slip(np.full(N, 0.05)), "slip hardly varies"),
    "almost one slip": (by_slip(0.05 + 0.0005 * np.sin(T)), "slip hardly varies"),
    "no slip": (by_slip(0 * T), "slip hardly varies"),
    "one time": (columns(time_s=0 * T), ""),
    "no adhesion": (columns(adhesion=0 * T), "adhesion hardly varies"),
}


@pytest.mark.parametrize("kind", EMPTY)
def test_no_verdict_from_data_that_cannot_carry_one(kind, tmp_path):
    given, reason = EMPTY[kind]
    answer = run(tmp_path, given)
    assert answer.verdict == "nothing_found"
    assert answer.document["gain"] is None
    assert reason in answer.untested["everything"]
    assert "No verdict" in answer.out


@pytest.mark.parametrize(
    "given",
    [
        columns(speed_mps=0 * T),
        columns(speed_mps=np.full(N, np.nan)),
        columns(normal_load_N=0 * T),
        columns(slip=0 * T + 0.9),
    ],
    ids=["speed 0", "no speed", "load 0", "slip 0.9"],
)
def test_without_one_usable_row_it_is_an_error_with_the_reason(given, tmp_path):
    answer = diagnosed(tmp_path, write_table(tmp_path / "t.csv", given))
    assert answer.status == 2
    assert answer.err.count("\n") == 1
    assert "no usable row" in answer.err


def test_what_a_bare_table_does_not_identify_is_listed(tmp_path):
    untested = run(tmp_path, columns()).untested
    assert "slip and adhesion" in untested["wheelset_inertia"]
    for effect in (
        "speed_delay",
        "wheel_speed_delay",
        "speed_dependence",
        "falling_friction",
        "creep_relaxation",
    ):
        assert "speed_mps" in untested[effect]
    assert "load" in untested["load_dependence"]
    assert "one axle" in untested["wheel_radius"]
    assert "no signal" in untested["humidity"]


@pytest.mark.parametrize(
    ("given", "says"),
    [
        (columns(adhesion=-columns()["adhesion"]), "--column slip=slip,sign=-1"),
        (columns(slip=-SLIP), "slip and force have opposite signs in 100 %"),
        (columns(slip=100 * SLIP), "--column slip=slip,unit=percent"),
        (columns(adhesion=100 * columns()["adhesion"]), "--column adhesion=adhesion,unit=percent"),
        (columns(speed_mps=np.full(N, 200.0)), "--column speed_mps=speed_mps,unit=km/h"),
    ],
)
def test_a_wrong_sign_or_unit_is_an_error_with_the_fix(given, says, tmp_path):
    answer = diagnosed(tmp_path, write_table(tmp_path / "t.csv", given))
    assert answer.status == 2
    assert says in answer.err
    assert len(answer.err.splitlines()) == 1
    assert not (tmp_path / "diagnosis.json").exists()


LOADS = np.full(N, 9e4)
UPWARDS = "if the load is positive upwards, pass --column normal_load_N=normal_load_N,sign=-1"
ALTERNATING = np.where(np.arange(N) % 2 == 0, 9e4, -9e4)


@pytest.mark.parametrize(
    ("loads", "says"),
    [
        (
            -LOADS,
            f"all loads are negative; {UPWARDS}",
        ),
        (
            np.where(np.arange(N) < 3, 9e4, -9e4),
            f"2397 of 2400 loads are negative; {UPWARDS}",
        ),
        (ALTERNATING, "1200 of 2400 loads are negative, the others are not"),
    ],
    ids=["all", "all but three", "every other one"],
)
def test_negative_loads_are_an_error_and_not_rows_without_a_time(loads, says, tmp_path):
    given = columns(normal_load_N=loads, longitudinal_force_N=columns()["adhesion"] * loads)
    del given["adhesion"]
    answer = diagnosed(tmp_path, write_table(tmp_path / "t.csv", given))
    assert answer.status == 2
    assert says in answer.err


def test_a_few_rows_without_load_are_told_as_such(tmp_path):
    loads = np.where(np.arange(N) % 100 == 0, -5.0, 9e4)
    given = columns(normal_load_N=loads, longitudinal_force_N=columns()["adhesion"] * loads)
    del given["adhesion"]
    answer = run(tmp_path, given)
    assert "dropped 24 of 2400 rows: no load above 0" in answer.out + answer.err
    assert "without a finite time" not in answer.out + answer.err


@pytest.mark.costly
def test_a_column_that_looks_like_the_time_is_told(tmp_path):
    given = columns()
    given = {("time" if name == "time_s" else name): values for name, values in given.items()}
    answer = run(tmp_path, given)
    assert "--column time_s=time" in answer.out + answer.err
    given["time_s"] = given["time"]
    answer = run(tmp_path, given)
    assert "--column time_s=" not in answer.out + answer.err


def test_a_named_sign_mends_it(tmp_path):
    path = write_table(tmp_path / "t.csv", columns(slip=-SLIP))
    assert diagnosed(tmp_path, path, "--column", "slip=slip,sign=-1").verdict == "nothing_found"


def test_a_hidden_effect_in_a_table_is_named(tmp_path):
    """So that 'nothing is named' above is not for want of eyes."""
    humidity = 65 + 20 * np.sin(2 * np.pi * T / 37)
    given = columns(relative_humidity_percent=humidity)
    given["adhesion"] = (1 - 0.006 * (humidity - 60)) * burckhardt(SLIP) + 0.01 * (
        np.random.default_rng(8).standard_normal(N)
    )
    answer = diagnosed(tmp_path, write_table(tmp_path / "t.csv", given))
    (cause,) = answer.document["causes"]
    assert cause["effect"] == "humidity"
    slope = cause["parameters"]["slope"]
    assert abs(slope["value"] + 0.006) < 3 * slope["std"]
    low, high = answer.document["gain"]["interval"]
    assert 0 < low < high < 100


# --- several tables


def test_two_tables_are_each_others_proof(tmp_path):
    other = write_table(tmp_path / "b.csv", columns(2))
    answer = run(tmp_path, columns(1), other)
    assert answer.verdict == "nothing_found"
    assert "1 of 2 recordings" in answer.document["gain"]["held_out"]


def test_what_is_held_out_has_to_be_enough_too(tmp_path):
    short = write_table(tmp_path / "b.csv", columns(2, rows=8))
    answer = run(tmp_path, columns(1), "--holdout", short)
    assert answer.document["gain"] is None
    assert "hold out" in answer.untested["everything"]


def test_a_short_table_decides_nothing_by_a_long_one_held_out(tmp_path):
    long = write_table(tmp_path / "b.csv", columns(2))
    answer = run(tmp_path, columns(1, rows=6), "--holdout", long)
    assert answer.document["gain"] is None
    assert "decide" in answer.untested["everything"]


def test_a_short_table_beside_a_long_one_does_no_harm(tmp_path):
    long = write_table(tmp_path / "b.csv", columns(2))
    answer = run(tmp_path, columns(1, rows=6), long)
    assert answer.document["gain"] is not None


def test_the_same_table_twice_is_refused(tmp_path):
    path = write_table(tmp_path / "t.csv", columns())
    answer = diagnosed(tmp_path, path, path)
    assert answer.status == 2
    assert "give it once" in answer.err


def test_spans_are_on_the_tables_clock(tmp_path):
    """With pauses between the sweeps, which are no time in which something was measured."""
    time = T + 100.0 * np.floor(np.arange(N) / 500)
    answer = run(tmp_path, columns(time_s=time))
    spans = answer.document["gain"]["spans"]
    assert spans
    for begin, end in spans:
        assert np.abs(time - begin).min() < 0.01
        assert np.abs(time - end).min() < 0.01
