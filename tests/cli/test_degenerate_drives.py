"""Drives of which a signal is 0, constant, at an end, absent or reversed: an answer or a line."""

import contextlib
import io
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import HealthCheck, Phase, given, settings
from hypothesis import strategies as st

from adhesion_can.cli.main import main
from tests.diagnosis.bad_logs import MISSING, readings, write

LARGEST = {
    "wheel_speed": 65534 * 0.002,
    "speed": 65534 * 0.002,
    "effort": 32766 * 10.0,
    "load": 65534 * 10.0,
}
SMALLEST = {"effort": -32767 * 10.0}
MODEL = "[base]\nc1 = 0.4\nc2 = 60.0\nc3 = 0.3\n"
QUICK = ("check", "identify", "calibrate", "evaluate")


def spoils(x, low, high, missing):
    """What may happen to a signal, by name."""
    rows = np.arange(len(x)).reshape(-1, *[1] * (x.ndim - 1))
    return {
        "zero": 0.0 * x,
        "constant": np.full_like(x, np.median(x)),
        "largest": np.full_like(x, high),
        "smallest": np.full_like(x, low),
        "absent": np.full_like(x, missing),
        "reversed": np.clip(-x, low, high),
        "tiny": 1e-3 * x,
        "alternating": np.where(rows % 2 == 0, low, high),
        "zero for a while": np.where(rows < len(x) // 3, 0.0, x),
        "zero once": np.where(rows == len(x) // 2, 0.0, x),
        "absent for a while": np.where(rows > len(x) // 2, missing, x),
    }


SPOILS = tuple(spoils(np.ones(9), 0.0, 1.0, 2.0))


def spoilt(drive, field, how, axles):
    column = getattr(drive, field).astype(float)
    changed = spoils(column, SMALLEST.get(field, 0.0), LARGEST[field], MISSING[field])[how]
    if column.ndim == 2:
        changed = np.where(np.isin(np.arange(6), axles), changed, column)
    return replace(drive, **{field: changed})


def play(command, *words):
    """Status, and lines on stderr, of a command in process; warnings are errors here."""
    out, err = io.StringIO(), io.StringIO()
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
        status = main([command, *map(str, words)])
    return status, err.getvalue().splitlines()


def require_answers(folder, drive, commands):
    log, model = folder / "drive.log", folder / "model.toml"
    write(log, drive)
    model.write_text(MODEL)
    for command in commands:
        words = ["--model", model] if command == "evaluate" else []
        status, lines = play(command, log, *words)
        assert status in {0, 1, 2}, command
        assert len(lines) <= 2, (command, lines)
        assert (status == 2) is bool(lines), (command, lines)


CHANGES = st.lists(
    st.tuples(
        st.sampled_from(tuple(LARGEST)),
        st.sampled_from(SPOILS),
        st.sampled_from([(0, 1, 2, 3, 4, 5), (2,), (0, 1, 2), (1, 2, 3, 4, 5)]),
    ),
    min_size=1,
    max_size=3,
)
SETTINGS = {
    "deadline": None,
    "phases": (Phase.explicit, Phase.generate),
    "suppress_health_check": [HealthCheck.function_scoped_fixture, HealthCheck.too_slow],
}


@pytest.mark.costly
@pytest.mark.parametrize("field", LARGEST)
@pytest.mark.parametrize("how", ["zero", "constant", "largest", "absent"])
def test_one_signal_that_says_nothing_ends_in_an_answer_or_a_line(field, how, tmp_path):
    require_answers(tmp_path, spoilt(readings(8.0), field, how, range(6)), (*QUICK, "diagnose"))


@pytest.mark.costly
@settings(max_examples=8, **SETTINGS)
@given(changes=CHANGES)
def test_any_degenerate_drive_ends_in_an_answer_or_a_line(changes, tmp_path):
    drive = readings(8.0)
    for change in changes:
        drive = spoilt(drive, *change)
    require_answers(tmp_path, drive, (*QUICK, "diagnose"))


@pytest.mark.slow
@settings(max_examples=30, **SETTINGS)
@given(changes=CHANGES)
def test_any_degenerate_drive_that_is_long_enough_for_a_diagnosis(changes, tmp_path):
    drive = readings(45.0)
    for change in changes:
        drive = spoilt(drive, *change)
    require_answers(tmp_path, drive, ("diagnose", "evaluate"))


@pytest.mark.parametrize("how", ["zero once", "zero for a while"])
@pytest.mark.parametrize("axles", [(2,), (0, 1, 2, 3, 4, 5)])
def test_a_reading_of_an_axle_load_of_0_is_no_load_and_no_crash(how, axles, tmp_path):
    require_answers(tmp_path, spoilt(readings(20.0), "load", how, axles), ("diagnose", "identify"))


def test_the_axle_loads_of_a_drive_that_are_all_0_are_the_reason(tmp_path, capsys):
    write(tmp_path / "a.log", spoilt(readings(12.0), "load", "zero", range(6)))
    assert main(["diagnose", str(tmp_path / "a.log")]) == 2
    assert "axle load implausibly low" in capsys.readouterr().err


# ---------------------------------------------------------------------------------------- tables

ODD = {
    "zero": lambda x: 0.0 * x,
    "constant": lambda x: np.full_like(x, x[0]),
    "nan": lambda x: np.full_like(x, np.nan),
    "infinite once": lambda x: np.where(np.arange(len(x)) == len(x) // 2, np.inf, x),
    "huge": lambda x: 1e200 * x,
    "tiny": lambda x: 1e-200 * x,
    "negative": lambda x: -x,
    "zero once": lambda x: np.where(np.arange(len(x)) == len(x) // 2, 0.0, x),
    "unsorted": lambda x: x[::-1],
}


@pytest.mark.costly
@settings(max_examples=15, **SETTINGS)
@given(
    rows=st.sampled_from([1, 2, 3, 19, 21, 60, 200]),
    by_force=st.booleans(),
    timed=st.booleans(),
    changes=st.lists(st.tuples(st.integers(0, 5), st.sampled_from(tuple(ODD))), max_size=3),
    seed=st.integers(0, 99),
)
def test_any_degenerate_table_ends_in_an_answer_or_a_line(
    rows, by_force, timed, changes, seed, tmp_path
):
    rng = np.random.default_rng(seed)
    time_s = 0.05 * np.arange(rows)
    slip = 0.08 * np.sin(time_s) + 0.0005 * rng.standard_normal(rows)
    adhesion = np.sign(slip) * (0.4 * (1 - np.exp(-60 * np.abs(slip))) - 0.3 * np.abs(slip))
    adhesion += 0.01 * rng.standard_normal(rows)
    columns = {"time_s": time_s} if timed else {}
    columns["slip"] = slip
    if by_force:
        columns |= {"longitudinal_force_N": 245e3 * adhesion, "normal_load_N": 245e3 + 0 * slip}
    else:
        columns["adhesion"] = adhesion
    columns |= {"speed_mps": 12.0 + np.sin(time_s), "wind": rng.standard_normal(rows)}
    for place, how in changes:
        name = list(columns)[place % len(columns)]
        with np.errstate(over="ignore"):  # huge twice is infinite, which is as degenerate
            columns[name] = ODD[how](columns[name])
    lines = [",".join(columns)]
    lines += [",".join(repr(float(x)) for x in row) for row in zip(*columns.values(), strict=True)]
    table, model = tmp_path / "t.csv", tmp_path / "m.toml"
    table.write_text("\n".join(lines) + "\n")
    model.write_text(MODEL)
    for command in ("check", "identify", "evaluate", "diagnose"):
        status, err = play(command, table, *(["--model", model] if command == "evaluate" else []))
        assert status in {0, 1, 2}, command
        assert len(err) <= 2, (command, err)
