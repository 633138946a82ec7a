"""Rows of the regression by hand: columns of all directions, weights, and what noise adds."""

from dataclasses import replace

import numpy as np
import pytest

from adhesion_can.estimation.doubt import slip_basis
from adhesion_can.estimation.doubt.directions import WORK_S
from adhesion_can.estimation.doubt.rows import RowBuilder
from tests.estimation.doubt.doubt_helpers import (
    AXLES,
    DIRECTIONS,
    NAMES,
    THETA,
    curve,
    make_samples,
)

NOISE = 0.012
C1, C2, C3 = THETA


def samples(seconds=4.0, *, begin_s=10.0, **variances):
    """Sweeps exactly on the curve, in traction and then in braking, with errors as given."""
    found = make_samples(np.random.default_rng(1), seconds, begin_s=begin_s)
    found = replace(found, adhesion=curve(found.slip))
    full = {name: np.broadcast_to(value, len(found)) for name, value in variances.items()}
    return replace(found, **full)


def built(given, builder=None):
    return (builder or RowBuilder(DIRECTIONS, AXLES)).build(given, THETA, NOISE)


def column(rows, name):
    place = slip_basis.SIZE + NAMES.index(name)
    return rows.columns[:, place], rows.slopes[:, place]


def slope_of(slip):
    return C1 * C2 * np.exp(-C2 * np.abs(slip)) - C3


def bend_of(slip, h=1e-4):
    """Second derivative of the signed curve."""
    return (curve(slip + h) - 2.0 * curve(slip) + curve(slip - h)) / h**2


# ------------------------------------------------------------------- basis, response, weights


def test_the_first_columns_are_the_basis_with_the_sign_of_the_slip():
    given = samples()
    rows = built(given)
    values, slopes = slip_basis.evaluate(np.abs(given.slip))
    assert rows.columns[:, : slip_basis.SIZE] == pytest.approx(
        np.sign(given.slip)[:, None] * values
    )
    assert rows.slopes[:, : slip_basis.SIZE].tolist() == slopes.tolist()
    assert rows.columns.shape == (len(given), slip_basis.SIZE + len(DIRECTIONS))
    assert {-1.0, 1.0} <= set(np.sign(given.slip).tolist())


def test_the_response_is_free_of_the_bend_within_the_error_of_the_slip():
    """The mean of the curve over slips with an error is half its second derivative higher."""
    given = samples(slip_var=1e-5, slip_common_var=3e-5)
    away = np.abs(given.slip) > 1e-3
    wanted = given.adhesion + 0.5 * bend_of(given.slip) * 4e-5
    assert built(given).response[away] == pytest.approx(wanted[away], abs=1e-6)
    assert built(given).slip_var.tolist() == [4e-5] * len(given)


def test_weights_are_inverse_variances_at_the_slope_that_the_adhesion_shows():
    rng = np.random.default_rng(2)
    transient = rng.uniform(0.0, 1e-4, 800)
    given = samples(slip_var=1e-5, slip_common_var=3e-5, transient_var=transient)
    own = NOISE**2 + transient
    wanted = 1.0 / (own + slope_of(given.slip) ** 2 * 4e-5)
    rows = built(given)
    assert rows.weight == pytest.approx(wanted)
    assert rows.curve_square == pytest.approx(np.sum(wanted * curve(given.slip) ** 2))
    # An adhesion beyond the curve's level has the slope far beyond its peak.
    high = built(replace(given, adhesion=np.full(len(given), 0.9)))
    assert high.weight == pytest.approx(1.0 / (own + C3**2 * 4e-5))


def test_noise_along_the_level_has_the_errors_of_a_speed_reading_in_common():
    """Σ along · error by hand, the error of a vehicle speed once for all samples beside it."""
    rng = np.random.default_rng(3)
    n = 800
    given = samples(
        slip_var=rng.uniform(0, 1e-5, n),
        slip_common_var=rng.uniform(0, 1e-5, n),
        transient_var=rng.uniform(0, 1e-5, n),
        speed_us=np.arange(n) // 8 * 20_000,
    )
    rows = built(given)
    slope = slope_of(given.slip)
    along = (1.0 - np.exp(-C2 * np.abs(given.slip))) * rows.weight
    private = NOISE**2 + given.transient_var + slope**2 * given.slip_var
    groups = np.zeros(100)
    for k in range(n):
        groups[k // 8] += (
            np.sign(given.slip[k]) * along[k] * slope[k] * np.sqrt(given.slip_common_var[k])
        )
    assert rows.level_noise == pytest.approx(np.sum(along**2 * private) + np.sum(groups**2))


# ------------------------------------------------------------- directions that move the slip


def test_a_scale_of_the_speed_moves_the_slip_by_one_plus_slip():
    """v (1 − s) lets λ = ω r / v − 1 read higher by (1 + λ) s: by differences of the curve."""
    given, s = samples(), 1e-6
    value, slope = column(built(given), "speed_scale")
    moved = (1.0 + given.slip) / (1.0 - s) - 1.0
    away = np.abs(given.slip) > 1e-3
    assert value[away] == pytest.approx(
        ((curve(moved) - curve(given.slip)) / s)[away], rel=1e-3, abs=1e-4
    )
    assert slope[away] == pytest.approx(bend_of(given.slip)[away], rel=1e-3, abs=1e-3)


def test_radii_and_levels_of_axles_count_against_the_mean_of_all():
    given = samples()
    rows = built(given)
    scale, bend = column(rows, "speed_scale")
    for axle in range(1, AXLES + 1):
        own = np.where(given.axle == axle, 1.0, 0.0) - 1.0 / AXLES
        value, slope = column(rows, f"wheel_radius {axle}")
        assert value == pytest.approx(own * scale)
        assert slope == pytest.approx(own * bend)
        value, slope = column(rows, f"axle_level {axle}")
        assert value == pytest.approx(own * curve(given.slip))
        assert slope == pytest.approx(own * slope_of(given.slip))


def steady(rate_slip, rate_speed):
    """One axle's samples every 20 ms, whose slip and speed change evenly."""
    given = samples(1.0)
    t = np.arange(len(given)) * 0.02
    slip, speed = 0.02 + rate_slip * t, 8.0 + rate_speed * t
    stamps = np.round(t * 1e6).astype(np.int64)
    return replace(
        given, t_us=stamps, axle=np.full(len(t), 2), slip=slip, speed=speed, speed_us=stamps
    )


def test_delays_inertia_and_relaxation_go_by_the_rates_of_the_signals():
    given = steady(0.004, 0.6)
    inner = slice(4, -4)
    rows, slope, bend = built(given), slope_of(given.slip), bend_of(given.slip)
    rates = {
        "effort_delay": (-0.004 * slope, -0.004 * bend),
        "creep_relaxation": (-0.004 / given.speed * slope, -0.004 / given.speed * bend),
        "speed_delay": (
            -0.6 / given.speed * slope * (1.0 + given.slip), -0.6 / given.speed * bend
        ),
        # Rim speed (1 + λ) v: λ' v + (1 + λ) v', 1e4 kg m over the load.
        "wheelset_inertia": (
            1e4 * (0.004 * given.speed + (1.0 + given.slip) * 0.6) / given.load, 0.0 * slope
        ),
    }  # fmt: skip
    for name, (value, by_slip) in rates.items():
        found = column(rows, name)
        assert found[0][inner] == pytest.approx(value[inner], rel=1e-4), name
        assert found[1][inner] == pytest.approx(by_slip[inner], rel=1e-3, abs=1e-9), name


def test_rates_are_averaged_over_five_samples_of_an_axle_and_are_0_of_few():
    """A jump of the slip shows as a fifth of it in each of five steps, two samples long each."""
    given = steady(0.0, 0.0)
    jump = np.where(np.arange(len(given)) < 100, 0.02, 0.07)
    value, _ = column(built(replace(given, slip=jump)), "effort_delay")
    rate = -value / slope_of(jump)
    # The mean of five rises by 0.01 a sample from 98 to 102.
    mean = np.convolve(np.pad(jump, 2, mode="edge"), np.full(5, 0.2), mode="valid")
    wanted = np.gradient(mean) / 0.02
    assert rate[1:-1] == pytest.approx(wanted[1:-1], abs=1e-9)
    few = built(replace(given, slip=jump, axle=np.arange(len(given)) // 5))
    assert not column(few, "effort_delay")[0].any()
    still = built(replace(given, slip=jump, t_us=np.zeros(len(given), dtype=np.int64)))
    assert not column(still, "effort_delay")[0].any()


def test_a_bias_of_the_effort_is_a_force_over_the_load():
    given = samples()
    value, slope = column(built(given), "effort_bias")
    assert value == pytest.approx(1e3 / given.load)
    assert not slope.any()


# ------------------------------------------------------------- directions that multiply the curve


def test_what_the_adhesion_depends_on_multiplies_the_curve():
    given = samples(begin_s=3.0)
    sanding = (np.arange(len(given)) % 2).astype(float)
    humidity = np.where(np.arange(len(given)) < 5, np.nan, 75.0)
    given = replace(given, covariates={
        "sanding_active": sanding, "relative_humidity_percent": humidity,
        "rail_temperature_degC": np.full(len(given), -5.0),
        "curvature_per_m": np.full(len(given), -2e-3),
    })  # fmt: skip
    rows = built(given)
    factors = {
        "load_dependence": np.log(given.load / 2e5),
        "speed_dependence": given.speed / 10.0 - 1.0,
        "falling_friction": np.abs(given.slip) * given.speed,
        "traction_braking_asymmetry": np.sign(given.slip),
        "slow_drift": (given.t_us * 1e-6 - 3.0) / 100.0,
        "sanding_active": sanding,
        "relative_humidity_percent": np.where(np.arange(len(given)) < 5, 0.0, 0.5),
        "rail_temperature_degC": np.full(len(given), -2.5),
        "curvature_per_m": np.full(len(given), 2.0),
    }
    for name, factor in factors.items():
        value, slope = column(rows, name)
        assert value == pytest.approx(factor * curve(given.slip)), name
        assert slope == pytest.approx(factor * slope_of(given.slip)), name
        if name not in {"falling_friction", "traction_braking_asymmetry"}:
            assert rows.present[name] == pytest.approx(np.mean(factor[-30:])), name
    assert rows.present["falling_friction"] == pytest.approx(np.mean(given.speed[-30:]))
    assert rows.present["traction_braking_asymmetry"] == np.sign(np.mean(given.adhesion[-30:]))
    plain = built(samples())
    assert not column(plain, "sanding_active")[0].any()
    assert "sanding_active" not in plain.present


def test_slip_work_of_an_axle_is_forgotten_by_its_time_and_goes_on_from_block_to_block():
    """Explicit steps from sample to sample: work of each step, then what is left of it."""
    given = samples(3.0, begin_s=0.0)
    parts = [given.select(given.t_us < 1_200_000), given.select(given.t_us >= 1_200_000)]
    builder = RowBuilder(DIRECTIONS, AXLES)
    found = [built(part, builder) for part in parts]
    for name, constant_s in WORK_S.items():
        factor = np.concatenate([column(rows, name)[0] for rows in found]) / curve(given.slip)
        for axle in range(1, AXLES + 1):
            rows = np.flatnonzero(given.axle == axle)
            work, last_s = 0.0, given.t_us[rows[0]] * 1e-6
            for row in rows:
                step = given.t_us[row] * 1e-6 - last_s
                power = abs(curve(given.slip)[row] * given.slip[row]) * given.speed[row]
                work = work * np.exp(-step / constant_s) + power * step
                last_s += step
                if abs(given.slip[row]) > 1e-3:
                    assert factor[row] == pytest.approx(work, rel=1e-9), (name, axle, row)
        # In present conditions it is that of the latest samples of all axles.
        assert found[-1].present[name] == pytest.approx(np.mean(factor[-30:]))


def test_time_begins_with_each_surface():
    builder = RowBuilder(DIRECTIONS, AXLES)
    first, second = samples(1.0, begin_s=0.0), samples(1.0, begin_s=50.0)
    built(first, builder)
    assert built(second, builder).present["slow_drift"] == pytest.approx(0.5, abs=0.01)
    builder.begin_surface()
    assert built(second, builder).present["slow_drift"] == pytest.approx(0.01, abs=0.002)
