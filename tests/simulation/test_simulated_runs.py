"""Whole runs: scenarios, truth, the closed loop's ear, and samples against the plant's truth."""

import json
from dataclasses import replace

import numpy as np
import pytest

from adhesion_can.bus.block import Block
from adhesion_can.bus.codec import MessagePlan
from adhesion_can.bus.database import load_database
from adhesion_can.bus.e2e import protect
from adhesion_can.bus.frame import Frame
from adhesion_can.config import Configuration, load_configuration
from adhesion_can.estimation.batch_fit import identify
from adhesion_can.offline.extract_samples import extract_samples
from adhesion_can.physics.burckhardt import RAIL, peak
from adhesion_can.physics.curves import Conditions
from adhesion_can.physics.curves.surfaces import FamilySurface
from adhesion_can.physics.effects import ActiveEffect, effect_by_id
from adhesion_can.physics.vehicle import Geometry, Locomotive
from adhesion_can.simulation.drive import Pattern
from adhesion_can.simulation.run import RunSettings, Simulation, axles_behind
from adhesion_can.simulation.scenarios import SCENARIOS, scenario_by_name
from adhesion_can.simulation.sensors import SensorNoiseSettings

DATABASE = load_database()
SILENT = SensorNoiseSettings(0.0, 0.0, 0.0, 0.0)
NAMES = [s.name for s in SCENARIOS]
CONTRACT_SCENARIOS = {"dry", "wet", "greasy", "dry-wet-dry", "dry-wet-greasy-dry", "sweep"}
BY_NAME = {surface.name: surface for surface in RAIL}


def settings_of(name, duration, **changes):
    settings = RunSettings(scenario_by_name(name), duration)
    return replace(settings, **changes)


def mute(simulation):
    """The same run without its sensors, which cost most of the time."""
    simulation._sensors.due = lambda *_: []
    return simulation


def configuration() -> Configuration:
    return load_configuration()


def test_the_contracts_scenarios_are_there():
    assert set(NAMES) >= CONTRACT_SCENARIOS
    assert len(NAMES) == len(set(NAMES))
    with pytest.raises(KeyError, match="dry-wet-dry"):
        scenario_by_name("moon")


@pytest.mark.parametrize("name", NAMES)
def test_scenario_names_its_surfaces_in_order(name):
    scenario = scenario_by_name(name)
    if scenario.pattern is not Pattern.SWEEP:
        assert "-".join(scenario.surfaces) == name
    assert scenario.meaning
    starts = [section.from_s for section in scenario.sections(60.0)]
    assert starts == pytest.approx([60.0 / len(starts) * k for k in range(len(starts))], abs=1e-6)


def beyond_peak(surface):
    """1.2 times the slip of the peak; curves that fall with speed have it farther out when slow."""
    if isinstance(surface, FamilySurface):
        peak = surface.family.peak(surface.values, Conditions(12.0, 2e5), 0.5)
        return 1.2 * float(peak.lambda_m)
    return 1.2 * surface.lambda_m


@pytest.mark.costly
@pytest.mark.parametrize("name", NAMES)
def test_every_scenario_runs_for_its_duration_and_shows_the_whole_curve(name):
    scenario = scenario_by_name(name)
    each = 24.0 if scenario.pattern is Pattern.SWEEP else 6.0
    duration = max(each * len(scenario.surfaces), 12.0)
    simulation = mute(Simulation(settings_of(name, duration), DATABASE))
    slips, speeds = [], []
    for _ in simulation.run():
        slips.append(simulation.plant.slip)
        speeds.append(simulation.plant.speed)
    assert simulation.now_us == round(1e6 * duration)
    slips, share = np.array(slips), duration / len(simulation.sections)
    assert np.isfinite(slips).all()
    assert min(speeds) > 1.0
    assert max(speeds) < 35.0
    for k, section in enumerate(simulation.sections):
        part = np.abs(slips[round(500 * k * share) : round(500 * (k + 1) * share)])
        assert (part > beyond_peak(section.surface)).any(axis=0).all()
    if scenario.pattern is Pattern.SWEEP:
        assert slips.min() < -0.1


@pytest.mark.slow
@pytest.mark.parametrize("name", NAMES)
def test_a_run_of_ten_minutes_stays_in_the_range_of_a_heavy_haul(name):
    # 'holds the train back so that its speed stays in the range of a heavy haul': 120 km/h.
    simulation = mute(Simulation(settings_of(name, 600.0), DATABASE))
    speeds = []
    for _ in simulation.run():
        speeds.append(simulation.plant.speed)
        assert np.isfinite(simulation.plant.wheel_speed).all(), simulation.now_us / 1e6
    assert min(speeds) > 1.0
    assert max(speeds) < 34.0


@pytest.mark.costly
def test_a_sweep_that_brakes_the_train_to_a_stand_does_not_blow_up():
    # Where the sweep scenario comes to of itself after some 520 s.
    slow = replace(scenario_by_name("sweep"), speed=1.5)
    simulation = mute(Simulation(RunSettings(slow, 40.0), DATABASE))
    for _ in simulation.run():
        force = np.abs(simulation.plant.force).max()
        assert force < 0.5 * 245e3, (simulation.now_us / 1e6, simulation.plant.speed, force)
    assert np.isfinite(simulation.plant.wheel_speed).all()


def test_truth_has_the_contracts_keys_and_true_values():
    effects = (ActiveEffect(effect_by_id("falling_friction"), (0.2,)),)
    settings = settings_of("dry-wet-greasy-dry", 80.0, seed=17, effects=effects)
    truth = json.loads(json.dumps(Simulation(settings, DATABASE).truth(), allow_nan=False))
    assert set(truth) >= {"scenario", "seed", "vehicle", "surfaces", "effects", "noise"}
    assert (truth["scenario"], truth["seed"]) == ("dry-wet-greasy-dry", 17)
    assert truth["effects"] == [
        {"effect": "falling_friction", "form": "burckhardt", "parameters": {"c4": 0.2}}
    ]
    assert truth["vehicle"]["wheel_radius"] == [0.625] * 6
    assert truth["noise"]["effort"] == SensorNoiseSettings().effort
    assert [s["name"] for s in truth["surfaces"]] == ["dry", "wet", "greasy", "dry"]
    edges = [0.0]
    for s in truth["surfaces"]:
        assert set(s) >= {"from_s", "to_s", "name", "c1", "c2", "c3", "mu_max", "lambda_m"}
        assert s["from_s"] == edges[-1]
        edges.append(s["to_s"])
        c1, c2, c3 = s["c1"], s["c2"], s["c3"]
        assert (c1, c2, c3) == BY_NAME[s["name"]].theta
        log = np.log(c1 * c2 / c3)
        assert s["lambda_m"] == pytest.approx(log / c2)
        assert s["mu_max"] == pytest.approx(c1 - c3 / c2 * (1 + log))
    assert edges == pytest.approx([0, 20, 40, 60, 80])


def test_truth_tells_when_the_surface_under_the_leading_axle_changes():
    simulation = mute(Simulation(settings_of("dry-wet-dry", 9.0, along_track=True), DATABASE))
    seen = []
    for _ in simulation.run():
        c1 = simulation._track.under(simulation.now_us / 1e6, simulation.plant.position)[0]
        if not seen or seen[-1][1] != c1[0]:
            seen.append((simulation.now_us / 1e6, c1[0]))
    truth = simulation.truth()["surfaces"]
    assert [c1 for _, c1 in seen] == [s["c1"] for s in truth]
    assert [t for t, _ in seen] == pytest.approx([s["from_s"] for s in truth], abs=0.005)


def test_axles_stand_where_the_geometry_puts_them():
    vehicle = Locomotive()
    behind = axles_behind(vehicle, along=True)
    g = Geometry()
    assert behind == pytest.approx(
        [0, g.axle_spacing, 2 * g.axle_spacing, g.pivot_distance,
         g.pivot_distance + g.axle_spacing, g.pivot_distance + 2 * g.axle_spacing]
    )  # fmt: skip
    assert axles_behind(vehicle, along=False).tolist() == [0.0] * 6
    assert axles_behind(Locomotive(geometry=None), along=True).tolist() == [0.0] * 6


def test_along_the_track_the_rear_axles_find_the_wet_rail_later():
    simulation = mute(Simulation(settings_of("dry-wet-dry", 12.0, along_track=True), DATABASE))
    found = {}
    entered = None
    for _ in simulation.run():
        t, where = simulation.now_us / 1e6, simulation.plant.position
        c1 = simulation._track.under(t, where)[0]
        if 4.0 <= t < 8.0:
            for axle in range(6):
                if c1[axle] == BY_NAME["wet"].c1:
                    found.setdefault(axle, where)
            entered = found.get(0, entered)
    behind = axles_behind(Locomotive(), along=True)
    assert sorted(found) == list(range(6))
    for axle, where in found.items():
        assert where - entered == pytest.approx(behind[axle], abs=0.05)


def setpoint_frame(t_us, status, creep):
    message = DATABASE.message("AdhesionSetpoint")
    payload = MessagePlan(message).encode(
        {"Status": status, "MuMax": 0.3, "LambdaM": 0.07, "CreepSpeedSetpoint": creep}
    )
    protect(payload, message.frame_id, 0)
    return Frame(t_us, message.frame_id, bytes(payload))


def test_a_closed_loop_holds_the_setpoint_that_it_hears():
    simulation = mute(Simulation(settings_of("dry", 30.0, obey=True), DATABASE))
    for k, _ in enumerate(simulation.run()):
        if k % 10 == 0:
            simulation.receive(setpoint_frame(simulation.now_us, 1.0, 0.4))
    plant = simulation.plant
    creep = plant.radius * plant.wheel_speed - plant.speed
    assert creep == pytest.approx([0.4] * 6, rel=0.02)


@pytest.mark.parametrize(
    ("status", "creep"), [(0.0, None), (1.0, None), (2.0, 0.4), (3.0, 0.4), (4.0, 0.4), (5.0, None)]
)
def test_a_closed_loop_probes_where_the_rail_is_not_known(status, creep):
    simulation = mute(Simulation(settings_of("dry", 8.0, obey=True), DATABASE))
    slips = []
    for k, _ in enumerate(simulation.run()):
        if k % 10 == 0:
            simulation.receive(setpoint_frame(simulation.now_us, status, creep))
        slips.append(simulation.plant.slip)
    assert np.array(slips[2000:]).max() > 1.3 * BY_NAME["dry"].lambda_m


def test_foreign_and_remote_frames_are_not_heard():
    simulation = Simulation(settings_of("dry", 1.0, obey=True), DATABASE)
    before = simulation._drive.command
    for frame in (
        Frame(0, 0x202, bytes(8)),
        Frame(0, 0x201, b"", is_remote=True),
        Frame(0, 0x201, b"", is_error=True),
    ):
        simulation.receive(frame)
    assert simulation._drive.command is before


def test_a_repeated_step_is_the_run():
    settings = settings_of("wet", 1.0)
    by_run = [f for step in Simulation(settings, DATABASE).run() for f in step]
    simulation = Simulation(settings, DATABASE)
    by_step = [f for _ in range(500) for f in simulation.step()]
    assert by_step == by_run


# ------------------------------------------------------------ samples of a run against its truth


def run_samples(name, duration, **changes):
    simulation = Simulation(settings_of(name, duration, **changes), DATABASE)
    frames = [f for step in simulation.run() for f in step]
    samples, receiver = extract_samples([Block.from_frames(frames)], configuration(), "simulated")
    assert receiver.rejected == 0
    assert receiver.lost == 0
    return samples, simulation


@pytest.mark.parametrize("name", ["dry", "wet", "greasy", "sweep"])
def test_samples_without_noise_lie_on_the_true_curve(name):
    # Loads come at 5 Hz: where they move, samples are off the curve by what they moved since.
    still = replace(scenario_by_name(name), load_transfer=False)
    samples, simulation = run_samples(name, 12.0, noise=SILENT, scenario=still)
    theta = simulation.sections[0].surface.theta
    c1, c2, c3 = theta
    h, z = samples.folded()
    error = z - (c1 - c1 * np.exp(-c2 * h) - c3 * h)
    # Quantisation: 0.002 rad/s of 16 is 1e-4 of slip, times the slope; 2 x 0.002 rad/s in 20 ms
    # times J/r is 64 N; 10 N of 245 kN.
    tolerance = 1.5e-4 * (c1 * c2 * np.exp(-c2 * h)) + 1.5e-3
    assert (np.abs(error) < tolerance).mean() > 0.97
    assert abs(np.median(error)) < 1e-3
    assert len(samples) == pytest.approx(6 * 100 * 12, rel=0.02)


@pytest.mark.parametrize("transfer", [False, True])
def test_batch_fit_of_a_run_with_noise_finds_the_true_peak(transfer):
    samples, simulation = run_samples("dry", 12.0, load_transfer=transfer)
    result = identify(samples)
    assert len(result.segments) == 1
    e, true = result.whole, simulation.sections[0].surface
    assert e.identifiable.both
    assert e.mu_max == pytest.approx(true.mu_max, rel=0.01)
    assert e.lambda_m == pytest.approx(true.lambda_m, rel=0.1)


@pytest.mark.costly
def test_batch_fit_finds_the_stretches_of_a_changing_rail():
    samples, simulation = run_samples("dry-wet-greasy-dry", 40.0)
    result = identify(samples)
    starts = [s.from_us / 1e6 for s in result.segments]
    assert starts == pytest.approx([0, 10, 20, 30], abs=0.25)
    for segment, section in zip(result.segments, simulation.sections, strict=True):
        mu = float(peak(*section.surface.theta).mu_max)
        assert segment.estimate.mu_max == pytest.approx(mu, rel=0.03)


def test_samples_stand_at_wheel_speed_stamps_and_in_order():
    samples, _ = run_samples("dry", 3.0)
    assert (np.diff(samples.t_us) >= 0).all()
    assert set(samples.t_us % 10_000) <= {0, 250}
    assert set(samples.axle) == set(range(1, 7))
