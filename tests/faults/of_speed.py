"""Faults of the vehicle speed."""

from collections.abc import Mapping

import numpy as np

from tests.faults.case import Case, held, late, plus, spoil, times
from tests.faults.kinds import Kind
from tests.faults.rail import Floats
from tests.faults.sensors import SPEED_S, Readings

NOISE, TOP = 0.015, 131.06


def _drift(values: Floats, since: Floats, case: Case) -> Floats:
    return values + case.size * since


def _noise(values: Floats, _: Floats, case: Case) -> Floats:
    return values + case.size * NOISE * case.rng.standard_normal(values.shape)


def _at_rest(values: Floats, _: Floats, case: Case) -> Floats:
    return case.size * 0.003 * (1 + case.rng.uniform(-1, 1, values.shape))


def _at_top(values: Floats, _: Floats, case: Case) -> Floats:
    return TOP - case.size * NOISE * np.abs(case.rng.standard_normal(values.shape))


def _spikes(values: Floats, _: Floats, case: Case) -> Floats:
    rng = case.rng
    hit = rng.uniform(size=values.shape) < 0.02 * case.size
    return np.where(hit, rng.uniform(0, 40.0, values.shape), values)


def _steps(values: Floats, _: Floats, case: Case) -> Floats:
    """Speed in coarse steps of the size, m/s, as from a display."""
    return np.rint(values / case.size) * case.size


def _low_passed(readings: Readings, case: Case) -> Readings:
    """A first-order low-pass of the size, s, that begins in its steady state."""
    on = case.active(readings.times("speed"))
    share = float(-np.expm1(-SPEED_S / case.size))
    speed = np.array(readings.speed)
    last = float("nan")
    for row in np.flatnonzero(on):
        last = speed[row] if np.isnan(last) else last + share * (readings.speed[row] - last)
        speed[row] = last
    return readings.changed(speed=speed)


KINDS: Mapping[str, Kind] = {
    "speed_frozen": Kind(spoil=spoil("speed", held(0.0))),
    "speed_frozen_noisy": Kind((1.0, 2.0), "noise", spoil("speed", held(NOISE))),
    "speed_low": Kind((-0.05, -0.10), "gain", spoil("speed", times)),
    "speed_rather_low": Kind((-0.02, -0.04), "gain", spoil("speed", times)),
    "speed_rather_high": Kind((0.02, 0.04), "gain", spoil("speed", times)),
    "speed_high": Kind((0.05, 0.10), "gain", spoil("speed", times)),
    "speed_less": Kind((-0.3, -0.6), "m/s", spoil("speed", plus)),
    "speed_more": Kind((0.3, 0.6), "m/s", spoil("speed", plus)),
    "speed_drifts_up": Kind((0.02, 0.04), "m/s²", spoil("speed", _drift)),
    "speed_drifts_down": Kind((-0.02, -0.04), "m/s²", spoil("speed", _drift)),
    "speed_low_passed": Kind((2.0, 4.0), "s", _low_passed),
    "speed_late": Kind((0.5, 1.0), "s", late("speed")),
    "speed_very_late": Kind((1.5, 3.0), "s", late("speed")),
    "speed_at_rest": Kind((1.0, 2.0), "noise", spoil("speed", _at_rest)),
    "speed_at_top": Kind((1.0, 2.0), "noise", spoil("speed", _at_top)),
    "speed_noisy": Kind((10.0, 20.0), "times", spoil("speed", _noise)),
    "speed_spikes": Kind((1.0, 2.0), "2 %", spoil("speed", _spikes)),
    "speed_coarse": Kind((0.28, 0.56), "m/s", spoil("speed", _steps)),
}
