"""Draws of curves near a posterior: they reach the top of its ridge, and resolve it."""

import numpy as np
import pytest

from adhesion_can.estimation.tracker.curve_sums import Points
from adhesion_can.estimation.tracker.increment import increment
from adhesion_can.estimation.tracker.layout import CORRECTED, DOF
from adhesion_can.estimation.tracker.posterior import (
    NoisePrior,
    draw,
    effective_size,
    log_weights,
    normalise,
)
from adhesion_can.estimation.tracker.prior import Prior
from adhesion_can.estimation.tracker.settings import PriorSettings, TrackerSettings
from adhesion_can.physics.burckhardt import PUBLISHED, RAIL, adhesion, peak

SLIP_MAX = 0.5
SURFACES = {s.name: s.theta for s in (*PUBLISHED, *RAIL)}
CURVES = TrackerSettings().curves


def draw_curves(theta, std, reach, count, seed):
    """Draw for samples of a curve up to a share of its λ_m.

    Sums of squares of the curves that have a weight, all weights, and the sum of squares of the
    curve itself, which the best one does not exceed.
    """
    rng = np.random.default_rng(seed)
    h = rng.uniform(0.0, min(reach * float(peak(*theta).lambda_m), SLIP_MAX), count)
    noise = std * rng.standard_normal(count)
    zero = np.zeros(count)
    points = Points(h, adhesion(h, *theta) + noise, zero, zero, zero,
                    np.zeros(count, dtype=np.int64), np.ones(count))  # fmt: skip
    sums = increment(points, zero, std**2, 0.5)[CORRECTED]
    settings = TrackerSettings()
    prior = NoisePrior(settings.noise_std**2, 1.0)
    curves = draw(sums, prior, Prior(PriorSettings()), SLIP_MAX, CURVES)
    costs = curves.costs(sums)
    weights = normalise(log_weights(curves.log_base, costs, sums[DOF], prior))
    return costs[weights > 0.0], weights, float(noise @ noise)


@pytest.mark.parametrize("reach", [0.7, 1.5, 3.0])
@pytest.mark.parametrize("std", [0.0003, 0.001, 0.01])
@pytest.mark.parametrize("name", SURFACES)
def test_draws_reach_the_top_of_the_ridge_and_resolve_it(name, std, reach):
    for count in (60, 600, 6000):
        for seed in range(4):
            costs, weights, of_truth = draw_curves(SURFACES[name], std, reach, count, seed)
            assert costs.min() < of_truth + 2.0 * std**2, (count, seed)
            assert effective_size(weights) > CURVES / 6, (count, seed)
