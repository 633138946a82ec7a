"""Tails of the vehicles' statistics, and how sure a vehicle must stand out of a large fleet."""

import numpy as np
import pytest

from adhesion_can.fleet.compare_vehicles import FREEDOMS, compare_vehicles, discoveries, fit_freedom

EFFECTS = 26


@pytest.mark.parametrize("seed", range(10))
def test_a_small_fleet_keeps_the_widest_tails(seed):
    normal = np.random.default_rng(seed).standard_normal(10 * EFFECTS)
    assert fit_freedom(normal) == FREEDOMS[0]


@pytest.mark.parametrize("seed", range(10))
def test_a_large_fleet_shows_how_wide_its_tails_are(seed):
    rng = np.random.default_rng(seed)
    count = 200 * EFFECTS
    assert fit_freedom(rng.standard_normal(count)) == FREEDOMS[-1]
    assert fit_freedom(rng.standard_t(FREEDOMS[0], count)) == FREEDOMS[0]


def test_nobody_says_nothing_about_tails():
    assert fit_freedom(np.empty(0)) == FREEDOMS[0]


def named(rng, vehicles, odd):
    """Whether the first vehicle is chosen, by how much it is odd, and the number of the others."""
    size = rng.standard_normal((vehicles, EFFECTS))
    size[0, 3] = odd
    compared = compare_vehicles(
        [f"L{k:03}" for k in range(vehicles)], size, np.ones((vehicles, EFFECTS))
    )
    chosen = discoveries(compared.smallest, 0.025)
    return bool(chosen[0]), int(chosen[1:].sum())


def test_a_vehicle_stands_out_of_a_large_fleet_as_of_a_small_one():
    found = [named(np.random.default_rng(seed), 200, 9.0) for seed in range(20)]
    assert sum(first for first, _ in found) == 20
    assert sum(others for _, others in found) == 0


def test_nobody_is_named_where_nobody_is_odd():
    found = [named(np.random.default_rng([1, seed]), 200, 0.0) for seed in range(40)]
    assert sum(first + others for first, others in found) <= 1
