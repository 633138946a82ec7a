"""Noise of samples as they come: found where another was configured, else left as it is."""

from dataclasses import replace

import numpy as np
import pytest

from adhesion_can.estimation.noise.block_noise import measure_noise
from adhesion_can.estimation.noise.noise_factors import (
    NoiseFactors,
    RunningNoise,
    batch_factors,
)
from adhesion_can.estimation.noise.scaled_estimator import NoiseScaledEstimator
from adhesion_can.estimation.noise.settings import NoiseSettings
from adhesion_can.estimation.registry import EstimatorSettings, estimator_by_name
from adhesion_can.physics.burckhardt import peak
from adhesion_can.physics.samples import Samples
from adhesion_can.sampling.equations import Sensors
from tests.tram import DRY, Tram

OWN = {"wheel_speed_std": 0.02, "vehicle_speed_std": 0.02, "effort_std": 900.0}
UPDATE_US = 20_000


def updates(samples):
    """Samples by setpoint cycle, some of them empty."""
    cycle = samples.t_us // UPDATE_US
    for k in range(int(cycle[-1]) + 1):
        yield samples.select(cycle == k), (k + 1) * UPDATE_US


def run(samples, settings=None):
    noise = RunningNoise(settings or NoiseSettings())
    for part, _ in updates(samples):
        noise.add(part)
    return np.sqrt(noise.factors)


@pytest.mark.parametrize("cycle_ms", [10, 20, 50])
def test_right_noise_stays_as_it_is(cycle_ms):
    tram = Tram(cycle_ms=cycle_ms, seconds=25.0)
    factors = np.array([run(tram.samples(seed)) for seed in range(4)])
    # Standard deviations; 0.88 to 1.16 in 60 other seeds.
    assert factors.min() > 0.82
    assert factors.max() < 1.25


@pytest.mark.parametrize("cycle_ms", [20, 50])
@pytest.mark.parametrize("wrong", [0.25, 4.0])
@pytest.mark.parametrize("key", OWN)
def test_noise_that_is_wrong_by_four_is_found_within_seconds(key, wrong, cycle_ms):
    place = list(OWN).index(key)
    sensors = Sensors(**{**OWN, key: wrong * OWN[key]})
    for seed in range(2):
        factors = run(Tram(cycle_ms=cycle_ms, seconds=25.0).samples(seed, sensors))
        # The rest is the configuration's weight, 2 s of 25.
        assert 2.5 < factors[place] ** np.sign(-np.log(wrong)) < 5.5
        others = np.delete(factors, place)
        # dω/dt is a part of the adhesion's error.
        assert others.min() > 0.6
        assert others.max() < 2.1


def test_factors_stay_within_their_limits():
    settings = NoiseSettings(largest=3.0, smallest=0.5)
    samples = Tram(cycle_ms=20, seconds=12.0).samples(1)
    loud = replace(
        samples, slip_var=samples.slip_var / 1e4, adhesion_var=1e4 * samples.adhesion_var
    )
    private, common, adhesion = run(loud, settings)
    assert private == 3.0
    assert adhesion == 0.5
    assert 0.8 < common < 1.25


def test_a_wheel_that_sticks_and_slips_is_no_noise():
    # One second in five with 8 Hz of the wheel, 5 % of slip.
    samples = Tram(cycle_ms=10, seconds=25.0, wheel_std=0.005).samples(1)
    t = samples.t_us * 1e-6
    shaken = 0.05 * np.sin(2 * np.pi * 8 * t) * (t % 5 < 1)
    private, *_ = run(replace(samples, slip=samples.slip + shaken))
    assert private < 1.5


def test_a_jump_of_the_speed_is_no_noise():
    samples = Tram(cycle_ms=10, seconds=25.0, speed_std=0.005).samples(1)
    jumped = samples.speed + 0.3 * (samples.t_us > 11_111_111) - 0.3 * (samples.t_us > 17_777_777)
    factors = run(replace(samples, speed=jumped))
    assert factors.max() < 1.3


def test_a_speed_whose_errors_last_is_not_taken_for_a_quiet_one():
    # Neighbours differ by a tenth of the errors, which are as large as configured.
    samples = Tram(cycle_ms=20, seconds=25.0, speed_std=1e-4).samples(1)
    rng = np.random.default_rng(1)
    frames = np.unique(samples.speed_us)
    error = np.empty(len(frames))
    error[0] = rho_std = 0.02
    rho = np.exp(-0.02 / 0.4)
    for k in range(1, len(frames)):
        error[k] = rho * error[k - 1] + rho_std * np.sqrt(1 - rho**2) * rng.standard_normal()
    speed = samples.speed + np.interp(samples.t_us, frames, error)
    lasting = replace(samples, speed=speed, slip_common_var=(0.02 / speed) ** 2)
    _, common, _ = run(lasting)
    assert common > 0.35
    white = replace(samples, slip_common_var=(0.02 / samples.speed) ** 2)
    assert run(white)[1] < 0.3


def test_samples_without_variances_are_not_touched():
    rng = np.random.default_rng(1)
    slip = rng.uniform(0, 0.2, 5000)
    samples = Samples.curve(slip, slip, np.arange(5000) * 5000)
    noise = RunningNoise(NoiseSettings())
    for part, _ in updates(samples):
        noise.add(part)
    assert noise.factors == NoiseFactors()
    assert noise.factors.scale(samples) is samples


def test_pauses_and_stamps_that_run_backwards_start_a_block_anew():
    samples = Tram(cycle_ms=20, seconds=12.0).samples(1)
    noise = RunningNoise(NoiseSettings())
    for part, now_us in updates(samples):
        if now_us % 400_000 < 200_000:  # never a whole second
            noise.add(replace(part, t_us=part.t_us + (now_us // 400_000) * 1_000_000))
    assert noise.factors == NoiseFactors()
    noise.add(replace(samples.select(slice(4)), t_us=samples.t_us[:4]))
    noise.add(samples.select(slice(0, 0)))


def test_batch_and_stream_find_the_same():
    samples = Tram(cycle_ms=20, seconds=25.0).samples(1, Sensors(0.005, 0.08, 900.0))
    stream = run(samples)
    batch = np.sqrt(batch_factors(samples, NoiseSettings()))
    assert batch == pytest.approx(stream, rel=0.1)


def test_the_default_estimator_scales_and_the_setting_switches_it_off():
    make = estimator_by_name("tracker")
    assert isinstance(make(EstimatorSettings()), NoiseScaledEstimator)
    off = EstimatorSettings(noise=NoiseSettings(estimated=False))
    assert not isinstance(make(off), NoiseScaledEstimator)


@pytest.mark.parametrize("bad", [{"memory_s": 0.5}, {"largest": 0.9}, {"smallest": 0.0}])
def test_settings_that_make_no_sense_are_rejected(bad):
    with pytest.raises(ValueError, match="must be"):
        NoiseSettings(**bad)


@pytest.mark.slow
@pytest.mark.long
def test_wrong_noise_costs_little_where_it_is_estimated():
    # A quarter of the speeds' noise is configured. Of 24 drives the interval of λ_m holds 15 times
    # then, and 21 times with the noise estimated; its errors are 2.2 and 1.3 standard deviations.
    true = float(peak(*DRY).lambda_m)
    sensors = Sensors(0.005, 0.005, 900.0)
    errors = {True: [], False: []}
    for seed in range(24):
        samples = Tram(seconds=30.0).samples(seed, sensors)
        for estimated, found in errors.items():
            settings = EstimatorSettings(noise=NoiseSettings(estimated=estimated))
            estimator, last = estimator_by_name("tracker")(settings), None
            for part, now_us in updates(samples):
                last = estimator.update(part, now_us)
            found.append((last.lambda_m - true) / last.lambda_m_std)
    assert np.mean(np.abs(errors[True]) <= 1.96) >= 0.8
    assert np.square(errors[False]).mean() > 2.0 * np.square(errors[True]).mean()


def test_wheels_at_rest_tell_nothing_of_the_vehicle_speed():
    """Their slip is -1 whatever the speed: no number comes of it, nor a warning of numpy's."""
    samples = Tram(seconds=2.0).samples(1)
    whole = measure_noise(samples)
    locked = samples.axle == 1
    slip = np.where(locked, -1.0, samples.slip)
    common = np.where(locked, 0.0, samples.slip_common_var)
    some = measure_noise(replace(samples, slip=slip, slip_common_var=common))
    assert some.common.value == pytest.approx(whole.common.value, rel=0.2)
    none = np.zeros(len(slip))
    every = measure_noise(replace(samples, slip=none - 1.0, slip_common_var=none))
    assert every.common.freedom == every.common_long.freedom == 0
