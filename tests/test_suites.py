"""The suites for effects and estimators of others find what breaks their rules."""

from dataclasses import dataclass, replace

import numpy as np
import pytest

from adhesion_can.estimation.baselines.growing_window import WindowEstimator
from adhesion_can.physics.effects import Change, Observability, Parameter, Requirements
from adhesion_can.testing import EffectSuite, EstimatorSuite


@dataclass(frozen=True)
class Wind:
    """A sound effect, in a channel of its own."""

    id: str = "wind"
    form: str = ""
    title: str = "wind blows the sand away"
    parameters: tuple = (Parameter("loss", "1", 0.1, -0.2, 0.5, "share of adhesion lost"),)
    literature: str = "none"
    requires: Requirements = Requirements(covariates=("wind_mps",))
    observability: Observability = Observability(channel="wind_mps", excitation="the wind")

    def change(self, contact, values, _lags):
        return Change(contact.slip, 1.0 - values[0] * contact.covariates["wind_mps"] / 10.0)


class Scribbling(Wind):
    def change(self, contact, values, lags):
        contact.load[:] = 0.0
        return super().change(contact, values, lags)


class Restless(Wind):
    def change(self, contact, _values, _lags):
        return Change(contact.slip, 0.9)


class Invisible(Wind):
    def change(self, contact, _values, _lags):
        return Change(contact.slip)


class Infinite(Wind):
    def change(self, contact, values, _lags):
        with np.errstate(divide="ignore"):
            return Change(contact.slip, 1.0 / (1.0 - 2.0 * np.full(1, max(values[0], 0.0))))


SIZE = Wind.parameters[0]


def names_of(suite):
    return [name for name in dir(suite) if name.startswith("test_")]


def fails(suite, rule):
    """Whether a suite fails one of its tests."""
    try:
        getattr(suite, rule)()
    except Exception:  # noqa: BLE001  a broken effect fails in ways of its own
        return True
    return False


class Suite(EffectSuite):
    covariates = {"wind_mps": (0.0, 10.0)}  # noqa: RUF012  as a user writes it

    def __init__(self, effect):
        self.effect = effect


def test_an_effect_of_ones_own_passes_in_a_channel_of_its_own():
    suite = Suite(Wind())
    assert not [name for name in names_of(suite) if fails(suite, name)]


@pytest.mark.parametrize(
    ("effect", "rule"),
    [
        (Scribbling(), "test_the_typical_size_is_seen_and_leaves_its_inputs_alone"),
        (Invisible(), "test_the_typical_size_is_seen_and_leaves_its_inputs_alone"),
        (Restless(), "test_size_0_changes_nothing"),
        (Infinite(), "test_the_ends_of_its_ranges_give_numbers"),
        (Wind(title="Wind"), "test_the_definition_is_complete"),
        (Wind(literature=" "), "test_the_definition_is_complete"),
        (Wind(parameters=()), "test_the_definition_is_complete"),
        (Wind(parameters=(SIZE, SIZE)), "test_the_definition_is_complete"),
        (Wind(parameters=(replace(SIZE, typical=0.6),)), "test_the_definition_is_complete"),
        (Wind(parameters=(replace(SIZE, lower=0.05),)), "test_the_definition_is_complete"),
        (Wind(observability=Observability("gust", "the wind")), "test_it_states_how_it_shows"),
        (Wind(observability=Observability("wind_mps")), "test_it_states_how_it_shows"),
    ],
)
def test_each_broken_rule_of_an_effect_is_found(effect, rule):
    assert fails(Suite(effect), rule)


class Changed:
    """The growing window, with another answer."""

    def __init__(self, answer):
        self._window, self._answer = WindowEstimator(), answer

    def update(self, samples, now_us):
        return self._answer(self._window.update(samples, now_us), samples)


class Odd(EstimatorSuite):
    def __init__(self, answer):
        self.make = lambda: Changed(answer)


def sure(estimate, _):
    claim = None if estimate is None else replace(estimate.identifiable, mu_max=True, lambda_m=True)
    return estimate and replace(estimate, identifiable=claim)


@pytest.mark.parametrize(
    ("answer", "rule"),
    [
        (sure, "test_slips_far_below_the_peak_do_not_identify_it"),
        (sure, "test_a_single_slip_does_not_identify_the_peak"),
        (
            lambda e, _: e and replace(e, mu_max=1.1 * e.mu_max),
            "test_it_finds_the_peak_of_a_dry_rail",
        ),
        (
            lambda e, _: e and replace(e, mu_max_std=np.nan),
            "test_whatever_comes_it_answers_with_numbers",
        ),
        (lambda e, s: e if s.t_us.size else None, "test_no_samples_give_no_other_estimate"),
        (
            lambda e, _: e and replace(e, c1=e.c1 + np.random.default_rng().random()),
            "test_the_same_samples_give_the_same_estimates",
        ),
    ],
)
def test_each_broken_rule_of_an_estimator_is_found(answer, rule):
    assert fails(Odd(answer), rule)
    assert not fails(Odd(lambda estimate, _: estimate), rule)
