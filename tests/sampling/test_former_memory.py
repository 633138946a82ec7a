"""A former keeps a fraction of a second of readings, whatever input is silent."""

import gc
import tracemalloc

import pytest

from adhesion_can.physics.readings import Reading, Role
from adhesion_can.physics.vehicle import Locomotive
from adhesion_can.sampling.former import SampleFormer

CYCLES = {
    Role.WHEEL_SPEED: 10_000,
    Role.VEHICLE_SPEED: 20_000,
    Role.TRACTIVE_EFFORT: 10_000,
    Role.AXLE_LOAD: 200_000,
}
W, V, F, N = Role.WHEEL_SPEED, Role.VEHICLE_SPEED, Role.TRACTIVE_EFFORT, Role.AXLE_LOAD


@pytest.mark.costly
@pytest.mark.parametrize("when", ["never", "stops"])
@pytest.mark.parametrize("silent", [W, V, F, (W, 2), (F, 2)], ids=str)
def test_memory_stays_bounded_when_an_input_is_silent(silent, when):
    vehicle = Locomotive(wheel_radius=(0.6, 0.6), axle_load=(2e5, 2e5), geometry=None)
    former = SampleFormer(vehicle, CYCLES)
    stop_us = 0 if when == "never" else 500_000

    def run(first, last):
        for k in range(first, last):
            t = 10_000 * k
            for role, axle in ((V, 0), (W, 1), (W, 2), (F, 1), (F, 2), (N, 1), (N, 2)):
                if t < stop_us or silent not in (role, (role, axle)):
                    former.add(Reading(t, role, axle, 2e5 if role is N else 15.0 + k % 7))
            if k % 2:
                former.collect(t).to_rows()

    run(0, 400)
    # CPython keeps some freed tuples of each length for later: they are no growth of ours.
    spare = [tuple([k] * length) for length in range(1, 21) for k in range(2100)]
    del spare
    tracemalloc.start()
    try:
        run(400, 500)
        # Circles of whatever else runs in this process are no growth either.
        gc.collect()
        before = tracemalloc.get_traced_memory()[0]
        run(500, 3000)
        gc.collect()
        grown = tracemalloc.get_traced_memory()[0] - before
    finally:
        tracemalloc.stop()
    assert grown < 40_000  # 25 s; what is kept for ever comes to some hundred kB
