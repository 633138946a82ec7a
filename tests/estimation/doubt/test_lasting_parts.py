"""Errors that last, from scores of blocks that are drawn by themselves."""

from dataclasses import replace

import numpy as np
import pytest

from adhesion_can.estimation.batch_means import FEWEST, batch_inflation
from adhesion_can.estimation.doubt.blocks import ReducedBlocks
from adhesion_can.estimation.doubt.lasting_errors import (
    LastingErrors,
    estimate_lasting_errors,
    slip_inflation,
)

BLOCKS, SIZE, SCALE = 60, 4, 2


def drawn(level_std, seed=1, inflation=1.0):
    """Scores of blocks whose level differs, with noise of the variance that they state."""
    rng = np.random.default_rng(seed)
    information = rng.uniform(50.0, 150.0, BLOCKS)
    grams = rng.uniform(-20.0, 20.0, (BLOCKS, SIZE, SIZE))
    grams = grams + grams.transpose(0, 2, 1)
    for k in range(SIZE):
        grams[:, k, k] = information
    noise = np.sqrt(inflation * information)[:, None] * rng.standard_normal((BLOCKS, SIZE))
    level = level_std * rng.standard_normal((BLOCKS, SIZE)) * information[:, None]
    return ReducedBlocks(
        grams, np.zeros((SIZE, SIZE)), level + noise, BLOCKS, information.copy(), 1.0
    )


def test_the_level_scatters_by_what_was_drawn_beside_the_noise():
    found = [estimate_lasting_errors(drawn(0.3, seed), BLOCKS).level_std for seed in range(60)]
    assert np.sqrt(np.mean(np.square(found))) == pytest.approx(0.3, rel=0.05)
    none = [estimate_lasting_errors(drawn(0.0, seed), BLOCKS).level_std for seed in range(60)]
    assert np.mean(none) < 0.04  # a tenth of the noise of a block


def test_what_is_estimated_besides_is_taken_off_the_scores():
    blocks, change = drawn(0.2), np.array([0.5, -0.3, 0.1, 0.7])
    moved = replace(blocks, scores=blocks.scores + blocks.grams @ change)
    wanted = estimate_lasting_errors(blocks, BLOCKS)
    assert estimate_lasting_errors(moved, BLOCKS, change) == pytest.approx(wanted)
    assert estimate_lasting_errors(moved, BLOCKS).level_std != pytest.approx(wanted.level_std)


def test_only_the_first_blocks_that_are_known_count():
    blocks = drawn(0.2)
    spoilt = replace(blocks, scores=blocks.scores.copy(), grams=blocks.grams.copy())
    spoilt.scores[40:] *= 100.0
    spoilt.grams[40:] *= 100.0
    assert estimate_lasting_errors(spoilt, 40) == estimate_lasting_errors(blocks, 40)


@pytest.mark.parametrize("inflation", [1.0, 9.0, 25.0])
def test_the_inflation_is_that_of_the_variance_of_the_scores(inflation):
    found = [
        estimate_lasting_errors(drawn(0.0, seed, inflation), BLOCKS).inflation for seed in range(20)
    ]
    # The length of the blocks that scatters most: above it by chance, and never below 1.
    assert min(found) >= 1.0
    assert inflation <= np.median(found) < 2.5 * inflation


def test_few_blocks_and_blocks_without_information_say_nothing():
    blocks = drawn(0.2)
    assert estimate_lasting_errors(blocks, FEWEST - 1) is None
    assert estimate_lasting_errors(blocks, FEWEST) is not None
    for factor in (0.0, -0.5):
        idle = replace(blocks, grams=factor * blocks.grams)
        assert estimate_lasting_errors(idle, BLOCKS) is None
        assert slip_inflation(idle, SCALE) == 1.0


def test_blocks_that_show_less_than_nothing_inflate_nothing():
    """Corrected for the errors of the slips, the information of a block may be below 0."""
    blocks = drawn(0.0, 3)
    few = replace(
        blocks, grams=blocks.grams[:13].copy(), scores=0.1 * blocks.scores[:13], current=13
    )
    few.grams[:12, SCALE, SCALE] = -1.0
    assert slip_inflation(few, SCALE) == 1.0


def test_without_noise_that_is_expected_nothing_is_inflated():
    assert batch_inflation(np.ones(40), np.zeros(40)) == 1.0


@pytest.mark.parametrize(("inflation", "wanted"), [(3.9, 1.0), (4.0, 1.0), (4.1, 4.1)])
def test_up_to_four_an_inflation_is_chance(inflation, wanted):
    assert LastingErrors(inflation, 0.0).beyond_chance == wanted


def test_errors_of_the_speed_inflate_what_is_known_of_its_scale():
    """Of the current blocks alone; what errors of the slips add is noise."""
    calm = [slip_inflation(drawn(0.0, seed), SCALE) for seed in range(10)]
    assert calm == [1.0] * 10
    loud = drawn(0.0, 3, 30.0)
    assert slip_inflation(loud, SCALE) > 15.0
    diluted = np.zeros((SIZE, SIZE))
    diluted[SCALE, SCALE] = 29.0 * loud.grams[:, SCALE, SCALE].sum()
    assert slip_inflation(replace(loud, dilution=diluted), SCALE) == 1.0
    earlier = replace(drawn(0.0, 4), current=30)
    earlier.scores[30:] *= 30.0
    assert slip_inflation(earlier, SCALE) == 1.0
