"""What of a residual the sensors explain: variances, ratios and limits by hand."""

from types import SimpleNamespace

import numpy as np
import pytest

from adhesion_can.diagnosis.inference import sensor_noise
from adhesion_can.diagnosis.inference.sensor_noise import (
    NoiseComparison,
    _compare,
    _estimate_variance,
    _RowVariance,
    _variance_of_rows,
    compare_where_effort_is_noisy,
    compare_with_sensors,
    trimmed_rms,
)
from adhesion_can.diagnosis.regression.model import Model
from adhesion_can.diagnosis.regression.segment_curves import SegmentCurves
from adhesion_can.sampling.noise import NoiseEstimate, estimate_signal
from adhesion_can.sampling.traces import Trace
from tests.diagnosis.diagnosis_helpers import C1, C2, C3, build_table_drive, burckhardt
from tests.diagnosis.test_regression_fits import build_plain_regression

MODEL = Model(SegmentCurves(np.array([[C1, np.log(C2), C3]])))


def test_wild_readings_do_not_count_and_normal_ones_have_their_own_size():
    noise = 3.0 * np.random.default_rng(1).standard_normal(100_000)
    assert trimmed_rms(noise) == pytest.approx(3.0, rel=0.01)
    wild = np.where(np.arange(100_000) % 60 == 0, 900.0, noise)
    assert trimmed_rms(wild) == pytest.approx(3.0, rel=0.06)
    assert trimmed_rms(np.empty(0)) == 0.0
    assert trimmed_rms(np.array([-2.0])) == pytest.approx(2.0 / 0.9344)


@pytest.mark.parametrize(
    ("given", "is_above"),
    [
        ({}, True),
        ({"sensors": None}, False),
        ({"sensors": 0.0}, False),
        ({"usual": 1.15}, False),
        ({"usual": 1.1501}, True),
        # Three standard errors of 10 % more.
        ({"usual": 1.49, "std_error": 0.1}, False),
        ({"usual": 1.5, "std_error": 0.1}, True),
        # A few wild readings are the whole of it.
        ({"floor": 10.0, "usual": 2.9}, False),
        ({"floor": 10.0, "usual": 3.1}, True),
    ],
)
def test_what_exceeds_the_sensors_noise(given, is_above):
    known = {"floor": 1.2, "sensors": 1.0, "std_error": 0.0, "usual": 1.2, "left": 1.0}
    found = NoiseComparison(**(known | given))
    assert found.is_exceeded is is_above
    # What the effects alone leave is judged by the same rule.
    left = known | given
    other = NoiseComparison(**(left | {"left": left["usual"]}))
    assert other.leaves_more is is_above
    assert not NoiseComparison(**(known | {"left": 1.1})).leaves_more


def test_rows_count_by_the_reciprocal_of_their_variance():
    rng = np.random.default_rng(2)
    std = rng.uniform(0.5, 4.0, 500)
    noise, left = std * rng.standard_normal((2, 500))
    found = _compare(noise, 3.0 * left, std**2, 0.07)
    sensors = np.sqrt(500 / np.sum(1 / std**2))
    assert found.sensors == pytest.approx(sensors)
    assert found.floor == pytest.approx(np.sqrt(np.average(noise**2, weights=1 / std**2)))
    assert found.ratio == pytest.approx(np.sqrt(np.mean((noise / std) ** 2)))
    assert found.usual == pytest.approx(trimmed_rms(noise / std))
    assert found.left == pytest.approx(3.0 * trimmed_rms(left / std))
    assert found.std_error == 0.07


def test_variances_of_a_row_are_those_of_effort_and_slip():
    """σ_F/N, and the slope times the errors of wheel and vehicle speed: (1 + λ) σ_v / v."""
    rng, n = np.random.default_rng(3), 50
    load, speed, slip = rng.uniform(1e5, 3e5, n), rng.uniform(2, 20, n), rng.normal(0, 0.05, n)
    steepness, wheel = rng.uniform(0, 20, n), rng.uniform(1e-4, 1e-3, n)
    seen = SimpleNamespace(load=load, speed=speed, slip=slip)
    drive = SimpleNamespace(table=False, wheel_slip_std=wheel, observe=lambda: seen)
    by_effort, by_slip = _variance_of_rows(drive, NoiseEstimate(900.0), 0.02, steepness)
    assert by_effort == pytest.approx((900.0 / load) ** 2)
    of_speed = steepness * (1.0 + slip) * 0.02 / speed
    assert by_slip == pytest.approx((steepness * wheel) ** 2 + of_speed**2)


def test_the_noise_of_a_table_is_that_of_its_residual():
    rng, t = np.random.default_rng(4), np.arange(4000) * 0.05
    slip = 0.11 * np.sin(2 * np.pi * t / 7.0)
    noise = 0.01 * rng.standard_normal(4000)
    regression = build_plain_regression(build_table_drive(slip, burckhardt(slip) + noise, t))
    found = _estimate_variance(regression, MODEL)
    wanted = estimate_signal(Trace(np.rint(1e6 * t).astype(np.int64), regression.residual(MODEL)))
    assert found.variance == pytest.approx(np.full(4000, wanted.std**2))
    assert wanted.std == pytest.approx(0.01, rel=0.1)
    assert found.std_error == pytest.approx(wanted.std_error / wanted.std)
    assert not found.is_by_slip.any()
    compared = compare_with_sensors(regression, MODEL, noise)
    assert compared.ratio == pytest.approx(1.0, abs=0.1)


# --------------------------------------------------------------------------- of groups of rows


def rows(by_slip, noise):
    """A regression of 100 rows of variance 1, of which some have their noise from the slip."""
    is_by_slip = np.arange(100) < by_slip
    variance = _RowVariance(np.ones(100), is_by_slip, 0.0)
    residual = np.where(is_by_slip, *noise)
    regression = SimpleNamespace(residual=lambda _: residual, used=np.ones(100, dtype=bool))
    return variance, regression, residual


@pytest.mark.parametrize(
    ("by_slip", "share"), [(0, 2.0), (30, 2.0), (90, 2.0), (91, None), (100, None)]
)
def test_rows_with_noise_of_the_effort_are_compared_where_there_are_a_tenth(
    by_slip, share, monkeypatch
):
    variance, regression, _ = rows(by_slip, (7.0, 2.0))
    monkeypatch.setattr(sensor_noise, "_estimate_variance", lambda *_: variance)
    found = compare_where_effort_is_noisy(regression, MODEL)
    assert found == (None if share is None else pytest.approx(share / 0.9344))


@pytest.mark.parametrize(
    ("by_slip", "noise", "floor"),
    [(50, (1.0, 3.0), 3.0), (50, (3.0, 1.0), 3.0), (95, (1.0, 3.0), 1.0), (5, (3.0, 1.0), 1.0)],
)
def test_the_group_with_more_than_it_should_have_counts(by_slip, noise, floor, monkeypatch):
    """A group of less than a tenth of the rows is not compared."""
    variance, regression, left = rows(by_slip, noise)
    monkeypatch.setattr(sensor_noise, "_estimate_variance", lambda *_: variance)
    found = compare_with_sensors(regression, MODEL, left)
    assert found.floor == pytest.approx(floor)
    assert compare_with_sensors(regression, MODEL, np.empty(0)).sensors is None


def test_where_the_readings_show_no_noise_only_the_floor_is_known(monkeypatch):
    monkeypatch.setattr(sensor_noise, "_estimate_variance", lambda *_: None)
    found = compare_with_sensors(None, MODEL, np.array([3.0, -4.0]))
    assert found.to_dict() == {"floor": pytest.approx(12.5**0.5), "sensors": None, "ratio": None}
    assert compare_where_effort_is_noisy(None, MODEL) is None
