"""Reversed wheel speeds, wrong units and diameters for radii, from rim and vehicle speed."""

import math

import numpy as np
import pytest

from adhesion_can.offline.rim_speed import inspect_rim_speeds, known_ratio, slips_of_traces
from adhesion_can.physics.readings import Role
from adhesion_can.physics.vehicle import Locomotive
from adhesion_can.sampling.traces import Trace


def slips(seed, ratio=1.0, rows=500):
    """Slips of a drive whose rims are read at a multiple of their speed."""
    rng = np.random.default_rng(seed)
    true = 0.08 * np.sin(np.arange(rows) / 20.0) + 0.002 * rng.standard_normal(rows)
    return ratio * (1.0 + true) - 1.0


@pytest.mark.parametrize("seed", range(5))
def test_sound_speeds_and_spinning_wheels_are_no_finding(seed):
    rng = np.random.default_rng(seed)
    assert inspect_rim_speeds({1: slips(seed), 2: slips(seed + 9)}) == []
    assert known_ratio(rng.uniform(0.0, 2.5, 400)) is None
    assert known_ratio(rng.uniform(-1.0, 0.9, 400)) is None
    assert known_ratio(slips(seed, -1.0, rows=5)) is None


@pytest.mark.parametrize(
    ("ratio", "says"),
    [
        (-1.0, "change sign of wheel_speed"),
        (1 / 3.6, "vehicle_speed: it may be in km/h"),
        (30 / math.pi, "wheel_speed: it may be in rpm"),
        (math.pi / 30, "it may be in rad/s, not in rpm"),
        (0.5 / math.pi, "it may be in 1/s"),
        (2.0, "it may be a diameter"),
        (1000.0, "it may be in mm"),
    ],
)
def test_a_known_ratio_is_told_with_its_axles_and_fix(ratio, says):
    (finding,) = inspect_rim_speeds({1: slips(1), 2: slips(2, ratio), 4: slips(4, ratio)})
    assert finding.what.startswith("axles 2, 4: the rim speed is")
    assert says in finding.fix
    assert finding.fatal


def test_slips_of_traces_are_those_of_the_formula():
    """ω r / v − 1 at the wheel's stamps, whatever their size; nothing below v_min."""
    vehicle = Locomotive()
    t_us = np.arange(0, 1_000_000, 10_000, dtype=np.int64)
    v = np.where(t_us < 500_000, 10.0, 0.1)
    omega = np.where(t_us % 100_000 == 0, np.nan, -10.0 / vehicle.wheel_radius[0])
    traces = {
        (Role.VEHICLE_SPEED, 0): Trace(t_us, v),
        (Role.WHEEL_SPEED, 1): Trace(t_us, omega),
    }
    found = slips_of_traces(traces, vehicle, v_min=1.0)
    assert list(found) == [1]
    assert len(found[1]) == 45
    assert np.allclose(found[1], -2.0)
    assert slips_of_traces({}, vehicle, v_min=1.0) == {}
