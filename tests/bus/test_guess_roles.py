"""Roles guessed from names, units and value tables; a false guess is worse than none."""

import cantools
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from adhesion_can.bus.database import load_database
from adhesion_can.bus.guess_roles import guess_roles
from adhesion_can.bus.roles import packaged_choices


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
