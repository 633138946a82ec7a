"""Channels and waves that a residual depends on, of tables that were made with them."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from adhesion_can.diagnosis.effect_grams import SizeEstimate
from adhesion_can.diagnosis.inference.compute_effect_grams import _settled_size
from adhesion_can.diagnosis.inference.find_residual_channels import (
    FLIPS,
    find_residual_channels,
    find_wave,
)
from adhesion_can.diagnosis.inference.hold_out_gain import evaluate_hold_out
from adhesion_can.diagnosis.regression.candidate import Candidate
from adhesion_can.diagnosis.regression.gram_matrices import BlockGramMatrices
from adhesion_can.diagnosis.regression.model import Model, evaluate_model
from adhesion_can.diagnosis.regression.segment_curves import SegmentCurves
from adhesion_can.diagnosis.regression.whitened_regression import fit_model
from adhesion_can.physics.effects import effect_by_id
from tests.diagnosis.diagnosis_helpers import C1, C2, C3, build_table_drive, burckhardt
from tests.diagnosis.test_regression_fits import build_plain_regression

CURVE = Model(SegmentCurves(np.array([[C1, np.log(C2), C3]])))
N, STD, SPEED = 3000, 0.01, 12.0


def regression_of(factor, seed=1, rows=N):
    """A table whose adhesion is the curve times a factor of the dew point and the place."""
    rng = np.random.default_rng(seed)
    t = np.arange(rows) * 0.05
    slip = 0.11 * np.sin(2 * np.pi * t / 7.0) * (1 + 0.5 * np.sin(t / 13))
    dew = np.sin(2 * np.pi * t / 41.0) + 0.3 * np.sin(t)
    adhesion = factor(dew, SPEED * t) * burckhardt(slip) + STD * rng.standard_normal(rows)
    drive = build_table_drive(
        slip, adhesion, t, speed=np.full(rows, SPEED), covariates={"dew": dew}
    )
    return build_plain_regression(drive)


def channels_of(factor, seed=1):
    regression = regression_of(factor, seed)
    rng = np.random.default_rng(7)
    return regression, find_residual_channels(regression, fit_model(regression, CURVE), 0.01, rng)


def test_the_channel_that_explains_most_comes_first_with_what_it_takes_off():
    """1 + 0.15 dew²: no straight line, but a spline."""
    regression, found = channels_of(lambda dew, _: 1.0 + 0.15 * dew**2)
    first = found[0]
    assert first.channel.name == "dew"
    assert first.p_value < 0.01
    assert [one.gain for one in found] == sorted((one.gain for one in found), reverse=True)
    before = regression.residual(fit_model(regression, CURVE).model)
    left = before - first.prediction_change
    rmse = np.sqrt(np.mean(before**2))
    assert first.gain == pytest.approx(1.0 - np.sqrt(np.mean(left**2)) / rmse)
    assert np.sqrt(np.mean(left**2)) == pytest.approx(STD, rel=0.05)
    assert first.explained_square(rmse) == pytest.approx(rmse**2 - np.mean(left**2))
    assert first.spline_change + first.jacobian @ first.coefficients[:3] == pytest.approx(
        first.prediction_change
    )


def test_without_a_dependence_no_channel_is_significant_and_none_gains():
    _, found = channels_of(lambda dew, _: 1.0 + 0 * dew)
    assert found
    assert min(one.p_value for one in found) > 0.01
    assert max(one.gain for one in found) < 0.02
    assert not any(one.channel.period for one in found)


@pytest.mark.parametrize("length", [12.0, 40.0])
def test_a_wave_along_the_rail_is_found_with_its_length(length):
    _, found = channels_of(lambda _, place: 1.0 + 0.12 * np.cos(2 * np.pi * place / length + 1.0))
    (wave,) = [one for one in found if one.channel.period]
    assert wave.channel.name == "position"
    assert wave.channel.period == pytest.approx(length, rel=0.02)
    assert wave.p_value == 1.0 / (FLIPS + 1)
    assert wave.basis.shape == (N, 2)
    assert wave.gain > 0.1


def test_p_values_of_waves_are_those_of_chance():
    """Of noise they are even from 0 to 1: the mean of 30 of them has a deviation of 0.053."""
    values = []
    for seed in range(30):
        regression = regression_of(lambda dew, _: 1.0 + 0 * dew, seed, 1500)
        model = fit_model(regression, CURVE).model
        at = evaluate_model(regression.data, model.curves)
        values.append(find_wave(regression, model, at, np.random.default_rng(seed))[2])
    assert np.mean(values) == pytest.approx(0.5, abs=0.22)
    assert 0.0 < min(values) < max(values) <= 1.0


def test_few_rows_and_points_have_no_wave():
    for rows in (999, 1000):
        regression = regression_of(lambda dew, _: 1.0 + 0 * dew, rows=rows)
        at = evaluate_model(regression.data, CURVE.curves)
        found = find_wave(regression, CURVE, at, np.random.default_rng(1))
        assert (found is None) == (rows < 1000)


@pytest.mark.parametrize("other_drives", [False, True])
def test_held_out_rows_lose_what_a_channel_predicts(other_drives):
    """With the channel from the rows that decide, only the noise is left of those held out."""
    regression = regression_of(lambda dew, _: 1.0 + 0.15 * dew**2)
    number = regression.block
    regression = replace(regression, block=np.where(number // 2 % 3 == 1, -1 - number, number))
    fitted = fit_model(regression, CURVE)
    found = find_residual_channels(regression, fitted, 0.01, np.random.default_rng(7))
    dew = next(one for one in found if one.channel.name == "dew")
    result = evaluate_hold_out(
        regression, fitted.model, fitted.model, dew, other_drives=other_drives
    )
    assert result.rows.tolist() == np.flatnonzero(regression.block < 0).tolist()
    assert np.sqrt(np.mean(result.after**2)) == pytest.approx(STD, rel=0.1)
    assert np.sqrt(np.mean(result.before**2)) > 1.5 * STD


# ------------------------------------------------------------------- the size of one effect


def settled(value, left, std, *, free=(True, True, True, True)):
    """Size of a fitted effect that is still so far from where its fit would end."""
    candidate = Candidate(effect_by_id("humidity"))
    gram = np.eye(5)
    gram[3, 4] = gram[4, 3] = left
    fitted = SimpleNamespace(
        model=CURVE.with_effect(candidate, (value,)),
        free=np.array(free),
        covariance=np.diag([1.0, 1.0, 1.0, std**2]),
        grams=BlockGramMatrices(gram[None], np.ones(1)),
    )
    return _settled_size(fitted, candidate)


def test_what_is_left_of_a_step_is_taken_up_to_one_standard_error():
    assert settled(-0.004, 0.0005, 0.001) == SizeEstimate(pytest.approx(-0.0035), 0.001)
    assert settled(-0.004, -0.001, 0.001).value == pytest.approx(-0.005)
    assert settled(-0.004, 0.0011, 0.001) is None
    # Of parameters that do not move nothing is left.
    fixed = settled(-0.004, 0.0005, 0.001, free=(True, False, True, True))
    assert fixed.value == pytest.approx(-0.0035)


def test_at_the_end_of_its_range_and_without_an_error_there_is_no_size():
    assert settled(0.01, 0.0, 0.001) is None
    assert settled(-0.004, 0.0, 0.001, free=(True, True, True, False)) is None
    assert settled(-0.004, 0.0, 0.0) is None
    assert settled(-0.004, 0.0, np.inf) is None
    assert settled(0.0099, 0.0, 0.001) is not None
