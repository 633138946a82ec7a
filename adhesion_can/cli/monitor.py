"""`monitor`: a live view of a bus or of a recording. It never sends.

On a terminal Textual draws it (`cli/monitor_app.py`); `--plain` and `--json` write lines.
"""

import argparse
import os
import sys
from collections import deque
from collections.abc import Callable
from contextlib import ExitStack
from functools import partial
from math import inf, isfinite
from pathlib import Path

from adhesion_can.cli.bus_options import add_bus, add_wait, bus_is_configured, bus_opener
from adhesion_can.cli.common import (
    add_configuration,
    add_model,
    configuration,
    require_positive,
)
from adhesion_can.cli.monitor_learned import LearnedFolder
from adhesion_can.cli.monitor_lines import write_lines
from adhesion_can.cli.monitor_log import LogSource, survey
from adhesion_can.cli.monitor_session import MonitorSession
from adhesion_can.cli.monitor_source import NOTES, LiveSource, Source
from adhesion_can.cli.monitor_viewer import VIEWER
from adhesion_can.cli.outputs import add_file, add_json, require_candump_name, require_outputs
from adhesion_can.cli.silence import bus_name
from adhesion_can.config import Configuration
from adhesion_can.errors import AdhesionCanError, ConfigError, InputError
from adhesion_can.extras import needing_extra
from adhesion_can.printable import say
from adhesion_can.service.bus_listener import EVERY_ID, BusListener
from adhesion_can.service.core import ServiceCore
from adhesion_can.service.reconnecting_bus import ReconnectingBus

_AppMaker = Callable[[MonitorSession, float | None], int]


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the description and the options of the command to its parser."""
    parser.description = (
        "Shows a bus (-i, -c) or a recording: messages, axles, the identified curve, its peak "
        "over time, and what the service knows and needs, in words. It never sends. '?' shows "
        "the keys."
    )
    parser.add_argument("log", nargs="*", type=Path, metavar="LOG")
    parser.add_argument(
        "--plain", action="store_true", help="print a line at each interval, for pipes"
    )
    add_json(parser, "write one JSON object per line at each interval")
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
        help="start at this time of a recording",
    )
    add_file(parser, "--record", "F", "record all frames as candump", require_candump_name)
    parser.add_argument("--duration", type=float, metavar="S", help="end after this time")
    add_wait(parser)
    parser.add_argument(
        "--serve",
        action="store_true",
        help="show the same view in a browser on this host, at an address that is printed",
    )
    parser.add_argument(
        "--port",
        type=port,
        metavar="N",
        help="port of --serve (default: one that is free)",
    )
    parser.add_argument(
        "--learned",
        type=Path,
        metavar="DIR",
        help="also show the models that 'run --learn' keeps in this folder",
    )
    parser.add_argument(VIEWER, action="store_true", dest="viewer", help=argparse.SUPPRESS)
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


def port(text: str) -> int:
    """Port by its number; 0 for one that is free.

    Raises:
        argparse.ArgumentTypeError: It is none.

    """
    if not (text.isascii() and text.isdigit() and int(text) < 2**16):
        raise argparse.ArgumentTypeError(f"{text!r} is not a port; give a number from 0 to 65535")
    return int(text)


def run(options: argparse.Namespace) -> int:
    """Run the command."""
    _require_options(options)
    config = configuration(options)
    if options.viewer:
        return _view_in_page(options, config)
    require_outputs(options, options.log)
    if options.serve:
        return _serve(options, config)
    in_lines = options.plain or options.json is not None or not _on_terminal()
    return _show(options, config, None if in_lines else _app_maker())


def _show(options: argparse.Namespace, config: Configuration, make_app: _AppMaker | None) -> int:
    """Show the source in a program for terminals, or in lines where there is none."""
    with ExitStack() as stack:
        learned = None if options.learned is None else LearnedFolder(options.learned)
        source = _open_source(options, config, in_lines=make_app is None)
        stack.callback(source.close)
        session = MonitorSession(config, source, learned)
        stack.callback(session.close)
        if options.record is not None:
            session.toggle_recording(options.record)
        if make_app is not None:
            return make_app(session, options.duration)
        write_lines(options, session, source, config)
    return 0


def _serve(options: argparse.Namespace, config: Configuration) -> int:
    """Serve the view until Ctrl-C; what cannot be shown is an error before it."""
    with needing_extra("serve", "--serve", "needs textual-serve"):
        from adhesion_can.cli.monitor_server import serve  # noqa: PLC0415  an extra
    if not options.wait:
        _open_source(options, config, in_lines=True).close()
    return serve(options.command_line, options.port or 0, options.duration)


def _view_in_page(options: argparse.Namespace, config: Configuration) -> int:
    """The view of one page of --serve; an error is shown in the page."""
    from adhesion_can.cli.error_app import ErrorApp  # noqa: PLC0415  an extra

    try:
        return _show(options, config, _app_maker(os.getppid()))
    except AdhesionCanError as error:
        ErrorApp(str(error)).run()
        return 2


def _on_terminal() -> bool:
    """Whether there is a terminal: Textual reads stdin and draws on stderr."""
    return all(stream.isatty() for stream in (sys.stdin, sys.stdout, sys.stderr))


def _require_options(options: argparse.Namespace) -> None:
    require_positive(options.every, "--every")
    if options.duration is not None:
        require_positive(options.duration, "--duration")
    if not (isfinite(options.from_s) and options.from_s >= 0):
        raise InputError("--from", f"{options.from_s} is not a time", "give seconds, 0 or more")
    if options.port is not None and not options.serve:
        raise InputError("--port", "applies to --serve only", "add --serve, or remove it")
    others = {"--plain": options.plain, "--json": options.json, "--record": options.record}
    for name, value in others.items():
        if options.serve and value:
            raise InputError(
                f"--serve and {name}", "exclude each other", f"run another monitor with {name}"
            )
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
        return _open_bus(options, config, say if in_lines else None)
    extent = survey(options.log, config)
    if options.from_s > extent.duration_s:
        raise InputError(
            f"--from {options.from_s:g}",
            f"is after the end at {extent.duration_s:.1f} s",
            "it counts from the first frame",
        )
    make_core = None
    if options.estimate or (not extent.has_service and _can_estimate(config)):
        make_core = partial(ServiceCore, config)
        make_core()  # a configuration that cannot serve is an error before anything is shown
    chosen = options.speed or (inf if in_lines else 1.0)
    return LogSource(options.log, extent, make_core, from_s=options.from_s, speed=chosen)


def _open_bus(
    options: argparse.Namespace, config: Configuration, notify: Callable[[str], None] | None
) -> LiveSource:
    notes: deque[str] = deque(maxlen=NOTES)
    tell = notify or notes.append
    core = ServiceCore(config) if options.estimate else None
    bus = ReconnectingBus(bus_opener(options), EVERY_ID, tell, wait_for_it=options.wait)
    name = bus_name(options, bus.channel_info)
    listener = BusListener(bus, tell)
    listener.start()
    return LiveSource(listener, name, core, notes)


def _can_estimate(config: Configuration) -> bool:
    """Whether the roles suffice for a service."""
    try:
        config.require_service()
    except ConfigError:
        return False
    return True


def _app_maker(parent: int | None = None) -> _AppMaker:
    """What runs the terminal program, and gives its exit status.

    Args:
        parent: Process with which the program ends; None: it ends with no other.

    Raises:
        InputError: The extra is not installed.

    """
    with needing_extra("tui", "the view", "needs Textual", "; --plain does not"):
        from adhesion_can.cli.monitor_app import MonitorApp  # noqa: PLC0415  an extra

    def show(session: MonitorSession, duration_s: float | None) -> int:
        app = MonitorApp(session, duration_s, parent)
        app.run()
        return app.return_code or 0

    return show
