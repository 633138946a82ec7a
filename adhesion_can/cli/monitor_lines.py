"""Lines of `monitor` for pipes: text and JSON, at even times."""

import argparse
import json
import signal
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from types import FrameType
from typing import TextIO

from adhesion_can.cli.monitor_session import MonitorSession
from adhesion_can.cli.monitor_source import Source
from adhesion_can.cli.outputs import finite, talk
from adhesion_can.cli.silence import SilenceWatch, nothing_received
from adhesion_can.config import Configuration
from adhesion_can.files import whole_file
from adhesion_can.monitoring.snapshot import Snapshot
from adhesion_can.printable import say
from adhesion_can.reporting.terminal.plain import plain_line, snapshot_document

LOOK_S = 0.05
"""Time between two looks at whether a line is due, or the end is asked for, s."""


def write_lines(
    options: argparse.Namespace, session: MonitorSession, source: Source, config: Configuration
) -> None:
    """Lines at even times until the end of the recording, of the duration, or Ctrl-C.

    If nothing comes on a bus, that is said once on stderr with what was waited for.

    Args:
        options: Options of the command.
        session: What is shown.
        source: Source of the frames.
        config: Configuration whose messages are waited for.

    """
    silence = SilenceWatch(nothing_received(config, source.transport().name), say)
    with _asked_to_stop() as stop, _json_file(options.json) as file:
        for snapshot in _snapshots(options, session, source, stop):
            if session.log is None:
                silence.look(heard=snapshot.frames > 0)
            if talk(options):
                say(plain_line(snapshot), sys.stdout)
            if file is not None:
                file.write(json.dumps(finite(snapshot_document(snapshot)), allow_nan=False) + "\n")
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
