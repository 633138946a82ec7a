"""The factor of a curve of another family over a Burckhardt curve, by hand."""

from math import exp

import numpy as np
import pytest

from adhesion_can.physics.curves import FAMILIES, Conditions
from adhesion_can.physics.effects import LagStates
from adhesion_can.physics.effects.base import Contact
from adhesion_can.physics.effects.shape_factor import CurveShape

BASE = (0.4, 60.0, 0.3)
MAGIC = (55.0, 1.4, 0.4, -0.7)


def factors(family, values, slip, load=2e5, base=BASE):
    size = len(slip)
    rows = {name: np.full(size, 1.0) for name in ("creep_speed", "time_s", "axle", "place")}
    contact = Contact(
        slip=np.array(slip), speed=np.full(size, 12.0), load=np.full(size, load),
        adhesion=np.zeros(size), **rows,
    )  # fmt: skip
    change = CurveShape(FAMILIES[family], base).change(contact, values, LagStates())
    assert change.slip is contact.slip
    return np.asarray(change.factor)


def burckhardt(slip):
    return BASE[0] * (1.0 - exp(-BASE[1] * slip)) - BASE[2] * slip


def test_the_factor_is_the_ratio_of_both_curves_on_either_side():
    slip = [0.002, 0.02, 0.1, -0.02, 0.3]
    curve = FAMILIES["magic_formula"].adhesion(np.abs(slip), MAGIC, Conditions(12.0))
    wanted = [mu / burckhardt(abs(s)) for mu, s in zip(curve, slip, strict=True)]
    assert factors("magic_formula", MAGIC, slip) == pytest.approx(np.array(wanted))


def test_at_small_slip_it_is_the_ratio_of_the_initial_slopes():
    """B C D of the magic formula, c1 c2 − c3 of Burckhardt's."""
    wanted = 55.0 * 1.4 * 0.4 / (0.4 * 60.0 - 0.3)
    assert factors("magic_formula", MAGIC, [0.0, 1e-7, -1e-6]) == pytest.approx(
        np.full(3, wanted), rel=1e-3
    )


def test_it_stays_between_a_fifth_and_five():
    tall, low = (55.0, 1.4, 4.0, -0.7), (55.0, 1.4, 0.004, -0.7)
    assert factors("magic_formula", tall, [0.02]).tolist() == [5.0]
    assert factors("magic_formula", low, [0.02]).tolist() == [0.2]
    # A Burckhardt curve that has fallen below 0 says nothing: the largest factor.
    assert factors("magic_formula", MAGIC, [0.5], base=(0.1, 60.0, 0.3)).tolist() == [5.0]


def test_the_load_counts_where_it_is_known():
    """Polach's stiffness falls with the load; 1 N stands for an unknown one."""
    polach = (0.6, 0.3, 0.4, 0.4, 0.3)
    unknown = FAMILIES["polach"].adhesion(0.002, polach, Conditions(12.0, np.nan))
    assert factors("polach", polach, [0.002], load=1.0) == pytest.approx(
        float(unknown) / burckhardt(0.002)
    )
    stiff, soft, light = (factors("polach", polach, [0.002], load=n)[0] for n in (1e5, 2e5, 1.5))
    assert stiff > soft
    assert light > stiff


def test_the_parameters_are_those_of_the_family():
    shape = CurveShape(FAMILIES["polach"], BASE)
    assert shape.parameters is FAMILIES["polach"].parameters
    assert (shape.form, shape.id) == ("polach", "curve_shape")
    assert shape.literature == FAMILIES["polach"].literature
