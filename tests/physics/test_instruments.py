"""Errors of the instruments: ages against each other, the true vehicle, and what laws need."""

from dataclasses import replace

import numpy as np
import pytest

from adhesion_can.physics.effects import effect_by_id
from adhesion_can.physics.instrument_laws import LoadShift, Need
from adhesion_can.physics.instruments import PERFECT, Instruments
from adhesion_can.physics.vehicle import Locomotive


def lawful(*names):
    found = PERFECT
    for name, form in names:
        effect = effect_by_id(name, form)
        found = effect.amend(found, tuple(p.typical for p in effect.parameters))
    return found


def test_ages_count_from_the_wheel_speeds():
    found = Instruments(speed_delay=0.3, effort_delay=0.05, wheel_speed_delay=0.1)
    assert (found.speed_lag, found.effort_lag) == (pytest.approx(0.2), pytest.approx(-0.05))
    assert (PERFECT.speed_lag, PERFECT.effort_lag) == (0.0, 0.0)


def test_the_true_vehicle_has_the_true_radii_and_an_inertia_of_at_least_0():
    found = Instruments(radius_error={2: 0.1, 6: -0.2}, inertia_error=-150.0)
    true = found.vehicle(Locomotive())
    assert true.wheel_radius == pytest.approx((0.625, 0.6875, 0.625, 0.625, 0.625, 0.5))
    assert true.wheelset_inertia == Locomotive().wheelset_inertia - 150.0
    assert replace(found, inertia_error=-1e4).vehicle(Locomotive()).wheelset_inertia == 0.0
    assert true.axle_load == Locomotive().axle_load
    assert found.radius_factor(6) == pytest.approx([1.0, 1.1, 1.0, 1.0, 1.0, 0.8])
    assert np.ones(3).tolist() == PERFECT.radius_factor(3).tolist()


def test_laws_say_what_they_need_together():
    found = lawful(("effort_gain", "axle"), ("speed_error", "offset"), ("curving_resistance", ""))
    assert [found.needs(need) for need in (Need.AXLE, Need.EFFORTS, Need.SEQUENCE)] == [
        *(True, False, False)
    ]
    assert found.law_covariates == ("curvature_per_m",)
    assert found.load_shifts == ()
    shifted = lawful(("load_transfer", "geometry"), ("effort_gain", "all"))
    assert shifted.load_shifts == (LoadShift(1.0),)
    assert shifted.law_covariates == ()
    assert shifted.needs(Need.EFFORTS)


def test_a_law_of_size_0_is_none():
    law = LoadShift(1.0)
    assert PERFECT.with_law(law, 0.5).with_law(law, -0.5).laws == (law, law)
    assert PERFECT.with_law(law, 0.0) is PERFECT


@pytest.mark.parametrize(
    ("instruments", "misread"),
    [
        (PERFECT, False),
        (Instruments(speed_error=-0.01), True),
        (Instruments(speed_delay=0.1), True),
        (Instruments(wheel_speed_delay=0.1, effort_bias=10.0), False),
        (lawful(("speed_error", "pitch")), True),
        (lawful(("effort_gain", "all")), False),
    ],
)
def test_whether_the_vehicle_speed_is_misread(instruments, misread):
    assert instruments.misread_speed is misread
