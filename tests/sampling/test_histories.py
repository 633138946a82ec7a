"""Histories of one signal against values by hand: reading by reading, and in columns."""

import copy
import math

import numpy as np
import pytest

from adhesion_can.sampling.column_history import NEVER, ColumnHistory
from adhesion_can.sampling.signal_history import WAITING, SignalHistory

GAP_US = 30
READINGS = ((10, 1.0), (20, 3.0), (30, None), (40, 5.0), (70, 8.0), (101, 0.0), (111, 6.0))
"""A value that is missing at 30, a longest bridged gap to 70, and one beyond it to 101."""
STAMPS = {
    5: None, 10: 1.0, 11: 1.2, 15: 2.0, 19: 2.8, 20: 3.0, 25: None, 30: None, 35: None,
    40: 5.0, 41: 5.1, 55: 6.5, 69: 7.9, 70: 8.0, 71: None, 100: None, 101: 0.0, 106: 3.0,
    111: 6.0, 112: "waits", 500: "waits",
}  # fmt: skip
"""Values at stamps; None: there is none."""
HELD = {
    9: None, 10: 10, 19: 10, 20: 20, 29: 20, 30: None, 39: None, 40: 40, 69: 40, 70: 70,
    100: 70, 101: 101, 111: 111, 141: 111, 142: None,
}  # fmt: skip
"""Stamp of the reading that holds; None: it is too old or has no value."""
VALUES = dict(READINGS)


def by_reading(readings=READINGS):
    history = SignalHistory(GAP_US)
    for t_us, value in readings:
        history.add(t_us, value)
    return history


def in_columns(readings=READINGS, lag_us=0, size=3):
    """Blocks of some readings each, stamped later by the lag."""
    history = ColumnHistory(GAP_US, lag_us)
    for first in range(0, len(readings), size):
        stamps, values = zip(*readings[first : first + size], strict=True)
        numbers = [math.nan if value is None else value for value in values]
        history.extend(np.array(stamps) + lag_us, np.array(numbers))
    return history


def test_values_lie_on_lines_between_readings_and_nowhere_else():
    history = by_reading()
    for t_us, wanted in STAMPS.items():
        found = history.at(t_us)
        if wanted in {None, "waits"}:
            assert found is (WAITING if wanted else None), t_us
        else:
            assert found == pytest.approx(wanted, rel=1e-12), t_us


@pytest.mark.parametrize("lag_us", [0, 7])
def test_columns_have_the_same_values_and_say_when_they_were_known(lag_us):
    history, stamps = in_columns(lag_us=lag_us), np.array(list(STAMPS))
    found = history.at(stamps)
    wanted = [math.nan if one in {None, "waits"} else one for one in STAMPS.values()]
    assert found.value == pytest.approx(wanted, rel=1e-12, nan_ok=True)
    ends = [min((t for t in VALUES if t >= at), default=None) for at in STAMPS]
    known = [NEVER if end is None else end + lag_us for end in ends]
    assert found.known_us.tolist() == known
    assert found.bracket_end_us.tolist() == [NEVER if end is None else end for end in ends]


def test_a_place_in_its_bracket_is_a_share_of_it_and_1_at_the_reading():
    at = np.array([11, 15, 20, 41, 55, 70, 106])
    wanted = [0.1, 0.5, 1.0, 1 / 30, 0.5, 1.0, 0.5]
    assert [by_reading().share_at(int(t)) for t in at] == pytest.approx(wanted)
    assert in_columns().at(at).share == pytest.approx(wanted)
    assert [by_reading().bracket_end_us(int(t)) for t in at] == [20, 20, 20, 70, 70, 70, 111]


def test_had_the_value_stepped_at_any_time_of_its_bracket_it_is_one_end_or_the_other():
    """The stamp at a share s has the later value with probability s: √(s (1 − s)) of the step."""
    at = [11, 15, 20, 25, 40, 41, 55, 70, 106]
    shares = {11: (0.1, 2.0), 15: (0.5, 2.0), 41: (1 / 30, 3.0), 55: (0.5, 3.0), 106: (0.5, 6.0)}
    wanted = [
        np.sqrt(shares[t][0] * (1.0 - shares[t][0])) * shares[t][1] if t in shares else 0.0
        for t in at
    ]
    assert [by_reading().step_std(t) for t in at] == pytest.approx(wanted)
    assert in_columns().at(np.array(at)).step_std == pytest.approx(wanted)
    assert in_columns().at(np.array([5, 900])).step_std.tolist() == [0.0, 0.0]


def test_the_last_reading_holds_as_long_as_a_gap_may_be():
    history = by_reading()
    for t_us, stamp in HELD.items():
        wanted = None if stamp is None else (stamp, VALUES[stamp])
        assert history.held_at(t_us) == wanted, t_us
    stamps, values = in_columns().held_at(np.array(list(HELD)))
    wanted = [math.nan if one is None else VALUES[one] for one in HELD.values()]
    assert values == pytest.approx(wanted, nan_ok=True)
    known = [one is not None for one in HELD.values()]
    assert stamps[known].tolist() == [one for one in HELD.values() if one is not None]


def test_without_a_reading_nothing_is_known():
    assert SignalHistory(GAP_US).at(0) is WAITING
    assert SignalHistory(GAP_US).held_at(0) is None
    empty = ColumnHistory(GAP_US)
    empty.extend(np.empty(0, dtype=np.int64), np.empty(0))
    assert empty.first_us == NEVER
    found = empty.at(np.array([3, 4]))
    assert np.isnan(found.value).all()
    assert found.known_us.tolist() == found.bracket_end_us.tolist() == [NEVER, NEVER]
    assert found.step_std.shape == found.share.shape == (2,)
    assert np.isnan(empty.held_at(np.array([3, 4]))[1]).all()
    assert empty.before(np.array([3])).tolist() == [-1]


@pytest.mark.parametrize("size", [1, 2, 9])
def test_of_two_readings_of_one_stamp_the_later_one_counts(size):
    readings = [(10, 1.0), (20, 3.0), (20, 4.0), (30, 6.0)]
    assert by_reading(readings).at(15) == 2.5
    assert by_reading(readings).times == [10, 20, 30]
    columns = in_columns(readings, size=size)
    assert columns.t_us.tolist() == [10, 20, 30]
    assert columns.value.tolist() == [1.0, 4.0, 6.0]
    assert columns.first_us == 10


@pytest.mark.parametrize("t_us", [0, 10, 19, 20, 21, 40, 55, 110, 111, 200])
def test_what_is_forgotten_is_needed_at_no_later_stamp(t_us):
    """At most the reading before the stamp and the one before that are kept of older ones."""
    history, columns = by_reading(), in_columns()
    dropped = history.forget_before(t_us)
    columns.forget_before(t_us)
    assert dropped == max(sum(t <= t_us for t in VALUES) - 2, 0)
    assert history.times == list(VALUES)[dropped:] == columns.t_us.tolist()
    assert len(history.values) == len(columns.value) == len(VALUES) - dropped
    later = range(t_us, 112)
    assert [history.at(t) for t in later] == [by_reading().at(t) for t in later]
    held = range(t_us, 150)
    assert [history.held_at(t) for t in held] == [by_reading().held_at(t) for t in held]


def test_the_reading_before_a_stamp():
    at = np.array([9, 10, 11, 20, 21, 500])
    assert in_columns().before(at).tolist() == [-1, -1, 0, 0, 1, 6]


def test_a_copy_goes_its_own_way():
    history = by_reading()
    twin = copy.deepcopy(history)
    twin.add(121, 9.0)
    twin.values[0] = 7.0
    assert (history.at(121), twin.at(121)) == (WAITING, 9.0)
    assert (history.at(10), twin.at(10)) == (1.0, 7.0)
    assert twin.max_gap_us == GAP_US
