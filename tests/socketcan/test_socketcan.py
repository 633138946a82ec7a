"""The service on real SocketCAN, with can-utils on the other end.

What is tested is the kernel's interface and not its speed: where the kernel has no vcan these tests
run in an emulated machine, some thirty times slower than its host. So the frames are few, waits are
for events, and deadlines lie an order of magnitude above what an idle machine needs.
"""

import json
import os
import signal
import subprocess
from itertools import pairwise

import can
import pytest

from adhesion_can.bus.frame import Frame
from adhesion_can.cli.main import main
from adhesion_can.physics.burckhardt import peak
from adhesion_can.recordings.candump import parse_line
from adhesion_can.service.kernel_losses import count_unsent
from adhesion_can.simulation.scenarios import surface_by_name
from tests.socketcan.slow_bench import SETPOINTS_PER_S, write_configuration, write_drive
from tests.terminals import BENCH_GUIDE, ForkedTerminal, Terminal, bench_lines
from tests.wire import decoded, seal_ok

pytestmark = pytest.mark.timeout(900)

DEADLINE_S = 300.0
OUTPUTS = {0x201, 0x202, 0x203, 0x204, 0x211}
BUS = "-i socketcan -c vcan0"
DRIVE_S = 6
STRETCHES = (1, 3, 8)
"""Factors of all cycles, tried in turn."""


@pytest.fixture(scope="module", autouse=True)
def imports(tmp_path_factory):
    """Run the service and a replay once in this process: what they import is there for all forks.

    Without the replay each fork would import, at its first samples, what estimates them: seconds in
    an emulated machine, in which the service can only leave out what is overdue.
    """
    write_configuration(folder := tmp_path_factory.mktemp("imports"))
    write_drive(folder / "drive.log", surface_by_name("wet").theta, 3)
    handlers = {number: signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)}
    words = ["run", *BUS.split(), "--config", str(folder / "slow.toml"), "--duration", "0.1"]
    assert main(words) == 1  # no frame came
    words = ["replay", str(folder / "drive.log"), "--config", str(folder / "slow.toml")]
    assert main(words) == 0
    for number, handler in handlers.items():
        signal.signal(number, handler)


@pytest.fixture
def terminals(tmp_path):
    """Opens terminals and closes what is left of them."""
    opened = []

    def open_one(command, name, kind=Terminal):
        opened.append(kind(command, tmp_path, name))
        return opened[-1]

    yield open_one
    for terminal in opened:
        if terminal.process.poll() is None:
            terminal.kill()


def listeners():
    """Number of sockets that take every frame of vcan0."""
    with open("/proc/net/can/rcvlist_all") as file:  # noqa: PTH123
        return sum(line.split()[:1] == ["vcan0"] for line in file)


def candump(terminals, command="candump -L vcan0"):
    """candump, when it listens.

    Not while a service opens its bus: until its filters are set, that takes every frame as well.
    """
    before = listeners()
    terminal = terminals(command, "candump")
    terminal.until(lambda: listeners() > before, DEADLINE_S, "candump")
    return terminal


def listening(terminals, options=""):
    """The service on the slow bench, when it has opened the bus."""
    command = f"adhesion-can run {BUS} --config slow.toml {options}"
    service = terminals(command, "run", ForkedTerminal)
    service.wait_for("listening on", DEADLINE_S)
    return service


def play(terminals, log):
    """A recording, each frame at its time, by canplayer."""
    assert terminals(f"canplayer -I {log} vcan0=can0", "canplayer").wait(DEADLINE_S) == 0


def until_setpoints(dump, count, timeout=DEADLINE_S):
    dump.until(
        lambda: dump.out.read_bytes().count(b" 201#") >= count, timeout, f"{count} setpoints"
    )


def frames_in(path):
    """Frames of a log; a line that is still being written is left out."""
    items = [parse_line(line + b"\n") for line in path.read_bytes().split(b"\n")[:-1]]
    return [item for item in items if isinstance(item, Frame)]


def check_answers(frames, surfaces, at_least, overdue=0):
    """All sealed and counted; the last one that was certain is right for one of the surfaces."""
    answers = [f for f in frames if f.arbitration_id in OUTPUTS]
    assert all(seal_ok(f) for f in answers)
    points = [decoded(f) for f in answers if f.arbitration_id == 0x201]
    assert len(points) >= at_least
    tracking = [p for p in points if str(p["Status"]) == "TRACKING"]
    assert tracking, [str(p["Status"]) for p in points[-5:]]
    true = [float(peak(*surface_by_name(name).theta).mu_max) for name in surfaces]
    assert min(abs(float(tracking[-1]["MuMax"]) / mu_max - 1) for mu_max in true) < 0.05
    missing = 0
    for number in OUTPUTS:
        counts = [f.data[1] & 0x0F for f in answers if f.arbitration_id == number]
        steps = [(b - a) % 15 for a, b in pairwise(counts)]
        assert 0 not in steps
        missing += sum(steps) - len(steps)
    # A machine that is too slow leaves out what is overdue, and says so.
    assert missing <= overdue


def answered(terminals, tmp_path, stretch):
    """Frames of candump and figures of the service after a drive fed by canplayer."""
    write_configuration(tmp_path, stretch)
    write_drive(tmp_path / "drive.log", surface_by_name("wet").theta, DRIVE_S, stretch)
    dump = candump(terminals)
    service = listening(terminals, "--log run.log --json run.json")
    play(terminals, "drive.log")
    until_setpoints(dump, SETPOINTS_PER_S * DRIVE_S)  # however late, none is lost
    assert service.interrupt(DEADLINE_S) == 0
    dump.interrupt(DEADLINE_S)
    return frames_in(dump.out), json.loads((tmp_path / "run.json").read_text())


def test_run_answers_a_recording_fed_by_canplayer(terminals, tmp_path):
    # A machine that cannot follow leaves out what is overdue, rightly: it gets more time.
    for stretch in STRETCHES:
        frames, figures = answered(terminals, tmp_path, stretch)
        overdue = figures["overdue"]
        if not overdue and not figures["frames_lost"]:
            break
    check_answers(frames, ("wet",), at_least=SETPOINTS_PER_S * DRIVE_S, overdue=overdue)
    log = tmp_path / "drive.log"
    fed = [(f.arbitration_id, f.data) for f in frames_in(log)]
    heard = [(f.arbitration_id, f.data) for f in frames if f.arbitration_id not in OUTPUTS]
    assert heard == fed
    # What was sent is what replay makes of the service's own log.
    again = tmp_path / "again.log"
    words = ["replay", str(tmp_path / "run.log"), "--config", str(tmp_path / "slow.toml")]
    assert main([*words, "--frames", str(again)]) == 0
    repeatable = OUTPUTS - {0x211}  # the status also tells what exists only live
    sent, replayed = (
        [(f.arbitration_id, f.data) for f in some if f.arbitration_id in repeatable]
        for some in (frames, frames_in(again))
    )
    if overdue:
        rest = iter(replayed)
        assert all(frame in rest for frame in sent), "in the order of the replay"
    else:
        assert sent == replayed


def test_the_service_survives_a_bus_that_goes_down(terminals, tmp_path):
    write_configuration(tmp_path)
    write_drive(tmp_path / "drive.log", surface_by_name("dry").theta, 1)
    service = listening(terminals)
    play(terminals, "drive.log")
    try:
        subprocess.run(["ip", "link", "set", "vcan0", "down"], check=True)
        service.wait_for("the bus is gone", DEADLINE_S)
    finally:
        subprocess.run(["ip", "link", "set", "vcan0", "up"], check=True)
    service.wait_for("the bus is back", DEADLINE_S)
    dump = candump(terminals)
    drive = f"adhesion-can simulate --scenario dry --duration 1 {BUS} --dbc slow.dbc"
    simulate = terminals(f"{drive} --config slow.toml", "simulate", ForkedTerminal)
    assert simulate.wait(DEADLINE_S) == 0
    until_setpoints(dump, SETPOINTS_PER_S)
    assert service.interrupt(DEADLINE_S) == 0
    dump.interrupt(DEADLINE_S)
    frames = frames_in(dump.out)
    assert all(seal_ok(f) for f in frames if f.arbitration_id in OUTPUTS)
    assert any(f.arbitration_id == 0x101 for f in frames)


@pytest.mark.skipif(
    "ADHESION_CAN_EMULATED" in os.environ,
    reason="an emulated machine cannot follow the full bus (tests/cli runs it over multicast)",
)
def test_the_readme_bench_as_printed(terminals):
    run, simulate, dump_line = bench_lines("vcan0", BENCH_GUIDE)
    dump = candump(terminals, command=dump_line)
    service = terminals(run, "run")
    service.wait_for("listening on")
    assert terminals(simulate, "simulate").wait(90) == 0
    until_setpoints(dump, 900, 60)
    assert service.interrupt() == 0
    dump.interrupt()
    # On a busy machine the service may still be on the surface before when the drive has ended.
    check_answers(frames_in(dump.out), ("dry", "wet"), at_least=900)


def test_the_interface_tells_what_it_did_not_send():
    with can.Bus(interface="socketcan", channel="vcan0") as bus:
        assert count_unsent(bus) == 0
