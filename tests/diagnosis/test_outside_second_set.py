"""Worlds by others, second set: each changes the drive by the size that it states."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from tests.worlds.drive_profile import AXLES, STEP_S
from tests.worlds.outside.kinds import ASIDE, BESIDE, OPEN, SECOND, SECOND_NAMES
from tests.worlds.outside.registry import LABELS, MECHANISMS
from tests.worlds.outside.track_mechanisms import places, wheel_angle
from tests.worlds.outside.world import OutsideWorld
from tests.worlds.plant import drive
from tests.worlds.rail import peak


def scene_of(seed=3, duration_s=120.0):
    scenes = []
    world = OutsideWorld("outside:coarse_speed", seed, 0, duration_s)
    inner = world.mechanism
    world.mechanism = lambda scene: scenes.append(scene) or inner(scene)
    drive(world.profile, world.vehicle, world.rail, (), world.noise, world.mechanism)
    return scenes[0]


@pytest.fixture(scope="module")
def scene():
    return scene_of()


def changes(scene, name, seed=1):
    """Change of each size, with it."""
    one = MECHANISMS[name]
    return [(size, one.law(scene, size, np.random.default_rng(seed))) for size in one.sizes]


def touched(moved):
    """Numbers of the axles where something moved."""
    return np.flatnonzero(np.abs(moved).max(axis=0) > 1e-9)


def test_the_second_set_is_in_no_other_group():
    assert len(SECOND) == 12
    assert not set(SECOND) & {*OPEN, *ASIDE}
    assert not {kind.rpartition("+")[2] for kind in BESIDE} & set(SECOND_NAMES)
    assert all(MECHANISMS[name].second for name in SECOND_NAMES)
    for name in SECOND_NAMES:
        small, medium, large = MECHANISMS[name].sizes
        assert 0 < small < medium < large


@pytest.mark.parametrize("name", SECOND_NAMES)
def test_a_seed_gives_the_same_drive_and_another_one_another(name):
    readings = []
    for seed in (5, 5, 6):
        world = OutsideWorld(f"outside:{name}", seed, 0, 30.0, LABELS[1])
        known = (world.profile, world.vehicle, world.rail, (), world.noise)
        readings.append(drive(*known, world.mechanism))
    first, again, other = readings
    for signal in ("speed", "wheel_speed", "effort", "load"):
        assert np.array_equal(getattr(first, signal), getattr(again, signal))
        assert not np.array_equal(getattr(first, signal), getattr(other, signal))


def test_a_puddle_takes_its_share_at_first_and_once_a_turn(scene):
    first = np.argmin(scene.vehicle.behind)
    for size, change in changes(scene, "puddle_on_the_wheel"):
        lost = 1 - change.factor
        assert lost.max() == pytest.approx(size, rel=0.1)
        assert lost.min() == 0
        assert lost[:, first].max() == lost.max()
        # Each later axle picks up less of what lies there.
        order = np.argsort(scene.vehicle.behind)
        assert np.all(np.diff(lost.max(axis=0)[order]) < 0)
    wet = lost[:, first] > 0
    since = np.flatnonzero(wet)[0]
    angle = wheel_angle(scene)[:, first]
    turn = np.mod(angle - angle[since], 2 * np.pi)
    dry = (turn > 0.55 * np.pi) & (turn < 1.45 * np.pi)
    later = np.arange(len(turn)) < np.searchsorted(places(scene)[:, first], 300.0)
    assert not wet[dry & later].any()


def test_turned_wheels_grip_more_by_their_size_at_first(scene):
    begins = int(np.searchsorted(scene.profile.t, 0.0))
    for size, change in changes(scene, "freshly_turned_wheels"):
        gained = change.factor - 1
        axles = touched(gained)
        assert len(axles) == 2
        assert np.allclose(gained[begins, axles], size, rtol=0.01)
        assert np.all(np.diff(gained[begins:, axles], axis=0) < 0)
        assert gained[-1, axles[0]] > size * np.exp(-scene.profile.position[-1] / 300)


def test_a_hunting_bogie_loses_force_where_the_creep_is_small(scene):
    slip = np.abs(scene.profile.slip)
    onset = peak(scene.curves[0])[1]
    means = []
    for _, change in changes(scene, "bogie_hunting"):
        assert np.allclose(change.factor[slip == 0], 1.0)
        assert np.allclose(change.factor[slip > max(2 * onset, 0.05)], 1.0, atol=0.02)
        means.append(change.factor[(slip > 1e-4) & (slip < 0.2 * onset)].mean())
    assert 1 > means[0] > means[1] > means[2] > 0


def test_axles_without_a_wheelbase_roll_as_klingel_says_and_creep_nowhere(scene):
    short = replace(scene, vehicle=SimpleNamespace(behind=np.repeat([0.0, 10.0], 3)))
    for _, change in changes(short, "bogie_hunting"):
        felt = np.abs(scene.profile.slip) > 1e-6
        assert np.allclose(change.factor[felt], 1.0)


def test_chatter_leaves_alone_what_is_before_the_peak(scene):
    onset = peak(scene.curves[0])[1]
    before = np.abs(scene.profile.slip) <= onset
    beyond = np.abs(scene.profile.slip) > onset + 0.03
    assert beyond.any()
    means = []
    for _, change in changes(scene, "torsional_chatter"):
        assert np.allclose(change.factor[before], 1.0)
        means.append(change.factor[beyond].mean())
    assert 1 > means[0] > means[1] > means[2] > 0


def test_one_inverter_shows_three_axles_alike(scene):
    for size, change in changes(scene, "one_inverter_a_bogie"):
        shown = (scene.effort + change.offset).reshape(-1, 2, 3)
        true = scene.effort.reshape(-1, 2, 3)
        assert np.allclose(shown.mean(axis=2), true.mean(axis=2))
        assert np.allclose(np.ptp(shown, axis=2), (1 - size) * np.ptp(true, axis=2))


def test_a_broken_bar_swings_one_motor_at_twice_its_slip_frequency(scene):
    for size, change in changes(scene, "broken_rotor_bar"):
        (axle,) = touched(change.gain - 1)
        swing = (1 - change.gain[:, axle]) / size
        assert np.abs(swing).max() == pytest.approx(1.0, abs=1e-3)
        crossings = np.sum(np.diff(np.sign(swing)) != 0)
        turns = 2 * np.sum(np.abs(scene.effort[:, axle])) * STEP_S / 100e3
        assert 0.6 * turns - 1 <= crossings / 2 <= 1.2 * turns + 1


def test_the_sag_is_its_size_at_the_largest_power(scene):
    power = scene.profile.v * scene.effort.sum(axis=1)
    most = np.argmax(np.abs(power))
    for size, change in changes(scene, "line_voltage_sag"):
        sign = np.sign(power[most])
        assert change.gain[most, 0] == pytest.approx((1 - sign * size) ** -2)
        assert np.all((change.gain[:, 0] > 1) == (power > 0))


def test_a_block_drags_one_axle_and_less_at_speed(scene):
    for size, change in changes(scene, "dragging_brake_block"):
        (axle,) = touched(change.offset)
        drag = change.offset[:, axle]
        kmh = 3.6 * scene.profile.v
        assert np.argmax(drag) == np.argmin(kmh)
        # Karwatzki: friction over that at standstill is 120 / 200 at 20 km/h, 160 / 400 at 60 km/h.
        table = np.array([(v + 100) / (5 * v + 100) for v in range(100)])
        assert table[20] == 0.6
        assert table[60] == 0.4
        assert np.allclose(drag / size, np.interp(kmh, np.arange(100), table), rtol=1e-3)


def test_a_joint_turns_unevenly_by_its_angle(scene):
    for size, change in changes(scene, "cardan_joint"):
        ratio = change.wheel_speed / scene.omega
        assert len(touched(ratio - 1)) == AXLES
        bend = np.radians(size)
        assert ratio.max() == pytest.approx(1 / np.cos(bend), rel=1e-5)
        assert ratio.min() == pytest.approx(np.cos(bend), rel=1e-5)
        assert ratio.mean() == pytest.approx(1.0, abs=1e-4)


def test_a_radar_shows_the_vertical_speed_by_the_tangent_of_its_beam(scene):
    for size, change in changes(scene, "radar_heave"):
        error = change.speed - scene.profile.v
        assert np.tan(np.radians(40)) <= error.std() / size <= np.tan(np.radians(55))


def test_an_accelerometer_runs_away_by_its_bias_until_satellites_are_back(scene):
    for size, change in changes(scene, "satellite_outage"):
        error = np.abs(change.speed - scene.profile.v)
        assert (error == 0).any()
        rate = np.diff(error) / STEP_S
        runs = error[1:] > 0
        assert np.allclose(rate[runs], size)


def test_digits_are_as_coarse_as_they_are_called(scene):
    for size, change in changes(scene, "coarse_speed"):
        digits = 3.6 * change.speed / size
        assert np.allclose(digits, np.round(digits))
        error = 3.6 * np.abs(change.speed - scene.profile.v).max()
        assert 0.49 * size < error <= 0.5 * size + 1e-12
