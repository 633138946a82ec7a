"""The curve, its peak and its inverse against SciPy, dense grids and hand-written formulas."""

import math

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from scipy.optimize import brentq, minimize_scalar

from adhesion_can.physics.burckhardt import (
    PUBLISHED,
    RAIL,
    SLIP_MAX,
    adhesion,
    adhesion_full,
    adhesion_slope,
    falling_factor,
    load_factor,
    peak,
    peak_gradient,
    peak_of_one,
    slip_at,
    slip_at_share,
)

FIXED = settings(derandomize=True, deadline=None, max_examples=80)

LEVEL = st.floats(0.02, 1.5)
STEEP = st.floats(2.0, 400.0)
FALL = st.floats(1e-4, 1.0)
SLIP = st.floats(-1.0, 1.0)
ALL_SURFACES = [*PUBLISHED, *RAIL]


def by_hand(lam: float, c1: float, c2: float, c3: float) -> float:
    """Eq. 5 for one number, with `math` alone."""
    size = abs(lam)
    value = c1 * (1.0 - math.exp(-c2 * size)) - c3 * size
    return value if lam >= 0 else -value


def highest(c1: float, c2: float, c3: float, end: float) -> tuple[float, float]:
    """(λ_m, μ_m) by a dense grid and a bounded search around its best point."""
    grid = np.concatenate([np.linspace(0.0, end, 4001), np.geomspace(1e-6, end, 2001)])
    grid = np.unique(np.minimum(grid, end))  # geomspace may end a rounding error beyond
    values = c1 * (1.0 - np.exp(-c2 * grid)) - c3 * grid
    k = int(values.argmax())
    low, high = grid[max(k - 1, 0)], grid[min(k + 1, len(grid) - 1)]
    found = minimize_scalar(
        lambda x: -by_hand(x, c1, c2, c3),
        bounds=(low, high),
        method="bounded",
        options={"xatol": 1e-12},
    )
    best = max((values[k], grid[k]), (-found.fun, found.x))
    return float(best[1]), float(best[0])


@FIXED
@given(SLIP, LEVEL, STEEP, FALL)
def test_curve_is_eq_5_and_odd_in_slip(lam, c1, c2, c3):
    mu = float(adhesion(lam, c1, c2, c3))
    assert mu == pytest.approx(by_hand(lam, c1, c2, c3), rel=1e-11, abs=1e-13)
    assert float(adhesion(-lam, c1, c2, c3)) == -mu


def test_curve_is_zero_at_zero_and_nan_stays_nan():
    assert float(adhesion(0.0, 0.4, 60.0, 0.3)) == 0.0
    assert np.isnan(adhesion(np.nan, 0.4, 60.0, 0.3))


@pytest.mark.parametrize("surface", ALL_SURFACES, ids=lambda s: s.name)
def test_curve_keeps_its_digits_at_tiny_slip(surface):
    # Series of eq. 5: (c1 c2 − c3) λ − c1 c2² λ²/2 + c1 c2³ λ³/6, exact to 1e-15 here.
    c1, c2, c3 = surface.theta
    for lam in (1e-9, 1e-8, 1e-7):
        x = c2 * lam
        series = c1 * (x - x * x / 2 + x**3 / 6 - x**4 / 24) - c3 * lam
        assert float(adhesion(lam, c1, c2, c3)) == pytest.approx(series, rel=1e-12)


def test_functions_broadcast_over_slips_and_surfaces():
    slips = np.linspace(-0.3, 0.3, 7)
    c1, c2, c3 = (np.array(column)[:, None] for column in zip(*(s.theta for s in RAIL)))  # noqa: B905
    table = adhesion(slips, c1, c2, c3)
    slopes = adhesion_slope(slips, c1, c2, c3)
    assert table.shape == slopes.shape == (len(RAIL), 7)
    for i, surface in enumerate(RAIL):
        for j, lam in enumerate(slips):
            assert table[i, j] == pytest.approx(by_hand(lam, *surface.theta), rel=1e-12)
    top = peak(c1, c2, c3)
    assert top.mu_max.shape == top.lambda_m.shape == top.interior.shape == (len(RAIL), 1)
    inverse = slip_at(np.array([0.01, 0.02, 5.0]), c1, c2, c3)
    assert inverse.shape == (len(RAIL), 3)
    assert np.isnan(inverse[:, 2]).all()
    assert np.isfinite(inverse[:, :2]).all()


def test_integer_and_list_arguments_are_taken():
    assert float(adhesion(1, 1, 2, 0)) == pytest.approx(1 - math.exp(-2))
    assert adhesion([0, 1], 1, 2, 0).shape == (2,)
    assert float(slip_at(0, 1, 2, 0)) == 0.0


@FIXED
@given(st.floats(1e-4, 0.9), LEVEL, STEEP, FALL)
def test_slope_is_the_curves_derivative_and_even(lam, c1, c2, c3):
    step = 1e-5 * lam
    numeric = (by_hand(lam + step, c1, c2, c3) - by_hand(lam - step, c1, c2, c3)) / (2 * step)
    slope = float(adhesion_slope(lam, c1, c2, c3))
    rounding = 4e-16 * (c1 + c3) / step
    truncation = c1 * c2**3 * step**2
    assert slope == pytest.approx(numeric, abs=rounding + truncation)
    assert float(adhesion_slope(-lam, c1, c2, c3)) == slope


def test_slope_at_zero_is_c1_c2_minus_c3():
    assert float(adhesion_slope(0.0, 0.4, 60.0, 0.3)) == pytest.approx(23.7)


@FIXED
@given(LEVEL, STEEP, FALL, st.sampled_from([0.1, 0.5, SLIP_MAX]))
def test_peak_is_the_highest_point_in_the_range(c1, c2, c3, end):
    top = peak(c1, c2, c3, end)
    lam, mu = highest(c1, c2, c3, end)
    assert float(top.mu_max) == pytest.approx(max(mu, 0.0), abs=1e-12)
    # The maximum is flat: its place is as sharp as the curvature allows.
    blur = 4 * math.sqrt(1e-15 * max(c1, c3) / (c1 * c2**2 * math.exp(-c2 * lam) + 1e-300))
    assert float(top.lambda_m) == pytest.approx(lam, abs=max(min(blur, 1.0), 1e-9))
    assert 0.0 <= float(top.lambda_m) <= end


@pytest.mark.parametrize("surface", ALL_SURFACES, ids=lambda s: s.name)
def test_named_surfaces_have_the_peak_that_a_search_finds(surface):
    lam, mu = highest(*surface.theta, SLIP_MAX)
    assert surface.mu_max == pytest.approx(mu, rel=1e-9)
    if surface.c3 > 0:  # else a plateau, of which the search finds any point
        assert surface.lambda_m == pytest.approx(lam, rel=1e-5)
    assert bool(peak(*surface.theta).interior) is (surface.c3 > 0)


@pytest.mark.parametrize("surface", [s for s in ALL_SURFACES if s.c3 > 0], ids=lambda s: s.name)
def test_peak_is_eq_6_as_printed(surface):
    c1, c2, c3 = surface.theta
    log = math.log(c1 * c2 / c3)
    assert surface.lambda_m == pytest.approx(log / c2, rel=1e-13)
    assert surface.mu_max == pytest.approx(c1 - c3 / c2 * (1 + log), rel=1e-13)


def test_published_peaks_span_what_the_literature_says():
    places = [s.lambda_m for s in PUBLISHED if s.c3 > 0]
    assert min(places) == pytest.approx(0.06, abs=0.01)  # snow
    assert max(places) == pytest.approx(0.40, abs=0.01)  # dry cobble
    assert [s.theta for s in PUBLISHED] == [
        (1.2801, 23.99, 0.52),
        (0.857, 33.822, 0.347),
        (1.3713, 6.4565, 0.6691),
        (0.1946, 94.129, 0.0646),
        (0.05, 306.39, 0.0),
    ]


def test_a_rail_surface_is_lower_than_that_of_a_tyre_and_peaks_at_less_slip():
    tyre = {surface.name: surface for surface in PUBLISHED}
    dry, wet, greasy = RAIL
    for rail, road in ((dry, tyre["dry asphalt"]), (wet, tyre["wet asphalt"])):
        assert rail.mu_max < 0.5 * road.mu_max
        assert 0.03 < rail.lambda_m < 0.8 * road.lambda_m
    assert greasy.mu_max < wet.mu_max < dry.mu_max
    assert dry.lambda_m < wet.lambda_m < greasy.lambda_m


def test_ice_without_fall_has_no_interior_peak():
    top = peak(0.05, 306.39, 0.0)
    assert not top.interior
    assert float(top.lambda_m) == SLIP_MAX
    assert float(top.mu_max) == pytest.approx(0.05, rel=1e-12)


@pytest.mark.parametrize("c3", [1e-3, 1e-6, 1e-12, 1e-30, 1e-43, 1e-200, 5e-324, 0.0])
def test_peak_is_continuous_as_c3_goes_to_zero(c3):
    # A fit at its bound hands over c3 of any size: no overflow, no jump, no NaN.
    top = peak(0.4, 60.0, c3)
    mu = 0.4 * -math.expm1(-60.0 * float(top.lambda_m)) - c3 * float(top.lambda_m)
    assert float(top.mu_max) == pytest.approx(mu, rel=1e-12)
    assert float(top.mu_max) == pytest.approx(0.4, abs=2 * c3 + 1e-12)
    assert bool(top.interior) is (c3 >= 1e-12)


def test_peak_beyond_the_range_gives_the_end_of_the_range():
    c1, c2, c3 = 0.3, 8.0, 0.01  # λ_m = 0.68
    top = peak(c1, c2, c3, slip_max=0.5)
    assert not top.interior
    assert float(top.lambda_m) == 0.5
    assert float(top.mu_max) == pytest.approx(by_hand(0.5, c1, c2, c3), rel=1e-12)
    assert peak(c1, c2, c3, slip_max=1.0).interior


@FIXED
@given(LEVEL, STEEP, st.floats(1.0, 50.0))
def test_curve_that_falls_from_the_start_has_peak_zero(c1, c2, factor):
    top = peak(c1, c2, c1 * c2 * factor)
    assert (float(top.mu_max), float(top.lambda_m), bool(top.interior)) == (0.0, 0.0, False)


@FIXED
@given(LEVEL, STEEP, FALL)
def test_peak_gradient_is_the_finite_difference_of_the_peak(c1, c2, c3):
    assume(c1 * c2 > 1.05 * c3)
    assume(math.log(c1 * c2 / c3) / c2 < 0.95)
    gradient = peak_gradient(c1, c2, c3)
    assert gradient.shape == (2, 3)
    for j in range(3):
        theta = np.array([c1, c2, c3])
        step = 1e-5 * theta[j]
        up, down = theta.copy(), theta.copy()
        up[j] += step
        down[j] -= step
        above, below = peak(*up), peak(*down)
        for i, name in enumerate(("mu_max", "lambda_m")):
            numeric = float(getattr(above, name) - getattr(below, name)) / (2 * step)
            assert gradient[i, j] == pytest.approx(numeric, rel=2e-4, abs=1e-9 / step * 1e-5)


def test_peak_gradient_beyond_the_range_moves_the_height_only():
    c1, c2, c3, end = 0.3, 8.0, 0.01, 0.5
    gradient = peak_gradient(c1, c2, c3, end)
    assert np.isnan(gradient[1]).all()
    for j, step in enumerate((1e-6, 1e-4, 1e-7)):
        up, down = [c1, c2, c3], [c1, c2, c3]
        up[j] += step
        down[j] -= step
        numeric = (by_hand(end, *up) - by_hand(end, *down)) / (2 * step)
        assert gradient[0, j] == pytest.approx(numeric, rel=1e-6)


@FIXED
@given(st.floats(1e-6, 1.0), LEVEL, STEEP, FALL, st.sampled_from([0.2, SLIP_MAX]))
def test_slip_at_is_the_smallest_slip_that_gives_the_adhesion(share, c1, c2, c3, end):
    assume(c1 * c2 > c3)
    top = peak(c1, c2, c3, end)
    wanted = share * float(top.mu_max)
    lam = float(slip_at(wanted, c1, c2, c3, end))
    assert 0.0 <= lam <= float(top.lambda_m)
    assert by_hand(lam, c1, c2, c3) == pytest.approx(wanted, rel=1e-9, abs=1e-15)
    if share < 0.999:
        # On the rising side there is one root only, so it is the smallest.
        root = brentq(
            lambda x: by_hand(x, c1, c2, c3) - wanted, 0.0, float(top.lambda_m), xtol=1e-15
        )
        assert lam == pytest.approx(root, rel=1e-6, abs=1e-12)


@FIXED
@given(st.floats(0.01, 0.999), LEVEL, STEEP, FALL | st.just(0.0), st.sampled_from([0.1, SLIP_MAX]))
def test_for_numbers_peak_and_slip_are_those_for_arrays(share, c1, c2, c3, end):
    top = peak(c1, c2, c3, end)
    mu_max, lambda_m = float(top.mu_max), float(top.lambda_m)
    assert peak_of_one(c1, c2, c3, end) == pytest.approx((mu_max, lambda_m), rel=1e-12)
    slip = float(slip_at(share * mu_max, c1, c2, c3, end))
    assert slip_at_share(share, c1, c2, c3, slip_max=end) == pytest.approx(slip, rel=1e-9)


@FIXED
@given(st.floats(0.0, 0.995), LEVEL, STEEP, FALL)
def test_slip_at_undoes_the_curve_below_the_peak(share, c1, c2, c3):
    assume(c1 * c2 > 1.2 * c3)
    lam = share * float(peak(c1, c2, c3).lambda_m)
    back = slip_at(adhesion(lam, c1, c2, c3), c1, c2, c3)
    assert float(back) == pytest.approx(lam, rel=1e-5, abs=1e-12)
    assert float(slip_at(adhesion(-lam, c1, c2, c3), c1, c2, c3)) == -float(back)


@pytest.mark.parametrize("surface", ALL_SURFACES, ids=lambda s: s.name)
def test_slip_at_reaches_the_peak_and_nothing_above(surface):
    at_top = float(slip_at(surface.mu_max, *surface.theta))
    if surface.c3 > 0:
        assert at_top == pytest.approx(surface.lambda_m, rel=1e-5)
    assert by_hand(at_top, *surface.theta) == pytest.approx(surface.mu_max, rel=1e-12)
    above = slip_at(np.array([1.001, -1.001]) * surface.mu_max, *surface.theta)
    assert np.isnan(above).all()


def test_slip_at_of_a_falling_curve_is_zero_for_nothing_and_nan_else():
    assert float(slip_at(0.0, 0.1, 2.0, 5.0)) == 0.0
    assert np.isnan(slip_at(0.01, 0.1, 2.0, 5.0))
    assert np.isnan(slip_at(np.nan, 0.4, 60.0, 0.3))


@FIXED
@given(SLIP, st.floats(0.0, 60.0), st.floats(1e3, 4e5), st.floats(0.0, 1.0), st.floats(0.0, 5e-12))
def test_full_curve_is_eq_4(lam, speed, load, c4, c5):
    c1, c2, c3 = 0.4, 60.0, 0.3
    wanted = by_hand(lam, c1, c2, c3) * math.exp(-c4 * abs(lam) * speed) * (1 - c5 * load**2)
    got = float(adhesion_full(lam, speed, load, c1, c2, c3, c4, c5))
    assert got == pytest.approx(wanted, rel=1e-11, abs=1e-15)
    # Odd in slip as eq. 5: in braking the factor must not grow beyond 1.
    assert float(adhesion_full(-lam, speed, load, c1, c2, c3, c4, c5)) == -got
    assert abs(got) <= abs(by_hand(lam, c1, c2, c3)) + 1e-15


def test_full_curve_without_c4_and_c5_is_eq_5():
    slips = np.linspace(-0.5, 0.5, 11)
    plain = adhesion(slips, 0.4, 60.0, 0.3)
    assert np.array_equal(adhesion_full(slips, 20.0, 245e3, 0.4, 60.0, 0.3), plain)


def test_factors_are_one_at_zero():
    assert float(falling_factor(3.0, 0.0)) == float(falling_factor(0.0, 0.4)) == 1.0
    assert float(load_factor(245e3, 0.0)) == float(load_factor(0.0, 1e-12)) == 1.0
