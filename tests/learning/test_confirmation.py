"""The betting test: how often it confirms what is no better, and how soon what is."""

import numpy as np
import pytest

from adhesion_can.learning.confirmation import (
    BET,
    PROVEN,
    BettingTest,
    LearningState,
    ModelConfirmation,
)

RUNS = 2000


def largest_wealth(chance, spans, seed):
    """Largest wealth of who bets on 'better' in each of many runs, by the class itself."""
    rng = np.random.default_rng(seed)
    out = []
    for _ in range(RUNS):
        test, largest = BettingTest(), 1.0
        for is_better in (rng.random(spans) < chance).tolist():
            test.add(is_better=is_better)
            largest = max(largest, test.better)
        out.append(largest)
    return np.array(out)


@pytest.mark.parametrize("seed", [1, 2])
def test_a_model_that_is_no_better_passes_a_wealth_as_seldom_as_ville_says(seed):
    """P(sup wealth >= w) <= 1/w; and not far below it, or the test would be weak."""
    largest = largest_wealth(0.5, 240, seed)
    for wealth in (5.0, 20.0, 100.0):
        share = float((largest >= wealth).mean())
        std = np.sqrt(1.0 / wealth / RUNS)
        assert share <= 1.0 / wealth + 4.0 * std
        assert share >= 0.3 / wealth - 4.0 * std
    assert (largest >= PROVEN).mean() <= 1.0 / PROVEN + 4.0 * np.sqrt(1.0 / PROVEN / RUNS)


def test_a_bet_that_is_too_small_for_the_threshold_would_be_noticed():
    """The rate of a test with a threshold of 5 in place of 1000 is far beyond one in a thousand."""
    assert (largest_wealth(0.5, 240, 3) >= 5.0).mean() > 0.05


@pytest.mark.parametrize(("chance", "spans"), [(0.95, 40), (0.8, 100), (0.7, 240)])
def test_its_power(chance, spans):
    assert (largest_wealth(chance, spans, 4) >= PROVEN).mean() >= 0.9


def test_wealth_stays_a_number_for_a_year():
    test = BettingTest()
    for _ in range(100_000):
        test.add(is_better=True)
    assert np.isfinite(test.better)
    assert test.worse >= 0.0


def fed(confirmation, outcomes, from_s=0.0):
    """Spans of 5 s one after the other."""
    for place, is_better in enumerate(outcomes, start=1):
        confirmation.add(round((from_s + 5.0 * place) * 1e6), is_better=is_better)
    return confirmation


def test_a_model_that_predicts_better_is_confirmed_as_soon_as_the_wealth_says():
    needed = int(np.ceil(np.log(PROVEN) / np.log(1.0 + BET)))
    assert fed(ModelConfirmation(0), [True] * (needed - 1)).state is LearningState.ESTIMATED
    confirmed = fed(ModelConfirmation(0), [True] * needed)
    assert confirmed.state is LearningState.CONFIRMED
    assert (confirmed.spans, confirmed.won) == (needed, needed)


def test_a_model_that_predicts_worse_is_dropped():
    dropped = fed(ModelConfirmation(0), [False] * 30)
    assert dropped.state is LearningState.INVALID
    assert "worse" in dropped.reason
    # Nothing raises it again.
    assert fed(dropped, [True] * 100).state is LearningState.INVALID


def test_a_model_that_does_neither_is_dropped_at_its_age():
    confirmation = fed(ModelConfirmation(0, most_age_s=600.0), [True, False] * 50)
    assert confirmation.state is LearningState.ESTIMATED
    confirmation.grow_old(601_000_000)
    assert confirmation.state is LearningState.INVALID
    assert "10 minutes" in confirmation.reason


def test_a_confirmed_model_is_dropped_soon_after_it_ceases_to_hold():
    """However long it held before."""
    confirmation = fed(ModelConfirmation(0), [True] * 1000)
    fed(confirmation, [False] * 25, from_s=5000.0)
    assert confirmation.state is LearningState.INVALID


def test_a_confirmed_model_does_not_age():
    confirmation = fed(ModelConfirmation(0, most_age_s=600.0), [True] * 30)
    confirmation.grow_old(10**12)
    assert confirmation.state is LearningState.CONFIRMED
