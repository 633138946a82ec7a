"""Whether an effect joins the model: its gain over blocks has to be sure at a level of 5 %."""

from types import SimpleNamespace

import numpy as np
import pytest
import scipy

from adhesion_can.diagnosis.inference.model_comparison import (
    ScoredModel,
    gain_p_value,
    is_improvement,
    worse_p_value,
)
from tests.seeds import first_quick

BLOCKS = 30


def scored(squares, rmse, candidates=()):
    """A model with these squares of its blocks, as far as a comparison looks at it."""
    squares = np.asarray(squares, dtype=np.float64)
    model = SimpleNamespace(candidates=candidates, curves=SimpleNamespace(family="burckhardt"))
    fitted = SimpleNamespace(
        model=model,
        cross_validated_squares=squares,
        cross_validated_square=float(squares.sum()),
    )
    return ScoredModel(fitted, rmse, rmse)


def gains_with_p(p_value):
    """Gains of the blocks whose p-value by the mean is this, symmetric about their mean."""
    spread = scipy.stats.norm.ppf((np.arange(BLOCKS) + 0.5) / BLOCKS)
    spread /= spread.std(ddof=1)
    return scipy.stats.t.isf(p_value, BLOCKS - 1) / np.sqrt(BLOCKS) + spread


def joins(p_value, tested=1.0):
    plain = scored(np.full(BLOCKS, 10.0), 1.0)
    extended = scored(10.0 - gains_with_p(p_value), 0.9)
    return is_improvement(plain, extended, tested)


@pytest.mark.parametrize(("p_value", "wanted"), [(1e-5, True), (1e-3, True), (0.02, False)])
def test_a_gain_joins_at_five_percent(p_value, wanted):
    """The p-value counts twice for mean and ranks, and twice again for signs and blocks."""
    assert joins(p_value) is wanted


def test_all_that_was_tested_counts():
    assert joins(1e-4)
    assert not joins(1e-4, tested=200.0)


def test_a_sure_gain_that_is_small_is_not_worth_a_name():
    plain = scored(np.full(BLOCKS, 10.0), 1.0)
    assert not is_improvement(plain, scored(10.0 - gains_with_p(1e-8), 0.995), 1.0)


@pytest.mark.costly
@pytest.mark.parametrize("seed", first_quick(range(3)))
def test_the_p_values_are_those_of_chance(seed):
    """Gains of either sign with equal chance: at most 1 % of drives below 1 %, here of 2000."""
    rng = np.random.default_rng(seed)
    plain = scored(np.full(BLOCKS, 10.0), 1.0).fitted
    low = 0
    for _ in range(2000):
        gains = rng.standard_normal(BLOCKS) * rng.uniform(0.5, 2.0, BLOCKS)
        low += gain_p_value(plain, scored(10.0 - gains, 1.0).fitted) < 0.01
    assert low <= 40  # 20 expected at most; 40 and more have a chance of 5e-5


def test_a_model_that_is_worse_in_every_block_is_worse():
    best, other = (scored(np.full(BLOCKS, level), 1.0).fitted for level in (10.0, 11.0))
    assert worse_p_value(best, other) == 0.0
    assert worse_p_value(other, best) == 1.0
