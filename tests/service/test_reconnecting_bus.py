"""The bus that is opened again, on a fake bus and a fake clock."""

import errno

import can
import numpy as np
import pytest

from adhesion_can.bus.j1939 import IdFilter
from adhesion_can.errors import BusError
from adhesion_can.service.reconnecting_bus import (
    CHECKED_FRAMES,
    LISTEN_ONLY,
    PAUSES_S,
    ReconnectingBus,
)

MESSAGE = can.Message(arbitration_id=0x101, data=b"12345678", is_extended_id=False)


class FakeClock:
    def __init__(self):
        self.now_s = 100.0

    def __call__(self):
        return self.now_s

    def sleep(self, seconds):
        assert seconds >= 0
        self.now_s += seconds


class FakeBus:
    """A bus that raises what it holds at each call, or passes one frame after another."""

    channel_info = "fake"

    def __init__(self, recv_error=None, send_error=None, close_error=None, silent=False):
        self.recv_error, self.send_error, self.close_error = recv_error, send_error, close_error
        self.silent = silent
        self.filters, self.sent, self.closed, self.timeouts = None, [], 0, []

    def set_filters(self, filters):
        self.filters = filters

    def recv(self, timeout):
        self.timeouts.append(timeout)
        if self.recv_error:
            raise self.recv_error
        return None if self.silent else MESSAGE

    def send(self, message):
        if self.send_error:
            raise self.send_error
        self.sent.append(message)

    def shutdown(self):
        self.closed += 1
        if self.close_error:
            raise self.close_error


IDS = (IdFilter.exact(0x101, False),)


class Bench:
    """A reconnecting bus whose opener gives one after another what it has: buses and errors."""

    def __init__(self, *buses, ids=IDS, wait_for_it=False):
        self.buses = list(buses)
        self.clock = FakeClock()
        self.attempts_s = []
        self.notices = []
        self.bus = ReconnectingBus(
            self.open,
            ids,
            self.notices.append,
            clock=self.clock,
            sleep=self.clock.sleep,
            wait_for_it=wait_for_it,
        )

    def open(self):
        self.attempts_s.append(self.clock.now_s)
        bus = self.buses.pop(0) if len(self.buses) > 1 else self.buses[0]
        if isinstance(bus, Exception):
            raise bus
        return bus

    def receive_until(self, condition, tries=1000):
        for _ in range(tries):
            message = self.bus.receive(0.1)
            if condition():
                return message
        raise AssertionError("it never came")


DOWN = can.CanOperationError("down")


def test_frames_pass_with_the_wanted_ids_as_filters():
    fake = FakeBus()
    bench = Bench(fake, ids=(IdFilter.exact(0x101, False), IdFilter.exact(0x18FF0001, True)))
    assert bench.bus.receive(0.03) is MESSAGE
    assert fake.timeouts == [0.03]
    assert bench.bus.send(MESSAGE)
    assert fake.sent == [MESSAGE]
    assert bench.bus.channel_info == "fake"
    assert (bench.bus.sent, bench.bus.send_errors, bench.bus.reopened) == (1, 0, 0)
    assert fake.filters == [
        {"can_id": 0x101, "can_mask": 0x7FF, "extended": False},
        {"can_id": 0x18FF0001, "can_mask": 0x1FFFFFFF, "extended": True},
    ]
    assert bench.notices == []


@pytest.mark.parametrize("error", [OSError("no such device"), can.CanInitializationError("no")])
def test_a_bus_that_cannot_be_opened_at_first_is_an_error(error):
    with pytest.raises(type(error)):
        Bench(error)


def test_a_bus_that_is_not_there_yet_is_waited_for():
    missing = OSError(errno.ENODEV, "No such device")
    bench = Bench(missing, can.CanInitializationError("x"), missing, FakeBus(), wait_for_it=True)
    assert bench.bus.receive(0.05) is None
    assert not bench.bus.send(MESSAGE)
    assert bench.receive_until(lambda: bench.bus.reopened) is MESSAGE
    assert bench.notices == [
        f"cannot open the bus yet ({missing}); trying again",
        "the bus is back",
    ]
    assert np.diff(bench.attempts_s) == pytest.approx(PAUSES_S[:3])


def test_an_interface_that_does_not_exist_is_not_waited_for():
    with pytest.raises(can.CanInterfaceNotImplementedError):
        Bench(can.CanInterfaceNotImplementedError("no interface of this name"), wait_for_it=True)


@pytest.mark.parametrize("error", [DOWN, OSError(errno.ENETDOWN, "Network is down")])
def test_a_lost_bus_is_closed_and_opened_again_after_growing_pauses(error):
    first, second = FakeBus(recv_error=error), FakeBus()
    failures = [OSError("still down"), BusError("bus can0", "cannot be opened", "plug it in")]
    failures.insert(1, can.CanInitializationError("x"))
    bench = Bench(first, *failures, second)
    began_s = bench.clock.now_s
    assert bench.bus.receive(0.1) is None
    assert first.closed == 1
    assert bench.notices == [f"the bus is gone ({error}); reopening it"]
    assert not bench.bus.send(MESSAGE)  # and no error
    assert bench.bus.channel_info == "closed"
    message = bench.receive_until(lambda: bench.bus.reopened)
    assert message is MESSAGE
    assert bench.notices[1:] == ["the bus is back"]
    assert second.filters
    waited = np.diff([began_s, *bench.attempts_s[1:]])
    assert waited == pytest.approx(PAUSES_S[:4])
    assert (bench.bus.sent, bench.bus.send_errors, bench.bus.reopened) == (0, 0, 1)


def test_no_wait_is_longer_than_asked_for():
    bench = Bench(FakeBus(recv_error=DOWN), OSError("down"))
    bench.bus.receive(0.1)
    for _ in range(1000):
        before_s = bench.clock.now_s
        assert bench.bus.receive(0.02) is None
        assert bench.clock.now_s - before_s <= 0.02 + 1e-9
    assert bench.attempts_s[-1] - bench.attempts_s[-2] == pytest.approx(PAUSES_S[-1], abs=0.03)


def test_a_bus_that_opens_and_carries_nothing_is_neither_back_nor_gone_anew():
    """The pauses go on growing, and the operator reads one line."""
    bench = Bench(FakeBus(recv_error=DOWN))
    bench.receive_until(lambda: len(bench.attempts_s) == 6)
    assert [line for line in bench.notices if "gone" in line] == bench.notices
    assert len(bench.notices) == 1
    assert bench.bus.reopened == 0
    waited = np.diff(bench.attempts_s)
    assert waited == pytest.approx(PAUSES_S[:5])


def test_a_bus_is_back_with_the_first_frame_that_it_takes():
    bench = Bench(FakeBus(recv_error=DOWN), FakeBus(silent=True))
    bench.receive_until(lambda: len(bench.attempts_s) == 2)
    assert bench.bus.receive(0.1) is None
    assert bench.bus.reopened == 0
    assert bench.bus.send(MESSAGE)
    assert bench.bus.reopened == 1
    assert bench.notices[-1] == "the bus is back"


def test_the_pauses_begin_anew_with_each_loss():
    failing = FakeBus()
    bench = Bench(FakeBus(recv_error=DOWN), OSError("down"), OSError("down"), failing)
    bench.receive_until(lambda: bench.bus.reopened)
    failing.recv_error = DOWN
    lost_s = bench.clock.now_s
    bench.bus.receive(0.1)
    bench.receive_until(lambda: len(bench.attempts_s) == 5)
    assert bench.attempts_s[-1] - lost_s == pytest.approx(PAUSES_S[0])
    assert len([line for line in bench.notices if "gone" in line]) == 2


@pytest.mark.parametrize("code", [errno.ENETDOWN, errno.ENODEV, errno.ENXIO, errno.EBADF])
@pytest.mark.parametrize("kind", [OSError, can.CanOperationError])
def test_some_errors_at_sending_mean_that_the_bus_is_gone(kind, code):
    error = OSError(code, "gone") if kind is OSError else can.CanOperationError("gone", code)
    fake = FakeBus(send_error=error)
    bench = Bench(fake, FakeBus())
    assert not bench.bus.send(MESSAGE)
    assert (bench.bus.sent, bench.bus.send_errors, fake.closed) == (0, 1, 1)
    assert "the bus is gone" in bench.notices[0]


def test_a_full_bus_stays_open_and_is_reported_once():
    fake = FakeBus(send_error=OSError(errno.ENOBUFS, "No buffer space available"))
    bench = Bench(fake)
    assert [bench.bus.send(MESSAGE) for _ in range(5)] == [False] * 5
    assert (bench.bus.sent, bench.bus.send_errors, fake.closed) == (0, 5, 0)
    assert len(bench.notices) == 1
    assert "does not accept frames" in bench.notices[0]


def test_a_bus_that_fails_at_closing_is_opened_again_all_the_same():
    bench = Bench(FakeBus(recv_error=DOWN, close_error=OSError("stuck")), FakeBus())
    bench.bus.receive(0.1)
    assert bench.notices[1] == "closing it also failed (stuck)"
    assert bench.receive_until(lambda: bench.bus.reopened) is MESSAGE


def test_shutdown_closes_an_open_bus_and_leaves_a_lost_one():
    fake = FakeBus()
    Bench(fake).bus.shutdown()
    assert fake.closed == 1
    lost = FakeBus(recv_error=DOWN)
    bench = Bench(lost)
    bench.bus.receive(0.1)
    bench.bus.shutdown()
    assert lost.closed == 1


class Counting:
    """A bus whose interface counts what it drops instead of sending."""

    channel_info = "counting"
    state = can.BusState.ACTIVE

    def __init__(self, dropped=7):
        self.dropped, self.only_listens = dropped, True

    def send(self, message):
        self.dropped += self.only_listens

    def set_filters(self, filters):
        pass

    def shutdown(self):
        pass


def send_some(bus, number=CHECKED_FRAMES):
    for _ in range(number):
        assert bus.send(can.Message(arbitration_id=0x201))


def test_an_adapter_that_only_listens_is_told_once_and_counted():
    notices, own = [], Counting()
    bus = ReconnectingBus(lambda: own, (), notices.append, count_unsent=lambda one: one.dropped)
    send_some(bus, 3 * CHECKED_FRAMES)
    assert notices == [LISTEN_ONLY]
    # What was dropped before the bus was opened is not ours.
    assert bus.unsent == 3 * CHECKED_FRAMES
    own.only_listens = False
    send_some(bus)
    own.only_listens = True
    send_some(bus)
    assert notices == [LISTEN_ONLY] * 2


def test_single_frames_that_the_interface_drops_are_counted_and_not_told():
    notices, own = [], Counting()
    bus = ReconnectingBus(lambda: own, (), notices.append, count_unsent=lambda one: one.dropped)
    send_some(bus, 20)
    own.only_listens = False
    send_some(bus, CHECKED_FRAMES)
    assert notices == []
    assert bus.unsent == 20


def test_an_adapter_that_says_it_only_listens_is_told_at_the_opening():
    class Passive(Counting):
        state = can.BusState.PASSIVE

    notices = []
    ReconnectingBus(Passive, (), notices.append)
    assert notices == [LISTEN_ONLY]


def test_where_nothing_tells_nothing_is_counted():
    bus = ReconnectingBus(Counting, ())
    send_some(bus)
    assert bus.unsent == 0
