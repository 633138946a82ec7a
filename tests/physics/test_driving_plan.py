"""Driving plans: the slips that a step asks for, and what a step and a plan refuse."""

import math
from dataclasses import replace

import numpy as np
import pytest

from adhesion_can.physics.driving_plan import DrivingPlan, PlanLimits, PlanStep

RAMP = PlanStep(4.0, "traction", (0.02, 0.10))
SWEEP = PlanStep(12.0, "braking", (0.01, 0.05), period_s=3.0)
COAST = PlanStep(5.0, "coast")
PLAN = DrivingPlan((RAMP, COAST, SWEEP), 10.0)


# ---------------------------------------------------------------------------- slips over time


def test_a_ramp_goes_evenly_from_one_slip_to_the_other_and_stays_there():
    slips = RAMP.slips(np.array([-1.0, 0.0, 1.0, 2.0, 4.0, 9.0]), axles=3)
    wanted = np.array([0.02, 0.02, 0.04, 0.06, 0.10, 0.10])
    assert slips == pytest.approx(np.repeat(wanted[:, None], 3, axis=1), rel=1e-12)
    assert RAMP.slips(2.0, axles=4) == pytest.approx(np.full(4, 0.06))


def test_a_sweep_is_at_its_first_slip_at_each_period_and_at_the_second_between():
    found = SWEEP.slips(np.array([0.0, 0.75, 1.5, 2.25, 3.0, 10.5]), axles=2)[:, 1]
    assert found == pytest.approx([-0.01, -0.03, -0.05, -0.03, -0.01, -0.05], abs=1e-12)


def test_staggered_axles_follow_each_other_by_equal_parts_of_the_period():
    """Of three that pull the first one begins; the sum of the slips does not change."""
    step = replace(SWEEP, mode="traction", stagger=True, axles=(2, 3, 6))
    times = np.linspace(0.0, 3.0, 61)
    found, single = step.slips(times, axles=6), replace(SWEEP, mode="traction")
    for place, axle in enumerate((2, 3, 6)):
        alone = single.slips(times + place * 3.0 / 3, axles=6)[:, axle - 1]
        assert found[:, axle - 1] == pytest.approx(alone, abs=1e-12)
    assert np.isnan(found[:, [0, 3, 4]]).all()
    assert np.nansum(found, axis=1) == pytest.approx(np.full(61, 3 * 0.03), abs=1e-12)


def test_axles_idle_where_others_pull_alone_and_all_of_them_in_a_coasting_step():
    pulling = replace(RAMP, axles=(1, 4)).slips(np.array([0.0, 4.0]), axles=6)
    assert (~np.isnan(pulling)).tolist() == [[True, False, False, True, False, False]] * 2
    for elapsed, shape in ((1.0, (6,)), (np.zeros(3), (3, 6)), (np.zeros((2, 3)), (2, 3, 6))):
        coasting = COAST.slips(elapsed, axles=6)
        assert coasting.shape == shape == RAMP.slips(elapsed, axles=6).shape
        assert np.isnan(coasting).all()


@pytest.mark.parametrize("step", [RAMP, SWEEP, replace(SWEEP, period_s=0.7), COAST])
def test_the_rate_of_a_step_is_the_steepest_that_its_slips_have(step):
    times = np.linspace(0.0, step.duration_s, 200_001)
    slips = np.nan_to_num(step.slips(times, axles=1)[:, 0])
    steepest = np.abs(np.diff(slips)).max() / (times[1] - times[0])
    assert step.slip_rate == pytest.approx(steepest, rel=1e-6)


def test_efforts_have_the_sign_of_the_mode():
    assert [step.sign for step in (RAMP, SWEEP, COAST)] == [1.0, -1.0, 0.0]


@pytest.mark.parametrize(
    ("step", "words"),
    [
        (RAMP, "traction, slip 0.02 to 0.1"),
        (replace(RAMP, slip=(0.05, 0.05), sand=True), "traction, slip 0.05, with sand"),
        (SWEEP, "braking, slip 0.01 to 0.05 and back every 3 s"),
        (replace(SWEEP, stagger=True),
         "braking, slip 0.01 to 0.05 and back every 3 s, the axles in turn"),
        (replace(RAMP, axles=(3,)), "traction, slip 0.02 to 0.1, axle 3 alone"),
        (replace(SWEEP, axles=(1, 2), stagger=True),
         "braking, slip 0.01 to 0.05 and back every 3 s, axles 1, 2 alone"),
        (COAST, "coasting"),
        (replace(COAST, sand=True), "coasting, with sand"),
    ],
)  # fmt: skip
def test_a_step_in_words(step, words):
    assert step.description == words


# -------------------------------------------------------------------------- what is refused


@pytest.mark.parametrize(
    "change",
    [
        {"duration_s": 1e-3}, {"period_s": 0.0}, {"period_s": 1e-3}, {"slip": (0.0, 0.1)},
        {"slip": (0.1, 0.0)}, {"axles": (1,)}, {"axles": (2, 1)}, {"axles": (1, 2, 3, 4, 5, 6)},
        {"stagger": True},
    ],
)  # fmt: skip
@pytest.mark.parametrize("mode", ["traction", "braking"])
def test_steps_that_can_be_driven(change, mode):
    step = replace(SWEEP, mode=mode, **change)
    assert DrivingPlan((step,), 10.0).steps == (step,)


@pytest.mark.parametrize(
    ("step", "change", "words"),
    [
        (RAMP, {"duration_s": 0.0}, "duration_s"),
        (RAMP, {"duration_s": -1.0}, "duration_s"),
        (RAMP, {"duration_s": math.inf}, "duration_s"),
        (RAMP, {"duration_s": math.nan}, "duration_s"),
        (RAMP, {"period_s": -0.5}, "period_s"),
        (RAMP, {"period_s": math.inf}, "period_s"),
        (RAMP, {"slip": (0.1, -0.01)}, "slips have no sign"),
        (RAMP, {"slip": (math.nan, 0.1)}, "slips have no sign"),
        (RAMP, {"slip": (0.0, 0.0)}, "needs a slip above 0"),
        (SWEEP, {"slip": (0.0, 0.0)}, "needs a slip above 0"),
        (COAST, {"slip": (0.0, 0.1)}, "coasts"),
        (COAST, {"axles": (1,)}, "coasts"),
        (RAMP, {"stagger": True}, "stagger needs period_s"),
        (RAMP, {"axles": (2, 2)}, "different numbers"),
        (RAMP, {"axles": (0, 1)}, "different numbers"),
        (RAMP, {"axles": (-1,)}, "different numbers"),
    ],
)
def test_steps_that_cannot_be_driven_say_why(step, change, words):
    with pytest.raises(ValueError, match=words):
        replace(step, **change)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"steps": ()}, "needs a step"),
        ({"start_speed": 2.99}, "start_speed"),
        ({"start_speed": 25.01}, "start_speed"),
        ({"bandwidth_share": 0.0}, "bandwidth_share"),
        ({"bandwidth_share": 1.01}, "bandwidth_share"),
        ({"curve": (0.0, 60.0, 0.0)}, "curve with a peak"),
        ({"curve": (0.4, 60.0, -0.1)}, "curve with a peak"),
        ({"curve": (0.4, 1.0, 0.4)}, "curve with a peak"),
        ({"curve": (0.4, math.inf, 0.4)}, "curve with a peak"),
        ({"limits": PlanLimits(duration_max=20.9)}, "duration_max, 20.9 s"),
        ({"limits": PlanLimits(slip_max=0.099)}, "step 1 has a slip beyond slip_max, 0.099"),
        ({"limits": PlanLimits(braking=False)}, "step 3 brakes"),
        ({"steps": (COAST, replace(RAMP, axles=(1,))), "limits": PlanLimits(single_axles=False)},
         "step 2 lets axles idle"),
        ({"steps": (replace(COAST, sand=True),), "limits": PlanLimits(sand=False)},
         "step 1 uses sand"),
    ],
)  # fmt: skip
def test_plans_that_cannot_be_driven_say_why(change, words):
    with pytest.raises(ValueError, match=words):
        replace(PLAN, **change)


def test_ends_of_the_limits_are_within_them():
    assert replace(PLAN, start_speed=3.0, bandwidth_share=1.0).start_speed == 3.0
    assert replace(PLAN, start_speed=25.0, curve=(0.4, 60.0, 0.0)).curve[2] == 0.0
    limits = PlanLimits(duration_max=21.0, slip_max=0.1, braking=True, single_axles=False)
    assert replace(PLAN, limits=limits).duration_s == 21.0
    assert PlanLimits(duration_max=3600.0).duration_max == 3600.0
    with pytest.raises(ValueError, match="duration_max"):
        PlanLimits(duration_max=3601.0)
    with pytest.raises(ValueError, match="speed_max must be above speed_min"):
        PlanLimits(speed_min=5.0, speed_max=5.0)


def test_round_off_of_a_sum_exceeds_no_limit():
    """0.1 + 0.2 is above 0.3 by the last bit."""
    steps = (replace(RAMP, duration_s=1.1), replace(RAMP, duration_s=2.2, slip=(0.0, 0.1 + 0.2)))
    assert sum(step.duration_s for step in steps) > 3.3
    limits = PlanLimits(duration_max=3.3, slip_max=0.3)
    assert DrivingPlan(steps, 10.0, limits=limits).duration_s == pytest.approx(3.3)


# ------------------------------------------------------------------------ the steps of a plan


def test_a_plan_knows_which_step_is_driven_at_a_time():
    assert PLAN.duration_s == 21.0
    assert list(PLAN.begins()) == [(0.0, RAMP), (4.0, COAST), (9.0, SWEEP)]
    assert PLAN.step_at(0.0) == (0, 0.0)
    assert PLAN.step_at(3.5) == (0, 3.5)
    assert PLAN.step_at(4.0) == (1, 0.0)
    assert PLAN.step_at(10.5) == (2, 1.5)
    assert PLAN.step_at(20.9) == (2, pytest.approx(11.9))
    assert PLAN.step_at(21.0) is None


def test_the_largest_axle_that_a_plan_names():
    assert PLAN.most_axle == 0
    assert replace(PLAN, steps=(RAMP, replace(RAMP, axles=(5, 2)), SWEEP)).most_axle == 5
