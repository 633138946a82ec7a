"""Differences against weights by hand, and variances of noise of known size under motion."""

import numpy as np
import pytest

from adhesion_can.sampling.differences import (
    block_means,
    differences,
    freedom_share,
    low_quantile,
)

BINOMIAL = {1: [-1, 1], 2: [1, -2, 1], 3: [-1, 3, -3, 1], 4: [1, -4, 6, -4, 1]}


@pytest.mark.parametrize("order", BINOMIAL)
@pytest.mark.parametrize("stride", [1, 3])
def test_at_equal_steps_the_weights_are_the_binomial_ones_of_unit_norm(order, stride):
    n = 40
    value = np.random.default_rng(1).standard_normal(n)
    weights = np.array(BINOMIAL[order]) / np.linalg.norm(BINOMIAL[order])
    wanted = [
        weights @ value[k : k + order * stride + 1 : stride] for k in range(n - order * stride)
    ]
    found = differences(np.arange(n) * 0.02, value, order, stride, 0.02)
    assert np.abs(found) == pytest.approx(np.abs(wanted), rel=1e-9)


@pytest.mark.parametrize("order", BINOMIAL)
def test_a_polynomial_of_lower_degree_is_removed_at_uneven_steps_too(order):
    rng = np.random.default_rng(2)
    t_s = np.cumsum(rng.uniform(0.8, 1.2, (2, 30)), axis=-1) * 0.02
    motion = sum(3.0 * k * (t_s / 0.3) ** k for k in range(order))
    found = differences(t_s, motion, order, 2, 0.02)
    assert found.shape == (2, 30 - 2 * order)
    assert found == pytest.approx(np.zeros(found.shape), abs=1e-9 * np.abs(motion).max())
    bent = differences(t_s, motion + (t_s / 0.02) ** order, order, 2, 0.02)
    assert np.abs(bent).min() > 0.1


def test_differences_across_a_missing_reading_are_no_numbers():
    """Missing by a value, or by a step of more than 1.5 cycles a reading."""
    value = np.arange(12.0)
    value[5] = np.nan
    found = differences(np.arange(12) * 0.02, value, 2, 1, 0.02)
    assert np.flatnonzero(np.isnan(found)).tolist() == [3, 4, 5]
    t_s = np.arange(12) * 0.02
    t_s[6:] += 0.019
    assert np.isfinite(differences(t_s, np.arange(12.0), 2, 1, 0.02)).all()
    t_s[6:] += 0.003
    late = differences(t_s, np.arange(12.0), 2, 1, 0.02)
    assert np.flatnonzero(np.isnan(late)).tolist() == [4, 5]
    twice = np.array([0.0, 0.02, 0.02, 0.04])
    assert np.isnan(differences(twice, np.arange(4.0), 1, 1, 0.02)).tolist() == [False, True, False]


@pytest.mark.parametrize(("n", "left"), [(7, 1), (6, 0), (2, 0)])
def test_too_few_readings_give_no_difference(n, left):
    times = np.zeros((3, n)) + np.arange(n) * 0.02
    assert differences(times, times, 2, 3, 0.02).shape == (3, left)


@pytest.mark.parametrize(("order", "share"), [(1, 2 / 3), (2, 18 / 35), (3, 100 / 231)])
def test_freedom_of_a_mean_square_is_that_of_a_correlated_series(order, share):
    """1 / Σ ρ² by hand; of first differences ρ is −1/2 at one step, so 1 / (1 + 2/4)."""
    assert freedom_share(order) == pytest.approx(share)


def test_means_of_blocks_leave_out_what_is_missing_and_blocks_that_lack_more_than_half():
    nan = np.nan
    squares = np.array([1.0, 2.0, 3.0, 6.0, nan, nan, 5.0, 7.0, nan, nan, nan, 9.0, 4.0, 4.0])
    assert block_means(squares, 4).tolist() == [3.0, 6.0]
    assert block_means(squares[8:], 4).tolist() == []
    assert block_means(squares, 15).tolist() == []
    rows = np.array([[1.0, 3.0, 5.0, 7.0, 99.0], [2.0, 2.0, 8.0, 10.0, 99.0]])
    assert block_means(rows, 2).tolist() == [2.0, 6.0, 2.0, 9.0]


@pytest.mark.parametrize("freedom", [1.0, 4.0, 40.0])
def test_the_low_quantile_is_the_variance_of_noise_that_fills_all_blocks(freedom):
    """Against draws of χ²; the standard error against their scatter from set to set."""
    rng = np.random.default_rng(3)
    sets = 2.5 * rng.chisquare(freedom, (200, 500)) / freedom
    found = [low_quantile(means, freedom) for means in sets]
    values = np.array([one.var for one in found])
    assert values.mean() == pytest.approx(2.5, rel=0.05 if freedom < 4.0 else 0.01)
    assert {one.blocks for one in found} == {500}
    if freedom > 4.0:
        assert found[0].std_error == pytest.approx(values.std() / 2.5, rel=0.2)


def test_blocks_with_motion_hardly_matter_while_they_are_few():
    rng = np.random.default_rng(4)
    means = rng.chisquare(20, 1000) / 20
    moved = np.where(np.arange(1000) % 10 == 0, means + 50.0, means)
    assert low_quantile(moved, 20.0).var == pytest.approx(low_quantile(means, 20.0).var, rel=0.05)


def test_without_a_block_there_is_no_variance():
    found = low_quantile(np.empty(0), 4.0)
    assert np.isnan(found.var)
    assert (found.std_error, found.blocks) == (np.inf, 0)


def test_errors_of_few_blocks_shrink_with_their_number_and_freedom():
    few, many = (low_quantile(np.ones(n), 8.0).std_error for n in (25, 100))
    assert few == pytest.approx(2.0 * many)
    assert low_quantile(np.ones(25), 32.0).std_error == pytest.approx(few / 2.0)
