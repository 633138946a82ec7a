"""Joint fits where errors of the slips are much of the information, or more than all of it."""

import numpy as np
import pytest

from adhesion_can.estimation.doubt.blocks import CURVE, TANGENTS, ReducedBlocks
from adhesion_can.estimation.doubt.directions import build_directions
from adhesion_can.estimation.doubt.joint_peak import (
    LEAST_LEFT,
    compute_joint_peak,
    fit_jointly,
)
from adhesion_can.estimation.doubt.pooled_curve import PooledCurve

DIRECTIONS = build_directions(2)
SIZE = CURVE + len(DIRECTIONS)
PRIOR = 0.03
CHOSEN = range(CURVE)
STDS = dict.fromkeys(range(TANGENTS, CURVE), PRIOR)


def errors_in_variables(rng, rows, noise, slip_noise, truth):
    """Sums of a linear regression whose columns have errors: corrected Gram matrix and score."""
    columns = rng.standard_normal((rows, SIZE))
    slopes = rng.standard_normal((rows, SIZE))
    error = slip_noise * rng.standard_normal(rows)
    seen = columns + slopes * error[:, None]
    response = columns @ truth + noise * rng.standard_normal(rows)
    weight = 1.0 / (noise**2 + slip_noise**2 * (slopes @ truth) ** 2)
    dilution = (slopes * (weight * slip_noise**2)[:, None]).T @ slopes
    gram = (seen * weight[:, None]).T @ seen - dilution
    return ReducedBlocks(gram[None], dilution, ((seen * weight[:, None]).T @ response)[None], 1,
                         np.ones(1), 1.0)  # fmt: skip


@pytest.mark.parametrize("slip_noise", [0.02, 0.3])
def test_estimates_scatter_as_they_say(slip_noise):
    """Over 200 draws of the tangents: two standard deviations hold 90 to 99 %, and no bias."""
    rng = np.random.default_rng(3)
    inside, errors = [], []
    truth = np.zeros(SIZE)
    for _ in range(200):
        truth[:TANGENTS] = 0.3 * rng.standard_normal(TANGENTS)
        blocks = errors_in_variables(rng, 400, 0.2, slip_noise, truth)
        fit = fit_jointly(blocks, range(TANGENTS), DIRECTIONS, inflation=1.0, prior_std={})
        error = fit.change - truth[:TANGENTS]
        errors.append(error)
        inside.append(np.abs(error) < 2.0 * np.sqrt(np.diag(fit.covariance)))
    assert 0.88 < np.mean(inside) < 0.995
    assert np.abs(np.mean(errors, axis=0)).max() < 4.0 * np.std(errors) / np.sqrt(200)


@pytest.mark.parametrize("seed", range(20))
def test_where_the_errors_exceed_the_information_little_is_known(seed):
    """A direction with less than nothing left: its estimate stays at its prior's size."""
    rng = np.random.default_rng(seed)
    blocks = errors_in_variables(rng, 300, 0.2, 0.02, np.zeros(SIZE))
    along = np.zeros(SIZE)
    along[:CURVE] = rng.standard_normal(CURVE)
    along /= np.linalg.norm(along)
    whole = blocks.grams[0] + blocks.dilution
    more = 1.5 * float(along @ whole @ along)
    dilution = blocks.dilution + more * np.outer(along, along)
    gram = whole - dilution
    assert np.linalg.eigvalsh(gram[:CURVE, :CURVE]).min() < 0.0
    exceeded = ReducedBlocks(gram[None], dilution, blocks.scores, 1, np.ones(1), 1.0)
    fit = fit_jointly(exceeded, CHOSEN, DIRECTIONS, inflation=1.0, prior_std=STDS)
    usual = fit_jointly(blocks, CHOSEN, DIRECTIONS, inflation=1.0, prior_std=STDS)
    assert np.linalg.eigvalsh(fit.covariance).min() > 0.0
    own = along[fit.chosen]
    std, before = (float(np.sqrt(own @ one.covariance @ own)) for one in (fit, usual))
    assert std > before, "it is known less well"
    assert abs(own @ fit.change) < 6.0 * std
    assert np.abs(fit.change[TANGENTS:]).max() < PRIOR / LEAST_LEFT


def test_where_nothing_is_left_of_any_coefficient_there_is_an_answer():
    """A train that coasts: every corrected diagonal is below 0."""
    rng = np.random.default_rng(5)
    blocks = errors_in_variables(rng, 50, 0.2, 0.02, np.zeros(SIZE))
    whole = blocks.grams[0] + blocks.dilution
    coasting = ReducedBlocks(-0.2 * whole[None], 1.2 * whole, blocks.scores, 1, np.ones(1), 1.0)
    for chosen, stds in ((range(TANGENTS), {}), (CHOSEN, STDS)):
        fit = fit_jointly(coasting, chosen, DIRECTIONS, inflation=1.0, prior_std=stds)
        assert fit.chosen == list(chosen)
        assert np.linalg.eigvalsh(fit.covariance).min() > 0.0
        peak = compute_joint_peak(fit, PooledCurve((0.3, 40.0, 0.1)), DIRECTIONS, {}, 0.1)
        assert np.isfinite([peak.mu_max, peak.mu_max_std, peak.lambda_m, peak.lambda_m_std]).all()


def test_without_any_data_nothing_is_estimated():
    none = np.zeros((SIZE, SIZE))
    empty = ReducedBlocks(none[None], none, np.zeros((1, SIZE)), 1, np.ones(1), 1.0)
    fit = fit_jointly(empty, range(TANGENTS), DIRECTIONS, inflation=1.0, prior_std={})
    assert fit.chosen == []
    curve = PooledCurve((0.3, 40.0, 0.1))
    peak = compute_joint_peak(fit, curve, DIRECTIONS, {}, 0.2)
    assert peak.mu_max == pytest.approx(curve.mu_max, rel=1e-3)
    assert peak.mu_max_std == 0.0
