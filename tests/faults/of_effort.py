"""Faults of the efforts."""

from collections.abc import Mapping

import numpy as np

from tests.faults.case import Case, held, late, of_axles, plus, spoil, times
from tests.faults.kinds import Kind
from tests.faults.locomotive import AXLES
from tests.faults.rail import Floats
from tests.faults.sensors import Readings

NOISE, TOP = 1500.0, 327_660.0


def _at_top(values: Floats, _: Floats, case: Case) -> Floats:
    sign = np.where(values < 0, -1.0, 1.0)
    return sign * (TOP - NOISE * case.size * np.abs(case.rng.standard_normal(values.shape)))


def _at_zero(values: Floats, _: Floats, case: Case) -> Floats:
    return NOISE * case.size * case.rng.standard_normal(values.shape)


def _reversed(values: Floats, _: Floats, __: Case) -> Floats:
    return -values


def _noise(values: Floats, _: Floats, case: Case) -> Floats:
    return values + case.size * NOISE * case.rng.standard_normal(values.shape)


def _coarse(values: Floats, _: Floats, case: Case) -> Floats:
    return np.rint(values / case.size) * case.size


def _limited(values: Floats, _: Floats, case: Case) -> Floats:
    """Efforts that end at a share 1 − size of the largest one so far."""
    most = (1 - case.size) * np.abs(values).max(initial=1.0)
    return np.clip(values, -most, most)


def _swapped(readings: Readings, case: Case) -> Readings:
    first, second = case.axle % 3, 3 + case.axle % 3
    effort = np.array(readings.effort)
    on = case.active(readings.times("effort"))
    effort[np.ix_(on, [first, second])] = effort[np.ix_(on, [second, first])]
    return readings.changed(effort=effort)


def _efforts(change, count: int = AXLES):
    return spoil("effort", of_axles(change, count))


KINDS: Mapping[str, Kind] = {
    "efforts_at_top": Kind((1.0, 2.0), "noise", _efforts(_at_top)),
    "efforts_times_five": Kind((4.0, 8.0), "gain", _efforts(times), unseen=True),
    "efforts_a_fifth": Kind((-0.8, -0.9), "gain", _efforts(times), unseen=True),
    "efforts_gain": Kind((0.05, 0.10), "gain", _efforts(times), unseen=True),
    "efforts_zero": Kind((1.0, 2.0), "noise", _efforts(_at_zero)),
    "effort_zero": Kind((1.0, 2.0), "noise", _efforts(_at_zero, 1)),
    "efforts_reversed": Kind(spoil=_efforts(_reversed)),
    "effort_reversed": Kind(spoil=_efforts(_reversed, 1)),
    "efforts_more": Kind((20e3, 40e3), "N", _efforts(plus)),
    "effort_more": Kind((20e3, 40e3), "N", _efforts(plus, 1)),
    "efforts_frozen": Kind((1.0, 2.0), "noise", _efforts(held(NOISE))),
    "efforts_late": Kind((0.3, 0.6), "s", late("effort")),
    "efforts_noisy": Kind((10.0, 20.0), "times", _efforts(_noise)),
    "efforts_coarse": Kind((10e3, 20e3), "N", _efforts(_coarse)),
    "efforts_limited": Kind((0.1, 0.2), "share", _efforts(_limited)),
    "efforts_swapped": Kind(spoil=_swapped),
}
