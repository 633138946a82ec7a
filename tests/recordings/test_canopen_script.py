"""The script of docs/recordings.md that makes a DBC of a CANopen node's EDS."""

import re
import subprocess
import sys
from pathlib import Path

import cantools
import pytest

ROOT = Path(__file__).resolve().parents[2]
EDS = ROOT / "tests" / "data" / "drive.eds"


@pytest.fixture(scope="module")
def database(tmp_path_factory):
    pytest.importorskip("canopen")
    folder = tmp_path_factory.mktemp("canopen")
    page = (ROOT / "docs" / "recordings.md").read_text()
    (text,) = re.findall(r"```python\n(.*?import canopen.*?)```", page, re.DOTALL)
    script = folder / "canopen_dbc.py"
    script.write_text(text)
    words = [sys.executable, script, EDS, "5", folder / "drive.dbc"]
    subprocess.run(words, check=True, timeout=120)
    return cantools.database.load_file(folder / "drive.dbc")


@pytest.mark.costly
def test_the_objects_that_are_valid_become_messages(database):
    (message,) = database.messages
    assert message.frame_id == 0x185
    assert message.length == 8
    signals = {s.name: (s.start, s.length, s.is_signed, s.is_float) for s in message.signals}
    assert signals == {
        "Wheel_speed_1": (0, 16, False, False),
        "Torque_actual_value_2": (16, 16, True, False),
        "Motor_temperature_3": (32, 32, False, True),
    }


@pytest.mark.costly
def test_frames_are_decoded(database):
    values = database.decode_message(0x185, bytes.fromhex("e803 feff 00009041"))
    assert values == {
        "Wheel_speed_1": 1000, "Torque_actual_value_2": -2, "Motor_temperature_3": 18.0,
    }  # fmt: skip
