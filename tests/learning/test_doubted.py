"""What of a setpoint makes a learner look sooner."""

import pytest

from adhesion_can.learning.doubted import is_doubted
from adhesion_can.physics.doubt import Doubt
from adhesion_can.physics.objection import Objection
from adhesion_can.service.outputs import Outputs


@pytest.mark.parametrize(
    ("doubt", "objection", "expected"),
    [
        (Doubt.NONE, Objection.NONE, False),
        (Doubt.SPEED, Objection.NONE, True),
        (Doubt.NONE, Objection.SPEED_DEVIATES, True),
        (Doubt.NOT_AVAILABLE, Objection.SPEED_DEVIATES, True),
        (Doubt.NOT_AVAILABLE, Objection.NONE, None),
    ],
)
def test_a_doubt_and_an_objection_count(doubt, objection, expected):
    assert is_doubted(Outputs(doubt=doubt, objection=objection)) is expected
