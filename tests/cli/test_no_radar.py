"""What a user types who has no radar: simulate, replay with the switch, see TRACKING."""

import csv
import json

import numpy as np
import pytest

import adhesion_can
from adhesion_can.cli.main import main
from tests.gnss_configuration import write_gnss_configuration


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    folder = tmp_path_factory.mktemp("no_radar")
    (folder / "observed.toml").write_text("[observed_speed]\nenabled = true\n", encoding="utf-8")
    return folder


@pytest.fixture(scope="module")
def rows(folder):
    log, table = str(folder / "d.log"), folder / "d.csv"
    typed = f"simulate --scenario wet --no-radar --duration 25 --seed 1 --log {log}"
    assert main(typed.split()) == 0
    typed = f"replay {log} --config {folder / 'observed.toml'} --table {table}"
    assert main([*typed.split(), "--json", str(folder / "d.json")]) == 0
    with table.open() as file:
        return list(csv.DictReader(file))


@pytest.mark.costly
def test_the_status_is_tracking_behind_the_first_reliefs(rows):
    tracking = [float(row["time_s"]) for row in rows if row["status"] == "TRACKING"]
    assert len(tracking) > 20
    # The first relief takes until 3.4 s.
    assert min(tracking) > 3.4
    for row in rows:
        if row["status"] == "TRACKING":
            assert row["objection"] == "NONE"
            assert row["speed_source"] == "observed"
            assert abs(float(row["mu_max"]) / 0.2456 - 1) < 0.1


def test_without_a_relief_the_words_say_what_is_missing(rows, folder):
    early = [row for row in rows if 1.0 < float(row["time_s"]) < 2.9]
    assert {row["status"] for row in early} == {"LOW_EXCITATION"}
    assert {row["objection"] for row in early} == {"NO_RELIEF"}
    document = json.loads((folder / "d.json").read_text())
    assert "no_relief" in document["setpoints_by_objection"]
    assert "STALE_INPUT" not in document["setpoints_by_status"]


@pytest.mark.costly
@pytest.mark.usefixtures("rows")
def test_without_the_switch_the_message_is_missing(folder, capsys):
    assert main(["replay", str(folder / "d.log"), "--to", "2"]) == 2
    assert "VehicleSpeed 0x111" in capsys.readouterr().err


def test_with_a_speed_by_satellites_the_drive_has_it_and_slips_are_known_at_once(tmp_path):
    config = write_gnss_configuration(tmp_path, 'gnss_speed = "Satellites.Speed"')
    log, table = str(tmp_path / "d.log"), tmp_path / "d.csv"
    typed = f"simulate --scenario wet --no-radar --duration 3 --seed 1 --log {log}"
    assert main([*typed.split(), "--config", str(config)]) == 0
    assert main(["replay", log, "--config", str(config), "--table", str(table)]) == 0
    with table.open() as file:
        rows = [row for row in csv.DictReader(file) if row["status"] != "INIT"]
    known = [float(row["time_s"]) for row in rows if row["objection"] == "NONE"]
    assert min(known) < 2.0


def test_the_observed_speed_states_what_satellites_may_be_off_by(tmp_path, capsys):
    config = write_gnss_configuration(tmp_path)
    config.write_text(config.read_text().replace("gnss_std = 0.03", "gnss_std = 0"))
    assert main(["replay", "x.log", "--config", str(config)]) == 2
    assert "observed_speed.gnss_std" in capsys.readouterr().err


@pytest.mark.parametrize("other", [["--closed-loop"], ["--closed-loop", "--plan", "p.toml"]])
def test_the_drive_of_no_radar_follows_nobody(other, folder, capsys):
    (folder / "p.toml").write_text("")
    typed = ["simulate", "--scenario", "wet", "--no-radar", "--log", str(folder / "x.log"), *other]
    assert main(typed) == 2
    assert "--no-radar" in capsys.readouterr().err or "--plan" in other


def test_a_service_that_observes_cannot_learn(folder, capsys):
    typed = ["run", "-i", "virtual", "-c", "no_radar", "--config", str(folder / "observed.toml")]
    assert main([*typed, "--learn", "propose", "--learn-to", str(folder / "models")]) == 2
    assert "measured vehicle speed" in capsys.readouterr().err


@pytest.mark.usefixtures("rows")
def test_the_table_in_python_says_that_the_speed_is_observed_as_the_written_one_does(folder):
    log, config = folder / "d.log", folder / "observed.toml"
    table = adhesion_can.replay(log, config, to_s=1.0)
    assert set(table["speed_source"]) == {"", "observed"}
    assert np.array_equal(table["speed_source"] == "observed", ~np.isnan(table["speed_mps"]))
