"""From findings to a diagnosis: what may be empty there."""

import numpy as np
import pytest

from adhesion_can.diagnosis.extended_model import _estimate_segment
from adhesion_can.diagnosis.regression.model import Evaluation
from adhesion_can.physics.curves import Conditions
from tests.diagnosis.diagnosis_helpers import build_table_drive, burckhardt


def surface_of(factor):
    slip = 0.1 * np.sin(np.arange(2000) / 30)
    mu = burckhardt(slip) + 0.01 * np.random.default_rng(1).standard_normal(2000)
    drive = build_table_drive(slip, mu)
    predicted = factor * burckhardt(slip)
    seen = Evaluation(mu, slip, np.full(2000, factor), predicted / factor, Conditions(10.0))
    return _estimate_segment(drive, np.arange(2000), 0, seen)


def test_the_extended_curve_is_that_beneath_the_factor():
    found = surface_of(0.5)
    assert found.extended.mu_max == pytest.approx(2 * found.base.mu_max, rel=0.02)


def test_a_factor_that_leaves_nothing_is_no_end_of_the_report():
    found = surface_of(0.01)
    assert np.isfinite(found.base.mu_max)
