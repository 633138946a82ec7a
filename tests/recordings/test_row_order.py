"""The same rows in another order are the same table."""

import json

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from adhesion_can.cli.main import main
from adhesion_can.recordings.tables.sample_table import read_table

NOISE = 0.01


def rows_of(seed, *, rows=60, axles=1, segments=1, restart=False, step_s=0.02):
    """Rows of a table with a text, an empty cell now and then, and no two alike."""
    rng, found = np.random.default_rng(seed), []
    for k in range(rows * segments):
        segment, place = divmod(k, rows)
        t = step_s * (place if restart else k)
        for axle in range(1, axles + 1):
            slip = 0.15 * np.sin(0.3 * k + axle) ** 3
            mu = np.sign(slip) * 0.4 * (1 - np.exp(-30 * abs(slip))) + NOISE * rng.normal()
            speed = "" if rng.random() < 0.02 else f"{10 + rng.random():.4f}"
            rail = ("wet", "dry")[k // 7 % 2]
            found.append(f"{t:.3f},{axle},s{segment},{slip:.6f},{mu:.6f},{speed},{rail}")
    return found


def write(path, rows):
    path.write_text("\n".join(["time_s,axle,segment,slip,adhesion,speed_mps,rail", *rows]) + "\n")
    return path


def columns(path):
    table = read_table(path)
    samples = table.samples
    names = ("t_us", "axle", "slip", "adhesion", "speed", "creep_speed")
    found = {name: getattr(samples, name) for name in names} | dict(samples.covariates)
    return table, found | {"segment": table.segment}


@pytest.mark.costly
@given(
    seed=st.integers(0, 999),
    axles=st.integers(1, 3),
    segments=st.integers(1, 3),
    restart=st.booleans(),
    data=st.data(),
)
@settings(derandomize=True, max_examples=60, deadline=None)
def test_any_order_of_rows_gives_one_table(seed, axles, segments, restart, data, tmp_path_factory):
    folder = tmp_path_factory.mktemp("order")
    rows = rows_of(seed, axles=axles, segments=segments, restart=restart)
    in_time, expected = columns(write(folder / "a.csv", rows))
    assert not in_time.notes
    mixed = data.draw(st.permutations(rows))
    _, found = columns(write(folder / "b.csv", mixed))
    for name, column in expected.items():
        np.testing.assert_array_equal(found[name], column, err_msg=name)


@given(seed=st.integers(0, 999), data=st.data())
@settings(derandomize=True, max_examples=30, deadline=None)
def test_rows_of_one_stamp_have_one_order_too_once_times_do_not_ascend(
    seed, data, tmp_path_factory
):
    folder = tmp_path_factory.mktemp("ties")
    rows = rows_of(seed, rows=40, step_s=0.0004)  # two to three rows have one stamp
    first, second = (data.draw(st.permutations(rows)) for _ in range(2))
    (one, a), (other, b) = (
        columns(write(folder / f"{i}.csv", order)) for i, order in enumerate((first, second))
    )
    assume(one.notes and other.notes)
    for name, column in a.items():
        np.testing.assert_array_equal(b[name], column, err_msg=name)


def test_rows_of_one_stamp_keep_the_files_order_while_times_ascend(tmp_path):
    rows = rows_of(3, rows=40, step_s=0.0004)
    table, found = columns(write(tmp_path / "t.csv", rows))
    assert not table.notes
    assert found["slip"].tolist() == [float(row.split(",")[3]) for row in rows]


def test_segments_with_one_clock_stay_as_they_follow_each_other(tmp_path):
    """A surface that comes back is a span of its own."""
    rows = rows_of(1, rows=30, segments=3)
    rows = [row.replace(",s2,", ",s0,") for row in rows]
    _, found = columns(write(tmp_path / "t.csv", rows))
    assert np.flatnonzero(np.diff(found["segment"])).tolist() == [29, 59]


def test_what_was_sorted_is_counted(tmp_path):
    rows = rows_of(2)
    moved = [*rows[30:], *rows[:30]]
    (note,) = read_table(write(tmp_path / "t.csv", moved)).notes
    assert note.startswith("1 row has an earlier time_s")
    (note,) = read_table(write(tmp_path / "t.csv", rows[::-1])).notes
    assert note.startswith("59 rows have an earlier time_s")
    # By axle, each in its order: the rows are in order already.
    by_axle = sorted(rows_of(2, axles=3), key=lambda row: row.split(",")[1])
    assert not read_table(write(tmp_path / "t.csv", by_axle)).notes


@pytest.mark.costly
@pytest.mark.parametrize("command", ["identify", "diagnose", "check"])
def test_commands_answer_alike_to_the_byte(tmp_path, command):
    rows = rows_of(5, rows=2000, axles=2)
    path, out, answers = tmp_path / "t.csv", tmp_path / "o.json", []
    for order in (rows, list(np.random.default_rng(6).permutation(rows))):
        write(path, order)
        assert main([command, str(path), "--json", str(out)]) == 0
        document = json.loads(out.read_text())
        for said in ("inputs", "problems", "warnings", "findings", "tables"):
            document.pop(said, None)
        answers.append(json.dumps(document))
    assert answers[0] == answers[1]
