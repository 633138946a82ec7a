"""Faults of the axle loads."""

from collections.abc import Mapping

import numpy as np

from tests.faults.case import Case, held, of_axles, spoil, times
from tests.faults.kinds import Kind
from tests.faults.locomotive import AXLES
from tests.faults.rail import Floats

NOISE, TOP = 500.0, 655_340.0


def _at_zero(values: Floats, _: Floats, case: Case) -> Floats:
    return NOISE * case.size * np.abs(case.rng.standard_normal(values.shape))


def _at_top(values: Floats, _: Floats, case: Case) -> Floats:
    """Three times the load and more stand at the end of the range."""
    return TOP - NOISE * case.size * np.abs(case.rng.standard_normal(values.shape))


def _loads(change, count: int = AXLES):
    return spoil("load", of_axles(change, count))


KINDS: Mapping[str, Kind] = {
    "loads_a_third": Kind((-0.66, -0.83), "gain", _loads(times), unseen=True),
    "loads_high": Kind((0.8, 1.6), "gain", _loads(times), unseen=True),
    "loads_at_top": Kind((1.0, 2.0), "noise", _loads(_at_top)),
    "loads_gain": Kind((0.05, 0.10), "gain", _loads(times), unseen=True),
    "loads_zero": Kind((1.0, 2.0), "noise", _loads(_at_zero)),
    "loads_frozen": Kind((1.0, 2.0), "noise", _loads(held(NOISE))),
    "load_half": Kind((-0.5, -0.75), "gain", _loads(times, 1)),
}
