"""Fits of the regression against SciPy's, and the errors that they state."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import least_squares

from adhesion_can.diagnosis.regression.candidate import Candidate
from adhesion_can.diagnosis.regression.model import Model, RegressionData, evaluate_model
from adhesion_can.diagnosis.regression.segment_curves import SegmentCurves
from adhesion_can.diagnosis.regression.whitened_regression import WhitenedRegression, fit_model
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
