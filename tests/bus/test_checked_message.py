"""A protected message out and in again, and what is refused on the way."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from adhesion_can.bus.checked_message import CheckedMessage
from adhesion_can.bus.database import load_database
from adhesion_can.bus.protected_message import ProtectedMessage
from adhesion_can.bus.rejection import Rejection

MESSAGES = {m.name: m for m in load_database().db.messages}
EFFORTS = st.one_of(st.none(), st.floats(-320e3, 320e3))


def both(name):
    return ProtectedMessage(MESSAGES[name]), CheckedMessage(MESSAGES[name])


@given(st.lists(st.tuples(EFFORTS, EFFORTS, EFFORTS), min_size=1, max_size=40))
def test_values_come_back_to_half_a_step(rows):
    sender, receiver = both("EffortDemand1")
    for number, row in enumerate(rows):
        values = {f"EffortDemand_Ax{axle}": value for axle, value in enumerate(row, 1)}
        frame = sender.frame(10_000 * number, values)
        assert receiver.is_carried_by(frame)
        found = receiver.read(frame)
        for name, value in values.items():
            assert found[name] == (None if value is None else pytest.approx(value, abs=5.0))


def test_a_multiplexed_message_has_the_values_of_its_axle_alone():
    sender, receiver = both("AxleSetpoint")
    values = {"Axle": 4, "MuMax_Ax4": 0.3, "LambdaM_Ax4": 0.05, "CreepSpeedSetpoint_Ax4": None}
    found = receiver.read(sender.frame(0, values))
    assert {name for name in found if name.endswith(("1", "2", "3", "5", "6"))} == set()
    assert found["LambdaM_Ax4"] == pytest.approx(0.05)
    assert found["CreepSpeedSetpoint_Ax4"] is None


def test_a_damaged_a_repeated_and_a_short_frame_are_refused():
    sender, receiver = both("EffortDemand2")
    values = {f"EffortDemand_Ax{axle}": 1e3 for axle in (4, 5, 6)}
    first, second, third = (sender.frame(10_000 * k, values) for k in range(3))
    damaged = second._replace(data=bytes([*second.data[:5], second.data[5] ^ 1, *second.data[6:]]))
    assert isinstance(receiver.read(first), dict)
    assert receiver.read(damaged) is Rejection.CHECKSUM
    assert isinstance(receiver.read(second), dict)
    assert receiver.read(second) is Rejection.REPEAT
    assert receiver.read(third._replace(data=third.data[:7])) is Rejection.LENGTH


def test_other_ids_and_remote_frames_are_none_of_it():
    sender, receiver = both("EffortDemand1")
    frame = sender.frame(0, {"EffortDemand_Ax1": 1.0})
    assert not receiver.is_carried_by(frame._replace(arbitration_id=0x302))
    assert not receiver.is_carried_by(frame._replace(is_extended=True))
    assert not receiver.is_carried_by(frame._replace(is_remote=True))
