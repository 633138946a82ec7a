"""`run`: the service on a bus."""

import argparse
import os
import signal
import sys
from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from types import FrameType
from typing import Any, TextIO, cast

from adhesion_can.cli.bus_options import add_bus, add_wait, bus_opener
from adhesion_can.cli.common import (
    MODEL_ONLINE,
    add_configuration,
    add_model,
    configuration,
    tell_all,
)
from adhesion_can.cli.extras_of_run import listening_address, read_secoc, serve_metrics
from adhesion_can.cli.narrator import FORMATS, Narrator
from adhesion_can.cli.outputs import (
    add_file,
    add_json,
    require_candump_name,
    require_outputs,
    talk,
    write_json,
)
from adhesion_can.cli.run_learning import RunLearning, add_learning, start_learning
from adhesion_can.cli.silence import SilenceWatch, bus_name, name_inputs, nothing_received
from adhesion_can.cli.stderr_behind import stderr_behind
from adhesion_can.estimation.extended.model import ExtendedModel
from adhesion_can.reporting.provenance import provenance
from adhesion_can.service.behind import done_within
from adhesion_can.service.core import ServiceCore
from adhesion_can.service.counters import read_counters
from adhesion_can.service.file_lock import file_lock
from adhesion_can.service.frame_log import LogBehind
from adhesion_can.service.kept_state import KeptState, kept_curves_to_lines, with_surfaces
from adhesion_can.service.live import LiveService
from adhesion_can.service.outputs import Outputs
from adhesion_can.service.reconnecting_bus import ReconnectingBus
from adhesion_can.service.service_manager import ServiceManager
from adhesion_can.service.state_file import read_state
from adhesion_can.service.state_keeper import StateKeeper
from adhesion_can.service.written_behind import WrittenBehind, longest_end_s


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the description and the options of the command to its parser."""
    parser.description = (
        "Reads the bus, identifies the adhesion curve and sends the setpoints until it is "
        "interrupted (Ctrl-C, SIGTERM) or the duration is over."
    )
    about = "log received and sent frames, for replay"
    add_file(parser, "--log", "F", about, require_candump_name)
    about = "start with the surfaces kept in this file, and keep those identified"
    add_file(parser, "--state", "F", about)
    add_wait(parser)
    parser.add_argument(
        "--dry-run", action="store_true", help="listen and identify, but send nothing"
    )
    parser.add_argument(
        "--secoc-key", type=Path, metavar="F", help="key file: send authenticated CAN FD frames"
    )
    add_file(parser, "--secoc-trip", "F", "file that counts the starts with this key")
    parser.add_argument(
        "--log-format",
        choices=FORMATS,
        default="text",
        help="lines on stderr as text (default) or as JSON, one object each",
    )
    parser.add_argument(
        "--metrics",
        type=listening_address,
        metavar="[HOST:]PORT",
        help="serve metrics to Prometheus there; HOST defaults to 127.0.0.1",
    )
    parser.add_argument(
        "--duration", type=float, metavar="S", help="end after so long; status 1 without a frame"
    )
    add_model(parser, MODEL_ONLINE)
    add_learning(parser)
    add_json(parser)
    add_configuration(parser)
    add_bus(parser)


def run(options: argparse.Namespace) -> int:
    """Run the command."""
    with stderr_behind() as stderr:
        narrator = Narrator(
            cast(TextIO, stderr), options.log_format, is_taken=lambda: stderr.has_room
        )
        ending = _serve(options, narrator, has_terminal=stderr.isatty())
    if not (ending.all_written and stderr.has_ended):
        # Who takes nothing was waited for; the interpreter would wait for ever at its own end.
        os._exit(ending.status)
    return ending.status


@dataclass(frozen=True)
class _Ending:
    """How the service ended.

    Attributes:
        all_written: Whether everything was written by the end.
        status: Exit status.

    """

    all_written: bool
    status: int


def _serve(options: argparse.Namespace, narrator: Narrator, *, has_terminal: bool) -> _Ending:
    """Serve until the end."""
    config = configuration(options)
    read = [path for path in (config.database.path, options.secoc_key) if path is not None]
    require_outputs(options, read)
    observers: list[Callable[[int, Outputs], None]] = [narrator.print_setpoint]
    with ExitStack() as stack:
        # The lock goes last: whoever waits for it must not find a state that is still written.
        if options.state:
            stack.enter_context(file_lock(options.state, f"--state {options.state}"))
        outputs = stack.enter_context(WrittenBehind(narrator.warn))
        path = options.state
        state = read_state(config, path, narrator.warn) if path else KeptState("")
        config = with_surfaces(config, state.curves)
        learning = start_learning(options, config, stack, narrator)
        manager = ServiceManager(os.environ)
        core = learning.make_core(config, partial(tell_all, observers))
        if path:
            keeper = outputs.keep(path, state, config.service.state_interval_s)
            observers.append(partial(_keep, keeper, core, config.model))
        bus = ReconnectingBus(
            bus_opener(options), core.ids, narrator.warn, wait_for_it=options.wait
        )
        stack.callback(bus.shutdown)
        log = outputs.log(options.log) if options.log else None
        name = bus_name(options, bus.channel_info)
        learning.observe(core, observers, log)
        silence = SilenceWatch(nothing_received(config, name), narrator.warn)
        service = LiveService(
            core,
            bus,
            write_log=None if log is None else log.write,
            secure=read_secoc(options, core.messages.sizes),
            dry_run=options.dry_run,
            notify=narrator.warn,
            each_turn=lambda: _look_around(manager, silence, service, learning),
        )
        if log is not None and state.curves:
            log.write(kept_curves_to_lines(service.clock(), state.curves))
        if options.metrics is not None:
            address = serve_metrics(stack, options.metrics, service, log, learning.metrics)
            narrator.print(f"metrics at {address}")
        _obey_signals(service, log, learning, has_terminal=has_terminal)
        # Said last: who waits for it may send a signal at once.
        narrator.print(f"listening on {name}; Ctrl-C ends")
        manager.ready(f"listening on {name}")
        until = (
            None if options.duration is None else service.clock() + round(options.duration * 1e6)
        )
        service.run(until)
        ran_out = until is not None and service.clock() >= until
        manager.stopping()
    counters = read_counters(service)
    document = _describe_run(service, log) | learning.fields() | provenance(config)

    def write() -> None:
        write_json(options.json, document)
        sys.stdout.flush()

    json_written = done_within(longest_end_s(options.json), write)
    if not json_written:
        narrator.warn(f"--json {options.json}: not written before the service ended")
    if talk(options):
        narrator.print(
            f"{counters['received']} frames received, {core.receiver.rejected} rejected, "
            f"{counters['frames_lost']} lost, {counters['sent']} sent, {counters['send_errors']} "
            f"refused by the bus; {counters['samples']} samples"
        )
    is_deaf = ran_out and not counters["received"]
    if is_deaf:
        narrator.warn(
            f"no frame of {name_inputs(config)} came in {options.duration:g} s on {name}: "
            "nothing was identified; check the bus, the bitrate and [roles]"
        )
    return _Ending(outputs.all_ended and json_written, 1 if is_deaf else 0)


def _keep(
    keeper: StateKeeper,
    core: ServiceCore,
    model: ExtendedModel | None,
    t_us: int,
    outputs: Outputs,
) -> None:
    """Keep what is learned with the model of the start: a state belongs to one model."""
    if core.configuration.model is model:
        keeper.observe(t_us, outputs)


def _describe_run(service: LiveService, log: LogBehind | None) -> dict[str, Any]:
    """Counters of a service that has ended, as JSON has them."""
    core = service.core
    return {
        **read_counters(service),
        "log_lines_lost": 0 if log is None else log.lost,
        "clock_offset_s": service.stamps.offset_us / 1e6,
        "frames_rejected": core.receiver.rejected,
        "samples_left_out": core.left_out_samples,
        "loop_time_p99_us": core.loop_time_p99_us,
        "faults": core.faults,
        "last": None if core.estimate is None else core.estimate.to_dict(),
    }


def _obey_signals(
    service: LiveService, log: LogBehind | None, learning: RunLearning, *, has_terminal: bool
) -> None:
    """Have signals end the service with its last frames, or start another log."""

    def stop(_: int, __: FrameType | None) -> None:
        service.stop()

    def hang_up(_: int, __: FrameType | None) -> None:
        # Of a terminal that is closed it means an end; of a service manager, another log.
        if has_terminal:
            service.stop()
        elif log is not None:
            log.request_next()
            learning.expect_new_log()

    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGQUIT):
        signal.signal(number, stop)
    signal.signal(signal.SIGHUP, hang_up)
    for number in (signal.SIGUSR1, signal.SIGUSR2):
        # They mean nothing here; by default each ends the process without last frames.
        signal.signal(number, signal.SIG_IGN)


def _look_around(
    manager: ServiceManager,
    silence: SilenceWatch,
    service: LiveService,
    learning: RunLearning,
) -> None:
    """What is done at each turn of the loop."""
    manager.alive()
    silence.look(heard=service.counts.received > 0)
    learning.look()
