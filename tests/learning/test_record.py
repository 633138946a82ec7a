"""The rolling record, beside a plain list of readings."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from adhesion_can.learning.examination import halves
from adhesion_can.learning.record import ReadingRecord, join_readings
from adhesion_can.physics.readings import Role

SIGNALS = [(Role.WHEEL_SPEED, 1), (Role.WHEEL_SPEED, 2), (Role.VEHICLE_SPEED, 0)]
STEPS = st.lists(
    st.tuples(st.sampled_from(SIGNALS), st.integers(0, 400_000), st.floats(-1e3, 1e3)),
    max_size=300,
)


def stamped(steps):
    """(signal, stamp, value) with stamps that ascend by the steps, µs."""
    t_us, out = 0, []
    for key, step, value in steps:
        t_us += step
        out.append((key, t_us, value))
    return out


def columns(rows):
    """Readings in columns, as the record takes and gives them."""
    return {
        key: (
            np.array([t for one, t, _ in rows if one == key], dtype=np.int64),
            np.array([v for one, _, v in rows if one == key]),
        )
        for key in dict.fromkeys(one for one, _, _ in rows)
    }


def as_lists(readings):
    return {key: (t.tolist(), v.tolist()) for key, (t, v) in readings.items() if len(t)}


@given(STEPS, st.integers(1, 40), st.floats(0.5, 30.0))
def test_it_holds_the_readings_of_its_window_and_no_others(steps, at_once, window_s):
    rows = stamped(steps)
    record = ReadingRecord(window_s)
    for first in range(0, len(rows), at_once):
        record.add(columns(rows[first : first + at_once]))
    oldest = (rows[-1][1] if rows else 0) - round(window_s * 1e6)
    kept = [row for row in rows if row[1] >= oldest]
    assert as_lists(record.whole()) == as_lists(columns(kept))
    assert record.end_us == (rows[-1][1] if rows else None)


@given(STEPS, st.integers(0, 50_000_000), st.integers(0, 50_000_000))
def test_a_part_of_it_is_what_was_stamped_between(steps, one, other):
    rows, (first, last) = stamped(steps), sorted((one, other))
    record = ReadingRecord(1e6)
    record.add(columns(rows))
    inside = [row for row in rows if first <= row[1] < last]
    assert as_lists(record.between(first, last)) == as_lists(columns(inside))


@given(STEPS)
def test_halves_have_all_readings_and_none_in_common(steps):
    rows = stamped(steps)
    first, second = halves(columns(rows))
    ends = [int(t[-1]) for t, _ in first.values()], [int(t[0]) for t, _ in second.values()]
    assert not (ends[0] and ends[1]) or max(ends[0]) < min(ends[1])
    assert as_lists(join_readings([first, second])) == as_lists(columns(rows))


def drive(seconds, hz=100, begin_us=0):
    """Readings of one signal at an even rate."""
    t_us = begin_us + np.arange(int(seconds * hz), dtype=np.int64) * (1_000_000 // hz)
    return {SIGNALS[0]: (t_us, np.zeros(len(t_us)))}


def test_its_memory_is_bounded():
    """An hour takes what ten minutes take."""
    record, sizes = ReadingRecord(60.0), []
    for second in range(3600):
        record.add(drive(1.0, begin_us=second * 1_000_000))
        sizes.append(record.nbytes)
    assert max(sizes) == max(sizes[:600]) < 60 * 100 * 16 * 4
    assert record.length_s == pytest.approx(60.0, abs=0.1)


def test_a_signal_that_comes_too_often_shortens_it():
    record = ReadingRecord(60.0, most_readings=1000)
    for second in range(100):
        record.add(drive(1.0, hz=500, begin_us=second * 1_000_000))
        record.add({SIGNALS[1]: (np.array([second * 1_000_000]), np.zeros(1))})
    assert record.length_s == pytest.approx(2.0, abs=0.1)
    whole = record.whole()
    assert len(whole[SIGNALS[0]][0]) == 1000
    # All signals begin at one time.
    assert whole[SIGNALS[1]][0][0] >= whole[SIGNALS[0]][0][0]


def test_stamps_that_stand_still_do_not_fill_the_memory():
    record = ReadingRecord(60.0, most_readings=1000)
    for _ in range(100):
        record.add({SIGNALS[0]: (np.zeros(500, dtype=np.int64), np.zeros(500))})
    assert record.nbytes < 100_000


def test_a_hole_begins_it_again():
    record = ReadingRecord(600.0, hole_s=60.0)
    record.add(drive(10.0))
    record.add(drive(10.0, begin_us=65_000_000))
    assert record.begin_us == 0
    record.add(drive(10.0, begin_us=140_000_000))
    assert record.begin_us == 140_000_000
