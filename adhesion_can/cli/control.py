"""`control`: the reference creep controller as a process of its own on a bus.

It reads the vehicle's speeds and efforts and the service's setpoints, and sends effort demands to
`simulate --closed-loop`. Frames count from their arrival on this host's monotonic clock, so that
no clock of the bus makes the motors wait.
"""

import argparse
import signal
import sys
import time
from types import FrameType

from adhesion_can.bus.frame import Frame
from adhesion_can.cli.common import (
    add_bus,
    add_configuration,
    add_json,
    bus_opener,
    configuration,
    require_positive,
    talk,
    write_json,
)
from adhesion_can.cli.silence import SilenceWatch, bus_name
from adhesion_can.control.creep_controller import CreepController, Mode
from adhesion_can.control.frames import ControllerOnBus, build_reference
from adhesion_can.recordings.python_can_messages import from_message, to_message
from adhesion_can.reporting.provenance import provenance
from adhesion_can.service.reconnecting_bus import ReconnectingBus

WAIT_S = 0.05
"""Longest wait for a frame before the first step, s: Ctrl-C is noticed after it."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the description and the options of the command to its parser."""
    parser.description = (
        "The reference creep controller: reads wheel speeds, vehicle speed, efforts and the "
        "service's setpoints, sends EffortDemand1 and 2 to 'simulate --closed-loop', until it is "
        "interrupted (Ctrl-C, SIGTERM) or the duration is over."
    )
    parser.add_argument(
        "--wait", action="store_true", help="wait for a bus that is not there yet, and try again"
    )
    parser.add_argument("--duration", type=float, metavar="S", help="end after so long")
    add_json(parser)
    add_configuration(parser)
    add_bus(parser)


def run(options: argparse.Namespace) -> int:
    """Run the command."""
    if options.duration is not None:
        require_positive(options.duration, "--duration")
    config = configuration(options)
    controller = build_reference(config)
    frames = ControllerOnBus(config, controller)
    bus = ReconnectingBus(bus_opener(options), frames.ids, _say, wait_for_it=options.wait)
    try:
        name = bus_name(options, bus.channel_info)
        silence = SilenceWatch(
            f"nothing is received on {name} yet: start 'simulate --closed-loop' and 'run' on it",
            _say,
        )
        loop = _Loop(frames, controller, bus, silence)
        for number in (signal.SIGINT, signal.SIGTERM):
            signal.signal(number, loop.stop)
        _say(f"controlling on {name}; Ctrl-C ends")
        loop.run(options.duration)
    finally:
        bus.shutdown()
    document = {
        "received": loop.received,
        "rejected": frames.receiver.rejected,
        "steps": loop.steps,
        "sent": bus.sent,
        "send_errors": bus.send_errors,
        "share_of_steps": {mode.name.lower(): loop.share(mode) for mode in Mode},
    }
    write_json(options.json, {**document, **provenance(config)})
    if talk(options):
        shares = ", ".join(f"{100 * loop.share(mode):.0f} % {mode.name}" for mode in Mode)
        _say(
            f"{loop.received} frames received, {frames.receiver.rejected} rejected; "
            f"{loop.steps} steps: {shares}; {bus.sent} frames sent"
        )
    return 0


class _Loop:
    """Frames of a bus through a controller, until it is stopped."""

    def __init__(
        self,
        frames: ControllerOnBus,
        controller: CreepController,
        bus: ReconnectingBus,
        silence: SilenceWatch,
    ) -> None:
        self._frames = frames
        self._controller = controller
        self._bus = bus
        self._silence = silence
        self._stopped = False
        self._mode: Mode | None = None
        self._counts = dict.fromkeys(Mode, 0)
        self.received = 0

    @property
    def steps(self) -> int:
        return sum(self._counts.values())

    def share(self, mode: Mode) -> float:
        """Share of the steps in a mode."""
        return self._counts[mode] / max(self.steps, 1)

    def stop(self, _: int, __: FrameType | None) -> None:
        self._stopped = True

    def run(self, duration_s: float | None) -> None:
        frames = self._frames
        end_us = None if duration_s is None else _now_us() + round(duration_s * 1e6)
        while not self._stopped and (end_us is None or _now_us() < end_us):
            due_us = frames.next_due_us
            wait_s = WAIT_S if due_us is None else min(max(due_us - _now_us(), 0) / 1e6, WAIT_S)
            message = self._bus.receive(wait_s)
            self._silence.look(heard=message is not None)
            if message is None:
                demands = frames.advance(_now_us())
            else:
                self.received += 1
                demands = frames.feed(from_message(message)._replace(t_us=_now_us()))
            self._send(demands)
            self._note_mode(demands)
        self._send(frames.stop(_now_us()))

    def _send(self, demands: list[Frame]) -> None:
        for demand in demands:
            self._bus.send(to_message(demand))

    def _note_mode(self, demands: list[Frame]) -> None:
        """Count a step, and say what the controller goes by where that has changed."""
        if demands:
            mode = self._controller.mode
            self._counts[mode] += 1
            if mode is not self._mode:
                self._mode = mode
                _say(f"{mode.name}: {mode.value}")


def _now_us() -> int:
    return time.monotonic_ns() // 1000


def _say(line: str) -> None:
    print(line, file=sys.stderr, flush=True)
