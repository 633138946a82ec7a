"""`control`: three parties on one bus, each a process of its own, and what is wrong usage."""

import json
import threading
from itertools import cycle
from pathlib import Path

import can
import numpy as np
import pytest

from adhesion_can.cli.main import main
from adhesion_can.control.creep_controller import Mode
from adhesion_can.recordings.candump import ReadReport, format_frame, read_candump
from adhesion_can.recordings.python_can_messages import from_message, to_message
from tests.cli.test_multicast import ROOT, own_network, run_in_own_network
from tests.promptness import ON_TIME, frames_with_prompt_past, need_prompt
from tests.terminals import Terminal, bench_lines
from tests.wire import Bench, decoded, seal_ok

PAGE = ROOT / "docs" / "creep_control.md"


@pytest.fixture(scope="module")
def played(tmp_path_factory):
    """Folder of what the bench wrote."""
    if not own_network():
        pytest.skip("needs root, unshare and ip for a network of its own")
    folder = tmp_path_factory.mktemp("control")
    run_in_own_network("tests.cli.test_control", folder)
    return folder


def bench(folder):
    """The bench of docs/creep_control.md, and a listener that writes what it hears."""
    run, control, simulate = bench_lines("control", PAGE)
    terminals, seen, ended = [], [], threading.Event()

    def open_one(command, name):
        terminals.append(Terminal(command, folder, name))
        return terminals[-1]

    def listen(bus):
        while not ended.is_set():
            message = bus.recv(0.1)
            if message is not None:
                seen.append(from_message(message))

    with can.Bus(interface="udp_multicast", channel="239.74.163.2", hop_limit=0) as bus:
        listener = threading.Thread(target=listen, args=(bus,))
        listener.start()
        try:
            service = open_one(run, "run")
            service.wait_for("listening on")
            controller = open_one(f"{control} --json control.json", "control")
            controller.wait_for("controlling on")
            assert open_one(simulate, "simulate").wait(300) == 0
            assert controller.interrupt(60) == 0, controller.err.read_text()
            assert service.interrupt(60) == 0, service.err.read_text()
        finally:
            ended.set()
            listener.join()
            for terminal in terminals:
                if terminal.process.poll() is None:
                    terminal.kill()
    lines = [format_frame(frame) for frame in sorted(seen, key=lambda frame: frame.t_us)]
    (folder / "seen.log").write_text("".join(f"{line}\n" for line in lines))


def frames_of(folder):
    """Frames that were heard on the bus."""
    report = ReadReport()
    frames = list(read_candump((folder / "seen.log").read_bytes().splitlines(), report))
    assert report.passed_over == 0
    return frames


@pytest.mark.realtime
def test_three_parties_pull_on_one_bus_as_printed(played):
    """The motors follow the controller, and it pulls, however late each of them comes."""
    seen = frames_of(played)
    demands = [frame for frame in seen if frame.arbitration_id == 0x301]
    # Some 2000 in the 20 s; on a busy machine datagrams are lost and steps come late.
    assert len(demands) > 300
    assert all(map(seal_ok, demands))
    assert greatest_effort(seen) > 0
    document = json.loads((played / "control.json").read_text())
    assert document["steps"] > 300
    # What datagrams are lost leave gaps in the counters, and some frames behind a gap are rejected.
    assert document["rejected"] < 0.2 * document["received"]
    assert sum(document["share_of_steps"].values()) == pytest.approx(1.0)
    said = (played / "control.err").read_text()
    assert "SEARCH: searching for the peak with pairs of axles" in said
    last = decoded(demands[-1])
    assert (
        str(last["EffortDemand_Ax1"]) in ("not available", "0.0") or last["EffortDemand_Ax1"] < 2e5
    )


@pytest.mark.realtime
def test_where_nobody_is_late_it_pulls_with_60_kn_or_more_and_holds_the_peak(played):
    """Where demands come late the motors give nothing after three cycles."""
    seen = frames_of(played)
    prompt = frames_with_prompt_past(seen, 0x121, 1_000_000, of=(*ON_TIME, 0x201, 0x301))
    need_prompt(len(prompt) / sum(frame.arbitration_id == 0x121 for frame in seen), 0.5)
    assert greatest_effort(prompt) > 60e3
    document = json.loads((played / "control.json").read_text())
    shares = document["share_of_steps"]
    assert shares["search"] + shares["hold"] + shares["steady"] > 0.5
    assert document["rejected"] < 0.01 * document["received"]


def greatest_effort(frames):
    """Greatest effort of the first axle, N."""
    told = [decoded(f)["TractiveEffort_Ax1"] for f in frames if f.arbitration_id == 0x121]
    return max(effort for effort in told if isinstance(effort, int | float))


class Walking:
    """A controller that goes by each of its modes in turn, a step each."""

    mode = Mode.SLOW

    def __init__(self):
        self._modes = cycle(Mode)

    def step(self, measured, _):
        self.mode = next(self._modes)
        return np.zeros(len(measured.load))


@pytest.mark.usefixtures("restored_signals")
def test_without_a_frame_there_is_no_mode(capsys):
    assert main(["control", "-i", "virtual", "-c", "nobody", "--duration", "0.2"]) == 0
    said = capsys.readouterr().err
    assert "no step, as the wheel speeds of all axles never came" in said
    assert not any(mode.name in said for mode in Mode)


@pytest.mark.usefixtures("restored_signals")
def test_every_mode_is_told_and_counted(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr("adhesion_can.cli.control.build_reference", lambda _: Walking())
    frames = list(Bench().drive(0, 20_000))
    with can.Bus(interface="virtual", channel="modes") as bus:
        ended = threading.Event()

        def drive():
            while not ended.wait(0.02):
                for frame in frames:
                    bus.send(to_message(frame))

        driver = threading.Thread(target=drive)
        driver.start()
        out = tmp_path / "c.json"
        try:
            words = ["control", "-i", "virtual", "-c", "modes", "--duration", "2"]
            assert main([*words, "--json", str(out)]) == 0
        finally:
            ended.set()
            driver.join()
    said = capsys.readouterr().err
    shares = json.loads(out.read_text())["share_of_steps"]
    for mode in Mode:
        assert f"{mode.name}: {mode.value}" in said
        assert shares[mode.name.lower()] > 0.1


@pytest.mark.usefixtures("restored_signals")
def test_it_ends_by_itself(tmp_path):
    """Alone on a bus: no frame, no step, status 0, and what it did as JSON."""
    out = tmp_path / "c.json"
    words = ["control", "-i", "virtual", "-c", "alone", "--duration", "0.2"]
    assert main([*words, "--json", str(out)]) == 0
    document = json.loads(out.read_text())
    assert (document["received"], document["steps"]) == (0, 0)
    assert document["sent"] == 2  # the last two: no effort is demanded


@pytest.mark.parametrize(
    ("words", "expected"),
    [
        (["--duration", "-1"], "--duration"),
        (["--config", "{tmp}/one.toml"], "one driven axle"),
        (["--config", "{tmp}/none.toml"], "no signal has the role vehicle_speed"),
    ],
)
def test_wrong_usage_is_one_line(words, expected, tmp_path, capsys):
    axle = 'wheel_speed.1 = "WheelSpeeds1.WheelSpeed_Ax1"\n'
    speed = 'vehicle_speed = "VehicleSpeed.VehicleSpeed"\n'
    (tmp_path / "one.toml").write_text(f"[vehicle]\naxles = 1\n[roles]\n{axle}{speed}")
    (tmp_path / "none.toml").write_text(f"[vehicle]\naxles = 1\n[roles]\n{axle}")
    words = [word.format(tmp=tmp_path) for word in words]
    assert main(["control", "-i", "virtual", "-c", "wrong", *words]) == 2
    said = capsys.readouterr().err
    assert expected in said
    assert said.count("\n") == 1


def test_a_bus_that_is_not_there_is_named(capsys):
    assert main(["control", "-i", "socketcan", "-c", "nosuchcan7"]) == 2
    assert "nosuchcan7" in capsys.readouterr().err


def test_the_page_names_the_commands_that_it_needs():
    lines = bench_lines("control", PAGE)
    assert [line.split()[1] for line in lines] == ["run", "control", "simulate"]
    assert Path(ROOT / "README.md").read_text().count("docs/creep_control.md") >= 1
