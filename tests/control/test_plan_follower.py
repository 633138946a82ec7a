"""A plan that is driven: slips, order of the steps, sand, and limits that are never exceeded."""

from dataclasses import replace

import numpy as np
import pytest

from adhesion_can.api.configuration import as_configuration
from adhesion_can.api.simulation import build_run_settings, drive_plan, make_simulation
from adhesion_can.control.plan_follower import PlanFollower
from adhesion_can.physics.driving_plan import DrivingPlan, PlanLimits, PlanStep
from adhesion_can.physics.vehicle import Locomotive

SETTLED_S = 1.0
"""Time from which a step's slips are reached, s."""


def driven(steps, *, speed=12.0, start=None, limits=None, effects=(), duration=None):
    """Rows of (time, speed, sand, slips, efforts) of a plan on a dry rail."""
    plan = DrivingPlan(tuple(steps), speed, limits=limits or PlanLimits())
    config = as_configuration(None)
    seconds = duration or plan.duration_s
    settings = build_run_settings("dry", seconds, 1, list(effects), config, plan=plan)
    if start is not None:
        settings = replace(settings, start_speed=start)
    simulation = make_simulation(settings, config)
    rows = []
    for _ in drive_plan(simulation, config, plan):
        plant = simulation.plant
        rows.append(
            (simulation.now_us / 1e6, plant.speed, plant.conditions.sanding,
             *plant.slip, *simulation._drive.effort)
        )  # fmt: skip
    rows = np.array(rows)
    return plan, rows[:, 0], rows[:, 1], rows[:, 2], rows[:, 3:9], rows[:, 9:]


@pytest.mark.costly
def test_axles_reach_the_slips_of_the_steps_and_the_others_idle():
    steps = (
        PlanStep(3.0, "traction", (0.04, 0.04)),
        PlanStep(6.0, "traction", (0.002, 0.14), 6.0, stagger=True),
        PlanStep(3.0, "braking", (0.03, 0.03), axles=(1, 4)),
        PlanStep(3.0, "coast"),
        PlanStep(4.0, "braking", (0.02, 0.1)),
    )
    plan, time_s, _, _, slip, effort = driven(steps)
    for begin, step in plan.begins():
        rows = (time_s > begin + SETTLED_S) & (time_s < begin + step.duration_s - 0.02)
        wanted = step.slips(time_s[rows] - begin, 6)
        idle = np.isnan(wanted)
        error = np.abs(slip[rows] - wanted)[~idle]
        if error.size:
            assert np.sqrt(np.mean(error**2)) < 0.006
            assert np.quantile(error, 0.95) < 0.012
        assert np.abs(effort[rows][idle]).max(initial=0.0) < 10.0
        assert np.abs(slip[rows][idle]).max(initial=0.0) < 1e-3


def test_sand_is_strewn_in_its_steps_alone():
    steps = (
        PlanStep(1.0, "coast"),
        PlanStep(2.0, "traction", (0.02, 0.02), sand=True),
        PlanStep(1.0, "coast"),
    )
    _, time_s, _, sand, _, _ = driven(steps)
    assert sand[(time_s > 1.1) & (time_s < 2.9)].all()
    assert not sand[(time_s < 0.9) | (time_s > 3.1)].any()


def test_the_effort_never_exceeds_its_limit():
    limits = PlanLimits(effort_max=30e3)
    steps = (PlanStep(4.0, "traction", (0.002, 0.1)), PlanStep(4.0, "braking", (0.05, 0.05)))
    _, _, _, _, _, effort = driven(steps, limits=limits)
    # The demand has steps of 10 N on the bus.
    assert np.abs(effort).max() <= 30e3 + 10.0


@pytest.mark.costly
@pytest.mark.parametrize(
    ("mode", "limits"),
    [
        ("traction", PlanLimits(speed_max=12.5)),
        ("braking", PlanLimits(speed_min=11.5)),
    ],
)
def test_nothing_pulls_or_brakes_beyond_the_speed_limits(mode, limits):
    _, _, speed, _, _, effort = driven((PlanStep(12.0, mode, (0.05, 0.05)),), limits=limits)
    outside = (speed > limits.speed_max + 0.1) | (speed < limits.speed_min - 0.1)
    assert np.abs(effort[outside]).max(initial=0.0) < 1e3
    # The limit was met at all.
    assert speed.max() > limits.speed_max - 0.2 or speed.min() < limits.speed_min + 0.2


def test_slips_stay_within_their_limit_where_the_rail_is_other_than_expected():
    limits = PlanLimits(slip_max=0.1)
    step = PlanStep(8.0, "traction", (0.002, 0.1), 4.0, stagger=True)
    _, _, _, _, slip, _ = driven((step,), limits=limits, effects=["falling_friction=0.3"])
    assert (np.abs(slip) > 0.13).mean() < 0.01


@pytest.mark.costly
@pytest.mark.parametrize("start", [10.5, 13.5])
def test_the_plan_begins_at_its_speed(start):
    step = PlanStep(2.0, "traction", (0.06, 0.06))
    _, _, speed, _, slip, _ = driven((step,), speed=12.0, start=start, duration=20.0)
    pulled = np.flatnonzero(np.median(slip, axis=1) > 0.05)
    assert len(pulled)
    assert abs(speed[pulled[0]] - 12.0) < 0.8


def test_a_plan_for_more_axles_than_there_are_is_refused():
    plan = DrivingPlan((PlanStep(1.0, "traction", (0.0, 0.1), axles=(7,)),), 10.0)
    with pytest.raises(ValueError, match="axle 7"):
        PlanFollower(Locomotive(), plan)
