"""What the output messages say of themselves."""

import pytest

from adhesion_can.bus.database import OUTPUT_MESSAGES, load_database
from adhesion_can.service.output_messages import SETPOINT, OutputMessages

CONTRACT = {
    "AdhesionSetpoint": (0x201, 20),
    "AdhesionModel": (0x202, 100),
    "AdhesionQuality": (0x203, 100),
    "AxleSetpoint": (0x204, 20),
    "ServiceStatus": (0x211, 1000),
}
"""Id and cycle in ms."""


@pytest.fixture
def messages():
    return OutputMessages(load_database(), ())


def test_ids_and_cycles_are_those_of_the_contract(messages):
    assert set(OUTPUT_MESSAGES) == set(CONTRACT)
    assert messages.ids == {(number, False) for number, _ in CONTRACT.values()}
    assert messages.ids_by_name == {name: number for name, (number, _) in CONTRACT.items()}
    assert messages.cycles_us == {name: ms * 1000 for name, (_, ms) in CONTRACT.items()}
    assert messages.cycles_by_id_us == {number: ms * 1000 for number, ms in CONTRACT.values()}


def test_each_has_eight_bytes(messages):
    assert messages.sizes == dict.fromkeys(CONTRACT, 8)


def test_they_are_in_ascending_order_of_their_ids(messages):
    assert next(iter(messages.cycles_us)) == SETPOINT
    assert list(messages.cycles_us) == sorted(CONTRACT, key=lambda name: CONTRACT[name][0])


def test_each_id_has_its_name(messages):
    for name, (number, _) in CONTRACT.items():
        assert messages.find_name(number) == name
