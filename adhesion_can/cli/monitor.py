"""`monitor`: a live view of a bus or of a recording. It never sends.

On a terminal Textual draws it (`cli/monitor_app.py`); `--plain` and `--json` write lines.
"""

import argparse
import json
import signal
import sys
import threading
import time
from collections import deque
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from math import inf, isfinite
from pathlib import Path
from types import FrameType
from typing import TextIO

from adhesion_can.cli.bus_options import add_bus, bus_is_configured, bus_opener
from adhesion_can.cli.common import (
    add_configuration,
    add_model,
    configuration,
    finite,
    require_outputs,
    require_positive,
    talk,
)
from adhesion_can.cli.monitor_log import LogSource, survey
from adhesion_can.cli.monitor_session import MonitorSession
from adhesion_can.cli.monitor_source import NOTES, LiveSource, Source
from adhesion_can.cli.silence import bus_name
from adhesion_can.config import Configuration
from adhesion_can.errors import ConfigError, InputError
from adhesion_can.extras import install_extra
from adhesion_can.files import whole_file
from adhesion_can.monitoring.snapshot import Snapshot
from adhesion_can.printable import say
from adhesion_can.reporting.terminal.plain import as_json, plain_line
from adhesion_can.service.bus_listener import EVERY_ID, BusListener
from adhesion_can.service.core import ServiceCore
from adhesion_can.service.reconnecting_bus import ReconnectingBus

LOOK_S = 0.05
"""Time between two looks at whether a line is due, or the end is asked for, s."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the description and the options of the command to its parser."""
    parser.description = (
        "Shows a bus (-i, -c) or a recording: messages, axles, the identified curve, its peak "
        "over time, and what the service knows and needs, in words. It never sends. '?' shows "
        "the keys."
    )
    parser.add_argument("log", nargs="*", type=Path, metavar="LOG")
    parser.add_argument(
        "--plain", action="store_true", help=("print a line at each interval, for pipes")
    )
    parser.add_argument(
        "--json", metavar="F", help="write one JSON object per line at each interval; - for stdout"
    )
    parser.add_argument(
        "--every", type=float, default=1.0, metavar="S", help="time between lines (default 1)"
    )
    parser.add_argument(
        "--estimate",
        action="store_true",
        help=(
            "run the service here and show its estimates instead of the received ones (default "
            "for recordings without estimates)"
        ),
    )
    parser.add_argument(
        "--speed",
        type=speed,
        metavar="X",
        help="playback speed of a recording: a factor, or 'max' (default 1; with lines: max)",
    )
    parser.add_argument(
        "--from",
        dest="from_s",
        type=float,
        default=0.0,
        metavar="S",
        help=("start at this time of a recording"),
    )
    parser.add_argument("--record", type=Path, metavar="F", help="record all frames as candump")
    parser.add_argument("--duration", type=float, metavar="S", help="end after this time")
    parser.add_argument(
        "--wait", action="store_true", help="wait for a bus that does not exist yet"
    )
    add_model(parser, "its effects are removed if the service runs here")
    add_configuration(parser)
    add_bus(parser)


def speed(text: str) -> float:
    """Speed of a recording by its text; inf for as fast as it goes.

    Raises:
        argparse.ArgumentTypeError: It is none.

    """
    if text in ("max", "0"):
        return inf
    try:
        value = float(text)
    except ValueError:
        value = -1.0
    if not (isfinite(value) and value > 0):
        raise argparse.ArgumentTypeError(f"{text!r} is not a speed; give a number above 0, or max")
    return value


def run(options: argparse.Namespace) -> int:
    """Run the command."""
    _require_options(options)
    config = configuration(options)
    require_outputs(options, {"--json": options.json, "--record": options.record}, options.log)
    in_lines = options.plain or options.json is not None or not _on_terminal()
    make_app = None if in_lines else _app_maker()
    with ExitStack() as stack:
        source = _open_source(options, config, in_lines=in_lines)
        stack.callback(source.close)
        session = MonitorSession(config, source)
        stack.callback(session.close)
        if options.record is not None:
            session.toggle_recording(options.record)
        if make_app is not None:
            return make_app(session, options.duration)
        _write_lines(options, session, source)
    return 0


def _on_terminal() -> bool:
    """Whether there is a terminal: Textual reads stdin and draws on stderr."""
    return all(stream.isatty() for stream in (sys.stdin, sys.stdout, sys.stderr))


def _require_options(options: argparse.Namespace) -> None:
    require_positive(options.every, "--every")
    if options.duration is not None:
        require_positive(options.duration, "--duration")
    if not (isfinite(options.from_s) and options.from_s >= 0):
        raise InputError("--from", f"{options.from_s} is not a time", "give seconds, 0 or more")
    on_bus = "interface" in options or "channel" in options
    if not options.log:
        on_bus = on_bus or bus_is_configured()
    if on_bus is bool(options.log):
        what = "give one of them, not both"
        raise InputError("LOG or bus", what, "name a recording, or a bus by -i and -c")
    if on_bus and (options.speed is not None or options.from_s):
        raise InputError("--speed and --from", "apply to recordings only", "remove them for a bus")


def _open_source(options: argparse.Namespace, config: Configuration, *, in_lines: bool) -> Source:
    if not options.log:
        return _open_bus(options, config, _note_printer() if in_lines else None)
    extent = survey(options.log, config)
    if options.from_s > extent.duration_s:
        raise InputError(
            f"--from {options.from_s:g}",
            f"is after the end at {extent.duration_s:.1f} s",
            "it counts from the first frame",
        )
    make_core = None
    if options.estimate or (not extent.has_service and _can_estimate(config)):
        make_core = _core_maker(config)
        make_core()  # a configuration that cannot serve is an error before anything is shown
    chosen = options.speed or (inf if in_lines else 1.0)
    return LogSource(options.log, extent, make_core, from_s=options.from_s, speed=chosen)


def _open_bus(
    options: argparse.Namespace, config: Configuration, notify: Callable[[str], None] | None
) -> LiveSource:
    notes: deque[str] = deque(maxlen=NOTES)
    tell = notify or notes.append
    core = _core_maker(config)() if options.estimate else None
    bus = ReconnectingBus(bus_opener(options), EVERY_ID, tell, wait_for_it=options.wait)
    name = bus_name(options, bus.channel_info)
    listener = BusListener(bus, tell)
    listener.start()
    return LiveSource(listener, name, core, notes)


def _note_printer() -> Callable[[str], None]:
    return say


def _core_maker(config: Configuration) -> Callable[[], ServiceCore]:
    return lambda: ServiceCore(config)


def _can_estimate(config: Configuration) -> bool:
    """Whether the roles suffice for a service."""
    try:
        config.require_identification()
    except ConfigError:
        return False
    return True


def _app_maker() -> Callable[[MonitorSession, float | None], int]:
    """What runs the terminal program, and gives its exit status.

    Raises:
        InputError: The extra is not installed.

    """
    try:
        from adhesion_can.cli.monitor_app import MonitorApp  # noqa: PLC0415  an extra
    except ImportError as error:
        raise InputError(
            "the view",
            f"needs Textual (no module {error.name!r}); --plain does not",
            install_extra("tui"),
        ) from error

    def show(session: MonitorSession, duration_s: float | None) -> int:
        app = MonitorApp(session, duration_s)
        app.run()
        return app.return_code or 0

    return show


def _write_lines(options: argparse.Namespace, session: MonitorSession, source: Source) -> None:
    """Lines at even times until the end of the recording, of the duration, or Ctrl-C."""
    with _asked_to_stop() as stop, _json_file(options.json) as file:
        for snapshot in _snapshots(options, session, source, stop):
            if talk(options):
                say(plain_line(snapshot), sys.stdout)
            if file is not None:
                file.write(json.dumps(finite(as_json(snapshot)), allow_nan=False) + "\n")
                file.flush()


@contextmanager
def _asked_to_stop() -> Iterator[threading.Event]:
    """Event that Ctrl-C and SIGTERM set meanwhile."""
    stop = threading.Event()

    def ask(_: int, __: FrameType | None) -> None:
        stop.set()

    numbers = (signal.SIGINT, signal.SIGTERM)
    before = [signal.signal(number, ask) for number in numbers]
    try:
        yield stop
    finally:
        for number, handler in zip(numbers, before, strict=True):
            signal.signal(number, handler)


@contextmanager
def _json_file(target: str | None) -> Iterator[TextIO | None]:
    if target is None:
        yield None
    elif target == "-":
        yield sys.stdout
    else:
        with whole_file(Path(target), keep_part=True) as file:
            yield file


def _snapshots(
    options: argparse.Namespace, session: MonitorSession, source: Source, stop: threading.Event
) -> Iterator[Snapshot]:
    log = session.log
    begin_us = source.now_us if log is None else log.begin_us
    began_s = time.monotonic()
    count = 0
    while not stop.is_set():
        count += 1
        since_s = count * options.every
        if options.duration is not None:
            if since_s - options.every > options.duration - 1e-9:
                return
            since_s = min(since_s, options.duration)  # the last line is at the end
        pace = 1.0 if log is None else log.speed
        while not stop.is_set() and (rest := began_s + since_s / pace - time.monotonic()) > 0:
            time.sleep(min(rest, LOOK_S))
            if log is None:
                session.turn()
        if stop.is_set():
            return
        if log is None:
            yield session.turn()
            continue
        yield session.run_until(begin_us + round(since_s * 1e6))
        if session.is_at_end:
            return
