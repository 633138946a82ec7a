"""Reliefs, changes of the surface and wrong radii, in a drive whose slips a test sets."""

import numpy as np
import pytest

from adhesion_can.physics.objection import Objection
from tests.estimation.observed_speed.straight_drive import StraightDrive


def test_without_a_relief_the_slip_is_not_known_and_the_reason_says_what_is_missing():
    drive = StraightDrive()
    stated = drive.run(10.0)
    assert not stated.known[0]
    assert stated.reasons == (Objection.NO_RELIEF,)
    assert np.isinf(stated.since_relief_s[0])
    assert stated.slip_std.min() > 0.005


def test_a_relief_makes_the_slip_known():
    drive = StraightDrive()
    drive.run(5.0)
    stated = drive.relieve(0)
    for axle in (1, 2):
        stated = drive.relieve(axle)
    assert stated.known[0]
    assert stated.reasons == (Objection.NONE,)
    assert stated.since_relief_s[0] == pytest.approx(1.0, abs=0.25)
    assert np.abs(drive.error(stated)).max() < 0.001


def test_an_old_relief_does_not_count():
    drive = StraightDrive()
    drive.run(2.0)
    for axle in range(3):
        drive.relieve(axle)
    assert drive.run(15.0).known[0]
    stated = drive.run(11.0)
    assert not stated.known[0]
    assert stated.reasons == (Objection.NO_RELIEF,)


@pytest.mark.parametrize("wrong", [-0.004, -0.002, 0.002, 0.004])
@pytest.mark.parametrize("axle", [0, 3])
def test_a_relief_of_an_axle_with_a_wrong_radius_is_not_overconfident(axle, wrong):
    radius_error = np.zeros(6)
    radius_error[axle] = wrong
    drive = StraightDrive(radius_error=radius_error)
    drive.run(2.0)
    stated = drive.relieve(axle)
    # 0.2 % is one standard deviation of a radius: the slips of all others are off by as much.
    assert np.all(np.abs(drive.error(stated)) <= 2.6 * stated.slip_std[0])
    for other in range(6):
        stated = drive.relieve(other)
    assert np.abs(drive.error(stated)).max() < 0.0012
    found = np.log(stated.radius_factor[0])
    assert np.allclose(found - found.mean(), radius_error - radius_error.mean(), atol=0.0012)


def test_one_axle_that_spins_is_no_change_of_the_surface():
    drive = StraightDrive()
    drive.run(2.0)
    for axle in range(3):
        drive.relieve(axle)
    drive.run(3.0)
    drive.slip[4] += 0.08
    stated = drive.run(1.0)
    assert stated.known[0]
    assert np.abs(drive.error(stated)).max() < 0.0015


def test_a_change_of_the_surface_under_axle_after_axle_is_no_acceleration():
    drive = StraightDrive()
    drive.run(2.0)
    for axle in range(3):
        drive.relieve(axle)
    drive.run(3.0)
    drive.slip[3] += 0.008
    drive.run(0.2)
    drive.slip[4] += 0.008
    stated = drive.run(0.5)
    assert not stated.known[0]
    assert stated.reasons == (Objection.RAIL_CHANGED,)
    assert np.abs(drive.error(stated)).max() < 0.0015
    # It is asked for when the change has passed under the last axle.
    assert drive.run(1.5).relief_wanted[0]
    assert drive.relieve(1).known[0]


def test_a_larger_effort_needs_another_relief():
    drive = StraightDrive()
    drive.run(2.0)
    for axle in range(3):
        drive.relieve(axle)
    for _ in range(20):
        drive.adhesion *= 1.015
        drive.slip *= 1.015**2
        stated = drive.run(0.2)
    assert not stated.known[0]
    assert stated.reasons == (Objection.EFFORTS_ROSE,)


def test_a_speed_by_satellites_corrects_the_speed():
    drive = StraightDrive()
    before = drive.run(5.0).speed[0]
    stated = drive.run(30.0, gnss=15.0)
    assert abs(before - 15.0) > abs(stated.speed[0] - 15.0)
    assert stated.speed[0] == pytest.approx(15.0, abs=0.03)
    assert stated.slow_variance[0] < 0.03**2


def test_coasting_is_no_relief():
    drive = StraightDrive(adhesion=0.0)
    stated = drive.run(10.0)
    assert not stated.known[0]
    assert np.isinf(stated.since_relief_s[0])
