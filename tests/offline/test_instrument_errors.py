"""What `check` makes of errors that all axles share, and how much `[instruments]` leaves open."""

from dataclasses import replace

import numpy as np
import pytest

from adhesion_can.config import load_configuration
from adhesion_can.estimation.batch_fit import identify
from adhesion_can.estimation.doubt.settings import InstrumentUncertainty
from adhesion_can.estimation.doubt.shared_errors import estimate_shared_errors
from adhesion_can.offline.instrument_errors import propose_instruments
from tests.estimation.doubt.doubt_helpers import AXLES, THETA, in_seconds, make_samples

LIGHT, HEAVY = 92e3, 245e3


def proposals(samples, **stated):
    """Sentences of the check for samples of four axles, with stated errors."""
    config = load_configuration()
    vehicle = replace(
        config.vehicle,
        wheel_radius=(0.33,) * AXLES,
        axle_load=(float(samples.load.mean()),) * AXLES,
        geometry=None,
    )
    instruments = InstrumentUncertainty(**stated)
    estimators = replace(config.estimators, instruments=instruments)
    config = replace(config, vehicle=vehicle, estimators=estimators)
    return list(propose_instruments(samples, identify(samples), config))


def with_load(samples, load):
    return replace(samples, load=np.full(len(samples), load))


@pytest.mark.costly
def test_intervals_of_shared_errors_hold_the_truth():
    """60 drives with errors as instruments have them: 95 % intervals missed it in 3 and 1 of 60.

    At most 10 of 60 may miss: with 5 % expected, more come by chance once in 10 000 times.
    """
    outside = np.zeros(2)
    for seed in range(60):
        rng = np.random.default_rng(seed)
        bias, scale = rng.normal(0.0, 400.0), rng.normal(0.0, 0.001)
        samples = make_samples(rng, 45.0, effort_bias=bias, speed_scale=scale)
        found = estimate_shared_errors(samples, THETA, AXLES, 0.5)
        for k, (one, truth) in enumerate(((found.speed, scale), (found.effort, bias))):
            outside[k] += abs(one.value - truth) > 1.96 * one.std
    assert outside.max() <= 10, outside


def test_too_few_samples_show_nothing():
    samples = make_samples(np.random.default_rng(1), 1.0)
    assert estimate_shared_errors(samples, THETA, AXLES, 0.5) is None


def test_a_drive_in_both_directions_proposes_smaller_errors():
    samples = make_samples(np.random.default_rng(3), 60.0, effort_bias=100.0)
    (sentence,) = proposals(samples)
    assert "speed_error_std = 0.0003" in sentence
    assert "effort_bias_std = " in sentence
    assert 80.0 < float(sentence.split("effort_bias_std = ")[1].split()[0]) < 300.0


def test_what_is_no_error_of_all_axles_proposes_nothing():
    """One wheel that is 1 % larger would be taken for errors of speed and efforts."""
    samples = make_samples(np.random.default_rng(3), 60.0)
    slip = np.where(samples.axle == 1, samples.slip - 0.01 * (1 + samples.slip), samples.slip)
    worn = replace(samples, slip=slip, creep_speed=slip * samples.speed)
    assert estimate_shared_errors(worn, THETA, AXLES, 0.5) is None


def test_traction_alone_proposes_nothing():
    samples = make_samples(np.random.default_rng(3), 60.0)
    assert proposals(samples.select(samples.slip > 0.0)) == []


def test_what_is_stated_well_is_not_proposed_again():
    samples = make_samples(np.random.default_rng(3), 60.0)
    assert proposals(samples, speed_error_std=0.0004, effort_bias_std=150.0) == []


def test_a_large_error_is_no_proposal():
    """A bias of three times the default is for the doubt and for `diagnose` to name."""
    samples = make_samples(np.random.default_rng(3), 60.0, effort_bias=3000.0)
    assert not any("effort_bias_std" in one for one in proposals(samples))


@pytest.mark.parametrize("load", [LIGHT, HEAVY])
def test_traction_alone_is_as_certain_on_a_light_axle_as_on_a_heavy_one(load):
    """The plausible bias of the efforts grows with the load: μ_max is known to 1.5 % on both."""
    config = load_configuration()
    vehicle = replace(config.vehicle, axle_load=(load,) * 6)
    estimator = replace(config, vehicle=vehicle).make_estimator()
    samples = with_load(make_samples(np.random.default_rng(1), 30.0), load)
    samples = samples.select(samples.slip > 0.0)
    estimate = None
    for part in in_seconds(samples, 0.2):
        estimate = estimator.update(part, int(part.t_us[-1]) + 1) or estimate
    assert 0.01 < estimate.mu_max_std / estimate.mu_max < 0.02
    assert estimate.identifiable.mu_max


def test_a_stated_bias_holds_whatever_the_load():
    assert InstrumentUncertainty(effort_bias_std=700.0).on_load(LIGHT).used_bias_std == 700.0
    assert InstrumentUncertainty().on_load(HEAVY).used_bias_std == pytest.approx(1000.0)
    assert InstrumentUncertainty().on_load(LIGHT).used_bias_std == pytest.approx(375.5, abs=0.1)
