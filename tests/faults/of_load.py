"""Faults of the axle loads."""

from collections.abc import Mapping

from tests.faults.case import Case, held, of_axles, spoil, times
from tests.faults.kinds import Kind
from tests.faults.locomotive import AXLES
from tests.faults.rail import Floats

NOISE = 500.0


def _at_zero(values: Floats, _: Floats, case: Case) -> Floats:
    return NOISE * case.size * abs(case.rng.standard_normal(values.shape))


def _loads(change, count: int = AXLES):
    return spoil("load", of_axles(change, count))


KINDS: Mapping[str, Kind] = {
    "loads_a_third": Kind((-0.66, -0.83), "gain", _loads(times), unseen=True),
    "loads_triple": Kind((2.0, 4.0), "gain", _loads(times), unseen=True),
    "loads_gain": Kind((0.05, 0.10), "gain", _loads(times), unseen=True),
    "loads_zero": Kind((1.0, 2.0), "noise", _loads(_at_zero)),
    "loads_frozen": Kind((1.0, 2.0), "noise", _loads(held(NOISE))),
    "load_half": Kind((-0.5, -0.75), "gain", _loads(times, 1)),
}
