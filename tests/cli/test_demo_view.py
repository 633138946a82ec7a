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


@pytest.mark.costly
@pytest.mark.parametrize("lost", [0, 26])
def test_a_machine_that_was_too_slow_is_told_of_behind_the_view(
    lost, tmp_path, monkeypatch, capsys
):
    """The service then drops frames, and its figures are not what it can do."""

    def run(bench, _):
        for frames in bench.simulation.run():
            for frame in frames:
                bench.core.feed(frame)
        bench.core.counts.receive_drops = lost

    monkeypatch.setattr(demo._Bench, "run", run)
    assert main(["demo", "--headless", "--duration", "12", "--out", str(tmp_path / "out")]) == 0
    err = capsys.readouterr().err
    assert ("the service lost 26 frames" in err) == bool(lost)
    assert len(err.splitlines()) == bool(lost)


def test_a_drive_that_obeys_nobody_says_so(tmp_path):
    settings = RunSettings(scenario_by_name("dry"), 1.0)
    bench = demo._Bench(load_configuration(), settings, tmp_path / "demo.log")
    assert bench.simulation.describe_drive().endswith("ignores the service.")
