"""A lag that only averages noise of the slip, and one that a contact has."""

import numpy as np
import pytest

from adhesion_can.api.diagnosis import diagnose
from tests.diagnosis.diagnosis_helpers import burckhardt, write_table

STEP_S, SPEED = 0.02, 15.0


def table(path, seed, *, length=0.0, slip_noise=0.0):
    """Sweeps of creep over a contact that follows its slip over a length, m; slips with noise."""
    rng = np.random.default_rng(seed)
    t = np.arange(4000) * STEP_S
    slip = 0.04 * np.sin(2 * np.pi * t / 0.9) * (1 + 0.5 * np.sin(t / 3.0))
    felt = slip.copy()
    if length:
        gone = 1.0 - np.exp(-SPEED * STEP_S / 50 / length)
        state, felt = slip[0], np.empty_like(slip)
        for k, wanted in enumerate(slip):
            for part in np.linspace(slip[max(k - 1, 0)], wanted, 50):
                state += gone * (part - state)
            felt[k] = state
    columns = {
        "time_s": t,
        "slip": slip + slip_noise * rng.standard_normal(len(t)),
        "adhesion": burckhardt(felt) + 0.01 * rng.standard_normal(len(t)),
        "speed_mps": np.full(len(t), SPEED),
    }
    return write_table(path, columns)


@pytest.mark.costly
@pytest.mark.parametrize("seed", range(4))
def test_noise_of_the_slip_is_no_relaxation(tmp_path, seed):
    found = diagnose(table(tmp_path / "t.csv", seed, slip_noise=0.002))
    assert "creep_relaxation" not in {cause.effect for cause in found.causes}


@pytest.mark.slow
@pytest.mark.long
def test_a_contact_that_lags_is_named(tmp_path):
    """Three of four drives, with noise of the slip besides."""
    lengths = []
    for seed in range(4):
        found = diagnose(table(tmp_path / "t.csv", seed, length=0.8, slip_noise=0.0005))
        lengths += [
            cause.parameters[0].value
            for cause in found.causes
            if cause.effect == "creep_relaxation"
        ]
    assert len(lengths) >= 3
    assert np.median(lengths) == pytest.approx(0.8, rel=0.15)


def delayed(path, seed, noise):
    """Table whose adhesion is 0.6 cycles late: a sender may hold it for half a cycle unknown."""
    rng = np.random.default_rng(seed)
    t = np.arange(3000) * STEP_S
    slip = 0.04 * np.sin(2 * np.pi * t / 2.1) * (1 + 0.5 * np.sin(t / 3.0))
    late = burckhardt(np.interp(t - 0.6 * STEP_S, t, slip))
    columns = {
        "time_s": t,
        "slip": slip,
        "adhesion": late + noise * rng.standard_normal(len(t)),
        "speed_mps": 12.0 + 4.0 * np.sin(t / 5.0),
    }
    return write_table(path, columns)


@pytest.mark.slow
@pytest.mark.parametrize("seeds", [range(2), range(2, 6)])
def test_a_delay_has_to_be_longer_than_half_a_cycle_for_certain(tmp_path, seeds):
    delays = {"effort_delay", "wheel_speed_delay", "speed_delay"}
    for seed in seeds:
        clear = diagnose(delayed(tmp_path / "t.csv", seed, 0.005))
        assert [cause.effect for cause in clear.causes] == ["effort_delay"]
        noisy = diagnose(delayed(tmp_path / "t.csv", seed, 0.04))
        named = [cause.parameters[0] for cause in noisy.causes if cause.effect in delays]
        assert all(one.value - 1.96 * one.std >= 0.5 * STEP_S for one in named)
