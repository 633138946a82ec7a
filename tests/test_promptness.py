"""Which frames have a prompt past."""

import pytest

from adhesion_can.bus.frame import Frame
from tests.promptness import GAP_US, PAST_US, frames_with_prompt_past
from tests.wire import CYCLES_MS, INPUTS, REQUIRED

SETPOINT = 0x201


def drive(seconds, without=()):
    """Inputs at their cycles and a setpoint every 20 ms, without some between two times, s."""
    cycles = {INPUTS[name]: CYCLES_MS[name] for name in REQUIRED} | {SETPOINT: 20}
    return [
        Frame(t_ms * 1000, number, b"")
        for t_ms in range(0, round(seconds * 1000), 10)
        for number, cycle_ms in cycles.items()
        if t_ms % cycle_ms == 0
        and not any(number == name and a <= t_ms / 1000 < b for name, a, b in without)
    ]


def times(frames, **options):
    """Times of the setpoints with a prompt past, s."""
    return [frame.t_us / 1e6 for frame in frames_with_prompt_past(frames, SETPOINT, **options)]


def test_all_from_the_least_past_on_where_nobody_is_late():
    found = times(drive(10.0))
    assert found[0] == PAST_US / 1e6
    assert found[-1] == 9.98
    assert len(found) == 350


@pytest.mark.parametrize("late", [*(INPUTS[name] for name in REQUIRED), SETPOINT])
def test_none_for_a_while_after_one_was_late(late):
    found = times(drive(10.0, without=[(late, 5.0, 5.1)]))
    assert not [t for t in found if 5.0 + GAP_US / 1e6 < t < 5.1 + PAST_US / 1e6]
    assert [t for t in found if t < 5.0]
    assert [t for t in found if t > 5.1 + PAST_US / 1e6]


@pytest.mark.parametrize("late", [*(INPUTS[name] for name in REQUIRED), SETPOINT])
def test_none_ever_again_after_one_was_late_where_the_whole_past_counts(late):
    found = times(drive(10.0, without=[(late, 5.0, 5.1)]), is_whole=True)
    assert found[0] == PAST_US / 1e6
    assert 4.98 <= found[-1] <= 5.0 + GAP_US / 1e6


def test_the_whole_past_begins_when_all_have_come():
    without = [(SETPOINT, 0.5, 0.9)] + [(INPUTS[name], 0.0, 2.0) for name in REQUIRED]
    found = times(drive(10.0, without=without), is_whole=True)
    assert (found[0], found[-1]) == (2.0 + PAST_US / 1e6, 9.98)


@pytest.mark.parametrize("missing", [*(INPUTS[name] for name in REQUIRED), SETPOINT])
def test_none_where_one_never_comes_or_no_longer(missing):
    assert times(drive(10.0, without=[(missing, 0.0, 10.0)])) == []
    assert all(t <= 6.04 for t in times(drive(10.0, without=[(missing, 6.0, 10.0)])))
