"""The unit for systemd, judged by systemd's own tool."""

import os
import re
import shutil
import subprocess
from pathlib import Path

import pytest

from adhesion_can.cli.main import main

UNIT = Path(__file__).resolve().parents[1] / "tools" / "systemd" / "adhesion-can@.service"
HIGHEST_EXPOSURE = 2.0
"""Of 10; most services of a distribution have 9."""

needs_systemd = pytest.mark.skipif(
    shutil.which("systemd-analyze") is None, reason="systemd-analyze is not here"
)


@pytest.fixture
def instance(tmp_path):
    path = tmp_path / "adhesion-can@can0.service"
    path.write_text(UNIT.read_text())
    return path


def analyze(*words):
    done = subprocess.run(
        ["systemd-analyze", *map(str, words)], capture_output=True, text=True, check=False
    )
    return done.returncode, done.stdout + done.stderr


@needs_systemd
def test_the_unit_has_no_fault(instance):
    status, said = analyze("verify", "--man=no", instance)
    assert status == 0, said
    assert instance.name not in said, said


@needs_systemd
def test_the_unit_is_hardened(instance):
    _, said = analyze("security", "--offline=true", "--no-pager", instance)
    found = re.search(r"exposure level for \S+: ([\d.]+)", said)
    if found is None:
        pytest.skip(f"this systemd-analyze cannot judge a file: {said[-200:]}")
    assert float(found[1]) <= HIGHEST_EXPOSURE


def test_the_command_of_the_unit_is_one_of_ours(capsys):
    line = re.search(r"^ExecStart=/usr/bin/env adhesion-can (.*)$", UNIT.read_text(), re.MULTILINE)
    words = line[1].replace("%i", "no-such-can").split()
    assert {"--wait", "--state", "--log", "--config"} <= set(words)
    # Every option is known; what is wrong is the file that is not here.
    assert main(words) == 2
    assert "no-such-can.toml" in capsys.readouterr().err


def keep_log(folder):
    """Do what the unit for can0 does before it starts, as systemd writes the command out."""
    line = re.search(r"^ExecStartPre=-/bin/sh -c '(.*)'$", UNIT.read_text(), re.MULTILINE)
    command = line[1].replace("%%", "\0").replace("%i", "can0").replace("\0", "%")
    return subprocess.run(
        ["/bin/sh", "-c", command.replace("$$", "$")],
        env=os.environ | {"LOGS_DIRECTORY": str(folder)},
        capture_output=True,
        text=True,
        check=False,
    )


def test_the_log_of_the_last_start_is_kept(tmp_path):
    assert keep_log(tmp_path).returncode == 0
    assert not list(tmp_path.iterdir())
    for stamp, text in ((1_700_000_000, "first"), (1_700_000_060, "second")):
        (log := tmp_path / "can0.log").write_text(text)
        os.utime(log, (stamp, stamp))
        done = keep_log(tmp_path)
        assert (done.returncode, done.stderr) == (0, "")
    found = {path.name: path.read_text() for path in tmp_path.iterdir()}
    assert found == {
        "can0-20231114T221320Z.log": "first",
        "can0-20231114T221420Z.log": "second",
    }
