"""The creep controller: it follows, it keeps its limits, and its probing covers the curve."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from adhesion_can.physics.burckhardt import RAIL, adhesion
from adhesion_can.physics.vehicle import Locomotive
from adhesion_can.simulation.drive import (
    SWEEP_PERIOD_S,
    Drive,
    DriveSettings,
    Pattern,
    probing_slip,
)
from adhesion_can.simulation.plant import Plant

FIXED = settings(derandomize=True, deadline=None, max_examples=20)
DT = 0.002
VEHICLE = Locomotive()
SURFACES = pytest.mark.parametrize("surface", RAIL, ids=lambda s: s.name)


def run(drive, plant, theta, seconds, watch=lambda _: None):
    rail = tuple(np.full(6, c) for c in theta)
    for k in range(round(seconds / DT)):
        t = k * DT
        creep = plant.radius * plant.wheel_speed - plant.speed
        effort = drive.step(t, plant.speed, creep, DT)
        plant.step(effort, rail, DT)
        watch(t)


@pytest.mark.costly
@pytest.mark.parametrize("share", [0.3, 1.0])
@pytest.mark.parametrize("speed", [3.0, 25.0])
@SURFACES
def test_an_obeying_drive_holds_the_creep_that_it_is_told(surface, speed, share):
    # A train so heavy, on a fall that makes up for its resistance, keeps its speed: steady state.
    falling = -(1.5 + 0.00025 * (3.6 * speed) ** 2) * 1e-3
    plant = Plant(replace(VEHICLE, train_mass=1e10), speed, gradient=falling)
    drive = Drive(6, DriveSettings(probe_s=0.0), obey=True)
    wanted = share * surface.lambda_m * speed
    drive.update_command(0.0, known=True, creep_speed=wanted)
    creeps = []
    run(
        drive,
        plant,
        surface.theta,
        18.0,
        lambda t: creeps.append(plant.radius * plant.wheel_speed - plant.speed) if t > 16 else None,
    )
    assert np.array(creeps) == pytest.approx(wanted, rel=0.02)


@FIXED
@given(
    st.floats(1e4, 2e5),
    st.floats(0.0, 30.0),
    st.sampled_from(list(Pattern)),
    st.integers(0, 10**6),
)
def test_effort_is_never_beyond_its_limit(limit, speed, pattern, seed):
    rng = np.random.default_rng(seed)
    drive = Drive(6, DriveSettings(effort_max=limit), pattern)
    for k in range(400):
        effort = drive.step(k * DT, speed, rng.uniform(-20, 20, 6), DT)
        assert (np.abs(effort) <= limit * (1 + 1e-12)).all()
        assert np.isfinite(effort).all()


def test_a_long_saturation_does_not_wind_the_integral_up():
    # Three seconds of a creep out of reach, then a small one: the effort must let go at once.
    plant = Plant(VEHICLE, 10.0)
    drive = Drive(6, DriveSettings(effort_max=3e4, probe_s=0.0), obey=True)
    drive.update_command(0.0, known=True, creep_speed=2.0)
    run(drive, plant, RAIL[0].theta, 3.0)
    assert drive.effort == pytest.approx([3e4] * 6, rel=1e-3)
    drive.update_command(3.0, known=True, creep_speed=0.02)
    run(drive, plant, RAIL[0].theta, 0.5)
    creep = plant.radius * plant.wheel_speed - plant.speed
    assert (creep <= 0.02 * 1.1).all()
    assert (drive.effort < 1.5e4).all()


def histogram_of_slips(pattern, surface, speed, seconds):
    plant, drive = Plant(VEHICLE, speed), Drive(6, pattern=pattern)
    slips = []
    run(drive, plant, surface.theta, seconds, lambda _: slips.append(plant.slip))
    return np.array(slips), plant


@SURFACES
def test_probing_begins_near_zero_on_every_axle(surface):
    slips, _ = histogram_of_slips(Pattern.STAGGERED, surface, 10.0, 8.0)
    for axle in range(6):
        # 'Near zero': at least the lower half of the adhesion, else c2 rests on the bend alone.
        low = float(adhesion(slips[500:, axle].min(), *surface.theta))
        assert low < 0.5 * surface.mu_max


@SURFACES
@pytest.mark.parametrize("speed", [5.0, 10.0, 25.0])
def test_probing_goes_beyond_the_peak_on_every_axle(surface, speed):
    slips, _ = histogram_of_slips(Pattern.STAGGERED, surface, speed, 8.0)
    slips = slips[500:]
    for axle in range(6):
        assert slips[:, axle].max() > 1.3 * surface.lambda_m
        assert slips[:, axle].max() < 0.5  # and comes back within what the model takes
        # Beyond the peak it must be for long enough to be seen in a block of samples.
        assert (slips[:, axle] > surface.lambda_m).mean() > 0.15


@SURFACES
def test_a_sweep_covers_traction_and_braking_alike_and_coasts(surface):
    slips, _ = histogram_of_slips(Pattern.SWEEP, surface, 15.0, SWEEP_PERIOD_S)
    assert slips.max() > 1.3 * surface.lambda_m
    assert slips.min() < -1.3 * surface.lambda_m
    assert (np.abs(slips) < 0.005).mean() > 0.1


def test_probing_axles_are_out_of_step_and_the_train_hardly_feels_it():
    pulls = []
    drive, plant = Drive(6), Plant(VEHICLE, 10.0)
    run(drive, plant, RAIL[0].theta, 12.0, lambda _: pulls.append(plant.force.sum()))
    pulls = np.array(pulls[2000:])
    assert pulls.std() < 0.1 * pulls.mean()


@FIXED
@given(st.floats(0.0, 1e4), st.integers(1, 8), st.sampled_from(list(Pattern)))
def test_probing_slip_stays_within_its_ends(t, axles, pattern):
    chosen = DriveSettings()
    slip = probing_slip(t, axles, pattern, chosen)
    assert slip.shape == (axles,)
    assert np.abs(slip).max() <= chosen.slip_high + 1e-12
    if pattern is Pattern.STAGGERED:
        assert slip.min() >= chosen.slip_low - 1e-12


def test_probing_slip_is_continuous():
    for pattern in Pattern:
        t = np.arange(0, 45, 0.002)
        slips = np.array([probing_slip(x, 6, pattern, DriveSettings()) for x in t])
        assert np.abs(np.diff(slips, axis=0)).max() < 0.001


def test_the_setpoint_is_obeyed_only_where_the_rail_is_known_and_probing_is_over():
    drive = Drive(6, DriveSettings(probe_s=3.0), obey=True)
    probing = probing_slip(10.0, 6, Pattern.STAGGERED, drive.settings) * 8.0
    assert drive.setpoint(10.0, 8.0) == pytest.approx(probing)  # nothing was said
    drive.update_command(8.0, known=True, creep_speed=0.3)
    assert drive.setpoint(10.0, 8.0) == pytest.approx(probing)  # known for 2 s only
    drive.update_command(10.5, known=True, creep_speed=0.4)
    assert drive.setpoint(11.1, 8.0).tolist() == [0.4] * 6
    drive.update_command(11.2, known=True, creep_speed=None)
    assert np.ptp(drive.setpoint(11.3, 8.0)) > 0  # not available
    drive.update_command(11.4, known=False, creep_speed=0.4)
    assert np.ptp(drive.setpoint(11.5, 8.0)) > 0
    drive.update_command(11.6, known=True, creep_speed=0.4)
    assert np.ptp(drive.setpoint(14.5, 8.0)) > 0
    assert drive.setpoint(14.7, 8.0).tolist() == [0.4] * 6


def test_a_drive_that_does_not_obey_does_not():
    drive = Drive(6)
    drive.update_command(0.0, known=True, creep_speed=0.3)
    assert np.ptp(drive.setpoint(100.0, 8.0)) > 0
