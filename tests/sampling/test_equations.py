"""Equations of the samples: variances against draws of the readings, gaps and delays by hand."""

from dataclasses import replace

import numpy as np
import pytest

from adhesion_can.physics.instruments import PERFECT
from adhesion_can.physics.readings import Direction, Role
from adhesion_can.physics.vehicle import Geometry, Locomotive
from adhesion_can.sampling.equations import (
    TRAVEL_BY_DIRECTION,
    Measured,
    SampleEquations,
    SamplingSettings,
    Sensors,
)

CYCLES = {Role.WHEEL_SPEED: 10_000, Role.VEHICLE_SPEED: 20_000, Role.TRACTIVE_EFFORT: 15_000,
          Role.AXLE_LOAD: 200_000}  # fmt: skip
NOISE = Sensors(wheel_speed_std=0.1, vehicle_speed_std=0.02, effort_std=3e3)
"""The noise of the wheel speed adds 3500 N to that of the effort, by the inertia."""
VEHICLE = Locomotive(
    wheel_radius=(0.6, 0.5), axle_load=(2e5, 1.5e5), wheelset_inertia=300.0, geometry=None
)
SPEED, WHEEL_SPEED, ACCELERATION, EFFORT, LOAD = 8.0, 15.0, 2.0, 4e4, 1.8e5
BEFORE_S, AFTER_S = 0.012, 0.008
"""Steps from the wheel speed before and to the one after."""


def equations(vehicle=VEHICLE, instruments=PERFECT, sensors=NOISE, **more):
    return SampleEquations(vehicle, CYCLES, SamplingSettings(), sensors, instruments, **more)


def measured(n, axle=1, **changes):
    """Rows of n equal readings without noise."""
    row = {
        "wheel_speed": WHEEL_SPEED, "wheel_accel": ACCELERATION, "span": BEFORE_S + AFTER_S,
        "speed": SPEED, "effort": EFFORT, "load": LOAD, "acceleration_change": 0.0,
        "effort_step_std": 0.0, "transfer_std": 0.0, **changes,
    }  # fmt: skip
    columns = {name: np.full(n, value) if np.ndim(value) == 0 else value
               for name, value in row.items()}  # fmt: skip
    return Measured(axle=np.full(n, axle), **columns)


@pytest.mark.parametrize("axle", [1, 2])
def test_slip_adhesion_and_creep_speed_are_those_of_the_papers_equations(axle):
    r = VEHICLE.wheel_radius[axle - 1]
    found = equations().derive(measured(1, axle))
    assert found.slip == pytest.approx([(r * WHEEL_SPEED - SPEED) / SPEED])
    assert found.creep_speed == pytest.approx([r * WHEEL_SPEED - SPEED])
    assert found.adhesion == pytest.approx([(EFFORT - 300.0 * ACCELERATION / r) / LOAD])


@pytest.mark.parametrize("axle", [1, 2])
def test_stated_variances_are_those_of_noise_on_the_readings(axle):
    """40 000 draws: the scatter of a variance is 0.7 %."""
    rng, n = np.random.default_rng(13), 40_000

    def wheel(then_s):
        return WHEEL_SPEED + ACCELERATION * then_s + NOISE.wheel_speed_std * rng.standard_normal(n)

    before, middle, after = wheel(-BEFORE_S), wheel(0.0), wheel(AFTER_S)
    drawn = measured(
        n,
        axle,
        wheel_speed=middle,
        wheel_accel=(after - before) / (BEFORE_S + AFTER_S),
        effort=EFFORT + NOISE.effort_std * rng.standard_normal(n),
    )
    found, stated = equations().derive(drawn), equations().derive(measured(1, axle))
    assert np.var(found.slip) == pytest.approx(stated.slip_var[0], rel=0.03)
    assert np.var(found.adhesion) == pytest.approx(stated.adhesion_var[0], rel=0.03)
    # What the vehicle speed adds is common to the axles, and stated by itself.
    speed = SPEED + NOISE.vehicle_speed_std * rng.standard_normal(n)
    common = equations().derive(measured(n, axle, speed=speed))
    assert np.var(common.slip) == pytest.approx(stated.slip_common_var[0], rel=0.03)
    assert stated.transient_var.tolist() == [0.0]


@pytest.mark.parametrize("share", [-1.01, -0.99, 0.99, 1.01])
def test_what_noise_explains_within_four_deviations_is_no_transient(share):
    """Of the change of dω/dt, (a − b)/h − (b − c)/h with three readings and half a span h each,
    and of an effort in the middle of its step."""
    half = (BEFORE_S + AFTER_S) / 2
    noise = 4.0 * np.sqrt(1.0 + 4.0 + 1.0) * NOISE.wheel_speed_std / half
    r = VEHICLE.wheel_radius[0]
    (changed,) = equations().derive(measured(1, acceleration_change=share * noise)).transient_var
    wanted = (300.0 * share * noise / 2.0 / r / LOAD) ** 2 if abs(share) > 1.0 else 0.0
    assert changed == pytest.approx(wanted)
    # The difference of two efforts has √2 their noise; in the middle of its step half of it shows.
    for std in (NOISE.effort_std, 1.0):
        noise = 4.0 * np.sqrt(2.0) * std / 2.0
        of_quiet = equations(sensors=replace(NOISE, effort_std=std))
        (stepped,) = of_quiet.derive(measured(1, effort_step_std=share * noise)).transient_var
        assert stepped == pytest.approx((noise * share / LOAD) ** 2 if share > 1.0 else 0.0)


def test_transients_of_all_kinds_add_up():
    r = VEHICLE.wheel_radius[0]
    rows = measured(1, acceleration_change=-120.0, effort_step_std=2e4, transfer_std=9e3)
    found = equations().derive(rows)
    parts = (300.0 * 60.0 / r, 2e4, found.adhesion[0] * 9e3)
    assert found.transient_var == pytest.approx([sum(part**2 for part in parts) / LOAD**2])


def test_gaps_are_multiples_of_the_cycles():
    found = equations()
    assert found.gap_us(Role.WHEEL_SPEED) == 30_000.0
    assert found.gap_us(Role.AXLE_LOAD) == 600_000.0
    assert found.gap_us(Role.RAIN) == 0.0
    assert found.longest_gap_us == 60_000.0
    assert found.give_up_us == 120_000.0
    wide = replace(found, settings=SamplingSettings(max_gap_cycles=5.0))
    assert wide.longest_gap_us == 100_000.0


@pytest.mark.parametrize(
    ("errors", "speed_us", "effort_us", "waits_us"),
    [
        ({}, 0, 0, 0),
        ({"speed_delay": 0.035, "effort_delay": 0.02}, 35_000, 20_000, 35_000),
        ({"speed_delay": 0.01, "effort_delay": 0.02}, 10_000, 20_000, 20_000),
        ({"speed_delay": -0.03, "effort_delay": -0.011}, -30_000, -11_000, 0),
        ({"wheel_speed_delay": 0.02, "speed_delay": 0.05}, 30_000, -20_000, 30_000),
        ({"wheel_speed_delay": 0.03}, -30_000, -30_000, 0),
    ],
)
def test_samples_wait_for_the_latest_of_late_readings(errors, speed_us, effort_us, waits_us):
    found = equations(instruments=replace(PERFECT, **errors))
    assert (found.speed_lag_us, found.effort_lag_us, found.lag_us) == (
        *(speed_us, effort_us, waits_us),
    )
    assert found.give_up_us == 120_000.0 + waits_us
    assert found.load_age_us == 600_000 + max(effort_us, 0)
    # A wheel speed that waits is given up after twice the gap; twice more is kept for the others.
    assert found.oldest_needed_us([5_000_000, 4_990_000], 5_010_000) == 4_990_000
    assert found.oldest_needed_us([0], 5_000_000) == 4_760_000 - waits_us
    assert found.oldest_needed_us([], 5_000_000) == 5_000_000


def test_readings_are_corrected_to_the_true_vehicle():
    found = equations(instruments=replace(PERFECT, radius_error={2: 0.02}, inertia_error=50.0))
    assert found.radius == pytest.approx([0.6, 0.51])
    assert found.vehicle.wheelset_inertia == 350.0
    assert found.configured is VEHICLE


def test_a_row_of_the_transfer_is_what_an_axle_gains_for_each_axles_effort():
    assert equations().transfer is None
    geometry = Geometry(axles_per_bogie=(2,), axle_spacing=2.0, coupler_height=1.0)
    # Effort times height over the distance, whichever axle pulls.
    moved = np.array(equations(replace(VEHICLE, geometry=geometry)).transfer)
    assert moved == pytest.approx(np.array([[-0.5, -0.5], [0.5, 0.5]]))
    six = equations(Locomotive())
    effort = np.array([1.0, -2.0, 3.0, 4.0, 5.0, -6.0]) * 1e4
    gained = Locomotive().geometry.load_transfer(effort)
    assert np.array(six.transfer) @ effort == pytest.approx(gained)


def test_channels_of_the_users_have_their_names_by_number_and_roles_those_of_the_catalogue():
    found = equations(channels=("dew", "brake pipe"))
    assert [found.covariate(Role.CHANNEL, number) for number in (1, 2)] == ["dew", "brake pipe"]
    assert found.covariate(Role.HUMIDITY, 0) == "relative_humidity_percent"
    assert found.covariate(Role.WHEEL_SPEED, 1) == ""


def test_only_forward_and_reverse_are_ways_to_go():
    assert TRAVEL_BY_DIRECTION == {Direction.FORWARD: 1.0, Direction.REVERSE: -1.0}


@pytest.mark.parametrize("name", ["wheel_speed_std", "vehicle_speed_std", "effort_std"])
def test_standard_deviations_may_be_0_and_not_below(name):
    assert getattr(Sensors(**{name: 0.0}), name) == 0.0
    for std in (-1e-9, float("nan")):
        with pytest.raises(ValueError, match="must not be negative"):
            Sensors(**{name: std})


def test_rows_are_selected_in_all_columns():
    rows = measured(4, wheel_speed=np.arange(4.0), load=np.arange(4.0) + 10.0)
    kept = rows.select(np.array([True, False, False, True]))
    assert kept.wheel_speed.tolist() == [0.0, 3.0]
    assert kept.load.tolist() == [10.0, 13.0]
    assert {len(column) for column in kept} == {2}
