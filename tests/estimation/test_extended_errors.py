"""Extended models: what remains of the samples' errors, and samples of which little is left."""

from dataclasses import replace

import numpy as np
import pytest

from adhesion_can.estimation.extended.correction import correct_samples, remove_effects
from adhesion_can.estimation.extended.current_curve import LatestLagStates
from adhesion_can.estimation.extended.estimator import ExtendedEstimator
from adhesion_can.estimation.extended.model import ExtendedModel
from adhesion_can.estimation.extended.slip_lags import SlipLags, noise_gain
from adhesion_can.physics.effects import ActiveEffect, LagStates, effect_by_id
from adhesion_can.physics.samples import Samples
from tests.estimation.test_extended import BASE, HEIGHT, Fixed, World, followed, model_of, rail

EXPONENT, USUAL_LOAD, REFERENCE = 3.0, 250e3, 100e3


def loaded_world():
    """Adhesion that falls with the third power of the load, at an ordinary level."""
    w = World()
    factor = (w.load / USUAL_LOAD) ** -EXPONENT
    return w, factor * rail(w.slip), factor


def model_at_reference():
    """The same in the terms of the effect, whose reference is a load of 100 kN."""
    c1, c2, c3 = BASE
    high = (USUAL_LOAD / REFERENCE) ** EXPONENT
    active = ActiveEffect(effect_by_id("load_dependence", "power"), (EXPONENT,))
    return ExtendedModel((high * c1, c2, high * c3), effects=(active,))


def test_a_reference_far_from_all_loads_takes_no_sample_away():
    w, adhesion, factor = loaded_world()
    now, _, estimator = followed(w.batches(adhesion), model_at_reference())
    assert not estimator.left_out
    assert now.identifiable.both
    assert now.mu_max == pytest.approx(HEIGHT * factor[-1].mean(), rel=0.007)
    for axle in range(1, 7):
        expected = HEIGHT * factor[-1, axle - 1]
        assert now.per_axle[axle][0] == pytest.approx(expected, rel=0.01)


def test_a_batch_keeps_the_base_curve_at_the_reference():
    w, adhesion, factor = loaded_world()
    whole = w.whole(adhesion)
    result = correct_samples(whole, model_at_reference(), 6)
    assert result.kept.all()
    high = (USUAL_LOAD / REFERENCE) ** EXPONENT
    np.testing.assert_allclose(result.samples.adhesion, whole.adhesion / factor.ravel() * high)


def in_curve(curvature, slip):
    """Estimate after a drive with a curvature and a slip for each update; a fixed base curve."""
    w = World(seconds=0.1 * len(slip))
    w.curvature = np.repeat(np.asarray(curvature, dtype=float), 10)
    w.slip = np.repeat(np.asarray(slip, dtype=float), 10)[:, None] * np.ones(6)
    estimator = ExtendedEstimator(Fixed(), model_of("curve_creep"))
    return [
        estimator.update(s, int(s.t_us[-1])) for s in w.batches(np.zeros_like(w.slip))
    ], estimator


def test_the_peak_follows_a_curve_in_which_the_wheels_coast():
    estimates, estimator = in_curve([0.0] * 5 + [0.02] * 5, [0.05] * 5 + [0.0] * 5)
    # No sample of the curve says anything of the base curve, and all say where the train is.
    assert sum(estimator.left_out.values()) == 5 * 10 * 6
    grid = np.linspace(1e-4, 0.5, 100_000)
    whole = np.hypot(grid, 3.0 * 0.02)
    curve = rail(whole) * grid / whole
    assert estimates[-1].mu_max == pytest.approx(curve.max(), rel=2e-3)
    assert estimates[-1].lambda_m == pytest.approx(grid[curve.argmax()], rel=0.03)
    assert estimates[4].mu_max == pytest.approx(HEIGHT, rel=1e-3)


@pytest.mark.parametrize("exponent", [0.02, 0.3, 2.0, 20.0])
def test_noise_that_a_lag_leaves(exponent):
    n, dt = 100_000, 0.01
    noise = np.random.default_rng(1).standard_normal(n)
    lags = LagStates()
    left = lags.follow("x", np.ones(n), dt * np.arange(n), noise, exponent / dt)
    # A variance of n/(2/E) independent values: four standard errors.
    rel = 4 * np.sqrt(2 / (n * min(exponent / 2, 1)))
    assert left.var() == pytest.approx(float(noise_gain(np.array(exponent))), rel=rel)


def relaxed(rng, seconds, length=0.7, speed=10.0, wheel=0.0003, vehicle=0.001):
    """(what is left of samples of zero slip behind a relaxing contact, as an update each 20 ms)."""
    frames = round(seconds / 0.02)
    error = speed * vehicle * rng.standard_normal(frames + 1)
    active = ActiveEffect(effect_by_id("creep_relaxation"), (length,))
    w = World(seconds=0.02 * frames)
    w.v = np.full(len(w.t), speed)
    w.slip = np.zeros_like(w.slip)
    whole = w.whole(np.zeros_like(w.slip))
    place = np.repeat(np.arange(2 * frames), 6)
    share = 0.5 * (place % 2)
    of_speed = (1 - share) * error[place // 2] + share * error[place // 2 + 1]
    measured = speed + of_speed
    rim = speed * (1.0 + wheel * rng.standard_normal(len(whole)))
    whole = replace(
        whole,
        slip=rim / measured - 1.0,
        speed=measured,
        slip_var=np.full(len(whole), wheel**2),
        slip_common_var=np.full(len(whole), vehicle**2),
        speed_us=(place // 2 + 1) * 20_000,
    )
    lags = LatestLagStates()
    parts = [
        remove_effects(whole.select(slice(k, k + 12)), (active,), 0, 6, lags).samples
        for k in range(0, len(whole), 12)
    ]
    return [part for part in parts if part.t_us[0] > 1_000_000]


@pytest.mark.costly
def test_behind_a_relaxing_contact_variances_are_those_of_the_smoothed_slip():
    # 3 s of errors that last 0.07 s: 20 % in one run; four standard errors of 40.
    left, stated, across = [], [], []
    for seed in range(40):
        parts = relaxed(np.random.default_rng(seed), 4.0)
        slip = np.stack([part.slip.reshape(2, 6).mean(axis=1) for part in parts]).ravel()
        own = np.stack([part.slip.reshape(2, 6) for part in parts]).reshape(-1, 6)
        left.append(np.mean(slip**2))
        stated.append(parts[-1].slip_common_var[0] + parts[-1].slip_var[0] / 6)
        across.append(np.mean(own.var(axis=1, ddof=1)) / parts[-1].slip_var[0])
    assert np.mean(left) / np.mean(stated) == pytest.approx(1.0, abs=0.15)
    assert np.mean(across) == pytest.approx(1.0, abs=0.1)


def test_behind_a_relaxing_contact_the_slip_knows_nothing_of_the_speeds_rate():
    """Where it did, the error of the speed looked like a delay of it: a doubt of a right model."""
    together = []
    for seed in range(20):
        parts = relaxed(np.random.default_rng(seed), 4.0)
        slip = np.concatenate([part.slip[::6] for part in parts])
        speed = np.concatenate([part.speed[::6] for part in parts])
        together.append(np.corrcoef(slip[2:-2], speed[4:] - speed[:-4])[0, 1])
    assert abs(np.mean(together)) < 0.05


def test_a_slip_that_takes_a_share_of_the_adhesion_brings_its_error_into_it():
    rng = np.random.default_rng(2)
    n, std, lateral = 4000, 0.001, 3.0 * 0.01
    w = World(seconds=1.0)
    one = next(iter(w.batches(np.zeros_like(w.slip)))).select(slice(0, 1))
    whole = one.select(np.zeros(n, dtype=np.int64))
    slip = rng.uniform(0.012, 0.06, n)
    true = np.hypot(slip, lateral)
    noise = 0.002
    whole = replace(
        whole,
        slip=slip + std * rng.standard_normal(n),
        adhesion=rail(true) * slip / true + noise * rng.standard_normal(n),
        slip_var=np.full(n, std**2),
        adhesion_var=np.full(n, noise**2),
        covariates={"curvature_per_m": np.full(n, 0.01)},
    )
    left = correct_samples(whole, model_of("curve_creep"), 6).samples
    slope = BASE[0] * BASE[1] * np.exp(-BASE[1] * left.slip) - BASE[2]
    var = noise**2 + left.transient_var + slope**2 * left.slip_var
    score = (left.adhesion - rail(left.slip)) ** 2 / var
    # The two errors of one slip go together here, and their sum is more than the variances say.
    assert 0.8 < score.mean() < 2.0
    assert (left.slip_var < 0.85 * std**2).any()


def test_lags_of_other_quantities_leave_the_errors_alone():
    lags = SlipLags()
    w = World(seconds=1.0)
    samples = next(iter(w.batches(np.zeros_like(w.slip))))
    lags.watch(samples.slip)
    lags.follow("work", samples.axle.astype(float), samples.t_us * 1e-6, samples.load, 0.3, 0.0)
    assert lags.smooth_errors(samples, samples.t_us * 1e-6) is samples


class Recorded:
    """An estimator that keeps what it was given."""

    def __init__(self):
        self.given = []

    def update(self, samples, now_us):
        self.given.append(samples)


def test_samples_around_a_step_of_a_signal_may_belong_to_either_of_its_values():
    """Six samples with the wrong value would outweigh the drive before: a false change."""
    w = World(seconds=2.0)
    w.sand = np.where(w.t >= 1.0, 1.0, 0.0)
    inner = Recorded()
    estimator = ExtendedEstimator(inner, model_of("sanding"))
    whole = w.whole(0.3 + 0.0 * w.slip)
    for k in range(0, len(whole), 12):
        estimator.update(whole.select(slice(k, k + 12)), 20_000 * k)
    given = Samples.concatenate(inner.given)
    at = given.t_us - 1_000_000
    near = (at >= 0) & (at <= 40_000)
    # With or without the gain of 0.2.
    assert (np.sqrt(given.transient_var[near]) > 0.15 * 0.25).all()
    assert given.transient_var[~near & (np.abs(at) > 80_000)].max() < 0.001**2
