"""The rim of one wheel as reference of the slips, reading by reading and in columns."""

import numpy as np

from adhesion_can.physics.readings import Reading, Role
from adhesion_can.physics.vehicle import Locomotive
from adhesion_can.sampling.rim_speed import RimSpeed

VEHICLE = Locomotive(wheel_radius=(0.6, 0.625, 0.625, 0.625, 0.625, 0.625))


def wheel(t_us, axle, value):
    return Reading(t_us, Role.WHEEL_SPEED, axle, value)


def test_the_speed_follows_the_readings_of_its_frame():
    readings = [wheel(5, 1, 20.0), wheel(5, 2, 30.0)]
    found = RimSpeed(VEHICLE).add_to(iter(readings))
    assert found == [*readings, Reading(5, Role.VEHICLE_SPEED, 0, 0.6 * 20.0)]


def test_a_wheel_that_is_not_available_gives_no_speed():
    assert RimSpeed(VEHICLE).add_to([wheel(5, 1, None)])[-1].value is None


def test_frames_without_the_wheel_have_no_speed():
    readings = [wheel(5, 2, 30.0), Reading(5, Role.TRACTIVE_EFFORT, 1, 1e4)]
    assert RimSpeed(VEHICLE).add_to(readings) == readings


def test_columns_have_the_same_speeds():
    values = [20.0, 20.1, np.nan, 19.7]
    stamps = np.array([5, 15, 25, 35])
    columns = {(Role.WHEEL_SPEED, 1): (stamps, np.array(values))}
    t_us, speed = RimSpeed(VEHICLE).add_to_columns(columns)[Role.VEHICLE_SPEED, 0]
    rim = RimSpeed(VEHICLE)
    one_by_one = [
        rim.add_to([wheel(t, 1, None if np.isnan(x) else x)])[-1].value
        for t, x in zip(stamps.tolist(), values, strict=True)
    ]
    assert t_us.tolist() == stamps.tolist()
    assert np.array(one_by_one, dtype=float).tobytes() == speed.tobytes()
    other = {(Role.WHEEL_SPEED, 2): (stamps, np.array(values))}
    assert rim.add_to_columns(other) is other
