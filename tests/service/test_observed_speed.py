"""The service with a vehicle speed that wheels and efforts show, and without the switch for it."""

from functools import partial
from itertools import chain

import numpy as np
import pytest

from adhesion_can.api.simulation import build_run_settings, drive_with_reliefs, make_simulation
from adhesion_can.bus.block import Block
from adhesion_can.bus.e2e import COUNTS, protect
from adhesion_can.bus.frame import Frame
from adhesion_can.config import load_configuration
from adhesion_can.errors import ConfigError
from adhesion_can.estimation.observed_speed.estimator import ObservedSpeedEstimator
from adhesion_can.physics.burckhardt import peak
from adhesion_can.physics.objection import Objection
from adhesion_can.physics.readings import Role
from adhesion_can.physics.status import Status
from adhesion_can.service.core import ServiceCore
from adhesion_can.service.replay import replay, replay_blocks
from tests.gnss_configuration import DATA_ID, SATELLITES_ID, write_gnss_configuration
from tests.service.test_column_replay import assert_same, run_core, spoiled
from tests.service.test_work_ahead import with_work_ahead
from tests.wire import Bench

CONFIG = load_configuration()


@pytest.fixture(scope="module")
def observing(tmp_path_factory):
    path = tmp_path_factory.mktemp("observed") / "my.toml"
    path.write_text("[observed_speed]\nenabled = true\n", encoding="utf-8")
    return load_configuration(path)


@pytest.fixture(scope="module")
def drive():
    """Frames of 17 s without a vehicle speed, and true slips at the ends of steps of 2 ms."""
    settings = build_run_settings("wet", 17.0, 3, (), CONFIG)
    simulation = make_simulation(settings, CONFIG, no_radar=True)
    frames, true = [], []
    for step in drive_with_reliefs(simulation):
        frames += step
        plant = simulation.plant
        true.append(plant.radius * plant.wheel_speed / plant.speed - 1)
    return frames, np.array(true)


@pytest.fixture(scope="module")
def played(observing, drive):
    """Setpoints by time, and samples, of a replay."""
    setpoints, samples = [], []
    core = ServiceCore(
        observing, on_setpoint=lambda *one: setpoints.append(one), on_samples=samples.append
    )
    replay_blocks([Block.from_frames(drive[0])], core, lambda _: None)
    return setpoints, samples, core


def test_the_switch_is_off_by_default():
    assert not CONFIG.observes_speed
    assert CONFIG.make_rim_speed() is None
    assert not isinstance(CONFIG.make_estimator(), ObservedSpeedEstimator)
    assert Role.VEHICLE_SPEED in CONFIG.roles()


def test_the_role_is_not_used_with_the_switch(observing):
    assert not {Role.VEHICLE_SPEED, Role.SPEED_SOURCE} & observing.roles()
    assert isinstance(observing.make_estimator(), ObservedSpeedEstimator)


def test_a_role_beside_the_switch_is_an_error(tmp_path):
    path = tmp_path / "my.toml"
    path.write_text(
        '[observed_speed]\nenabled = true\n[roles]\nvehicle_speed = "VehicleSpeed.VehicleSpeed"\n',
        encoding="utf-8",
    )
    with pytest.raises(ConfigError, match="vehicle_speed"):
        load_configuration(path)


@pytest.mark.parametrize("role", ["wheel_speed", "tractive_effort"])
def test_each_axle_needs_wheel_speed_and_effort(tmp_path, role):
    message = {"wheel_speed": "WheelSpeeds", "tractive_effort": "TractiveEffort"}
    roles = [
        f'{name}.{axle} = "{message[name]}{1 + (axle - 1) // 3}.'
        f'{"WheelSpeed" if name == "wheel_speed" else "TractiveEffort"}_Ax{axle}"'
        for name in message
        for axle in range(1, 7)
        if (name, axle) != (role, 5)
    ]
    path = tmp_path / "my.toml"
    path.write_text("[observed_speed]\nenabled = true\n[roles]\n" + "\n".join(roles))
    with pytest.raises(ConfigError, match=rf"{role}\.5"):
        ServiceCore(load_configuration(path))


@pytest.mark.costly
def test_without_the_role_nothing_is_stale_and_no_relief_is_an_objection(played):
    setpoints, *_ = played
    statuses = {outputs.status for _, outputs in setpoints}
    assert Status.STALE_INPUT not in statuses
    assert Status.FAULT not in statuses
    early = [outputs for t_us, outputs in setpoints if 1.5e6 < t_us < 2.5e6]
    assert {one.status for one in early} == {Status.LOW_EXCITATION}
    assert {one.objection for one in early} == {Objection.NO_RELIEF}
    assert all(one.speed_observed for one in early)


def test_without_the_switch_the_same_frames_are_stale(drive):
    core = ServiceCore(CONFIG)
    replay_blocks([Block.from_frames(drive[0][:2000])], core, lambda _: None)
    assert core.outputs.status is Status.STALE_INPUT
    assert not core.outputs.speed_observed


@pytest.mark.costly
def test_behind_reliefs_the_slips_are_known_and_right(played, drive):
    setpoints, samples, core = played
    known = [
        t_us
        for t_us, outputs in setpoints
        if outputs.status is not Status.INIT and outputs.objection is Objection.NONE
    ]
    assert len(known) > 100
    assert min(known) > 3e6
    errors = []
    for part in samples:
        near = np.abs(np.subtract.outer(part.t_us, known)).min(axis=1) < 20_000
        true = drive[1][part.t_us // 2000 - 1, part.axle - 1]
        errors.append((part.slip - true)[near & (part.adhesion > 0.05)])
    assert np.sqrt(np.mean(np.concatenate(errors) ** 2)) < 0.002
    assert core.counts.samples == sum(map(len, samples))


def served(config, name, seed):
    """Setpoints from 12 s on of a drive of a minute with reliefs and excursions."""
    settings = build_run_settings(name, 60.0, seed, (), CONFIG)
    frames = chain(*drive_with_reliefs(make_simulation(settings, CONFIG, no_radar=True)))
    found = []
    core = ServiceCore(config, on_setpoint=lambda *one: found.append(one))
    replay_blocks([Block.from_frames(list(frames))], core, lambda _: None)
    return [outputs for t_us, outputs in found if t_us >= 12e6]


@pytest.mark.slow
@pytest.mark.long
def test_with_reliefs_and_excursions_the_peak_is_known_half_of_the_time(observing):
    """In the mean of six drives, and where it is known it is right."""
    shares = []
    for name, theta in {"wet": (0.27, 45.0, 0.22), "dry": (0.4, 60.0, 0.3)}.items():
        mu_max, lambda_m = float(peak(*theta).mu_max), float(peak(*theta).lambda_m)
        for seed in (1, 2, 3):
            late = served(observing, name, seed)
            known = [one for one in late if one.status is Status.TRACKING]
            for one in known:
                off = one.setpoint.mu_max - mu_max, one.setpoint.lambda_m - lambda_m
                assert abs(off[0]) < max(3 * one.mu_max_std, 0.02 * mu_max)
                assert abs(off[1]) < max(3 * one.lambda_m_std, 0.05 * lambda_m)
            shares.append(len(known) / len(late))
    assert np.mean(shares) > 0.5


def test_the_speed_in_the_outputs_is_the_observed_one(played):
    """The drive begins at 10 m/s; the rim of a wheel that pulls is some percent faster."""
    setpoints, *_ = played
    known = [o for t_us, o in setpoints if t_us > 4e6 and o.objection is Objection.NONE]
    for outputs in known:
        if outputs.setpoint.creep_speed is not None:
            slip = outputs.setpoint.creep_speed / outputs.speed
            assert slip <= outputs.setpoint.lambda_m
    assert known[0].speed == pytest.approx(10.4, abs=0.3)


@pytest.mark.costly
def test_frames_and_columns_give_the_same_bytes(observing, drive):
    core, sent = assert_same(drive[0][:6000], config=observing, make=None, cuts=9)
    assert core.counts.samples > 3000
    assert len(sent) > 4000


@pytest.fixture(scope="module")
def with_satellites(drive, tmp_path_factory):
    """A configuration with the roles, and the drive with their frames each 0.1 s, some lost."""
    folder = tmp_path_factory.mktemp("satellites")
    roles = ('gnss_speed = "Satellites.Speed"', 'acceleration = "Satellites.Acceleration"')
    config = load_configuration(write_gnss_configuration(folder, *roles))
    frames, rng = [], np.random.default_rng(4)
    for frame in drive[0]:
        while (t_us := 40_000 + 100_000 * len(frames)) <= frame.t_us:
            speed = round(360 * (10.0 + rng.normal(0, 0.05)))
            raw = 65_535 if len(frames) % 37 > 30 else speed
            push = int(rng.integers(-90, 90)).to_bytes(2, "little", signed=True)
            data = bytearray(bytes(2) + raw.to_bytes(2, "little") + push + bytes(2))
            protect(data, DATA_ID, len(frames) % COUNTS)
            frames.append(Frame(t_us, SATELLITES_ID, bytes(data)))
    return config, sorted([*drive[0], *frames], key=lambda frame: frame.t_us)


@pytest.mark.slow
def test_frames_and_columns_agree_with_a_speed_by_satellites(with_satellites):
    config, items = with_satellites
    core, _ = assert_same(items[:9000], config=config, make=None, cuts=9)
    assert core.counts.samples > 2500


@pytest.mark.parametrize("seed", range(4))
def test_spoiled_drives_give_the_same_bytes(observing, seed):
    assert_same(spoiled(seed), config=observing, make=None, cuts=5)


@pytest.mark.costly
def test_work_ahead_changes_nothing(observing, drive):
    items, rng, done = drive[0][:3500], np.random.default_rng(5), []

    def ahead(core, *rest, **how):
        return replay(with_work_ahead(items, core, rng, 0.7, done), core, *rest, **how)

    _, *plain = run_core(partial(replay, items), observing, None)
    _, *early = run_core(ahead, observing, None)
    assert early[:2] == plain[:2]
    assert len(done) > 100


def test_a_derived_speed_stays_low_excitation_without_the_switch():
    core = ServiceCore(CONFIG)
    replay_blocks(
        [Block.from_frames(list(Bench().drive(0, 1_000_000, source=4)))], core, lambda _: None
    )
    assert core.outputs.status is Status.LOW_EXCITATION
    assert core.outputs.objection is Objection.NONE
