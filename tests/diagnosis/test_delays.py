"""Delays of every signal, of either sign, named after the signal that is late or early.

The drives are the tests' own: a braking car in a table, and a locomotive in closed form.
"""

import numpy as np
import pytest

from adhesion_can.api.diagnosis import diagnose as diagnose_files
from adhesion_can.diagnosis.diagnose import diagnose
from adhesion_can.physics.instruments import Instruments
from adhesion_can.physics.readings import Role
from adhesion_can.sampling.traces import Trace
from tests.diagnosis.diagnosis_helpers import SyntheticDrive, burckhardt, write_table

STEP_S = 0.02


def braking_car(path, seed, late, by):
    """Table of a braking car whose speed varies; one of its signals is late by so many seconds."""
    rng = np.random.default_rng(seed)
    t = np.arange(3000) * STEP_S
    speed = 18.0 + 6.0 * np.sin(t / 2.3) + 2.0 * np.sin(t / 0.7)
    slip = -0.05 * (1.0 - np.cos(2.0 * np.pi * t / 3.1)) * (0.6 + 0.4 * np.sin(t / 5.0))
    signals = {"speed": speed, "wheel": (1.0 + slip) * speed, "force": burckhardt(slip)}
    signals[late] = np.interp(t - by, t, signals[late])
    noise = {"speed": 0.003, "wheel": 0.003, "force": 0.01}
    read = {name: x + noise[name] * rng.standard_normal(len(t)) for name, x in signals.items()}
    columns = {
        "time_s": t,
        "slip": read["wheel"] / read["speed"] - 1.0,
        "adhesion": read["force"],
        "speed_mps": read["speed"],
    }
    return write_table(path, columns)


EFFECT = {"speed": "speed_delay", "wheel": "wheel_speed_delay", "force": "effort_delay"}


@pytest.mark.parametrize("by", [0.1, -0.063])
@pytest.mark.parametrize("late", EFFECT)
def test_the_signal_that_is_late_or_early_is_named(tmp_path, late, by):
    named, sizes = 0, []
    for seed in range(3):
        found = diagnose_files(braking_car(tmp_path / "t.csv", seed, late, by))
        causes = {cause.effect: cause for cause in found.causes}
        if EFFECT[late] in causes:
            named += 1
            cause = causes[EFFECT[late]]
            sizes.append(cause.parameters[0].value)
            assert ("early" if by < 0 else "late") in cause.title
    assert named >= 2
    assert np.allclose(sizes, by, atol=0.012)


def test_rows_too_far_apart_do_not_show_a_delay(tmp_path):
    rng = np.random.default_rng(5)
    t = np.arange(1500.0)
    slip = 0.05 * np.sin(t / 9.0)
    adhesion = burckhardt(slip) + 0.01 * rng.standard_normal(len(t))
    columns = {"time_s": t, "slip": slip, "adhesion": adhesion, "speed_mps": 10.0 + np.sin(t / 40)}
    found = diagnose_files(write_table(tmp_path / "t.csv", columns))
    why = {one.what: one.why for one in found.untested}
    for effect in ("effort_delay", "speed_delay", "wheel_speed_delay"):
        assert "1 s apart" in why[effect]
    assert "10 m apart" in why["creep_relaxation"]


def test_a_table_without_speeds_says_so(tmp_path):
    t = np.arange(800) * 0.05
    slip = 0.05 * np.sin(t)
    path = write_table(
        tmp_path / "t.csv", {"time_s": t, "slip": slip, "adhesion": burckhardt(slip)}
    )
    why = {one.what: one.why for one in diagnose_files(path).untested}
    assert why["speed_delay"] == why["wheel_speed_delay"] == "the table has no column speed_mps"


class LateWheels(SyntheticDrive):
    """A locomotive whose wheel speeds come late."""

    late_s = 0.12

    def traces(self, rng=None, **how):
        found = super().traces(rng, **how)
        for (role, axle), trace in list(found.items()):
            if role is Role.WHEEL_SPEED:
                stamps = trace.t_us + round(self.late_s * 1e6)
                found[role, axle] = Trace(stamps, trace.value)
        return found


def test_late_wheel_speeds_of_a_recording_are_no_inertia():
    """Two of three drives at least: the wheel speeds, and no effect of the vehicle."""
    right = 0
    for seed in range(3):
        drive = LateWheels(duration_s=90.0).build_drive_data(np.random.default_rng(seed))
        found = diagnose([drive])
        names = {cause.effect for cause in found.causes}
        if "wheel_speed_delay" in names and "wheelset_inertia" not in names:
            (cause,) = (one for one in found.causes if one.effect == "wheel_speed_delay")
            right += abs(cause.parameters[0].value - LateWheels.late_s) < 0.02
    assert right >= 2


def test_only_differences_between_the_delays_count():
    all_late = Instruments(speed_delay=0.2, effort_delay=0.2, wheel_speed_delay=0.2)
    assert (all_late.speed_lag, all_late.effort_lag) == (0.0, 0.0)
    wheel = Instruments(wheel_speed_delay=0.1)
    assert (wheel.speed_lag, wheel.effort_lag) == (-0.1, -0.1)
