"""Score tests: how often they are wrong, and what they find."""

from dataclasses import replace

import numpy as np
import pytest
from scipy import stats

from adhesion_can.estimation.doubt.blocks import (
    CURVE,
    TANGENTS,
    BlockSeries,
    ReducedBlocks,
    fit_blocks,
)
from adhesion_can.estimation.doubt.directions import EFFORT_BIAS, LOAD, SPEED_SCALE, SURROUNDINGS
from adhesion_can.estimation.doubt.score_tests import compute_score_tests, select_directions
from adhesion_can.estimation.doubt.settings import DoubtSettings
from adhesion_can.physics.channels import COVARIATES
from adhesion_can.physics.doubt import Doubt
from tests.estimation.doubt.doubt_helpers import (
    DIRECTIONS,
    NAMES,
    THETA,
    make_blocks,
    make_samples,
)

BASE = tuple(range(TANGENTS))


def reduced(seconds: float, block_s: float, **hidden: float):
    seed = hidden.pop("seed")
    samples = make_samples(np.random.default_rng(int(seed)), seconds, **hidden)
    series = BlockSeries(len(DIRECTIONS))
    series.blocks = make_blocks(samples, block_s)
    return series.reduced(fit_blocks(series.blocks, THETA))


@pytest.mark.costly
@pytest.mark.parametrize("lasting_s", [0.0, 0.3])
def test_p_values_of_nothing_are_at_most_as_small_as_they_say(lasting_s: float) -> None:
    """25 drives of 60 s, 23 coefficients: at most 1 % of the p-values below 0.01, counted with
    twice the binomial's standard deviation of independent tests."""
    drives = 25
    small = tested = 0
    for seed in range(drives):
        blocks = reduced(60.0, 1.0, seed=seed, lasting_s=lasting_s)
        p = compute_score_tests(blocks, BASE).p_value
        p = p[p < 1.0]
        small, tested = small + int((p < 0.01).sum()), tested + len(p)
    assert tested > 20 * drives
    assert small / tested < 0.01 + 2 * np.sqrt(0.01 / tested) * 2


@pytest.mark.parametrize(
    ("hidden", "name", "doubt"),
    [
        ({"load_exponent": 0.4}, LOAD, Doubt.AXLE_LOAD),
        ({"speed_scale": 0.003}, SPEED_SCALE, Doubt.DIRECTION),
        ({"effort_bias": 3000.0}, EFFORT_BIAS, Doubt.DIRECTION),
    ],
)
def test_what_is_hidden_is_found_within_a_minute(
    hidden: dict[str, float], name: str, doubt: Doubt
) -> None:
    """In all of 5 drives of a minute, as the first of the selected ones."""
    for seed in range(5):
        blocks = reduced(60.0, 0.5, seed=seed, **hidden)
        found = select_directions(blocks, DIRECTIONS, DoubtSettings())
        assert (found.names[0], found.doubt) == (name, doubt)
        size = compute_score_tests(blocks, BASE).size[CURVE + NAMES.index(name)]
        true = {LOAD: -0.4, SPEED_SCALE: 0.003, EFFORT_BIAS: 3.0}[name]
        assert size == pytest.approx(true, rel=0.25)


def test_sizes_and_their_t_are_those_of_the_rows_themselves() -> None:
    """Regressions of rows without Gram matrices; blocks of different weight."""
    rng, blocks, size = np.random.default_rng(5), 12, CURVE + len(DIRECTIONS)
    x = rng.standard_normal((blocks, 30, size)) * rng.uniform(0.5, 2.0, (blocks, 1, 1))
    y = rng.standard_normal((blocks, 30)) + 0.3 * x[:, :, -1]
    given = ReducedBlocks(
        x.transpose(0, 2, 1) @ x, np.zeros((size, size)), np.einsum("bnk,bn->bk", x, y), blocks,
        np.ones(blocks), 1.0,
    )  # fmt: skip
    found = compute_score_tests(given, BASE)
    base, response = x.reshape(-1, size)[:, list(BASE)], y.ravel()

    def beside_base(column):
        return column - base @ np.linalg.lstsq(base, column, rcond=None)[0]

    residual = beside_base(response).reshape(blocks, 30)
    for k in range(TANGENTS, size):
        rest = beside_base(x[:, :, k].ravel()).reshape(blocks, 30)
        square, left = np.sum(rest**2, axis=1), np.sum(rest * residual, axis=1)
        share, slope = square / square.sum(), left.sum() / square.sum()
        scatter = (left - square * slope) / (1.0 - share)
        shared = np.sum(scatter[1:] * scatter[:-1]) / np.sum(scatter**2) + 1.5 / blocks
        rho = min(max(shared, 0.0), 0.9)
        t = left.sum() / np.sqrt(np.sum(scatter**2) * (1 + rho) / (1 - rho))
        freedom = 1.0 / np.sum(share**2) - 1.0
        assert found.size[k] == pytest.approx(slope, rel=1e-5, abs=1e-7)
        assert found.information[k] == pytest.approx(square.sum(), rel=1e-5)
        assert found.t[k] == pytest.approx(t, rel=1e-5)
        assert found.freedom[k] == pytest.approx(freedom, rel=1e-5)
        assert found.p_value[k] == pytest.approx(2 * stats.t.sf(abs(t), freedom), rel=1e-4)


@pytest.mark.costly
def test_nothing_is_selected_where_nothing_is_hidden() -> None:
    for seed in range(20):
        blocks = reduced(40.0, 0.5, seed=seed)
        assert select_directions(blocks, DIRECTIONS, DoubtSettings()).doubt is Doubt.NONE


def test_what_the_curve_explains_is_not_tested() -> None:
    """A direction along a tangent leaves nothing of itself, one that is 0 has nothing to leave."""
    blocks = reduced(20.0, 0.5, seed=1)
    along, nothing = CURVE + NAMES.index(LOAD), CURVE + NAMES.index(SPEED_SCALE)
    grams, scores = blocks.grams.copy(), blocks.scores.copy()
    grams[:, along], scores[:, along] = 2.0 * grams[:, 0], 2.0 * scores[:, 0]
    grams[:, :, along] = 2.0 * grams[:, :, 0]
    grams[:, nothing], grams[:, :, nothing], scores[:, nothing] = 0.0, 0.0, 0.0
    found = compute_score_tests(replace(blocks, grams=grams, scores=scores), BASE)
    for k in (*BASE, along, nothing):
        assert (found.p_value[k], found.t[k], found.information[k]) == (1.0, 0.0, 1.0)
    assert found.p_value[CURVE + NAMES.index(EFFORT_BIAS)] < 1.0


def test_what_is_smaller_than_the_least_size_is_left() -> None:
    blocks = reduced(60.0, 0.5, seed=1, load_exponent=0.4)
    coarse = DoubtSettings(least_size=0.5)
    assert select_directions(blocks, DIRECTIONS, coarse).doubt is Doubt.NONE


def test_few_blocks_say_nothing() -> None:
    blocks = reduced(6.0, 1.0, seed=1, load_exponent=2.0)
    assert select_directions(blocks, DIRECTIONS, DoubtSettings()).doubt is Doubt.NONE


@pytest.mark.parametrize("name", SURROUNDINGS)
def test_surroundings_are_found_by_the_names_of_the_covariates(name: str) -> None:
    samples = make_samples(np.random.default_rng(7), 60.0)
    scale = SURROUNDINGS[name]
    value = np.round(np.sin(samples.t_us * 1e-6 / 3.1) > 0.3)
    samples = replace(
        samples,
        adhesion=samples.adhesion * (1.0 + 0.2 * value),
        covariates={name: scale.shift + scale.unit * value},
    )
    series = BlockSeries(len(DIRECTIONS))
    series.blocks = make_blocks(samples, 0.5)
    blocks = series.reduced(fit_blocks(series.blocks, THETA))
    found = select_directions(blocks, DIRECTIONS, DoubtSettings())
    assert (found.names[0], found.doubt) == (name, Doubt.SURROUNDINGS)


def test_they_are_those_that_samples_carry() -> None:
    assert set(SURROUNDINGS) <= set(COVARIATES.values())
