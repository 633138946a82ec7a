"""A switch whose message comes later than its effect, earlier, or for another reason."""

import numpy as np
import pytest

from adhesion_can.estimation.extended.estimator import ExtendedEstimator
from adhesion_can.estimation.tracker.tracker import Tracker
from tests.estimation.test_extended import HEIGHT, STEP_US, World, model_of, rail

GAIN = 0.2
"""That of `sanding` in `model_of`."""
ON_S, OFF_S = (6.0, 12.0), (9.0, 15.0)
"""Times at which the effect begins and ends, s."""
SEEDS = range(5)


def errors(late_s, seed, height=1.0 + GAIN, ends=OFF_S):
    """Times, relative errors of μ_max, and time since the surface's change, of a drive of 18 s.

    Args:
        late_s: Time from the effect to its message, s; negative: the message is first.
        seed: Seed of the noise.
        height: Factor of the adhesion while the effect is there.
        ends: Times at which the effect ends, s.

    """
    w = World(seconds=18.0, noise=0.01, seed=seed)
    there = sum(((w.t >= a) & (w.t < b)) * 1.0 for a, b in zip(ON_S, ends, strict=True))
    w.sand = np.interp(w.t - late_s, w.t, there).round()
    factor = 1.0 + (height - 1.0) * there
    # Creep near the peak, where the level shows in each sample.
    w.slip = 0.04 + 0.05 * np.abs(np.sin(2 * np.pi * (w.t[:, None] / 1.7 + w.axles / 6)))
    estimator = ExtendedEstimator(Tracker(), model_of("sanding"))
    found = []
    for samples in w.batches(factor[:, None] * rail(w.slip)):
        now = int(samples.t_us[-1])
        estimate = estimator.update(samples, now + STEP_US)
        if estimate is not None and now > 4e6:
            true = HEIGHT * factor[now // STEP_US]
            found.append((now * 1e-6, estimate.mu_max / true - 1.0, estimate.surface_since_us))
    return np.array(found).T


@pytest.mark.costly
@pytest.mark.parametrize("late_s", [0.7, -0.7])
def test_the_adhesion_follows_the_samples_and_not_the_message(late_s):
    """And no change of the surface is made of what the switch has done."""
    drives = [errors(late_s, seed) for seed in SEEDS]
    assert np.mean([np.abs(error) > 0.05 for _, error, _ in drives]) <= 0.02
    assert all((since == since[0]).all() for *_, since in drives)


@pytest.mark.costly
def test_a_message_in_time_changes_nothing():
    wrong = np.concatenate([np.abs(errors(0.0, seed)[1]) > 0.03 for seed in SEEDS])
    assert not wrong.any()


@pytest.mark.costly
def test_a_surface_that_only_looks_like_the_switch_is_followed():
    """No message ever comes: after 1.5 s it is the rail that has changed."""
    for seed in SEEDS:
        t, error, _ = errors(100.0, seed, ends=(9.0, 18.0))
        settled = ((t > 8.2) & (t < 9.0)) | (t > 15.0)
        assert np.abs(error[settled]).max() < 0.03


@pytest.mark.costly
@pytest.mark.parametrize("height", [0.6, 1.6])
def test_another_change_than_the_switch_makes_is_one_of_the_surface(height):
    for seed in SEEDS:
        t, error, _ = errors(100.0, seed, height=height, ends=(9.0, 18.0))
        assert np.abs(error[(t > 6.8) & (t < 9.0)]).max() < 0.03
