"""Fits of the regression against SciPy's, and the errors that they state."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import least_squares

from adhesion_can.diagnosis.regression.candidate import Candidate
from adhesion_can.diagnosis.regression.gram_matrices import BlockGramMatrices
from adhesion_can.diagnosis.regression.model import Model, RegressionData, evaluate_model
from adhesion_can.diagnosis.regression.segment_curves import SegmentCurves
from adhesion_can.diagnosis.regression.whitened_regression import (
    FittedModel,
    WhitenedRegression,
    _free_parameters,
    _sandwich_covariance,
    fit_model,
)
from adhesion_can.diagnosis.regression.whitening import ContiguousRuns, Whitener
from adhesion_can.physics.effects import effect_by_id
from tests.diagnosis.diagnosis_helpers import C1, C2, C3, build_table_drive, burckhardt

CURVE = np.array([[C1, np.log(C2), C3]])


def build_plain_regression(drive, block_s=2.0):
    n = len(drive)
    zero = np.zeros(n)
    data = RegressionData((drive,), np.zeros(n, dtype=np.int64), 1)
    whitener = Whitener(np.array([1.0]), ContiguousRuns(np.zeros(1, dtype=np.int64), n))
    block = np.floor(drive.t_s / block_s).astype(np.int64)
    return WhitenedRegression(
        data, np.ones(n), zero, np.zeros((n, 0)), np.zeros(1), zero, whitener, np.ones(n), block
    )


def table(rng, factor=1.0, n=4000, std=0.01):
    t = np.arange(n) * 0.05
    slip = 0.11 * np.sin(2 * np.pi * t / 7.0) * (1 + 0.5 * np.sin(t / 13))
    return slip, factor * burckhardt(slip) + std * rng.standard_normal(n), t


def test_a_fit_of_white_noise_is_scipys():
    slip, mu, t = table(np.random.default_rng(2))
    found = fit_model(
        build_plain_regression(build_table_drive(slip, mu, t)),
        Model(SegmentCurves(np.array([[0.3, 3.0, 0.1]]))),
    )

    def residual(x):
        return mu - burckhardt(slip, x[0], np.exp(x[1]), x[2])

    by_scipy = least_squares(residual, [0.3, 3.0, 0.1])
    assert found.model.curves.values[0] == pytest.approx(by_scipy.x, rel=2e-3)
    covariance = np.linalg.inv(by_scipy.jac.T @ by_scipy.jac) * np.mean(by_scipy.fun**2)
    # The sandwich may be wider, by chance of the blocks.
    ratio = np.sqrt(found.covariance.diagonal() / covariance.diagonal())
    assert (ratio >= 0.99).all()
    assert (ratio < 1.6).all()
    assert found.grams.total[-1, -1] == pytest.approx(np.sum(by_scipy.fun**2), rel=1e-3)


@pytest.mark.parametrize("seed", range(3))
def test_a_parameter_at_its_bound_does_not_stop_the_others(seed):
    """Rising data press the fall c3 against 0; SciPy's bounded fit finds the rest."""
    slip, mu, t = table(np.random.default_rng(seed))
    mu = mu + 0.9 * slip
    start = Model(SegmentCurves(np.array([[0.2, 3.0, 0.3]])))
    found = fit_model(build_plain_regression(build_table_drive(slip, mu, t)), start)
    lower, upper = start.bounds

    def residual(x):
        return mu - burckhardt(slip, x[0], np.exp(x[1]), x[2])

    by_scipy = least_squares(residual, [0.3, 3.0, 0.1], bounds=(lower, upper))
    assert found.model.curves.values[0] == pytest.approx(by_scipy.x, rel=2e-3, abs=1e-6)
    assert found.free.tolist() == [True, True, False]
    rest = found.grams.total[:-1, -1][:2] / np.sqrt(found.grams.total.diagonal()[:2])
    assert np.abs(rest).max() < 1e-2 * np.sqrt(found.grams.square)


def test_squares_of_a_block_are_those_by_the_parameters_of_the_others():
    """First order against refits with the block left out."""
    slip, mu, t = table(np.random.default_rng(3), n=1200)
    regression = build_plain_regression(build_table_drive(slip, mu, t), block_s=6.0)
    found = fit_model(regression, Model(SegmentCurves(CURVE)))
    for b in range(0, 10, 3):
        others = replace(
            regression, block=np.where(regression.block == b, -1 - b, regression.block)
        )
        again = fit_model(others, found.model).model
        own = regression.block == b
        left = evaluate_model(regression.data, again.curves).residual[own]
        assert found.cross_validated_squares[b] == pytest.approx(np.sum(left**2), rel=0.02)


def test_squares_by_the_others_are_exact_where_the_model_is_linear():
    """Refits without each of a few blocks, whose leverage is large; but for two kinds of column.

    What one block alone knows stays in it, and a parameter that is not free does not move.
    """
    rng = np.random.default_rng(4)
    columns, noise = rng.standard_normal((48, 3)), rng.standard_normal(48)
    columns[:, 2] = np.where(np.arange(48) < 12, 5.0, 1e-3) * columns[:, 2]
    residual = noise - columns @ np.linalg.lstsq(columns, noise, rcond=None)[0]
    idle = rng.standard_normal((48, 1))
    fitted = FittedModel(
        Model(SegmentCurves(CURVE)),
        blocks_of(np.column_stack([columns, idle]), residual, 12),
        np.eye(4),
        np.array([True, True, True, False]),
    )
    wanted = []
    for first in range(0, 48, 12):
        own = np.isin(np.arange(48), np.arange(first, first + 12))
        known = columns[:, :2] if first == 0 else columns
        again = np.linalg.lstsq(known[~own], residual[~own], rcond=None)[0]
        wanted.append(np.sum((residual[own] - known[own] @ again) ** 2))
    assert fitted.cross_validated_squares[1:] == pytest.approx(wanted[1:], rel=1e-5)
    # The third column is as good as unknown to the others: its size stays what it was.
    assert fitted.cross_validated_squares[0] == pytest.approx(wanted[0], rel=0.02)
    assert fitted.cross_validated_square == pytest.approx(sum(fitted.cross_validated_squares))


def test_what_is_held_out_is_the_rest():
    slip, mu, t = table(np.random.default_rng(5), n=400)
    whole = build_plain_regression(build_table_drive(slip, mu, t), block_s=2.0)
    number = whole.block
    part = replace(whole, block=np.where(number % 3 == 1, -1 - number, number))
    assert part.used.tolist() == (number % 3 != 1).tolist()
    assert part.held_out.used.tolist() == (number % 3 == 1).tolist()
    assert part.block_number.tolist() == part.held_out.block_number.tolist() == number.tolist()
    assert part.all_data.block.tolist() == number.tolist()
    assert part.held_out.held_out.block.tolist() == part.block.tolist()


@pytest.mark.parametrize(("second", "is_whole"), [("held out", False), ("in part", True)])
def test_what_is_reported_is_of_all_rows_but_those_of_a_drive_held_out_whole(second, is_whole):
    slip, mu, t = table(np.random.default_rng(5), n=400)
    drive = build_table_drive(slip, mu, t)
    one = build_plain_regression(drive)
    number = np.append(one.block, one.block + 20)
    held = np.append(np.zeros(400, dtype=bool), (np.arange(400) < 200) | (second == "held out"))
    data = RegressionData((drive, drive), np.zeros(800, dtype=np.int64), 1)
    both = replace(one, data=data, block=np.where(held, -1 - number, number))
    wanted = number if is_whole else both.block
    assert both.last_fit.block.tolist() == wanted.tolist()


@pytest.mark.parametrize("number", range(4))
@pytest.mark.parametrize("uphill", [-2.0, 2.0])
@pytest.mark.parametrize("end", [0, 1])
def test_a_parameter_stays_at_a_bound_that_the_data_press_it_against_alone(number, uphill, end):
    """Whatever the products of the Jacobian's own columns are."""
    model = Model(SegmentCurves(CURVE)).with_effect(Candidate(effect_by_id("humidity")))
    vector = model.parameter_vector
    vector[number] = model.bounds[end][number]
    matrix = np.eye(5) - 3.0 * uphill * (1.0 - np.eye(5))
    matrix[:-1, -1] = np.where(np.arange(4) == number, uphill, 0.5)
    found = _free_parameters(
        replace(model, curves=SegmentCurves(vector[None, :3]), values=((vector[3],),)),
        BlockGramMatrices(matrix[None], np.ones(1)),
    )
    is_pressed = (uphill < 0.0) == (end == 0)
    assert found.tolist() == [k != number or not is_pressed for k in range(4)]


def test_weights_follow_the_share_of_the_slips_noise_in_what_is_white():
    """The variance of the residuals grows fourfold with the share."""
    rng = np.random.default_rng(6)
    slip, mu, t = table(rng)
    share = rng.uniform(size=len(t))
    plain = replace(
        build_plain_regression(build_table_drive(slip, mu, t)), slip_variance_share=share
    )
    residual = np.sqrt(1.0 + 3.0 * share) * rng.standard_normal(len(t))
    found = plain.refit_whitening(residual)
    assert found.whitener.order == 0
    assert found.weight == pytest.approx(1.0 / np.sqrt(1.0 + 3.0 * share), rel=0.1)


def test_stated_errors_cover_the_truth():
    """Curve and effect together, a hundred tables: 95 % intervals cover in 80 to 100 %.

    Five standard errors below a coverage of 93 %, which is that of some thirty blocks.
    """
    candidate = Candidate(effect_by_id("humidity"))
    covered = []
    for seed in range(100):
        rng = np.random.default_rng(seed)
        t = np.arange(2000) * 0.05
        humidity = 65 + 20 * np.sin(2 * np.pi * t / 37)
        slip, mu, t = table(rng, 1 - 0.003 * (humidity - 60), 2000)
        drive = build_table_drive(slip, mu, t, covariates={"relative_humidity_percent": humidity})
        found = fit_model(
            build_plain_regression(drive), Model(SegmentCurves(CURVE)).with_effect(candidate)
        )
        std = np.sqrt(found.covariance.diagonal())
        truth = np.array([C1, np.log(C2), C3, -0.003])
        covered.append(np.abs(found.model.parameter_vector - truth) < 1.96 * std)
    share = np.mean(covered, axis=0)
    assert (share >= 0.8).all()


def blocks_of(columns, residual, size):
    """Gram matrices of blocks of so many rows, the residual last."""
    whole = np.column_stack([columns, residual])
    parts = whole.reshape(-1, size, whole.shape[1])
    return BlockGramMatrices(
        np.array([part.T @ part for part in parts]), np.full(len(parts), float(size))
    )


def test_a_residual_that_no_block_explains_has_the_covariance_of_least_squares():
    """G⁻¹ times the sum of squares over the rows less the parameters; in any unit of a column."""
    rng = np.random.default_rng(7)
    columns, residual = rng.standard_normal((60, 3)) @ rng.standard_normal((3, 3)), np.zeros(60)
    for first in range(0, 60, 10):
        own = slice(first, first + 10)
        noise = rng.standard_normal(10)
        residual[own] = noise - columns[own] @ np.linalg.lstsq(columns[own], noise, rcond=None)[0]
    wanted = np.linalg.inv(columns.T @ columns) * (residual @ residual) / 57.0
    found = _sandwich_covariance(blocks_of(columns, residual, 10))
    assert found == pytest.approx(wanted, rel=1e-6)
    units = np.array([1e-7, 1.0, 1e6])
    found = _sandwich_covariance(blocks_of(columns * units, residual, 10))
    assert found * np.outer(units, units) == pytest.approx(wanted, rel=1e-6)
    idle = _sandwich_covariance(blocks_of(np.column_stack([columns, 0 * residual]), residual, 10))
    assert idle[:3, :3] == pytest.approx(wanted * 57.0 / 56.0, rel=1e-6)


def test_blocks_that_err_together_widen_it_and_leave_the_correlations():
    """Of a mean with an error of each block: the variance of the blocks over their number."""
    rng = np.random.default_rng(8)
    level = np.repeat(rng.standard_normal(40), 25)
    residual = level - level.mean()
    slope = np.tile(np.linspace(-1.0, 2.0, 25), 40)
    found = _sandwich_covariance(blocks_of(np.column_stack([np.ones(1000), slope]), residual, 25))
    (alone,) = _sandwich_covariance(blocks_of(np.ones((1000, 1)), residual, 25)).ravel()
    assert alone == pytest.approx(np.var(residual[::25], ddof=1) / 40, rel=1e-6)
    columns = np.column_stack([np.ones(1000), slope])
    plain = np.linalg.inv(columns.T @ columns)
    correlation = found[0, 1] / np.sqrt(found[0, 0] * found[1, 1])
    assert correlation == pytest.approx(plain[0, 1] / np.sqrt(plain[0, 0] * plain[1, 1]), rel=1e-6)


def test_a_size_counts_in_its_standard_deviations():
    candidate = Candidate(effect_by_id("falling_friction", "polach"))
    model = Model(SegmentCurves(CURVE)).with_effect(candidate, (0.04, 0.7))
    grams = BlockGramMatrices(np.eye(6)[None], np.ones(1))
    covariance = np.diag([1.0, 1.0, 1.0, 1e-4, 9.0])
    fitted = FittedModel(model, grams, covariance, np.ones(5, dtype=bool))
    assert fitted.size_in_deviations(0) == pytest.approx(4.0)
    exact = replace(fitted, covariance=np.zeros((5, 5)))
    assert exact.size_in_deviations(0) == np.inf
    nothing = replace(exact, model=exact.model.with_parameters(np.zeros(5)))
    assert nothing.size_in_deviations(0) == 0.0
