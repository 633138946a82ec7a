"""Errors of an interpolated vehicle speed, and coasting, at low speed: statistics as stated."""

from dataclasses import replace

import numpy as np
import pytest

from adhesion_can.estimation.tracker.curve_sums import (
    coefficients,
    costs,
    interpolation,
    slope_at,
)
from adhesion_can.estimation.tracker.increment import increment
from adhesion_can.estimation.tracker.layout import CORRECTED, DOF
from adhesion_can.estimation.tracker.points import CoastingGate, build_points
from adhesion_can.physics.burckhardt import RAIL, adhesion
from adhesion_can.physics.samples import Samples

DRY = RAIL[0].theta
SD = 0.01


def updates(rng, slip, error, count, shares=(0.475, 0.975)):
    """Updates of six axles at two places between two vehicle speeds, whose errors are white."""
    frames = error * rng.standard_normal(count + 1)
    for k in range(count):
        share = np.repeat(shares, 6)
        e = frames[k] + share * (frames[k + 1] - frames[k])
        h = np.full(12, slip)
        samples = Samples.curve(
            h + e, adhesion(h, *DRY) + SD * rng.standard_normal(12), np.full(12, 20_000 * k)
        )
        samples.axle[:] = np.tile(np.arange(1, 7), 2)
        yield replace(samples, slip_common_var=np.full(12, error**2), speed_share=share)


@pytest.mark.parametrize("slip", [0.004, 0.02])
def test_sum_of_squares_of_the_true_curve_is_its_number_of_samples(slip):
    count, found = 400, []
    x, factors = interpolation(np.log([DRY[1]])), coefficients(np.array([DRY]))
    for samples in updates(np.random.default_rng(1), slip, 0.002, count):
        points = build_points(samples)
        sums = increment(points, slope_at(points, DRY), SD**2, 0.5)[CORRECTED]
        assert sums[DOF] == 12
        found.append(costs(sums, x, factors)[0] / SD**2)
    # Chi-squared of 12 or a little less: mean within five standard errors, and hardly one above 41
    # (probability 5e-5). With one error for both places the mean is 31 at the lower slip.
    assert np.mean(found) < 12 + 5 * np.sqrt(24 / count)
    assert np.sum(np.array(found) > 41) <= 1


@pytest.mark.parametrize("level", [0.03, 0.04, 0.05])
def test_samples_in_light_traction_are_not_selected_by_their_noise(level):
    rng, gate, kept = np.random.default_rng(1), CoastingGate(), []
    for k in range(3000):
        noise = SD * rng.standard_normal(12)
        samples = Samples.curve(np.full(12, 0.002), level + noise, np.full(12, 20_000 * k))
        samples.axle[:] = np.tile(np.arange(1, 7), 2)
        stated = np.full(12, SD**2)
        samples = replace(samples, adhesion_var=stated, slip_var=np.full(12, 0.001**2))
        passed = gate.passes(samples)
        kept += noise[passed].tolist() if k else []
    if level < 0.04:
        assert len(kept) < 100
        return
    # Five standard errors; selected one by one, those at four standard deviations lie 0.8 too high.
    assert abs(np.mean(kept)) < 5 * SD / np.sqrt(len(kept))
    assert np.std(kept) == pytest.approx(SD, rel=5 / np.sqrt(2 * len(kept)))
