"""Worlds by others: every mechanism is stated with its source, acts where it says, and is felt."""

import re
from dataclasses import fields
from hashlib import sha256
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.worlds import make_world
from tests.worlds.drive_profile import STATIC_LOAD, STEP_S, STYLES
from tests.worlds.encoding import database
from tests.worlds.outside.__main__ import mechanism_table
from tests.worlds.outside.car import CARS, has_simulator, load_simulator, make_car, static_loads
from tests.worlds.outside.families import FAMILIES
from tests.worlds.outside.kinds import ASIDE_NAMES, BESIDE, MECH, MEMORY, NAMES, OPEN_NAMES
from tests.worlds.outside.registry import ASIDE_COUNT, LABELS, MECHANISMS, set_aside
from tests.worlds.outside.signals import coloured, leaky_sum, low_pass, play, stretches
from tests.worlds.outside.world import OutsideWorld, make_outside
from tests.worlds.plant import drive

ROOT = Path(__file__).resolve().parents[2]
ACTS_ON = {
    "contact_mechanisms": {"effort"},
    "track_mechanisms": {"effort"},
    "drivetrain_mechanisms": {"effort"},
    "instrument_mechanisms": {"speed", "wheel_speed"},
    "vehicle_mechanisms": {"effort", "load", "wheel_speed"},
    "second_contact": {"effort"},
    "second_drivetrain": {"effort"},
    "second_instruments": {"speed", "wheel_speed"},
}
"""Signals that the mechanisms of a module may change."""
LEAST_EXCESS = 0.001
"""A medium mechanism leaves so much of the plain fit: in 240 s some standard errors of the RMSE,
whose relative standard deviation is 1/sqrt(2 · 144 000) = 0.0019 on one drive's white noise."""


def readings_with_and_without(world):
    known = (world.profile, world.vehicle, world.rail, (), world.noise)
    return drive(*known, world.mechanism), drive(*known)


def changed_signals(one, other):
    names = [field.name for field in fields(one) if field.name != "forward"]
    return {n for n in names if not np.array_equal(getattr(one, n), getattr(other, n))}


def test_there_are_enough_and_half_a_rule_sets_aside():
    assert len(NAMES) == 37
    assert len(ASIDE_NAMES) == ASIDE_COUNT
    assert not set(ASIDE_NAMES) & set(OPEN_NAMES)
    assert set_aside(list(reversed(NAMES))) == tuple(reversed(ASIDE_NAMES))
    digests = {name: sha256(name.encode()).hexdigest() for name in NAMES}
    assert max(digests[n] for n in ASIDE_NAMES) < min(digests[n] for n in OPEN_NAMES)
    # A mechanism that is renamed changes sides: that must be seen here.
    assert sorted(ASIDE_NAMES) == [
        "bogie_pitch", "braked_reference_axle", "corrugation", "dc_link_torque",
        "flange_lubricator", "heat_of_axle_ahead", "polygonal_wheel", "rate_and_state",
        "slip_hysteresis", "tracking_filter", "train_surge", "wheel_flat",
    ]  # fmt: skip


@pytest.mark.parametrize("source", [*(m.source for m in MECHANISMS.values()),
                                    *(f.__doc__ for f in FAMILIES.values())])  # fmt: skip
def test_each_states_its_law_its_literature_and_its_sizes(source):
    assert re.search(r"Law( \(.*\))?:", source)
    assert re.search(r"Literature: .*\b(19|20)\d\d\b", source, re.DOTALL)
    assert "Sizes:" in source


def test_the_page_has_the_table_that_the_command_prints():
    page = (ROOT / "docs" / "worlds.md").read_text()
    table = re.search(r"<!-- mechanisms: .* -->\n(.*)\n<!-- /mechanisms -->", page, re.DOTALL)
    assert table is not None
    assert table[1] == mechanism_table()


@pytest.mark.costly
@pytest.mark.parametrize("name", MECHANISMS)
def test_a_mechanism_is_felt_the_more_the_larger_it_is(name, tmp_path):
    shares = [
        make_outside(f"outside:{name}", 7, tmp_path / "a.log", duration_s=40.0, label=label)
        .excess[-1]
        for label in LABELS
    ]  # fmt: skip
    assert shares[0] < shares[1] < shares[2]
    assert shares[1] >= LEAST_EXCESS


@pytest.mark.parametrize("name", MECHANISMS)
def test_a_mechanism_changes_the_signals_of_its_place_and_no_others(name):
    world = OutsideWorld(f"outside:{name}", 3, 0, 30.0, "medium")
    changed = changed_signals(*readings_with_and_without(world))
    assert changed
    assert changed <= ACTS_ON[MECHANISMS[name].law.__module__.rpartition(".")[2]]


# These two have a filter of 0.8 s and a gate of 20 ms, whatever their size.
@pytest.mark.parametrize("name", sorted(set(MECHANISMS) - {"air_spring_friction", "pulse_timing"}))
def test_a_mechanism_without_size_changes_nothing(name):
    world = OutsideWorld(f"outside:{name}", 3, 0, 30.0, "medium")
    none = {"effort_averaging": STEP_S, "speed_hold": STEP_S}.get(name, 1e-9)
    law = MECHANISMS[name].law
    world.mechanism = lambda scene: law(scene, none, np.random.default_rng(1))
    one, other = readings_with_and_without(world)
    least = {"wheel_speed": 0.004, "speed": 0.002, "effort": 10.0}
    for signal in changed_signals(one, other):
        # A digit of the bus, where it was about to turn over.
        assert np.abs(getattr(one, signal) - getattr(other, signal)).max() <= 1.01 * least[signal]


@pytest.mark.parametrize("kind", [*MECH, MEMORY[2], BESIDE[17]])
def test_the_truth_states_what_is_hidden(kind, tmp_path):
    truth = make_world(kind, 2, tmp_path / "a.log", duration_s=60.0)
    names = kind.partition(":")[2].split("+")
    if kind.startswith("null"):
        assert truth.effects == ()
        assert truth.conditions["speed_memory_s"] == 1.0
    else:
        assert [name.removeprefix("outside:") for name in truth.names] == names
        assert all(np.isfinite(list(truth.effects[0].parameters.values())))
        assert truth.excess[-1] > 0
    assert truth.conditions["rail"] in ("dry", "wet")
    assert truth.conditions["style"] in STYLES


def test_a_log_carries_what_the_instruments_read(tmp_path):
    world = OutsideWorld("outside:speed_hold", 4, 0, 60.0, "large")
    world.written((), tmp_path / "a.log", (0.1, 0.4), False)
    readings, _ = readings_with_and_without(world)
    sent = {"111": [], "121": [], "131": []}
    for line in (tmp_path / "a.log").read_text().splitlines():
        number, _, data = line.split()[2].partition("#")
        if number in sent:
            sent[number].append(database().decode_message(int(number, 16), bytes.fromhex(data)))
    assert np.allclose([m["VehicleSpeed"] for m in sent["111"]], readings.speed)
    assert np.allclose([m["TractiveEffort_Ax2"] for m in sent["121"]], readings.effort[:, 1])
    # Loads come five times a second.
    assert len(sent["131"]) == 60 * 5
    assert np.allclose([m["AxleLoad_Ax3"] for m in sent["131"]], readings.load[:, 2])


def test_a_drive_as_a_table_has_the_samples_of_its_log(tmp_path):
    world = OutsideWorld("outside:air_spring_friction", 4, 0, 40.0)
    world.written((), tmp_path / "a.csv", (0.1, 0.4), False)
    readings, _ = readings_with_and_without(world)
    table = np.genfromtxt(tmp_path / "a.csv", delimiter=",", names=True)
    third = table[table["axle"] == 3]
    rows = np.rint(third["time_s"] / STEP_S).astype(int)
    assert np.allclose(third["normal_load_N"], readings.load[rows // 20, 2], rtol=1e-6)
    even = rows % 2 == 0
    v = readings.speed[rows[even] // 2]
    assert np.allclose(third["slip"][even], 0.625 * readings.wheel_speed[rows[even], 2] / v - 1,
                       atol=1e-6)  # fmt: skip
    assert np.allclose(third["sanding"], readings.sanding[rows // 100])


def test_a_seed_gives_the_same_bytes_and_another_one_another_world(tmp_path):
    files = []
    for number, seed in enumerate((5, 5, 6)):
        path = tmp_path / f"{number}.log"
        make_world("outside:leaf_patches", seed, path, duration_s=30.0)
        files.append(path.read_bytes())
    assert files[0] == files[1] != files[2]
    with pytest.raises(ValueError, match="no kind 'outside:nothing'"):
        make_world("outside:nothing", 1, tmp_path / "a.log")


def test_the_shares_of_braking_are_what_they_are_called():
    braking = {name: [] for name in STYLES}
    for seed in range(24):
        world = OutsideWorld("null:memory-0", seed, 0, 120.0)
        mean = world.profile.slip.mean(axis=1)
        share = np.sum(mean < -0.005) / np.sum(np.abs(mean) > 0.005)
        braking[world.conditions["style"]].append(share)
    assert np.mean(braking["mostly traction"]) < 0.35 < np.mean(braking["mixed"]) < 0.65
    assert np.mean(braking["mostly braking"]) > 0.65


@given(memory=st.sampled_from([0.2, 1.0]), seed=st.integers(0, 2**31))
@settings(max_examples=20, deadline=None)
def test_noise_with_memory_has_its_variance_and_its_memory(memory, seed):
    rows = round(2000 * memory / 0.02)
    x = coloured(np.random.default_rng(seed), rows, 0.02, memory)
    # 2 000 memories: the variance has a relative standard deviation of about 1/sqrt(2000).
    assert np.var(x) == pytest.approx(1.0, abs=0.2)
    late = round(memory / 0.02)
    assert np.mean(x[late:] * x[:-late]) == pytest.approx(np.exp(-1), abs=0.17)


def test_the_filters_are_what_they_are_called():
    t = np.arange(3000) * STEP_S
    step = np.where(t >= 5, 1.0, 0.0)
    assert low_pass(step, 2.0)[700] == pytest.approx(1 - np.exp(-1), abs=0.01)
    assert leaky_sum(np.ones(3000), 3.0)[-1] == pytest.approx(3.0, rel=1e-3)
    swing = play(np.sin(t), 0.2)
    rising = (np.cos(t) > 0.3) & (np.sin(t) > -0.7) & (t > 7)
    assert np.allclose(swing[rising], np.sin(t[rising]) - 0.1)
    place = np.linspace(0, 2e5, 400_000)
    share = stretches(np.random.default_rng(1), place, 30.0, 90.0).mean()
    # 1 600 stretches: a standard deviation of 0.007.
    assert share == pytest.approx(0.25, abs=0.03)


def scene_of(kind, seed=3):
    scenes = []
    world = OutsideWorld(kind, seed, 0, 60.0)
    inner = world.mechanism
    world.mechanism = lambda scene: scenes.append(scene) or inner(scene)
    readings_with_and_without(world)
    return scenes[0], inner(scenes[0]), world.beside[0].parameters


def test_load_transfer_moves_loads_and_makes_none():
    scene, change, p = scene_of("mech:load_transfer")
    true = change.load_factor * scene.profile.load
    static = np.broadcast_to(scene.vehicle.static_load, true.shape)
    assert np.allclose(true.sum(axis=1), static.sum(axis=1))
    assert np.array_equal(change.shown_load, static)
    # Moment of the vehicle about the rail: effort at the coupler's height is load times place.
    whole = (scene.adhesion * static).sum(axis=1)
    place = np.mean(scene.vehicle.behind) - scene.vehicle.behind
    assert np.allclose((true - static) @ place, -0.95 * p["size"] * whole)


def test_heating_is_its_first_order_for_little_work():
    scene, change, p = scene_of("mech:contact_heating")
    power = np.abs(scene.adhesion) * scene.profile.load * np.abs(scene.profile.slip)
    power *= scene.profile.v[:, None]
    power[scene.profile.t < 0] = 0.0
    work = leaky_sum(power, p["time"])
    # Until there has been much of it: what is left of much work is less than that of bare friction.
    most = np.maximum.accumulate(p["loss"] * work)
    little = (work > 100) & (most < 0.02)
    assert little.sum() > 100
    assert np.allclose(1 - change.factor[little], p["loss"] * work[little], rtol=0.05)


def test_instruments_of_the_families_act_on_one_axle_or_in_braking():
    scene, change, p = scene_of("mech:wheel_once_per_turn")
    moved = np.abs(change.wheel_speed - scene.omega).max(axis=0)
    assert np.flatnonzero(moved > 1e-9).tolist() == [int(p["axle"]) - 1]
    scene, change, p = scene_of("mech:brake_blending")
    assert np.all(change.gain[scene.effort > 0] == 1)
    slow = (scene.effort < 0) & (scene.profile.v[:, None] < 0.5 * p["fade"])
    assert np.all(change.gain[slow] < 1 - 0.499 * p["share"])
    scene, change, p = scene_of("mech:curving_resistance")
    bend = np.abs(scene.profile.curvature).max()
    assert change.offset.max() == pytest.approx(
        p["size"] * 0.65 / (1 / bend - 55) * STATIC_LOAD, rel=0.2
    )


needs_car = pytest.mark.skipif(not has_simulator(), reason="commonroad-vehicle-models is missing")


@needs_car
def test_a_car_obeys_newton_and_its_scales_do_not_move(tmp_path):
    for kind in CARS:
        make_car(kind, 2, tmp_path / f"{kind[4:]}.csv", duration_s=12.0)
    scales, loads = (
        np.loadtxt(tmp_path / f"{kind[4:]}.csv", delimiter=",", skiprows=1) for kind in CARS
    )
    force = scales[:, 2].reshape(-1, 4).sum(axis=1)
    mass = static_loads(load_simulator().parameters).sum() / 9.81
    v = scales[::4, 4]
    assert np.all(np.ptp(scales[:, 3].reshape(-1, 4), axis=0) == 0)
    assert np.ptp(loads[:, 3].reshape(-1, 4), axis=0).min() > 300
    # Over half a second the noise of the speed is small beside what the forces do.
    rows = 25
    gained = v[rows:] - v[:-rows]
    pushed = np.convolve(force, np.ones(rows), "valid")[:-1] * 0.02 / mass
    assert np.corrcoef(gained, pushed)[0, 1] > 0.99
    assert np.polyfit(pushed, gained, 1)[0] == pytest.approx(1.0, abs=0.05)
