"""The size of the vehicle speed's errors by what all axles have in common."""

import numpy as np
import pytest
from scipy.optimize import minimize_scalar

from adhesion_can.diagnosis.regression.speed_error_scale import estimate_speed_error_scale

BLOCKS, ROWS, ERRORS = 40, 300, 5


def drawn(rng, factor, *, noise=1.0):
    """Residuals of blocks with errors that are `factor` times as large as the design has them."""
    n = BLOCKS * ROWS
    block = np.repeat(np.arange(BLOCKS), ROWS)
    design = 0.3 * rng.standard_normal((n, ERRORS)) * rng.uniform(0.2, 1.0, (n, 1))
    errors = factor * rng.standard_normal((BLOCKS, ERRORS))
    residual = noise * rng.standard_normal(n) + np.sum(design * errors[block], axis=1)
    return residual, design, block


@pytest.mark.parametrize("factor", [0.5, 1.0, 3.0, 6.0])
def test_the_factor_is_recovered(factor):
    """Its standard error is 5 to 7 % (80 draws each): five of them for one, four for the mean."""
    rng = np.random.default_rng(1)
    found = [estimate_speed_error_scale(*drawn(rng, factor)) for _ in range(10)]
    assert found == pytest.approx([factor] * 10, rel=0.35)
    assert np.mean(found) == pytest.approx(factor, rel=0.1)


def test_it_does_not_depend_on_the_size_of_the_noise():
    """Louder rows have larger errors of the same factor in units of the noise."""
    residual, design, block = drawn(np.random.default_rng(2), 3.0)
    found = estimate_speed_error_scale(residual, design, block)
    assert estimate_speed_error_scale(5.0 * residual, 5.0 * design, block) != pytest.approx(1.0)
    assert estimate_speed_error_scale(5.0 * residual, design, block) == pytest.approx(found)


def test_no_error_at_all_makes_it_small():
    assert estimate_speed_error_scale(*drawn(np.random.default_rng(3), 0.0)) < 0.2


def test_rows_that_are_held_out_take_no_part():
    residual, design, block = drawn(np.random.default_rng(4), 2.0)
    known = estimate_speed_error_scale(residual, design, block)
    more = np.concatenate([residual, 100.0 * residual])
    held_out = np.concatenate([block, -1 - block])
    assert estimate_speed_error_scale(more, np.tile(design, (2, 1)), held_out) == known


def test_what_is_in_single_axles_is_no_error_of_the_speed():
    """A mechanism at one of six axles, as large as the noise, leaves the factor about 1."""
    rng = np.random.default_rng(5)
    residual, design, block = drawn(rng, 1.0)
    axle = np.tile(np.arange(6), len(residual) // 6)
    level = rng.standard_normal(BLOCKS)[block] * (axle == 2)
    assert estimate_speed_error_scale(residual + level, design, block) < 1.6


@pytest.mark.parametrize("rows", [0, 3])
def test_too_few_rows_say_nothing(rows):
    design = np.ones((rows, ERRORS))
    assert estimate_speed_error_scale(np.ones(rows), design, np.zeros(rows, dtype=np.int64)) == 1.0


@pytest.mark.parametrize("seed", range(4))
def test_of_few_blocks_it_is_the_most_likely_one_with_what_is_usual(seed):
    """Normal densities with dense covariances; a factor of 3 up or down has half a unit less."""
    rng, blocks, n = np.random.default_rng(seed), 3, 25
    design = 0.5 * rng.standard_normal((blocks * n, 2))
    block = np.repeat(np.arange(blocks), n)
    true = (rng.standard_normal((blocks, 2)) * 3.0)[block]
    residual = rng.standard_normal(blocks * n) + np.sum(design * true, axis=1)
    parts = [(design[block == b], residual[block == b]) for b in range(blocks)]
    left = [r - d @ np.linalg.lstsq(d, r, rcond=None)[0] for d, r in parts]
    noise = sum(float(one @ one) for one in left) / (blocks * (n - 2))

    def unlikeliness(log_factor):
        found = (log_factor / np.log(3.0)) ** 2
        for d, r in parts:
            covariance = np.eye(n) + np.exp(2.0 * log_factor) * d @ d.T
            found += np.linalg.slogdet(covariance)[1] + r @ np.linalg.solve(covariance, r) / noise
        return found

    wanted = minimize_scalar(unlikeliness, bounds=(-3.4, 3.4), method="bounded")
    found = estimate_speed_error_scale(residual, design, block)
    assert found == pytest.approx(np.exp(wanted.x), rel=1e-3)
