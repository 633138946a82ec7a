"""Why a recording gives no samples: unknown cycles, signals that stand still, a slow vehicle."""

from dataclasses import replace

import pytest

from adhesion_can.config import load_configuration
from adhesion_can.offline.missing_samples import (
    describe_dropped,
    explain_axle,
    explain_no_samples,
    unknown_cycles,
)
from adhesion_can.offline.scan import SignalRange

CONFIG = load_configuration()
SLOW = {"below v_min": 600}


def signals(**changed):
    """Ranges of a moving vehicle; `wheel_speed_2=(0, 0)` changes that of a role."""
    found = {choice.name: SignalRange(0.5, 20.0, readings=100) for choice in CONFIG.choices}
    for name, (low, high) in changed.items():
        key = name if name in found else ".".join(name.rsplit("_", 1))
        found[key] = SignalRange(low, high, readings=100)
    return found


def without_cycles(*names):
    config = replace(CONFIG, database=CONFIG.database)
    for message in config.messages:
        if message.plan.name in names:
            object.__setattr__(message, "cycle_us", None)
    return config


def test_v_min_has_its_value_and_the_speed_its_range():
    config = replace(CONFIG, sampling=replace(CONFIG.sampling, v_min=2.5))
    (said,) = explain_no_samples(SLOW, signals(vehicle_speed=(0.0, 1.2)), config)
    assert said == (
        "no sample could be formed: vehicle speed below v_min = 2.5 m/s in [sampling] (600); "
        "vehicle_speed (VehicleSpeed.VehicleSpeed) reads 0 to 1.2 m/s"
    )
    assert describe_dropped({"no bracket": 3}, CONFIG) == {"no bracket": 3}


def test_a_speed_of_0_throughout_is_the_fault_and_comes_first():
    seen = signals(vehicle_speed=(0.0, 0.0), wheel_speed_2=(0.0, 0.0))
    first, last = explain_no_samples(SLOW, seen, CONFIG)
    assert first.startswith("vehicle_speed (VehicleSpeed.VehicleSpeed) reads 0 m/s throughout: the")
    assert "the vehicle does not move, or nothing is sent in the signal" in first
    assert "reads" not in last


def test_wheels_that_stand_are_named_together():
    seen = signals(wheel_speed_2=(0.0, 0.0), wheel_speed_4=(0.0, 0.0), tractive_effort_1=(7.0, 7.0))
    wheels, effort, _ = explain_no_samples({"no bracket": 9}, seen, CONFIG)
    assert wheels.startswith("wheel_speed.2 (WheelSpeeds1.")
    assert "wheel_speed.4 (WheelSpeeds2." in wheels or "wheel_speed.4 (WheelSpeeds1." in wheels
    assert "read 0 rad/s throughout: no axle turns there, or" in wheels
    assert "reads 7 N throughout: the sensor is stuck, or it is another signal" in effort


@pytest.mark.parametrize(("names", "says"), [
    (["VehicleSpeed"], "the cycle of VehicleSpeed is unknown, so that every reading"),
    (["WheelSpeeds1", "WheelSpeeds2"], "the cycles of WheelSpeeds1, WheelSpeeds2 are unknown"),
])  # fmt: skip
def test_gaps_of_messages_without_a_cycle_are_no_gaps(names, says):
    config = without_cycles(*names)
    (said,) = explain_no_samples({"gap in wheel speed": 23996}, signals(), config)
    assert says in said
    assert "(23996 wheel speeds); write cycle_ms at the roles" in said
    assert "gap" not in said


def test_one_message_with_a_cycle_is_enough_for_its_role():
    config = without_cycles("WheelSpeeds1")
    (said,) = explain_no_samples(SLOW, signals(), config)
    assert "unknown" not in said


def test_an_unknown_cycle_is_written_as_it_was_measured():
    config = without_cycles("VehicleSpeed", "WheelSpeeds1")
    said = "\n".join(unknown_cycles(config, {"VehicleSpeed": 19.98}))
    assert "write cycle_ms = 20, as in this recording, at its role" in said
    assert (
        "WheelSpeeds1: its cycle is unknown, so a stale input cannot be detected; write cycle_ms at"
        in said
    )


def test_an_axle_without_samples_has_its_reason():
    said = explain_axle(2, signals(wheel_speed_2=(0.0, 0.0)), CONFIG)
    assert said.startswith("axle 2: no sample could be formed: wheel_speed.2 (WheelSpeeds1.")
    assert explain_axle(2, signals(), CONFIG) == "axle 2: no sample could be formed"
