"""How far a recording's samples lie from the curve, without and with the effects of a model."""

from dataclasses import replace

import numpy as np
import pytest

from adhesion_can.config import load_configuration
from adhesion_can.estimation.extended.model import ExtendedModel
from adhesion_can.offline.fit_errors import MisfitCollector
from adhesion_can.physics.effects import ActiveEffect, effect_by_id
from adhesion_can.physics.samples import Samples

CONFIG = load_configuration()
BASE = (0.4, 60.0, 0.3)
NOISE = 0.01


def mu(slip, c1=0.4, c2=60.0, c3=0.3):
    size = np.abs(slip)
    return np.sign(slip) * (c1 * (1 - np.exp(-c2 * size)) - c3 * size)


def by_speed(v):
    """Curtius and Kniffler, by hand."""
    return (7.5 / (3.6 * v + 44) + 0.161) / (7.5 / 44 + 0.161)


def drive(seconds=60.0, curve=mu, slip_noise=0.0, seed=1):
    """Six axles at 100 Hz that sweep their slips, 0.13 s behind one another."""
    rng = np.random.default_rng(seed)
    t_us = np.repeat(np.arange(round(seconds * 100)) * 10_000, 6)
    axle = np.tile(np.arange(1, 7), len(t_us) // 6)
    t = t_us / 1e6 - 0.13 * axle
    slip = 0.06 + 0.06 * np.sin(2 * np.pi * t / 7.0)
    speed = 12 + 6 * np.sin(2 * np.pi * t_us / 1e6 / 31.0)
    adhesion = curve(slip) if curve is mu else curve(slip, speed, t_us / 1e6)
    samples = Samples.curve(
        slip + slip_noise * rng.standard_normal(len(slip)),
        adhesion + NOISE * rng.standard_normal(len(slip)),
        t_us,
    )
    return replace(samples, axle=axle, speed=speed, load=np.full(len(slip), 245e3))


def told(samples, model=None, step=12, **how):
    fit = MisfitCollector(replace(CONFIG, model=model), **how)
    for row in range(0, len(samples), step):
        fit.add(samples.select(slice(row, row + step)))
    return fit.compute()


def of(name, *values):
    return ExtendedModel(BASE, effects=(ActiveEffect(effect_by_id(name), values),))


def test_on_one_rail_the_noise_is_left():
    samples = drive()
    result = told(samples)
    assert result.rmse == pytest.approx(NOISE, rel=0.02)
    assert (result.samples, result.segments) == (len(samples), 1)


def test_a_model_takes_its_effect_away_and_the_figure_stays_in_measured_adhesion():
    """In points of the base curve, which are divided by the factor, the noise would be larger."""
    samples = drive(curve=lambda slip, v, _: mu(slip) * by_speed(v))
    plain, model = told(samples), told(samples, of("speed_dependence", 1.0))
    assert by_speed(samples.speed).mean() < 0.8
    assert plain.rmse > 1.8 * NOISE
    assert model.rmse == pytest.approx(NOISE, rel=0.02)
    effect = mu(samples.slip) * by_speed(samples.speed)
    shape = mu(samples.slip)
    alone = effect - shape * (effect @ shape) / (shape @ shape)
    missed = np.sqrt(np.mean(alone**2))
    assert np.sqrt(plain.rmse**2 - model.rmse**2) == pytest.approx(missed, rel=0.03)


def test_a_usual_factor_far_from_1_takes_no_sample_away():
    """A power law whose reference is 100 kN leaves a fifteenth at 245 kN."""
    effect = ActiveEffect(effect_by_id("load_dependence", "power"), (3.0,))
    result = told(drive(), ExtendedModel(BASE, effects=(effect,)))
    assert result.rmse == pytest.approx(NOISE, rel=0.02)
    assert result.samples == told(drive()).samples


def test_what_is_a_matter_of_time_alone_counts_here():
    """The estimator leaves a slow drift out of the model, since it follows it itself."""
    samples = drive(curve=lambda slip, _, t: mu(slip) * (1 - 0.004 * t))
    plain, model = told(samples), told(samples, of("slow_drift", -0.004))
    assert plain.rmse > 1.5 * NOISE
    assert model.rmse == pytest.approx(NOISE, rel=0.02)


def test_each_rail_has_its_curve_and_the_passage_is_left_out():
    def two(slip, _, t):
        return np.where(t < 33.0, mu(slip), mu(slip, 0.1, 25.0, 0.1))

    samples = drive(curve=two)
    # The last axle finds the change a second after the first.
    late = (samples.axle == 6) & (samples.t_us > 33_000_000) & (samples.t_us < 34_000_000)
    adhesion = np.where(late, mu(samples.slip), samples.adhesion)
    result = told(replace(samples, adhesion=adhesion))
    assert result.segments == 2
    assert result.rmse == pytest.approx(NOISE, rel=0.03)
    assert len(samples) - 2600 < result.samples < len(samples) - 2000


def test_noise_of_the_slip_on_the_steep_branch_is_not_the_curves_fault():
    samples = drive(slip_noise=0.001)
    smooth, raw = told(samples).rmse, np.std(samples.adhesion - mu(samples.slip))
    assert raw > 1.15 * NOISE
    assert smooth < 1.05 * NOISE


def test_gaps_and_axles_are_not_smoothed_over():
    samples = drive()
    t_s = samples.t_us / 1e6
    gap = samples.select((t_s % 3.0 > 1.0) & ((samples.axle != 3) | (t_s % 2.0 > 0.7)))
    assert told(gap).rmse == pytest.approx(NOISE, rel=0.03)


def test_pieces_of_any_size_tell_the_same():
    samples = drive(20.0)
    model = of("adhesion_recovery", 4e-7, 3.0)
    small, large = told(samples, model, step=6), told(samples, model, step=5000)
    assert small.rmse == pytest.approx(large.rmse, rel=1e-9)
    assert small._replace(rmse=large.rmse) == large


def test_a_long_recording_is_told_by_a_part_of_its_seconds():
    whole, part = told(drive(90.0)), told(drive(90.0), most=12_000)
    assert 6_000 < part.samples <= 12_000 < whole.samples
    assert part.rmse == pytest.approx(whole.rmse, rel=0.03)


def test_samples_without_the_channel_of_an_effect_are_left_out():
    samples = drive()
    moist = replace(samples, covariates={"relative_humidity_percent": np.full(len(samples), 70.0)})
    half = len(samples) // 2 // 12 * 12
    fit = MisfitCollector(replace(CONFIG, model=of("humidity", -0.003)))
    for row in range(0, len(samples), 12):
        fit.add((samples if row < half else moist).select(slice(row, row + 12)))
    result = fit.compute()
    assert result.samples == len(samples) - half
    assert result.rmse == pytest.approx(NOISE, rel=0.03)


@pytest.mark.parametrize("rows", [0, 1, 199])
def test_too_few_samples_tell_nothing(rows):
    samples = drive(1.0).select(slice(0, rows))
    assert told(samples) is None


def test_samples_that_are_no_points_of_a_curve_change_nothing():
    samples = drive()
    slip, adhesion = samples.slip.copy(), samples.adhesion.copy()
    slip[::100], adhesion[50::100] = 0.9, np.nan
    slip[7] = np.nan
    result = told(replace(samples, slip=slip, adhesion=adhesion))
    assert result.rmse == pytest.approx(NOISE, rel=0.03)
    assert result.samples == len(samples) - 2 * len(samples) // 100 - 1
