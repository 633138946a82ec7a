"""Batch fit of samples whose slips have errors: no bias, and intervals that hold."""

from dataclasses import replace

import numpy as np
import pytest

from adhesion_can.estimation.batch_fit import fit_surface, identify
from adhesion_can.estimation.errors_in_variables import fit_with_errors
from adhesion_can.estimation.likelihood import sum_of_squares
from adhesion_can.estimation.noise.settings import NoiseSettings
from adhesion_can.estimation.variable_projection import fit_least_squares
from adhesion_can.physics.burckhardt import RAIL, peak
from adhesion_can.physics.samples import Samples
from adhesion_can.sampling.equations import Sensors
from tests.tram import DRY, LOW, Tram

SLOW = Tram(speed=4.0)
"""At 4 m/s the errors of the speeds are a slip of 0.005."""
DEFAULTS = Sensors()


def deviations(samples, theta):
    """Errors of (μ_max, λ_m) in their standard deviations."""
    e, true = fit_surface(samples), peak(*theta)
    return [
        float(e.mu_max - true.mu_max) / e.mu_max_std,
        float(e.lambda_m - true.lambda_m) / e.lambda_m_std,
    ]


def contact_points(theta, seed, *, n=6000, slip_std=0.0, shared_std=0.0, adhesion_std=0.01):
    """Points of four axles swept in turn, stamped, with errors of stated variances."""
    rng = np.random.default_rng(seed)
    step, axle = np.arange(n) // 4, np.arange(n) % 4 + 1
    true = 0.11 * (1.0 - np.cos(2 * np.pi * (step / 200 + axle / 4)))
    c1, c2, c3 = theta
    mu = -c1 * np.expm1(-c2 * true) - c3 * true
    shared = shared_std * rng.standard_normal(n // 4 + 1)[step]
    slip = true + slip_std * rng.standard_normal(n) + shared
    ones = np.ones(n)
    points = Samples.curve(slip, mu + adhesion_std * rng.standard_normal(n), step * 20_000)
    return replace(
        points,
        axle=axle,
        slip_var=slip_std**2 * ones,
        slip_common_var=shared_std**2 * ones,
        adhesion_var=adhesion_std**2 * ones,
    )


@pytest.mark.parametrize("errors", [{"slip_std": 0.006}, {"shared_std": 0.006}])
@pytest.mark.parametrize("surface", RAIL, ids=lambda s: s.name)
def test_errors_of_the_slip_leave_no_bias(surface, errors):
    rows = [contact_points(surface.theta, seed, **errors) for seed in range(12)]
    z = np.array([deviations(samples, surface.theta) for samples in rows])
    # 1.2 is four standard errors of the mean of 12.
    assert np.abs(z.mean(axis=0)).max() < 1.2
    plain = [fit_least_squares(*samples.folded()) for samples in rows]
    biased = np.mean([peak(*theta).lambda_m for theta in plain]) / surface.lambda_m - 1
    assert biased > 0.03


@pytest.mark.parametrize("cycle_ms", [20, 50])
def test_noise_of_a_slow_tram_biases_least_squares_and_not_the_fit(cycle_ms):
    tram = replace(SLOW, cycle_ms=cycle_ms)
    rows = [tram.samples(seed) for seed in range(8)]
    z = np.array([deviations(samples, DRY) for samples in rows])
    # 1.5 is four standard errors of the mean of 8.
    assert np.abs(z.mean(axis=0)).max() < 1.5
    plain = [fit_least_squares(*samples.folded()) for samples in rows]
    assert np.mean([peak(*theta).lambda_m for theta in plain]) > 1.05 * peak(*DRY).lambda_m


@pytest.mark.slow
@pytest.mark.parametrize("sensors", [None, DEFAULTS], ids=["configured", "defaults"])
@pytest.mark.parametrize("speed", [4.0, 9.0])
def test_intervals_of_identify_cover_the_peak(speed, sensors):
    # Two surfaces, 100 drives, with right and with wrong `[sensors]`.
    tram = Tram(speed=speed, seconds=60.0, surfaces=(DRY, LOW))
    inside = []
    for seed in range(100):
        result = identify(tram.samples(seed, sensors))
        assert len(result.segments) == 2
        for theta, segment in zip(tram.surfaces, result.segments, strict=True):
            e, true = segment.estimate, peak(*theta)
            assert e.identifiable.both
            inside.append(
                [
                    abs(e.mu_max - true.mu_max) <= 1.96 * e.mu_max_std,
                    abs(e.lambda_m - true.lambda_m) <= 1.96 * e.lambda_m_std,
                ]
            )
    share = np.mean(inside, axis=0)
    # 200 intervals of 95 %: below 0.90 in one of 400 sets, above 0.99 in one of 500.
    assert (share >= 0.9).all(), share
    assert (share <= 0.99).all(), share


def test_intervals_of_a_few_drives_hold_with_wrong_sensors():
    tram = Tram(speed=4.0, seconds=50.0, surfaces=(DRY, LOW))
    inside = []
    for seed in range(200, 212):
        for theta, segment in zip(
            tram.surfaces, identify(tram.samples(seed, DEFAULTS)).segments, strict=True
        ):
            e, true = segment.estimate, peak(*theta)
            inside.append(abs(e.mu_max - true.mu_max) <= 1.96 * e.mu_max_std)
            inside.append(abs(e.lambda_m - true.lambda_m) <= 1.96 * e.lambda_m_std)
    # Binomial with 0.95 of 48: fewer than 40 in one of 10 000.
    assert sum(inside) >= 40


def test_errors_that_last_widen_the_intervals():
    # Those of the vehicle speed last 0.5 s, longer than the weights or the groups know of.
    z, white = [], []
    for seed in range(10):
        rng = np.random.default_rng(1000 + seed)
        samples = Tram(speed_std=1e-4, seconds=60.0).samples(seed)
        error = np.empty(int(samples.t_us[-1]) // 50_000 + 2)
        error[0] = 0.02 * rng.standard_normal()
        rho = np.exp(-0.05 / 0.5)
        for k in range(1, len(error)):
            error[k] = rho * error[k - 1] + 0.02 * np.sqrt(1 - rho**2) * rng.standard_normal()
        speed = samples.speed + error[samples.t_us // 50_000]
        slip = (1 + samples.slip) * samples.speed / speed - 1
        lasting = replace(
            samples, slip=slip, speed=speed, slip_common_var=(0.02 * (1 + slip) / speed) ** 2
        )
        z.append(deviations(lasting, DRY))
        white.append(fit_surface(Tram(seconds=60.0).samples(seed)).lambda_m_std)
    z = np.array(z)
    # Of 20 intervals of 95 %, fewer than 15 in one of 3000.
    assert (np.abs(z) <= 1.96).sum() >= 15
    assert fit_surface(lasting).lambda_m_std > 1.5 * np.mean(white)


def test_points_without_errors_are_fitted_as_ever():
    samples = replace(contact_points(DRY, 1), adhesion_var=np.zeros(6000))
    h, z = samples.folded()
    theta = fit_least_squares(h, z)
    e = fit_surface(samples)
    assert e.theta == tuple(theta)
    assert e.noise_std == np.sqrt(sum_of_squares(theta, h, z) / (len(h) - 3))
    assert identify(samples).whole.theta == e.theta


def test_vanishing_errors_give_the_least_squares():
    samples = contact_points(DRY, 1, slip_std=1e-7)
    found = fit_with_errors(samples, 0.5)
    plain = fit_least_squares(*samples.folded())
    assert found.theta == pytest.approx(plain, rel=2e-3)
    assert found.noise_std == pytest.approx(0.01, rel=0.03)


def test_order_of_the_samples_does_not_matter():
    samples = SLOW.samples(1)
    turned = samples.select(np.random.default_rng(1).permutation(len(samples)))
    assert fit_with_errors(turned, 0.5).theta == pytest.approx(fit_with_errors(samples, 0.5).theta)


@pytest.mark.parametrize("n", [1, 2, 3, 5, 20, 60])
def test_few_samples_give_an_answer_and_no_certainty(n):
    e = fit_surface(contact_points(DRY, 1, slip_std=0.005).select(slice(n)))
    assert np.isfinite([*e.theta, e.mu_max, e.lambda_m, e.noise_std]).all()
    if n < 20:
        assert not e.identifiable.both


@pytest.mark.parametrize("slip_std", [0.03, 0.1, 1.0])
def test_errors_wider_than_the_curve_give_an_answer(slip_std):
    samples = contact_points(DRY, 1, slip_std=slip_std)
    e = identify(samples, noise=NoiseSettings(estimated=False))
    if e is not None:
        assert np.isfinite([*e.whole.theta, e.whole.mu_max, e.whole.noise_std]).all()
        assert e.whole.mu_max_std > 0


def test_a_curve_that_never_falls_has_no_place_of_its_peak():
    # c3 = 0: in some seeds the noise has a fall of its own, of a few standard errors.
    flat = (0.05, 306.39, 0.0)
    for seed in range(20):
        rng = np.random.default_rng(seed)
        h = rng.uniform(0.0, 0.45, 5000)
        z = flat[0] * -np.expm1(-flat[1] * h) + 0.002 * rng.standard_normal(5000)
        assert not fit_surface(Samples.curve(h, z)).identifiable.lambda_m
        noisy = contact_points(flat, seed, slip_std=0.001, adhesion_std=0.002)
        assert not fit_surface(noisy).identifiable.lambda_m
