"""The service on a bus: one blocking loop around the core.

The loop waits for a frame until 2 ms after the next due time at most; so a frame may come that much
late and still count before it. While the bus is down the core goes on, with status STALE_INPUT.
"""

import gc
import threading
import time
from collections import deque
from collections.abc import Callable, Iterable
from dataclasses import dataclass

import numpy as np

from adhesion_can.bus.e2e import COUNTS
from adhesion_can.bus.frame import ADVANCE, SECOND_SENDER, STOP, Frame, Mark, to_us
from adhesion_can.recordings.candump import format_frame, format_mark
from adhesion_can.recordings.python_can_messages import from_message, to_message
from adhesion_can.service.core import ServiceCore
from adhesion_can.service.echoes import EchoFilter
from adhesion_can.service.lateness import Lateness
from adhesion_can.service.output_messages import SETPOINT
from adhesion_can.service.receive_queue import Received, ReceiveQueue
from adhesion_can.service.reconnecting_bus import ReconnectingBus
from adhesion_can.service.stamp_clock import StampClock

GRACE_US = 2_000
"""Time after a due time until which frames stamped before it are waited for, µs."""
FAR_US = 200_000
"""Time by which the core is behind, µs, from which it is looked for a request to stop at each due
time that it catches up with."""
OVERDUE_US = 100_000
"""Time after its due time, and at least a cycle, from which a frame is not sent any more, µs."""
BUS_OFF = 0x40
"""Bit of the id of an error frame by which SocketCAN reports bus-off (linux/can/error.h)."""
IDLE_S = 0.1
"""Longest wait for a frame, s, so that a request to stop is seen soon."""


def start_clock() -> Callable[[], int]:
    """Clock of this host, µs since the epoch: the wall clock's time now, going on evenly.

    Nobody sets it: what is due in 20 ms is due in 20 ms, whatever happens to the wall clock.
    """
    offset_ns = time.time_ns() - time.monotonic_ns()
    return lambda: (time.monotonic_ns() + offset_ns) // 1000


@dataclass(slots=True)
class LiveCounts:
    """Numbers of what came in.

    Attributes:
        received: Number of frames received.
        echoes: Number of echoes of our own frames, as some interfaces return them.
        foreign_outputs: Number of frames with our ids that another sender sent.
        overdue: Number of our frames that were not sent, since they were due too long ago.
        bus_off: Number of times that the controller left the bus because of its errors.

    """

    received: int = 0
    echoes: int = 0
    foreign_outputs: int = 0
    overdue: int = 0
    bus_off: int = 0


class LiveService:
    """Runs a core on a bus until it is asked to stop.

    Args:
        core: Fresh core.
        bus: Bus that delivers the ids of the core's inputs and outputs.
        clock: Clock of this host, which nobody sets, µs; None starts one.
        write_log: Callback with each line of the service's own log.
        secure: Function that makes of a frame of ours the one that goes on the bus; the log keeps
            the former.
        dry_run: Whether to receive and identify, but to send nothing.
        notify: Callback with a line for the operator.
        each_turn: Callback at each turn of the loop, ten times a second at least.

    """

    def __init__(
        self,
        core: ServiceCore,
        bus: ReconnectingBus,
        *,
        clock: Callable[[], int] | None = None,
        write_log: Callable[[str], object] | None = None,
        secure: Callable[[Frame], Frame] = lambda frame: frame,
        dry_run: bool = False,
        notify: Callable[[str], None] = lambda _: None,
        each_turn: Callable[[], None] = lambda: None,
    ) -> None:
        self.core = core
        self.bus = bus
        self.counts = LiveCounts()
        self.lateness = Lateness()
        """Times from due to sent of the setpoints of all axles together."""
        self.clock = clock or start_clock()
        self.stamps = StampClock(notify)
        self._echoes = EchoFilter()
        self._missed: dict[int, int] = {}
        """Number of frames since the last one that the bus took, by id."""
        self._overdue_us = {
            number: max(cycle_us, OVERDUE_US)
            for number, cycle_us in core.messages.cycles_by_id_us.items()
        }
        self._setpoint_id = core.messages.ids_by_name[SETPOINT]
        cycle_us = core.messages.cycles_by_id_us[self._setpoint_id]
        self._queue = ReceiveQueue(bus, self._age_us, self.clock, cycle_us=cycle_us)
        self._write_log = write_log
        self._secure = secure
        self._dry_run = dry_run
        self._notify = notify
        self._each_turn = each_turn
        self._stuck_signals: list[str] = []
        """Signals that were reported to be stuck."""
        self._stuck_readings = 0
        self._overload_told = False
        """Whether it was reported that more frames come than are handled."""
        self._stop = threading.Event()
        self._loop_times_s: deque[float] = deque(maxlen=1000)

    def stop(self) -> None:
        """Ask the loop to end; safe from a signal handler or another thread."""
        self._stop.set()

    def run(self, until_us: int | None = None) -> None:
        """Run until `stop` is called, or until the clock passes `until_us`; then close the bus.

        The last frames say 'not available': no controller continues with a setpoint that has no
        sender.
        """
        # What lives as long as the service need not be looked through for garbage: a collection of
        # the whole heap takes tens of milliseconds. So would one here, while frames come already.
        gc.freeze()
        try:
            while not self._stop.is_set() and (until_us is None or self.clock() < until_us):
                self._step()
                self._each_turn()
            self._take_back()
        finally:
            gc.unfreeze()
            self.bus.shutdown()

    def _take_back(self) -> None:
        """Send the last frames.

        They leave at once: what is due before them, since the loop was held up, is not composed.
        """
        due_us, now_us = self.core.next_due_us, self.core.now_us
        t_us = max(self.clock() if due_us is None else min(self.clock(), due_us - 1), now_us)
        for _ in range(2):
            self._log(format_mark(Mark(t_us, STOP)))
            if self._send_last(self.core.stop(t_us)):
                return
            # Some have the count of the last frame that was sent; the next ones have another.

    def _send_last(self, frames: Iterable[Frame]) -> bool:
        """Send last frames, which are never overdue.

        Returns:
            Whether receivers take none of them for a repetition.

        """
        all_new = True
        for frame in frames:
            if self._looks_repeated(frame):
                self._missed[frame.arbitration_id] += 1
                all_new = False
                continue
            if not self._dry_run:
                self._hand_over(frame)
            self._log_frame(frame)
        return all_new

    def _step(self) -> None:
        """Handle the next frame, or advance the core where none comes until its due time."""
        due_us = self.core.next_due_us
        wait_s = IDLE_S
        if due_us is not None:
            wait_s = min(max((due_us + GRACE_US - self.clock()) / 1e6, 0.0), IDLE_S)
        received = None
        if self.core.has_work_ahead:
            received = self._queue.get(0.0)
            if received is None and self.core.work_ahead():
                return
        if received is None:
            received = self._queue.get(wait_s)
        if self._stop.is_set():
            return
        if received is not None:
            self._handle(received)
        elif due_us is not None and self.clock() >= due_us + GRACE_US:
            self._log(format_mark(Mark(due_us, ADVANCE)))
            self._send(self.core.due_frames(due_us))
        # Behind the sending, which it would hold up.
        self.core.counts.receive_drops = self._queue.dropped + self.bus.kernel_drops
        self._tell_stuck()
        self._tell_overload()

    def _handle(self, received: Received) -> None:
        began = time.perf_counter()
        self.counts.received += 1
        stamp_us = to_us(received.message.timestamp)
        t_us = self.stamps.to_host(
            stamp_us, received.time_us, received.earliest_us, awaited=received.awaited
        )
        frame = from_message(received.message, t_us)
        if frame.is_error and frame.arbitration_id & BUS_OFF:
            self._tell_bus_off()
        # The id of an error frame is a set of bits, and may look like one of ours.
        if frame.is_data and ((frame.arbitration_id, frame.is_extended) in self.core.messages.ids):
            self._handle_own_id(frame)
            return
        if t_us < 0:
            t_us, frame = 0, frame._replace(t_us=0)
        effective = frame if t_us >= self.core.now_us else frame._replace(t_us=self.core.now_us)
        # What is due goes out before the frame is looked at.
        if not self._send_due(effective.t_us):
            return
        # The core gets the stamp as it came, and counts it when it has to clamp it.
        self._send(self.core.feed(frame))
        self._log_frame(effective)
        self._loop_times_s.append(time.perf_counter() - began)
        if self.counts.received % 100 == 0:
            self.core.loop_time_p99_us = float(np.quantile(self._loop_times_s, 0.99)) * 1e6

    def _tell_stuck(self) -> None:
        """Report the signals that became stuck, and those that change again."""
        stuck = self.core.receiver.stuck
        if stuck == self._stuck_readings and not self._stuck_signals:
            return
        self._stuck_readings = stuck
        signals = self.core.receiver.stuck_signals
        for name in signals:
            if name not in self._stuck_signals:
                self._notify(
                    f"{name} is stuck: its frames arrive but its value no longer changes; it "
                    "counts as not available until it does (if it may stay constant, set "
                    "stuck_check = false for its role)"
                )
        for name in self._stuck_signals:
            if name not in signals:
                self._notify(f"{name} is no longer stuck")
        self._stuck_signals = signals

    def _tell_overload(self) -> None:
        """Report once that the machine is too slow for the bus."""
        if self._queue.is_overloaded and not self._overload_told:
            self._overload_told = True
            self._notify(
                "overload: dropping the oldest frames (frames_lost); setpoints continue; stop "
                "other programs on this machine, or send fewer input frames"
            )

    def _tell_bus_off(self) -> None:
        self.counts.bus_off += 1
        self._notify(
            "the CAN controller left the bus after errors (bus-off); it receives and sends "
            "nothing until it is restarted; `ip link set can0 type can restart-ms 100` restarts "
            "it automatically"
        )

    def _handle_own_id(self, frame: Frame) -> None:
        """Handle a frame with an id of ours: an echo of our own frame, or a second service's."""
        # By its stamp, not by the clock: a loop that is behind sees an echo late.
        if self._echoes.is_echo(frame, min(self.clock(), frame.t_us)):
            self.counts.echoes += 1
            return
        if not self.counts.foreign_outputs:
            name = self.core.messages.find_name(frame.arbitration_id)
            self._notify(
                f"another node on this bus sends {name} ({frame.arbitration_id:#x}); the status "
                "is FAULT while it does; stop it, or give this service a database with other ids"
            )
        self.counts.foreign_outputs += 1
        mark = Mark(max(frame.t_us, self.core.now_us), SECOND_SENDER)
        self._log(format_mark(mark))
        self.core.second_sender(mark.t_us)

    def _send_due(self, t_us: int) -> bool:
        """Send what is due until a time, µs; returns False where it was asked to stop meanwhile."""
        core = self.core
        if FAR_US < t_us - core.now_us <= core.restart_us:
            # After a pause: as one call would, due time by due time.
            while (due_us := core.next_due_us) is not None and due_us < t_us:
                if self._stop.is_set():
                    return False
                self._send(core.due_frames(due_us))
                self._each_turn()
        self._send(core.due_frames(t_us))
        return True

    def _send(self, frames: Iterable[Frame]) -> None:
        for frame in frames:
            number = frame.arbitration_id
            # Held up for long: nobody is sent a burst of what was due meanwhile.
            overdue = self.clock() - frame.t_us >= self._overdue_us[number]
            if overdue or self._looks_repeated(frame):
                self.counts.overdue += 1
                self._missed[number] = self._missed.get(number, 0) + 1
                continue
            if not self._dry_run:
                sent_us = self._hand_over(frame)
                if sent_us is not None and number == self._setpoint_id:
                    self.lateness.add(max(sent_us - frame.t_us, 0))
            # Behind the sending, which it would hold up.
            self._log_frame(frame)

    def _looks_repeated(self, frame: Frame) -> bool:
        """Whether a frame has the count of the last one that was sent: receivers reject it."""
        missed = self._missed.get(frame.arbitration_id, 0)
        return missed > 0 and (missed + 1) % COUNTS == 0

    def _hand_over(self, frame: Frame) -> int | None:
        """Send a frame of ours, and count where the bus does not take it.

        Returns:
            Time at which it was sent, µs; None where the bus did not take it.

        """
        number = frame.arbitration_id
        sent = self._secure(frame)
        if not self.bus.send(to_message(sent)):
            self._missed[number] = self._missed.get(number, 0) + 1
            return None
        self._missed[number] = 0
        sent_us = self.clock()
        self._echoes.add_sent(sent, sent_us)
        return sent_us

    def _log(self, line: str) -> None:
        if self._write_log is not None:
            self._write_log(line)

    def _log_frame(self, frame: Frame) -> None:
        if self._write_log is not None:
            self._write_log(format_frame(frame))

    def _age_us(self, received: Received) -> int:
        if not self.stamps.usable:
            return 0
        stamp_us = to_us(received.message.timestamp) + self.stamps.offset_us
        # By the present: one that waits in the queue grows older.
        return self.clock() - stamp_us
