"""The service on real SocketCAN, with can-utils on the other end."""

import subprocess

import pytest

from adhesion_can.bus.frame import Frame
from adhesion_can.cli.main import main
from adhesion_can.physics.burckhardt import peak
from adhesion_can.recordings.candump import parse_line
from adhesion_can.simulation.scenarios import surface_by_name
from tests.terminals import Terminal, bench_lines
from tests.wire import decoded, seal_ok

OUTPUTS = {0x201, 0x202, 0x203, 0x204, 0x211}


@pytest.fixture
def terminals(tmp_path):
    """Opens terminals and closes what is left of them."""
    opened = []

    def open_one(command, name):
        opened.append(Terminal(command, tmp_path, name))
        return opened[-1]

    yield open_one
    for terminal in opened:
        if terminal.process.poll() is None:
            terminal.kill()


def listeners():
    """Number of sockets that take every frame of vcan0."""
    with open("/proc/net/can/rcvlist_all") as file:  # noqa: PTH123
        return sum(line.split()[:1] == ["vcan0"] for line in file)


def candump(terminals, name="candump"):
    before = listeners()
    terminal = terminals("candump -L vcan0", name)
    terminal.until(lambda: listeners() > before, 30, "candump")
    return terminal


def frames_in(path):
    """Frames of a log; a line that is still being written is left out."""
    items = [parse_line(line + b"\n") for line in path.read_bytes().split(b"\n")[:-1]]
    return [item for item in items if isinstance(item, Frame)]


def check_answers(frames, surfaces, at_least):
    """All sealed; the last one that was certain is right for one of the rails."""
    answers = [f for f in frames if f.arbitration_id in OUTPUTS]
    assert all(seal_ok(f) for f in answers)
    points = [decoded(f) for f in answers if f.arbitration_id == 0x201]
    assert len(points) >= at_least
    tracking = [p for p in points if str(p["Status"]) == "TRACKING"]
    assert tracking, [str(p["Status"]) for p in points[-5:]]
    true = [float(peak(*surface_by_name(name).theta).mu_max) for name in surfaces]
    assert min(abs(float(tracking[-1]["MuMax"]) / mu_max - 1) for mu_max in true) < 0.05
    counts = [f.data[1] & 0x0F for f in answers if f.arbitration_id == 0x201]
    assert all((b - a) % 15 == 1 for a, b in zip(counts, counts[1:], strict=False))


def test_run_answers_a_recording_fed_by_canplayer(terminals, tmp_path):
    log = tmp_path / "a.log"
    assert main(["simulate", "--scenario", "wet", "--duration", "10", "--log", str(log)]) == 0
    service = terminals(
        "adhesion-can run -i socketcan -c vcan0 --log run.log --json run.json", "run"
    )
    service.wait_for("listening on")
    dump = candump(terminals)
    assert terminals("canplayer -I a.log vcan0=can0", "canplayer").wait(60) == 0
    # A slow machine answers late, and nothing is lost: 500 setpoints to 10 s of input.
    dump.until(lambda: dump.out.read_bytes().count(b" 201#") >= 500, 60, "500 setpoints")
    assert service.interrupt() == 0
    dump.interrupt()
    frames = frames_in(dump.out)
    check_answers(frames, ("wet",), at_least=500)
    heard = [f for f in frames if f.arbitration_id not in OUTPUTS]
    assert len(heard) == len(log.read_text().splitlines())
    # What was sent is what replay makes of the service's own log.
    assert main(["replay", str(tmp_path / "run.log"), "--frames", str(tmp_path / "again.log")]) == 0
    sent = [(f.arbitration_id, f.data) for f in frames if f.arbitration_id in OUTPUTS - {0x211}]
    again = [
        (f.arbitration_id, f.data)
        for f in frames_in(tmp_path / "again.log")
        if f.arbitration_id != 0x211
    ]
    assert sent == again


def test_the_service_survives_a_bus_that_goes_down(terminals):
    service = terminals("adhesion-can run -i socketcan -c vcan0", "run")
    service.wait_for("listening on")
    drive = "adhesion-can simulate --scenario dry --duration {} -i socketcan -c vcan0"
    assert terminals(drive.format(2), "drive").wait(60) == 0
    try:
        subprocess.run(["ip", "link", "set", "vcan0", "down"], check=True)
        service.wait_for("the bus is gone")
    finally:
        subprocess.run(["ip", "link", "set", "vcan0", "up"], check=True)
    service.wait_for("the bus is back")
    dump = candump(terminals)
    assert terminals(drive.format(3), "again").wait(60) == 0
    dump.until(lambda: dump.out.read_bytes().count(b" 201#") > 100, 60, "100 setpoints")
    assert service.interrupt() == 0
    dump.interrupt()


def test_the_readme_bench_as_printed(terminals):
    run, simulate, dump_line = bench_lines("vcan0")
    before = listeners()
    dump = terminals(dump_line, "candump")
    dump.until(lambda: listeners() > before, 30, "candump")
    service = terminals(run, "run")
    service.wait_for("listening on")
    assert terminals(simulate, "simulate").wait(90) == 0
    dump.until(lambda: dump.out.read_bytes().count(b" 201#") >= 900, 60, "900 setpoints")
    assert service.interrupt() == 0
    dump.interrupt()
    # An emulated machine is thirty times slower than the host: there the service may still be on
    # the rail before when the drive has ended.
    check_answers(frames_in(dump.out), ("dry", "wet"), at_least=900)
