"""Tables whose slips carry noise: it is estimated, and is no effect and no shape."""

import numpy as np
import pytest

from adhesion_can import diagnose
from adhesion_can.diagnosis.regression.estimate_slip_noise import estimate_slip_noise
from adhesion_can.diagnosis.regression.whitening import ContiguousRuns
from tests.diagnosis.diagnosis_helpers import write_table
from tests.seeds import first_quick

STEP_S = 0.02
SEEDS = range(6)


def true_contact(rows):
    """Slip, adhesion and speed of sweeps in both directions, with coasting between them."""
    time_s = np.arange(rows) * STEP_S
    phase = time_s % 20.0
    braking = -0.10 * np.sin(np.pi * phase / 4.0) ** 2
    traction = 0.05 * np.sin(np.pi * (phase - 8.0) / 6.0) ** 2
    slip = np.where(phase < 8.0, braking, np.where(phase < 14.0, traction, 0.0))
    size = np.abs(slip)
    adhesion = np.sign(slip) * ((1.0 - np.exp(-25.0 * size)) - 0.5 * size)
    speed = 18.0 + 6.0 * np.sin(time_s / 2.3) + 2.0 * np.sin(time_s / 0.7)
    return time_s, slip, adhesion, speed


def slope(slip):
    return 25.0 * np.exp(-25.0 * np.abs(slip)) - 0.5


def runs_of(rows):
    time_s = np.arange(rows) * STEP_S
    return ContiguousRuns.find(time_s, np.ones(rows), np.zeros(rows, dtype=bool))


@pytest.mark.parametrize("std", [3e-4, 1e-3, 3e-3])
def test_the_noise_of_the_slips_is_found(std):
    rows = 9000
    _, slip, adhesion, _ = true_contact(rows)
    for seed in SEEDS:
        rng = np.random.default_rng(seed)
        read = slip + std * rng.standard_normal(rows)
        size = np.abs(read)
        predicted = np.sign(read) * ((1.0 - np.exp(-25.0 * size)) - 0.5 * size)
        residual = adhesion + 0.005 * rng.standard_normal(rows) - predicted
        found = estimate_slip_noise(read, residual, slope(read), runs_of(rows), np.ones(rows, bool))
        assert found == pytest.approx(std, rel=0.12)


def test_exact_slips_have_none_however_quick_they_are():
    rows = 9000
    for seed in SEEDS:
        rng = np.random.default_rng(seed)
        slip = 0.05 * rng.standard_normal(rows)  # no two rows alike, and all of it true
        residual = 0.005 * rng.standard_normal(rows)
        assert not estimate_slip_noise(
            slip, residual, slope(slip), runs_of(rows), np.ones(rows, bool)
        )


def test_differences_do_not_reach_over_a_gap():
    rows = 1200
    time_s = np.arange(rows) * STEP_S + 100.0 * (np.arange(rows) // 3)
    runs = ContiguousRuns.find(time_s, np.ones(rows), np.zeros(rows, dtype=bool))
    noise = np.random.default_rng(1).standard_normal(rows)
    assert not estimate_slip_noise(noise, -noise, np.ones(rows), runs, np.ones(rows, bool))


@pytest.mark.parametrize("seed", first_quick(SEEDS))
def test_noise_of_the_slips_is_no_finding(tmp_path, seed):
    # Taken as exact, these slips left 'unexplained' with a gain of 19 % in every draw.
    time_s, slip, adhesion, speed = true_contact(15_000)
    rng = np.random.default_rng(seed)
    wheel = (1.0 + slip) * speed + 0.01 * rng.standard_normal(15_000)
    vehicle = speed + 0.01 * rng.standard_normal(15_000)
    noisy = adhesion + 0.005 * rng.standard_normal(15_000)
    columns = {
        "time_s": time_s, "slip": wheel / vehicle - 1.0, "adhesion": noisy,
        "speed_mps": vehicle,
    }  # fmt: skip
    found = diagnose(write_table(tmp_path / "table.csv", columns))
    assert found.verdict.value == "nothing_found"
    peak = found.longest_segment.base
    assert peak.mu_max == pytest.approx(0.9016, rel=0.01)
