"""A recording of another bus than the configuration: one sentence with the ids and the fix."""

import json
import re

import pytest

import adhesion_can
from adhesion_can.bus.database import packaged_path
from adhesion_can.cli.main import main
from adhesion_can.config import load_configuration
from adhesion_can.errors import RecordingError
from adhesion_can.fleet.analysis import analyse
from adhesion_can.input_files import file_sha256

READERS = (
    "replay",
    "replay --realtime --to 0.5",
    "identify",
    "diagnose",
    "evaluate --model m.toml",
)
NEEDED = ("101", "102", "111", "121", "122")
LACKS = {
    "other.log": "the recording does not fit adhesion.dbc: 5 of 5 needed messages are missing "
    "(WheelSpeeds1 0x101, WheelSpeeds2 0x102, TractiveEffort1 0x121, TractiveEffort2 0x122, "
    "VehicleSpeed 0x111); the recording has 0x131, 0x132, 0x141, 0x151, 0x601, 0x602, 0x611, 0x621 "
    "and 1 more",
    "speeds.log": "2 of 5 needed messages are missing (TractiveEffort1 0x121, TractiveEffort2 "
    "0x122); the recording has 0x101, 0x102, 0x111",
}
"""What is wrong with each recording, of which frames are accepted but no sample is formed."""


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A drive, the same with other ids for what is needed, and its speeds alone."""
    folder = tmp_path_factory.mktemp("bus")
    log = folder / "drive.log"
    assert main(["simulate", "--scenario", "dry", "--duration", "3", "--log", str(log)]) == 0
    text = log.read_text()
    ids = "|".join(NEEDED)
    renamed = re.sub(rf" ({ids})#", lambda found: f" 6{found[1][1:]}#", text)
    (folder / "other.log").write_text(renamed)
    speeds = [one for one in text.splitlines(keepends=True) if re.search(" (101|102|111)#", one)]
    (folder / "speeds.log").write_text("".join(speeds))
    (folder / "m.toml").write_text("[base]\nc1 = 0.4\nc2 = 60.0\nc3 = 0.3\n")
    return folder


@pytest.mark.parametrize("name", LACKS)
@pytest.mark.parametrize("typed", READERS)
def test_each_command_ends_with_the_ids_that_are_missing(folder, monkeypatch, capsys, typed, name):
    monkeypatch.chdir(folder)
    command, *options = typed.split()
    capsys.readouterr()
    assert main([command, name, *options]) == 2
    out, err = capsys.readouterr()
    assert f"{command}: {name}: {LACKS[name]}; " in err
    assert err.count("\n") == 1
    assert "--config F" in err
    assert "Next:" not in out


def test_the_setpoints_of_a_recording_without_a_sample_stay_written(folder, tmp_path):
    table, frames = tmp_path / "t.csv", tmp_path / "f.log"
    written = ["--table", str(table), "--frames", str(frames)]
    assert main(["replay", str(folder / "speeds.log"), *written]) == 2
    assert table.read_text().count("\n") > 100
    assert frames.stat().st_size > 0


def test_a_part_that_is_too_short_for_a_message_is_no_other_bus(folder, capsys):
    assert main(["replay", str(folder / "drive.log"), "--to", "0.0001"]) == 0
    assert "needed messages" not in "".join(capsys.readouterr())


def test_a_configuration_of_another_vehicle_is_named(folder, tmp_path, capsys):
    dbc, config = tmp_path / "own.dbc", tmp_path / "own.toml"
    dbc.write_text(re.sub(r"\b(257|258|273|289|290)\b", r"1\1", packaged_path().read_text()))
    config.write_text('[bus]\ndatabase = "own.dbc"\n')
    assert main(["replay", str(folder / "drive.log"), "--config", str(config)]) == 2
    err = capsys.readouterr().err
    assert "the recording does not fit own.dbc: 5 of 5" in err
    assert "check database and [roles] in own.toml, or name another with --config" in err


@pytest.mark.parametrize("name", LACKS)
def test_check_leads_with_the_sentence(folder, monkeypatch, capsys, name):
    monkeypatch.chdir(folder)
    capsys.readouterr()
    assert main(["check", name, "--json", "c.json"]) == 1
    said = capsys.readouterr().out
    (wrong,) = [line for line in said.splitlines() if line.startswith("WRONG: ")]
    assert wrong.startswith(f"WRONG: {LACKS[name]}; ")
    document = json.loads((folder / "c.json").read_text())
    assert [f"WRONG: {one}" for one in document["failures"]] == [wrong]
    assert said.splitlines()[-1] == document["next"]
    if name == "other.log":
        assert "adhesion-can check other.log --config F" in document["next"]
        assert "Signals" not in said


def test_calibrate_needs_only_speeds(folder, capsys):
    assert main(["calibrate", str(folder / "other.log")]) == 2
    assert "3 of 3 needed messages are missing" in capsys.readouterr().err
    assert main(["calibrate", str(folder / "speeds.log")]) == 2
    assert "has no tractive effort" in capsys.readouterr().err


def test_convert_of_ids_that_mean_something_else(folder, tmp_path, capsys):
    """One frame in 256 has the right checksum by chance: that is no conversion."""
    lines = (folder / "drive.log").read_text().splitlines(keepends=True)
    efforts = [line for line in lines if " 121#" in line]
    wrong = [re.sub(r"#..", "#00", line) for line in efforts[5:]]
    (tmp_path / "w.log").write_text("".join([*efforts[:5], *wrong]))
    out = tmp_path / "w.csv"
    assert main(["convert", str(tmp_path / "w.log"), "--out", str(out)]) == 2
    err = capsys.readouterr().err
    assert re.search(r"2\d\d of 30\d frames of known ids are rejected \(checksum: ", err)
    assert "with --dbc" in err
    assert not out.exists()


def test_in_python_too(folder):
    with pytest.raises(RecordingError, match="5 of 5 needed messages are missing"):
        adhesion_can.replay(folder / "other.log")


def test_a_fleet_names_the_recording(folder):
    path = folder / "other.log"
    config = load_configuration(None, None)
    found = analyse(path, "other.log", file_sha256(path), config, ("check", "replay"))
    assert found.fields["failed_step"] == "read"
    assert found.fields["error"].startswith(f"other.log: {LACKS['other.log']}; ")
