"""The watch in front of the estimator: steps that no rail makes, and sound readings."""

from dataclasses import replace

import numpy as np
import pytest

from adhesion_can.estimation.plausibility.agreement import UPDATES, Agreement
from adhesion_can.estimation.plausibility.course import Course, extrapolation
from adhesion_can.estimation.plausibility.estimator import WatchedEstimator
from adhesion_can.estimation.plausibility.settings import PlausibilitySettings
from adhesion_can.estimation.plausibility.steps import (
    STEPS,
    CurveBefore,
    Window,
    is_effort_step,
    is_wheel_jump,
)
from adhesion_can.physics.objection import WORDINGS, Objection, objection_sentence
from adhesion_can.physics.samples import Sample, Samples
from adhesion_can.physics.vehicle import Locomotive
from tests.service.test_core import KNOWN

CURVE = CurveBefore((0.4, 60.0, 0.3), 0.36, 0.07)
RNG = np.random.default_rng(1)


def curve(slip):
    c1, c2, c3 = CURVE.theta
    return c1 * (1.0 - np.exp(-c2 * slip)) - c3 * slip


def window(wheels=1.0, efforts=0.0, at=7):
    """Six axles at slips of 0.5 to 2 %, with a step of all wheels or efforts at a cycle."""
    slip = np.tile(np.linspace(0.005, 0.02, 6), (STEPS, 1))
    mu = curve(slip)
    slip[at:] = wheels * (1.0 + slip[at:]) - 1.0
    mu[at:] += efforts
    speed = np.full(STEPS, 14.0)
    return Window((1.0 + slip) * 14.0, mu, slip, np.full((STEPS, 6), 2.45e5), speed)


@pytest.mark.parametrize("factor", [1.5, 0.5, 9.0, 1e-3])
def test_one_factor_on_all_wheels_is_a_jump(factor):
    assert is_wheel_jump(window(factor), CURVE, 0.003)
    assert not is_wheel_jump(window(1.0), CURVE, 0.003)


def test_wheels_that_roll_while_they_are_pulled_are_a_jump():
    given = window()
    slip = given.slip.copy()
    slip[7:] = 1e-4
    assert is_wheel_jump(given._replace(slip=slip, rim=(1 + slip) * 14.0), CURVE, 0.003)


@pytest.mark.parametrize("standing", [1, 3, 4])
def test_a_wheel_that_stood_still_before_hides_no_jump_of_the_others(standing):
    given = window(1.5)
    for reading in (0.0, 0.01):
        still = given.rim.copy()
        still[:, :standing] = reading
        assert is_wheel_jump(given._replace(rim=still), CURVE, 0.003) == (standing <= 3)
    assert not is_wheel_jump(window()._replace(rim=window().rim * [0, 1, 1, 1, 1, 1]), CURVE, 0.003)


def test_wheels_that_move_along_the_curve_are_no_jump():
    """All slips double within a cycle, and the adhesion with them: another effort."""
    slip = np.tile(np.linspace(0.005, 0.02, 6), (STEPS, 1))
    slip[7:] *= 2.0
    given = Window((1 + slip) * 14.0, curve(slip), slip, 0 * slip, np.full(STEPS, 14.0))
    assert not is_wheel_jump(given, CURVE, 0.003)


def test_axles_that_a_rail_moves_differently_are_no_jump():
    given = window()
    slip = given.slip.copy()
    slip[7:] += np.linspace(0.01, 0.06, 6)
    assert not is_wheel_jump(given._replace(slip=slip, rim=(1 + slip) * 14.0), CURVE, 0.003)


def test_a_step_of_all_efforts_is_seen_and_a_ramp_is_not():
    assert is_effort_step(window(efforts=0.08))
    assert is_effort_step(window(efforts=-0.08))
    ramp = window()
    mu = ramp.adhesion + 0.02 * np.arange(STEPS)[:, None]
    assert not is_effort_step(ramp._replace(adhesion=mu))


def test_a_straight_line_stays_on_its_course_and_a_step_shows_its_size():
    course = Course(46, 2)
    for k in range(100):
        course.add((0.3 * k + 2.0, 0.3 * k + (5.0 if k >= 94 else 0.0)))
    line, step = (extrapolation(46, [(40, 6)]) @ course.rows)[0]
    assert abs(line) < 1e-9
    assert step == pytest.approx(5.0)


class Sure:
    """Estimator that is sure of one curve."""

    def __init__(self):
        self.fed = 0

    def update(self, samples, now_us):
        self.fed += len(samples)
        c1, c2, c3 = CURVE.theta
        return replace(KNOWN, c1=c1, c2=c2, c3=c3, mu_max=0.36, lambda_m=0.07)


def drive(
    change=lambda _, row: row, cycles=900, seed=3, mass=8e5, outer=lambda _: -0.2, noise=0.02
):
    """Objections of a drive with noise, a row a cycle; and the estimator's number of samples.

    `outer` is the acceleration by other forces than those of the wheels, m/s², by the cycle.
    """
    rng = np.random.default_rng(seed)
    sure = Sure()
    vehicle = Locomotive() if mass == 8e5 else Locomotive(train_mass=mass)
    watched = WatchedEstimator(sure, vehicle, PlausibilitySettings(), 0.5)
    seen, true_speed = [], 10.0
    for k in range(cycles):
        mu = 0.15 + 0.1 * np.cos((k - 600) / 60.0) + 0.03 * np.arange(6) / 6
        true_speed += 0.02 * (2.45e5 * mu.sum() / mass + outer(k))
        speed = true_speed + noise * rng.standard_normal()
        slip = np.interp(mu, curve(np.linspace(0, 0.07, 500)), np.linspace(0, 0.07, 500))
        rim = (1.0 + slip) * true_speed
        speed, rim, mu = change(k, (speed, rim, mu + 0.01 * rng.standard_normal(6)))
        rows = [
            Sample(
                t_us=20_000 * k,
                axle=i + 1,
                slip=rim[i] / speed - 1.0,
                adhesion=mu[i],
                creep_speed=rim[i] - speed,
                speed=speed,
                load=2.45e5,
                slip_var=1e-7,
                slip_common_var=(noise / speed) ** 2,
                adhesion_var=1e-4,
            )
            for i in range(6)
        ]
        seen.append(watched.update(Samples.from_rows(rows), 20_000 * k + 10_000).objection)
    return seen, sure.fed


def after(change, k0=600):
    return lambda k, row: change(*row) if k >= k0 else row


@pytest.mark.parametrize("seed", range(4))
def test_a_sound_drive_has_no_objection(seed):
    seen, fed = drive(cycles=3000, seed=seed)
    assert set(seen) == {Objection.NONE}
    assert fed == 18_000


LIGHT = 6 * 2.45e5 / 9.81
"""Mass of a vehicle all of whose axles are driven, kg."""


@pytest.mark.parametrize("seed", range(4))
def test_the_brakes_of_a_light_vehicle_are_no_jump_of_its_speed(seed):
    """Its friction brakes set in, with 1.4 m/s³ for 0.5 s, while the wheels slip ever more."""

    def braked(k):
        return -1.7 - 1.4 * np.clip(0.02 * (k - 600), 0.0, 0.5)

    def slipping(k, row):
        speed, rim, mu = row
        return speed, rim + 0.02 * max(k - 600, 0), mu

    def and_jumping(k, row):
        speed, rim, mu = slipping(k, row)
        return speed - 0.5 * (k >= 600), rim, mu

    light = {"cycles": 660, "seed": seed, "mass": LIGHT, "outer": braked, "noise": 0.01}
    assert Objection.SPEED_JUMP not in drive(slipping, **light)[0]
    assert Objection.SPEED_JUMP in drive(and_jumping, **light)[0][600:625]


@pytest.mark.parametrize(
    ("change", "objection"),
    [
        (lambda v, rim, mu: (0.95 * v, rim, mu), Objection.SPEED_JUMP),
        (lambda v, rim, mu: (v - 0.3, rim, mu), Objection.SPEED_JUMP),
        (lambda v, rim, mu: (v, 1.5 * rim, mu), Objection.WHEELS_JUMP),
        (lambda v, rim, mu: (v, 0 * rim + 0.005, mu), Objection.WHEELS_JUMP),
        (lambda v, rim, mu: (v, rim, mu + 0.08), Objection.EFFORTS_JUMP),
    ],
)
def test_a_jump_is_objected_to_within_half_a_second_and_stands(change, objection):
    seen, _ = drive(after(change))
    assert set(seen[:600]) == {Objection.NONE}
    assert objection in seen[600:625]
    assert set(seen[625:]) == {objection}


def test_a_speed_that_stands_still_leaves_its_course():
    held = []

    def change(k, row):
        held.append(row[0])
        return (np.mean(held[595:600]) + 0.005 * (k % 3), *row[1:]) if k >= 600 else row

    seen, _ = drive(change)
    assert {Objection.SPEED_DEVIATES, Objection.SPEED_JUMP} & set(seen[600:700])


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf, 1e300, 0.0])
def test_readings_without_a_value_leave_nothing_behind(value):
    def change(k, row):
        v, rim, mu = row
        return (v, rim, mu * 0 + value) if 300 <= k < 310 else (v, rim, mu)

    seen, _ = drive(change)
    assert set(seen[600:]) == {Objection.NONE}


def test_axles_that_are_lost_end_a_question():
    """Of a step of the efforts nobody can tell with two axles left."""
    rng = np.random.default_rng(5)
    watched = WatchedEstimator(Sure(), Locomotive(), PlausibilitySettings(), 0.5)
    seen = []
    for k in range(700):
        mu = 0.15 + (0.08 if k >= 400 else 0.0) + 0.01 * rng.standard_normal(6)
        axles = range(6) if k < 405 else range(2)
        rows = [Sample(20_000 * k, i + 1, 0.008, mu[i], 0.1, 12.0, 2.45e5) for i in axles]
        seen.append(watched.update(Samples.from_rows(rows), 20_000 * k + 10_000).objection)
    assert Objection.EFFORTS_JUMP in seen[400:405]
    assert set(seen[420:]) == {Objection.NONE}


@pytest.mark.parametrize("noise", [0.0, 0.1])
def test_a_step_of_all_efforts_that_nothing_answers_stands(noise):
    """Where the vehicle's answer is lost in the noise of its speed, too: nobody can tell."""
    rng = np.random.default_rng(7)

    def change(k, row):
        v, rim, mu = row
        return v + noise * rng.standard_normal(), rim, mu + (0.08 if k >= 600 else 0.0)

    seen, _ = drive(change)
    assert set(seen[660:]) == {Objection.EFFORTS_JUMP}


def test_after_a_fault_that_ends_the_readings_agree_again():
    seen, fed = drive(lambda k, row: (0.95 * row[0], *row[1:]) if 600 <= k < 700 else row)
    assert Objection.SPEED_JUMP in seen[600:700]
    assert set(seen[700 + UPDATES + 2 :]) == {Objection.NONE}
    assert fed < 6 * 800


def test_coasting_shows_that_wheels_and_vehicle_run_alike():
    agreement = Agreement()
    agreement.begin(None)
    rest = Samples.curve(np.full(6, 0.0005), np.full(6, 0.004))
    assert [agreement.add(rest) for _ in range(UPDATES)][-1]
    agreement.begin(None)
    off = Samples.curve(np.full(6, 0.03), np.full(6, 0.004))
    assert not any(agreement.add(off) for _ in range(2 * UPDATES))


def test_beyond_the_top_the_slip_is_that_of_the_top():
    """Whatever the estimate says of its height, which may be that of several families."""
    for mu_max in (0.2, 0.36, 0.5):
        slips = CURVE._replace(mu_max=mu_max).slip_at(np.array([-0.9, -0.2, 0.0, 0.2, 0.9]))
        assert slips[4] == pytest.approx(CURVE.lambda_m, abs=1e-3)
        assert curve(slips[3]) == pytest.approx(0.2)
        assert np.array_equal(slips, -slips[::-1])


def test_every_objection_has_words():
    assert set(WORDINGS) == set(Objection) - {Objection.NONE}
    assert all(": " in objection_sentence(one) for one in WORDINGS)
    assert objection_sentence(Objection.NONE) == ""
