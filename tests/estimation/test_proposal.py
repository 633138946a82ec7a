"""Draws of curves near a posterior: they reach the top of its ridge, and resolve it."""

import numpy as np
import pytest
from scipy import stats

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
from adhesion_can.estimation.tracker.proposal import (
    _COARSE_CELLS,
    COARSE,
    FINE,
    TEMPER,
    UNIFORM,
    _closer,
    _draw_from_cells,
    _Frame,
    _Segment,
    propose,
)
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


@pytest.mark.costly
@pytest.mark.parametrize("reach", [0.7, 1.5, 3.0])
@pytest.mark.parametrize("std", [0.0003, 0.001, 0.01])
@pytest.mark.parametrize("name", SURFACES)
def test_draws_reach_the_top_of_the_ridge_and_resolve_it(name, std, reach):
    for count in (60, 600, 6000):
        for seed in range(4):
            costs, weights, of_truth = draw_curves(SURFACES[name], std, reach, count, seed)
            assert costs.min() < of_truth + 2.0 * std**2, (count, seed)
            assert effective_size(weights) > CURVES / 6, (count, seed)


def segment(theta, count, std, seed=0, noise_var=1e-4):
    """Slips, adhesions and their segment."""
    rng = np.random.default_rng(seed)
    h = rng.uniform(0.0, 0.2, count)
    z = adhesion(h, *theta) + std * rng.standard_normal(count)
    zero = np.zeros(count)
    points = Points(h, z, zero, zero, zero, np.zeros(count, dtype=np.int64), np.ones(count))
    sums = increment(points, zero, 1e-4, SLIP_MAX)[CORRECTED]
    return h, z, _Segment(sums, noise_var, 4.0, Prior(PriorSettings()))


@pytest.mark.parametrize("noise_var", [1e-6, 1e-4, 1e-2])
@pytest.mark.parametrize("count", [3, 40])
def test_the_level_is_that_of_a_linear_regression(count, noise_var):
    """c1 of z = c1 f(λ), with the normal prior of 0.35 ± 0.5 as one more observation."""
    h, z, found = segment(SURFACES["wet"], count, 0.01)
    places = np.column_stack([np.log([20.0, 60.0, 150.0]), np.log([2.0, 4.0, 6.0])])
    mean, std, cost = found.level(places, noise_var)
    for k, (c2, s) in enumerate(np.exp(places)):
        f = 1.0 - np.exp(-c2 * h) - c2 * np.exp(-s) * h
        rows, wanted = (
            np.append(f / np.sqrt(noise_var), 2.0),
            np.append(z / np.sqrt(noise_var), 0.7),
        )
        best = (rows @ wanted) / (rows @ rows)
        assert mean[k] == pytest.approx(best, rel=1e-4)
        assert std[k] == pytest.approx(1.0 / np.sqrt(rows @ rows), rel=1e-4)
        assert cost[k] == pytest.approx(np.sum((z - best * f) ** 2), rel=1e-3, abs=1e-6)


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("count", [30, 300])
def test_the_stated_density_of_the_draws_is_theirs(count, seed):
    """By importance sampling: densities whose integrals are known, from draws by theirs.

    With few samples the density is a bent ridge, beside which a normal one has too few draws.
    """
    _, _, found = segment(SURFACES["dry"], count, 0.01, seed)
    drawn = propose(found.sums, found.noise_var, found.noise_freedom, found.prior, 20_000)
    phi = drawn.phi[drawn.good]
    middle, spread = np.average(phi, axis=0), np.cov(phi.T)
    target = stats.multivariate_normal(middle, 0.05 * spread)
    ratio = np.exp(target.logpdf(phi) - drawn.log_density[drawn.good])
    assert ratio.sum() / len(drawn.good) == pytest.approx(1.0, abs=0.01)


def test_places_are_drawn_by_the_cells_and_their_density_is_stated():
    rng = np.random.default_rng(1)
    log_m = rng.uniform(-6.0, 0.0, FINE * FINE)
    u, log_density = _draw_from_cells(log_m, 400_000)
    assert u.min() >= 0.0
    assert u.max() <= 1.0
    mass = np.exp(TEMPER * log_m)
    mass = (1.0 - UNIFORM) * mass / mass.sum() + UNIFORM / len(mass)
    cells = np.minimum((u * FINE).astype(int), FINE - 1) @ [FINE, 1]
    shown = np.bincount(cells, minlength=len(mass)) / len(u)
    assert np.abs(shown - mass).sum() < 0.05
    np.testing.assert_allclose(log_density, np.log(mass[cells] * len(mass)), rtol=1e-9, atol=1e-12)


@pytest.mark.parametrize("angle", [0.0, 0.4, 1.2, 2.5])
def test_the_next_frame_is_laid_closely_about_the_cells_that_matter(angle):
    """Cells of a narrow strip through the square: the frame holds all of them and little else."""
    along = np.array([np.cos(angle), np.sin(angle)])
    across = np.abs((_COARSE_CELLS - 0.5) @ [-along[1], along[0]]) < 0.06
    frame = _Frame(np.array([1.0, -2.0]), np.array([[3.0, 0.5], [0.0, 2.0]]))
    closer = _closer(frame, across)
    places = np.linalg.solve(closer.edges, (frame.points(_COARSE_CELLS[across]) - closer.corner).T)
    assert places.min() > 0.0
    assert places.max() < 1.0
    # A cell more on each side of a strip of 0.12 with middles up to 0.06 from its line.
    length = np.ptp((_COARSE_CELLS[across] - 0.5) @ along)
    assert closer.area <= 1.1 * frame.area * (length + 2 / COARSE) * (0.12 + 2 / COARSE)
