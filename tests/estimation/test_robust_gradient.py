"""The robust gradient method: where it ends, what cannot move it, and what it never leaves."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import quad
from scipy.stats import norm

from adhesion_can.estimation.baselines.robust_gradient import (
    GradientEstimator,
    GradientSettings,
    _mean_bounded_square,
)
from adhesion_can.estimation.baselines.settings import EvolutionSettings
from adhesion_can.physics.burckhardt import peak
from adhesion_can.physics.samples import Samples

FIXED = settings(derandomize=True, deadline=None, max_examples=25)
EVOLUTION = EvolutionSettings()


def curve(h, c1, c2, c3):
    return c1 - c1 * np.exp(-c2 * h) - c3 * h


def stretch(theta, seed, n=2000, sd=0.0, top=0.2):
    rng = np.random.default_rng(seed)
    h = rng.uniform(0.0, top, n)
    return Samples.curve(h, curve(h, *theta) + sd * rng.standard_normal(n))


def last(estimator, samples, size=12):
    for k in range(0, len(samples), size):
        estimate = estimator.update(samples.select(slice(k, k + size)), 0)
    return estimate


@pytest.mark.costly
@FIXED
@given(
    c1=st.floats(0.1, 0.6),
    c2=st.floats(15.0, 90.0),
    c3=st.floats(0.02, 0.5),
    size=st.sampled_from([12, 500]),
)
def test_without_noise_it_ends_at_the_curve(c1, c2, c3, size):
    estimate = last(GradientEstimator(), stretch((c1, c2, c3), 1, n=6000), size)
    h = np.linspace(0.0, 0.2, 50)
    # Where the peak is hardly reached, c1 and c3 of one curve can take each other's place.
    assert curve(h, *estimate.theta) == pytest.approx(curve(h, c1, c2, c3), abs=3e-3)


@FIXED
@given(st.data())
def test_whatever_comes_it_stays_within_its_bounds(data):
    estimator = GradientEstimator()
    for _ in range(data.draw(st.integers(1, 6))):
        n = data.draw(st.integers(1, 60))
        rng = np.random.default_rng(data.draw(st.integers(0, 999)))
        size = data.draw(st.sampled_from([1e-6, 0.1, 1.0, 1e3, 1e6]))
        slip = rng.uniform(-0.5, 0.5, n)
        estimate = estimator.update(Samples.curve(slip, size * rng.standard_normal(n)), 0)
        theta = np.array(estimate.theta)
        assert (theta >= np.array(EVOLUTION.lower) * (1 - 1e-9)).all()
        assert (theta <= np.array(EVOLUTION.upper) * (1 + 1e-9)).all()
        assert np.isfinite(estimate.noise_std)
        assert not np.isnan(estimate.covariance).any()


@pytest.mark.parametrize("seed", range(5))
def test_outliers_hardly_move_it(seed):
    """One sample in ten is off by 0.5, which lifts a mean by 0.05."""
    theta = (0.5, 30.0, 0.08)
    samples = stretch(theta, seed, n=5000, sd=0.01)
    rng = np.random.default_rng(seed + 100)
    off = rng.random(len(samples)) < 0.1
    samples = Samples.curve(samples.slip, samples.adhesion + 0.5 * off)
    estimate = last(GradientEstimator(), samples)
    assert estimate.mu_max == pytest.approx(float(peak(*theta).mu_max), abs=0.005)
    assert estimate.change_probability == 0.0


def test_the_mean_bounded_square_is_the_integral():
    for limit in (0.5, 1.345, 3.0):
        wanted, _ = quad(lambda u, k=limit: min(u * u, k * k) * norm.pdf(u), -12, 12, limit=200)
        assert _mean_bounded_square(limit) == pytest.approx(wanted, rel=1e-6)


@pytest.mark.parametrize(
    "wrong",
    [{"huber": 0.0}, {"batch": 0}, {"memory": 1.0}, {"window": 0.5}, {"change": 1.0},
     {"longest": 0.0}, {"growth": 0.0}, {"change_noise": 0.5}, {"noise_std": -1.0}],
)  # fmt: skip
def test_settings_that_make_no_sense_are_refused(wrong):
    with pytest.raises(ValueError, match="must be"):
        GradientSettings(**wrong)
