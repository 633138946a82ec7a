"""A peak is identified only where one curve holds for traction and braking."""

import numpy as np
import pytest

from adhesion_can import identify
from adhesion_can.result_text import TimeScale
from tests.seeds import first_quick

SEEDS = range(20)
FEW = range(3)
"""Seeds where the families of curves are judged as well: seconds each, all of them are slow."""


def contact(seed, rows=4000, top=0.1, mu=0.35, noise=0.01):
    """Slips in both directions and the adhesions of one curve, with noise."""
    rng = np.random.default_rng(seed)
    slip = rng.uniform(-top, top, rows)
    size = np.abs(slip)
    adhesion = np.sign(slip) * (mu * (1 - np.exp(-60 * size)) - 0.8 * size)
    return slip, adhesion + noise * rng.standard_normal(rows), rng


@pytest.mark.costly
@pytest.mark.parametrize("noise", first_quick([0.03, 0.003, 0.1]))
@pytest.mark.parametrize("seeds", [FEW, pytest.param(SEEDS, marks=pytest.mark.slow)], ids=len)
def test_one_curve_is_identified_whatever_the_noise(noise, seeds):
    found = [identify(*contact(seed, noise=noise)[:2]).segments[0] for seed in seeds]
    assert all(one.directions.agree for one in found)
    assert all(one.estimate.identifiable.mu_max for one in found)


@pytest.mark.parametrize("factor", [0.6, 1.6, 2.2])
def test_another_adhesion_in_braking_leaves_no_identifiable_peak(factor):
    for seed in SEEDS:
        slip, adhesion, _ = contact(seed)
        (one,) = identify(slip, np.where(slip < 0, factor, 1.0) * adhesion).segments
        assert not one.estimate.identifiable.mu_max
        assert np.sign(one.directions.difference) == np.sign(1.0 - factor)
        assert "adhesion in traction" in one.sentence(TimeScale())


def test_slips_without_a_force_are_no_fall_beyond_a_peak():
    # The steep, straight side of a curve in all rows but those of bends, where slip has no force.
    for seed in SEEDS:
        rng = np.random.default_rng(seed)
        slip = 0.004 * rng.standard_normal(5000)
        adhesion = 8.0 * slip + 0.01 * rng.standard_normal(5000)
        bend = rng.random(5000) < 0.15
        slip = np.where(bend, 0.03 * rng.standard_normal(5000), slip)
        adhesion = np.where(bend, 0.02 * rng.standard_normal(5000), adhesion)
        (one,) = identify(slip, adhesion).segments
        assert not one.estimate.identifiable.mu_max
        assert one.directions.opposite > 0.25
        assert "opposite signs" in one.sentence(TimeScale())


@pytest.mark.costly
@pytest.mark.parametrize("seeds", [FEW, pytest.param(SEEDS, marks=pytest.mark.slow)], ids=len)
def test_a_mild_asymmetry_leaves_the_peak_identified(seeds):
    # The library's own effect of typical size.
    for seed in seeds:
        slip, adhesion, _ = contact(seed)
        (one,) = identify(slip, np.where(slip < 0, 0.9, 1.0) * adhesion).segments
        assert one.directions.agree
