"""Due times, one by one and all at once."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from adhesion_can.service.schedule import Schedule

CYCLES_US = st.dictionaries(st.sampled_from("abcde"), st.integers(1, 50), min_size=1)


def test_nothing_is_due_before_the_start_and_after_the_end():
    schedule = Schedule({"a": 20})
    assert (schedule.started, schedule.next_due_us) == (False, None)
    assert schedule.pop_due(0) == []
    assert len(schedule.due_times(100)) == 0
    schedule.start(7)
    assert (schedule.started, schedule.next_due_us) == (True, 7)
    schedule.stop()
    assert (schedule.started, schedule.next_due_us) == (False, None)


def test_messages_due_together_come_in_the_given_order():
    schedule = Schedule({"first": 20, "second": 10, "third": 20})
    schedule.start(100)
    assert schedule.pop_due(100) == ["first", "second", "third"]
    assert schedule.pop_due(105) == []
    assert schedule.pop_due(110) == ["second"]
    assert schedule.pop_due(120) == ["first", "second", "third"]


def test_a_due_time_that_was_passed_over_is_not_skipped():
    """The core pops each due time by itself: what is overdue waits for its own time."""
    schedule = Schedule({"a": 20})
    schedule.start(100)
    assert schedule.pop_due(105) == []
    assert schedule.next_due_us == 100
    assert schedule.pop_due(100) == ["a"]
    assert schedule.next_due_us == 120


def test_a_message_is_due_at_its_own_times_alone():
    schedule = Schedule({"a": 20, "b": 30})
    assert not schedule.is_due("a", 0)
    schedule.start(100)
    schedule.pop_due(100)
    assert [t for t in range(100, 150) if schedule.is_due("a", t)] == [120]
    assert [t for t in range(100, 150) if schedule.is_due("b", t)] == [130]
    assert not schedule.is_due("c", 120)


@given(CYCLES_US, st.integers(0, 10**12), st.integers(0, 300))
def test_every_message_is_due_at_t0_plus_multiples_of_its_cycle(cycles_us, t0_us, span_us):
    schedule = Schedule(cycles_us)
    schedule.start(t0_us)
    until_us = t0_us + span_us
    expected = schedule.due_times(until_us)
    due = {name: [] for name in cycles_us}
    times = []
    while schedule.next_due_us <= until_us:
        times.append(schedule.next_due_us)
        for name in schedule.pop_due(times[-1]):
            due[name].append(times[-1])
    np.testing.assert_array_equal(times, expected)
    for name, cycle_us in cycles_us.items():
        assert due[name] == list(range(t0_us, until_us + 1, cycle_us))
