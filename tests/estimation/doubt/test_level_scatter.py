"""Levels that alternate along the rail, about an estimate that knows their mean."""

from collections import deque
from dataclasses import replace

import numpy as np
import pytest

from adhesion_can.estimation.doubt.level_scatter import LevelScatter, _Level, _scatter
from adhesion_can.physics.estimate import Estimate, Identifiable
from adhesion_can.physics.samples import Samples
from tests.estimation.doubt.doubt_helpers import AXLES, NOISE, THETA, curve, in_seconds

SEEDS = range(5)
LAMBDA_M = float(np.log(THETA[0] * THETA[1] / THETA[2]) / THETA[1])
MU_MAX = float(curve(np.array([LAMBDA_M]))[0])


def drive(seed, seconds, *, amplitude=0.0, period_s=2.5, change_s=None):
    """Samples near the peak, and the level of the rail under them.

    Args:
        seed: Seed of noise and phase.
        seconds: Duration, s.
        amplitude: Amplitude of the level, as a share of the adhesion.
        period_s: Time from joint to joint, s.
        change_s: Time of a single change of the surface to 0.6 of its level, s.

    """
    rng = np.random.default_rng(seed)
    t = np.repeat(np.arange(round(50 * seconds)) / 50, AXLES)
    axle = np.tile(np.arange(1, AXLES + 1), len(t) // AXLES)
    slip = 0.01 + 0.14 * np.sin(2 * np.pi * t / 7.3 + axle) ** 2
    phase = rng.uniform(0.0, 2 * np.pi)
    level = 1.0 + amplitude * np.sin(2 * np.pi * t / period_s + phase)
    if change_s is not None:
        level = np.where(t < change_s, level, 0.6)
    adhesion = level * curve(slip) + NOISE * rng.standard_normal(len(t))
    stamps = np.round(t * 1e6).astype(np.int64)
    samples = Samples.curve(slip, adhesion, stamps)
    return samples.with_variances(0.0 * t, 0.0 * t, 0.0 * t + NOISE**2), t, level


def fixed_estimate():
    """An estimate of the mean curve."""
    return Estimate(
        *THETA,
        covariance=np.diag([1e-6, 1.0, 1e-6]),
        mu_max=MU_MAX,
        mu_max_std=0.001 * MU_MAX,
        lambda_m=LAMBDA_M,
        lambda_m_std=0.01 * LAMBDA_M,
        noise_std=NOISE,
        samples=10_000,
        identifiable=Identifiable(mu_max=True, lambda_m=True),
        surface_since_us=0,
    )


def scatter(samples):
    """Scatter about a fixed estimate, of the mean curve."""
    found = LevelScatter(0.5)
    for part in in_seconds(samples, 0.1):
        found.add(part, fixed_estimate())
    return found.std


@pytest.mark.parametrize("seed", SEEDS)
def test_a_steady_rail_has_none(seed):
    assert scatter(drive(seed, 30.0)[0]) == 0.0


@pytest.mark.parametrize("amplitude", [0.05, 0.18])
def test_its_size_is_that_of_the_level(amplitude):
    found = [scatter(drive(seed, 30.0, amplitude=amplitude)[0]) for seed in SEEDS]
    # Root mean square of a sine, less what the means over 0.5 s and the trimming take.
    assert np.mean(found) == pytest.approx(amplitude / np.sqrt(2.0), rel=0.15)


def test_one_change_of_the_surface_is_no_scatter():
    before, t, _ = drive(1, 20.0, change_s=19.3)
    assert t[-1] > 19.3
    assert scatter(before) == 0.0


def level_of(samples, **changes):
    """Scatter of twenty windows, all of them the same samples, about the estimate of `scatter`."""
    estimate = replace(fixed_estimate(), **changes)
    found = LevelScatter(0.5)
    for k in range(21):
        stamps = (k * 600_000 + np.linspace(0, 500_000, len(samples))).astype(np.int64)
        found.add(replace(samples, t_us=stamps), estimate)
    return found.std


def half_second(slip, factor, n=40, **variances):
    """Samples at one slip of either sign, whose adhesion is a factor of the curve's."""
    signs = np.where(np.arange(n) % 2, 1.0, -1.0)
    found = Samples.curve(signs * slip, factor * curve(signs * slip))
    full = {name: np.full(n, value) for name, value in variances.items()}
    return replace(found, adhesion_var=np.full(n, NOISE**2), **full)


def test_a_level_that_is_off_by_a_share_scatters_by_it_on_either_side_of_the_slip():
    """Less what the noise and the estimate itself may be off by, in squares."""
    found = level_of(half_second(LAMBDA_M, 1.1))
    noise = (NOISE / MU_MAX) ** 2 / 40
    assert found == pytest.approx(np.sqrt(0.01 - noise - 0.001**2), rel=1e-3)
    beyond = level_of(half_second(2.0 * LAMBDA_M, 0.9))
    level = float(curve(np.array([2.0 * LAMBDA_M]))[0])
    assert beyond == pytest.approx(np.sqrt(0.01 - (NOISE / level) ** 2 / 40 - 0.001**2), rel=1e-3)


def test_errors_of_slip_and_load_are_noise_of_a_window():
    """Variances add up: with a slope s of the curve an error of the slip is one of s times it."""
    c1, c2, c3 = THETA
    slip = 1.6 * LAMBDA_M
    slope = c1 * c2 * np.exp(-c2 * slip) - c3
    level = float(curve(np.array([slip]))[0])
    found = level_of(
        half_second(slip, 1.1, slip_var=1e-4, slip_common_var=3e-4, transient_var=2e-4)
    )
    noise = (NOISE**2 + 2e-4 + slope**2 * 4e-4) / level**2 / 40
    assert found == pytest.approx(np.sqrt(0.01 - noise - 0.001**2), rel=1e-3)
    # Up to four times what chance makes of it is chance.
    assert level_of(half_second(LAMBDA_M, 1.01), mu_max_std=0.0051 * MU_MAX) == 0.0
    assert level_of(half_second(LAMBDA_M, 1.01), mu_max_std=0.0020 * MU_MAX) > 0.0


def test_only_the_flat_part_of_the_curve_has_the_level_of_the_peak():
    """A logarithmic slope of at most 0.3, on either side of the peak; and 20 samples of it."""
    c1, c2, c3 = THETA
    for slip in np.linspace(0.002, 0.3, 40):
        slope = (c1 * c2 * np.exp(-c2 * slip) - c3) * slip / float(curve(np.array([slip]))[0])
        if abs(abs(slope) - 0.3) > 0.02:
            seen = level_of(half_second(slip, 1.3)) > 0.0
            assert seen == (abs(slope) < 0.3), slip
    assert level_of(half_second(LAMBDA_M, 1.1, n=19)) == 0.0
    assert level_of(half_second(LAMBDA_M, 1.1, n=20)) > 0.0
    unknown = Identifiable(mu_max=False, lambda_m=True)
    assert level_of(half_second(LAMBDA_M, 1.1), identifiable=unknown) == 0.0


@pytest.mark.parametrize(("levels", "std"), [(11, 0.0), (12, 0.1)])
def test_from_twelve_levels_on_their_scatter_counts(levels, std):
    """A tenth each, beside noise that hardly counts."""
    found = _scatter(deque([_Level(0.01, 3e-7, 2e-7)] * levels))
    assert found == pytest.approx(std, rel=1e-4)
