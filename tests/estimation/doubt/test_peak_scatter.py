"""Errors of the vehicle speed that last: what λ_m and its standard deviation make of them."""

from dataclasses import replace

import numpy as np
import pytest

from adhesion_can.estimation.batch_means import FEWEST
from adhesion_can.estimation.doubt.blocks import ReducedBlocks
from adhesion_can.estimation.doubt.estimator import DoubtingTracker
from adhesion_can.estimation.doubt.peak_scatter import slip_scatter
from adhesion_can.estimation.doubt.pooled_curve import PooledCurve
from adhesion_can.estimation.tracker.tracker import Tracker
from tests.estimation.doubt.doubt_helpers import AXLES, in_seconds, make_samples

STEEP = (0.32, 170.0, 0.9)
LAMBDA_M = float(np.log(STEEP[0] * STEEP[1] / STEEP[2]) / STEEP[1])


def lasting_error(rng, stamps_us, std, memory_s):
    """Autoregressive error of the first order at stamps, the same for all axles."""
    frames, member = np.unique(stamps_us, return_inverse=True)
    keep = np.exp(-np.diff(frames) * 1e-6 / memory_s)
    error = rng.standard_normal(len(frames))
    for k in range(1, len(error)):
        error[k] = keep[k - 1] * error[k - 1] + np.sqrt(1 - keep[k - 1] ** 2) * error[k]
    return std * error[member]


def coverage(std, memory_s, seeds, seconds=120.0):
    """Share of the estimates after 20 s whose 95 % intervals of λ_m hold, and that of TRACKING."""
    held, tracked = [], []
    for seed in seeds:
        rng = np.random.default_rng(seed)
        true = make_samples(rng, seconds, theta=STEEP)
        # Relative error e of the speed: 1 + λ is divided by 1 + e.
        error = lasting_error(rng, true.t_us, std, memory_s)
        samples = replace(true, slip=(1 + true.slip) / (1 + error) - 1, speed_us=true.t_us)
        estimator = DoubtingTracker(Tracker(), AXLES)
        for part in in_seconds(samples, 0.2):
            estimate = estimator.update(part, int(part.t_us[-1]) + 1)
            if estimate is not None and part.t_us[-1] > 20e6:
                off = abs(estimate.lambda_m - LAMBDA_M)
                held.append(off <= 1.96 * estimate.lambda_m_std)
                tracked.append(estimate.identifiable.both)
    return np.mean(held), np.mean(tracked)


@pytest.mark.slow
@pytest.mark.parametrize("memory_s", [1.0, 10.0])
@pytest.mark.parametrize("std", [0.001, 0.002])
def test_intervals_hold_beside_errors_of_the_speed_that_last(std, memory_s):
    held, _ = coverage(std, memory_s, range(8))
    assert held >= 0.93


@pytest.mark.costly
def test_intervals_hold_in_a_few_drives():
    held, _ = coverage(0.002, 10.0, range(3), seconds=90.0)
    assert held >= 0.93


@pytest.mark.costly
def test_without_such_errors_nothing_is_lost():
    held, tracked = coverage(0.0, 10.0, range(2), seconds=60.0)
    assert held == 1.0
    assert tracked >= 0.99


@pytest.mark.parametrize("worth", [0.0, -3.0])
def test_without_information_of_a_coefficient_the_place_is_unknown(worth):
    """Corrected for the errors of the slips, it may even be below 0."""
    rng = np.random.default_rng(1)
    root = rng.standard_normal((40, 3, 3))
    grams = root @ root.transpose(0, 2, 1)
    blocks = ReducedBlocks(grams, np.zeros((3, 3)), rng.standard_normal((40, 3)), 40, None, 1.0)
    assert 0.0 < slip_scatter(blocks, PooledCurve(STEEP)) < np.inf
    grams[:, 1, 1] = worth
    assert slip_scatter(blocks, PooledCurve(STEEP)) == np.inf


@pytest.mark.parametrize("units", [(1.0, 1.0, 1.0), (1e3, 1e-4, 1.0)])
def test_it_is_the_root_of_the_squared_pulls_of_blocks_that_are_independent(units):
    """λ_m = ln(c1 c2/c3)/c2 by differences; pulls change their sign from block to block."""
    rng = np.random.default_rng(3)
    roots = rng.standard_normal((FEWEST, 3, 5)) * np.array(units)[:, None]
    grams = roots @ roots.transpose(0, 2, 1)
    inverse = np.linalg.inv(grams.sum(axis=0))

    def place(theta):
        c1, c2, c3 = theta
        return np.log(c1 * c2 / c3) / c2

    theta, step = np.array(STEEP), 1e-6 * np.array(STEEP)
    gradient = [(place(theta + h) - place(theta - h)) / (2.0 * h.sum()) for h in np.diag(step)]
    influence = inverse @ gradient
    scores = rng.standard_normal((FEWEST, 3)) * np.array(units)
    sign = np.where(np.arange(FEWEST) % 2, -1.0, 1.0)
    scores *= (sign * np.sign(scores @ influence))[:, None]
    blocks = ReducedBlocks(grams, np.zeros((3, 3)), scores, FEWEST, np.ones(FEWEST), 1.0)
    variance = FEWEST / (FEWEST - 3) * np.sum((scores @ influence) ** 2)
    found = slip_scatter(blocks, PooledCurve(STEEP))
    assert found == pytest.approx(np.sqrt(variance) / LAMBDA_M, rel=1e-4)
