"""Blocks of a drive: merged, linearised, and carried over a change of the surface."""

from dataclasses import replace

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
    samples = make_samples(np.random.default_rng(1), MOST + 10)
    blocks = make_blocks(replace(samples, slip_var=np.full(len(samples), 1e-6)))
    series = series_of(blocks)
    assert len(series) < MOST
    assert series.block_s == 1.0
    for name in ("gram", "dilution", "score", "level_noise", "curve_square"):
        whole = sum(getattr(block, name) for block in blocks)
        assert sum(getattr(block, name) for block in series.blocks) == pytest.approx(whole)
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


def test_changes_wait_at_most_four_at_a_time_each_once_and_none_before_the_first_block() -> None:
    blocks = make_blocks(make_samples(np.random.default_rng(6), 8))
    series = BlockSeries(len(DIRECTIONS))
    series.add_candidate()
    assert series.candidates == []
    for block in blocks[:7]:
        series.append(block)
        series.add_candidate()
        series.add_candidate()
    assert series.candidates == [4, 5, 6, 7]


def test_a_change_is_awaited_while_one_block_alone_is_after_the_latest_candidate() -> None:
    blocks = make_blocks(make_samples(np.random.default_rng(6), 8))
    series = series_of(blocks[:3])
    assert not series.awaits_change
    series.add_candidate()
    seen = [series.awaits_change]
    for block in blocks[3:6]:
        series.append(block)
        seen.append(series.awaits_change)
    assert seen == [False, True, False, False]
    # With a later candidate it starts again.
    series.add_candidate()
    series.append(blocks[6])
    assert series.awaits_change


def test_candidates_keep_their_places_when_blocks_before_them_go() -> None:
    blocks = make_blocks(make_samples(np.random.default_rng(7), MOST + 1))
    series = series_of(blocks[:10])
    series.add_candidate()
    series.append(blocks[10])
    series.add_candidate()
    series.end_surface(10, PooledCurve(THETA))
    assert series.candidates == [1]
    assert len(series.blocks) == 1
    assert len(series) == 11
    series.block_s = 8.0
    for block in blocks[11:MOST]:
        series.append(block)
    # The oldest blocks, those of the surface before, go first.
    assert len(series) == MOST - 1
    assert series.candidates == [1]
    fresh = series_of(blocks[: MOST - 1])
    fresh.block_s = 8.0
    fresh.add_candidate()
    fresh.append(blocks[-1])
    assert len(fresh) == MOST - 1
    assert fresh.candidates == [MOST - 2]


def test_a_candidate_marks_the_same_block_until_all_before_it_are_gone() -> None:
    """Also when the last block of the surface before goes, which moves no block of this one."""
    blocks = make_blocks(make_samples(np.random.default_rng(7), MOST + 4))
    series = series_of(blocks[:2])
    series.end_surface(2, PooledCurve(THETA))
    for block in blocks[2:5]:
        series.append(block)
    series.block_s = 8.0
    series.add_candidate()
    first_after = blocks[5]
    places = []
    for block in blocks[5:]:
        series.append(block)
        places += series.candidates
        for place in series.candidates:
            assert series.blocks[place] is first_after
    # Two blocks of the surface before go, then two of this one; then none is left to end.
    assert sorted(set(places), reverse=True) == [3, 2, 1]
    assert series.candidates == []


def test_what_errors_of_the_slips_add_is_carried_over_a_change_as_the_sums_are() -> None:
    """Projected onto the same tangents; with it the sums of both surfaces are positive again."""
    samples = make_samples(np.random.default_rng(8), 20)
    noisy = replace(samples, slip_var=np.full(len(samples), 1e-5))
    series = series_of(make_blocks(noisy))
    before = series.reduced(PooledCurve(THETA))
    series.end_surface(20, PooledCurve(THETA))
    after = series.reduced(PooledCurve(THETA))
    assert after.current == 0
    assert after.curve_square == pytest.approx(before.curve_square)
    gram, rest = before.grams.sum(axis=0), slice(TANGENTS, None)
    onto = np.linalg.solve(gram[:TANGENTS, :TANGENTS], gram[:TANGENTS, rest])
    left = np.vstack([-onto, np.eye(len(gram) - TANGENTS)])
    wanted = left.T @ before.dilution @ left
    place = CURVE - TANGENTS + NAMES.index(TIME)
    wanted[place], wanted[:, place] = 0.0, 0.0
    scale = np.sqrt(np.abs(np.outer(wanted.diagonal(), wanted.diagonal()))) + 1e-9
    assert after.dilution[rest, rest] / scale == pytest.approx(wanted / scale, abs=1e-6)
    whole = left.T @ gram @ left
    whole[place], whole[:, place] = 0.0, 0.0
    scale = np.sqrt(np.abs(np.outer(whole.diagonal(), whole.diagonal()))) + 1e-9
    found = after.grams.sum(axis=0)[rest, rest]
    assert found / scale == pytest.approx(whole / scale, abs=1e-6)
