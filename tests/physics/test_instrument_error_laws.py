"""Laws of instrument errors against formulas written out here, at situations made by hand."""

import math
from dataclasses import replace

import numpy as np
import pytest

from adhesion_can.physics.effects import EFFECTS, LagStates, effect_by_id
from adhesion_can.physics.effects.speed_error import GROWING_SPEED_ERROR
from adhesion_can.physics.instrument_laws import Need, Quantity, Situation
from adhesion_can.physics.instruments import PERFECT
from adhesion_can.physics.vehicle import Locomotive

N = 60
RNG = np.random.default_rng(11)
TIME_S = np.arange(N) * 2.0
DRIVE = Situation(
    time_s=TIME_S,
    axle=np.tile([1.0, 2.0, 3.0], N // 3),
    wheel_speed=RNG.uniform(5.0, 40.0, N),
    wheel_accel=RNG.uniform(-2.0, 2.0, N),
    speed=RNG.uniform(3.0, 30.0, N),
    effort=RNG.uniform(-4e4, 4e4, N),
    load=RNG.uniform(2e5, 2.6e5, N),
    vehicle=Locomotive(axle_load=(2e5,) * 6),
    travel=RNG.choice([-1.0, 1.0], N),
    efforts=RNG.uniform(-4e4, 4e4, (N, 6)),
    acceleration=RNG.uniform(-0.5, 0.5, N),
    wheel_angle=RNG.uniform(0.0, 200.0, N),
    covariates={"curvature_per_m": RNG.choice([-1 / 200, 0.0, 1 / 500, 1 / 50], N)},
)


def law_of(name, *values, form=""):
    (law,) = effect_by_id(name, form).amend(PERFECT, values).laws
    return law


def error(name, *values, form="", at=DRIVE):
    return law_of(name, *values, form=form).error(at, LagStates())


def relative(name, *values, form="", at=DRIVE):
    found = error(name, *values, form=form, at=at)
    assert not np.any(found.absolute)
    assert not np.any(found.relative_rate)
    return np.broadcast_to(found.relative, len(at.axle)).tolist()


def absolute(name, *values, form="", at=DRIVE):
    found = error(name, *values, form=form, at=at)
    assert not np.any(found.relative)
    return np.asarray(found.absolute).tolist()


def test_the_gain_of_an_axle_is_its_own_and_that_of_all_is_everyones():
    wanted = [0.07 if axle == 2 else 0.0 for axle in DRIVE.axle]
    assert relative("effort_gain", 0.07, 2.0, form="axle") == wanted
    assert relative("effort_gain", -0.04, form="all") == [-0.04] * N


def test_a_gain_that_drifts_is_in_proportion_to_time():
    wanted = [1e-3 * t for t in TIME_S]
    assert relative("effort_gain", 1e-3, form="time") == pytest.approx(wanted)


@pytest.mark.parametrize("is_true", [True, False])
def test_heat_approaches_the_square_of_the_effort_over_its_continuous_one(is_true):
    """At a constant effort, 0.3 of the load: 1 − e^(−t/T) of (0.3 / 0.2)², from a cold motor."""
    load, gain, time_s = 2e5, 0.08, 40.0
    t = np.arange(40) * 0.9
    heat = 2.25 * -np.expm1(-t / time_s)
    read = 0.3 * load * (1.0 if is_true else 1.0 + gain * heat)
    at = Situation(
        *(t, np.ones(40), t, t, t, np.broadcast_to(read, 40), np.full(40, load)), is_true=is_true
    )
    found = relative("effort_gain", gain, time_s, form="heat", at=at)
    assert found[0] == 0.0
    assert found[-1] > 0.09
    # Efforts as read count with a line between two readings, and after three rounds.
    assert found == pytest.approx(gain * heat, rel=1e-9 if is_true else 2e-2)


def test_an_error_of_the_speed_from_a_time_on_and_one_that_grows():
    wanted = [0.02 if t >= 50.0 else 0.0 for t in TIME_S]
    assert relative("speed_error", 0.02, 50.0, form="step") == wanted
    grown = [0.02 * (1.0 - math.exp(-t / 30.0)) for t in TIME_S]
    law = GROWING_SPEED_ERROR.law(0.02, 30.0)
    assert law.quantity is Quantity.SPEED
    assert law.error(DRIVE, LagStates()).relative == pytest.approx(grown)


def test_pitch_goes_by_the_effort_of_all_axles_over_their_weight_in_the_way_of_travel():
    wanted = [
        0.1 * sum(row) / 1.2e6 * way for row, way in zip(DRIVE.efforts, DRIVE.travel, strict=True)
    ]
    assert relative("speed_error", 0.1, form="pitch") == pytest.approx(wanted)
    for missing in ({"vehicle": None}, {"efforts": None}):
        found = relative("speed_error", 0.1, form="pitch", at=replace(DRIVE, **missing))
        assert np.isnan(found).all()


def test_errors_in_curves_have_the_sign_of_the_curve_or_none():
    bends = DRIVE.covariates["curvature_per_m"]
    offset = relative("speed_error", 1.5, form="offset")
    assert offset == pytest.approx([1.5 * k for k in bends])
    either = relative("speed_error", 1.5, form="curvature")
    assert either == pytest.approx([1.5 * abs(k) for k in bends])
    assert max(either) == 1.5 / 50


def test_a_smoothed_speed_lacks_its_time_constant_times_its_rate():
    """A steady acceleration: 0.4 m/s² for 0.6 s is 0.24 m/s, once the lag has settled."""
    t = np.arange(400) * 0.02
    at = Situation(*(t, np.ones(400), t, t, 5.0 + 0.4 * t, t, t))
    known = replace(at, acceleration=np.full(400, 0.4))
    assert absolute("speed_error", 0.6, form="low_pass", at=known) == pytest.approx([-0.24] * 400)
    true = replace(known, acceleration=np.where(t < 2.0, 0.0, 0.4), is_true=True)
    late = 0.24 * np.expm1(-np.maximum(t - 1.99, 0.0) / 0.6)
    found = absolute("speed_error", 0.6, form="low_pass", at=true)
    assert found == pytest.approx(late.tolist(), abs=3e-3)
    # Unknown, the acceleration is the rate of the speed itself, seconds later.
    unknown = absolute("speed_error", 0.6, form="low_pass", at=at)
    assert unknown[0] == 0.0
    assert unknown[-1] == pytest.approx(-0.24, rel=1e-3)
    steady = absolute("speed_error", 0.6, form="low_pass", at=replace(at, speed=np.full(400, 9.0)))
    assert steady == pytest.approx([0.0] * 400, abs=1e-9)


def test_curves_resist_by_roeckl_and_no_more_than_at_100_m():
    """650 / (R − 55) newton per kilonewton of load."""
    by_radius = {0.0: 0.0, 1 / 200: 0.65 / 145.0, 1 / 500: 0.65 / 445.0, 1 / 50: 0.65 / 45.0}
    wanted = [
        2.0 * by_radius[abs(k)] * load
        for k, load in zip(DRIVE.covariates["curvature_per_m"], DRIVE.load, strict=True)
    ]
    assert absolute("curving_resistance", 2.0) == pytest.approx(wanted)


def test_a_blended_brake_takes_its_share_where_the_vehicle_brakes():
    brakes = DRIVE.efforts.sum(axis=1) < 0.0
    assert 10 < brakes.sum() < 50
    wanted = np.where(brakes, -0.3, 0.0)
    assert relative("brake_blending", 0.3, form="constant") == pytest.approx(wanted.tolist())
    alone = relative("brake_blending", 0.3, form="constant", at=replace(DRIVE, efforts=None))
    assert alone == pytest.approx(np.where(DRIVE.effort < 0.0, -0.3, 0.0).tolist())


def test_a_brake_that_fades_out_has_its_share_at_rest_and_never_more_than_all():
    at = replace(DRIVE, effort=np.full(N, -1.0), efforts=None, speed=np.linspace(0.0, 24.0, N))
    line = [min(1.5 * max(1.0 - v / 20.0, 0.0), 1.0) for v in at.speed]
    found = relative("brake_blending", 1.5, 20.0, form="fade", at=at)
    assert found == pytest.approx([-x for x in line])
    assert found[0] == -1.0
    assert found[-1] == 0.0


def test_a_wheel_speed_swings_once_a_turn_and_states_how_fast_it_does():
    """The rate by a difference quotient, of a wheel that turns on at its speed."""
    found, dt = error("wheel_once_per_turn", 0.01, 0.7, 3.0), 1e-6
    own = (DRIVE.axle == 3.0).astype(float)
    assert found.relative == pytest.approx(own * 0.01 * np.sin(DRIVE.wheel_angle + 0.7))
    later = error(
        *("wheel_once_per_turn", 0.01, 0.7, 3.0),
        at=replace(DRIVE, wheel_angle=DRIVE.wheel_angle + DRIVE.wheel_speed * dt),
    )
    rate = (later.relative - found.relative) / dt
    assert found.relative_rate == pytest.approx(rate, abs=1e-5)
    unknown = error("wheel_once_per_turn", 0.01, 0.7, 3.0, at=replace(DRIVE, wheel_angle=None))
    assert np.isnan(unknown.relative).all()


def test_each_law_says_which_reading_is_wrong_and_what_it_must_know():
    quantities = {
        "load_transfer": Quantity.LOAD,
        "effort_gain": Quantity.EFFORT,
        "speed_error": Quantity.SPEED,
        "curving_resistance": Quantity.EFFORT,
        "brake_blending": Quantity.EFFORT,
        "wheel_once_per_turn": Quantity.WHEEL_SPEED,
    }
    needs = {
        ("load_transfer", "geometry"): {Need.EFFORTS},
        ("load_transfer", "heights"): {Need.EFFORTS},
        ("effort_gain", "axle"): {Need.AXLE},
        ("effort_gain", "heat"): {Need.SEQUENCE},
        ("effort_gain", "time"): {Need.SEQUENCE},
        ("speed_error", "step"): {Need.SEQUENCE},
        ("speed_error", "growth"): {Need.SEQUENCE},
        ("speed_error", "low_pass"): {Need.SEQUENCE},
        ("speed_error", "pitch"): {Need.EFFORTS},
        ("brake_blending", "constant"): {Need.EFFORTS},
        ("brake_blending", "fade"): {Need.EFFORTS},
        ("wheel_once_per_turn", ""): {Need.WHEEL_ANGLE, Need.SEQUENCE, Need.AXLE},
    }
    seen = set()
    for effect in EFFECTS:
        if effect.id in quantities:
            law = law_of(effect.id, *(p.typical for p in effect.parameters), form=effect.form)
            seen.add(effect.id)
            assert law.quantity is quantities[effect.id]
            assert law.needs == needs.get((effect.id, effect.form), set()), effect
            curves = "curving" in effect.id or effect.form in {"offset", "curvature"}
            assert law.covariates == (("curvature_per_m",) if curves else ())
            assert bool(effect.requires.covariates) == curves
    assert seen == set(quantities)
