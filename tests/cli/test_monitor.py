"""`monitor`: sources, session, lines for pipes, wrong usage. It never sends."""

import json
import os
import socket
import subprocess
import sys
import time
from collections import deque
from itertools import islice
from math import inf
from pathlib import Path

import can
import numpy as np
import pytest

from adhesion_can.bus.frame import Frame
from adhesion_can.cli import monitor as command
from adhesion_can.cli.main import main
from adhesion_can.cli.monitor_log import LogSource, survey
from adhesion_can.cli.monitor_session import MonitorSession, typed_time
from adhesion_can.cli.monitor_source import LiveSource
from adhesion_can.config import load_configuration
from adhesion_can.errors import InputError
from adhesion_can.extras import install_extra
from adhesion_can.monitoring.snapshot import MessageRole, MessageState, Origin
from adhesion_can.physics.status import Status
from adhesion_can.recordings.python_can_messages import to_message
from adhesion_can.recordings.recording import Recording
from adhesion_can.recordings.sequence import blocks_in_sequence
from adhesion_can.reporting.terminal.plain import plain_line, snapshot_document
from adhesion_can.service.bus_listener import EVERY_ID, BusListener
from adhesion_can.service.core import ServiceCore
from adhesion_can.service.reconnecting_bus import ReconnectingBus
from tests.monitoring.recorded import DURATION_S, OWN, closed_loop, write_log
from tests.terminals import ROOT, Terminal, bench_lines
from tests.wire import Bench


@pytest.fixture(scope="module")
def logs(tmp_path_factory):
    """A recording with its service, and the same without."""
    folder = tmp_path_factory.mktemp("monitored")
    frames, _ = closed_loop()
    write_log(folder / "full.log", frames)
    write_log(folder / "inputs.log", [f for f in frames if f.arbitration_id not in OWN])
    return folder


def lines_of(capsys, *words):
    assert main(["monitor", *map(str, words)]) == 0
    return capsys.readouterr().out.splitlines()


def session_on(path, *, estimate=False, **how):
    config = load_configuration()
    make = (lambda: ServiceCore(config)) if estimate else None
    clock = Clock()
    source = LogSource([path], survey([path], config), make, clock=clock, **how)
    return MonitorSession(config, source), clock


class Clock:
    """A clock that stands still unless it is told otherwise."""

    def __init__(self):
        self.now_s = 100.0

    def __call__(self):
        return self.now_s


# --- recordings


@pytest.mark.costly
def test_a_recording_at_its_own_speed_and_at_another(logs):
    session, clock = session_on(logs / "full.log")
    assert session.turn().transport.position_s == pytest.approx(0.0, abs=0.02)
    clock.now_s += 1.5
    shown = session.turn()
    assert shown.transport.position_s == pytest.approx(1.5, abs=0.02)
    assert shown.service.status is Status.TRACKING
    session.faster(2.0)
    clock.now_s += 1.0
    assert session.turn().transport.position_s == pytest.approx(3.5, abs=0.02)
    for _ in range(9):
        session.faster(2.0)
    assert session.turn().transport.speed == inf
    clock.now_s += 0.01
    shown = session.turn()
    assert shown.transport.is_at_end
    assert session.is_at_end
    session.faster(0.5)
    assert session.turn().transport.speed == 64.0


def test_pause_and_step(logs):
    session, clock = session_on(logs / "full.log")
    clock.now_s += 1.0
    before = session.turn()
    session.toggle_pause()
    clock.now_s += 5.0
    held = session.turn()
    assert held.transport.paused
    assert held.t_us == before.t_us
    session.step()
    assert session.turn().t_us == before.t_us + 100_000
    session.toggle_pause()
    clock.now_s += 1.0
    assert session.turn().t_us == before.t_us + 1_100_000


@pytest.mark.costly
@pytest.mark.parametrize("estimate", [False, True])
def test_a_jump_shows_what_playing_up_to_it_shows(logs, estimate):
    path = logs / "full.log"
    jumped, _ = session_on(path, estimate=estimate)
    jumped.jump("2.5")
    there = jumped.run_until(2_500_000)
    played, _ = session_on(path, estimate=estimate)
    plain = played.run_until(2_500_000)
    # Less than ten seconds in: what led to it was read as well.
    assert there.service == plain.service
    assert there.axles == plain.axles
    assert there.transport.position_s == pytest.approx(2.5, abs=0.02)
    jumped.jump("-2")
    assert jumped.run_until(500_000).t_us == 500_000
    jumped.jump("1e9")
    assert jumped.turn().transport.position_s <= DURATION_S
    with pytest.raises(InputError, match="is not a time"):
        jumped.jump("soon")
    with pytest.raises(InputError, match="is not a time"):
        jumped.jump("nan")


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("120", (120.0, False)), ("2:00", (120.0, False)), ("1:02:03.5", (3723.5, False)),
        ("+1:30", (90.0, True)), ("-10", (-10.0, True)), (" 5 ", (5.0, False)),
    ],
)  # fmt: skip
def test_times_as_people_type_them(text, expected):
    assert typed_time(text, "jump to") == expected


@pytest.mark.parametrize("text", ["", "soon", "1:75", "1.5:30", "1:2:3:4", "+-3", "2:-1", "inf"])
def test_what_is_no_time_is_an_error_with_examples(text):
    with pytest.raises(InputError, match=r"is not a time; give seconds .* 2:00 or \+10"):
        typed_time(text, "jump to")


def test_while_a_jump_passes_over_blocks_the_view_goes_on(tmp_path, monkeypatch):
    """A long recording is passed over a block at a time, and the view says how far it is."""
    path = write_log(tmp_path / "long.log", Bench().drive(0, 40_000_000))
    session, _ = session_on(path)
    (whole,) = blocks_in_sequence([Recording(path)])
    parts = [
        whole.select(np.arange(k, min(k + 2000, len(whole)))) for k in range(0, len(whole), 2000)
    ]
    monkeypatch.setattr("adhesion_can.cli.monitor_log.blocks_in_sequence", lambda *_: iter(parts))
    monkeypatch.setattr("adhesion_can.cli.monitor_log.TURN_S", -1.0)
    session.jump("0:39")
    positions = []
    for _ in range(10_000):
        shown = session.turn()
        if shown.transport.catching_up_s is None:
            break
        assert shown.transport.catching_up_s == pytest.approx(39.0)
        assert not shown.transport.is_at_end
        positions.append(shown.transport.position_s)
    assert positions == sorted(positions)
    assert len({position for position in positions if position < 29.0}) > 3
    assert shown.transport.position_s == pytest.approx(38.0, abs=1.01)


@pytest.mark.costly
def test_a_service_that_ends_says_so(tmp_path):
    """It takes back its setpoint; one that is cut off does not."""
    frames, _ = closed_loop()
    config = load_configuration()
    core = ServiceCore(config)
    inputs = [f for f in frames if f.arbitration_id not in OWN]
    sent = [answer for f in inputs if f.t_us < 3_000_000 for answer in core.feed(f)]
    whole = {True: [*sent, *core.stop(3_000_000)], False: sent}
    for signed_off, answers in whole.items():
        mixed = sorted([*inputs, *answers], key=lambda frame: frame.t_us)
        session, _ = session_on(write_log(tmp_path / f"{signed_off}.log", mixed))
        shown = session.run_until(5_000_000)
        assert (shown.service.is_silent, shown.service.has_ended) == (True, signed_off)
        line = plain_line(shown)
        assert ("(ended)" in line, "(silent)" in line) == (signed_off, not signed_off)
        assert snapshot_document(shown)["ended"] is signed_off


def test_late_in_a_recording_it_begins_some_seconds_before(tmp_path):
    bench = Bench()
    path = write_log(tmp_path / "long.log", bench.drive(0, 30_000_000))
    session, _ = session_on(path, from_s=25.0)
    shown = session.run_until(25_000_000)
    assert shown.first_us == 15_000_000
    assert shown.transport.position_s == pytest.approx(25.0, abs=0.02)


def test_estimated_here_is_what_the_service_sends(logs):
    """The recorded answers are those of the same core on the same frames."""
    session, _ = session_on(logs / "inputs.log", estimate=True)
    here = session.run_until(2_000_000)
    recorded, _ = session_on(logs / "full.log")
    there = recorded.run_until(2_000_000)
    assert here.transport.origin is Origin.ESTIMATED_HERE
    assert here.service.mu_max == there.service.mu_max
    assert here.service.status is there.service.status


def test_what_is_recorded_replays_and_holds_nothing_made_here(logs, tmp_path):
    path = tmp_path / "r.log"
    session, _ = session_on(logs / "inputs.log", estimate=True)
    session.run_until(1_000_000)
    session.toggle_recording(path)
    assert session.run_until(2_000_000).transport.recording == str(path)
    session.toggle_recording()
    session.run_until(2_200_000)
    session.close()
    kept = [item for item in Recording(path) if isinstance(item, Frame)]
    frames, _ = closed_loop()
    expected = [
        f for f in frames if f.arbitration_id not in OWN and 1_000_000 < f.t_us <= 2_000_000
    ]
    assert [(f.t_us, f.arbitration_id, f.data) for f in kept] == [
        (f.t_us, f.arbitration_id, f.data) for f in expected
    ]
    assert main(["replay", str(path), "--json", str(tmp_path / "r.json")]) == 0
    assert json.loads((tmp_path / "r.json").read_text())["frames_rejected"] == 0


# --- lines


def test_lines_of_a_recording(logs, capsys):
    found = lines_of(capsys, logs / "full.log", "--plain", "--every", "2")
    assert [line.split("  ")[0] for line in found] == ["2.0 s", "4.0 s", "6.0 s", "8.0 s"]
    assert all("TRACKING" in line and "frames/s" in line for line in found)


def test_the_last_line_is_at_the_end_and_not_in_the_silence_behind_it(logs, capsys):
    (line,) = lines_of(capsys, logs / "full.log", "--json", "-", "--every", "60")
    document = json.loads(line)
    assert document["position_s"] == pytest.approx(DURATION_S, abs=0.1)
    assert (document["silent"], document["status"]) == (False, "TRACKING")
    states = {one["name"]: one["state"] for one in document["messages"]}
    assert states["WheelSpeeds1"] == "ok"


def test_the_last_line_is_at_the_duration(logs, capsys):
    words = ["--json", "-", "--every", "1", "--duration"]
    short, long = ("0.5", [0.5]), ("2.5", [1.0, 2.0, 2.5])
    for duration, expected in (short, long):
        found = lines_of(capsys, logs / "full.log", *words, duration)
        assert [json.loads(line)["position_s"] for line in found] == expected


def test_values_of_json_carry_no_noise_of_floats(logs, capsys):
    (line,) = lines_of(capsys, logs / "full.log", "--json", "-", "--every", "60")
    document = json.loads(line)
    measured = [document[name] for name in ("mu_max", "lambda_m", "c1", "c2", "speed_mps")]
    measured += [value for axle in document["axles"] for value in axle.values()]
    assert all(len(repr(value).lstrip("-0.").replace(".", "")) <= 6 for value in measured)


def test_a_recording_in_other_units_is_refused_as_by_the_other_commands(logs, tmp_path, capsys):
    path = tmp_path / "ms.log"
    with (logs / "full.log").open() as whole, path.open("w") as file:
        for line in islice(whole, 3000):
            stamp, rest = line[1:].split(") ", 1)
            file.write(f"({1e3 * float(stamp):.6f}) {rest}")
    assert main(["monitor", str(path), "--plain"]) == 2
    assert "its stamps seem to be in ms" in capsys.readouterr().err


@pytest.mark.costly
def test_objects_of_json_and_a_span_of_the_recording(logs, capsys, tmp_path):
    words = [logs / "full.log", "--json", "-", "--every", "1", "--from", "3", "--duration", "3"]
    found = [json.loads(line) for line in lines_of(capsys, *words)]
    assert [one["position_s"] for one in found] == [4.0, 5.0, 6.0]
    assert {one["service"] for one in found} == {"recorded"}
    assert len(found[0]["axles"]) == 6
    # To a file, and as text beside it.
    out = tmp_path / "m.jsonl"
    text = lines_of(capsys, logs / "inputs.log", "--json", out, "--every", "1", "--duration", "2")
    assert len(text) == len(out.read_text().splitlines()) == 2
    last = json.loads(out.read_text().splitlines()[-1])
    assert (last["service"], last["status"]) == ("estimated_here", "TRACKING")
    assert any("estimated here" in sentence for sentence in last["words"])


def test_a_recording_without_effort_has_no_service_and_says_why(tmp_path, capsys):
    data = Path(__file__).resolve().parent.parent / "data"
    frame = Frame(1_000_000, 0x7DF, b"\x02")
    path = write_log(tmp_path / "car.log", [frame, frame._replace(t_us=2_000_000)])
    (line,) = lines_of(capsys, path, "--json", "-", "--config", data / "car.toml")
    document = json.loads(line)
    assert document["service"] is None
    assert any("no role gives tractive effort" in sentence for sentence in document["words"])


def test_the_documented_line_sends_plotjuggler_an_object_a_datagram(logs):
    """On a recording in place of the bus, and to a free port in place of PlotJuggler's."""
    (line,) = bench_lines("plotjuggler", ROOT / "docs" / "monitor.md")
    with socket.socket(type=socket.SOCK_DGRAM) as server:
        server.bind(("127.0.0.1", 0))
        server.settimeout(120.0)
        line = line.replace("-i socketcan -c vcan0", f"{logs / 'full.log'} --duration 0.5")
        line = line.replace("9870", str(server.getsockname()[1]))
        path = f"{Path(sys.executable).parent}:{os.environ['PATH']}"
        done = subprocess.run(
            ["bash", "-c", line], env={**os.environ, "PATH": path}, check=True, timeout=240,
            capture_output=True,
        )  # fmt: skip
        assert done.stderr == b""
        found = [json.loads(server.recv(65536)) for _ in range(10)]
    assert [one["position_s"] for one in found] == pytest.approx([0.05 * k for k in range(1, 11)])
    assert all(isinstance(one["axles"][0], dict) for one in found)
    assert isinstance(found[-1]["bus_time_s"], float)


@pytest.mark.costly
def test_a_reader_that_goes_away_is_no_error(logs):
    code = "import sys; from adhesion_can.cli.main import main; sys.exit(main(sys.argv[1:]))"
    words = ["monitor", str(logs / "full.log"), "--plain", "--every", "0.005"]
    with subprocess.Popen(
        [sys.executable, "-c", code, *words], stdout=subprocess.PIPE, stderr=subprocess.PIPE
    ) as process:
        assert process.stdout.readline()
        process.stdout.close()
        assert process.stderr.read() == b""
        assert process.wait(60) == 0


def test_ctrl_c_ends_it_cleanly(logs, tmp_path):
    command_line = f"adhesion-can monitor {logs / 'full.log'} --plain --speed 0.5 --every 0.1"
    terminal = Terminal(f"{command_line} --json kept.jsonl --record kept.log", tmp_path, "monitor")
    terminal.wait_for("frames/s")
    assert terminal.interrupt() == 0
    assert terminal.err.read_text() == ""
    assert json.loads((tmp_path / "kept.jsonl").read_text().splitlines()[0])["frames"] > 0
    assert next(iter(Recording(tmp_path / "kept.log"))).t_us >= 0


# --- a bus


NEVER_US = 10**15


class DeafBus:
    """A bus that delivers frames and on which sending is an error."""

    channel_info = "deaf"

    def __init__(self, frames, *, then=None):
        self.frames = list(frames)
        self.then = then
        self.is_shut = False

    def recv(self, timeout):
        if self.frames:
            return to_message(self.frames.pop(0))
        if self.then is not None:
            raise self.then
        time.sleep(min(timeout, 0.01))
        return None

    def send(self, message):
        raise AssertionError("a monitor sends")

    def set_filters(self, filters):
        assert {one["can_mask"] for one in filters} == {0}

    def shutdown(self):
        self.is_shut = True


def wait_until(ready, timeout=30.0):
    end = time.monotonic() + timeout
    while not ready():
        assert time.monotonic() < end
        time.sleep(0.01)


@pytest.mark.parametrize("estimate", [False, True])
def test_on_a_bus_it_shows_what_comes_and_sends_nothing(monkeypatch, capsys, estimate):
    # However busy the machine is, no frame is too old to be looked at, and three seconds suffice.
    monkeypatch.setattr("adhesion_can.service.receive_queue.STALE_US", NEVER_US)
    now_us = time.time_ns() // 1000
    frames = [f._replace(t_us=now_us - 400_000 + f.t_us) for f in Bench().drive(0, 300_000)]
    bus = DeafBus(frames)
    monkeypatch.setattr(command, "bus_opener", lambda _: lambda: bus)
    words = ["-i", "virtual", "-c", "x", "--json", "-", "--every", "3", "--duration", "3"]
    (line,) = lines_of(capsys, *words, *["--estimate"] * estimate)
    document = json.loads(line)
    by_name = {one["name"]: one for one in document["messages"]}
    assert by_name["WheelSpeeds1"]["accepted"] == 30
    assert by_name["WheelSpeeds1"]["state"] == "silent"
    assert document["position_s"] is None
    if estimate:
        # A silent bus has made its inputs stale.
        assert (document["service"], document["status"]) == ("estimated_here", "STALE_INPUT")
    else:
        assert document["service"] is None
    assert bus.is_shut


def test_what_nobody_takes_is_bounded_and_counted(monkeypatch):
    monkeypatch.setattr("adhesion_can.service.receive_queue.STALE_US", NEVER_US)
    bus = DeafBus(Frame(k, 0x100, b"\x00") for k in range(50))
    listener = BusListener(ReconnectingBus(lambda: bus, EVERY_ID), capacity=20)
    listener.start()
    wait_until(lambda: listener.dropped == 30)
    taken = listener.take()
    listener.stop()
    assert len(taken) == 20
    assert listener.dropped == 30
    assert taken[-1].t_us >= taken[0].t_us


def test_a_turn_takes_no_more_than_it_has_time_for(monkeypatch):
    """What is left waits for the next turn, in order."""
    monkeypatch.setattr("adhesion_can.cli.monitor_source.TURN_S", 0.0)
    monkeypatch.setattr("adhesion_can.service.receive_queue.STALE_US", NEVER_US)
    bus = DeafBus(Frame(k, 0x100, bytes([k])) for k in range(200))
    listener = BusListener(ReconnectingBus(lambda: bus, EVERY_ID))
    listener.start()
    wait_until(lambda: len(listener._waiting) == 200)
    source = LiveSource(listener, "flood", None, deque())
    turns = [[frame.data[0] for frame in source.take()] for _ in range(5)]
    source.close()
    assert [len(turn) for turn in turns] == [64, 64, 64, 8, 0]
    assert [number for turn in turns for number in turn] == list(range(200))


def test_a_bus_that_goes_down_is_opened_again():
    first = DeafBus([Frame(1, 0x100, b"\x01")], then=can.CanOperationError("gone"))
    second = DeafBus([Frame(2, 0x100, b"\x02")])
    buses, notes = [first, second], []
    listener = BusListener(ReconnectingBus(lambda: buses.pop(0), EVERY_ID, notes.append))
    listener.start()
    found = []
    wait_until(lambda: found.extend(listener.take()) or len(found) == 2)
    assert listener.is_open
    listener.stop()
    assert [frame.data for frame in found] == [b"\x01", b"\x02"]
    assert first.is_shut
    assert any("reopening it" in note for note in notes)


def test_what_ends_the_thread_is_told():
    bus = DeafBus([], then=RuntimeError("a defect"))
    listener = BusListener(ReconnectingBus(lambda: bus, EVERY_ID))
    listener.start()
    with pytest.raises(RuntimeError, match="a defect"):
        wait_until(lambda: listener.take() is None)
    listener.stop()


def test_on_a_paused_view_of_a_bus_frames_go_on():
    class Source:
        origin, made_here, generation, now_us = Origin.SENT, frozenset(), 0, 0

        def take(self):
            self.now_us += 100_000
            return list(Bench().drive(self.now_us - 100_000, self.now_us))

        def transport(self):
            from adhesion_can.monitoring.snapshot import Transport

            return Transport()

        def close(self):
            pass

    session = MonitorSession(load_configuration(), Source())
    shown = session.turn()
    session.toggle_pause()
    assert session.turn().frames == shown.frames
    session.step()
    assert session.turn().frames == 3 * shown.frames
    session.toggle_pause()
    assert session.turn().frames == 4 * shown.frames


def test_the_inputs_of_the_packaged_database_are_its_inputs(logs):
    session, _ = session_on(logs / "full.log")
    shown = session.run_until(2_000_000)
    inputs = [view for view in shown.messages if view.kind is MessageRole.INPUT]
    assert len(inputs) == 9
    assert all(view.state is MessageState.OK for view in inputs)


# --- wrong usage


@pytest.mark.parametrize(
    ("words", "said"),
    [
        ([], "give one of them, not both"),
        (["x.log", "-i", "virtual"], "give one of them, not both"),
        (["x.log"], "x.log: No such file"),
        (["x.log", "--speed", "-1"], "is not a speed"),
        (["x.log", "--every", "0"], "not a positive number"),
        (["x.log", "--from", "-1"], "is not a time"),
        (["-i", "virtual", "-c", "x", "--speed", "2"], "apply to recordings only"),
        (["-i", "socketcan", "-c", "nope0", "--plain"], "bus socketcan:nope0: cannot be opened"),
    ],
)
def test_wrong_usage_is_one_line(capsys, tmp_path, monkeypatch, words, said):
    monkeypatch.chdir(tmp_path)
    for name in ("CAN_INTERFACE", "CAN_CHANNEL"):
        monkeypatch.delenv(name, raising=False)
    with pytest.raises(SystemExit) if "a speed" in said else _nothing():
        assert main(["monitor", *words]) == 2
    err = capsys.readouterr().err
    assert said in err
    assert len(err.strip().splitlines()) == 1


def _nothing():
    from contextlib import nullcontext

    return nullcontext()


def test_a_begin_behind_the_end_and_an_empty_recording(logs, capsys, tmp_path):
    assert main(["monitor", str(logs / "full.log"), "--plain", "--from", "99"]) == 2
    assert "is after the end at 8.0 s" in capsys.readouterr().err
    (tmp_path / "empty.log").write_text("")
    assert main(["monitor", str(tmp_path / "empty.log"), "--plain"]) == 2
    assert len(capsys.readouterr().err.strip().splitlines()) == 1


def test_without_textual_it_says_what_to_install(logs, capsys, monkeypatch):
    monkeypatch.setattr(command, "_on_terminal", lambda: True)
    monkeypatch.setitem(sys.modules, "adhesion_can.cli.monitor_app", None)
    assert main(["monitor", str(logs / "full.log")]) == 2
    err = capsys.readouterr().err
    assert install_extra("tui") in err
    assert len(err.strip().splitlines()) == 1


@pytest.mark.costly
def test_importing_the_command_imports_no_textual():
    code = "import sys, adhesion_can.cli.monitor, adhesion_can.cli.demo\n"
    code += "print('textual' in sys.modules)"
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True, timeout=120
    )
    assert done.stdout == "False\n"
