"""Units as databases and tables spell them."""

from math import pi

import pytest

from adhesion_can.bus.role_specs import ROLE_SPECS, to_si
from adhesion_can.bus.units import find_factor
from adhesion_can.physics.readings import Role
from adhesion_can.recordings.tables.choice import COLUMN_UNITS

ALL_UNITS = (*(spec.units for spec in ROLE_SPECS.values()), *COLUMN_UNITS.values())
ANGULAR = {
    pi / 30: ("rpm", "RPM", "1/min", "U/min", "u / min", "r/min", "rev/min", "min-1", "min⁻¹",
              "min^-1", "min−1", "/min"),
    pi / 180: ("deg/s", "°/s", "º/s", "degree/s", "deg/sec", "Deg/s"),
    1.0: ("rad/s", "Rad/s", "rad/sec", "rad s^-1"),
    2 * pi: ("1/s", "s-1", "rev/s"),
}  # fmt: skip
LINEAR = {
    1 / 3.6: ("km/h", "Km/h", "km / h", "KPH", "Kph", "kmh", "km/hr", "kmph"),
    0.44704: ("mph", "MPH", "mi/h"),
    1.0: ("m/s", "M/S", "m/sec", "mps"),
}


@pytest.mark.parametrize(
    ("role", "units"), [(Role.WHEEL_SPEED, ANGULAR), (Role.VEHICLE_SPEED, LINEAR)]
)
def test_spellings_of_strangers(role, units):
    for factor, spellings in units.items():
        for spelling in spellings:
            assert to_si(role, spelling, 0.5) == factor, spelling


@pytest.mark.parametrize("spelling", ["km/h", "KPH", "km / h"])
def test_a_speed_of_the_rim_in_any_spelling(spelling):
    assert to_si(Role.WHEEL_SPEED, spelling, 0.5) == pytest.approx(1 / 3.6 / 0.5)


@pytest.mark.parametrize(
    ("role", "unit", "factor"),
    [
        (Role.TRACTIVE_EFFORT, "daN", 10.0),
        (Role.TRACTIVE_EFFORT, "KN", 1000.0),
        (Role.AXLE_LOAD, "Tonnes", 9806.65),
        (Role.RAIL_TEMPERATURE, "℃", 1.0),
        (Role.HUMIDITY, "percent", 1.0),
        (Role.GRADIENT, "Promille", 1e-3),
        (Role.GNSS_SPEED, "Km/h", 1 / 3.6),
        (Role.ACCELERATION, "m/s^2", 1.0),
        (Role.ACCELERATION, "mg", 9.80665e-3),
    ],
)
def test_further_quantities(role, unit, factor):
    assert to_si(role, unit, None) == factor


@pytest.mark.parametrize(
    ("role", "unit"),
    [
        (Role.TRACTIVE_EFFORT, ""),
        (Role.TRACTIVE_EFFORT, "mN"),
        (Role.TRACTIVE_EFFORT, "%"),
        (Role.TRACTIVE_EFFORT, "Nm"),
        (Role.VEHICLE_SPEED, "min-1"),
        (Role.VEHICLE_SPEED, "kn"),
        (Role.VEHICLE_SPEED, "m/s²"),
        (Role.VEHICLE_SPEED, "m/s^2"),
        (Role.WHEEL_SPEED, "Hz"),
        (Role.WHEEL_SPEED, ""),
    ],
)
def test_what_is_another_quantity_or_may_be_is_not_taken(role, unit):
    assert to_si(role, unit, 0.5) is None


def test_every_unit_has_the_factor_that_its_table_states():
    for units in ALL_UNITS:
        for unit, factor in units.items():
            assert find_factor(units, unit) == factor


def test_what_nobody_knows_is_no_unit_of_anything():
    for units in ALL_UNITS:
        assert find_factor(units, "knots") is None
        assert find_factor(units, "bar") is None
