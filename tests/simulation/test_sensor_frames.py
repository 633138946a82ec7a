"""The frames of the simulated sensors against the contract's table, decoded by hand."""

from collections import defaultdict

import numpy as np
import pytest
from scipy.stats import kstest

from adhesion_can.bus.database import load_database
from adhesion_can.physics.instruments import PERFECT
from adhesion_can.physics.vehicle import Locomotive
from adhesion_can.simulation.role_sensors import RoleSensors, packaged_messages
from adhesion_can.simulation.run import RunSettings, Simulation
from adhesion_can.simulation.scenarios import scenario_by_name
from adhesion_can.simulation.sensors import PlantState, SensorNoiseSettings

DATABASE = load_database()
SILENT = SensorNoiseSettings(0.0, 0.0, 0.0, 0.0)
CYCLE_MS = {
    0x101: 10, 0x102: 10, 0x111: 20, 0x121: 10, 0x122: 10, 0x131: 200, 0x132: 200, 0x141: 1000,
    0x151: 200,
}  # fmt: skip
# id: (name, start, length, signed, factor, offset) as the contract has them.
LAYOUT = {
    0x101: [("w1", 16, 16, False, 0.002, 0), ("w2", 32, 16, False, 0.002, 0),
            ("w3", 48, 16, False, 0.002, 0)],
    0x102: [("w4", 16, 16, False, 0.002, 0), ("w5", 32, 16, False, 0.002, 0),
            ("w6", 48, 16, False, 0.002, 0)],
    0x111: [("v", 16, 16, False, 0.002, 0), ("source", 32, 4, False, 1, 0),
            ("direction", 36, 2, False, 1, 0)],
    0x121: [("f1", 16, 16, True, 10, 0), ("f2", 32, 16, True, 10, 0), ("f3", 48, 16, True, 10, 0)],
    0x122: [("f4", 16, 16, True, 10, 0), ("f5", 32, 16, True, 10, 0), ("f6", 48, 16, True, 10, 0)],
    0x131: [("n1", 16, 16, False, 10, 0), ("n2", 32, 16, False, 10, 0),
            ("n3", 48, 16, False, 10, 0)],
    0x132: [("n4", 16, 16, False, 10, 0), ("n5", 32, 16, False, 10, 0),
            ("n6", 48, 16, False, 10, 0)],
    0x141: [("ambient", 16, 8, False, 0.5, -40), ("rail", 24, 8, False, 0.5, -40),
            ("humidity", 32, 8, False, 0.5, 0), ("sanding", 40, 1, False, 1, 0),
            ("rain", 41, 2, False, 1, 0)],
    0x151: [("gradient", 16, 16, True, 0.01, 0), ("curvature", 32, 16, True, 0.001, 0)],
}  # fmt: skip


def raw_of(data, start, length, signed):
    """Bit by bit: bit k of the payload is bit k % 8 of byte k // 8 (Intel)."""
    raw = sum(((data[(start + k) // 8] >> ((start + k) % 8)) & 1) << k for k in range(length))
    return raw - (1 << length) if signed and raw >> (length - 1) else raw


def decoded(frame):
    return {
        name: raw_of(frame.data, start, length, signed) * factor + offset
        for name, start, length, signed, factor, offset in LAYOUT[frame.arbitration_id]
    }


def crc8(message):
    """SAE J1850 polynomial, register 0, no final xor, one bit at a time, high bit first."""
    register = 0
    for byte in message:
        for k in range(7, -1, -1):
            top = (register >> 7) ^ ((byte >> k) & 1)
            register = ((register << 1) & 0xFF) ^ (0x1D if top else 0)
    return register


def frames_of(scenario="dry-wet-dry", duration=4.0, **changes):
    settings = RunSettings(scenario_by_name(scenario), duration, **changes)
    simulation = Simulation(settings, DATABASE)
    return [frame for step in simulation.run() for frame in step], simulation


@pytest.fixture(scope="module")
def frames():
    return frames_of(duration=20.0)[0]


def by_id(frames):
    groups = defaultdict(list)
    for frame in frames:
        groups[frame.arbitration_id].append(frame)
    return groups


def test_the_crc_of_this_test_knows_a_published_check_value():
    # CRC-8 with polynomial 0x1D, init and xor 0 (catalogue: CRC-8/GSM-A): 0x37 for "123456789".
    assert crc8(b"123456789") == 0x37


def test_every_message_of_the_contract_comes_and_no_other(frames):
    assert set(by_id(frames)) == set(CYCLE_MS)
    assert all(len(f.data) == 8 and f.is_data and not f.is_extended for f in frames)


@pytest.mark.parametrize("frame_id", CYCLE_MS, ids=hex)
def test_each_message_keeps_its_cycle_to_the_microsecond(frames, frame_id):
    stamps = np.array([f.t_us for f in by_id(frames)[frame_id]])
    assert stamps[0] < 1000 * CYCLE_MS[frame_id]
    assert (np.diff(stamps) == 1000 * CYCLE_MS[frame_id]).all()
    assert stamps[-1] > 20e6 - 1000 * CYCLE_MS[frame_id] - 1
    assert stamps[-1] <= 20e6


def test_stamps_rise_and_no_two_frames_share_the_bus(frames):
    # 8 bytes at 500 kbit/s take at least 111 bits of 2 us.
    stamps = np.array([f.t_us for f in frames])
    assert (np.diff(stamps) >= 222).all()


@pytest.mark.parametrize("frame_id", CYCLE_MS, ids=hex)
def test_alive_counts_0_to_14_from_0(frames, frame_id):
    counts = [f.data[1] & 0x0F for f in by_id(frames)[frame_id]]
    assert counts == [k % 15 for k in range(len(counts))]


def test_crc_is_that_of_autosar_e2e_profile_1(frames):
    for f in frames[:3000]:
        low, high = f.arbitration_id & 0xFF, f.arbitration_id >> 8
        assert f.data[0] == crc8(bytes([low, high]) + f.data[1:])


def test_bits_that_no_signal_has_are_zero(frames):
    for frame_id, group in by_id(frames).items():
        used = 0xFFF  # Crc and Alive
        for _, start, length, *_ in LAYOUT[frame_id]:
            used |= ((1 << length) - 1) << start
        for f in group[:200]:
            assert int.from_bytes(f.data, "little") & ~used == 0


def test_constant_channels_say_what_they_should(frames):
    groups = by_id(frames)
    for f in groups[0x111]:
        assert (decoded(f)["source"], decoded(f)["direction"]) == (1, 1)  # radar, forward
    for f in groups[0x141]:
        values = decoded(f)
        assert -20 <= values["ambient"] <= 40
        assert -20 <= values["rail"] <= 60
        assert 0 <= values["humidity"] <= 100
        assert values["rain"] in {0, 1, 2}
    profile = scenario_by_name("dry-wet-dry").profile
    speeds = {f.t_us: decoded(f)["v"] for f in groups[0x111]}
    for f in groups[0x151]:
        nearest = min(speeds, key=lambda t: abs(t - f.t_us))
        expected = 1e3 * profile.at(speeds[nearest])
        assert decoded(f)["gradient"] == pytest.approx(expected, abs=0.5)


def state(omega, v, effort, load, gradient=0.0):
    return PlantState(*(np.asarray(x, float) for x in (omega,)), v, np.asarray(effort, float),
                      np.asarray(load, float), gradient)  # fmt: skip


def sensors_of(noise, rng):
    return RoleSensors(packaged_messages(DATABASE), noise, rng, PERFECT, Locomotive())


def one_round(before, after=None, noise=SILENT, rng=None, until=2_000):
    sensors = sensors_of(noise, rng or np.random.default_rng(1))
    frames = sensors.due(after or before, before, 0, until)
    return {name: value for f in frames for name, value in decoded(f).items()}, frames


def test_without_noise_the_values_are_the_state_rounded_to_the_factor():
    rng = np.random.default_rng(2)
    omega, effort = rng.uniform(0, 130, 6), rng.uniform(-3e5, 3e5, 6)
    load = rng.uniform(1e5, 3e5, 6)
    values, frames = one_round(state(omega, 17.123456, effort, load, -0.0123))
    assert len(frames) == 9
    for axle in range(1, 7):
        assert values[f"w{axle}"] == pytest.approx(omega[axle - 1], abs=0.001 + 1e-9)
        assert values[f"f{axle}"] == pytest.approx(effort[axle - 1], abs=5 + 1e-6)
        assert values[f"n{axle}"] == pytest.approx(load[axle - 1], abs=5 + 1e-6)
    assert values["v"] == pytest.approx(17.123456, abs=0.001 + 1e-9)
    assert values["gradient"] == pytest.approx(-12.3, abs=0.005 + 1e-9)


def test_a_frame_within_a_step_carries_the_state_of_its_stamp():
    before = state(np.full(6, 10.0), 10.0, np.full(6, 1e4), np.full(6, 2e5))
    after = state(np.full(6, 30.0), 12.0, np.full(6, 3e4), np.full(6, 2.4e5))
    values, frames = one_round(before, after)
    share = {f.arbitration_id: f.t_us / 2000 for f in frames}
    assert values["w4"] == pytest.approx(10 + 20 * share[0x102], abs=0.002)
    assert values["v"] == pytest.approx(10 + 2 * share[0x111], abs=0.002)
    assert values["f1"] == pytest.approx(1e4 + 2e4 * share[0x121], abs=10)
    assert values["n6"] == pytest.approx(2e5 + 4e4 * share[0x132], abs=10)


def test_values_beyond_the_range_saturate_below_not_available():
    sensors = sensors_of(SILENT, np.random.default_rng(1))
    calm = state(np.full(6, 20.0), 12.0, np.full(6, 4e4), np.full(6, 2.4e5))
    beyond = state(np.full(6, 1e4), 1e4, [1e7, -1e7, 0, 0, 0, 0], np.full(6, 1e9))
    assert len(sensors.due(calm, calm, 0, 2_000)) == 9
    assert sensors.saturation() == []
    frames = sensors.due(beyond, calm, 2_000, 202_000)
    values = {name: value for f in frames for name, value in decoded(f).items()}
    assert values["w1"] == 0xFFFE * 0.002
    assert values["v"] == 0xFFFE * 0.002
    assert values["f1"] == 0x7FFE * 10
    assert values["f2"] == -0x8000 * 10
    assert values["n1"] == 0xFFFE * 10
    assert any(line.startswith("axle_load.1 (AxleLoads1.") for line in sensors.saturation())


def test_speeds_are_magnitudes_under_noise():
    rng = np.random.default_rng(3)
    loud = SensorNoiseSettings(wheel_speed=1.0, vehicle_speed=1.0)
    standing = state(np.zeros(6), 0.0, np.zeros(6), np.full(6, 2e5))
    for _ in range(20):
        values, _ = one_round(standing, noise=loud, rng=rng)
        assert all(0 <= values[f"w{axle}"] < 10 for axle in range(1, 7))
        assert 0 <= values["v"] < 10


def test_noise_is_white_and_of_its_stated_size():
    noise = SensorNoiseSettings(0.05, 0.1, 2450.0, 800.0)
    sensors = sensors_of(noise, np.random.default_rng(4))
    calm = state(np.full(6, 20.0), 12.0, np.full(6, 4e4), np.full(6, 2.4e5))
    seen = defaultdict(list)
    for k in range(20_000):
        for f in sensors.due(calm, calm, 2000 * k, 2000 * k + 2000):
            for name, value in decoded(f).items():
                seen[name].append(value)
    for names, mean, std in (("w", 20.0, 0.05), ("f", 4e4, 2450.0), ("n", 2.4e5, 800.0)):
        # The last step may hold a frame of the first bogie and not yet of the second.
        n = min(len(seen[f"{names}{axle}"]) for axle in range(1, 7))
        columns = np.array([seen[f"{names}{axle}"][:n] for axle in range(1, 7)])
        # Six standard errors everywhere: one false alarm in ten million seeds.
        assert columns.mean(axis=1) == pytest.approx([mean] * 6, abs=6 * std / np.sqrt(n))
        assert columns.std(axis=1) == pytest.approx([std] * 6, rel=6 / np.sqrt(2 * n))
        # Axles and moments know nothing of each other.
        assert np.abs(np.corrcoef(columns) - np.eye(6)).max() < 6 / np.sqrt(n)
        for column in columns:
            centred = column - column.mean()
            assert abs(centred[1:] @ centred[:-1]) < 6 * centred @ centred / np.sqrt(n)
    speeds = np.array(seen["v"])
    # Rounded to 0.002, which is a fiftieth of the spread.
    assert kstest((speeds - 12.0) / 0.1, "norm").pvalue > 1e-6


def test_same_seed_same_bytes_other_seed_other_bytes():
    one, same, other = (frames_of(seed=seed)[0] for seed in (1, 1, 2))
    assert one == same
    assert [f.t_us for f in one] == [f.t_us for f in other]
    different = sum(a.data != b.data for a, b in zip(one, other, strict=True))
    assert different > 0.5 * len(one)


def test_axles_that_the_vehicle_has_not_are_not_available():
    # All ones is the contract's word; 0 rad/s at 36 km/h would be a locked wheel.
    vehicle = Locomotive((0.6,) * 4, (2e5,) * 4, geometry=None)
    frames, _ = frames_of("dry", 0.1, vehicle=vehicle)
    groups = by_id(frames)
    for frame_id, signed in ((0x102, False), (0x122, True), (0x132, False)):
        for f in groups[frame_id]:
            ones = 0x7FFF if signed else 0xFFFF
            assert raw_of(f.data, 16, 16, signed) != ones  # axle 4 is there
            assert raw_of(f.data, 32, 16, signed) == ones
            assert raw_of(f.data, 48, 16, signed) == ones
