"""The peak of a curve with small changes, by differences, and the fit of a few coefficients."""

import numpy as np
import pytest

from adhesion_can.estimation.doubt.blocks import CURVE, TANGENTS, ReducedBlocks
from adhesion_can.estimation.doubt.directions import CREEP_SPEED, LOAD, SPEED_SCALE
from adhesion_can.estimation.doubt.joint_peak import JointFit, compute_joint_peak, fit_jointly
from adhesion_can.estimation.doubt.pooled_curve import PooledCurve
from tests.estimation.doubt.doubt_helpers import DIRECTIONS, NAMES, THETA

CURVE_AT = PooledCurve(THETA)
SIZE = CURVE + len(DIRECTIONS)
LOAD_PLACE, CREEP_PLACE = CURVE + NAMES.index(LOAD), CURVE + NAMES.index(CREEP_SPEED)
REACHED = 0.3


def peak(chosen=(0, 1, 2), change=None, covariance=None, present=None, reached=REACHED):
    change = np.zeros(len(chosen)) if change is None else np.array(change, dtype=float)
    covariance = np.zeros((len(chosen),) * 2) if covariance is None else covariance
    fit = JointFit(list(chosen), change, covariance)
    return compute_joint_peak(fit, CURVE_AT, DIRECTIONS, present or {}, reached)


def test_without_a_change_it_is_the_peak_of_the_curve():
    found = peak()
    assert found.mu_max == pytest.approx(CURVE_AT.mu_max, rel=1e-4)
    assert found.lambda_m == pytest.approx(CURVE_AT.lambda_m, rel=5e-3)
    assert (found.mu_max_std, found.lambda_m_std) == (0.0, 0.0)


@pytest.mark.parametrize("change", [(0.02, 0.0, 0.0), (0.0, 4.0, 0.0), (0.0, 0.0, 0.08),
                                    (-0.02, -2.0, 0.05)])  # fmt: skip
def test_tangents_move_it_as_their_parameters_do(change):
    moved = PooledCurve(tuple(np.add(THETA, change)))
    found, before = peak(change=change), peak()
    assert found.mu_max - before.mu_max == pytest.approx(moved.mu_max - CURVE_AT.mu_max, abs=2e-3)
    by = moved.lambda_m - CURVE_AT.lambda_m
    assert found.lambda_m - before.lambda_m == pytest.approx(by, abs=0.25 * abs(by) + 5e-4)


def test_its_standard_deviations_are_those_of_draws_of_the_coefficients():
    rng = np.random.default_rng(1)
    root = np.array([[4e-3, 0.0, 0.0], [0.3, 0.6, 0.0], [4e-3, 2e-3, 8e-3]])
    found = peak(covariance=root @ root.T)
    drawn = [peak(change=root @ rng.standard_normal(3)) for _ in range(400)]
    for name in ("mu_max", "lambda_m"):
        scatter = np.std([getattr(one, name) for one in drawn])
        assert getattr(found, f"{name}_std") == pytest.approx(scatter, rel=0.2), name


def test_what_multiplies_the_curve_does_so_by_its_present_value():
    """A size of 0.2 with ln(load) −0.3: 6 % less; of the creep speed by the slip as well."""
    found = peak((LOAD_PLACE,), (0.2,), present={LOAD: -0.3})
    assert found.mu_max == pytest.approx(0.94 * CURVE_AT.mu_max, rel=1e-4)
    assert found.lambda_m == pytest.approx(CURVE_AT.lambda_m, rel=5e-3)
    assert peak((LOAD_PLACE,), (0.2,)).mu_max == pytest.approx(CURVE_AT.mu_max, rel=1e-4)
    falls = peak((CREEP_PLACE,), (-0.1,), present={CREEP_SPEED: 12.0})
    slip = np.linspace(1e-3, 0.2, 4000)
    c1, c2, c3 = THETA
    whole = (c1 * (1.0 - np.exp(-c2 * slip)) - c3 * slip) * (1.0 - 0.1 * 12.0 * slip)
    assert falls.mu_max == pytest.approx(whole.max(), rel=1e-3)
    assert falls.lambda_m == pytest.approx(slip[whole.argmax()], rel=0.02)
    # An error of the speed is none of the curve: it has no present value.
    scale = CURVE + NAMES.index(SPEED_SCALE)
    assert peak((scale,), (0.02,)).mu_max == pytest.approx(CURVE_AT.mu_max, rel=1e-4)


def test_a_curve_that_rises_to_the_end_of_what_was_reached_has_its_peak_there_unknown():
    found = peak(reached=0.03)
    assert found.lambda_m == pytest.approx(0.03, rel=0.05)
    assert found.lambda_m_std == 0.03
    assert found.mu_max < CURVE_AT.mu_max


def test_a_coefficient_without_data_stays_at_its_prior_and_others_are_least_squares():
    """Priors of directions have a tenth of the weight; the tangents have none."""
    rng = np.random.default_rng(2)
    columns = np.zeros((500, SIZE))
    columns[:, [0, 1, 2, LOAD_PLACE]] = rng.standard_normal((500, 4))
    response = columns[:, [0, 1, 2, LOAD_PLACE]] @ [0.5, -0.2, 0.1, 0.3]
    response += 0.1 * rng.standard_normal(500)
    scaled = columns / 0.1
    blocks = ReducedBlocks(
        (scaled.T @ scaled)[None], np.zeros((SIZE, SIZE)), (scaled.T @ response / 0.1)[None], 1,
        np.ones(1), 1.0,
    )  # fmt: skip
    chosen = [0, 1, 2, LOAD_PLACE, CREEP_PLACE]
    fit = fit_jointly(blocks, chosen, DIRECTIONS, inflation=4.0, prior_std={})
    assert fit.chosen == chosen[:4]  # nothing at all is known of the last one
    gram = scaled[:, fit.chosen].T @ scaled[:, fit.chosen]
    load = DIRECTIONS[NAMES.index(LOAD)]
    gram[3, 3] += 4.0 * 0.1 / load.prior_std**2
    assert fit.change == pytest.approx(
        np.linalg.solve(gram, scaled[:, fit.chosen].T @ response / 0.1), rel=1e-6
    )
    assert fit.covariance == pytest.approx(4.0 * np.linalg.inv(gram), rel=1e-6)
    assert fit.spread(SIZE)[[0, LOAD_PLACE]] == pytest.approx(fit.change[[0, 3]])
    assert not fit.spread(SIZE)[TANGENTS:CURVE].any()


@pytest.mark.parametrize("prior", [None, 0.01])
def test_a_bump_has_a_prior_of_a_tenth_unless_another_one_is_given(prior):
    """One observation of variance 1 of a bump alone: precision 1 and that of the prior."""
    gram = np.zeros((SIZE, SIZE))
    gram[TANGENTS, TANGENTS] = 1.0
    score = np.zeros(SIZE)
    score[TANGENTS] = 2.0
    blocks = ReducedBlocks(gram[None], 0 * gram, score[None], 1, np.ones(1), 1.0)
    given = {} if prior is None else {TANGENTS: prior}
    fit = fit_jointly(blocks, [TANGENTS], DIRECTIONS, inflation=1.0, prior_std=given)
    precision = 1.0 + (prior or 0.1) ** -2
    assert fit.change == pytest.approx([2.0 / precision])
    assert fit.covariance == pytest.approx(np.array([[1.0 / precision]]))
