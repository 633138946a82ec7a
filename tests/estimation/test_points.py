"""The branch of samples whose slip is smaller than its own error."""

from dataclasses import replace

import numpy as np
import pytest

from adhesion_can.estimation.tracker.points import build_points
from adhesion_can.physics.samples import Samples

SLIP_STD, STD = 0.002, 0.01


def measured(slip, adhesion, rng, size=2):
    """Samples of an update, `size` from each axle, with noise in both."""
    axles = len(slip)
    n = size * axles
    h = np.tile(slip, size) + SLIP_STD * rng.standard_normal(n)
    z = np.tile(adhesion, size) + STD * rng.standard_normal(n)
    return replace(
        Samples.curve(h, z),
        axle=np.tile(np.arange(1, axles + 1), size),
        slip_var=np.full(n, SLIP_STD**2),
        adhesion_var=np.full(n, STD**2),
    )


def mean_points(slip, adhesion, seeds):
    """Mean slip and adhesion of each axle's points over many updates, shape (axles,) each."""
    found = []
    for seed in seeds:
        points = build_points(measured(slip, adhesion, np.random.default_rng(seed)))
        found.append((points.slip.reshape(2, -1).mean(0), points.adhesion.reshape(2, -1).mean(0)))
    slips, adhesions = np.mean(found, axis=0)
    return slips, adhesions


def test_axles_that_pull_beside_axles_that_brake_keep_their_own_branches():
    slip = np.array([0.003, 0.003, 0.003, 0.003, -0.003, -0.003])
    adhesion = np.array([0.1, 0.1, 0.1, 0.1, -0.08, -0.08])
    slips, adhesions = mean_points(slip, adhesion, range(400))
    # Means of 800 samples: six standard errors.
    np.testing.assert_allclose(slips, np.abs(slip), atol=6 * SLIP_STD / 28)
    np.testing.assert_allclose(adhesions, np.abs(adhesion), atol=6 * STD / 28)


@pytest.mark.parametrize("level", [0.01, 0.02, 0.03, 0.06])
def test_noise_folds_no_axle_where_all_pull(level):
    """Also where some axles are sure of their adhesion and others are not."""
    slips, adhesions = mean_points(np.full(6, 0.0005), np.full(6, level), range(400))
    np.testing.assert_allclose(slips, 0.0005, atol=6 * SLIP_STD / 28)
    np.testing.assert_allclose(adhesions, level, atol=6 * STD / 28)


def test_an_axle_that_hardly_pulls_goes_with_the_others():
    adhesion = np.array([0.1, 0.1, 0.1, 0.1, 0.1, 0.004])
    slips, adhesions = mean_points(np.full(6, 0.0005), adhesion, range(400))
    assert adhesions[5] == pytest.approx(0.004, abs=6 * STD / 28)
    assert slips[5] == pytest.approx(0.0005, abs=6 * SLIP_STD / 28)


def test_without_stated_noise_of_the_adhesion_the_mean_of_all_axles_decides():
    rng = np.random.default_rng(1)
    adhesion = np.array([0.1, 0.1, 0.1, 0.1, -0.08, -0.08])
    samples = replace(measured(np.zeros(6), adhesion, rng), adhesion_var=np.zeros(12))
    assert (build_points(samples).sign[np.abs(samples.slip) < 4 * SLIP_STD] == 1.0).all()
