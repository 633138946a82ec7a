"""Curves of a family to start with, of surfaces that were made with known ones."""

import numpy as np
import pytest

from adhesion_can.diagnosis.regression.fit_families import LEAST_ROWS, fit_family_curves
from adhesion_can.diagnosis.regression.model import RegressionData
from adhesion_can.physics.curves import FAMILIES, Conditions
from tests.diagnosis.diagnosis_helpers import build_table_drive

N = 900
VALUES = {
    "burckhardt": (0.35, 60.0, 0.4),
    "magic_formula": (55.0, 1.4, 0.4, -0.7),
    "polach": (0.6, 0.3, 0.4, 0.4, 0.3),
}


def table(family, factor, rows=N, load=2e5):
    """Sweeps at several speeds on a curve and on a factor of it, in turn."""
    rng = np.random.default_rng(1)
    slip, speed = rng.uniform(-0.15, 0.15, rows), rng.uniform(5.0, 20.0, rows)
    conditions = Conditions(speed, np.nan if load is None else load)
    curve = family.adhesion(slip, VALUES[family.name], conditions)
    adhesion = np.where(np.arange(rows) < rows // 2, 1.0, factor) * curve
    drive = build_table_drive(
        slip,
        adhesion + 0.001 * rng.standard_normal(rows),
        np.arange(rows) * 0.05,
        speed=speed,
        load=None if load is None else np.full(rows, load),
    )
    surface = (np.arange(rows) >= rows // 2).astype(np.int64)
    return RegressionData((drive,), surface, 2)


@pytest.mark.parametrize("name", VALUES)
@pytest.mark.parametrize("load", [2e5, None])
def test_each_surface_has_its_own_curve(name, load):
    """Whether the load is known or not: then the curve is that at the reference load."""
    family = FAMILIES[name]
    found = fit_family_curves(table(family, 0.5, load=load), family).parameters
    slip = np.linspace(0.002, 0.15, 40)
    conditions = Conditions(12.0, np.nan if load is None else load)
    wanted = family.adhesion(slip, VALUES[name], conditions)
    assert family.adhesion(slip, found[0], conditions) == pytest.approx(wanted, rel=0.03)
    assert family.adhesion(slip, found[1], conditions) == pytest.approx(0.5 * wanted, rel=0.06)


@pytest.mark.parametrize(("rows", "fitted"), [(2 * LEAST_ROWS - 2, False), (2 * LEAST_ROWS, True)])
def test_a_surface_of_few_rows_has_the_typical_curve(rows, fitted):
    family = FAMILIES["burckhardt"]
    found = fit_family_curves(table(family, 0.5, rows), family).parameters
    typical = [p.typical for p in family.parameters]
    for theta in found:
        assert (theta == pytest.approx(typical)) is not fitted


def test_many_rows_are_thinned_and_give_the_same_curve():
    family = FAMILIES["burckhardt"]
    many = fit_family_curves(table(family, 1.0, 8000), family).parameters
    assert many == pytest.approx(np.tile(VALUES["burckhardt"], (2, 1)), rel=0.05)
