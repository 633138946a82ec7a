"""Laws that a named effect may stand for: a gain that follows the effort, a speed error that grows.

Rows here have the mechanism written out.
"""

from dataclasses import replace

import numpy as np
import pytest

from adhesion_can.diagnosis.inference.imitations import find_growth, imitates_load
from adhesion_can.diagnosis.regression.candidate import Candidate
from adhesion_can.diagnosis.regression.model import Model, RegressionData
from adhesion_can.diagnosis.regression.segment_curves import SegmentCurves
from adhesion_can.diagnosis.regression.whitened_regression import WhitenedRegression, fit_model
from adhesion_can.diagnosis.regression.whitening import ContiguousRuns, Whitener
from adhesion_can.physics.effects import effect_by_id
from tests.diagnosis.diagnosis_helpers import C1, C2, C3, build_table_drive, burckhardt

STD, STATIC_LOAD = 0.004, 220e3


def rows_of_axles_with_loads(seed, factor, speed_error=None):
    """Regression on sweeps of axles with loads of their own.

    Args:
        seed: Seed of the noise.
        factor: Factor of the adhesion by the adhesion and the load over its mean.
        speed_error: Relative error of the vehicle speed by the time, s; None: none.

    """
    rng = np.random.default_rng(seed)
    t = np.tile(np.arange(0.0, 120.0, 0.05), 4)
    axle = np.repeat(np.arange(1, 5), len(t) // 4)
    load = STATIC_LOAD * (1.0 + 0.06 * (axle - 2.5) + 0.05 * np.sin(t / 7.0))
    side = np.where(np.floor(t / 9.0) % 3 == 2, -1.0, 1.0)
    slip = side * 0.11 * (0.5 - 0.5 * np.cos(2 * np.pi * t / 9.0 + 0.4 * axle))
    true = burckhardt(slip)
    adhesion = true * factor(true, load / STATIC_LOAD) + STD * rng.standard_normal(len(t))
    error = np.zeros(len(t)) if speed_error is None else speed_error(t)
    read, speed = (1.0 + slip) / (1.0 + error) - 1.0, 12.0 * (1.0 + error)
    drive = build_table_drive(read, adhesion, t, axle=axle, speed=speed, load=load)
    n = len(drive)
    breaks = np.zeros(n, dtype=bool)
    breaks[0] = True
    return WhitenedRegression(
        RegressionData((drive,), np.zeros(n, dtype=np.int64), 1),
        np.full(n, 1.0 / STD),
        np.zeros(n),
        np.zeros((n, 0)),
        np.zeros(1),
        np.zeros(n),
        Whitener(np.array([1.0]), ContiguousRuns.find(drive.t_s, drive.axle, breaks)),
        np.ones(n),
        np.floor(drive.time_s / 4.0).astype(np.int64),
    )


def imitates(seed, factor):
    regression = rows_of_axles_with_loads(seed, factor)
    plain = fit_model(regression, Model(SegmentCurves(np.array([[C1, np.log(C2), C3]])))).model
    load = Candidate(effect_by_id("load_dependence", "power"))
    return imitates_load(regression, plain, load)


@pytest.mark.parametrize("size", [0.08, 0.2, -0.1])
def test_a_gain_that_follows_the_effort_looks_like_a_load(size):
    """Shown force F (1 + s (F / 0.3 N)²): it explains more than any power of the load."""
    found = [
        imitates(seed, lambda mu, load: 1.0 + size * (mu * load / 0.3) ** 2) for seed in range(5)
    ]
    assert all(found)


@pytest.mark.parametrize("exponent", [-1.0, -0.3, 0.3, 1.0])
def test_a_load_that_acts_at_every_adhesion_is_no_gain(exponent):
    found = [imitates(seed, lambda _, load: load**-exponent) for seed in range(5)]
    assert not any(found)


def test_another_effect_is_not_asked():
    regression = rows_of_axles_with_loads(1, lambda mu, load: 1.0 + 0 * mu * load)
    model = Model(SegmentCurves(np.array([[C1, np.log(C2), C3]])))
    assert not imitates_load(regression, model, Candidate(effect_by_id("speed_dependence")))


# ------------------------------------------------------------- errors of the speed that grow


PLAIN = Model(SegmentCurves(np.array([[C1, np.log(C2), C3]])))


def growth(seed, speed_error, name="speed_scale", form="", values=None):
    """Time constant of the growth that explains more than a named effect; None: none does."""
    regression = rows_of_axles_with_loads(seed, lambda mu, _: 1.0 + 0 * mu, speed_error)
    without = fit_model(regression, PLAIN).model
    named = without.with_effect(Candidate(effect_by_id(name, form)), values)
    return find_growth(regression, fit_model(regression, named).model, 0, without)


@pytest.mark.parametrize("time_s", [25.0, 80.0])
def test_an_error_that_grows_explains_more_than_a_constant_one(time_s):
    found = [growth(seed, lambda t: -0.006 * np.expm1(-t / time_s)) for seed in range(2)]
    assert found == pytest.approx([time_s] * 2, rel=0.5)


def test_a_constant_error_is_no_growth():
    assert [growth(seed, lambda t: 0.006 + 0 * t) for seed in range(2)] == [None] * 2


def test_of_a_step_a_growth_that_is_nearly_as_good_is_enough():
    """It cannot stand for a late step."""
    for seed in range(2):
        step = growth(seed, lambda t: 0.006 * (t > 60.0), "speed_error", "step", (0.005, 60.0))
        assert step is None
        grown = growth(
            seed, lambda t: -0.006 * np.expm1(-t / 40.0), "speed_error", "step", (0.004, 40.0)
        )
        assert grown == pytest.approx(40.0, rel=0.5)


def test_only_errors_of_the_speed_in_one_recording_are_asked():
    def grows(t):
        return -0.006 * np.expm1(-t / 40.0)

    assert growth(1, grows, "falling_friction", "burckhardt") is None
    regression = rows_of_axles_with_loads(1, lambda mu, _: 1.0 + 0 * mu, grows)
    without = fit_model(regression, PLAIN).model
    named = without.with_effect(Candidate(effect_by_id("speed_scale")), (0.004,))
    data, (drive,) = regression.data, regression.data.drives
    twice = replace(data, drives=(drive, drive))
    assert find_growth(replace(regression, data=twice), named, 0, without) is None
    points = replace(data, drives=(replace(drive, independent=True),))
    assert find_growth(replace(regression, data=points), named, 0, without) is None
