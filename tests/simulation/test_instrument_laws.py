"""Laws of the instruments: formulas written out here are found in frames, and samples lose them."""

import math
from dataclasses import replace

import numpy as np
import pytest

from adhesion_can.bus.block import Block
from adhesion_can.config import load_configuration
from adhesion_can.estimation.extended.model import ExtendedModel
from adhesion_can.offline.extract_samples import extract_samples
from adhesion_can.physics.vehicle import Locomotive
from tests.simulation.test_effects_in_runs import active, column, signals

LOAD = 245e3
EFFORTS = [f"TractiveEffort_Ax{axle}" for axle in range(1, 7)]
SPEED_S, EFFORT_S = 0.02, 0.01


@pytest.fixture(scope="module")
def plain():
    return signals()


def times(values, name):
    return np.array(list(values[name])) / 1e6


def low_pass(target, step_s, time_s):
    """Explicit Euler in a hundredth of the steps."""
    x, out = 0.0, []
    for before, after in zip([target[0], *target[:-1]], target, strict=True):
        for part in range(100):
            u = before + (after - before) * (part + 0.5) / 100
            x += step_s / 100 / time_s * (u - x)
        out.append(x)
    return np.array(out)


def total_effort(values):
    """Effort of all axles at the stamps of the vehicle speed."""
    at = times(values, "VehicleSpeed")
    return sum(np.interp(at, times(values, name), column(values, name)) for name in EFFORTS)


def curvature(values, name):
    at = np.searchsorted(times(values, "Curvature"), times(values, name), side="right") - 1
    return column(values, "Curvature")[np.maximum(at, 0)] / 1e3


@pytest.mark.costly
def test_gains_of_the_effort(plain):
    true = {name: column(plain[0], name) for name in EFFORTS}
    found, _ = signals(active("effort_gain", 0.1, 2.0, form="axle"))
    for axle, name in enumerate(EFFORTS, start=1):
        factor = 1.1 if axle == 2 else 1.0
        assert column(found, name) == pytest.approx(factor * true[name], abs=10.1)
    found, _ = signals(active("effort_gain", -0.05, form="all"))
    assert column(found, EFFORTS[3]) == pytest.approx(0.95 * true[EFFORTS[3]], abs=10.1)
    found, _ = signals(active("effort_gain", 0.002, form="time"))
    growth = 1 + 0.002 * times(plain[0], EFFORTS[0])
    assert column(found, EFFORTS[0]) == pytest.approx(growth * true[EFFORTS[0]], abs=10.1)


def test_heat_of_a_motor_is_its_effort_squared_with_a_memory(plain):
    found, _ = signals(active("effort_gain", 0.2, 30.0, form="heat"))
    true, load = column(plain[0], EFFORTS[4]), column(plain[0], "AxleLoad_Ax5")
    load = np.interp(times(plain[0], EFFORTS[4]), times(plain[0], "AxleLoad_Ax5"), load)
    heat = low_pass((true / (0.2 * load)) ** 2, EFFORT_S, 30.0)
    assert heat.max() > 0.03
    assert column(found, EFFORTS[4]) == pytest.approx((1 + 0.2 * heat) * true, abs=150.0)


def test_errors_of_the_speed(plain):
    true, t = column(plain[0], "VehicleSpeed"), times(plain[0], "VehicleSpeed")
    bend = curvature(plain[0], "VehicleSpeed")
    for effect, wanted, within in (
        (active("speed_error", 0.02, 1.5, form="step"), true * (1 + 0.02 * (t >= 1.5)), 0.0031),
        (
            active("speed_error", 0.1, form="pitch"),
            true * (1 + 0.1 * total_effort(plain[0]) / (6 * LOAD)),
            0.02,  # efforts are sent at other times than the speed
        ),
        (active("speed_error", 2.0, form="offset"), true * (1 + 2.0 * bend), 0.05),
        (active("speed_error", -2.0, form="curvature"), true * (1 - 2.0 * np.abs(bend)), 0.05),
    ):
        found = column(signals(effect)[0], "VehicleSpeed")
        assert np.abs(found - true).max() > 0.05
        assert found == pytest.approx(wanted, abs=within)


def test_a_speed_behind_a_low_pass(plain):
    true = column(plain[0], "VehicleSpeed")
    found = column(signals(active("speed_error", 0.5, form="low_pass"))[0], "VehicleSpeed")
    wanted = true[0] + low_pass(true - true[0], SPEED_S, 0.5)
    assert np.abs(found - true).max() > 0.02
    assert found == pytest.approx(wanted, abs=0.012)


def test_resistance_of_curves_by_roeckl(plain):
    found, _ = signals(active("curving_resistance", 2.0))
    true, bend = column(plain[0], EFFORTS[0]), np.abs(curvature(plain[0], EFFORTS[0]))
    tight = bend > 1 / 310
    assert tight.sum() > 50
    loads = times(plain[0], "AxleLoad_Ax1"), column(plain[0], "AxleLoad_Ax1")
    share = (column(found, EFFORTS[0]) - true) / np.interp(times(plain[0], EFFORTS[0]), *loads)
    wanted = 2.0 * 650.0 / (300.0 - 55.0) / 1000.0
    assert np.median(share[tight]) == pytest.approx(wanted, rel=0.05)


@pytest.mark.slow
def test_a_blended_brake_hides_a_share_of_braking_alone():
    plain, _ = signals(duration=16.0)
    true = column(plain, EFFORTS[0])
    found, _ = signals(active("brake_blending", 0.3), duration=16.0)
    share = np.where(true < -50.0, 0.7, 1.0)
    assert column(found, EFFORTS[0]) == pytest.approx(share * true, abs=20.0)
    assert true.min() < -5e4
    found, _ = signals(active("brake_blending", 0.3, 20.0, form="fade"), duration=16.0)
    known = times(plain, "VehicleSpeed"), column(plain, "VehicleSpeed")
    speed = np.interp(times(plain, EFFORTS[0]), *known)
    share = np.where(true < -50.0, 1 - 0.3 * (1 - speed / 20.0), 1.0)
    assert column(found, EFFORTS[0]) == pytest.approx(share * true, abs=60.0)


def test_an_eccentric_pole_wheel_swings_once_a_turn(plain):
    name = "WheelSpeed_Ax3"
    found, _ = signals(active("wheel_once_per_turn", 0.01, 0.7, 3.0))
    true = column(plain[0], name)
    angle = np.concatenate([[0.0], np.cumsum((true[1:] + true[:-1]) / 2 * 0.01)])
    wanted = true * (1 + 0.01 * np.sin(angle + 0.7))
    assert angle[-1] > 8 * math.pi
    assert column(found, name) == pytest.approx(wanted, abs=0.01)
    other = "WheelSpeed_Ax2"
    assert column(found, other).tolist() == column(plain[0], other).tolist()


def test_loads_as_read_stay_where_true_ones_move():
    found, _ = signals(active("load_transfer", 1.5))
    for axle in range(1, 7):
        assert column(found, f"AxleLoad_Ax{axle}") == pytest.approx(LOAD, abs=10.1)


@pytest.mark.costly
@pytest.mark.parametrize(
    "effect",
    [
        active("load_transfer", 1.0, form="geometry"),
        active("effort_gain", 0.1, 2.0, form="axle"),
        active("effort_gain", 0.2, 30.0, form="heat"),
        active("speed_error", 0.02, 1.5, form="step"),
        active("speed_error", 0.1, form="pitch"),
        active("speed_error", 2.0, form="offset"),
        active("speed_error", 0.3, form="low_pass"),
        active("curving_resistance", 3.0),
        active("brake_blending", 0.3),
        active("wheel_once_per_turn", 0.01, 0.7, 3.0),
    ],
    ids=lambda one: f"{one.effect.id}:{one.effect.form}",
)
def test_samples_lose_the_error(effect):
    """The drive uses the true state: without the effect it is the same drive."""

    def samples(frames, *model):
        config = load_configuration()
        if model:
            config = replace(config, model=ExtendedModel((0.4, 60.0, 0.3), effects=model))
        return extract_samples([Block.from_frames(frames)], config, "simulated")[0]

    duration = 14.0 if effect.effect.id == "brake_blending" else 6.0
    _, true = signals(duration=duration)
    _, wrong = signals(effect, duration=duration)
    whole, read, corrected = samples(true), samples(wrong), samples(wrong, effect)
    assert len(corrected) > 0.98 * len(whole)

    def misfit(other):
        keys = {(t, a): k for k, (t, a) in enumerate(zip(whole.t_us, whole.axle, strict=True))}
        rows = [
            (keys[t, a], k)
            for k, (t, a) in enumerate(zip(other.t_us, other.axle, strict=True))
            if (t, a) in keys
        ]
        mine, theirs = np.array(rows).T
        slip = other.slip[theirs] - whole.slip[mine]
        adhesion = other.adhesion[theirs] - whole.adhesion[mine]
        # The slip as 60 times steeper a quantity: the slope of the curve.
        return float(np.sqrt(np.mean((60.0 * 0.4 * slip) ** 2 + adhesion**2)))

    # The rate of a speed that comes one by one is known a second late.
    left = 0.35 if effect.effect.form == "low_pass" else 0.2
    assert misfit(corrected) < left * misfit(read)
    assert Locomotive().axles == len(np.unique(corrected.axle))
