"""The peak of a model with falling friction, and its differences between forms."""

import numpy as np
import pytest

from adhesion_can.diagnosis.peak_spread import (
    NO_SPREAD,
    compare_peaks,
    find_peak_with_friction,
)
from adhesion_can.diagnosis.regression.candidate import Candidate
from adhesion_can.diagnosis.regression.model import Model
from adhesion_can.diagnosis.regression.segment_curves import BURCKHARDT, SegmentCurves
from adhesion_can.physics.curves import FAMILIES, Conditions
from adhesion_can.physics.effects import effect_by_id
from tests.diagnosis.diagnosis_helpers import C1, C2, C3, burckhardt

AT = Conditions(12.0, 200e3)
PLAIN = Model(SegmentCurves.from_parameters(BURCKHARDT, np.array([[C1, C2, C3]])))


def test_the_peak_is_that_of_the_curve_times_its_falling_friction():
    grid = np.linspace(1e-4, 0.5, 200_001)
    for c4 in (0.0, 0.3):
        falling = Candidate(effect_by_id("falling_friction"))
        model = PLAIN.with_effect(falling, (c4,)) if c4 else PLAIN
        wanted = burckhardt(grid) * np.exp(-c4 * 12.0 * grid)
        mu_max, lambda_m = find_peak_with_friction(model, 0, AT)
        assert mu_max == pytest.approx(wanted.max(), rel=1e-4)
        assert lambda_m == pytest.approx(grid[wanted.argmax()], rel=5e-3)


def test_the_spread_is_the_largest_difference_to_another_form():
    free = FAMILIES["free"]
    mu_max, lambda_m = find_peak_with_friction(PLAIN, 0, AT)
    shape = [p.typical for p in free.parameters[2:]]

    def other(height, place):
        values = np.array([[height * mu_max, place * lambda_m, *shape]])
        return Model(SegmentCurves.from_parameters(free, values))

    assert compare_peaks(PLAIN, (), 0, AT) == NO_SPREAD
    found = compare_peaks(PLAIN, (other(1.01, 0.8), other(0.97, 1.1)), 0, AT)
    assert found.mu_max == pytest.approx(0.03, abs=2e-4)
    assert found.lambda_m == pytest.approx(0.2, abs=5e-3)
