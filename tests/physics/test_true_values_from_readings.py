"""True values from readings with errors by several laws, against readings made wrong by hand."""

from dataclasses import dataclass, replace

import numpy as np
import pytest

from adhesion_can.physics.instrument_laws import (
    LoadShift,
    Quantity,
    ReadingError,
    Situation,
    remove_errors,
)
from adhesion_can.physics.lag_states import LagStates
from adhesion_can.physics.vehicle import Locomotive

VEHICLE = Locomotive()
AXLES = np.arange(1.0, 7.0)


@dataclass(frozen=True)
class Law:
    """An error of three numbers, or of as many arrays."""

    quantity: Quantity
    relative: object = 0.0
    absolute: object = 0.0
    relative_rate: object = 0.0

    def error(self, _situation, _lags):
        return ReadingError(self.relative, self.absolute, self.relative_rate)


def situation(**changes):
    """True values of six axles at one time."""
    given = Situation(
        time_s=np.full(6, 3.0),
        axle=AXLES,
        wheel_speed=np.linspace(20.0, 22.0, 6),
        wheel_accel=np.linspace(-1.0, 1.5, 6),
        speed=np.full(6, 12.5),
        effort=np.linspace(-2e4, 3e4, 6),
        load=np.linspace(2.3e5, 2.5e5, 6),
        vehicle=VEHICLE,
    )
    return replace(given, **changes)


def removed(readings, *laws):
    return remove_errors(laws, readings, LagStates())


def test_each_error_is_taken_off_its_own_reading():
    true = situation()
    readings = situation(
        effort=true.effort * 1.25 + 400.0, load=true.load * 0.8 - 300.0, speed=true.speed * 1.1
    )
    found = removed(
        readings,
        Law(Quantity.EFFORT, 0.25, 400.0),
        Law(Quantity.LOAD, -0.2, -300.0),
        Law(Quantity.SPEED, 0.1),
    )
    for name in ("effort", "load", "speed", "wheel_speed", "wheel_accel", "axle"):
        assert getattr(found.values, name) == pytest.approx(getattr(true, name), rel=1e-12), name


def test_the_force_gain_is_how_far_adhesion_as_read_follows_the_true_one():
    """The oracle reads a second effort: adhesion as read grows by the gain times as much."""
    true = situation()

    def read(effort):
        return (1.25 * effort + 400.0) / (0.8 * true.load - 300.0)

    found = removed(
        situation(effort=1.25 * true.effort + 400.0, load=0.8 * true.load - 300.0),
        Law(Quantity.EFFORT, 0.25, 400.0),
        Law(Quantity.LOAD, -0.2, -300.0),
    )
    grown = (read(true.effort + 1e3) - read(true.effort)) / (1e3 / true.load)
    assert found.force_gain == pytest.approx(grown, rel=1e-9)
    assert removed(true).force_gain == 1.0


def test_a_wheel_speed_whose_error_changes_loses_it_in_its_acceleration_too():
    """ω (1 + e) with e that changes in time; its acceleration by a difference quotient."""
    true, dt = situation(), 1e-6
    error, rate = np.linspace(-0.2, 0.3, 6), np.linspace(0.5, -0.4, 6)
    read = true.wheel_speed * (1.0 + error)
    later = (true.wheel_speed + true.wheel_accel * dt) * (1.0 + error + rate * dt)
    found = removed(
        situation(wheel_speed=read, wheel_accel=(later - read) / dt),
        Law(Quantity.WHEEL_SPEED, error, relative_rate=rate),
    )
    assert found.values.wheel_speed == pytest.approx(true.wheel_speed, rel=1e-12)
    assert found.values.wheel_accel == pytest.approx(true.wheel_accel, abs=1e-4)


@pytest.mark.parametrize("travel", [1.0, -1.0])
def test_loads_move_to_the_axles_behind_and_each_axle_gets_its_own(travel):
    """The front axles lose what the rear ones gain, as far as the vehicle goes that way."""
    efforts = np.array([30e3, 0.0, 10e3, 20e3, -5e3, 15e3])
    order = [4, 0, 5, 2, 1, 3]  # rows need not be in the order of the axles
    readings = situation(
        axle=AXLES[order], efforts=np.tile(efforts, (6, 1)), travel=np.full(6, travel)
    )
    found = removed(readings, LoadShift(1.0)).values.load - readings.load
    wanted = travel * VEHICLE.transfer_shares() @ efforts
    assert found == pytest.approx(wanted[order], rel=1e-12)
    assert found.sum() == pytest.approx(0.0, abs=1e-6)
    whole = removed(replace(readings, efforts=np.full((6, 6), 20e3)), LoadShift(1.0))
    moved = dict(zip(readings.axle, whole.values.load - readings.load, strict=True))
    assert (moved[1.0] < 0.0) == (travel > 0.0)
    assert (moved[6.0] > 0.0) == (travel > 0.0)
    half = removed(readings, LoadShift(0.5)).values.load - readings.load
    assert half == pytest.approx(0.5 * found, rel=1e-9)


def test_without_what_the_law_needs_the_load_is_not_a_number():
    readings = situation(efforts=np.zeros((6, 6)))
    for missing in ({"vehicle": None}, {"efforts": None}):
        found = removed(replace(readings, **missing), LoadShift(1.0)).values
        assert np.isnan(found.load).all()
        assert found.effort.tolist() == readings.effort.tolist()
