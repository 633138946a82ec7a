"""Inflation of the variance by errors that last, against its theory."""

import numpy as np
import pytest

from adhesion_can.estimation.batch_means import FEWEST
from adhesion_can.estimation.doubt.blocks import BlockSeries, fit_blocks
from adhesion_can.estimation.doubt.lasting_errors import estimate_lasting_errors
from tests.estimation.doubt.doubt_helpers import (
    AXLES,
    DIRECTIONS,
    NOISE,
    THETA,
    make_blocks,
    make_samples,
)


def estimate(seed: int, lasting_s: float, seconds: float = 120.0):
    samples = make_samples(np.random.default_rng(seed), seconds, lasting_s=lasting_s)
    series = BlockSeries(len(DIRECTIONS))
    series.blocks = make_blocks(samples, 2.0)
    reduced = series.reduced(fit_blocks(series.blocks, THETA))
    return estimate_lasting_errors(reduced, reduced.current)


@pytest.mark.costly
def test_independent_errors_are_not_inflated() -> None:
    found = [estimate(seed, 0.0).inflation for seed in range(20)]
    assert np.median(found) < 2.5
    assert max(found) < 4.0


@pytest.mark.parametrize("lasting_s", [0.2, 0.5])
def test_lasting_errors_have_the_inflation_of_an_autoregression(lasting_s: float) -> None:
    """(1 + φ)/(1 − φ) samples an axle count as one; blocks of several times 2 s show all of it."""
    keep = np.exp(-1 / 50 / lasting_s)
    expected = (1 + keep) / (1 - keep)
    found = np.median([estimate(seed, lasting_s).inflation for seed in range(12)])
    assert 0.5 * expected < found < 2.0 * expected


def test_the_level_scatters_by_what_lasts() -> None:
    """Means of a block of an AR(1) of 5 s keep most of its standard deviation, over four axles."""
    found = np.median([estimate(seed, 5.0).level_std for seed in range(10)])
    std = NOISE / np.sqrt(AXLES)
    assert 0.5 * std < found < 1.6 * std


def test_too_few_blocks_say_nothing() -> None:
    samples = make_samples(np.random.default_rng(1), 4.0)
    series = BlockSeries(len(DIRECTIONS))
    series.blocks = make_blocks(samples, 1.0)
    reduced = series.reduced(fit_blocks(series.blocks, THETA))
    assert len(series.blocks) < FEWEST
    assert estimate_lasting_errors(reduced, reduced.current) is None
