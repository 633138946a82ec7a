"""Times at which a slave reads its inputs."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from adhesion_can.errors import InputError
from adhesion_can.fmu.slave import Cycle


@given(
    cycle_us=st.integers(2, 5000),
    start_us=st.integers(-(10**9), 10**9),
    data=st.data(),
)
def test_it_reads_at_the_first_step_from_each_whole_cycle_on(cycle_us, start_us, data):
    steps = data.draw(st.lists(st.integers(1, cycle_us), min_size=1, max_size=60))
    cycle = Cycle("c", cycle_us / 1e6, start_us)
    assert cycle.cycle_us == cycle_us
    times, t_us = [], start_us
    for step_us in steps:
        if cycle.is_due(t_us, t_us + step_us):
            times.append(t_us)
        t_us += step_us
    stamps = [start_us + sum(steps[:n]) for n in range(len(steps))]
    # By definition: of each cycle the first stamp that lies in it, if there is one.
    cycles = {}
    for stamp in stamps:
        cycles.setdefault((stamp - start_us) // cycle_us, stamp)
    assert times == list(cycles.values())


@given(cycle_us=st.integers(2, 5000), more=st.integers(2, 5000))
def test_a_step_longer_than_the_cycle_is_refused(cycle_us, more):
    cycle = Cycle("cycle_of_mine", cycle_us / 1e6, 0)
    assert cycle.is_due(0, cycle_us)
    with pytest.raises(InputError, match="cycle_of_mine"):
        cycle.is_due(cycle_us, 2 * cycle_us + more)


@pytest.mark.parametrize("rate", [120, 150, 30, 300, 3200, 16_000, 44_100, 48_000])
def test_a_step_of_the_cycle_reads_each_time_though_both_are_rounded(rate):
    cycle = Cycle("c", 1 / rate, 0)
    stamps = [round(1e6 * k / rate) for k in range(5001)]
    assert all(map(cycle.is_due, stamps, stamps[1:]))
