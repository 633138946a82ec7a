"""Faults of the wheel speeds."""

from collections.abc import Mapping

import numpy as np

from tests.faults.case import Case, both, held, late, of_axles, spoil, times
from tests.faults.kinds import Kind
from tests.faults.locomotive import AXLES, RADIUS
from tests.faults.rail import Floats
from tests.faults.sensors import Readings

REST_NOISE, NOISE, TOP = 0.005, 0.0035, 131.0
TEETH_LOST = 0.35
"""Part of a reading that a lost tooth takes, at the size 1."""


def _at_rest(values: Floats, _: Floats, case: Case) -> Floats:
    """0 to 0.01 rad/s with noise."""
    return case.size * REST_NOISE * (1 + case.rng.uniform(-1, 1, values.shape))


def _at_top(values: Floats, _: Floats, case: Case) -> Floats:
    """The end of the range, with noise."""
    return TOP - case.size * NOISE * np.abs(case.rng.standard_normal(values.shape))


def _full_effort(values: Floats, _: Floats, case: Case) -> Floats:
    return 100e3 + 2000 * case.rng.standard_normal(values.shape)


def _larger_radius(values: Floats, _: Floats, case: Case) -> Floats:
    """A wheel that is larger than it is held for turns slower."""
    return values / (1 + case.size)


def _noise(values: Floats, _: Floats, case: Case) -> Floats:
    """Noise of the size times that of a sound sensor."""
    return values + case.size * NOISE * case.rng.standard_normal(values.shape)


def _drift(values: Floats, since: Floats, case: Case) -> Floats:
    """A gain that drifts by the size each second."""
    return values * (1 + case.size * since[:, None])


def _spikes(values: Floats, _: Floats, case: Case) -> Floats:
    """One reading in fifty is anywhere in the range."""
    rng = case.rng
    hit = rng.uniform(size=values.shape) < 0.02 * case.size
    return np.where(hit, rng.uniform(0, TOP, values.shape), values)


def _tooth(readings: Readings, case: Case) -> Readings:
    """Once a turn a wheel's reading is short of what a lost tooth does not tell."""
    t, axle = readings.times("wheel"), case.axle
    wheel = np.array(readings.wheel)
    turns = np.floor(np.cumsum(wheel[:, axle]) * (t[1] - t[0]) / (2 * np.pi))
    hit = np.append(False, np.diff(turns) > 0) & case.active(t)
    wheel[hit, axle] *= 1 - TEETH_LOST * case.size
    return readings.changed(wheel=wheel)


def _swapped(readings: Readings, case: Case) -> Readings:
    """The sensors of two axles of different bogies are exchanged."""
    first, second = case.axle % 3, 3 + case.axle % 3
    wheel = np.array(readings.wheel)
    on = case.active(readings.times("wheel"))
    wheel[np.ix_(on, [first, second])] = wheel[np.ix_(on, [second, first])]
    return readings.changed(wheel=wheel)


def _as_vehicle(readings: Readings, case: Case) -> Readings:
    """Wheel speeds that are made of the vehicle speed: a slip of 0, with the wheels' own noise."""
    t = readings.times("wheel")
    rolling = np.interp(t, readings.times("speed"), readings.speed) / RADIUS
    noise = NOISE * case.size * case.rng.standard_normal(readings.wheel.shape)
    on = case.active(t)[:, None]
    return readings.changed(wheel=np.where(on, rolling[:, None] + noise, readings.wheel))


def _wheels(change, count: int = AXLES):
    return spoil("wheel", of_axles(change, count))


KINDS: Mapping[str, Kind] = {
    "wheels_at_rest": Kind((1.0, 2.0), "noise", _wheels(_at_rest)),
    "wheels_at_rest_five": Kind((1.0, 2.0), "noise", _wheels(_at_rest, 5)),
    "wheels_at_rest_two": Kind((1.0, 2.0), "noise", _wheels(_at_rest, 2)),
    "wheel_at_rest": Kind((1.0, 2.0), "noise", _wheels(_at_rest, 1)),
    "wheels_at_rest_full_effort": Kind(
        (1.0, 2.0), "noise", both(_wheels(_at_rest), spoil("effort", _full_effort))
    ),
    "wheels_at_top": Kind((1.0, 2.0), "noise", _wheels(_at_top)),
    "wheels_fast": Kind((0.5, 1.0), "gain", _wheels(times)),
    "wheels_slow": Kind((-0.5, -0.75), "gain", _wheels(times)),
    "wheel_fast": Kind((0.5, 1.0), "gain", _wheels(times, 1)),
    "wheels_larger": Kind((0.03, 0.06), "radius", _wheels(_larger_radius)),
    "wheels_smaller": Kind((-0.03, -0.06), "radius", _wheels(_larger_radius)),
    "wheel_larger": Kind((0.03, 0.06), "radius", _wheels(_larger_radius, 1)),
    "wheels_late": Kind((0.2, 0.4), "s", late("wheel")),
    "wheels_noisy": Kind((10.0, 20.0), "times", _wheels(_noise)),
    "wheel_noisy": Kind((10.0, 20.0), "times", _wheels(_noise, 1)),
    "wheel_tooth": Kind((1.0, 2.0), "reading", _tooth),
    "wheel_spikes": Kind((1.0, 2.0), "2 %", _wheels(_spikes, 1)),
    "wheels_frozen": Kind((1.0, 2.0), "noise", _wheels(held(NOISE))),
    "wheel_frozen": Kind((1.0, 2.0), "noise", _wheels(held(NOISE), 1)),
    "wheel_drifts": Kind((0.005, 0.01), "gain/s", _wheels(_drift, 1)),
    "wheels_roll": Kind((1.0, 2.0), "noise", _as_vehicle),
    "wheels_swapped": Kind(spoil=_swapped),
}
