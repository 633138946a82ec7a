"""Draws of curves against an integration on a grid, for peaks that the slips did not reach."""

import sys
from pathlib import Path
from types import SimpleNamespace

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
from tests.seeds import first_quick

ROOT = Path(__file__).resolve().parents[2]
NOISE_STD = 0.01
ANY_SLIP = 1e3


@pytest.fixture(scope="module")
def tools():
    sys.path.insert(1, str(ROOT / "tools" / "benchmarks"))
    import _exact_posterior
    import _prepeak_bound

    return SimpleNamespace(exact=_exact_posterior.exact_posterior, bound=_prepeak_bound)


def make_sums(h, z):
    zero = np.zeros(len(h))
    points = Points(h, z, zero, zero, zero, np.zeros(len(h), dtype=np.int64), np.ones(len(h)))
    return increment(points, zero, NOISE_STD**2, 0.5)[CORRECTED]


def draw_data(bound, rng, used):
    """Slips and adhesions up to a share of a random surface's μ_max."""
    parts = bound.components(PriorSettings())
    weights = np.array([weight for weight, *_ in parts])
    _, centre, scale = parts[rng.choice(len(parts), p=weights / weights.sum())]
    c1, c2, c3 = theta = bound.theta_of(bound.draw_surface(rng, centre, scale))
    h = rng.uniform(0.0, bound.slip_at_use(theta, used), 1200)
    return h, c1 * -np.expm1(-c2 * h) - c3 * h + NOISE_STD * rng.standard_normal(len(h))


@pytest.mark.costly
@pytest.mark.parametrize(
    ("used", "surfaces"), first_quick([(0.95, 8), (0.95, 24), (0.5, 24), (0.7, 24), (0.9, 24)])
)
def test_one_draw_is_the_exact_posterior(tools, used, surfaces):
    """Mean and standard deviation of ln μ_max: over 300 surfaces up to 0.21 and 0.90 to 1.10."""
    prior, noise = Prior(PriorSettings()), NoisePrior(NOISE_STD**2, 1e6)
    for seed in range(surfaces):
        h, z = draw_data(tools.bound, np.random.default_rng([seed, 5]), used)
        sums = make_sums(h, z)
        curves = draw(sums, noise, prior, 0.5, TrackerSettings().curves)
        weights = normalise(log_weights(curves.log_base, curves.costs(sums), sums[DOF], noise))
        log_peak = np.log(curves.peaks[0])
        mean = weights @ log_peak
        std = np.sqrt(weights @ (log_peak - mean) ** 2)
        parts = tools.bound.components(PriorSettings())
        exact = tools.exact(h, z, NOISE_STD, parts, ANY_SLIP, 0.0)
        assert abs(mean - exact.mean) < 0.3 * exact.std
        assert 0.8 < std / exact.std < 1.2
        assert effective_size(weights) > 40
