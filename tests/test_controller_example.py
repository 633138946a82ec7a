"""The decisions of docs/examples/controller.py, without a bus."""

import importlib.util
import sys
from pathlib import Path

import pytest

import adhesion_can
from adhesion_can.bus.database import load_database
from adhesion_can.bus.protected_message import ProtectedMessage
from adhesion_can.physics.doubt import Doubt
from adhesion_can.physics.objection import Objection
from adhesion_can.physics.status import Status
from adhesion_can.simulation.run import RunSettings, Simulation
from adhesion_can.simulation.scenarios import scenario_by_name

PATH = Path(__file__).resolve().parent.parent / "docs" / "examples" / "controller.py"
LITTLE_SLIP, RELEASED_S = 0.003, 3.0
"""Slip of all axles at first, and the time from which the controller drives, s."""


@pytest.fixture(scope="module")
def example():
    """The example as a module."""
    spec = importlib.util.spec_from_file_location("controller_example", PATH)
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module  # dataclasses look it up
    spec.loader.exec_module(module)
    return module


def drive(controller, seconds, watch):
    """Locomotive, service and controller in simulated time; `watch(t_s)` before each step."""
    config = adhesion_can.load_configuration()
    settings = RunSettings(scenario_by_name("dry"), seconds, obey=True)
    locomotive, service = Simulation(settings, config.database), adhesion_can.ServiceCore(config)
    locomotive.await_demands()
    for frames in locomotive.run():
        watch(locomotive.now_us / 1e6)
        for frame in frames:
            for each in (*service.feed(frame), frame):
                for demand in controller.feed(each.t_us, each.arbitration_id, each.data):
                    locomotive.receive(adhesion_can.Frame(each.t_us, *demand))


@pytest.mark.costly
def test_it_leaves_a_peak_that_was_fitted_to_small_slips(example):
    """All axles at a slip of 0.003: λ_m follows it down. Probes then show the true one."""
    controller = example.Controller()
    chooser, known = controller.chooser, controller.receiver.values
    stuck, seen = [], []

    def watch(t_s):
        if t_s < RELEASED_S:  # as if the drive had held half of LambdaM all the time
            chooser.slips = [min(slip, LITTLE_SLIP) for slip in chooser.slips]
            chooser.next_s = t_s + 0.1
            stuck.append((known.get("Status"), known.get("LambdaM")))
        else:
            seen.append((t_s, known["Status"], known["LambdaM"]))

    drive(controller, RELEASED_S + 4.0, watch)
    assert stuck[-1][0] == Status.LOW_EXCITATION
    assert stuck[-1][1] < 0.01
    tracking = [row for row in seen if row[1] == Status.TRACKING]
    assert tracking, "no TRACKING within 4 s"
    assert tracking[-1][2] == pytest.approx(0.073, rel=0.1)


GOOD = {
    "AdhesionSetpoint": {"Status": 1, "MuMax": 0.37, "LambdaM": 0.07, "CreepSpeedSetpoint": 0.5},
    "AdhesionModel": {"Objection": 0, "C1": 0.4, "C2": 60.0, "C3": 0.3},
    "AdhesionQuality": {"Doubt": 0, "MuMaxStd": 1e-3, "LambdaMStd": 2e-3, "SurfaceAge": 3.0},
}
DATABASE = load_database()


def receive(example, changes, omitted=()):
    """A receiver that has got one good frame of each message but for the changes."""
    receiver, supervision = example.SetpointReceiver(), example.Supervision()
    for name, values in GOOD.items():
        if name not in omitted:
            values = {n: changes.get(n, x) for n, x in values.items()}
            frame = ProtectedMessage(DATABASE.message(name)).frame(1000, values)
            receiver.receive(1000, *supervision.read(1000, frame.arbitration_id, frame.data))
    return receiver


@pytest.mark.parametrize(
    ("action", "changes"),
    [
        ("HOLD", {}),
        ("HOLD", {"Status": Status.LOW_EXCITATION}),
        ("HOLD", {"LambdaMStd": 0.02}),
        ("PROBE", {"LambdaMStd": 0.022}),
        ("PROBE", {"LambdaMStd": None}),
        ("PROBE", {"LambdaM": None, "CreepSpeedSetpoint": None}),
        ("PROBE", {"Status": Status.INIT}),
        ("PROBE", {"Status": Status.SURFACE_CHANGE}),
        ("PROBE", {"Doubt": Doubt.SPEED}),
        ("PROBE", {"Doubt": Doubt.NOT_AVAILABLE}),
        ("ALONE", {"Objection": Objection.SPEED_JUMP, "Doubt": Doubt.NOT_AVAILABLE}),
        ("ALONE", {"Status": Status.STALE_INPUT}),
        ("ALONE", {"Status": Status.FAULT}),
    ],
)
def test_what_the_messages_lead_to(example, action, changes):
    receiver = receive(example, changes)
    assert receiver.judge(2000)[0] is example.Action[action]
    assert receiver.judge(61_001)[0] is example.Action.ALONE, "silence"


@pytest.mark.parametrize("name", GOOD)
def test_without_one_of_the_messages_nothing_is_held(example, name):
    receiver = receive(example, {}, omitted={name})
    assert receiver.judge(2000) == (example.Action.ALONE, "silence")


def test_probes_go_further_each_time_with_one_axle_at_a_time(example):
    chooser, tops = example.SlipChooser(), {}
    for cycle in range(800):
        slips = chooser.choose(cycle / 100, 10.0, example.Action.PROBE, {})
        away = [axle for axle, slip in enumerate(slips) if slip > example.CAUTIOUS_SLIP + 1e-9]
        assert len(away) <= 1
        for axle in away:
            tops[axle] = max(tops.get(axle, 0.0), slips[axle])
    assert list(tops) == [0, 1, 2, 3, 4]
    assert list(tops.values()) == pytest.approx([0.12, 0.18, 0.27, 0.3, 0.3], abs=0.01)


def test_a_held_slip_is_left_to_both_sides_of_the_peak(example):
    chooser = example.SlipChooser()
    values = {"CreepSpeedSetpoint": 0.5, "LambdaM": 0.07, "Status": Status.TRACKING}
    rows = [chooser.choose(c / 100, 10.0, example.Action.HOLD, values) for c in range(170)]
    assert rows[-1] == pytest.approx([0.05] * 6)
    assert min(row[0] for row in rows[30:]) == pytest.approx(0.042)
    assert max(row[0] for row in rows) == pytest.approx(0.084)
    assert max(row[1] for row in rows) == pytest.approx(0.05)


def test_a_damaged_or_repeated_frame_is_not_taken(example):
    frame = ProtectedMessage(DATABASE.message("AdhesionModel")).frame(0, GOOD["AdhesionModel"])
    supervision = example.Supervision()
    damaged = bytes([*frame.data[:7], frame.data[7] ^ 1])
    assert supervision.read(0, 0x202, damaged) == ("", {})
    assert supervision.read(0, 0x202, frame.data)[0] == "AdhesionModel"
    assert supervision.read(100_000, 0x202, frame.data) == ("", {}), "repeated"
    assert supervision.read(1_100_001, 0x202, frame.data)[0] == "AdhesionModel"
