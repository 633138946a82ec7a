"""What goes wrong ends in an error with words, and in no process that is left."""

import os
import shutil
import signal
import stat
import subprocess
import sys
import time
from pathlib import Path

import pytest

from adhesion_can.version import __version__

pytest.importorskip("fmpy", reason="needs the extra 'test'")
ROOT = Path(__file__).resolve().parents[2]
pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="looks into /proc")


def children():
    """Numbers of the processes of FMUs that this process has started."""
    path = Path(f"/proc/self/task/{os.getpid()}/children")
    numbers = map(int, path.read_text().split())
    return {n for n in numbers if b"adhesion_can.fmu.child" in command(n)}


def command(number):
    try:
        return Path(f"/proc/{number}/cmdline").read_bytes()
    except (FileNotFoundError, ProcessLookupError):
        return b""


def wait_until(is_so, seconds=60.0):
    end_s = time.monotonic() + seconds
    while not is_so():
        assert time.monotonic() < end_s
        time.sleep(0.02)


def raises():
    from fmpy.fmi1 import FMICallException

    return pytest.raises(FMICallException)


@pytest.mark.costly
def test_a_killed_process_is_an_error_and_reset_starts_another(host):
    before = children()
    one = host.initialize("controller")
    (child,) = children() - before
    one.doStep(0.0, 0.01)
    os.kill(child, signal.SIGKILL)
    with raises():
        one.doStep(0.01, 0.01)
    assert "was ended by signal 9" in host.said[-1]
    with raises():
        host.read(one, "effort_demand_1")
    one.reset()
    one.setupExperiment(startTime=0.0)
    one.enterInitializationMode()
    one.exitInitializationMode()
    one.doStep(0.0, 0.01)
    assert host.read(one, "effort_demand_1") == [0.0]
    (child,) = children() - before
    one.freeInstance()
    assert command(child) == b""
    one.freeInstance = lambda: None


def test_a_stopped_process_is_an_error_after_its_time(host, monkeypatch):
    before = children()
    one = host.initialize("controller")
    (child,) = children() - before
    monkeypatch.setenv("ADHESION_CAN_TIMEOUT", "0.5")
    os.kill(child, signal.SIGSTOP)
    began_s = time.monotonic()
    with raises():
        one.doStep(0.0, 0.01)
    assert time.monotonic() - began_s >= 0.5
    assert "does not answer in time" in host.said[-1]
    assert command(child) == b""


HOST = """
import os, sys
from fmpy import read_model_description
from fmpy.fmi2 import FMU2Slave
folder = sys.argv[1]
description = read_model_description(folder)
ones = []
for name in "ab":
    one = FMU2Slave(guid=description.guid, unzipDirectory=folder, instanceName=name,
                    modelIdentifier=description.coSimulation.modelIdentifier)
    one.instantiate()
    ones.append(one)
print(*open(f"/proc/self/task/{os.getpid()}/children").read().split(), flush=True)
sys.stdin.read()
"""


def test_processes_end_with_a_host_that_is_killed(unpacked):
    with subprocess.Popen(
        [sys.executable, "-c", HOST, unpacked["controller"]],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        cwd=ROOT,
    ) as host:
        numbers = host.stdout.readline().split()
        assert len(numbers) == 2
        assert all(b"fmu.child" in command(int(n)) for n in numbers)
        host.kill()
    wait_until(lambda: not any(b"fmu.child" in command(int(n)) for n in numbers))


def test_a_description_of_another_fmu_is_refused(host):
    before = children()
    with pytest.raises(Exception, match="instantiate"):
        host.instantiate("controller", guid="{00000000-0000-0000-0000-000000000000}")
    assert "the description is of another FMU" in host.said[-1]
    assert children() == before


@pytest.fixture
def own_copy(unpacked, tmp_path):
    return Path(shutil.copytree(unpacked["controller"], tmp_path / "copy"))


def test_another_version_is_named(host, own_copy):
    file = own_copy / "resources" / "fmu.toml"
    lines = file.read_text().splitlines()
    changed = ['version = "9.8.7"' if line.startswith("version") else line for line in lines]
    file.write_text("\n".join(changed))
    with pytest.raises(Exception, match="instantiate"):
        host.instantiate("controller", own_copy)
    assert "exported by adhesion-can 9.8.7, and 0." in host.said[-1]


def test_a_missing_file_is_named(host, own_copy):
    (own_copy / "resources" / "fmu.toml").unlink()
    with pytest.raises(Exception, match="instantiate"):
        host.instantiate("controller", own_copy)
    assert "fmu.toml" in host.said[-1]


def script(path, text):
    path.write_text(text)
    path.chmod(path.stat().st_mode | stat.S_IXUSR)
    return str(path)


def test_no_interpreter(host, monkeypatch):
    monkeypatch.setenv("ADHESION_CAN_PYTHON", "/nowhere/python")
    with pytest.raises(Exception, match="instantiate"):
        host.instantiate("controller")
    assert "'/nowhere/python' cannot be started: No such file" in host.said[-1]
    assert "ADHESION_CAN_PYTHON" in host.said[-1]


def test_an_interpreter_without_the_package(host, monkeypatch, tmp_path):
    # Isolated and without site-packages, as an interpreter that has none.
    text = f'#!/bin/sh\nshift\nexec "{sys.executable}" -I -S "$@"\n'
    monkeypatch.setenv("ADHESION_CAN_PYTHON", script(tmp_path / "bare", text))
    with pytest.raises(Exception, match="instantiate"):
        host.instantiate("controller")
    assert "ended with status 1" in host.said[-1]
    assert "in which adhesion-can is installed" in host.said[-1]


def test_the_module_that_an_fmu_starts_names_its_version():
    words = [sys.executable, "-m", "adhesion_can.fmu.child"]
    done = subprocess.run(words, capture_output=True, text=True, check=False, timeout=60, cwd=ROOT)
    assert done.stderr == f"adhesion-can {__version__} is here; FMUs start it\n"


def test_a_start_that_takes_too_long_names_the_limit(host, monkeypatch, tmp_path):
    slow = script(tmp_path / "slow", "#!/bin/sh\nexec sleep 60\n")
    monkeypatch.setenv("ADHESION_CAN_PYTHON", slow)
    monkeypatch.setenv("ADHESION_CAN_TIMEOUT", "0.3")
    with pytest.raises(Exception, match="instantiate"):
        host.instantiate("controller")
    assert f"'{slow}': the Python process does not answer in time" in host.said[-1]
    assert "ADHESION_CAN_TIMEOUT" in host.said[-1]
    assert "ADHESION_CAN_PYTHON" not in host.said[-1]


@pytest.mark.parametrize("text", ["yes answer", "printf '\\0\\0\\0'; exec sleep 60"])
def test_a_process_that_speaks_otherwise(host, monkeypatch, tmp_path, text):
    monkeypatch.setenv("ADHESION_CAN_PYTHON", script(tmp_path / "other", f"#!/bin/sh\n{text}\n"))
    monkeypatch.setenv("ADHESION_CAN_TIMEOUT", "0.3")
    with pytest.raises(Exception, match="instantiate"):
        host.instantiate("controller")
    assert "protocol" in host.said[-1] or "in time" in host.said[-1]


def test_the_interpreter_of_the_export_is_tried_before_that_of_the_path(
    host, own_copy, monkeypatch, tmp_path
):
    file = own_copy / "resources" / "python.txt"
    assert file.read_text() == f"{sys.executable}\n"
    file.write_text("/gone/python\n")
    bare = script(tmp_path / "python3", "#!/bin/sh\nexit 7\n")
    monkeypatch.setenv("PATH", f"{Path(bare).parent}:{os.environ['PATH']}")
    with pytest.raises(Exception, match="instantiate"):
        host.instantiate("controller", own_copy)
    assert "ended with status 7 ('python3')" in host.said[-1]
