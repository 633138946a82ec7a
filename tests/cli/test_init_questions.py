"""`init`: what it asks about signals, and what it says of an answer that it cannot use."""

import sys
import tomllib

import pytest

from adhesion_can import simulate
from adhesion_can.cli.main import main
from adhesion_can.config import load_configuration
from tests.cli.init_dialogue import VEHICLE, Terminal


def database(path, *messages):
    """Messages of (name, ['NAME SIGN LOW HIGH UNIT']); signals of 16 bits, cycles of 20 ms."""
    text = 'VERSION ""\nNS_ :\nBS_:\nBU_: X\n'
    for number, (name, signals) in enumerate(messages):
        text += f"BO_ {256 + number} {name}: 8 X\n"
        for place, signal in enumerate(signals):
            word, sign, low, high, unit = signal.split()
            text += f' SG_ {word} : {16 * place}|16@1{sign} (0.01,0) [{low}|{high}] "{unit}" X\n'
    text += 'BA_DEF_ BO_ "GenMsgCycleTime" INT 0 10000;\nBA_DEF_DEF_ "GenMsgCycleTime" 20;\n'
    path.write_text(text)
    return path


TRAM = (
    ("Wheels", [f"nAxle{k} + 0 3000 1/min" for k in (1, 2, 3, 4)]),
    ("Motors", [f"FzAct_Axle{k} - -60 60 kN" for k in (1, 2, 3, 4)]),
    ("State", ["vGround + 0 100 km/h", "LoadBogie1 + 0 300 kN", "LoadBogie2 + 0 300 kN"]),
)
BOGIE = (
    ("ASR_Ist", ["M1_Zugkraft - -100 100 kN", "M2_Zugkraft - -100 100 kN"]),
    ("ASR_Rad", [f"Rad_{letter} + 0 120 km/h" for letter in "ABCD"]),
    ("FSG_Fzg", ["v_Fzg + 0 120 km/h"]),
)
RIG = (
    ("A", ["nA + 0 3000 rpm", "nB + 0 3000 rpm"]),
    ("F", ["FxA - -80 80 kN", "FxB - -80 80 kN", "FzA + 0 300 kN", "FzB + 0 300 kN"]),
    ("V", ["v + 0 120 km/h"]),
)
BARE = (
    ("W", ["Wheel1 + 0 3000 rpm", "Wheel2 + 0 3000 rpm"]),
    ("L", ["AxleLoad1 + 0 300 kN", "AxleLoad2 + 0 300 kN", "Mot_Trq - -900 900 Nm"]),
)


SILENT = (("Fast", ["Wheel1 + 0 3000 rpm"]), ("Slow", ["vGround + 0 120 km/h"]))


def answer(tmp_path, monkeypatch, capsys, messages, *lines, options=VEHICLE):
    """Roles of the file, the file and what was said, for typed lines."""
    dbc, out = database(tmp_path / "own.dbc", *messages), tmp_path / "own.toml"
    monkeypatch.setattr(sys, "stdin", Terminal("".join(f"{line}\n" for line in lines)))
    words = ["init", "--dbc", str(dbc), "--out", str(out), "--overwrite", *options]
    assert main(words) == 0
    return tomllib.loads(out.read_text())["roles"], out, capsys.readouterr().err


def test_the_loads_of_bogies_are_distributed_after_a_yes(tmp_path, monkeypatch, capsys):
    roles, out, said = answer(tmp_path, monkeypatch, capsys, TRAM, "y")
    assert "2 bogie loads for 4 axles: State.LoadBogie1, State.LoadBogie2 (kN, 0 to 300)" in said
    assert "does each carry 2 axles, in this order, with equal shares?" in said
    assert roles["axle_load.3"] == {"signal": "State.LoadBogie2", "factor": 0.5}
    assert roles["tractive_effort.3"] == "Motors.FzAct_Axle3"
    config = load_configuration(out)
    scales = {s.name: s.scale for m in config.messages for s in m.signals}
    assert (scales["axle_load.1"], scales["tractive_effort.1"]) == (500.0, 1000.0)
    roles, out, _ = answer(tmp_path, monkeypatch, capsys, TRAM, "n")
    assert "axle_load.1" not in roles
    assert '# "axle_load.1" = { signal = "State.LoadBogie1", factor = 0.5 }' in out.read_text()


def test_letters_are_one_question_for_all_axles(tmp_path, monkeypatch, capsys):
    roles, out, said = answer(tmp_path, monkeypatch, capsys, BOGIE, "y", "y")
    assert said.count("take them, in this order?") == 1
    assert "ASR_Rad.Rad_D (km/h, 0 to 120): letters A, B, .. counted as 1, 2, .." in said
    assert roles["wheel_speed.4"] == "ASR_Rad.Rad_D"
    assert roles["tractive_effort.4"] == {"signal": "ASR_Ist.M2_Zugkraft", "factor": 0.5}
    load_configuration(out).require_identification()
    roles, out, _ = answer(tmp_path, monkeypatch, capsys, BOGIE)
    assert "wheel_speed.1" not in roles
    assert '# "tractive_effort.3" = { signal = "ASR_Ist.M2_Zugkraft", factor = 0.5 }' in (
        out.read_text()
    )


def test_a_needed_role_is_chosen_from_its_candidates(tmp_path, monkeypatch, capsys):
    roles, out, said = answer(tmp_path, monkeypatch, capsys, RIG, "y", "y", "2 1", "1")
    assert "wheel_speed: these signals have its unit\n  1  A.nA (rpm)" in said
    assert (roles["wheel_speed.1"], roles["wheel_speed.2"]) == ("A.nB", "A.nA")
    assert roles["vehicle_speed"] == "V.v"
    assert '"vehicle_speed" = "V.v"  # chosen\n' in out.read_text()
    assert load_configuration(out).vehicle.axles == 2


def test_after_a_no_another_order_is_chosen(tmp_path, monkeypatch, capsys):
    roles, out, said = answer(tmp_path, monkeypatch, capsys, BOGIE, "n", "4 3 2 1", "y")
    assert "  1  ASR_Rad.Rad_A (km/h)\n" in said
    assert roles["wheel_speed.1"] == "ASR_Rad.Rad_D"
    assert roles["tractive_effort.2"] == {"signal": "ASR_Ist.M1_Zugkraft", "factor": 0.5}
    assert "unclear" not in out.read_text()


def test_a_signal_chosen_for_a_role_loses_the_one_that_took_it(tmp_path, monkeypatch, capsys):
    roles, _, said = answer(tmp_path, monkeypatch, capsys, BARE, "1 2")
    assert "  1  L.AxleLoad1 (kN, also taken for axle_load.1)" in said
    assert "L.AxleLoad1 is then not taken for axle_load.1" in said
    assert roles["tractive_effort.2"] == "L.AxleLoad2"
    assert "axle_load.2" not in roles


def test_fewer_chosen_efforts_than_axles_are_asked_for_their_share(tmp_path, monkeypatch, capsys):
    roles, _, said = answer(tmp_path, monkeypatch, capsys, BARE, "2", "y")
    assert "1 effort for 2 axles: L.AxleLoad2" in said
    assert roles["tractive_effort.1"] == {"signal": "L.AxleLoad2", "factor": 0.5}


def test_after_a_no_to_equal_shares_another_order_is_chosen(tmp_path, monkeypatch, capsys):
    lines = ("y", "n", "2 1", "y")
    roles, _, said = answer(tmp_path, monkeypatch, capsys, BOGIE, *lines)
    assert said.count("does each drive 2 axles") == 2
    assert "is then not taken" not in said
    assert roles["tractive_effort.1"] == {"signal": "ASR_Ist.M2_Zugkraft", "factor": 0.5}
    assert roles["tractive_effort.3"] == {"signal": "ASR_Ist.M1_Zugkraft", "factor": 0.5}


def test_axles_that_count_from_0_are_asked_one_by_one(tmp_path, monkeypatch, capsys):
    wheels = ("W", [f"WheelSpeed_{k} + 0 3000 rpm" for k in range(3)])
    lines = ("1", "1", "y", "", "2")
    roles, _, said = answer(tmp_path, monkeypatch, capsys, (wheels, BARE[1], RIG[2]), *lines)
    assert "wheel_speed.1 may be\n  1  W.WheelSpeed_0 (rpm, 0 to 3000)" in said
    assert [roles[f"wheel_speed.{k}"] for k in (1, 2, 3)] == [f"W.WheelSpeed_{k}" for k in range(3)]


def test_without_answers_the_candidates_are_named_with_what_took_them(tmp_path, capsys):
    dbc = database(tmp_path / "own.dbc", *BARE)
    assert main(["init", "--dbc", str(dbc), "--yes"]) == 0
    said = capsys.readouterr().err
    assert "candidates: L.AxleLoad1 (kN, also taken for axle_load.1), L.AxleLoad2" in said
    assert 'L.Mot_Trq: a torque gives an effort with unit = "N" and factor =' in said


def test_a_missing_unit_is_named(tmp_path, capsys):
    dbc = database(tmp_path / "own.dbc", ("V", ["Speed + 0 100 km/h"]))
    assert main(["init", "--dbc", str(dbc), "--yes"]) == 0
    said = capsys.readouterr().err
    assert "tractive_effort not found; candidates: no signal has a unit that fits (N, daN" in said


def test_an_effort_without_negative_values_is_said(tmp_path, capsys):
    efforts = ("F", ["Effort_Ax1 + 0 100 kN", "Effort_Ax2 + 0 100 kN"])
    dbc, out = database(tmp_path / "own.dbc", BARE[0], efforts), tmp_path / "own.toml"
    assert main(["init", "--dbc", str(dbc), "--yes", "--out", str(out)]) == 0
    said = capsys.readouterr().err
    assert "F.Effort_Ax1, F.Effort_Ax2: cannot be negative; check the sign in braking" in said
    assert "its values cannot be negative" in out.read_text()


@pytest.mark.parametrize(
    ("typed", "said"),
    [
        ("0,46", "'0,46': has a decimal comma; type 0.46\n"),
        ("0.46 m", "'0.46 m': has more than a number; type it in m without the unit, for example"),
        ("460 mm", "'460 mm': type it in m: 0.46\n"),
        (
            "460",
            "'460': 460 m is above any wheel radius (0.1 to 1.3 m); type 0.46 for 460 mm, or 460",
        ),
        ("0.46 0.45", "'0.46 0.45': several numbers; type one for all axles, for example 0.33"),
        ("small", "'small': not a number; type one in m, for example 0.33\n"),
        ("-1", "'-1': not above 0; type for example 0.33\n"),
        ("nan", "'nan': not above 0; type for example 0.33\n"),
    ],
)
def test_each_repeat_of_a_number_says_what_was_wrong(tmp_path, monkeypatch, capsys, typed, said):
    lines = ("n", typed, "0.5")
    _, out, asked = answer(tmp_path, monkeypatch, capsys, TRAM, *lines, options=VEHICLE[2:])
    assert said in asked
    assert asked.count("wheel_radius_m: radius") == 2
    assert tomllib.loads(out.read_text())["vehicle"]["wheel_radius_m"] == 0.5


@pytest.mark.parametrize(
    ("messages", "lines", "said"),
    [
        (TRAM, ["ja", "y"], "'ja': neither yes nor no; type y, n, or Enter for later"),
        (RIG, ["y", "y", "9", "1 2", "1"], "'9': not a number of the list (from 1 to 2); type"),
        (RIG, ["y", "y", "1 1", "1 2", "1"], "'1 1': has a number twice; type each once, for"),
        (RIG, ["y", "y", "1 2", "1 1 ", "1"], "'1 1': has a number twice"),
        (RIG, ["n", "", "", "", "2,5"], "'2,5': not a number of the list (from 1 to 4)"),
        (RIG, ["y", "y", "1", "1 1"], "'1 1': has a number twice"),
        (BOGIE, ["1 2", "y", "y"], "'1 2': neither yes nor no"),
    ],
)
def test_each_repeat_of_a_choice_says_what_was_wrong(
    tmp_path, monkeypatch, capsys, messages, lines, said
):
    _, _, asked = answer(tmp_path, monkeypatch, capsys, messages, *lines)
    assert said in asked


@pytest.mark.parametrize("typed", ["2.5", "0", "four", "65"])
def test_a_number_of_axles_is_whole(tmp_path, monkeypatch, capsys, typed):
    messages = (("F", ["Force - -100 100 kN"]), ("V", ["vVeh + 0 100 km/h"]))
    _, out, asked = answer(tmp_path, monkeypatch, capsys, messages, typed, "2", "")
    assert f"'{typed}': not a whole number from 1 to 64; type for example 4" in asked
    assert tomllib.loads(out.read_text())["vehicle"]["axles"] == 2


@pytest.mark.parametrize(
    ("skipped", "typed", "said"),
    [
        (2, "92", "92 N is below any axle load (1 to 500 kN); type 92e3 for 92 kN, or 92 again to"),
        (2, "9.2", "type 9.2e3 for 9.2 kN or 90.22e3 for 9.2 t, or"),
        (2, "368e4", "type the load of one axle, not of the vehicle, for example 90e3, or 368e4"),
        (2, "92 kN", "'92 kN': type it in N: 92e3\n"),
        (
            4,
            "92000",
            "and may be the axle load in N or the mass of a train in kg; type for example 60",
        ),
        (
            6,
            "37.5",
            "37.5 kg is below any mass of a train (0.3 t to 200 000 t); type 37.5e3 for 37.5 t",
        ),
        (6, "1650", "less than the 36710 kg that the axles carry; type 1650e3 for 1650 t, or 1650"),
        (
            6,
            "20e3",
            "less than the 36710 kg that the axles carry; type 36.8e3 or more, or 20e3 again",
        ),
    ],
)
def test_a_number_that_no_vehicle_has_is_asked_again(
    tmp_path, monkeypatch, capsys, skipped, typed, said
):
    key = VEHICLE[skipped]
    options = [*VEHICLE[:skipped], *VEHICLE[skipped + 2 :]]
    kept = VEHICLE[skipped + 1]
    _, out, asked = answer(tmp_path, monkeypatch, capsys, TRAM, "n", typed, kept, options=options)
    assert said in asked, key
    assert float(kept) in tomllib.loads(out.read_text())["vehicle"].values()


def test_an_unusual_number_is_kept_where_it_is_typed_twice(tmp_path, monkeypatch, capsys):
    lines = ("n", "2.0", "2.0")
    _, out, _ = answer(tmp_path, monkeypatch, capsys, TRAM, *lines, options=VEHICLE[2:])
    assert tomllib.loads(out.read_text())["vehicle"]["wheel_radius_m"] == 2.0


def test_cycles_that_the_database_lacks_are_asked_once_for_each_message(
    tmp_path, monkeypatch, capsys
):
    dbc, out = database(tmp_path / "own.dbc", *SILENT), tmp_path / "own.toml"
    dbc.write_text(dbc.read_text().replace('"GenMsgCycleTime" 20', '"GenMsgCycleTime" 0'))
    monkeypatch.setattr(sys, "stdin", Terminal("0\n20\n\n"))
    assert main(["init", "--dbc", str(dbc), "--out", str(out), *VEHICLE]) == 0
    said = capsys.readouterr().err
    assert "'0': not from 0.1 to 100000 ms; type for example 20" in said
    assert "no cycle of Slow" in said
    text = out.read_text()
    roles = tomllib.loads(text)["roles"]
    assert roles["wheel_speed.1"] == {"signal": "Fast.Wheel1", "cycle_ms": 20}
    assert roles["vehicle_speed"] == "Slow.vGround"
    assert text.count("The database has no cycle of Slow.\n") == 1


@pytest.mark.parametrize("agreed", ["y", "n"])
def test_shared_motors_get_a_second_file_that_can_be_simulated(
    tmp_path, monkeypatch, capsys, agreed
):
    roles, out, said = answer(tmp_path, monkeypatch, capsys, BOGIE, "y", "y", agreed)
    second = out.with_name("own_simulate.toml")
    assert f"write {second} for it, with the first axle of each?" in said
    assert roles["tractive_effort.4"] == {"signal": "ASR_Ist.M2_Zugkraft", "factor": 0.5}
    assert second.exists() == (agreed == "y")
    if agreed == "y":
        assert (
            "axles = 2  # axles 1 and 3 of the vehicle: one of each motor\n" in second.read_text()
        )
        mapped = tomllib.loads(second.read_text())["roles"]
        assert mapped["wheel_speed.2"] == "ASR_Rad.Rad_C"
        assert mapped["tractive_effort.2"] == {"signal": "ASR_Ist.M2_Zugkraft", "factor": 0.5}
        assert simulate("dry", 0.1, configuration=second).frames


def test_a_second_file_with_edits_is_kept(tmp_path, monkeypatch, capsys):
    dbc, out = database(tmp_path / "own.dbc", *BOGIE), tmp_path / "own.toml"
    second = tmp_path / "own_simulate.toml"
    second.write_text("# mine\n")
    monkeypatch.setattr(sys, "stdin", Terminal("y\ny\ny\n"))
    assert main(["init", "--dbc", str(dbc), "--out", str(out), *VEHICLE]) == 0
    assert f"{second}: exists, and may have your edits" in capsys.readouterr().err
    assert second.read_text() == "# mine\n"


def test_without_answers_the_roles_for_a_simulation_are_commented(tmp_path):
    """Wheels with numbers are clear; the efforts of two motors for them have to be asked."""
    wheels = ("W", [f"Wheel{axle} + 0 3000 rpm" for axle in (1, 2, 3, 4)])
    dbc, out = database(tmp_path / "own.dbc", wheels, BOGIE[0], BOGIE[2]), tmp_path / "own.toml"
    assert main(["init", "--dbc", str(dbc), "--out", str(out), "--yes", *VEHICLE]) == 0
    _, found, section = out.read_text().partition("keep only these roles of axles 1 and 3:\n")
    assert found
    lines = [line.removeprefix("#   ") for line in section.splitlines()[:4]]
    assert tomllib.loads("\n".join(lines)) == {
        "wheel_speed.1": "W.Wheel1",
        "wheel_speed.2": "W.Wheel3",
        "tractive_effort.1": {"signal": "ASR_Ist.M1_Zugkraft", "factor": 0.5},
        "tractive_effort.2": {"signal": "ASR_Ist.M2_Zugkraft", "factor": 0.5},
    }
