"""`control`: the reference creep controller as a process of its own on a bus.

It reads the vehicle's speeds and efforts and the service's setpoints, and sends effort demands to
`simulate --closed-loop`. Frames count from their arrival on this host's monotonic clock, so that
no clock of the bus makes the motors wait.
"""

import argparse
import signal
import time
from pathlib import Path
from types import FrameType

from adhesion_can.bus.frame import Frame
from adhesion_can.cli.bus_options import add_bus, add_wait, bus_opener
from adhesion_can.cli.common import add_configuration, configuration, require_positive
from adhesion_can.cli.outputs import add_json, talk, write_json
from adhesion_can.cli.silence import SilenceWatch, bus_name
from adhesion_can.config.plan_file import read_plan
from adhesion_can.control.creep_controller import CreepController, Mode
from adhesion_can.control.frames import ControllerOnBus, build_follower, build_reference
from adhesion_can.control.plan_follower import PlanFollower
from adhesion_can.printable import say
from adhesion_can.recordings.python_can_messages import from_message, to_message
from adhesion_can.reporting.provenance import provenance
from adhesion_can.service.reconnecting_bus import ReconnectingBus

WAIT_S = 0.05
"""Longest wait for a frame before the first step, s: Ctrl-C is noticed after it."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the description and the options of the command to its parser."""
    parser.description = (
        "The reference creep controller. It reads wheel speeds, vehicle speed, efforts and the "
        "service's setpoints, and sends EffortDemand1 and 2 to 'simulate --closed-loop' until "
        "it is interrupted (Ctrl-C, SIGTERM) or the duration is over. With --plan, it brings "
        "the train to the plan's start speed, drives the steps of the plan, and ends."
    )
    parser.add_argument(
        "--plan",
        type=Path,
        metavar="PLAN.toml",
        help="drive this plan, written by diagnose --next-drive",
    )
    add_wait(parser)
    parser.add_argument("--duration", type=float, metavar="S", help="end after this time")
    add_json(parser)
    add_configuration(parser)
    add_bus(parser)


def run(options: argparse.Namespace) -> int:
    """Run the command."""
    if options.duration is not None:
        require_positive(options.duration, "--duration")
    config = configuration(options)
    controller: CreepController | PlanFollower
    if options.plan is None:
        controller = build_reference(config)
        frames = ControllerOnBus(config, controller)
    else:
        follower = controller = build_follower(config, read_plan(options.plan))
        frames = ControllerOnBus(config, controller, lambda: follower.sanding)
    bus = ReconnectingBus(bus_opener(options), frames.ids, say, wait_for_it=options.wait)
    try:
        name = bus_name(options, bus.channel_info)
        silence = SilenceWatch(
            f"nothing received on {name} yet: start 'simulate --closed-loop' and 'run' there",
            say,
        )
        loop = _Loop(frames, _Progress(controller), bus, silence)
        for number in (signal.SIGINT, signal.SIGTERM):
            signal.signal(number, loop.stop)
        say(f"controlling on {name}; Ctrl-C ends")
        loop.run(options.duration)
    finally:
        bus.shutdown()
    document = {
        "received": loop.received,
        "rejected": frames.receiver.rejected,
        "steps": loop.progress.steps,
        "sent": bus.sent,
        "send_errors": bus.send_errors,
        "share_of_steps": loop.progress.shares(),
    }
    write_json(options.json, {**document, **provenance(config)})
    if talk(options):
        say(
            f"{loop.received} frames received, {frames.receiver.rejected} rejected; "
            f"{_steps_of(loop.progress)}; {bus.sent} frames sent"
        )
    return 0


def _steps_of(progress: "_Progress") -> str:
    """Number of steps, and what the controller went by in them."""
    if not progress.steps:
        return "no step, as the wheel speeds of all axles never came"
    shares = [f"{100 * share:.0f} % {name.upper()}" for name, share in progress.shares().items()]
    return f"{progress.steps} steps: {', '.join(shares)}"


class _Progress:
    """What the controller goes by, step by step."""

    def __init__(self, controller: CreepController | PlanFollower) -> None:
        self._controller = controller
        self._counts: dict[str, int] = {}
        if isinstance(controller, CreepController):
            self._counts = {mode.name: 0 for mode in Mode}
        self._told = ""

    @property
    def steps(self) -> int:
        return sum(self._counts.values())

    @property
    def is_over(self) -> bool:
        """Whether a plan has been driven to its end."""
        controller = self._controller
        return isinstance(controller, PlanFollower) and controller.is_over

    def note(self) -> None:
        """Count a step, and say what the controller goes by where that has changed."""
        controller = self._controller
        if isinstance(controller, PlanFollower):
            number, told = controller.step_number, controller.phase
            name = "APPROACH" if number is None else f"STEP {number + 1}"
            name = "OVER" if controller.is_over else name
        else:
            name, told = controller.mode.name, f"{controller.mode.name}: {controller.mode.value}"
        self._counts[name] = self._counts.get(name, 0) + 1
        if told != self._told:
            self._told = told
            say(told)

    def shares(self) -> dict[str, float]:
        """Share of the steps by what the controller went by."""
        return {name.lower(): count / max(self.steps, 1) for name, count in self._counts.items()}


class _Loop:
    """Frames of a bus through a controller, until it is stopped or its plan is over."""

    def __init__(
        self,
        frames: ControllerOnBus,
        progress: _Progress,
        bus: ReconnectingBus,
        silence: SilenceWatch,
    ) -> None:
        self._frames = frames
        self.progress = progress
        self._bus = bus
        self._silence = silence
        self._stopped = False
        self.received = 0

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
            if demands:
                self.progress.note()
            self._stopped |= self.progress.is_over
        self._send(frames.stop(_now_us()))

    def _send(self, demands: list[Frame]) -> None:
        for demand in demands:
            self._bus.send(to_message(demand))


def _now_us() -> int:
    return time.monotonic_ns() // 1000
