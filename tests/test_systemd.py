"""The unit for systemd, judged by systemd's own tool."""

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
