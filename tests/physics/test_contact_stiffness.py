"""Hertz's ellipse and Kalker's coefficient against closed forms, SciPy and a rigorous solver."""

from math import inf, pi

import numpy as np
import pytest
from scipy.special import ellipe, ellipk

from adhesion_can.physics.contact_stiffness import (
    POISSON,
    SHEAR_MODULUS,
    axis_ratio,
    contact_ellipse,
    initial_stiffness,
    kalker_c11,
)

PLANE_MODULUS = SHEAR_MODULUS / (1 - POISSON)


def test_spheres_touch_in_the_circle_of_hertz():
    # A wheel and a rail of the same curvature act like a sphere on a plane: a³ = 3 Q R / (4 E*).
    assert axis_ratio(0.5, rail_radius=0.5) == pytest.approx(1.0, abs=1e-3)
    ellipse = contact_ellipse(1e5, 0.5, ratio=1.0)
    radius = (3 * 1e5 * 0.5 / (4 * PLANE_MODULUS)) ** (1 / 3)
    assert ellipse.a == pytest.approx(radius, rel=1e-9)
    assert ellipse.b == ellipse.a
    near = contact_ellipse(1e5, 0.5, ratio=0.9999)
    assert near.a == pytest.approx(radius, rel=1e-3)


def test_a_cone_on_an_unworn_rail_makes_an_ellipse_longer_than_wide():
    assert axis_ratio(0.625) == pytest.approx(1.6, abs=0.05)


@pytest.mark.parametrize(
    ("wheel_radius", "profile_radius"), [(0.2, inf), (0.46, inf), (0.625, inf), (0.625, -0.35)]
)
def test_the_ellipse_solves_the_equations_of_johnson(wheel_radius, profile_radius):
    load, rail_radius = 1.067e5, 0.3
    ratio = axis_ratio(wheel_radius, rail_radius, profile_radius)
    ellipse = contact_ellipse(load, wheel_radius, ratio)
    longer, shorter = max(ellipse.a, ellipse.b), min(ellipse.a, ellipse.b)
    m = 1 - (shorter / longer) ** 2
    pressure = 3 * load / (2 * pi * ellipse.a * ellipse.b)
    scale = pressure / PLANE_MODULUS * shorter / (m * longer**2)
    small = scale * (ellipk(m) - ellipe(m))
    large = scale * ((longer / shorter) ** 2 * ellipe(m) - ellipk(m))
    along, across = 0.5 / wheel_radius, 0.5 * (1 / rail_radius + 1 / profile_radius)
    np.testing.assert_allclose([small, large], sorted([along, across]), rtol=1e-9)
    assert (ratio > 1) == (along < across)


def test_c11_is_kalkers_at_the_points_of_his_table():
    assert kalker_c11(1.0, 0.25) == pytest.approx(4.12)
    assert kalker_c11(1.0, 0.5) == pytest.approx(5.20)
    assert kalker_c11(0.1, 0.0) == pytest.approx(2.51)
    assert kalker_c11(2.0, 0.25) == pytest.approx(5.10)  # b/a = 0.5
    assert kalker_c11(10.0, 0.5) == kalker_c11(20.0, 0.5) == pytest.approx(12.9)
    assert kalker_c11(0.1, 0.5) == kalker_c11(0.05, 0.5) == pytest.approx(4.85)
    assert 4.12 < kalker_c11(1.0, 0.28) < 4.36


def test_the_compliance_of_the_table_is_linear_in_poissons_ratio():
    # The displacements under a shear traction are linear in it, and 1/c11 is one at a unit force.
    ratios = np.array([*np.arange(1, 10) / 10, *(10 / np.arange(10, 0, -1))])
    table = [[kalker_c11(ratio, poisson) for ratio in ratios] for poisson in (0.0, 0.25, 0.5)]
    low, middle, high = 1 / np.array(table)
    np.testing.assert_allclose(middle, 0.5 * (low + high), rtol=0.004)


def test_stiffness_falls_with_the_cube_root_of_the_load():
    stiffness = initial_stiffness(np.array([1e5, 8e5, np.nan]), 0.625)
    assert stiffness[0] / stiffness[1] == pytest.approx(2.0)
    assert stiffness[2] == pytest.approx(float(initial_stiffness(2e5, 0.625)))


def test_stiffness_is_that_of_a_rigorous_solver():
    # Eurosprinter, 106.7 kN a wheel, a/b = 0.5: CONTACT's force at a slip of 1e-5 is 0.002315 of
    # the load, by elements of a finite size.
    assert float(initial_stiffness(213_400.0, 0.625, 0.5)) == pytest.approx(231.5, rel=0.015)
