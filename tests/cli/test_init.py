"""`init`: the file that it writes, what it asks, and that nothing is invented."""

import runpy
import sys
import tomllib
from io import StringIO
from pathlib import Path

import pytest

from adhesion_can.bus.database import packaged_path
from adhesion_can.cli.main import main
from adhesion_can.config import load_configuration
from adhesion_can.errors import ConfigError
from tests.cli.init_dialogue import VEHICLE, Terminal

TRAM = Path(__file__).resolve().parents[1] / "data" / "tram.dbc"


def test_the_file_of_a_tram_loads(tmp_path, capsys):
    out = tmp_path / "tram.toml"
    assert main(["init", "--dbc", str(TRAM), "--yes", "--out", str(out), *VEHICLE]) == 0
    assert "12 roles guessed" in capsys.readouterr().err
    config = load_configuration(out)
    config.require_identification()
    assert config.vehicle.wheel_radius == (0.33,) * 4
    scales = {s.name: s.scale for m in config.messages for s in m.signals}
    assert scales["wheel_speed.3"] == pytest.approx(0.10471976)
    assert scales["tractive_effort.1"] == 1e3
    assert "positive in traction" in out.read_text()


def test_our_own_database_needs_the_vehicle_alone(tmp_path):
    out = tmp_path / "own.toml"
    assert main(["init", "--dbc", str(packaged_path()), "--yes", "--out", str(out), *VEHICLE]) == 0
    assert {c.name for c in load_configuration(out).choices} == {
        c.name for c in load_configuration().choices
    }


def test_what_nobody_said_is_to_be_filled_in(tmp_path, capsys):
    """No invented radius: each is an error until it is written."""
    out = tmp_path / "tram.toml"
    assert main(["init", "--dbc", str(TRAM), "--yes", "--out", str(out)]) == 0
    assert "to fill in wheel_radius_m, axle_load_N" in capsys.readouterr().err
    with pytest.raises(ConfigError, match="wheel_radius_m: not filled in; write the radius of the"):
        load_configuration(out)


def test_a_number_is_written_as_it_was_given(tmp_path):
    out = tmp_path / "tram.toml"
    words = ["init", "--dbc", str(TRAM), "--yes", "--out", str(out)]
    assert main([*words, "--train-mass", "1234567", "--axle-load", "123456.75"]) == 0
    vehicle = tomllib.loads(out.read_text())["vehicle"]
    assert (vehicle["train_mass_kg"], vehicle["axle_load_N"]) == (1234567, 123456.75)


def test_a_wrong_number_is_told_in_its_own_unit(capsys):
    assert main(["init", "--dbc", str(TRAM), "--yes", "--axle-load", "-1"]) == 2
    told = capsys.readouterr().err
    assert "--axle-load: -1 is not a positive number; give newtons above 0" in told


@pytest.mark.parametrize(
    ("option", "value", "fix"),
    [
        ("--axle-load", "92", "below any axle load (1 to 500 kN); pass 92e3 for 92 kN; if it is"),
        (
            "--inertia",
            "92e3",
            "above any inertia of a wheelset (0.1 to 5000 kg m^2), and may be the",
        ),
        ("--train-mass", "60", "pass 60e3 for 60 t; if it is right, write it into the file"),
        (
            "--wheel-radius",
            "33",
            "33 m is above any wheel radius (0.1 to 1.3 m); pass 0.33 for 33 cm",
        ),
    ],
)
def test_a_number_that_no_vehicle_has_is_refused_with_what_was_meant(capsys, option, value, fix):
    assert main(["init", "--dbc", str(TRAM), "--yes", option, value]) == 2
    said = capsys.readouterr().err
    assert f"init: {option}: " in said
    assert fix in said


def test_a_database_that_is_not_there_is_named_with_those_that_are(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    for words in (["init", "--yes"], ["check", "drive.log"]):
        assert main([*words, "--dbc", "nope.dbc"]) == 2
        assert "--dbc nope.dbc: No such file; check the path, which is" in capsys.readouterr().err
    (tmp_path / "mine.dbc").write_text("")
    assert main(["init", "--yes", "--dbc", "nope.dbc"]) == 2
    assert "; databases in that folder: mine.dbc\n" in capsys.readouterr().err


def test_without_a_terminal_nothing_is_taken_silently(tmp_path, capsys, monkeypatch):
    monkeypatch.setattr(sys, "stdin", StringIO(""))
    out = tmp_path / "tram.toml"
    assert main(["init", "--dbc", str(TRAM), "--out", str(out)]) == 2
    line = capsys.readouterr().err
    assert line.count("\n") == 1
    assert "12 roles guessed" in line
    assert "pass --yes" in line
    assert not out.exists()


def test_rivals_are_asked_and_empty_answers_leave_them_open(tmp_path, monkeypatch, capsys):
    dbc, out = tmp_path / "two.dbc", tmp_path / "two.toml"
    rival = ' SG_ v_Zug : 24|16@1+ (0.1,0) [0|320] "km/h" Vector__XXX\n SG_ Fahrtrichtung'
    dbc.write_text(TRAM.read_text().replace(" SG_ Fahrtrichtung", rival, 1))
    monkeypatch.setattr(sys, "stdin", Terminal("7\n2\n0.33\nabc\n90000\n60\n\n"))
    assert main(["init", "--dbc", str(dbc), "--out", str(out)]) == 0
    asked = capsys.readouterr().err
    assert "1  GW_Odometrie.v_Fzg (km/h, 0 to 320)" in asked
    document = tomllib.loads(out.read_text())
    assert document["roles"]["vehicle_speed"] == "GW_Odometrie.v_Zug"
    assert document["vehicle"]["axle_load_N"] == 90000
    assert document["vehicle"]["train_mass_kg"] == "fill in"
    monkeypatch.setattr(sys, "stdin", Terminal(""))
    assert main(["init", "--dbc", str(dbc), "--out", str(out), "--overwrite"]) == 0
    assert "vehicle_speed" not in tomllib.loads(out.read_text())["roles"]
    assert "# vehicle_speed: unclear; uncomment the right line, if any" in out.read_text()


# --- motors that drive two axles, and what is left over


@pytest.fixture
def motors(tmp_path):
    """Two motors for four axles."""
    path = tmp_path / "motors.dbc"
    wheels = "".join(f' SG_ Wheel{k} : {16 * k - 16}|16@1+ (0.1,0) [0|3000] "rpm" X\n'
                     for k in (1, 2, 3, 4))  # fmt: skip
    text = 'VERSION ""\nNS_ :\nBS_:\nBU_: X\nBO_ 256 Odo: 8 X\n'
    text += ' SG_ TrainSpeed : 0|16@1+ (0.01,0) [0|120] "km/h" X\n'
    text += f"BO_ 257 Axles: 8 X\n{wheels}"
    for k in (1, 2):
        text += f"BO_ {257 + k} Motor{k}: 8 X\n"
        text += f' SG_ Mot{k}_Effort : 0|16@1- (0.01,0) [-100|100] "kN" X\n'
        text += f' SG_ Mot{k}_Torque : 16|16@1- (1,0) [-9000|9000] "Nm" X\n'
    path.write_text(text + 'BA_DEF_ BO_ "GenMsgCycleTime" INT 0 10000;\n'
                    'BA_DEF_DEF_ "GenMsgCycleTime" 20;\n')  # fmt: skip
    return path


def test_efforts_of_motors_are_written_commented_with_the_factor(motors, tmp_path, capsys):
    out = tmp_path / "motors.toml"
    assert main(["init", "--dbc", str(motors), "--yes", "--out", str(out), *VEHICLE]) == 0
    said = capsys.readouterr().err
    assert "not assigned: 2 motor efforts for 4 axles; missing tractive_effort.1" in said
    assert "2 signals not used: Motor1.Mot1_Torque, Motor2.Mot2_Torque" in said
    text = out.read_text()
    assert "tractive_effort" not in tomllib.loads(text)["roles"]
    assert "# tractive_effort: 2 motor efforts for 4 axles." in text
    assert "#   Motor2: Mot2_Torque (Nm)" in text
    out.write_text(text.replace('# "tractive_effort', '"tractive_effort'))
    config = load_configuration(out)
    scales = {s.name: s.scale for m in config.messages for s in m.signals}
    assert [scales[f"tractive_effort.{k}"] for k in (1, 2, 3, 4)] == [500.0] * 4
    config.require_identification()


def test_a_yes_gives_each_axle_its_share(motors, tmp_path, monkeypatch, capsys):
    out = tmp_path / "motors.toml"
    words = ["init", "--dbc", str(motors), "--out", str(out), *VEHICLE]
    monkeypatch.setattr(sys, "stdin", Terminal("y\n"))
    assert main(words) == 0
    assert "does each drive 2 axles, in this order" in capsys.readouterr().err
    roles = tomllib.loads(out.read_text())["roles"]
    assert roles["tractive_effort.3"] == {"signal": "Motor2.Mot2_Effort", "factor": 0.5}
    monkeypatch.setattr(sys, "stdin", Terminal("\n"))
    assert main([*words, "--overwrite"]) == 0
    assert "tractive_effort.3" not in tomllib.loads(out.read_text())["roles"]


def test_a_role_that_is_not_found_has_its_candidates(motors, tmp_path, capsys):
    motors.write_text(motors.read_text().replace("TrainSpeed", "Reading"))
    out = tmp_path / "motors.toml"
    assert main(["init", "--dbc", str(motors), "--yes", "--out", str(out)]) == 0
    assert "vehicle_speed not found; candidates: Odo.Reading (km/h)\n" in capsys.readouterr().err
    assert "#   candidates: Odo.Reading (km/h)\n" in out.read_text()


def test_numbers_are_asked_for_with_examples(motors, tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(sys, "stdin", Terminal("\n" * 9))
    assert main(["init", "--dbc", str(motors), "--out", str(tmp_path / "motors.toml")]) == 0
    asked = capsys.readouterr().err
    for example in ("0.33", "90e3", "60", "40e3"):
        assert f", such as {example} (tram) or " in asked


def test_the_database_of_the_example_is_found(tmp_path):
    example = Path(__file__).resolve().parents[2] / "docs" / "examples" / "own_database.py"
    dbc, out = tmp_path / "own.dbc", tmp_path / "own.toml"
    dbc.write_text(runpy.run_path(str(example))["DATABASE"])
    assert main(["init", "--dbc", str(dbc), "--yes", "--out", str(out), *VEHICLE]) == 0
    load_configuration(out).require_identification()
    assert {choice.name for choice in load_configuration(out).choices} == {
        "vehicle_speed",
        *(f"{role}.{axle}" for role in ("wheel_speed", "tractive_effort") for axle in (1, 2, 3, 4)),
    }


@pytest.mark.parametrize(("load", "bias"), [("92e3", "376"), ("245e3", "1000")])
def test_errors_of_the_instruments_stand_with_the_values_that_hold(tmp_path, load, bias):
    out = tmp_path / "own.toml"
    given = [load if word == "90e3" else word for word in VEHICLE]
    words = ["init", "--dbc", str(TRAM), "--yes", "--out", str(out), *given]
    assert main(words) == 0
    text = out.read_text()
    assert "[instruments]\nspeed_error_std = 0.003 " in text
    assert f"# effort_bias_std = {bias} " in text
    stated = text.replace("# effort_bias_std", "effort_bias_std")
    (tmp_path / "stated.toml").write_text(stated)
    assert load_configuration(tmp_path / "stated.toml").estimators.instruments.used_bias_std > 0


def test_an_error_in_proportion_to_an_unknown_load_has_no_number(tmp_path):
    out = tmp_path / "own.toml"
    assert main(["init", "--dbc", str(TRAM), "--yes", "--out", str(out)]) == 0
    assert (
        "# effort_bias_std = ..  # N; without this line 0.41 % of the axle load" in out.read_text()
    )


def test_a_file_with_edits_in_it_is_not_replaced(tmp_path, capsys):
    out = tmp_path / "own.toml"
    words = ["init", "--dbc", str(TRAM), "--yes", "--out", str(out)]
    assert main(words) == 0
    out.write_text(edited := out.read_text() + "# mine\n")
    assert main(words) == 2
    assert f"--out {out}: exists, and may have your edits" in capsys.readouterr().err
    assert out.read_text() == edited
    assert main([*words, "--overwrite"]) == 0
    assert "# mine" not in out.read_text()
