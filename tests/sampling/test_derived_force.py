"""A force that was computed from the speed has the speed's noise; one that was measured has not."""

import numpy as np
import pytest

from adhesion_can.sampling.derived_force import find_derived_force

STEP_S = 0.05


def vehicle(seed, rows=1500):
    """Stamps, true speed and true rate of change of a vehicle that speeds up and brakes."""
    rng, t = np.random.default_rng(seed), np.arange(rows) * STEP_S
    periods = rng.uniform(1.5, 9.0, 3)
    rate = sum(np.sin(2 * np.pi * t / p + rng.uniform(0, 6)) for p in periods) * 0.6
    return rng, t, 12.0 + np.cumsum(rate) * STEP_S, rate


def stamps(t):
    return np.round(t * 1e6).astype(np.int64)


@pytest.mark.parametrize("span", [1, 2, 3])
def test_a_force_from_the_speed_is_found(span):
    found = 0
    for seed in range(20):
        rng, t, v, _ = vehicle(seed)
        read = v + 0.006 * rng.standard_normal(len(t))
        force = np.zeros(len(t))
        force[span:-span] = (read[2 * span :] - read[: -2 * span]) / (2 * span * STEP_S)
        # In any unit, and rounded as such tables are.
        written = np.round(0.1 * force[span:-span] + 0.002 * rng.standard_normal(), 5)
        inner = slice(span, -span)
        one = find_derived_force(stamps(t)[inner], np.round(read[inner], 5), written)
        found += one is not None and one.explained > 0.9
    assert found >= 19


@pytest.mark.parametrize("noise", [0.0, 0.002, 0.02])
@pytest.mark.parametrize("force_noise", [0.0, 0.02, 0.1])
def test_a_measured_force_that_drives_the_vehicle_is_not(noise, force_noise):
    """Mass times the rate of change, as mechanics has it, and noise of its own: 0 of 20 seeds."""
    for seed in range(20):
        rng, t, v, rate = vehicle(seed)
        read = v + noise * rng.standard_normal(len(t))
        force = rate + force_noise * rng.standard_normal(len(t))
        assert find_derived_force(stamps(t), read, force) is None


@pytest.mark.parametrize(("beside", "is_found"), [(0.1, True), (1.5, False)])
def test_a_force_that_is_mostly_of_another_origin_is_not(beside, is_found):
    """It has the noise of the speed, and beside it a slow part with a share of its variance."""
    for seed in range(20):
        rng, t, v, rate = vehicle(seed)
        read = v + 0.006 * rng.standard_normal(len(t))
        slow = beside * np.std(rate) * np.sqrt(2.0) * np.sin(2 * np.pi * t / 31.0)
        found = find_derived_force(stamps(t), read, np.gradient(read, STEP_S) + slow)
        assert (found is not None) == is_found
        assert found is None or 0.9 < found.explained < 1.0


def test_few_rows_gaps_and_one_stamp_say_nothing():
    rng, t, v, _ = vehicle(1)
    read = v + 0.006 * rng.standard_normal(len(t))
    force = np.gradient(read, STEP_S)
    assert find_derived_force(stamps(t), read, force) is not None
    assert find_derived_force(stamps(t)[:90], read[:90], force[:90]) is None
    assert find_derived_force(0 * stamps(t), read, force) is None
    # Every third step is half as long again, or half as long.
    for share in (1.5, 0.5):
        uneven = np.cumsum(np.tile([1.0, 1.0, share], len(t) // 3) * STEP_S)
        assert find_derived_force(stamps(uneven), read, force) is None
    holes = stamps(t) + np.arange(len(t)) // 3 * 1_000_000
    assert find_derived_force(holes, read, force) is None
