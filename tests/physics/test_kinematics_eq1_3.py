"""Creep, slip ratio and adhesion coefficient against the equations as printed."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from adhesion_can.physics.kinematics import (
    V_MIN,
    adhesion_coefficient,
    creep_speed,
    slip_ratio,
    wheelset_effort,
)

FIXED = settings(derandomize=True, deadline=None, max_examples=100)


@FIXED
@given(st.floats(0.0, 130.0), st.floats(V_MIN, 60.0), st.floats(0.3, 0.8))
def test_creep_is_slip_times_speed(omega, v, r):
    creep, slip = float(creep_speed(omega, v, r)), float(slip_ratio(omega, v, r))
    assert creep == pytest.approx(r * omega - v, abs=1e-12)
    assert slip == pytest.approx(r * omega / v - 1.0, abs=1e-12)
    assert slip * v == pytest.approx(creep, abs=1e-12)
    assert slip >= -1.0  # a wheel that stands


def test_traction_is_positive_braking_negative_locked_is_minus_one():
    assert float(slip_ratio(17.6, 10.0, 0.625)) == pytest.approx(0.1)
    assert float(slip_ratio(14.4, 10.0, 0.625)) == pytest.approx(-0.1)
    assert float(slip_ratio(0.0, 10.0, 0.625)) == -1.0
    assert float(slip_ratio(16.0, 10.0, 0.625)) == 0.0


@pytest.mark.parametrize("v", [0.0, 0.5, np.nextafter(V_MIN, 0.0), -3.0, np.nan])
def test_no_slip_ratio_below_v_min(v):
    assert np.isnan(slip_ratio(10.0, v, 0.625))


def test_slip_ratio_begins_exactly_at_v_min():
    assert float(slip_ratio(2.0, V_MIN, 0.625)) == pytest.approx(0.25)
    assert float(slip_ratio(10.0, 3.0, 0.625, v_min=3.0)) == pytest.approx(0.625 * 10 / 3 - 1)
    assert np.isnan(slip_ratio(10.0, 2.999, 0.625, v_min=3.0))


def test_mixed_speeds_and_axles_broadcast():
    v = np.array([0.5, 1.0, 10.0])
    omega = np.array([[16.0], [17.0]])
    radius = np.array([[0.625], [0.6]])
    slip = slip_ratio(omega, v, radius)
    assert slip.shape == creep_speed(omega, v, radius).shape == (2, 3)
    assert np.isnan(slip[:, 0]).all()
    assert slip[1, 2] == pytest.approx(0.6 * 17 / 10 - 1)
    # One speed for several wheels: the mask of v must grow with them.
    assert slip_ratio([16.0, 17.0], 10.0, 0.625).shape == (2,)
    assert np.isnan(slip_ratio([16.0, 17.0], 0.1, 0.625)).all()
    assert slip_ratio([16, 17], 10, 1).dtype == np.float64


def test_wheelset_effort_is_what_a_torque_balance_leaves():
    # J dω/dt = r (F − F_ad): with F_ad = 0 the effort is all inertia's.
    inertia, r, effort, dt = 200.0, 0.625, 12e3, 1e-3
    omega = 0.0
    for _ in range(100):
        omega += dt * r * effort / inertia
    assert float(wheelset_effort(omega / 0.1, inertia, r)) == pytest.approx(effort, rel=1e-12)


@FIXED
@given(
    st.floats(-3e5, 3e5),
    st.floats(1e3, 4e5),
    st.floats(-200.0, 200.0),
    st.floats(0.0, 500.0),
    st.floats(0.3, 0.8),
)
def test_adhesion_coefficient_is_eq_3_less_the_wheelsets_share(force, load, accel, inertia, r):
    mu = float(adhesion_coefficient(force, load, accel, inertia, r))
    assert mu * load == pytest.approx(force - inertia * accel / r, rel=1e-9, abs=1e-6)
    # Both signs are alike: braking mirrors traction.
    assert float(adhesion_coefficient(-force, load, -accel, inertia, r)) == -mu


def test_adhesion_coefficient_defaults_to_force_over_load():
    assert float(adhesion_coefficient(49e3, 245e3)) == pytest.approx(0.2)


@pytest.mark.parametrize("load", [0.0, -0.0, -1.0, -245e3, np.nan])
def test_no_adhesion_without_load(load):
    assert np.isnan(adhesion_coefficient(1e4, load))
    mixed = adhesion_coefficient(1e4, np.array([load, 2e5]))
    assert np.isnan(mixed[0])
    assert mixed[1] == pytest.approx(0.05)


def test_adhesion_coefficient_broadcasts_over_axles_and_time():
    force = np.full((5, 6), 1e4)
    load = np.linspace(2e5, 2.5e5, 6)
    mu = adhesion_coefficient(force, load, np.zeros((5, 1)), 200.0, np.full(6, 0.625))
    assert mu.shape == (5, 6)
    assert mu[3, 2] == pytest.approx(1e4 / load[2])
    assert adhesion_coefficient(1e4, load).shape == (6,)
