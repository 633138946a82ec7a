"""Roles guessed from names, units and value tables; a false guess is worse than none."""

import cantools
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from adhesion_can.bus.database import load_database
from adhesion_can.bus.guess_roles import guess_roles
from adhesion_can.bus.role_candidates import candidates, unused_signals
from adhesion_can.bus.roles import packaged_choices
from adhesion_can.bus.shared_signals import distribute
from adhesion_can.physics.readings import Role


def database(*messages):
    """Messages of (name, [(signal, unit)]); signals of 16 bits."""
    text = 'VERSION ""\n\nNS_ :\n\nBS_:\n\nBU_: ECU\n'
    for number, (name, signals) in enumerate(messages):
        text += f"\nBO_ {256 + number} {name}: {2 * len(signals)} ECU\n"
        for place, (signal, unit) in enumerate(signals):
            text += f' SG_ {signal} : {16 * place}|16@1- (0.1,0) [0|0] "{unit}" Vector__XXX\n'
    return cantools.database.load_string(text, "dbc", strict=False).messages


def places(guessed):
    return {guess.name: guess.place for guess in guessed.taken}


def test_our_own_database_is_guessed_whole():
    guessed = guess_roles(load_database().db.messages)
    assert places(guessed) == {c.name: f"{c.message}.{c.signal}" for c in packaged_choices()}
    assert guessed.rivals == {}


@pytest.mark.parametrize(
    ("messages", "wanted"),
    [
        (
            [("PWR", [("V_AX_1", "km/h"), ("V_AX_2", "km/h"),
                      ("TE_AX_1", "kN"), ("TE_AX_2", "kN")]),
             ("NAV", [("GroundSpeed", "m/s")])],
            {"wheel_speed.1": "PWR.V_AX_1", "wheel_speed.2": "PWR.V_AX_2",
             "tractive_effort.1": "PWR.TE_AX_1", "tractive_effort.2": "PWR.TE_AX_2",
             "vehicle_speed": "NAV.GroundSpeed"},
        ),
        (
            [("Axle1", [("Speed", "rpm")]), ("Axle2", [("Speed", "rpm")]),
             ("Drive1", [("Force", "kN")]), ("Drive2", [("Force", "kN")]),
             ("Odometer", [("Velocity", "km/h")])],
            {"wheel_speed.1": "Axle1.Speed", "wheel_speed.2": "Axle2.Speed",
             "tractive_effort.1": "Drive1.Force", "tractive_effort.2": "Drive2.Force",
             "vehicle_speed": "Odometer.Velocity"},
        ),
        (
            [("WhlSpdFront", [("WhlSpd1", "rad/s"), ("WhlSpd2", "rad/s")]),
             ("Fahrzeug", [("v_ist", "km/h"), ("v_soll", "km/h")]),
             ("Lasten", [("Achslast_1", "t"), ("Achslast_2", "t")])],
            {"wheel_speed.1": "WhlSpdFront.WhlSpd1", "wheel_speed.2": "WhlSpdFront.WhlSpd2",
             "vehicle_speed": "Fahrzeug.v_ist", "axle_load.1": "Lasten.Achslast_1",
             "axle_load.2": "Lasten.Achslast_2"},
        ),
        (
            [("BCU", [("RadsatzDrehzahl_1", "1/min"), ("RadsatzDrehzahl_2", "1/min")]),
             ("Bogies", [("Bogie1_Ax1_omega", "rad/s"), ("Bogie2_Ax3_omega", "rad/s")])],
            {"wheel_speed.2": "BCU.RadsatzDrehzahl_2", "wheel_speed.3": "Bogies.Bogie2_Ax3_omega"},
        ),
    ],
)  # fmt: skip
def test_names_of_other_houses(messages, wanted):
    assert places(guess_roles(database(*messages))) == wanted


@pytest.mark.parametrize(
    "signals",
    [
        [("n_Motor_1", "rpm"), ("MotorSpeed2", "rpm"), ("n_fan_1", "rpm")],
        [("WheelSpeed_1", "V"), ("WheelSpeed_2", "")],
        [("WHEEL_SPEED_FL", "km/h"), ("WHEEL_SPEED_FR", "km/h")],
        [("WheelSpeedValid_1", "rpm"), ("AxleSpeedLimit_1", "km/h"), ("SpeedSetpoint", "km/h")],
        [("WindSpeed", "m/s"), ("CreepSpeed_Ax1", "m/s"), ("VehicleSpeedMax", "km/h")],
        [("BrakeForce_1", "kN"), ("TractiveEffortDemand_1", "kN"), ("Torque_1", "Nm")],
        [("OilTemperature", "degC"), ("Sanding", "kg"), ("Direction", "deg")],
        [("WheelSpeed_9999", "rpm"), ("Car2_Speed3_Part1", "km/h")],
    ],
)
def test_other_quantities_are_no_roles(signals):
    guessed = guess_roles(database(("M", signals)))
    assert guessed.taken == ()
    assert guessed.rivals == {}


def test_two_that_fit_alike_are_rivals():
    guessed = guess_roles(
        database(("Radar", [("v_train", "km/h")]), ("Tacho", [("v_train", "km/h")]))
    )
    assert guessed.taken == ()
    assert [g.place for g in guessed.rivals["vehicle_speed"]] == ["Radar.v_train", "Tacho.v_train"]


def test_axles_that_count_from_0_are_asked():
    """Whether 0 is the first axle nobody knows."""
    signals = [(f"WheelSpeed_{k}", "rpm") for k in range(4)]
    guessed = guess_roles(database(("M", signals)))
    assert guessed.taken == ()
    assert {g.place for g in guessed.rivals["wheel_speed.1"]} == {
        "M.WheelSpeed_0",
        "M.WheelSpeed_1",
    }


def test_a_hundred_messages_with_decoys():
    decoys = [
        (f"Node{k}", [(f"Setpoint_{k}", "rpm"), (f"MotorSpeed_{k}", "rpm"), ("Voltage", "V"),
                      (f"BrakeForce_{k}", "kN")])
        for k in range(1, 97)
    ]  # fmt: skip
    real = [
        ("Axles", [(f"AxleSpeed_{k}", "rpm") for k in (1, 2, 3, 4)]),
        ("Effort", [(f"TractiveEffort_{k}", "kN") for k in (1, 2, 3, 4)]),
        ("Speed", [("TrainSpeed", "km/h")]),
    ]
    found = places(guess_roles(database(*decoys[:50], *real, *decoys[50:])))
    assert found == {
        **{f"wheel_speed.{k}": f"Axles.AxleSpeed_{k}" for k in (1, 2, 3, 4)},
        **{f"tractive_effort.{k}": f"Effort.TractiveEffort_{k}" for k in (1, 2, 3, 4)},
        "vehicle_speed": "Speed.TrainSpeed",
    }


WORDS = ("Wheel", "Axle", "Speed", "v", "n", "Force", "Load", "Vehicle", "Rail", "Air", "Temp",
         "Source", "Ax", "Ground", "Effort", "Fz")  # fmt: skip
NAMES = st.builds(
    lambda words, number: "_".join(words) + (f"_{number}" if number is not None else ""),
    st.lists(st.sampled_from(WORDS), min_size=1, max_size=4),
    st.sampled_from([None, 0, 1, 2, 3]),
)
UNITS = st.sampled_from(["rpm", "km/h", "m/s", "N", "kN", "t", "degC", "%", ""])
MESSAGES = st.lists(
    st.tuples(NAMES, st.dictionaries(NAMES, UNITS, min_size=1, max_size=4)),
    min_size=1,
    max_size=5,
    unique_by=lambda message: message[0],
)


@settings(max_examples=80, deadline=None)
@given(MESSAGES)
def test_no_signal_has_two_roles_and_no_role_two_signals(messages):
    guessed = guess_roles(database(*((name, list(s.items())) for name, s in messages)))
    taken = [guess.place for guess in guessed.taken]
    assert len(set(taken)) == len(taken)
    names = [guess.name for guess in guessed.taken]
    assert len(set(names)) == len(names)
    assert not set(names) & set(guessed.rivals)
    assert not set(taken) & {guess.place for guess in guessed.shared}


WHEELS = ("Axles", [(f"WheelSpeed_{k}", "rpm") for k in (1, 2, 3, 4)])


@pytest.mark.parametrize(
    "efforts",
    [
        [(f"Motor{k}", [(f"Mot{k}_Effort", "kN")]) for k in (1, 2)],
        [(f"Bogie{k}", [("Effort", "kN")]) for k in (1, 2)],
        [("Traction", [("BogieForce_1", "kN"), ("BogieForce_2", "kN")])],
        [("Traction", [("Force_1", "kN"), ("Force_2", "kN")])],
    ],
)
def test_efforts_that_are_fewer_than_the_axles_are_no_efforts_of_axles(efforts):
    guessed = guess_roles(database(WHEELS, *efforts))
    assert {guess.role for guess in guessed.taken} == {Role.WHEEL_SPEED}
    assert [guess.axle for guess in guessed.shared] == [1, 2]
    places = [guess.place for guess in distribute(guessed.shared, 4)]
    assert places == [guess.place for guess in guessed.shared for _ in range(2)]
    assert {guess.share for guess in distribute(guessed.shared, 4)} == {0.5}
    assert distribute(guessed.shared, 5) == distribute(guessed.shared, None) == ()


@pytest.mark.parametrize(
    "efforts",
    [
        [(f"Motor{k}", [(f"Mot{k}_Effort", "kN")]) for k in (1, 2, 3, 4)],
        [(f"Bogie{k}", [(f"Force{k}", "kN")]) for k in (1, 2, 3, 4)],
        [("Traction", [("Effort_Ax1", "kN"), ("Effort_Ax2", "kN")])],  # the others are trailing
    ],
)
def test_efforts_of_axles_are_taken(efforts):
    guessed = guess_roles(database(WHEELS, *efforts))
    assert guessed.shared == ()
    assert [g.axle for g in guessed.taken if g.role is Role.TRACTIVE_EFFORT] == list(
        range(1, 1 + sum(len(signals) for _, signals in efforts))
    )


def test_efforts_of_bogies_without_wheel_speeds_are_not_assigned():
    guessed = guess_roles(database(*((f"Bogie{k}", [("Effort", "kN")]) for k in (1, 2))))
    assert guessed.taken == ()
    assert [guess.place for guess in guessed.shared] == ["Bogie1.Effort", "Bogie2.Effort"]


def test_an_effort_that_names_an_axle_is_preferred_to_that_of_a_motor():
    efforts = [("Efforts", [(f"Effort_Ax{k}", "kN") for k in (1, 2, 3, 4)])]
    efforts += [(f"Motor{k}", [("Effort", "kN")]) for k in (1, 2)]
    guessed = guess_roles(database(WHEELS, *efforts))
    assert places(guessed)["tractive_effort.1"] == "Efforts.Effort_Ax1"
    assert guessed.shared == ()


def test_a_wheel_needs_no_word_for_speed_where_its_unit_is_a_rotation():
    guessed = guess_roles(database(("Drive", [("Wheel1", "rpm"), ("Wheel2", "kN")])))
    assert places(guessed) == {"wheel_speed.1": "Drive.Wheel1"}


def test_candidates_have_the_unit_of_a_role_and_those_with_its_words_come_first():
    messages = database(
        ("A", [("Pull", "kN"), ("Mot_Torque", "Nm")]),
        ("B", [("Tractive_Sum", "kN"), ("T", "degC")]),
    )
    guessed = guess_roles(messages)
    assert guessed.taken == ()
    found = candidates(messages, guessed, Role.TRACTIVE_EFFORT)
    assert [one.signal.name for one in found] == ["Tractive_Sum", "Pull"]
    assert candidates(messages, guessed, Role.AMBIENT_TEMPERATURE) == []
    assert len(list(unused_signals(messages, guessed))) == 4
