"""Levels that alternate along the rail, about an estimate that knows their mean."""

import numpy as np
import pytest

from adhesion_can.estimation.doubt.estimator import DoubtingTracker
from adhesion_can.estimation.doubt.level_scatter import LevelScatter
from adhesion_can.estimation.tracker.tracker import Tracker
from adhesion_can.physics.estimate import Estimate, Identifiable
from adhesion_can.physics.samples import Samples
from tests.estimation.doubt.doubt_helpers import AXLES, NOISE, THETA, curve, in_seconds

SEEDS = range(5)
LAMBDA_M = float(np.log(THETA[0] * THETA[1] / THETA[2]) / THETA[1])
MU_MAX = float(curve(np.array([LAMBDA_M]))[0])


def drive(seed, seconds, *, amplitude=0.0, period_s=2.5, change_s=None):
    """Samples near the peak, and the level of the rail under them.

    Args:
        seed: Seed of noise and phase.
        seconds: Duration, s.
        amplitude: Amplitude of the level, as a share of the adhesion.
        period_s: Time from joint to joint, s.
        change_s: Time of a single change of the surface to 0.6 of its level, s.

    """
    rng = np.random.default_rng(seed)
    t = np.repeat(np.arange(round(50 * seconds)) / 50, AXLES)
    axle = np.tile(np.arange(1, AXLES + 1), len(t) // AXLES)
    slip = 0.01 + 0.14 * np.sin(2 * np.pi * t / 7.3 + axle) ** 2
    phase = rng.uniform(0.0, 2 * np.pi)
    level = 1.0 + amplitude * np.sin(2 * np.pi * t / period_s + phase)
    if change_s is not None:
        level = np.where(t < change_s, level, 0.6)
    adhesion = level * curve(slip) + NOISE * rng.standard_normal(len(t))
    stamps = np.round(t * 1e6).astype(np.int64)
    samples = Samples.curve(slip, adhesion, stamps)
    return samples.with_variances(0.0 * t, 0.0 * t, 0.0 * t + NOISE**2), t, level


def scatter(samples):
    """Scatter about a fixed estimate, of the mean curve."""
    estimate = Estimate(
        *THETA,
        covariance=np.diag([1e-6, 1.0, 1e-6]),
        mu_max=MU_MAX,
        mu_max_std=0.001 * MU_MAX,
        lambda_m=LAMBDA_M,
        lambda_m_std=0.01 * LAMBDA_M,
        noise_std=NOISE,
        samples=10_000,
        identifiable=Identifiable(mu_max=True, lambda_m=True),
        surface_since_us=0,
    )
    found = LevelScatter(0.5)
    for part in in_seconds(samples, 0.1):
        found.add(part, estimate)
    return found.std


@pytest.mark.parametrize("seed", SEEDS)
def test_a_steady_rail_has_none(seed):
    assert scatter(drive(seed, 30.0)[0]) == 0.0


@pytest.mark.parametrize("amplitude", [0.05, 0.18])
def test_its_size_is_that_of_the_level(amplitude):
    found = [scatter(drive(seed, 30.0, amplitude=amplitude)[0]) for seed in SEEDS]
    # Root mean square of a sine, less what the means over 0.5 s and the trimming take.
    assert np.mean(found) == pytest.approx(amplitude / np.sqrt(2.0), rel=0.15)


def test_one_change_of_the_surface_is_no_scatter():
    before, t, _ = drive(1, 20.0, change_s=19.3)
    assert t[-1] > 19.3
    assert scatter(before) == 0.0


@pytest.mark.parametrize("seeds", [range(2), pytest.param(range(2, 7), marks=pytest.mark.slow)])
def test_a_long_drive_over_joints_is_not_tracked_with_a_wrong_peak(seeds):
    """After 64 blocks one holds more than a joint: their means no longer show the level's."""
    wrong, tracked = [], []
    for seed in seeds:
        samples, t, level = drive(seed, 150.0, amplitude=0.09)
        estimator = DoubtingTracker(Tracker(), AXLES)
        for part in in_seconds(samples, 0.25):
            estimate = estimator.update(part, int(part.t_us[-1]) + 1)
            now_s = part.t_us[-1] * 1e-6
            if estimate is None or now_s < 20.0:
                continue
            true = MU_MAX * level[np.searchsorted(t, now_s - 1e-6)]
            off = abs(estimate.mu_max - true)
            tracked.append(estimate.identifiable.both)
            wrong.append(off > 3 * estimate.mu_max_std and off > 0.02 * true)
    wrong, tracked = np.array(wrong), np.array(tracked)
    assert (wrong & tracked).mean() <= 0.01
