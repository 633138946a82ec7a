"""Regression calibration against samples whose true slips are known."""

import numpy as np
import pytest

from adhesion_can.estimation.families.binned_samples import ADHESION, COUNT, SLIP, BinnedSamples
from adhesion_can.estimation.families.curve_points import build_points
from tests.estimation.families.family_helpers import burckhardt, make_samples

THETA = (0.41, 33.0, 0.38)


@pytest.mark.parametrize("slip_std", [0.003, 0.006])
def test_errors_of_the_slips_are_removed(slip_std):
    """Mean residual over the steep part, 8 drives: a third of what the measured slips leave."""
    law = burckhardt()
    left, naive = [], []
    for seed in range(8):
        rng = np.random.default_rng(seed)
        samples = make_samples(law, rng, 60.0, slip_std=slip_std, noise=0.003)
        binned = BinnedSamples.from_samples(samples, 0.003)
        points = build_points(binned, THETA)
        means = binned.sums[:, points.rows] / binned.sums[COUNT, points.rows]
        steep = (points.slip > 2.5 * slip_std) & (points.slip < 0.03)
        speed, std = points.conditions.speed, points.slip_std
        averaged = 0.5 * (law(points.slip + std, speed) + law(points.slip - std, speed))
        weight = points.weight * steep
        left.append(weight @ (means[ADHESION] - averaged) / weight.sum())
        naive.append(weight @ (means[ADHESION] - law(means[SLIP], speed)) / weight.sum())
    assert abs(np.mean(left)) < abs(np.mean(naive)) / 3


def test_exact_slips_stay_where_they_are():
    samples = make_samples(burckhardt(), np.random.default_rng(1), 30.0, slip_std=0.0)
    binned = BinnedSamples.from_samples(samples, 0.01)
    points = build_points(binned, THETA)
    measured = binned.sums[SLIP, points.rows] / binned.sums[COUNT, points.rows]
    np.testing.assert_allclose(points.slip, measured)
    assert not points.slip_std.any()


def test_bins_whose_sign_is_not_sure_give_no_point():
    samples = make_samples(burckhardt(), np.random.default_rng(1), 30.0, slip_std=0.01)
    points = build_points(BinnedSamples.from_samples(samples, 0.01), THETA)
    assert points.slip.min() > 0.005
