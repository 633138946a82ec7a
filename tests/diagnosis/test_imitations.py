"""What a named effect may stand for: a gain that follows the effort, a speed error that grows.

Rows and drives here have the mechanism written out, or are worlds of others.
"""

import numpy as np
import pytest

from adhesion_can.diagnosis.formatting import rival_title
from adhesion_can.diagnosis.inference.imitations import imitates_load
from adhesion_can.diagnosis.regression.candidate import Candidate
from adhesion_can.diagnosis.regression.model import Model, RegressionData
from adhesion_can.diagnosis.regression.segment_curves import SegmentCurves
from adhesion_can.diagnosis.regression.whitened_regression import WhitenedRegression, fit_model
from adhesion_can.diagnosis.regression.whitening import ContiguousRuns, Whitener
from adhesion_can.physics.effects import effect_by_id
from tests.diagnosis.diagnosis_helpers import (
    C1,
    C2,
    C3,
    build_table_drive,
    burckhardt,
    diagnosed,
)
from tests.seeds import first_quick
from tests.worlds.outside.world import make_outside

STD, STATIC_LOAD = 0.004, 220e3


def rows_of_axles_with_loads(seed, factor):
    """Regression on sweeps of axles with loads of their own; factor(adhesion, load over mean)."""
    rng = np.random.default_rng(seed)
    t = np.tile(np.arange(0.0, 120.0, 0.05), 4)
    axle = np.repeat(np.arange(1, 5), len(t) // 4)
    load = STATIC_LOAD * (1.0 + 0.06 * (axle - 2.5) + 0.05 * np.sin(t / 7.0))
    side = np.where(np.floor(t / 9.0) % 3 == 2, -1.0, 1.0)
    slip = side * 0.11 * (0.5 - 0.5 * np.cos(2 * np.pi * t / 9.0 + 0.4 * axle))
    true = burckhardt(slip)
    adhesion = true * factor(true, load / STATIC_LOAD) + STD * rng.standard_normal(len(t))
    speed = np.full(len(t), 12.0)
    drive = build_table_drive(slip, adhesion, t, axle=axle, speed=speed, load=load)
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


def test_a_rival_of_several_forms_has_a_title_of_all_of_them():
    assert "one axle" not in rival_title("effort_gain")


@pytest.mark.parametrize("seed", first_quick([23000, 24001, 26000]))
def test_wheels_that_grow_warm_are_no_error_of_the_speed(seed, tmp_path):
    path = tmp_path / "drive.log"
    make_outside("outside:tread_growth", seed, path)
    answer = diagnosed(tmp_path, path)
    assert answer.verdict == "unexplained", answer.out
    (error,) = (c for c in answer.document["closest"] if c["effect"] == "speed_error")
    assert "all wheel radii growing as the wheels warm up" in error["refuted_by"]


def test_what_chance_explains_once_in_twenty_drives_has_no_name(tmp_path):
    path = tmp_path / "drive.log"
    make_outside("outside:shower", 26001, path)
    answer = diagnosed(tmp_path, path)
    assert answer.document["causes"] == [], answer.out
    (closest,) = answer.document["closest"]
    assert closest["effect"] == "speed_dependence"
    assert "its p-value is 4" in closest["refuted_by"]


def test_a_motor_that_saturates_is_a_rival_of_the_load(tmp_path):
    path = tmp_path / "drive.log"
    make_outside("outside:motor_saturation", 25000, path)
    answer = diagnosed(tmp_path, path)
    (cause,) = answer.document["causes"]
    assert {cause["effect"], *cause["rivals"]} == {"load_dependence", "effort_gain"}
    assert "cannot distinguish it from effort_gain" in answer.out
