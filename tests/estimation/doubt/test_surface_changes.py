"""Which changes of the surface are confirmed: blocks of made-up samples, one candidate each."""

from dataclasses import replace

import numpy as np
import pytest

from adhesion_can.estimation.doubt.blocks import CURVE, TANGENTS, BlockSeries, fit_blocks
from adhesion_can.estimation.doubt.directions import LOAD, SPEED, TIME
from adhesion_can.estimation.doubt.pooled_curve import PooledCurve
from adhesion_can.estimation.doubt.surface_changes import (
    BUMP_STD,
    _precision,
    find_confirmed_change,
)
from tests.estimation.doubt.doubt_helpers import (
    DIRECTIONS,
    NAMES,
    THETA,
    curve,
    make_blocks,
    make_samples,
)

BEFORE = 20


def made(seed=1, factor=1.0, after=6, load_step=1.0, load_exponent=0.0, every=1):
    """A drive of 1 s blocks, the adhesion after the candidate times a factor, and its candidate.

    Args:
        seed: Seed of the noise.
        factor: Factor of the adhesion from the candidate on.
        after: Number of blocks from there on.
        load_step: Factor of the loads from there on.
        load_exponent: Exponent by which the adhesion falls with the load.
        every: One of so many samples is there, from there on.

    """
    samples = make_samples(np.random.default_rng(seed), float(BEFORE + after))
    later = samples.t_us >= BEFORE * 1e6
    load = np.where(later, load_step, 1.0) * samples.load
    level = np.where(later, factor, 1.0) * (load / 2.2e5) ** -load_exponent
    plain = curve(samples.slip)
    adhesion = level * plain + samples.adhesion - plain
    left = ~later | (np.arange(len(samples)) // 4 % every == 0)
    series = BlockSeries(len(DIRECTIONS), [NAMES.index(TIME)])
    series.block_s = 1.0
    series.blocks = make_blocks(replace(samples, adhesion=adhesion, load=load).select(left))
    series.candidates = [BEFORE]
    return series


def confirmed(series):
    at = PooledCurve(fit_blocks(series.blocks, THETA).theta)
    return find_confirmed_change(series, at, DIRECTIONS)


@pytest.mark.parametrize("factor", [0.5, 0.7, 1.4])
def test_a_change_is_confirmed_from_the_second_block_on(factor):
    for seed in range(3):
        assert confirmed(made(seed, factor, after=1)) is None
        assert confirmed(made(seed, factor, after=2)) == BEFORE
        assert confirmed(made(seed, factor)) == BEFORE


@pytest.mark.parametrize("factor", [0.92, 1.0, 1.08])
def test_a_change_of_less_than_an_eighth_is_none_however_certain(factor):
    for seed in range(3):
        assert confirmed(made(seed, factor)) is None


def test_a_large_change_that_few_samples_show_is_none_yet():
    """Two blocks of four samples each; sixteen of each axle show it."""
    for seed in range(3):
        assert confirmed(made(seed, 0.7, after=2, every=50)) is None
        assert confirmed(made(seed, 0.7, after=2, every=3)) == BEFORE


def test_what_the_load_explains_is_no_change():
    """The loads rise by 60 % there, and the adhesion falls with their root to 0.79."""
    for seed in range(3):
        assert confirmed(made(seed, load_step=1.6, load_exponent=0.5)) is None
        # The same fall without the load that explains it.
        assert confirmed(made(seed, factor=1.6**-0.5)) == BEFORE


@pytest.mark.parametrize(("after", "waits"), [(1, True), (2, True), (5, True), (6, False)])
def test_a_candidate_waits_for_six_seconds(after, waits):
    series = made(after=after)
    assert confirmed(series) is None
    assert series.candidates == [BEFORE] * waits


def test_of_two_candidates_the_first_that_is_one_is_confirmed():
    series = made(factor=0.6, after=4)
    series.candidates = [BEFORE - 4, BEFORE]
    assert confirmed(series) in {BEFORE - 4, BEFORE}
    series = made(factor=1.0, after=4)
    series.candidates = [BEFORE - 4, BEFORE]
    assert confirmed(series) is None
    assert series.candidates == [BEFORE]


def test_what_may_be_wrong_beside_a_change_has_its_plausible_size():
    found = [_precision(k, DIRECTIONS) for k in range(CURVE + len(DIRECTIONS))]
    assert found[:TANGENTS] == [0.0] * TANGENTS
    assert found[TANGENTS:CURVE] == pytest.approx([1.0 / BUMP_STD**2] * (CURVE - TANGENTS))
    assert found[CURVE + NAMES.index(LOAD)] == pytest.approx(1.0 / 4.0**2)
    assert found[CURVE + NAMES.index(SPEED)] == pytest.approx(1.0 / 0.5**2)
