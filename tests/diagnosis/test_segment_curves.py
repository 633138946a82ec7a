"""Curves of other families in the regression: slopes against differences, bounds, coordinates."""

import numpy as np
import pytest

from adhesion_can.diagnosis.regression.model import (
    Model,
    RegressionData,
    compute_curve_jacobian,
    evaluate_model,
)
from adhesion_can.diagnosis.regression.segment_curves import SegmentCurves
from adhesion_can.physics.burckhardt import adhesion
from adhesion_can.physics.curves import FAMILIES, Conditions, bounds
from adhesion_can.physics.effects import Contact, LagStates
from adhesion_can.physics.effects.shape_factor import CurveShape
from tests.diagnosis.diagnosis_helpers import build_table_drive

N = 500
SLIP = np.random.default_rng(1).uniform(-0.15, 0.15, N)


def two_surfaces():
    rng = np.random.default_rng(2)
    drive = build_table_drive(
        SLIP,
        0.3 * np.sign(SLIP),
        np.arange(N) * 0.05,
        speed=rng.uniform(5, 20, N),
        load=rng.uniform(150e3, 220e3, N),
    )
    return RegressionData((drive,), (np.arange(N) >= N // 2).astype(np.int64), 2)


def typical(family, factor=1.0):
    return [min(factor * p.typical, p.upper) for p in family.parameters]


@pytest.mark.parametrize("name", FAMILIES)
def test_slopes_are_those_of_differences(name):
    family, data = FAMILIES[name], two_surfaces()
    given = np.array([typical(family), typical(family, 0.8)])
    curves = SegmentCurves.from_parameters(family, given)
    assert curves.parameters == pytest.approx(given, rel=1e-12)
    slopes = compute_curve_jacobian(data, curves, evaluate_model(data, curves))
    assert slopes.shape == (N, 2 * curves.size)
    for column in range(slopes.shape[1]):
        ends = []
        for side in (1.0, -1.0):
            values = curves.values.copy()
            values.flat[column] += side * 1e-6
            moved = SegmentCurves(values, family)
            ends.append(evaluate_model(data, moved).predicted)
        assert slopes[:, column] == pytest.approx((ends[0] - ends[1]) / 2e-6, abs=2e-7)


@pytest.mark.parametrize("name", FAMILIES)
def test_steps_stay_within_the_bounds(name):
    family = FAMILIES[name]
    model = Model(SegmentCurves.from_parameters(family, np.array([typical(family)])))
    lower, upper = bounds(family)
    for far in (-1e6, 1e6):
        wild = model.with_parameters(np.full(len(lower), far)).curves.parameters[0]
        end = lower if far < 0 else upper
        assert wild == pytest.approx(end, rel=1e-9, abs=1e-12)


@pytest.mark.parametrize("name", FAMILIES)
def test_the_factor_makes_the_curve_of_burckhardts(name):
    family, base = FAMILIES[name], (0.4, 60.0, 0.3)
    slip = np.array([-0.1, -0.01, 1e-9, 0.004, 0.03, 0.12])
    one = np.ones(len(slip))
    contact = Contact(
        slip=slip, creep_speed=12.0 * slip, speed=12.0 * one, load=2e5 * one, time_s=0 * one,
        axle=one, place=one, adhesion=0 * one,
    )  # fmt: skip
    values = tuple(typical(family))
    factor = CurveShape(family, base).change(contact, values, LagStates()).factor
    wanted = family.adhesion(slip, values, Conditions(12.0, 2e5))
    inside = (factor > 0.2) & (factor < 5.0)
    assert inside.sum() >= 4
    assert (factor * adhesion(slip, *base))[inside] == pytest.approx(wanted[inside], rel=1e-3)
