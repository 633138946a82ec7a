"""Delays of every signal, of either sign, named after the signal that is late or early.

The drives are the tests' own: a braking car in a table, and a locomotive in closed form.
"""

import itertools

import numpy as np
import pytest

from adhesion_can.api.diagnosis import diagnose as diagnose_files
from adhesion_can.diagnosis.diagnose import diagnose
from adhesion_can.diagnosis.inference import delay_search
from adhesion_can.diagnosis.regression.whitened_regression import fit_model
from adhesion_can.physics.instruments import Instruments
from adhesion_can.physics.readings import Role
from adhesion_can.sampling.traces import Trace
from tests.diagnosis.diagnosis_helpers import SyntheticDrive, burckhardt, write_table
from tests.seeds import first_quick

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


@pytest.mark.costly
@pytest.mark.parametrize(("late", "by"), first_quick(itertools.product(EFFECT, (0.1, -0.063))))
def test_the_signal_that_is_late_or_early_is_named(tmp_path, late, by):
    named, sizes = 0, []
    for seed in range(3):
        found = diagnose_files(braking_car(tmp_path / "t.csv", seed, late, by))
        causes = {cause.effect: cause for cause in found.causes}
        # Where the forces tell little, an early wheel and a late vehicle speed are one answer.
        named += any(EFFECT[late] in (cause.effect, *cause.rivals) for cause in found.causes)
        if EFFECT[late] in causes:
            cause = causes[EFFECT[late]]
            sizes.append(cause.parameters[0].value)
            assert ("early" if by < 0 else "late") in cause.title
    assert named >= 2
    assert np.allclose(sizes, by, atol=0.012)


@pytest.mark.costly
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


@pytest.mark.slow
def test_late_wheel_speeds_of_a_recording_are_no_inertia():
    """Two of three drives at least: the wheel speeds, and no effect of the vehicle."""
    right = 0
    for seed in range(3):
        drive = LateWheels(duration_s=120.0).build_drive_data(np.random.default_rng(seed))
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


def rig(path, seed, speeds, by=0.0, length=0.0, period_s=6.0):
    """Table of a rig whose force is late, or follows over a length, at one speed after another."""
    rng = np.random.default_rng(seed)
    t = np.arange(4000) * STEP_S
    speed = np.repeat(speeds, len(t) // len(speeds))
    slip = 0.06 * np.sin(2.0 * np.pi * t / period_s) * (0.7 + 0.3 * np.sin(t / 3.0))
    followed = slip.copy()
    for row in range(1, len(t)) if length else ():
        share = 1.0 - np.exp(-speed[row] * STEP_S / length)
        between = 0.5 * (slip[row - 1] + slip[row])
        followed[row] = followed[row - 1] + share * (between - followed[row - 1])
    force = np.interp(t - by, t, burckhardt(followed)) + 0.01 * rng.standard_normal(len(t))
    columns = {
        "time_s": t,
        "slip": slip + 0.0005 * rng.standard_normal(len(t)),
        "adhesion": force,
        "speed_mps": speed,
    }
    return write_table(path, columns)


LAGS = {"creep_relaxation", "effort_delay", "wheel_speed_delay"}


def lag_of(path):
    """The lag or delay that is named, with its size and its rivals."""
    (cause,) = (one for one in diagnose_files(path).causes if one.effect in LAGS)
    return cause.effect, cause.parameters[0].value, set(cause.rivals)


@pytest.mark.slow
@pytest.mark.parametrize("lag", [{"by": 0.1}, {"length": 1.0}])
def test_at_one_speed_a_delay_and_a_relaxation_are_rivals(tmp_path, lag):
    for seed in range(2):
        named, _, rivals = lag_of(rig(tmp_path / "t.csv", seed, [10.0], **lag))
        assert {named} | rivals == LAGS


@pytest.mark.costly
def test_a_force_that_is_early_is_no_relaxation(tmp_path):
    for seed in range(2):
        named, size, rivals = lag_of(rig(tmp_path / "t.csv", seed, [10.0], by=-0.1))
        assert {named} | rivals == LAGS - {"creep_relaxation"}
        assert abs(size) == pytest.approx(0.1, abs=0.01)


@pytest.mark.costly
@pytest.mark.parametrize(
    ("expected", "lag"),
    [
        ("effort_delay", {"by": 0.1}),
        ("effort_delay", {"by": -0.1}),
        ("creep_relaxation", {"length": 1.0}),
    ],
)
def test_several_speeds_separate_a_delay_and_a_relaxation(tmp_path, expected, lag):
    for seed in range(2):
        path = rig(tmp_path / "t.csv", seed, [5.0, 10.0, 20.0, 8.0], **lag)
        named, size, rivals = lag_of(path)
        assert named == expected
        assert size == pytest.approx(*lag.values(), rel=0.1)
        assert not {"creep_relaxation", "effort_delay"} <= {named} | rivals


@pytest.mark.slow
@pytest.mark.parametrize("speeds", [[10.0], [5.0, 10.0, 20.0, 8.0]])
def test_an_early_force_in_quick_sweeps_is_no_average_of_noise(tmp_path, speeds):
    """A relaxation that runs backwards in time, of any length, would explain it too."""
    for seed in (1, 2):
        path = rig(tmp_path / "t.csv", seed, speeds, by=-0.1, period_s=1.7)
        named, size, _ = lag_of(path)
        assert named in {"effort_delay", "wheel_speed_delay"}
        assert abs(size) == pytest.approx(0.1, rel=0.05)


def noisy_car(path, seed, late_s):
    """Table of a car whose slips are as noisy as a row's step of the force is large."""
    rng = np.random.default_rng(seed)
    t = np.arange(8000) * STEP_S
    phase = t % 20.0
    pulls = np.where(phase < 14.0, 0.05 * np.sin(np.pi * (phase - 8.0) / 6.0) ** 2, 0.0)
    slip = np.where(phase < 8.0, -0.1 * np.sin(np.pi * phase / 4.0) ** 2, pulls)
    speed = 18.0 + 6.0 * np.sin(t / 2.3) + 2.0 * np.sin(t / 0.7)
    wheel = (1.0 + slip) * speed + 0.01 * rng.standard_normal(len(t))
    read = speed + 0.01 * rng.standard_normal(len(t))
    force = np.interp(t - late_s, t, burckhardt(slip, 1.0, 25.0, 0.5))
    columns = {
        "time_s": t,
        "slip": wheel / read - 1.0,
        "adhesion": force + 0.005 * rng.standard_normal(len(t)),
        "speed_mps": read,
    }
    return write_table(path, columns)


@pytest.mark.slow
@pytest.mark.parametrize("late_s", [0.05, 0.13, -0.05])
@pytest.mark.parametrize("seeds", [range(1), range(1, 4)])
def test_noise_of_the_slips_moves_no_delay_and_makes_no_relaxation_of_it(tmp_path, late_s, seeds):
    """Between rows a straight line averages noise, and so does a relaxation."""
    for seed in seeds:
        found = diagnose_files(noisy_car(tmp_path / "t.csv", seed, late_s))
        lags = {one.effect: one.parameters[0] for one in found.causes if one.effect in LAGS}
        assert list(lags) == ["effort_delay"]
        delay = lags["effort_delay"]
        assert delay.value == pytest.approx(late_s, abs=0.003)
        assert abs(delay.value - late_s) < 5.0 * delay.std


@pytest.mark.costly
def test_no_delay_is_tried_beyond_what_a_delay_may_be(tmp_path, monkeypatch):
    """The effort is as late as a delay may be at most; twice as much has no rows, and no fit."""
    tried = []

    def recorded(regression, model, *rest):
        tried.extend(active.values[0] for active in model.fixed if "delay" in active.effect.id)
        return fit_model(regression, model, *rest)

    monkeypatch.setattr(delay_search, "fit_model", recorded)
    found = diagnose_files(braking_car(tmp_path / "t.csv", 1, "force", 0.44))
    (delay,) = (cause for cause in found.causes if cause.effect == "effort_delay")
    assert delay.parameters[0].value == pytest.approx(0.44, abs=0.012)
    assert tried
    assert max(tried) <= 0.5
