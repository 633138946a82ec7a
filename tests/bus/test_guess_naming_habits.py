"""Databases of trams and bogies in several naming habits: what is taken without a question."""

import pytest

from adhesion_can.bus.guess_roles import guess_roles
from adhesion_can.physics.readings import Role
from tests.bus.test_guess_forces import BOTH, POSITIVE, UNSTATED, database

SHOWN = (Role.WHEEL_SPEED, Role.VEHICLE_SPEED, Role.TRACTIVE_EFFORT, Role.AXLE_LOAD)


def speeds(*names, unit="km/h"):
    return [(name, unit, POSITIVE) for name in names]


def signed(*names, unit="kN"):
    return [(name, unit, BOTH) for name in names]


def unsigned(*names, unit="kN"):
    return [(name, unit, POSITIVE) for name in names]


GERMAN_TRAM = [
    ("DG1_Antrieb", [*speeds("v_Achse1", "v_Achse2"), *signed("Zugkraft_Ist", "Zugkraft_Soll")]),
    ("DG2_Antrieb", [*speeds("v_Achse1", "v_Achse2"), *signed("Zugkraft_Ist", "Zugkraft_Soll")]),
    ("Fzg", [*speeds("v_Fzg_Ist"), *unsigned("Last_DG1", "Last_DG2", "Fzg_Masse", unit="t")]),
]
GERMAN_BOGIE = [
    ("ASR_Ist", signed("M1_Zugkraft", "M2_Zugkraft", unit="N")),
    ("ASR_Rad", speeds("Rad_A", "Rad_B", "Rad_C", "Rad_D")),
    ("FSG_Fzg", speeds("v_Fzg")),
]
GERMAN_WHEEL_LOADS = [
    ("Rad", [*speeds("n_Rad1", "n_Rad2", unit="U/min"), *unsigned("Radlast1", "Radlast2")]),
    ("Kraft", unsigned("Kraft_1", "Kraft_2")),
]
GERMAN_FZ = [
    ("ASG", [*speeds("n_RS1", "n_RS2", unit="1/min"), ("Fz_RS1", "kN", UNSTATED),
             ("Fz_RS2", "kN", UNSTATED)]),
]  # fmt: skip
FRENCH_BOGIE = [
    ("BOGIE_Traction",
     [*signed("EffortMoteur1", "EffortMoteur2", "EffortConsigne1"), *unsigned("EffortFrein1")]),
    ("BOGIE_Vitesses", speeds("VitesseEssieu1", "VitesseEssieu2", unit="tr/min")),
    ("Rame", [*speeds("VitesseRame"), *unsigned("ChargeBogie")]),
]  # fmt: skip
FRENCH_TRAM = [
    ("TCU_A", signed("EffortJante_Bog1", "EffortJante_Bog2")),
    ("TCU_V", speeds("VRoue_E1", "VRoue_E2", "VRoue_E3", "VRoue_E4")),
    ("GEN", [*speeds("VTrain"), *unsigned("ChargeBog1", "ChargeBog2")]),
]
ENGLISH_TRAM = [
    ("TCU1", speeds("nAxle1", "nAxle2", "nAxle3", "nAxle4", unit="1/min")),
    ("TCU2", signed("FzAct_Axle1", "FzAct_Axle2", "FzAct_Axle3", "FzAct_Axle4")),
    ("VCU", [*speeds("vGround"), *unsigned("LoadBogie1", "LoadBogie2")]),
]
ENGLISH_MOTORS = [
    ("Drive1Act", [*signed("Mot1Effort"), *speeds("Wheel1Speed", "Wheel2Speed")]),
    ("Drive2Act", [*signed("Mot2Effort"), *speeds("Wheel3Speed", "Wheel4Speed")]),
    ("Train", [*speeds("TrainSpeed"), *unsigned("BogieLoad1", "BogieLoad2")]),
]
ENGLISH_BOGIE = [
    ("BCU", [*signed("TractiveEffort"), *unsigned("BogieLoad"),
             *speeds("AxleSpeed1", "AxleSpeed2", unit="rpm")]),
]  # fmt: skip
RIG = [
    ("RIG_A", speeds("nA", "nB", unit="rpm")),
    ("RIG_F", [*signed("FxA", "FxB"), *unsigned("FzA", "FzB")]),
]
OTHER_FORCES = [
    ("A", signed("BrakingForce_1", "CouplerForce_1", "SpringForce_1", "ForzaFrenatura_1")),
    ("B", [*signed("TE_Possible_1"), *unsigned("PassengerLoad_1", "AirSpringLoad_1")]),
    ("C", [*speeds("WheelSlide_1", "AxleDelta_1"), *speeds("Axle_Shake_1", unit="mm/s")]),
]


def axles(role, *signals):
    return {f"{role}.{axle}": signal for axle, signal in enumerate(signals, start=1)}


@pytest.mark.parametrize(
    ("messages", "taken", "shared"),
    [
        (
            GERMAN_TRAM,
            {"vehicle_speed": "v_Fzg_Ist"},
            "Zugkraft_Ist Zugkraft_Ist Last_DG1 Last_DG2",
        ),
        (GERMAN_BOGIE, {"vehicle_speed": "v_Fzg"}, "M1_Zugkraft M2_Zugkraft"),
        (GERMAN_WHEEL_LOADS, axles("wheel_speed", "n_Rad1", "n_Rad2"), ""),
        (GERMAN_FZ, axles("wheel_speed", "n_RS1", "n_RS2"), ""),
        (
            FRENCH_BOGIE,
            {
                **axles("wheel_speed", "VitesseEssieu1", "VitesseEssieu2"),
                **axles("tractive_effort", "EffortMoteur1", "EffortMoteur2"),
                "vehicle_speed": "VitesseRame",
            },
            "ChargeBogie",
        ),
        (
            FRENCH_TRAM,
            {
                **axles("wheel_speed", "VRoue_E1", "VRoue_E2", "VRoue_E3", "VRoue_E4"),
                "vehicle_speed": "VTrain",
            },
            "EffortJante_Bog1 EffortJante_Bog2 ChargeBog1 ChargeBog2",
        ),
        (
            ENGLISH_TRAM,
            {
                **axles("wheel_speed", "nAxle1", "nAxle2", "nAxle3", "nAxle4"),
                **axles("tractive_effort", *(f"FzAct_Axle{k}" for k in (1, 2, 3, 4))),
                "vehicle_speed": "vGround",
            },
            "LoadBogie1 LoadBogie2",
        ),
        (
            ENGLISH_MOTORS,
            {
                **axles("wheel_speed", *(f"Wheel{k}Speed" for k in (1, 2, 3, 4))),
                "vehicle_speed": "TrainSpeed",
            },
            "Mot1Effort Mot2Effort BogieLoad1 BogieLoad2",
        ),
        (
            ENGLISH_BOGIE,
            axles("wheel_speed", "AxleSpeed1", "AxleSpeed2"),
            "TractiveEffort BogieLoad",
        ),
        (RIG, {}, ""),
    ],
)
def test_only_what_is_clear_is_taken(messages, taken, shared):
    guessed = guess_roles(database(*messages))
    found = {g.name: g.signal.name for g in guessed.taken if g.role in SHOWN}
    assert found == taken
    assert " ".join(guess.signal.name for guess in guessed.shared) == shared


def test_other_forces_and_motions_have_no_role():
    guessed = guess_roles(database(*OTHER_FORCES))
    assert guessed.guesses == ()
