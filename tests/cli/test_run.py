"""`run` as a process on a bus of this host: state, log, signals."""

import json
import signal
import subprocess
import sys
import threading
import time
from functools import cache

import can
import pytest

from adhesion_can.bus.frame import Frame
from adhesion_can.cli.main import main
from adhesion_can.recordings.candump import ReadReport, read_candump
from adhesion_can.recordings.python_can_messages import to_message
from tests.promptness import frames_with_prompt_past
from tests.terminals import Terminal
from tests.wire import Bench


def test_run_in_this_process_keeps_log_state_and_json(tmp_path):
    """On the virtual bus, fed from a thread: 2 s of a drive from the first setpoint on."""
    files = {name: tmp_path / name for name in ("run.log", "state.json", "run.json")}
    arguments = ["run", "-i", "virtual", "-c", "run-here", "--duration", "90"]
    arguments += ["--log", str(files["run.log"]), "--state", str(files["state.json"])]
    arguments += ["--json", str(files["run.json"])]
    handlers = {n: signal.getsignal(n) for n in (signal.SIGINT, signal.SIGTERM)}
    fed, ended = [], threading.Event()
    with can.Bus(interface="virtual", channel="run-here") as bus:

        def feed():
            began, answers, answered_us = time.monotonic(), 0, None
            for frame in Bench().drive(0, 80_000_000):
                if ended.is_set():
                    return
                time.sleep(max(0.0, frame.t_us / 1e6 - (time.monotonic() - began)))
                bus.send(to_message(frame._replace(t_us=time.time_ns() // 1000)))
                while bus.recv(0.0) is not None:
                    answers += 1
                if answers and answered_us is None:
                    answered_us = frame.t_us
                if answered_us is not None:
                    fed.append(frame)
                    if frame.t_us - answered_us > 2_000_000 and answers > 400:
                        break
            signal.raise_signal(signal.SIGTERM)

        feeder = threading.Thread(target=feed)
        feeder.start()
        try:
            assert main(arguments) == 0
        finally:
            ended.set()
            feeder.join()
    for number, handler in handlers.items():
        signal.signal(number, handler)
    document = json.loads(files["run.json"].read_text())
    assert len(fed) > 800
    assert document["sent"] > 400
    # Some 930 frames and 1200 samples; a busy machine loses of both, but none where it is in time:
    # 9 frames a setpoint and 12 samples.
    with files["run.log"].open("rb") as lines:
        logged = [item for item in read_candump(lines, ReadReport()) if isinstance(item, Frame)]
    prompt = frames_with_prompt_past(logged, 0x201, past_us=500_000)
    assert document["received"] > max(100, 8 * len(prompt))
    assert document["samples"] >= document["last"]["samples"] > 10 * len(prompt)
    assert main(["replay", str(files["run.log"]), "--frames", str(tmp_path / "again.log")]) == 0


def test_a_state_that_is_none_is_told_put_aside_and_the_service_begins_cold(tmp_path, capsys):
    state = tmp_path / "state.json"
    state.write_text('{"c1": 3}')
    handlers = {n: signal.getsignal(n) for n in (signal.SIGINT, signal.SIGTERM)}
    try:
        words = ["run", "-i", "virtual", "-c", "x", "--duration", "0.2", "--state", str(state)]
        assert main(words) == 1  # no frame came
    finally:
        for number, handler in handlers.items():
            signal.signal(number, handler)
    err = capsys.readouterr().err
    assert "is not used: it is not a state file of adhesion-can; starting cold" in err
    assert (tmp_path / "state.json.refused").read_text() == '{"c1": 3}'
    assert not state.exists()


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_ends_the_service_in_order(tmp_path, number):
    service = Terminal(
        "adhesion-can run -i virtual -c x --log run.log --json r.json", tmp_path, "run"
    )
    try:
        service.wait_for("listening on")
        service.process.send_signal(number)
        assert service.wait(60) == 0
    finally:
        if service.process.poll() is None:
            service.kill()
    assert (tmp_path / "run.log").exists()
    assert not (tmp_path / "run.log.part").exists()
    assert json.loads((tmp_path / "r.json").read_text())["received"] == 0


def test_hanging_up_does_not_end_a_service_that_has_no_terminal(tmp_path):
    """A service manager asks so for another log."""
    words = "adhesion-can run -i virtual -c y --log run.log"
    service = Terminal(words, tmp_path, "run")
    try:
        service.wait_for("listening on")
        service.process.send_signal(signal.SIGHUP)
        service.process.send_signal(signal.SIGTERM)
        assert service.wait(60) == 0
    finally:
        if service.process.poll() is None:
            service.kill()
    assert (tmp_path / "run.log").exists()


def test_a_bus_that_is_gone_for_good_is_an_error_at_the_start_unless_it_is_waited_for(capsys):
    words = ["run", "-i", "socketcan", "-c", "no-such-can", "--duration", "0.5"]
    assert main(words) == 2
    assert "cannot be opened" in capsys.readouterr().err
    assert main([*words, "--wait"]) == 1
    said = capsys.readouterr().err
    assert "trying again" in said
    assert "in 0.5 s on socketcan no-such-can: nothing was identified" in said


@cache
def modules_after(code):
    """Top-level modules and SciPy sub-packages that a fresh interpreter has after the code."""
    code += "; import sys; names = {n for n in sys.modules if n.count('.') == 0}; "
    code += "names |= {n for n in sys.modules if n.startswith('scipy.') and n.count('.') == 1}; "
    code += "print(*sorted(names))"
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True, timeout=60
    )
    return set(done.stdout.split())


HEAVY = {"matplotlib", "pyarrow", "asammdf", "plotly", "jinja2", "pandas", "scipy.signal"}
HEAVY |= {"scipy.interpolate", "scipy.optimize", "scipy.stats"}


def test_importing_the_package_or_the_entry_point_imports_no_library_at_all():
    for code in ("import adhesion_can", "import adhesion_can.cli.main"):
        assert not modules_after(code) & (HEAVY | {"numpy", "scipy", "can", "cantools", "rich"})


@pytest.mark.costly
def test_importing_a_command_imports_no_extra_and_no_heavy_part_of_scipy():
    commands = ("run", "replay", "check", "identify", "simulate", "calibrate", "monitor")
    # python-can itself imports asammdf, and so pandas, where it is installed.
    before = modules_after("import can, cantools, rich.progress")
    after = modules_after("import " + ", ".join(f"adhesion_can.cli.{one}" for one in commands))
    assert not (after - before) & HEAVY


@pytest.mark.costly
def test_the_check_of_a_short_drive_needs_no_heavy_part_of_scipy_either(tmp_path):
    log = tmp_path / "drive.log"
    assert main(["simulate", "--scenario", "wet", "--duration", "3", "--log", str(log)]) == 0
    code = "import contextlib, io, can, cantools; from adhesion_can.cli.main import main\n"
    code += f"with contextlib.redirect_stdout(io.StringIO()): main(['check', {str(log)!r}])"
    found = modules_after(code + "\npass")
    assert "scipy.special" not in found
    # python-can itself imports asammdf, and so pandas, where it is installed.
    assert not (found - modules_after("import can, cantools")) & HEAVY


def test_a_bus_from_the_environment_serves_simulate_too(monkeypatch, capsys):
    monkeypatch.setenv("CAN_INTERFACE", "virtual")
    monkeypatch.setenv("CAN_CHANNEL", "from-environment")
    with can.Bus(interface="virtual", channel="from-environment") as listener:
        assert main(["simulate", "--scenario", "dry", "--duration", "0.5"]) == 0
        assert listener.recv(0.1) is not None
    monkeypatch.delenv("CAN_INTERFACE")
    assert main(["simulate", "--scenario", "dry", "--duration", "0.5"]) == 2
    assert "--log and -i: neither is given" in capsys.readouterr().err


def test_a_crash_keeps_what_was_recorded(tmp_path, monkeypatch):
    """What the bus said cannot be asked again."""

    def crash(service, _until):
        service._write_log("(1.000000) can0 101#00\n")
        service.bus.shutdown()
        raise RuntimeError("a defect")

    monkeypatch.setattr("adhesion_can.cli.run.LiveService.run", crash)
    handlers = {n: signal.getsignal(n) for n in (signal.SIGINT, signal.SIGTERM)}
    with pytest.raises(RuntimeError, match="a defect"):
        main(["run", "-i", "virtual", "-c", "crash", "--log", str(tmp_path / "run.log")])
    for number, handler in handlers.items():
        signal.signal(number, handler)
    assert (tmp_path / "run.log.part").read_text() == "(1.000000) can0 101#00\n"
