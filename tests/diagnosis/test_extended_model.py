"""From findings to a diagnosis: what may be empty there."""

import numpy as np
import pytest

from adhesion_can.diagnosis.extended_model import _estimate_segment, build_spline
from adhesion_can.diagnosis.inference.find_residual_channels import ResidualChannel
from adhesion_can.diagnosis.regression.channel_splines import Channel, ChannelKind
from adhesion_can.diagnosis.regression.model import EvaluatedModel
from adhesion_can.physics.curves import Conditions
from tests.diagnosis.diagnosis_helpers import C1, C2, build_table_drive, burckhardt


def surface_of(factor):
    slip = 0.1 * np.sin(np.arange(2000) / 30)
    mu = burckhardt(slip) + 0.01 * np.random.default_rng(1).standard_normal(2000)
    drive = build_table_drive(slip, mu)
    predicted = factor * burckhardt(slip)
    seen = EvaluatedModel(mu, slip, np.full(2000, factor), predicted / factor, Conditions(10.0))
    return _estimate_segment(drive, np.arange(2000), 0, seen)


def test_the_extended_curve_is_that_beneath_the_factor():
    found = surface_of(0.5)
    assert found.extended.mu_max == pytest.approx(2 * found.base.mu_max, rel=0.02)


def test_a_factor_that_leaves_nothing_is_no_end_of_the_report():
    found = surface_of(0.01)
    assert np.isfinite(found.base.mu_max)


def test_a_spline_over_the_slip_has_no_change_that_the_curves_only_undo():
    """Curve and spline are functions of the same slip: fitted together each may be huge."""
    slip = np.linspace(1e-4, 0.2, 2000)
    mu = burckhardt(slip)
    channel = Channel("slip", ChannelKind.FACTOR, slip)
    evaluation = EvaluatedModel(mu, slip, np.ones(2000), mu, Conditions(10.0))
    basis = channel.build_basis(evaluation)
    steep = np.exp(-C2 * slip)
    jacobian = np.column_stack([1 - steep, C1 * slip * steep, -slip])
    hump = np.array([0.0, 0.0, 0.0, 0.05, 0.0, 0.0])
    curves = np.array([0.5, 30.0, 2.0])
    undone = np.linalg.lstsq(basis, jacobian @ curves, rcond=None)[0]
    fitted = np.concatenate([curves, hump - undone])
    spline = build_spline(ResidualChannel(channel, 0.001, 0.3, basis, jacobian, fitted))
    assert np.ptp(spline.at(slip[slip > 0.002])) < 0.15
