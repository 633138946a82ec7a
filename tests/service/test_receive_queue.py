"""The receive queue on a machine that is too slow for its bus, in simulated time."""

from collections import defaultdict
from itertools import pairwise

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from adhesion_can.recordings.python_can_messages import to_message
from adhesion_can.service.receive_queue import ReceiveQueue
from adhesion_can.service.reconnecting_bus import ReconnectingBus
from tests.wire import Bench

MS, S = 1_000, 1_000_000
BETWEEN_US = 10_000 / 4.5
"""Mean time between two frames of a full drive, µs."""


class Machine:
    """A bus on which a full drive passes, and a clock that goes on where work is done.

    `slower`: factor by which all of its cycles are longer.
    """

    def __init__(self, seconds, slower=1):
        self.now_us = 0
        frames = Bench().drive(0, round(seconds * S / slower))
        self.frames = [frame._replace(t_us=frame.t_us * slower) for frame in frames]
        self.taken = 0
        self.queue = ReceiveQueue(
            ReconnectingBus(lambda: self, ()),
            lambda one: self.now_us - round(one.message.timestamp * S),
            lambda: self.now_us,
            cycle_us=slower * 20 * MS,
        )

    def recv(self, timeout):
        """Next message that has passed by now, or passes within the timeout, s."""
        if self.taken == len(self.frames):
            self.now_us += round(timeout * S)
            return None
        frame = self.frames[self.taken]
        latest_us = self.now_us + round((timeout or 0.0) * S)
        if frame.t_us > latest_us:
            self.now_us = latest_us
            return None
        self.now_us = max(self.now_us, frame.t_us)
        self.taken += 1
        return to_message(frame)

    def set_filters(self, filters):
        """Filters are not needed."""

    def shutdown(self):
        """Nothing to close."""

    def work(self, until_us, cost_us):
        """Times at which messages are handled, their ages and ids: each takes a time of its own."""
        handled = []
        while self.now_us < until_us:
            received = self.queue.get(0.01)
            if received is None:
                continue
            age_us = self.now_us - round(received.message.timestamp * S)
            handled.append((self.now_us, age_us, received.message.arbitration_id))
            self.now_us += cost_us
        return handled


def test_a_machine_that_is_just_fast_enough_handles_all():
    machine = Machine(5.0)
    handled = machine.work(5 * S, round(0.98 * BETWEEN_US))
    assert len(handled) == len(machine.frames)
    assert machine.queue.dropped == 0
    assert not machine.queue.is_overloaded


@settings(max_examples=30, deadline=None)
@given(st.floats(1.02, 20.0))
def test_a_machine_that_is_too_slow_stays_at_the_present(times):
    cost_us = round(times * BETWEEN_US)
    machine = Machine(6.0)
    handled = machine.work(6 * S, cost_us)
    # Behind by 10 ms first, at any pace, then for the time of an overload, then at the present.
    settled_us = 2 * 100 * MS + round(10 * MS / (1 - 1 / times)) + 2 * cost_us
    for at_us, age_us, _ in handled:
        most_us = 20 * MS if at_us > settled_us else 10 * MS + 100 * MS + cost_us
        assert age_us <= most_us
    left = machine.taken - machine.queue.dropped - len(handled)
    assert left == len(machine.queue)
    assert machine.queue.is_overloaded == (settled_us < 6 * S)


@pytest.mark.parametrize("times", [1.05, 1.17, 1.3, 1.5])
def test_each_message_has_its_turn(times):
    """One of each message is dropped: after three cycles without one an input would be stale."""
    machine = Machine(10.0)
    at: dict[int, list[int]] = defaultdict(list)
    for at_us, age_us, number in machine.work(10 * S, round(times * BETWEEN_US)):
        at[number].append(at_us - age_us)
    assert machine.queue.dropped > 100
    for number, stamps in at.items():
        settled = [stamp for stamp in stamps if stamp > 1.5 * S]
        longest_us = max(b - a for a, b in pairwise(settled))
        assert longest_us <= (40 * MS if number == 0x111 else 20 * MS)


@settings(max_examples=20, deadline=None)
@given(st.floats(1.1, 8.0), st.sampled_from([10, 40]))
def test_on_a_slow_bus_half_a_cycle_may_wait(times, slower):
    """One of 0.2 s or 0.8 s: a machine that needs 50 ms for a message is not behind at once."""
    cost_us, half_us = round(times * slower * BETWEEN_US), slower * 10 * MS
    seconds = 6.0 * slower
    machine = Machine(seconds, slower)
    handled = machine.work(seconds * S, cost_us)
    settled_us = 10 * half_us + round(10 * MS / (1 - 1 / times)) + 2 * cost_us
    ages_us = [age_us for at_us, age_us, _ in handled if at_us > settled_us]
    assert ages_us
    assert max(ages_us) <= half_us
    if times < 4:
        assert max(ages_us) > half_us / 2


@pytest.mark.parametrize("slower", [10, 40])
def test_a_slow_bus_is_followed_by_a_machine_that_is_slow_but_fast_enough(slower):
    machine = Machine(10.0 * slower, slower)
    handled = machine.work(10 * slower * S, round(0.9 * slower * BETWEEN_US))
    assert len(handled) == len(machine.frames)
    assert machine.queue.dropped == 0


def test_what_waited_while_the_loop_was_held_up_is_caught_up_with():
    machine = Machine(3.0)
    handled = machine.work(1 * S, 500)
    machine.now_us += 300 * MS
    handled += machine.work(3 * S, 500)
    assert len(handled) == len(machine.frames)
    assert machine.queue.dropped == 0


def test_after_an_overload_a_machine_is_trusted_again():
    machine = Machine(6.0)
    machine.work(1 * S, round(1.5 * BETWEEN_US))
    assert machine.queue.dropped
    assert machine.queue.is_overloaded
    machine.work(2 * S + 100 * MS, 500)
    assert not machine.queue.is_overloaded
    dropped = machine.queue.dropped
    machine.now_us += 300 * MS
    machine.work(6 * S, 500)
    assert machine.queue.dropped == dropped


def test_nothing_more_comes_after_an_overload():
    machine = Machine(1.0)
    machine.work(1 * S, round(3.0 * BETWEEN_US))
    machine.work(4 * S, round(3.0 * BETWEEN_US))
    assert machine.queue.get(0.0) is None
    assert not machine.queue.is_overloaded
