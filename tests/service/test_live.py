"""The live loop on python-can's virtual bus, and on buses that fail."""

import threading
import time
from types import SimpleNamespace

import can
import pytest

from adhesion_can.bus.frame import ADVANCE, Frame, Mark
from adhesion_can.config import load_configuration
from adhesion_can.recordings.candump import ReadReport, read_candump
from adhesion_can.recordings.python_can_messages import from_message, to_message
from adhesion_can.service.core import ServiceCore
from adhesion_can.service.live import LiveService
from adhesion_can.service.receive_queue import STALE_US, Received, ReceiveQueue
from adhesion_can.service.reconnecting_bus import PAUSES_S, ReconnectingBus
from adhesion_can.service.replay import replay
from tests.service.test_core import FixedEstimator, assert_not_available, run, status
from tests.wire import Bench, decoded

CONFIG = load_configuration()
PATIENCE_S = 60.0
"""Longest wait for what takes well under a second on an idle machine."""


def wall_clock():
    """Stamps of python-can's virtual bus, µs."""
    return time.time_ns() // 1000


def opened(channel, **options):
    return can.Bus(interface="virtual", channel=channel, **options)


def opener(bus, reopen=None):
    """Gives a bus at first, and then what `reopen` gives."""
    buses = iter([bus])
    return lambda: next(buses, None) or (reopen or (lambda: bus))()


class Running:
    """A service in a thread of its own."""

    def __init__(self, core, bus, reopen=None, **options):
        self.core = core
        self.lines = []
        self.notices = []
        self.bus = ReconnectingBus(opener(bus, reopen), core.ids, self.notices.append)
        self.service = LiveService(
            core,
            self.bus,
            write_log=self.lines.append,
            notify=self.notices.append,
            **options,
        )
        self.thread = threading.Thread(target=self.service.run)

    def __enter__(self):
        self.thread.start()
        return self

    def __exit__(self, *_):
        self.service.stop()
        self.thread.join(PATIENCE_S)
        assert not self.thread.is_alive()


def wait_until(ready):
    """Wait for an event in another thread, however busy the machine is."""
    end = time.monotonic() + PATIENCE_S
    while not ready():
        assert time.monotonic() < end, f"nothing came within {PATIENCE_S} s"
        time.sleep(0.01)


def send_drive(bus, seconds, stall_at=None, until=lambda: False):
    """A steady drive in real time; returns when it is over, or earlier where `until` says so."""
    began = time.monotonic()
    for frame in Bench().drive(0, round(seconds * 1e6)):
        if until():
            return
        time.sleep(max(0.0, frame.t_us / 1e6 - (time.monotonic() - began)))
        if stall_at is not None and frame.t_us / 1e6 > stall_at:
            time.sleep(0.15)
            stall_at = None
        bus.send(to_message(frame._replace(t_us=wall_clock())))


def everything(bus):
    """What has come in; does not wait, since the service never stops to send."""
    frames = []
    while (message := bus.recv(0.0)) is not None:
        frames.append(from_message(message))
    return frames


def owned(frames, with_health=False):
    ids = {0x201, 0x202, 0x203, 0x204} | ({0x211} if with_health else set())
    return [frame for frame in frames if frame.arbitration_id in ids]


def own(frames, with_health=False):
    return [(f.arbitration_id, f.data) for f in owned(frames, with_health)]


def assert_replayed(sent, logged, overdue):
    """A replay sends what the log has of the service, in its order, and what was overdue besides.

    On an idle machine nothing is; in simulated time (`Played`) the two are equal in each test.
    """
    again = [(f.t_us, *one) for f, one in zip(owned(sent), own(sent), strict=True)]
    kept = [(f.t_us, *one) for f, one in zip(owned(logged), own(logged), strict=True)]
    assert len(again) - len(kept) <= overdue
    left = iter(again)
    assert all(frame in left for frame in kept)  # a search in an iterator goes on where it ended


@pytest.mark.costly
@pytest.mark.parametrize("stall_at", [None, 0.8])
def test_live_and_the_replay_of_its_log_are_byte_identical(stall_at):
    """Also where the sender stalls, so that the loop has to advance by its own clock."""
    channel = f"identical-{stall_at}"
    with opened(channel) as sender, opened(channel) as listener:
        with Running(ServiceCore(CONFIG), opened(channel)) as live:
            send_drive(sender, 2.2, stall_at)
            received = []
            wait_until(lambda: received.extend(own(everything(listener))) or len(received) > 700)
            # Without inputs the loop has to advance by its own clock.
            wait_until(lambda: any(f" {ADVANCE}" in line for line in tuple(live.lines)))
        received += own(everything(listener))
    report = ReadReport()
    items = list(read_candump([line.encode() for line in live.lines], report))
    assert report.passed_over == 0
    assert any(isinstance(item, Mark) for item in items)
    sent = []
    replay(items, ServiceCore(CONFIG), sent.append)
    logged = [item for item in items if isinstance(item, Frame)]
    assert own(logged) == received
    # What it sent last is taken back when it ends.
    assert [number for number, _ in received[-9:]] == [0x201, 0x202, 0x203, *[0x204] * 6]
    assert status(logged) == "INIT"
    assert len(received) > 700
    assert_replayed(sent, logged, live.service.counts.overdue)


def test_setpoints_come_while_the_inputs_are_silent():
    with opened("silent") as sender, opened("silent") as listener:
        with Running(ServiceCore(CONFIG, FixedEstimator), opened("silent")):
            send_drive(sender, 0.3)
            everything(listener)
            frames = []

            def stale_for_long():
                frames.extend(everything(listener))
                setpoints = [f for f in frames if f.arbitration_id == 0x201]
                return len(setpoints) >= 15 and status(frames) == "STALE_INPUT"

            wait_until(stale_for_long)


def test_a_dry_run_sends_nothing_and_logs_what_it_would_have_sent():
    with opened("dry") as sender, opened("dry") as listener:
        with Running(ServiceCore(CONFIG), opened("dry"), dry_run=True) as live:
            send_drive(sender, 0.3)
            wait_until(lambda: any(" 201#" in line for line in tuple(live.lines)))
        assert own(everything(listener), with_health=True) == []
    assert live.bus.sent == 0


def test_echoes_of_our_own_frames_are_not_a_second_sender():
    channel = "echo"
    with opened(channel) as sender:
        echoing = opened(channel, receive_own_messages=True)
        with Running(ServiceCore(CONFIG, FixedEstimator), echoing) as live:
            send_drive(sender, 0.5)
            wait_until(lambda: live.service.counts.echoes > 100)
    assert live.service.counts.foreign_outputs == 0
    assert live.core.faults == []


@pytest.mark.parametrize(("stamp_late_us", "echoes"), [(0, True), (3_000_000, False)])
def test_a_loop_that_is_behind_knows_an_echo_by_its_stamp(stamp_late_us, echoes):
    """The loop sees its frames later than they passed the bus: the stamp says when that was."""
    now_us = [0]
    bus = FailingBus([to_message(f) for f in Bench().drive(0, 300_000)])
    service = LiveService(
        ServiceCore(CONFIG, FixedEstimator),
        ReconnectingBus(lambda: bus, ()),
        clock=lambda: now_us[0],
    )
    while bus.messages:
        now_us[0] = round(bus.messages[0].timestamp * 1e6)
        service._step()
    own_frames = [from_message(message) for message in bus.sent]
    assert len(own_frames) > 50
    # As they come back: with the time at which they passed the bus, or with one 3 s later.
    now_us[0] += 3_000_000
    for frame in own_frames:
        message = to_message(frame._replace(t_us=frame.t_us + stamp_late_us))
        service._handle(Received(message, now_us[0], awaited=False, earliest_us=0))
    counts = service.counts
    assert (counts.echoes, counts.foreign_outputs) == (
        (len(own_frames), 0) if echoes else (0, len(own_frames))
    )


def test_a_second_service_is_reported_and_a_fault_and_in_the_log():
    channel = "second"
    other = run(ServiceCore(CONFIG, FixedEstimator), Bench().drive(0, 100_000))
    with opened(channel) as sender, opened(channel) as listener:
        with Running(ServiceCore(CONFIG, FixedEstimator), opened(channel)) as live:
            send_drive(sender, 0.3)
            foreign = next(f for f in reversed(other) if f.arbitration_id == 0x201)
            sender.send(to_message(foreign._replace(t_us=wall_clock(), data=b"\1\2\3\4\5\6\7\x08")))
            frames = []

            def fault():
                frames.extend(everything(listener))
                points = [decoded(f) for f in frames if f.arbitration_id == 0x201]
                return any(str(point["Status"]) == "FAULT" for point in points)

            wait_until(fault)
    assert live.service.counts.foreign_outputs == 1
    assert any(
        "another node on this bus sends AdhesionSetpoint (0x201)" in line for line in live.notices
    )
    assert any("second-sender" in line for line in live.lines)


class FailingBus(can.BusABC):
    """A bus that gives what it has and then breaks."""

    def __init__(self, messages=(), error=None, send_error=None):
        super().__init__(channel="failing")
        self.messages = list(messages)
        self.error = error
        self.send_error = send_error
        self.sent = []

    def _recv_internal(self, timeout):
        if self.messages:
            return self.messages.pop(0), True
        if self.error:
            raise self.error
        time.sleep(min(timeout or 0.0, 0.01))
        return None, True

    def send(self, msg, timeout=None):
        if self.send_error:
            raise self.send_error
        self.sent.append(msg)


def messages_of(frames):
    now = wall_clock()
    return [to_message(frame._replace(t_us=now + frame.t_us)) for frame in frames]


def test_a_bus_that_goes_down_is_opened_again_and_the_core_goes_on():
    bench = Bench()
    first = FailingBus(messages_of(bench.drive(0, 50_000)), error=can.CanOperationError("down"))
    second = FailingBus()
    attempts = []

    def reopen():
        attempts.append(time.monotonic())
        if len(attempts) < 3:
            raise OSError("still down")
        return second

    with Running(ServiceCore(CONFIG, FixedEstimator), first, reopen) as live:
        wait_until(lambda: live.bus.reopened)
    assert live.bus.reopened == 1
    assert len(attempts) == 3
    # A busy machine makes each pause longer, never shorter.
    assert attempts[1] - attempts[0] >= PAUSES_S[1]
    assert attempts[2] - attempts[1] >= PAUSES_S[2] > PAUSES_S[1] > 0.1
    assert second.sent  # STALE_INPUT goes out on the new bus
    # Of a busy machine, and of the clock of the stamps, there is more to tell.
    notices = [line for line in live.notices if line.startswith("the bus is")]
    assert [line.split("(")[0] for line in notices] == ["the bus is gone ", "the bus is back"]


def test_frames_that_the_bus_does_not_take_are_counted_and_reported_once():
    bus = FailingBus(
        messages_of(Bench().drive(0, 100_000)), send_error=can.CanOperationError("full")
    )
    with Running(ServiceCore(CONFIG, FixedEstimator), bus) as live:
        wait_until(lambda: live.bus.send_errors > 20)
    assert live.bus.sent == 0
    assert sum("does not accept frames" in line for line in live.notices) == 1


def test_stamps_of_another_clock_are_shifted_and_reported():
    bus = FailingBus([to_message(f) for f in Bench().drive(5_000_000, 5_300_000)])
    with Running(ServiceCore(CONFIG, FixedEstimator), bus) as live:
        wait_until(lambda: live.core.now_us and not bus.messages and not live.service._queue)
    assert live.service.stamps.offset_us > 1e15
    assert "another clock" in live.notices[0]
    assert live.core.counts.clamped == 0


def test_a_flood_is_bounded_and_its_oldest_frames_are_dropped_and_counted():
    bus = FailingBus(messages_of(Bench().drive(0, 2_000_000)))
    now_us = 0
    queue = ReceiveQueue(
        ReconnectingBus(lambda: bus, ()), lambda _: 20_000, lambda: now_us, capacity=50
    )
    now_us = 20_000
    flood = len(bus.messages)
    received = []
    for _ in range(flood):
        # Everything is there at once, and late: nobody can follow that.
        received.append(queue.get(0.0))
        assert len(queue) <= 50
    received = [one.message for one in received if one is not None]
    assert queue.dropped > 0
    assert len(received) + queue.dropped == flood
    stamps = [message.timestamp for message in received]
    assert stamps == sorted(stamps)


def test_what_waited_too_long_is_dropped_but_for_the_last():
    """Two seconds of frames that were there when a process was let go on after a stop."""
    frames = list(Bench().drive(0, 2_000_000))
    bus = FailingBus([to_message(frame) for frame in frames])
    now_us = 0
    queue = ReceiveQueue(
        ReconnectingBus(lambda: bus, ()),
        lambda one: now_us - round(one.message.timestamp * 1e6),
        lambda: now_us,
    )
    now_us = 2_000_000
    received = []
    while bus.messages or len(queue):
        received.append(round(queue.get(0.0).message.timestamp * 1e6))
    assert queue.dropped + len(received) == len(frames)
    young = [frame.t_us for frame in frames if now_us - frame.t_us <= STALE_US]
    assert received[-len(young) :] == young
    assert len(received) - len(young) < 10


def test_dropped_frames_are_counted_by_the_core():
    bus = FailingBus(messages_of(Bench().drive(0, 100_000)))
    service = LiveService(ServiceCore(CONFIG, FixedEstimator), ReconnectingBus(lambda: bus, ()))
    service._queue.dropped = 7
    service._step()
    assert service.core.counts.receive_drops == 7


def test_loop_time_is_measured(monkeypatch):
    """By a clock that lets every fiftieth frame take 10 ms and the others 250 µs."""
    ticks = iter([t for k in range(1000) for t in (k, k + (0.01 if k % 50 == 0 else 250e-6))])
    clock = SimpleNamespace(
        perf_counter=lambda: next(ticks), monotonic_ns=time.monotonic_ns, time_ns=time.time_ns
    )
    monkeypatch.setattr("adhesion_can.service.live.time", clock)
    # The time of the loop is that of the frames: none is too old on a busy machine.
    played = Played()
    played.drive(0, 500_000)
    played.service.bus.shutdown()
    assert played.service.counts.received >= 200
    assert played.core.loop_time_p99_us == pytest.approx(10_000)


class Played:
    """A service by a clock that stands still but for frames, or where a test sets it."""

    def __init__(self, **options):
        self.now_us = 0
        self.bus = FailingBus()
        self.core = ServiceCore(CONFIG, FixedEstimator)
        self.lines = []
        self.service = LiveService(
            self.core,
            ReconnectingBus(lambda: self.bus, ()),
            clock=lambda: self.now_us,
            write_log=self.lines.append,
            **options,
        )

    def drive(self, from_us, to_us):
        self.bus.messages = [to_message(frame) for frame in Bench().drive(from_us, to_us)]
        while self.bus.messages:
            self.now_us = max(self.now_us, round(self.bus.messages[0].timestamp * 1e6))
            self.service._step()

    def sent(self):
        return [from_message(message) for message in self.bus.sent]

    def assert_replayed(self, left_out=0):
        """A replay of the log sends what was sent, and at most so many frames that were not."""
        items = list(read_candump([line.encode() for line in self.lines], ReadReport()))
        again = []
        replay(items, ServiceCore(CONFIG, FixedEstimator), again.append)
        assert len(own(again)) - len(own(self.sent())) <= left_out
        rest = iter(own(again))
        assert all(one in rest for one in own(self.sent()))
        assert own(again)[-9:] == own(self.sent())[-9:]


LAST = [0x201, 0x202, 0x203, *[0x204] * 6, 0x211]


def assert_taken_back(frames):
    assert [frame.arbitration_id for frame in frames[-len(LAST) :]] == LAST
    assert status(frames) == "INIT"
    assert_not_available(frames[-len(LAST) :])


@pytest.mark.parametrize("pause_s", [0.01, 0.1, 0.15, 10.0, 100.0])
def test_after_a_pause_the_last_frames_leave_first(pause_s):
    """They are not overdue, and nothing that is comes before them."""
    played = Played()
    played.drive(0, 305_000)
    assert status(played.sent()) == "TRACKING"
    before = len(played.bus.sent)
    played.now_us += round(pause_s * 1e6)
    played.service.stop()
    played.service.run()
    assert_taken_back(played.sent())
    assert len(played.bus.sent) - before == len(LAST)
    assert played.service.counts.overdue == 0
    assert sum(played.service.lateness.counts) == 16
    played.assert_replayed()


def test_a_request_to_stop_ends_the_catching_up():
    """After ten seconds, within the time that is filled, it is asked to stop meanwhile."""
    turns = []

    def turn():
        turns.append(played.core.now_us)
        if len(turns) == 100:
            played.service.stop()

    played = Played(each_turn=turn)
    played.drive(0, 305_000)
    before = len(played.bus.sent)
    late = next(iter(Bench().drive(10_000_000, 10_010_000)))
    played.now_us = late.t_us
    played.service._handle(Received(to_message(late), late.t_us, awaited=False, earliest_us=0))
    assert len(turns) == 100
    assert played.core.now_us < 4_000_000
    played.service.run()
    assert_taken_back(played.sent())
    assert len(played.bus.sent) - before == len(LAST)
    played.assert_replayed(played.service.counts.overdue)


@pytest.mark.parametrize("dropped", [0, 1, 13, 14, 15, 29])
def test_no_last_frame_is_taken_for_a_repetition(dropped):
    """The bus does not take some setpoints; fourteen later the count is the same again."""
    played = Played()
    played.drive(0, 305_000)
    played.bus.send_error = can.CanOperationError("full")
    played.drive(310_000, 305_000 + 20_000 * dropped)
    played.bus.send_error = None
    before = [frame for frame in played.sent() if frame.arbitration_id == 0x201][-1]
    sent = len(played.bus.sent)
    played.service.stop()
    played.service.run()
    last = [frame for frame in played.sent()[sent:] if frame.arbitration_id == 0x201]
    assert last[0].data[1] & 0xF != before.data[1] & 0xF
    assert_taken_back(played.sent())
    assert len(played.bus.sent) - sent <= 2 * len(LAST)
    # At most eight of ours are due in 20 ms.
    played.assert_replayed(8 * dropped)
