"""What the ramps of a relief show, on curves that are no hyperbola, and how slips move along it."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from adhesion_can.estimation.observed_speed.hyperbola import STEEPEST, elasticity, move
from adhesion_can.estimation.observed_speed.ramp_fit import RampSamples, fit_ramps
from tests.estimation.observed_speed.straight_drive import StraightDrive
from tests.worlds.track_without_radar import SURFACES, RailUnderAxles

SPEED, STEP_S = 15.0, 0.01
GRID = np.geomspace(1e-5, 0.2, 3000)


def curve(surface):
    """Adhesion on the rising part of a curve of Polach's, and its slips."""
    p = SURFACES[surface]
    values = (p["kA"], p["kS"], p["mu0"], p["A"], p["B"], 1.0, 0.0)
    rail = RailUnderAxles(*(np.array(one) for one in values))
    used = rail.adhesion(GRID * SPEED, np.array(SPEED))
    top = used.argmax()
    return used[: top + 1], GRID[: top + 1]


def relief(rising, use, seed, noise=0.01):
    """Samples of six axles around a relief of the second one, and the slip that they hold."""
    rng = np.random.default_rng(seed)
    used, slips = rising
    share = np.interp(
        np.arange(0.0, 2.0, STEP_S), (0.0, 0.5, 0.65, 1.5, 1.65, 2.0), (1, 1, 0, 0, 1, 1)
    )
    shares = np.ones((len(share), 6))
    shares[:, 1] = share
    true = use * used[-1] * shares
    slip = np.interp(true, np.r_[0.0, used], np.r_[0.0, slips])
    log_rim = np.log(SPEED * (1 + slip)) + rng.normal(0, 0.003 * 0.625 / SPEED, slip.shape)
    log_rim = log_rim + rng.normal(0, 0.002, 6)
    adhesion = true + rng.normal(0, noise, true.shape)
    held = float(slip[0, 0])
    return RampSamples(log_rim, adhesion, [0, 2, 3, 4, 5], np.full(6, held)), held


@pytest.mark.parametrize("surface", SURFACES)
def test_the_ramps_predict_the_slip_at_smaller_efforts(surface):
    used, slips = curve(surface)
    for part in (0.9, 0.75, 0.5):
        true = np.interp(0.85 * part * used[-1], used, slips)
        errors = []
        for seed in range(12):
            samples, held = relief(curve(surface), 0.85, seed)
            found = fit_ramps(samples, 1, 0.01)
            assert found is not None, seed
            shown = move(np.array(held), np.array(found.log_half), np.array(part)).slip
            errors.append((shown - true) / (held - true))
        # Polach's curves are steeper at the end than the hyperbola that fits all of the ramp.
        assert np.sqrt(np.mean(np.square(errors))) < 0.35, part


@pytest.mark.parametrize("half", [0.001, 0.0015, 0.004])
def test_the_slip_of_half_the_asymptote_is_found(half):
    rising = 0.25 * GRID / (half + GRID), GRID
    errors = []
    for seed in range(8):
        found = fit_ramps(relief(rising, 0.75, seed)[0], 1, 0.01)
        errors.append(found.log_half - np.log(half))
    assert abs(np.mean(errors)) < 0.3
    assert np.std(errors) < 0.4


def test_the_variance_covers_the_scatter_by_noise_of_the_efforts():
    found = [fit_ramps(relief(curve("wet"), 0.8, seed)[0], 1, 0.01) for seed in range(40)]
    values = np.array([one.log_half for one in found])
    std = np.sqrt(np.mean([one.variance for one in found]))
    assert 0.3 < np.std(values) / std < 1.2


def test_radii_of_the_wheels_show_no_curve():
    samples, _ = relief(curve("wet"), 0.8, 1)
    shifted = RampSamples(
        samples.log_rim + np.linspace(-0.003, 0.003, 6), samples.adhesion, samples.others,
        samples.slip,
    )  # fmt: skip
    assert fit_ramps(shifted, 1, 0.01).log_half == pytest.approx(
        fit_ramps(samples, 1, 0.01).log_half, abs=1e-6
    )


def test_samples_without_a_relief_show_none():
    samples, _ = relief(curve("dry"), 0.8, 2)
    assert fit_ramps(samples, 0, 0.01) is None
    short = slice(0, 90)
    cut = RampSamples(
        samples.log_rim[short][:30], samples.adhesion[short][:30], samples.others, samples.slip
    )
    assert fit_ramps(cut, 1, 0.01) is None


@given(st.floats(1e-4, 0.02), st.floats(-7.0, -4.0), st.floats(0.5, 1.15))
def test_derivatives_are_those_of_the_slip(slip, log_half, ratio):
    if elasticity(slip * 1.001, log_half - 1e-3) >= STEEPEST - 0.1:
        return
    if 1.0 + (elasticity(slip, log_half) - 1.0) * (1.0 - ratio) < 0.2:
        return
    args = np.array(slip), np.array(log_half), np.array(ratio)
    moved = move(*args)
    by_slip = (move(args[0] * 1.0001, *args[1:]).slip - moved.slip) / (slip * 1e-4)
    by_half = (move(args[0], args[1] + 1e-5, args[2]).slip - moved.slip) / 1e-5
    assert float(moved.by_slip) == pytest.approx(float(by_slip), rel=2e-3)
    assert float(moved.by_log_half) == pytest.approx(float(by_half), rel=2e-3, abs=1e-7)
    if elasticity(moved.slip, args[1]) >= STEEPEST:
        return
    back = move(moved.slip, args[1], 1.0 / args[2])
    assert float(back.slip) == pytest.approx(slip, rel=1e-6)


def test_slips_stay_known_while_the_effort_falls_after_reliefs():
    drive = StraightDrive()
    drive.run(2.0)
    for axle in range(3):
        drive.relieve(axle)
    for _ in range(20):
        drive.adhesion *= 0.975
        drive.slip = 0.006 * (drive.adhesion / 0.12) ** 3
        stated = drive.run(0.2)
    assert drive.adhesion < 0.075
    assert stated.known[0]
    assert np.abs(drive.error(stated)).max() < 0.002
