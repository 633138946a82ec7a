"""Coasting contradicts a cause of another size, and no true one."""

import pytest

from adhesion_can.calibration.fit import AxleRadius, CalibratedQuantity, Calibration
from adhesion_can.learning.coasting_witness import find_contradiction
from tests.learning.learning_helpers import active, cause

RADIUS, STD = 0.6, 3e-4


def calibration(*ratios):
    """Radii of axles as ratios to the configured one; None: too little coasting."""
    axles = tuple(
        AxleRadius(
            axle,
            RADIUS,
            None if ratio is None else CalibratedQuantity(ratio * RADIUS, STD * RADIUS, (0.0, 1.0)),
            20.0,
            12,
        )
        for axle, ratio in enumerate(ratios, start=1)
    )
    fields = dict.fromkeys(Calibration.__dataclass_fields__)
    return Calibration(**{**fields, "axles": axles, "systematic_percent": 0.05})


@pytest.mark.parametrize(
    ("ratios", "causes", "holds"),
    [
        ((0.99, 0.99), [cause(values=(-0.01,))], True),
        ((0.9905, 0.989), [cause(values=(-0.01,))], True),
        ((1.0, 1.0), [cause(values=(-0.01,))], False),
        ((0.99, 0.99), [cause("effort_bias", (9e3,), (300.0,))], False),
        ((1.0, 1.0), [cause("effort_bias", (9e3,), (300.0,))], True),
        ((1.0, 1.02), [cause("wheel_radius", (0.02, 2), (1e-3, None))], True),
        ((1.02, 1.0), [cause("wheel_radius", (0.02, 2), (1e-3, None))], False),
        ((None, None), [cause(values=(-0.01,))], True),
        ((1.0, 1.0), [cause("speed_delay", (0.2,), (0.01,))], True),
    ],
)
def test_radii_beside_causes(ratios, causes, holds):
    found = find_contradiction(calibration(*ratios), tuple(map(active, causes)))
    assert (found == "") is holds


def test_the_reason_names_axle_and_sizes():
    found = find_contradiction(calibration(None, 1.0), (active(cause(values=(-0.01,))),))
    assert found == "in coasting the radius of axle 2 is +0.00 % off, and not -1.00 %"
