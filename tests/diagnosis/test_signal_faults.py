"""Saturated efforts and oscillating wheels, from signals made by hand."""

from types import SimpleNamespace

import numpy as np
import pytest

from adhesion_can.diagnosis.inference.signal_faults import (
    find_largest_oscillation,
    find_oscillation,
    find_saturated_sensors,
    find_saturation,
)

N = 20_000


def effort(seed=1, size=3e4):
    """A noisy effort that swings."""
    rng = np.random.default_rng(seed)
    return size * np.sin(np.arange(N) / 700.0) + 500.0 * rng.standard_normal(N)


def test_readings_that_are_cut_off_at_a_limit_are_saturated():
    signal = effort()
    limit, share = find_saturation(np.clip(signal, -2e4, 2e4))
    assert limit == 2e4
    assert share == pytest.approx(np.mean(np.abs(signal) >= 2e4))
    assert find_saturation(np.minimum(signal, 2.5e4)) is None  # braking goes beyond it
    limit, _ = find_saturation(np.clip(signal, -5e4, 2.5e4) + np.where(signal < 0, 9e3, 0.0))
    assert limit == 2.5e4


def test_a_signal_without_a_limit_or_without_noise_is_not():
    signal = effort()
    assert find_saturation(signal) is None
    assert find_saturation(np.zeros(N)) is None
    held = np.clip(np.repeat(signal[::10], 10), -2e4, 2e4)
    assert find_saturation(held) is None  # repeats everywhere: not measured each time


@pytest.mark.parametrize(("count", "saturated"), [(39, False), (40, True), (41, True)])
def test_a_five_hundredth_of_the_readings_must_be_at_the_limit(count, saturated):
    signal = effort()
    rows = np.arange(100, 100 + count)
    signal[rows] = 9e4
    found = find_saturation(signal)
    assert (found is not None) == saturated
    if saturated:
        assert found == (9e4, count / N)


@pytest.mark.parametrize(("rows", "count", "saturated"), [(19, 19, False), (60, 19, False),
                                                          (60, 20, True)])  # fmt: skip
def test_of_few_readings_twenty_must_be(rows, count, saturated):
    signal = effort()[:rows].copy()
    signal[:count] = 9e4
    assert (find_saturation(signal) is not None) == saturated


def recording(table=False, **axles):
    """A drive with an effort for each axle."""
    signals = list(axles.values())
    axle = np.concatenate([np.full(len(one), k + 1) for k, one in enumerate(signals)])
    return SimpleNamespace(name="a.log", table=table, axle=axle, effort=np.concatenate(signals))


def test_saturated_axles_are_named_and_tables_have_no_sensors():
    cut = np.clip(effort(), -2e4, 2e4)
    found = find_saturated_sensors([recording(a=effort(2), b=cut), recording(table=True, a=cut)])
    assert [(one.recording, one.axle, one.effort) for one in found] == [("a.log", 2, 2e4)]


class Wheels:
    """A drive whose wheel speeds, less their motion, are noise and an oscillation."""

    def __init__(self, frequency, amplitude, *, noise=0.01, rate=100.0, runs=(6000, 4000), seed=1):
        rng = np.random.default_rng(seed)
        self.kinematics, self.inertia, self.radius = SimpleNamespace(), 200.0, np.array([0.5, 0.75])
        high_pass = {}
        for axle, length in enumerate(runs, start=1):
            t = np.arange(length) / rate
            fast = noise * rng.standard_normal(length)
            fast = fast + amplitude * np.sin(2 * np.pi * frequency * t + axle)
            high_pass[axle] = [(t, fast)]
        self.kinematics.high_pass = high_pass

    def __len__(self):
        return 10

    def observe(self):
        return SimpleNamespace(load=np.full(10, 2e5))


@pytest.mark.parametrize("frequency", [5.0, 17.3, 40.0])
def test_an_oscillation_is_found_with_its_frequency_and_size(frequency):
    found = find_oscillation(Wheels(frequency, 0.05))
    assert found.frequency == pytest.approx(frequency, abs=0.2)
    assert found.amplitude == pytest.approx(0.05, rel=0.1)
    # Torque J dω/dt over the radius and the load, rms.
    wanted = 200.0 * 2 * np.pi * frequency * 0.05 / np.sqrt(2) / 0.625 / 2e5
    assert found.adhesion == pytest.approx(wanted, rel=0.1)


@pytest.mark.parametrize("drive", [Wheels(9.0, 0.0), Wheels(1.0, 0.05), Wheels(47.0, 0.05),
                                   Wheels(9.0, 0.05, runs=(1023,)), Wheels(9.0, 0.05, runs=()),
                                   Wheels(23.5, 0.05, rate=50.0)])  # fmt: skip
def test_noise_lines_beyond_the_range_and_short_runs_are_none(drive):
    """Below 2.5 Hz a vehicle moves; above 45 Hz, or 0.45 of the rate, nothing is resolved."""
    assert find_oscillation(drive) is None


def test_a_thousand_and_24_readings_are_enough():
    assert find_oscillation(Wheels(9.0, 0.05, runs=(1024,))) is not None
    assert find_oscillation(Wheels(9.0, 0.05, runs=(1023, 5000))).frequency == pytest.approx(
        9.0, abs=0.2
    )


def test_of_several_drives_the_oscillation_that_moves_the_adhesion_most_counts():
    """An inertia has the larger torque at the larger frequency."""
    drives = [Wheels(6.0, 0.05), Wheels(9.0, 0.0), Wheels(30.0, 0.04)]
    assert find_largest_oscillation(drives).frequency == pytest.approx(30.0, abs=0.2)
    assert find_largest_oscillation(drives[1:2]) is None
