"""What surrounds a run: its functions by hand, its frames, and that it shows what it must."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from adhesion_can.bus.block import Block
from adhesion_can.bus.database import load_database
from adhesion_can.config import load_configuration
from adhesion_can.offline.extract_samples import extract_samples
from adhesion_can.simulation.drive import Pattern
from adhesion_can.simulation.plant import GradientProfile, Plant
from adhesion_can.simulation.run import RunSettings, Simulation
from adhesion_can.simulation.scenarios import SCENARIOS, scenario_by_name
from adhesion_can.simulation.sensors import SensorNoiseSettings
from adhesion_can.simulation.surroundings import (
    DEFAULT_CONDITIONS,
    TRANSITION_M,
    SurroundingConditions,
    Surroundings,
    TrackCurve,
    Wave,
    interpolate,
)

DATABASE = load_database()
SWEEP = scenario_by_name("sweep")


def test_a_wave_swings_around_its_mean():
    wave = Wave(60.0, 20.0, 8.0)
    assert [wave.at(t) for t in (0, 2, 4, 6, 8)] == pytest.approx([60, 80, 60, 40, 60])
    assert {Wave(18.0).at(t) for t in range(50)} == {18.0}


def test_the_default_is_calm():
    for t, place in ((0.0, 0.0), (60.0, 123.0), (599.9, -5.0)):
        assert Surroundings().at(t, place) == DEFAULT_CONDITIONS
    for scenario in SCENARIOS:
        assert (scenario.surroundings.at(77.0, 500.0) == DEFAULT_CONDITIONS) == (
            scenario.pattern is not Pattern.SWEEP
        )


def test_curves_follow_each_other_with_transitions_and_begin_again():
    track = Surroundings(curves=(TrackCurve(200.0, 400.0, 100.0), TrackCurve(100.0, -250.0, 50.0)))
    left, right = 1 / 400, -1 / 250
    corners = [
        (0, 0), (TRANSITION_M / 2, left / 2), (TRANSITION_M, left), (100, left),
        (200 - TRANSITION_M, left), (200 - TRANSITION_M / 4, left / 4), (200, 0), (250, 0),
        (300, 0), (300 + TRANSITION_M, right), (400 - TRANSITION_M, right), (400, 0), (449, 0),
    ]  # fmt: skip
    for lap in (0, 450, 4500):
        for place, bend in corners:
            assert track.at(0.0, lap + place).curvature == pytest.approx(bend, abs=1e-12), place


@pytest.mark.parametrize("bad", [(70.0, 300.0, 10.0), (200.0, 0.0, 10.0), (200.0, 300.0, 0.0)])
def test_a_curve_that_no_track_has_is_refused(bad):
    with pytest.raises(ValueError, match="transitions"):
        TrackCurve(*bad)


def test_sand_is_strewn_at_the_end_of_each_period():
    sandy = Surroundings(sanding_period_s=10.0, sanding_s=3.0)
    for t in np.arange(0.0, 40.0, 0.25):
        assert sandy.at(t, 0.0).sanding == float(t % 10.0 >= 7.0), t


def test_conditions_go_by_the_names_that_samples_carry():
    there = SurroundingConditions(1.0, 2.0, 3.0, 4.0, 5.0, 6.0)
    values = there.covariates(7.0)
    assert values == {
        "ambient_temperature_degC": 1.0, "rail_temperature_degC": 2.0,
        "relative_humidity_percent": 3.0, "sanding_active": 4.0, "rain": 5.0, "gradient": 7.0,
        "curvature_per_m": 6.0,
    }  # fmt: skip


def test_a_profile_lets_its_speed_swing():
    profile = GradientProfile(10.0, rise=0.01, amplitude=0.5, period_s=40.0)
    assert profile.at(12.0, 0.0) == pytest.approx(0.02)
    assert profile.at(12.0, 10.0) == pytest.approx(-0.03)  # 15 m/s is what it is made for then
    assert profile.at(12.0, 30.0) == 0.035
    plant = Plant(RunSettings(SWEEP, 1.0).vehicle, 12.0, gradient=profile)
    assert plant.gradient == pytest.approx(0.02)
    plant.time_s = 10.0
    assert plant.gradient == pytest.approx(-0.03)


def test_frames_carry_the_surroundings_of_their_time_and_place():
    quick = Surroundings(
        humidity=Wave(60.0, 30.0, 17.0),
        rail_temperature=Wave(20.0, 15.0, 13.0),
        sanding_period_s=5.0,
        sanding_s=2.0,
        curves=(TrackCurve(90.0, 300.0, 5.0), TrackCurve(100.0, -400.0, 5.0)),
    )
    scenario = replace(SWEEP, surroundings=quick)
    settings = RunSettings(scenario, 12.0, noise=SensorNoiseSettings(0.0, 0.0, 0.0, 0.0))
    simulation = Simulation(settings, DATABASE)
    frames, places = [], [(0, 0.0)]
    for step in simulation.run():
        frames += step
        places.append((simulation.now_us, simulation.plant.position))
    samples, _ = extract_samples([Block.from_frames(frames)], load_configuration(), "simulated")
    times, way = np.array(places).T
    seconds = np.floor(samples.t_us / 1e6 - 0.0018)  # of the last frame before a sample
    channels = samples.covariates
    later = samples.t_us > 1_100_000
    for name, wave, step in (
        ("relative_humidity_percent", quick.humidity, 0.5),
        ("rail_temperature_degC", quick.rail_temperature, 0.5),
    ):
        wanted = np.array([wave.at(t) for t in seconds])
        # A sample is formed after its stamp, and then carries what is known by then.
        known = np.abs(channels[name] - wanted)[later]
        assert np.quantile(known, 0.9) <= step
    sand = np.array([float(t % 5.0 >= 3.0) for t in samples.t_us / 1e6])
    assert (channels["sanding_active"] == sand)[later].mean() > 0.97
    bend = np.array([quick.curvature(s) for s in np.interp(samples.t_us, times, way)])
    assert np.abs(channels["curvature_per_m"] - bend)[later].max() < 0.2 * 25 / 40 / 300
    assert {1, -1} <= set(np.sign(bend))


@pytest.mark.slow
def test_a_sweep_of_four_minutes_shows_every_channel():
    simulation = Simulation(RunSettings(SWEEP, 240.0), DATABASE)
    simulation._sensors.due = lambda *_: []
    rows = []
    for k, _ in enumerate(simulation.run()):
        if k % 50 == 0:
            plant, now = simulation.plant, simulation.plant.conditions
            rows.append((plant.speed, plant.slip[0], now.curvature, now.humidity,
                         now.rail_temperature, now.sanding, simulation.now_us / 1e6))  # fmt: skip
    speed, slip, bend, humidity, temperature, sand, time = np.array(rows).T
    assert 4.0 < speed.min() < 6.0
    assert 20.0 < speed.max() < 24.0
    assert np.abs(slip).max() > 0.15
    radii = 1 / np.abs(bend[bend != 0])
    assert radii.min() == pytest.approx(300.0)
    assert 0.2 < (bend == 0).mean() < 0.7
    assert np.ptp(humidity) > 30
    assert np.ptp(temperature) > 12
    assert 0.2 < sand.mean() < 0.5
    # None of them goes with another, or with time: each can be told.
    channels = [speed, np.abs(slip), np.abs(bend), humidity, temperature, sand, time, slip < 0]
    among = np.corrcoef(np.array(channels, dtype=float)) - np.eye(len(channels))
    assert np.abs(among).max() < 0.55


@given(
    st.lists(st.floats(-1e6, 1e6), min_size=1, max_size=8, unique=True).map(sorted),
    st.data(),
)
def test_one_number_is_interpolated_as_numpy_does(corners, data):
    size = len(corners)
    values = data.draw(st.lists(st.floats(-1e6, 1e6), min_size=size, max_size=size))
    x = data.draw(st.floats(-2e6, 2e6) | st.sampled_from(corners))
    assert interpolate(x, corners, values) == np.interp(x, corners, values)
