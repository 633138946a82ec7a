"""Radii, offset and delay from coasting: against drives made here, with correlated errors."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from adhesion_can.calibration.coasting import CalibrationSettings, CoastingDrive, find_coasting
from adhesion_can.calibration.fit import calibrate
from adhesion_can.physics.vehicle import Geometry, Locomotive
from adhesion_can.sampling.traces import Trace

TRUE_RADII = (0.600, 0.612, 0.625, 0.630)
VEHICLE = Locomotive(
    wheel_radius=(0.625,) * 4, axle_load=(200e3,) * 4, geometry=Geometry(axles_per_bogie=(2, 2))
)
TRACTION, CYCLE = 8.0, 30.0
"""s; each cycle begins with traction (slip 3 %, adhesion 0.25) and coasts for the rest."""


def correlated(rng, count, step_s, std, time_s=1.0):
    """AR(1) of correlation time `time_s`, stationary."""
    keep = np.exp(-step_s / time_s)
    noise = rng.standard_normal(count) * std
    noise[1:] *= np.sqrt(1 - keep * keep)
    for k in range(1, count):
        noise[k] += keep * noise[k - 1]
    return noise


def drive(
    rng,
    duration=240.0,
    offset=0.0,
    delay=0.0,
    noise=0.03,
    mean=14.0,
    swing=8.0,
    radii=TRUE_RADII,
    effort=True,
    slides=0.0,
    creep=0.03,
    step=0.05,
    start=0.0,
):
    """A drive over hills: speed and acceleration out of step, so that o and τ can be parted."""

    def speed(t):
        return mean + swing * (0.8 * np.sin(t / 31.0 + start) + 0.2 * np.sin(t / 9.0))

    t = np.arange(0.0, duration, step)
    pulls = (t % CYCLE) < TRACTION
    slip = np.where(pulls, creep, 0.0)
    if slides:
        # Brakes without a signal hold all wheels at 10 % of slip for 4 s, now and then.
        held = np.arange(len(t) // 80 + 1) % round(1 / slides) == 7  # of 4 s, all while it coasts
        slip = slip - 0.1 * held.repeat(80)[: len(t)]
    stamps = np.round(t * 1e6).astype(np.int64)
    wheels = {
        i: Trace(stamps, speed(t) * (1 + slip) / r + 0.003 * rng.standard_normal(len(t)))
        for i, r in enumerate(radii, start=1)
    }
    force = np.where(pulls, 50e3, 0.0)
    efforts = {i: Trace(stamps, force + 1e3 * rng.standard_normal(len(t))) for i in wheels}
    measured = speed(t - delay) + offset + correlated(rng, len(t), step, noise)
    return CoastingDrive(Trace(stamps, measured), wheels, efforts if effort else {})


def run(*drives, vehicle=VEHICLE, **settings):
    return calibrate(drives, vehicle, CalibrationSettings(**{"acceleration_max": 1.0} | settings))


def test_radii_offset_and_delay_are_found_within_their_errors():
    result = run(drive(np.random.default_rng(1), duration=600, offset=0.15, delay=0.2))
    for axle, true in zip(result.axles, TRUE_RADII, strict=True):
        assert axle.estimate.std < 1e-3 * true  # 4e-4 to 6e-4, by the seed
        assert axle.estimate.value == pytest.approx(true, abs=6 * axle.estimate.std)
        assert axle.ratio == axle.estimate.value / 0.625
        assert 0.5 * 600 < axle.coasting_s < 600 * (1 - TRACTION / CYCLE)
    assert result.offset.value == pytest.approx(0.15, abs=6 * result.offset.std)
    assert result.delay.value == pytest.approx(0.2, abs=6 * result.delay.std)
    assert result.offset.std < 0.02
    assert result.effort_known
    # The error's standard deviation, and what 3 mrad/s at the wheels add to it.
    assert result.noise_std == pytest.approx(0.03, rel=0.2)


FREE = {"offset_std_max": 1.0, "delay_std_max": 1.0}
FIXED = {"offset_std_max": 1e-9, "delay_s": 0.0}


def coverage(rounds, offset, delay, **limits):
    """(share of 95 % intervals that hold, spread of error/std) of what was estimated."""
    hits, ratios = [], []
    for seed in range(rounds):
        rng = np.random.default_rng(seed)
        one = drive(rng, step=0.1, offset=offset, delay=delay, start=rng.uniform(0, 6))
        result = run(one, **limits)
        found = [*(axle.estimate for axle in result.axles), result.offset, result.delay]
        pairs = [
            (q, x)
            for q, x in zip(found, [*TRUE_RADII, offset, delay], strict=True)
            if q is not None
        ]
        hits += [q.interval[0] <= x <= q.interval[1] for q, x in pairs]
        ratios += [(q.value - x) / q.std for q, x in pairs]
    return np.mean(hits), np.std(ratios)


@pytest.mark.parametrize("rounds", [60, pytest.param(600, marks=pytest.mark.slow)])
@pytest.mark.parametrize(
    ("offset", "delay", "limits"),
    [(0.1, 0.1, FREE), (0.0, 0.0, FIXED), (0.0, 0.0, {})],
    ids=["free", "fixed", "as the data allow"],
)
def test_95_percent_intervals_hold_under_correlated_errors(rounds, offset, delay, limits):
    """Errors of the speed with a correlation time of 1 s: 10 s blocks, some 24 of them."""
    share, spread = coverage(rounds, offset, delay, **limits)
    # Some 150 independent ones of 60 rounds, and a spread of 1.1 to 1.27 in other seeds, since the
    # blocks are few: bounds of five standard errors.
    assert share >= 0.82
    assert 0.7 < spread < 1.6


@pytest.mark.parametrize("step", [0.5, 1.0, 2.0])
def test_readings_as_slow_as_every_two_seconds_calibrate(step):
    """Gaps and windows follow the signals' own cycle."""
    errors = []
    for seed in range(12):
        rng = np.random.default_rng(seed)
        one = drive(rng, duration=1800.0, step=step, start=rng.uniform(0, 6))
        result = run(one, **FIXED)
        for axle, true in zip(result.axles, TRUE_RADII, strict=True):
            assert axle.coasting_s > 300
            assert axle.estimate.std < 1e-3 * true
            errors.append((axle.estimate.value - true) / axle.estimate.std)
    # The radii of one drive share its speed: some 12 to 24 independent ones.
    assert np.mean(np.abs(errors) < 2.2) >= 0.8


def test_a_gap_beyond_three_cycles_is_bridged_by_nothing():
    one = drive(np.random.default_rng(7), duration=600.0, step=1.0)
    kept = np.ones(600, dtype=bool)
    kept[100:103] = False  # four seconds between two readings
    wheels = {i: Trace(w.t_us[kept], w.value[kept]) for i, w in one.wheel_speed.items()}
    whole, holed = (find_coasting(CoastingDrive(one.speed, w, one.effort), [1, 2, 3, 4], VEHICLE,
                                  CalibrationSettings(acceleration_max=1.0))
                    for w in (one.wheel_speed, wheels))  # fmt: skip
    assert np.isfinite(whole.rolling).all()
    assert np.flatnonzero(~np.isfinite(holed.rolling).all(axis=1)).tolist() == [100, 101, 102]


def test_per_sample_errors_would_be_several_times_too_small():
    """What the blocks are for: with blocks of one sample the same data claim far too much."""
    one = drive(np.random.default_rng(3))
    honest, naive = run(one, **FIXED), run(one, block_s=0.05, **FIXED)
    for a, b in zip(honest.axles, naive.axles, strict=True):
        assert b.estimate.value == pytest.approx(a.estimate.value)
        assert a.estimate.std > 3 * b.estimate.std


def test_at_one_speed_the_offset_is_not_identifiable_and_stays_none():
    result = run(drive(np.random.default_rng(4), swing=0.05, offset=0.14))
    assert result.offset is None
    assert result.offset_std > 0.03
    for axle, true in zip(result.axles, TRUE_RADII, strict=True):
        # The radii take the offset as 0 and carry it: 0.14 m/s at 14 m/s is 1 %.
        assert axle.estimate.value / true == pytest.approx(1.01, abs=1e-3)


def test_where_acceleration_follows_speed_offset_and_delay_are_not_parted():
    """A train that climbs when it is fast: a = −(v − v0)/T, so o − τ a has the shape of r ω + o."""
    rng = np.random.default_rng(5)
    t = np.arange(0.0, 600.0, 0.05)
    v = 14.0 + 3.0 * np.exp(-(t % 60) / 20.0) - 1.0
    stamps = np.round(t * 1e6).astype(np.int64)
    wheels = {i: Trace(stamps, v / r) for i, r in enumerate(TRUE_RADII, start=1)}
    one = CoastingDrive(Trace(stamps, v + correlated(rng, len(t), 0.05, 0.03)), wheels, {})
    both = run(one, offset_std_max=0.01, delay_std_max=0.02)
    assert both.offset is None
    assert both.delay is None
    # The standard deviation that it finds is 0.022 to 0.040 in 30 seeds.
    known = run(one, offset_std_max=0.1, delay_s=0.0)
    assert known.delay is None
    assert known.delay_used_s == 0.0
    assert known.offset is not None, "a known delay makes the offset identifiable"
    assert known.offset.value == pytest.approx(0.0, abs=6 * known.offset.std)


def test_short_slides_do_not_move_the_radii():
    """Slides of 10 % for 4 s, now and then: radii within 0.15 % (30 seeds: 0.08 % at most)."""
    robust, dragged = 0.0, 0.0
    for seed in range(4):
        clean = run(drive(np.random.default_rng(seed), duration=400))
        slid = run(drive(np.random.default_rng(seed), duration=400, slides=0.05))
        assert slid.outliers > clean.outliers
        plain = run(drive(np.random.default_rng(seed), duration=400, slides=0.05), huber=1e6)
        for a, b, c in zip(clean.axles, slid.axles, plain.axles, strict=True):
            assert b.ratio == pytest.approx(a.ratio, rel=1.5e-3)
            robust += abs(b.ratio / a.ratio - 1)
            dragged += abs(c.ratio / a.ratio - 1)
    # One seed of thirty has a factor of 4, half of them one of 12.
    assert dragged > 3.5 * robust, "least squares would be dragged"


def test_a_delay_that_is_left_out_biases_and_one_that_is_known_does_not():
    one = drive(np.random.default_rng(7), duration=400, delay=0.5)
    found = run(one)
    known = run(one, delay_s=0.5)
    assert known.delay_used_s == 0.5
    assert found.delay_used_s == pytest.approx(0.5, abs=0.05)
    for a, b in zip(found.axles, known.axles, strict=True):
        assert a.ratio == pytest.approx(b.ratio, rel=5e-4)


def test_without_effort_speed_is_only_steady_and_the_slip_of_traction_is_inside():
    """0.3 % of creep in 27 % of the time cannot be parted from 0.08 % of wear."""
    with_effort, without_effort = (
        run(
            drive(np.random.default_rng(8), duration=900, creep=0.003, effort=known),
            acceleration_max=0.4,
            **FIXED,
        )
        for known in (True, False)
    )
    assert with_effort.effort_known
    assert not without_effort.effort_known
    for a, b in zip(with_effort.axles, without_effort.axles, strict=True):
        assert b.coasting_s > a.coasting_s
        assert 100 * (b.ratio / a.ratio - 1) == pytest.approx(-0.08, abs=0.04)


def test_an_axle_without_effort_of_its_own_coasts_where_the_others_do():
    one = drive(np.random.default_rng(9))
    del one.effort[4]
    result = run(one)
    assert result.axles[3].coasting_s == pytest.approx(result.axles[2].coasting_s, rel=0.05)
    assert result.axles[3].ratio == pytest.approx(TRUE_RADII[3] / 0.625, rel=1e-3)


def test_the_effort_that_accelerates_the_wheelset_is_no_traction():
    """Coasting downhill at 0.2 m/s², a motor with J/r² of 5 t takes 1 kN to keep its torque 0."""
    rng = np.random.default_rng(10)
    heavy = Locomotive(
        wheel_radius=(0.625,) * 4,
        axle_load=(200e3,) * 4,
        wheelset_inertia=2000.0,
        geometry=VEHICLE.geometry,
    )
    base = drive(rng, duration=300)
    spins = {
        i: Trace(e.t_us, e.value + 2000 * np.gradient(w.value, 0.05) / 0.625)
        for (i, e), w in zip(base.effort.items(), base.wheel_speed.values(), strict=True)
    }
    with_inertia = CoastingDrive(base.speed, base.wheel_speed, spins)
    aware = run(with_inertia, vehicle=heavy)
    blind = run(with_inertia)
    assert aware.axles[0].coasting_s > 1.5 * blind.axles[0].coasting_s
    assert aware.axles[0].ratio == pytest.approx(0.6 / 0.625, rel=1e-3)


def test_an_axle_that_hardly_coasts_keeps_its_radius():
    one = drive(np.random.default_rng(11))
    busy = one.effort[2]
    one.effort[2] = Trace(busy.t_us, np.where(busy.t_us > 12e6, 50e3, busy.value))
    result = run(one)
    second = result.axles[1]
    assert second.estimate is None
    assert second.ratio == 1.0
    assert second.configured == 0.625
    assert 0 < second.coasting_s < 5
    assert all(axle.estimate for i, axle in enumerate(result.axles) if i != 1)


def test_nothing_is_estimated_where_nothing_coasts():
    one = drive(np.random.default_rng(12))
    pulled = {i: Trace(e.t_us, e.value + 50e3) for i, e in one.effort.items()}
    result = run(CoastingDrive(one.speed, one.wheel_speed, pulled))
    assert all(axle.estimate is None for axle in result.axles)
    assert result.offset is None
    assert result.delay is None


def test_readings_across_gaps_and_not_available_ones_are_not_used():
    one = drive(np.random.default_rng(13), duration=300)
    broken = {}
    for axle, wheel in one.wheel_speed.items():
        hole = (wheel.t_us > 100e6) & (wheel.t_us < 150e6)
        value = np.where((wheel.t_us > 40e6) & (wheel.t_us < 60e6), np.nan, wheel.value)
        broken[axle] = Trace(wheel.t_us[~hole], value[~hole])
    whole, parts = run(one), run(CoastingDrive(one.speed, broken, one.effort))
    assert parts.axles[0].coasting_s < whole.axles[0].coasting_s - 30
    for a, b in zip(whole.axles, parts.axles, strict=True):
        assert a.ratio == pytest.approx(b.ratio, rel=1e-3)


def test_drives_count_together_and_their_blocks_apart():
    rngs = [np.random.default_rng(seed) for seed in (14, 15)]
    first, second = (drive(rng, duration=120, start=k) for k, rng in enumerate(rngs))
    alone, both = run(first, **FIXED), run(first, second, **FIXED)
    assert both.axles[0].blocks > alone.axles[0].blocks
    assert both.axles[0].coasting_s == pytest.approx(
        alone.axles[0].coasting_s + run(second, **FIXED).axles[0].coasting_s
    )
    assert both.axles[0].estimate.std < alone.axles[0].estimate.std


@settings(max_examples=8, derandomize=True)
@given(
    scale=st.floats(0.9, 1.1),
    radii=st.lists(st.floats(0.4, 0.7), min_size=4, max_size=4),
)
def test_radii_are_relative_to_the_vehicle_speed(scale, radii):
    """A scale error of the speed goes into every radius, whatever the wear; it cannot be seen."""
    one = drive(np.random.default_rng(16), duration=120, radii=radii, step=0.1)
    scaled = CoastingDrive(
        Trace(one.speed.t_us, scale * one.speed.value), one.wheel_speed, one.effort
    )
    limits = {"offset_std_max": 1e-9, "delay_std_max": 1e-9, "speed_min": 0.1}
    for a, b in zip(run(one, **limits).axles, run(scaled, **limits).axles, strict=True):
        assert b.estimate.value == pytest.approx(scale * a.estimate.value, rel=1e-9)


# --- traces


def test_a_trace_is_interpolated_between_readings_and_nowhere_else():
    trace = Trace(np.array([0, 100, 200, 1000]), np.array([0.0, 1.0, np.nan, 4.0]))
    at = trace.at(np.array([-1, 0, 50, 100, 150, 600, 1000, 1001]), gap_us=300)
    assert np.isnan(at[[0, 4, 5, 7]]).all()
    assert at[[1, 2, 3, 6]] == pytest.approx([0, 0.5, 1, 4])


@settings(max_examples=50, derandomize=True)
@given(st.integers(0, 2**32 - 1))
def test_window_mean_and_slope_agree_with_a_fine_sum(seed):
    rng = np.random.default_rng(seed)
    t = np.cumsum(rng.integers(1000, 20_000, 200))
    trace = Trace(t, rng.standard_normal(200).cumsum())
    at = np.linspace(t[0] + 60_000, t[-1] - 60_000, 7).astype(np.int64)
    mean = trace.mean(at, 100_000, 50_000)
    slope = trace.slope(at, 100_000, 50_000)
    for k, centre in enumerate(at):
        fine = np.linspace(centre - 50_000, centre + 50_000, 20_001)
        values = np.interp(fine, t, trace.value)
        assert mean[k] == pytest.approx(values.mean(), abs=0.05)
        assert slope[k] == pytest.approx((values[-1] - values[0]) / 0.1, abs=1e-6)


def test_window_mean_is_missing_where_a_part_of_the_window_is():
    t = np.arange(0, 2_000_000, 10_000)
    value = np.ones(len(t))
    value[100] = np.nan
    mean = Trace(t, value).mean(np.array([300_000, 960_000, 1_040_000, 1_980_000]), 1e5, 1e5)
    assert mean[0] == pytest.approx(1.0)
    assert np.isnan(mean[1:]).all()
    assert np.isnan(Trace(t[:1], value[:1]).mean(t[:1], 1e5, 1e5)).all()
    assert np.isnan(Trace(t[:0], value[:0]).at(t[:3], 1e5)).all()


def test_of_two_readings_with_one_stamp_the_later_counts():
    trace = Trace.from_readings(np.array([0, 5, 5, 9]), np.array([1.0, 2.0, 3.0, 4.0]))
    assert trace.t_us.tolist() == [0, 5, 9]
    assert trace.value.tolist() == [1, 3, 4]
