"""Blocks of a drive: merged, linearised, and carried over a change of the surface."""

import numpy as np
import pytest

from adhesion_can.estimation.doubt.blocks import (
    CURVE,
    MOST,
    TANGENTS,
    BlockSeries,
    fit_blocks,
)
from adhesion_can.estimation.doubt.directions import LOAD, TIME
from adhesion_can.estimation.doubt.pooled_curve import PooledCurve
from tests.estimation.doubt.doubt_helpers import (
    DIRECTIONS,
    NAMES,
    THETA,
    make_blocks,
    make_samples,
)

OTHER = (0.25, 90.0, 0.2)


def series_of(blocks: list) -> BlockSeries:
    series = BlockSeries(len(DIRECTIONS), [NAMES.index(TIME)])
    for block in blocks:
        series.append(block)
    return series


def test_merged_blocks_have_the_same_sums() -> None:
    blocks = make_blocks(make_samples(np.random.default_rng(1), MOST + 10))
    series = series_of(blocks)
    assert len(series) < MOST
    assert series.block_s == 1.0
    gram = sum(block.gram for block in blocks)
    assert sum(block.gram for block in series.blocks) == pytest.approx(gram)
    assert fit_blocks(series.blocks, THETA).theta == pytest.approx(fit_blocks(blocks, THETA).theta)


def test_blocks_about_a_possible_change_are_not_merged_with_each_other() -> None:
    blocks = make_blocks(make_samples(np.random.default_rng(1), MOST))
    series = series_of(blocks[:41])
    series.add_candidate()
    for block in blocks[41:]:
        series.append(block)
    place = series.candidates[0]
    before = sum(block.gram for block in series.blocks[:place])
    assert before == pytest.approx(sum(block.gram for block in blocks[:41]))


def test_directions_from_two_surfaces_are_those_of_one_regression() -> None:
    """Frisch, Waugh & Lovell: the blocks carried over give the sizes of a joint regression."""
    rng = np.random.default_rng(3)
    first = make_blocks(make_samples(rng, 30, load_exponent=0.5))
    samples = make_samples(rng, 30, begin_s=30.0, load_exponent=0.5, theta=OTHER)
    second = make_blocks(samples, theta=OTHER)
    series = series_of([*first, *second])
    series.end_surface(len(first), PooledCurve(THETA))
    reduced = series.reduced(PooledCurve(OTHER))
    known = [*range(TANGENTS), CURVE + NAMES.index(LOAD)]
    gram, score = reduced.grams.sum(axis=0), reduced.scores.sum(axis=0)
    size = np.linalg.solve(gram[np.ix_(known, known)], score[known])[-1]

    one, two = series_of(first), series_of(second)
    a, b = one.reduced(PooledCurve(THETA)), two.reduced(PooledCurve(OTHER))
    whole, right = np.zeros((7, 7)), np.zeros(7)
    for own, part in ((slice(0, 3), a), (slice(3, 6), b)):
        index = [*range(own.start, own.stop), 6]
        whole[np.ix_(index, index)] += part.grams.sum(axis=0)[np.ix_(known, known)]
        right[index] += part.scores.sum(axis=0)[known]
    assert size == pytest.approx(np.linalg.solve(whole, right)[-1], rel=1e-6)
    assert size == pytest.approx(-0.5, abs=0.05)


def test_time_begins_anew_with_each_surface() -> None:
    blocks = make_blocks(make_samples(np.random.default_rng(4), 20))
    series = series_of(blocks)
    series.end_surface(10, PooledCurve(THETA))
    reduced = series.reduced(PooledCurve(THETA))
    place = CURVE + NAMES.index(TIME)
    assert not reduced.grams[reduced.current :, place].any()
    assert reduced.grams[: reduced.current, place, place].any()


def test_the_series_stays_of_bounded_length() -> None:
    blocks = make_blocks(make_samples(np.random.default_rng(5), 20))
    series = BlockSeries(len(DIRECTIONS))
    for k in range(MOST * 10):
        series.append(blocks[k % len(blocks)])
        assert len(series) <= MOST
