"""The live view of the demo: what the drive does and why, and what is true."""

import pytest

from adhesion_can.bus.frame import Frame
from adhesion_can.cli import demo
from adhesion_can.cli.main import main
from adhesion_can.config import load_configuration
from adhesion_can.reporting.terminal.view import draw
from adhesion_can.simulation.run import RunSettings
from adhesion_can.simulation.scenarios import scenario_by_name
from tests.wire import DB


@pytest.fixture
def bench(tmp_path):
    config = load_configuration()
    settings = RunSettings(scenario_by_name("dry"), 1.0, obey=True)
    return demo._Bench(config, settings, tmp_path / "demo.log")


def setpoint():
    """A setpoint with status TRACKING, as the simulated drive reads it."""
    signals = {"Status": 1, "MuMax": 0.37, "LambdaM": 0.07, "CreepSpeedSetpoint": 0.5}
    data = DB.encode_message(0x201, {"Crc": 0, "Alive": 0, **signals})
    return Frame(0, 0x201, data)


@pytest.mark.parametrize("size", [(80, 24), (160, 50)])
def test_it_fills_the_terminal_and_tells_both(bench, size):
    for frames in bench.simulation.run():
        for frame in frames:
            bench.monitor.feed(frame)
    view = demo._live_view(bench)
    lines = draw(view.snapshot, *size, view.options)
    assert [len(line) for line in lines] == [size[0]] * size[1]
    text = " ".join(" ".join(line.plain for line in lines).split())
    probes = "Probing: the drive sweeps the slip from 0.002 to 0.2 to find the peak."
    assert probes in text
    assert "x truth" in text
    assert view.snapshot.true_peak.mu_max == pytest.approx(0.3731, abs=1e-4)


def test_the_drive_says_why_it_probes_until_it_holds(bench):
    simulation = bench.simulation
    assert simulation.describe_drive().endswith("to find the peak.")
    simulation.receive(setpoint())
    assert simulation.describe_drive().endswith("to find the peak. 3.0 s left.")
    while simulation.now_us < 3_100_000:
        simulation.step()
    holds = "The drive holds the creep setpoint: the service knows the peak."
    assert simulation.describe_drive() == holds


def test_what_the_service_reports_is_told_once_behind_the_view(tmp_path, monkeypatch, capsys):
    """On a machine that is too slow it drops frames, and the figures are not what it can do."""

    def run(bench, _):
        for frames in bench.simulation.run():
            for frame in frames:
                bench.core.feed(frame)
        bench.notices += ["overload: dropping the oldest frames", "the stamps jump"] * 2

    monkeypatch.setattr(demo._Bench, "run", run)
    assert main(["demo", "--headless", "--duration", "12", "--out", str(tmp_path / "out")]) == 0
    assert capsys.readouterr().err.splitlines() == [
        "demo: the service reported: overload: dropping the oldest frames",
        "demo: the service reported: the stamps jump",
    ]


def test_the_bench_keeps_what_its_service_reports(bench, monkeypatch):
    given = {}
    monkeypatch.setattr(demo, "LiveService", lambda *_, **options: given.update(options))
    with pytest.raises(AttributeError):
        bench.run(None)
    given["notify"]("overload")
    assert bench.notices == ["overload"]


def test_a_drive_that_obeys_nobody_says_so(tmp_path):
    settings = RunSettings(scenario_by_name("dry"), 1.0)
    bench = demo._Bench(load_configuration(), settings, tmp_path / "demo.log")
    assert bench.simulation.describe_drive().endswith("ignores the service.")
