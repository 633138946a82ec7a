"""Efforts and loads that are distinguished by name, range and number, or asked."""

import cantools
import pytest

from adhesion_can.bus.axle_numbers import LETTER_DOUBT
from adhesion_can.bus.guess_roles import FORCE_DOUBT, WHEEL_LOAD_DOUBT, guess_roles
from adhesion_can.bus.role_candidates import candidates, torques
from adhesion_can.bus.shared_signals import distribute
from adhesion_can.bus.signal_signs import Signs, signs_of
from adhesion_can.physics.readings import Role

BOTH, POSITIVE, UNSTATED = "- -60 60", "+ 0 300", "- 0 0"
WHEELS = ("Wheels", [(f"nAxle{k}", "1/min", "+ 0 3000") for k in (1, 2, 3, 4)])
SPEED = ("Odo", [("TrainSpeed", "km/h", "+ 0 120")])


def database(*messages):
    """Messages of (name, [(signal, unit, 'SIGN LOW HIGH')]); signals of 16 bits."""
    text = 'VERSION ""\n\nNS_ :\n\nBS_:\n\nBU_: ECU\n'
    for number, (name, signals) in enumerate(messages):
        text += f"\nBO_ {256 + number} {name}: 8 ECU\n"
        for place, (signal, unit, values) in enumerate(signals):
            sign, low, high = values.split()
            text += f' SG_ {signal} : {16 * place}|16@1{sign} (0.01,0) [{low}|{high}] "{unit}" X\n'
    return cantools.database.load_string(text, "dbc", strict=False).messages


def forces(pattern, values, count=4, unit="kN"):
    return ("F", [(pattern.format(k), unit, values) for k in range(1, count + 1)])


def taken(guessed, role):
    return [guess.place for guess in guessed.taken if guess.role is role]


@pytest.mark.parametrize(
    ("values", "signs"),
    [(BOTH, Signs.BOTH), (POSITIVE, Signs.POSITIVE), (UNSTATED, Signs.UNKNOWN),
     ("- -5 300", Signs.POSITIVE), ("+ 0 0", Signs.POSITIVE), ("- 0 300", Signs.POSITIVE)],
)  # fmt: skip
def test_signs_are_those_of_the_stated_range_else_of_the_bits(values, signs):
    (message,) = database(("M", [("a", "kN", values)]))
    assert signs_of(message.signals[0]) is signs


def test_an_fz_with_negative_values_is_an_effort_and_no_load():
    guessed = guess_roles(database(WHEELS, SPEED, forces("FzAct_Axle{}", BOTH)))
    assert taken(guessed, Role.TRACTIVE_EFFORT) == [f"F.FzAct_Axle{k}" for k in (1, 2, 3, 4)]
    assert taken(guessed, Role.AXLE_LOAD) == []
    assert guessed.rivals == {}


def test_an_fz_without_negative_values_is_a_load():
    guessed = guess_roles(database(WHEELS, SPEED, forces("Fz_Ax{}", POSITIVE)))
    assert taken(guessed, Role.AXLE_LOAD) == [f"F.Fz_Ax{k}" for k in (1, 2, 3, 4)]
    assert taken(guessed, Role.TRACTIVE_EFFORT) == []


def test_an_fz_without_a_range_is_asked():
    guessed = guess_roles(database(WHEELS, SPEED, forces("Fz_Ax{}", UNSTATED)))
    assert taken(guessed, Role.AXLE_LOAD) == taken(guessed, Role.TRACTIVE_EFFORT) == []
    assert [name for name in guessed.rivals if name.endswith(".1")] == [
        "tractive_effort.1",
        "axle_load.1",
    ]
    assert guessed.rivals["tractive_effort.1"][0].doubts == ("also fits axle_load",)


def test_any_force_without_negative_values_is_asked():
    guessed = guess_roles(database(WHEELS, SPEED, forces("Kraft_{}", POSITIVE)))
    assert taken(guessed, Role.AXLE_LOAD) == taken(guessed, Role.TRACTIVE_EFFORT) == []
    assert FORCE_DOUBT in guessed.rivals["tractive_effort.1"][0].doubts


def test_a_load_with_negative_values_is_none():
    guessed = guess_roles(database(WHEELS, SPEED, forces("AxleLoad_{}", BOTH)))
    assert taken(guessed, Role.AXLE_LOAD) == []
    assert "axle_load.1" not in guessed.rivals


@pytest.mark.parametrize("pattern", ["LoadBogie{}", "Last_DG{}", "ChargeBogie{}", "Load_{}"])
def test_loads_of_bogies_are_no_loads_of_axles(pattern):
    guessed = guess_roles(database(WHEELS, SPEED, forces(pattern, POSITIVE, 2)))
    assert taken(guessed, Role.AXLE_LOAD) == []
    assert "axle_load.1" not in guessed.rivals
    shared = guessed.shared_of(Role.AXLE_LOAD)
    assert [guess.axle for guess in shared] == [1, 2]
    assert [(g.axle, g.share) for g in distribute(shared, 4)] == [(k, 0.5) for k in (1, 2, 3, 4)]


def test_a_load_that_names_a_bogie_is_asked_for_as_many_axles_too():
    guessed = guess_roles(database(WHEELS, SPEED, forces("BogieLoad{}", POSITIVE, 4)))
    assert taken(guessed, Role.AXLE_LOAD) == []
    assert {g.share for g in distribute(guessed.shared_of(Role.AXLE_LOAD), 4)} == {1.0}


def test_the_load_of_a_wheel_is_asked_and_counts_twice():
    guessed = guess_roles(database(WHEELS, SPEED, forces("Radlast{}", POSITIVE)))
    assert taken(guessed, Role.AXLE_LOAD) == []
    (rival,) = guessed.rivals["axle_load.2"]
    assert (rival.doubts, rival.share) == ((WHEEL_LOAD_DOUBT,), 2.0)


def test_the_mass_of_the_vehicle_is_no_load():
    guessed = guess_roles(database(WHEELS, SPEED, forces("Fzg_Masse_{}", POSITIVE, 2, "t")))
    assert taken(guessed, Role.AXLE_LOAD) == []
    assert guessed.shared == ()


def test_a_braking_effort_in_french_is_no_effort():
    names = [("EffortMoteur1", "kN", BOTH), ("EffortMoteur2", "kN", BOTH),
             ("EffortFrein1", "kN", POSITIVE), ("EffortConsigne2", "kN", BOTH)]  # fmt: skip
    wheels = ("V", [("VitesseEssieu1", "tr/min", POSITIVE), ("VitesseEssieu2", "tr/min", POSITIVE)])
    guessed = guess_roles(database(wheels, SPEED, ("BOGIE_Traction", names)))
    assert taken(guessed, Role.TRACTIVE_EFFORT) == [
        "BOGIE_Traction.EffortMoteur1",
        "BOGIE_Traction.EffortMoteur2",
    ]
    assert guessed.rivals == {}


def test_an_effort_without_a_number_is_that_of_all_axles():
    signals = [("TractiveEffort", "kN", BOTH), ("BogieLoad", "kN", POSITIVE)]
    guessed = guess_roles(database(WHEELS, SPEED, ("BCU", signals)))
    assert taken(guessed, Role.TRACTIVE_EFFORT) == taken(guessed, Role.AXLE_LOAD) == []
    for role in (Role.TRACTIVE_EFFORT, Role.AXLE_LOAD):
        assert {guess.share for guess in distribute(guessed.shared_of(role), 4)} == {0.25}


def test_letters_are_asked_as_numbers():
    wheels = ("Rad", [(f"Rad_{letter}", "km/h", POSITIVE) for letter in "ABCD"])
    guessed = guess_roles(database(wheels, SPEED, forces("M{}_Zugkraft", BOTH, 2)))
    assert [rival.place for k in (1, 2, 3, 4) for rival in guessed.rivals[f"wheel_speed.{k}"]] == [
        f"Rad.Rad_{letter}" for letter in "ABCD"
    ]
    assert guessed.rivals["wheel_speed.4"][0].doubts == (LETTER_DOUBT,)
    assert taken(guessed, Role.TRACTIVE_EFFORT) == []
    assert len(guessed.shared) == 2


def test_a_lone_letter_is_no_number():
    guessed = guess_roles(database(("Rad", [("Rad_A", "km/h", POSITIVE)])))
    assert guessed.rivals == {}


def test_axles_that_each_bogie_counts_from_1_are_counted_through_and_asked():
    signals = [("v_Achse1", "km/h", POSITIVE), ("v_Achse2", "km/h", POSITIVE)]
    guessed = guess_roles(database(("DG1_Antrieb", signals), ("DG2_Antrieb", signals)))
    assert guessed.taken == ()
    assert [guessed.rivals[f"wheel_speed.{k}"][0].place for k in (1, 2, 3, 4)] == [
        "DG1_Antrieb.v_Achse1",
        "DG1_Antrieb.v_Achse2",
        "DG2_Antrieb.v_Achse1",
        "DG2_Antrieb.v_Achse2",
    ]
    assert all(len(guessed.rivals[f"wheel_speed.{k}"]) == 1 for k in (1, 2, 3, 4))


def test_candidates_that_another_role_took_are_named_with_it_last():
    messages = database(WHEELS, SPEED, forces("Achslast_{}", POSITIVE), ("X", [("Y", "N", BOTH)]))
    found = candidates(messages, guess_roles(messages), Role.TRACTIVE_EFFORT)
    assert [(one.place, one.uses) for one in found] == [
        ("X.Y", ()),
        *((f"F.Achslast_{k}", (f"taken for axle_load.{k}",)) for k in (1, 2, 3, 4)),
    ]


def test_torques_are_found_by_their_unit():
    messages = database(("M", [("Trq1", "Nm", BOTH), ("Trq2", "N·m", BOTH), ("F", "N", BOTH)]))
    assert torques(messages) == ["M.Trq1", "M.Trq2"]
