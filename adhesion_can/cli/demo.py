"""`demo`: locomotive, service and creep controller on one in-process bus, truth beside estimate.

Three parties on python-can's virtual bus, as on a bench: the simulated locomotive, the service as
`run` runs it, and a recorder. Simulated time is the bus's clock, kept at the pace of real time.
"""

import argparse
import heapq
import itertools
import sys
import threading
import time
import uuid
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any

import can
from rich.live import Live

from adhesion_can.bus.frame import Frame
from adhesion_can.cli.common import own_command, require_positive
from adhesion_can.cli.outputs import add_json, make_folder, require_outputs, talk, write_json
from adhesion_can.cli.reports import add_report, missing_report, page_provenance, write_report
from adhesion_can.config import Configuration, load_configuration
from adhesion_can.errors import InputError
from adhesion_can.estimation.doubt.settings import EXACT
from adhesion_can.files import whole_file
from adhesion_can.monitoring.snapshot import Transport, TruePeak
from adhesion_can.monitoring.state import MonitorState
from adhesion_can.printable import say
from adhesion_can.recordings.candump import format_frame
from adhesion_can.recordings.python_can_messages import from_message, to_message
from adhesion_can.reporting.drive.demonstrated import demo_texts
from adhesion_can.reporting.drive.page import page
from adhesion_can.reporting.drive.recorder import DriveRecorder
from adhesion_can.reporting.phases import Row, phase_table, phases
from adhesion_can.reporting.provenance import provenance
from adhesion_can.reporting.terminal.view import MonitorView, ViewOptions
from adhesion_can.reporting.text import console
from adhesion_can.result_text import plus_minus
from adhesion_can.service.core import ServiceCore
from adhesion_can.service.live import LiveService
from adhesion_can.service.outputs import Outputs
from adhesion_can.service.reconnecting_bus import ReconnectingBus
from adhesion_can.simulation.run import STEP_US, RunSettings, Simulation
from adhesion_can.simulation.scenarios import scenario_by_name

SCENARIO = "dry-wet-greasy-dry"
SHORTEST_S = 12.0
"""Shortest run, s: three seconds a surface, in which each can be found."""

PACE_US = 10_000
"""Time between two waits for real time, µs; frames due within it are sent at once."""

SHOWN_US = 100_000
"""Time between two drawings, µs."""

REORDER_US = 500_000
"""Longest delay of a frame at the recorder, µs: it is written in the order of the stamps."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the description and the options of the command to its parser."""
    parser.description = (
        "Runs a simulated locomotive over dry, wet, greasy and dry rails, with the service and "
        "a creep controller that follows it, on an in-process bus in real time."
    )
    parser.add_argument("--duration", type=float, default=40.0, metavar="S", help="default 40")
    parser.add_argument(
        "--headless", action="store_true", help="print lines instead of a live view"
    )
    parser.add_argument(
        "--out",
        type=Path,
        default=Path("adhesion-can-demo"),
        metavar="DIR",
        help="folder for report, recording and truth (default ./adhesion-can-demo)",
    )
    add_report(parser, html=False)
    add_json(parser)


def run(options: argparse.Namespace) -> int:
    """Run the command."""
    require_positive(options.duration, "--duration")
    if options.duration < SHORTEST_S:
        raise InputError(
            "--duration", f"{options.duration:g} s is too short", f"give {SHORTEST_S:g} s or more"
        )
    make_folder(options.out, "--out")
    names = ("demo.log", "truth.json", "demo.json", "report.html")
    require_outputs(options, own={f"--out {name}": options.out / name for name in names})
    html = options.out / "report.html"
    missing = missing_report(html)
    config = load_configuration()
    # The simulated locomotive's instruments have no error, as those of a calibrated vehicle.
    config = replace(config, estimators=replace(config.estimators, instruments=EXACT))
    settings = RunSettings(scenario_by_name(SCENARIO), options.duration, obey=True)
    bench = _Bench(config, settings, options.out / "demo.log")
    bench.run(_view(options, bench))
    if lost := bench.core.counts.receive_drops:
        say(
            f"demo: this machine was too slow: the service lost {lost} frames, and what it found "
            "may be worse for it; stop other programs and run the demo again"
        )
    run_phases = phases(bench.simulation.truth(), bench.rows)
    document = {**bench.simulation.truth(), **provenance(config)}
    write_json(str(options.out / "truth.json"), document, own_name=True)
    summary = {"phases": [phase.to_dict() for phase in run_phases], **provenance(config)}
    write_json(str(options.out / "demo.json"), summary, own_name=True)
    write_json(options.json, summary)
    written = [f"no report: {missing}"]
    if not missing:
        said = page_provenance(provenance(bench.core.configuration), options)
        texts = demo_texts(bench.simulation.truth(), run_phases, bench.core, said)
        report = page(bench.recorder.result(), texts, bench.core.configuration)
        _, *pictures = write_report(report, options, html)
        written = [*pictures, f"report: {html}; in a browser: {html.resolve().as_uri()}"]
    if talk(options):
        out = console()
        out.print(phase_table(run_phases))
        out.print(
            "found: time until mu_max was within 5 % of the truth and the status TRACKING; "
            "used: adhesion as a share of mu_max"
        )
        command, log = own_command(), options.out / "demo.log"
        out.print(f"recording of all frames: {log}")
        for line in written:
            out.print(line, soft_wrap=True)
        out.print(f"next: {command} replay {log}, or {command} --help")
    return 0


class _Clock:
    """Simulated time, µs, as the clock of the bus; the locomotive sets it."""

    def __init__(self) -> None:
        self.now_us = 0

    def __call__(self) -> int:
        return self.now_us


class _Recorder:
    """Writes every frame of the bus in the order of the stamps."""

    def __init__(self, write: Any) -> None:
        self._write = write
        self._waiting: list[tuple[int, int, Frame]] = []
        self._order = itertools.count()

    def add(self, frame: Frame) -> None:
        heapq.heappush(self._waiting, (frame.t_us, next(self._order), frame))
        while self._waiting[0][0] < frame.t_us - REORDER_US:
            self._write_next()

    def finish(self) -> None:
        while self._waiting:
            self._write_next()

    def _write_next(self) -> None:
        self._write(format_frame(heapq.heappop(self._waiting)[2]))


class _Bench:
    """The parties of the demo on one virtual bus."""

    def __init__(self, config: Configuration, settings: RunSettings, log: Path) -> None:
        self.simulation = Simulation(settings, config.database)
        self.monitor = MonitorState(config)
        """What is on the bus, for the view."""
        self.rows: list[Row] = []
        self.recorder = DriveRecorder(config.estimators.identifiability.slip_max)
        self._log = log
        self._clock = _Clock()
        self._channel = f"demo-{uuid.uuid4().hex[:8]}"
        self.core = ServiceCore(
            config,
            on_setpoint=self._setpoint,
            on_samples=self.recorder.add_samples,
            on_readings=self.recorder.add_readings,
        )
        self._failures: list[BaseException] = []

    def _setpoint(self, t_us: int, outputs: Outputs) -> None:
        self.rows.append(Row(t_us, outputs, self.simulation.adhesion_used()))
        self.recorder.add(t_us, outputs)

    def _open(self) -> can.BusABC:
        return can.Bus(interface="virtual", channel=self._channel, preserve_timestamps=True)

    def run(self, view: Any) -> None:
        """Run the demo to its end; errors of any party come out here."""
        service = LiveService(
            self.core, ReconnectingBus(self._open, self.core.ids), clock=self._clock
        )
        thread = threading.Thread(target=self._guarded, args=(service.run,), name="service")
        with (
            whole_file(self._log, own_name=True) as file,
            self._open() as recorder_bus,
            self._open() as bus,
        ):
            recorder = _Recorder(file.write)
            thread.start()
            try:
                with view as show:
                    self._drive(bus, recorder_bus, recorder, show)
            finally:
                service.stop()
                thread.join()
            self._drain(recorder_bus, recorder)
            recorder.finish()
        if self._failures:
            raise self._failures[0]

    def _guarded(self, work: Any) -> None:
        try:
            work()
        except BaseException as error:  # noqa: BLE001  the main thread raises it
            self._failures.append(error)

    def _drive(
        self, bus: can.BusABC, recorder_bus: can.BusABC, recorder: _Recorder, show: Any
    ) -> None:
        """Run the locomotive in real time: simulate, send, receive, record."""
        simulation = self.simulation
        began = time.monotonic()
        end_us = round(simulation.settings.duration_s * 1e6)
        while simulation.now_us < end_us and not self._failures:
            for _ in range(PACE_US // STEP_US):
                for frame in simulation.step():
                    bus.send(to_message(frame))
            self._clock.now_us = simulation.now_us
            time.sleep(max(simulation.now_us / 1e6 - (time.monotonic() - began), 0.0))
            while (message := bus.recv(0.0)) is not None:
                simulation.receive(from_message(message))
            self._drain(recorder_bus, recorder)
            if simulation.now_us % SHOWN_US == 0:
                show()

    def _drain(self, bus: can.BusABC, recorder: _Recorder) -> None:
        while (message := bus.recv(0.0)) is not None:
            frame = from_message(message)._replace(channel="vcan0")
            recorder.add(frame)
            self.monitor.feed(frame)


@contextmanager
def _view(options: argparse.Namespace, bench: _Bench) -> Iterator[Any]:
    """View of the bus on a terminal, a line every two seconds elsewhere."""
    out = console(sys.stdout if talk(options) else sys.stderr)
    if options.headless or not out.is_terminal:
        yield lambda: _print_line(out, bench)
        return
    # Drawn by `show` alone, at its own pace.
    with Live(_live_view(bench), console=out, screen=True, auto_refresh=False) as live:
        yield lambda: live.update(_live_view(bench), refresh=True)


def _true_surface(bench: _Bench) -> dict[str, Any]:
    now_s = bench.simulation.now_us / 1e6
    surfaces = bench.simulation.truth()["surfaces"]
    return next((s for s in surfaces if now_s <= s["to_s"]), surfaces[-1])


def _print_line(out: Any, bench: _Bench) -> None:
    if bench.simulation.now_us % 2_000_000 or not bench.rows:
        return
    true, outputs = _true_surface(bench), bench.rows[-1].outputs
    point = outputs.setpoint
    out.print(
        f"{bench.simulation.now_us / 1e6:5.1f} s  {true['name']:7}"
        f"mu_max {true['mu_max']:.4f} est. {plus_minus(point.mu_max, outputs.mu_max_std):16} "
        f"lambda_m {true['lambda_m']:.4f} "
        f"est. {plus_minus(point.lambda_m, outputs.lambda_m_std):16} {outputs.status.name}"
    )


def _live_view(bench: _Bench) -> MonitorView:
    """What `monitor` shows, and what only a simulation knows."""
    simulation, true = bench.simulation, _true_surface(bench)
    transport = Transport(
        name=f"{simulation.settings.scenario.name}, simulated",
        is_live=False,
        position_s=simulation.now_us / 1e6,
        duration_s=simulation.settings.duration_s,
    )
    snapshot = replace(
        bench.monitor.snapshot(simulation.now_us),
        transport=transport,
        remarks=(simulation.describe_drive(),),
        true_peak=TruePeak(true["name"], true["mu_max"], true["lambda_m"]),
    )
    return MonitorView(snapshot, ViewOptions(title="adhesion-can demo", keys=""))
