"""Samples from readings, against a batch computation that sees everything at once."""

from bisect import bisect_left
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from adhesion_can.physics.instruments import Instruments
from adhesion_can.physics.readings import Direction, Reading, Role
from adhesion_can.physics.samples import Sample
from adhesion_can.physics.vehicle import Geometry, Locomotive
from adhesion_can.sampling.equations import SamplingSettings
from adhesion_can.sampling.former import SampleFormer

FIXED = settings(derandomize=True, deadline=None, max_examples=60)
CYCLES = {
    Role.WHEEL_SPEED: 10_000,
    Role.VEHICLE_SPEED: 20_000,
    Role.TRACTIVE_EFFORT: 10_000,
    Role.AXLE_LOAD: 200_000,
}
GAP_CYCLES = 3.0
W, V, F, N = Role.WHEEL_SPEED, Role.VEHICLE_SPEED, Role.TRACTIVE_EFFORT, Role.AXLE_LOAD
VEHICLE = Locomotive(
    wheel_radius=(0.625, 0.62, 0.615, 0.61, 0.63, 0.622),
    axle_load=(245e3, 244e3, 243e3, 242e3, 241e3, 240e3),
    wheelset_inertia=210.0,
)


# ------------------------------------------------------------------------------- the oracle


def transfer_matrix(geometry: Geometry) -> np.ndarray:
    """Change of load of axle i by effort of axle j, from each bogie's balance; shape (6, 6).

    Two equations for three equal springs: the solution of smallest norm is theirs.
    """
    arm = geometry.axle_spacing * np.array([1.0, 0.0, -1.0])
    balance = np.vstack([np.ones(3), arm])
    pull = geometry.coupler_height - geometry.traction_height
    columns = []
    for j in range(6):
        parts = []
        for bogie, side in ((0, -1.0), (1, 1.0)):
            own = 1.0 if j // 3 == bogie else 0.0
            right = [side * pull / geometry.pivot_distance, -own * geometry.traction_height]
            parts.append(np.linalg.lstsq(balance, np.array(right), rcond=None)[0])
        columns.append(np.concatenate(parts))
    return np.array(columns).T


def deduplicated(readings, role, axle):
    """(stamps, values) of one signal; of one stamp the later reading counts."""
    track = {}
    for r in readings:
        if r.role is role and r.axle == axle:
            track[r.t_us] = r.value
    return np.array(list(track), dtype=np.int64), list(track.values())


def between(track, t, gap):
    """Value at t by np.interp on the two readings around it; None where there are none."""
    times, values = track
    k = bisect_left(times, t)
    if k == len(times):
        return None
    if times[k] == t:
        return values[k]
    if k == 0 or values[k] is None or values[k - 1] is None or times[k] - times[k - 1] > gap:
        return None
    return float(np.interp(t, times[k - 1 : k + 1], values[k - 1 : k + 1]))


def held(track, t, gap):
    """Last value at or before t; None where it is not available or older than the gap."""
    times, values = track
    last = np.searchsorted(times, t, side="right") - 1
    return values[last] if last >= 0 and t - times[last] <= gap else None


def transfer_since(matrix_row, efforts, since, t, gap):
    """Load transferred between two times, by the efforts known at both."""
    moved = 0.0
    for share, track in zip(matrix_row, efforts, strict=True):
        before, now = held(track, since, gap), held(track, t, gap)
        if before is not None and now is not None:
            moved += share * (now - before)
    return moved


def load_changes(readings, vehicle, travel=1.0):
    """Rows (stamp, change of the transfer, change of the load) between readings of the loads."""
    matrix = transfer_matrix(vehicle.geometry)
    efforts = [deduplicated(readings, F, axle) for axle in range(1, vehicle.axles + 1)]
    gap = GAP_CYCLES * CYCLES[F]
    rows = []
    for axle in range(1, vehicle.axles + 1):
        times, loads = deduplicated(readings, N, axle)
        for k in range(1, len(times)):
            since, t = times[k - 1], times[k]
            known = all(held(e, at, gap) is not None for e in efforts for at in (since, t))
            late = t - since > GAP_CYCLES * CYCLES[N]
            if known and not late and loads[k] is not None and loads[k - 1] is not None:
                moved = travel * transfer_since(matrix[axle - 1], efforts, since, t, gap)
                rows.append((t, moved, loads[k] - loads[k - 1]))
    return np.array(sorted(rows)).reshape(-1, 3)


def follows(changes, t, vehicle):
    """Gain of the loads on the transfer by time t, and standard deviation of what they miss."""
    _, x, y = changes[changes[:, 0] <= t].T
    prior = (0.01 * np.mean(vehicle.axle_load)) ** 2
    rough = y - x * (x @ y) / (x @ x + prior)
    var = (10 * prior + rough @ rough) / (10 + len(x))
    gain = (x @ y) / (x @ x + var)
    rest = y - gain * x
    scatter = (x**2 @ rest**2 - var * (x @ x)) / (np.sum(x**4) + prior**2)
    return gain, np.sqrt(var / (x @ x + var) + min(max(scatter, 0.0), 1.0))


def batch(readings, vehicle, *, v_min=1.0, min_share=0.1, travel=1.0):
    """{(t, axle): (slip, adhesion, creep, v, load, load_std)} of all samples there can be."""
    gap = {role: GAP_CYCLES * us for role, us in CYCLES.items()}
    speed = deduplicated(readings, V, 0)
    effort = {i: deduplicated(readings, F, i) for i in range(1, vehicle.axles + 1)}
    matrix = None if vehicle.geometry is None else transfer_matrix(vehicle.geometry)
    efforts = list(effort.values())
    changes = None if matrix is None else load_changes(readings, vehicle, travel)
    out = {}
    for axle in range(1, vehicle.axles + 1):
        times, omega = deduplicated(readings, W, axle)
        load_times, loads = deduplicated(readings, N, axle)
        r, static = vehicle.wheel_radius[axle - 1], vehicle.axle_load[axle - 1]
        for k in range(1, len(times) - 1):
            t = times[k]
            if (
                None in omega[k - 1 : k + 2]
                or max(times[k + 1] - times[k], times[k] - times[k - 1]) > gap[W]
            ):
                continue
            v, force = between(speed, t, gap[V]), between(effort[axle], t, gap[F])
            if v is None or force is None or v < v_min:
                continue
            load, load_std = static, vehicle.load_std * static
            last = np.searchsorted(load_times, t, side="right") - 1
            if last >= 0 and t - load_times[last] <= gap[N] and loads[last] is not None:
                load, load_std = loads[last], 0.0
            elif matrix is not None:
                all_efforts = [between(effort[j], t, gap[F]) for j in range(1, 7)]
                if None in all_efforts:
                    # Then what moves is not known, and its size under the own effort is doubt.
                    doubt = force * matrix[axle - 1].sum()
                    load_std = float(np.sqrt(load_std**2 + doubt**2))
                else:
                    load = static + travel * float(matrix[axle - 1] @ np.array(all_efforts))
            if load < min_share * static:
                continue
            if load_std == 0.0 and matrix is not None:
                row, since = matrix[axle - 1], load_times[last]
                gain, _ = follows(changes, t, vehicle)
                load += gain * travel * transfer_since(row, efforts, since, t, gap[F])
            accel = (omega[k + 1] - omega[k - 1]) / ((times[k + 1] - times[k - 1]) * 1e-6)
            out[int(t), axle] = (
                r * omega[k] / v - 1.0,
                (force - vehicle.wheelset_inertia * accel / r) / load,
                r * omega[k] - v,
                v,
                load,
                load_std,
            )
    return out


def formed_by(former, readings, every_us=20_000):
    """Everything collected on a clock of its own, and at the end."""
    samples, due = [], every_us
    for r in readings:
        while r.t_us >= due:
            samples += former.collect(due).to_rows()
            due += every_us
        former.add(r)
    return samples + former.collect(readings[-1].t_us).to_rows()


def compare(samples, expected):
    assert len(samples) == len({(s.t_us, s.axle) for s in samples})
    assert {(s.t_us, s.axle) for s in samples} == set(expected)
    for s in samples:
        got = (s.slip, s.adhesion, s.creep_speed, s.speed, s.load, s.load_std)
        assert got == pytest.approx(expected[s.t_us, s.axle], rel=1e-9, abs=1e-9)


# ------------------------------------------------------------------------ the random readings


def stream(
    rng, role, axle, until_us, value, *, phase=None, lost=0.0, none=0.0, twice=0.0, jitter=0
):
    """Readings of one signal at its cycle, with everything that a bus does to them."""
    cycle = CYCLES[role]
    t = int(rng.integers(0, cycle)) if phase is None else phase
    out, skip, last = [], 0, -1
    while t < until_us:
        stamp = max(t + int(rng.integers(-jitter, jitter + 1)), last + 1, 0)
        if skip:
            skip -= 1
        elif rng.random() < lost:
            # One or two frames, which a bracket spans, or eight and more, which none does.
            skip = int(rng.choice([0, 1, 8, 15]))
        else:
            last = stamp
            number = None if rng.random() < none else float(value(stamp * 1e-6))
            if rng.random() < twice:
                out.append(Reading(stamp, role, axle, float(value(0.0))))
            out.append(Reading(stamp, role, axle, number))
        t += cycle
    return out


def drive(rng, vehicle, until_us=600_000, *, loads=True, speed=12.0, skip=(), **faults):
    """Readings of all axles in the order of their stamps."""
    signals = []
    for axle in range(1, vehicle.axles + 1):
        r, phase = vehicle.wheel_radius[axle - 1], rng.uniform(0, 6)
        signals += [
            (W, axle, lambda t, r=r, p=phase: (speed / r) * (1.05 + 0.04 * np.sin(9 * t + p))),
            (F, axle, lambda t, p=phase: 6e4 * np.sin(5 * t + p)),
        ]
        if loads:
            signals.append((N, axle, lambda t, p=phase: 2.4e5 + 5e3 * np.sin(2 * t + p)))
    signals.append((V, 0, lambda t: speed + 0.3 * t))
    readings = []
    # Efforts come at one phase: whoever has the own one in hand has the others' too.
    shared = int(rng.integers(0, 10_000))
    for role, axle, value in signals:
        if (role, axle) in skip or role in skip:
            continue
        phase = shared if role is F else None
        readings += stream(rng, role, axle, until_us, value, phase=phase, **faults)
    order = sorted(range(len(readings)), key=lambda i: (readings[i].t_us, i))
    return [readings[i] for i in order]


# ---------------------------------------------------------------------------------- the tests


@pytest.mark.costly
@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize(
    "faults",
    [
        {},
        {"jitter": 900},
        {"lost": 0.05},
        {"none": 0.03},
        {"twice": 0.1},
        {"lost": 0.04, "none": 0.02, "twice": 0.05},
    ],
    ids=str,
)
@pytest.mark.parametrize("loads", [True, False])
def test_samples_are_those_of_a_batch_computation(seed, faults, loads):
    rng = np.random.default_rng(100 + seed)
    # A load that is not measured wants all six efforts: with faults the transfer is left out.
    vehicle = replace(VEHICLE, geometry=None) if faults else VEHICLE
    readings = drive(rng, vehicle, 1_500_000, loads=loads, **faults)
    expected = batch(readings, vehicle)
    assert len(expected) > 50
    compare(formed_by(SampleFormer(vehicle, CYCLES), readings), expected)


def test_transfer_in_the_test_is_the_vehicles():
    # The oracle's own check: two derivations of the same balance.
    effort = np.array([1.0, -2.0, 3.0, 4.0, 5.0, -6.0]) * 1e4
    assert np.allclose(transfer_matrix(Geometry()) @ effort, Geometry().load_transfer(effort))


@pytest.mark.parametrize(("direction", "travel"), [(Direction.FORWARD, 1), (Direction.REVERSE, -1)])
def test_unmeasured_loads_move_with_the_effort_and_turn_round_in_reverse(direction, travel):
    rng = np.random.default_rng(7)
    readings = [Reading(0, Role.DIRECTION, 0, float(direction)), *drive(rng, VEHICLE, loads=False)]
    expected = batch(readings, VEHICLE, travel=travel)
    samples = formed_by(SampleFormer(VEHICLE, CYCLES), readings)
    compare(samples, expected)
    assert max(abs(s.load - VEHICLE.axle_load[s.axle - 1]) for s in samples) > 5e3
    assert all(s.load_std == pytest.approx(0.02 * VEHICLE.axle_load[s.axle - 1]) for s in samples)


@pytest.mark.parametrize(("direction", "travel"), [(Direction.FORWARD, 1), (Direction.REVERSE, -1)])
def test_what_loads_may_miss_of_the_transfer_is_stated_as_an_error(direction, travel):
    rng = np.random.default_rng(11)
    readings = [Reading(0, Role.DIRECTION, 0, float(direction)), *drive(rng, VEHICLE)]
    samples = formed_by(SampleFormer(VEHICLE, CYCLES), readings)
    rigid = replace(VEHICLE, geometry=None)
    held_still = {(s.t_us, s.axle): s for s in formed_by(SampleFormer(rigid, CYCLES), readings)}
    matrix = transfer_matrix(VEHICLE.geometry)
    efforts = [deduplicated(readings, F, axle) for axle in range(1, 7)]
    changes = load_changes(readings, VEHICLE, travel)
    largest = 0.0
    for s in samples:
        if s.load_std > 0.0:
            continue
        stamps, _ = deduplicated(readings, N, s.axle)
        since = stamps[np.searchsorted(stamps, s.t_us, side="right") - 1]
        moved = transfer_since(matrix[s.axle - 1], efforts, since, s.t_us, GAP_CYCLES * CYCLES[F])
        gain, std = follows(changes, s.t_us, VEHICLE)
        rest = held_still[s.t_us, s.axle]
        assert s.load == pytest.approx(rest.load + gain * travel * moved)
        further = (s.adhesion * std * moved / s.load) ** 2
        own = rest.transient_var * (rest.load / s.load) ** 2
        assert s.transient_var == pytest.approx(own + further, abs=1e-15)
        largest = max(largest, abs(moved))
    assert largest > 3e3


def moving(seed, gain, duration_us=6_000_000, late_us=0):
    """Readings of efforts that jump, beside loads that follow them with a gain and a delay."""
    rng = np.random.default_rng(seed)
    matrix, readings = transfer_matrix(VEHICLE.geometry), []
    knots = np.arange(0, duration_us + 1, 330_000)
    levels = rng.uniform(-6e4, 6e4, (6, len(knots)))

    def efforts(t_us):
        return np.array([np.interp(t_us, knots, own) for own in levels])

    for t in range(0, duration_us, 10_000):
        readings += [Reading(t, W, i, 16.2 + 0.001 * rng.normal()) for i in range(1, 7)]
        readings += [Reading(t, F, i, float(f)) for i, f in enumerate(efforts(t), 1)]
        if t % 20_000 == 0:
            readings.append(Reading(t, V, 0, 10.0))
        if t % 200_000 == 0:
            loads = np.array(VEHICLE.axle_load) + gain * matrix @ efforts(max(t - late_us, 0))
            loads += 300.0 * rng.standard_normal(6)
            readings += [Reading(t, N, i, float(load)) for i, load in enumerate(loads, 1)]
    return (
        readings,
        lambda axle, t: VEHICLE.axle_load[axle - 1] + gain * float(matrix[axle - 1] @ efforts(t)),
    )


@pytest.mark.parametrize("gain", [1.0, 0.5, 0.0, -1.0])
@pytest.mark.parametrize("seed", [1, 2])
def test_loads_are_carried_on_as_they_follow_the_efforts(seed, gain):
    """A signal that follows, one of a single spring, a scale, and a train whose front is behind."""
    readings, true_load = moving(seed, gain)
    samples = formed_by(SampleFormer(VEHICLE, CYCLES), readings)
    settled = [s for s in samples if s.t_us > 3_000_000]
    errors = np.array([s.load - true_load(s.axle, s.t_us) for s in settled])
    assert np.sqrt(np.mean(errors**2)) < 450.0
    held_still = formed_by(SampleFormer(replace(VEHICLE, geometry=None), CYCLES), readings)
    errors = [s.load - true_load(s.axle, s.t_us) for s in held_still if s.t_us > 3_000_000]
    assert gain == 0.0 or np.sqrt(np.mean(np.square(errors))) > 1000.0 * abs(gain)


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_loads_that_follow_late_state_a_larger_error(seed):
    def stated(late_us):
        readings, _ = moving(seed, 1.0, late_us=late_us)
        samples = formed_by(SampleFormer(VEHICLE, CYCLES), readings)
        return np.mean([s.transient_var / s.adhesion**2 for s in samples if s.t_us > 3_000_000])

    assert stated(150_000) > 9.0 * stated(0)


def test_loads_measured_once_an_effort_stands_are_taken_as_they_are():
    rng = np.random.default_rng(12)
    readings = [replace(r, value=5e4) if r.role is F else r for r in drive(rng, VEHICLE)]
    rigid = replace(VEHICLE, geometry=None)
    with_transfer, without = (
        [s for s in formed_by(SampleFormer(v, CYCLES), readings) if s.load_std == 0.0]
        for v in (VEHICLE, rigid)
    )
    assert with_transfer == without
    assert len(with_transfer) > 100


def test_reverse_survives_a_direction_that_is_not_available():
    # 3 says that the sender does not know just now; the train has not turned round.
    readings = drive(np.random.default_rng(7), VEHICLE, loads=False)
    reverse = Reading(0, Role.DIRECTION, 0, float(Direction.REVERSE))
    lost = Reading(1, Role.DIRECTION, 0, float(Direction.NOT_AVAILABLE))
    plain = formed_by(SampleFormer(VEHICLE, CYCLES), [reverse, *readings])
    assert formed_by(SampleFormer(VEHICLE, CYCLES), [reverse, lost, *readings]) == plain


def test_without_transfer_the_direction_changes_nothing():
    # Speeds are magnitudes and effort is along the travel: the sign is that of traction.
    vehicle = replace(VEHICLE, geometry=None)
    readings = drive(np.random.default_rng(3), vehicle)
    forward, reverse = (
        formed_by(
            SampleFormer(vehicle, CYCLES), [Reading(0, Role.DIRECTION, 0, float(d)), *readings]
        )
        for d in (Direction.FORWARD, Direction.REVERSE)
    )
    assert forward == reverse
    assert {np.sign(s.slip) for s in forward} == {1.0, -1.0}
    assert all(np.sign(s.slip) == np.sign(s.creep_speed) for s in forward)


@pytest.mark.parametrize("missing", [(W, 2), (F, 2), (N, 2)], ids=str)
def test_an_axle_without_a_signal_does_not_hinder_the_others(missing):
    rng = np.random.default_rng(5)
    readings = drive(rng, VEHICLE, skip={missing})
    expected = batch(readings, VEHICLE)
    samples = formed_by(SampleFormer(VEHICLE, CYCLES), readings)
    compare(samples, expected)
    assert {s.axle for s in samples} == set(range(1, 7)) - ({2} if missing[0] is not N else set())


def test_effort_that_no_one_sends_leaves_its_transfer_as_doubt():
    readings = drive(np.random.default_rng(6), VEHICLE, loads=False, skip={(F, 5)})
    samples = formed_by(SampleFormer(VEHICLE, CYCLES), readings)
    compare(samples, batch(readings, VEHICLE))
    busy = [s for s in samples if s.axle == 1 and abs(s.adhesion) > 0.1]
    assert busy
    assert all(s.load_std > 0.02 * VEHICLE.axle_load[0] for s in busy)


@pytest.mark.parametrize("role", [W, V, F], ids=str)
def test_no_sample_without_a_required_input(role):
    readings = drive(np.random.default_rng(8), VEHICLE, skip={role})
    former = SampleFormer(VEHICLE, CYCLES)
    assert formed_by(former, readings) == []
    if role is not W:
        assert sum(former.dropped.values()) > 0


def test_vehicle_speed_none_costs_its_brackets_and_no_others():
    rng = np.random.default_rng(9)
    readings = drive(rng, VEHICLE)
    some = [r.t_us for r in readings if r.role is V][10]
    broken = [replace(r, value=None) if r.role is V and r.t_us == some else r for r in readings]
    whole = {(s.t_us, s.axle): s for s in formed_by(SampleFormer(VEHICLE, CYCLES), readings)}
    rest = {(s.t_us, s.axle): s for s in formed_by(SampleFormer(VEHICLE, CYCLES), broken)}
    assert all(whole[key] == s for key, s in rest.items())
    lost = set(whole) - set(rest)
    assert lost
    assert all(abs(t - some) < CYCLES[V] for t, _ in lost)


def test_samples_begin_at_v_min():
    vehicle = replace(VEHICLE, geometry=None)
    readings = []
    for k in range(200):
        t = 10_000 * k
        v = 0.005 * k  # 0 .. 1 m/s
        readings.append(Reading(t, V, 0, v))
        for axle in (1, 2):
            readings += [Reading(t, W, axle, 2 * v), Reading(t, F, axle, 1e4)]
    for v_min in (0.25, 0.5):
        former = SampleFormer(vehicle, CYCLES, SamplingSettings(v_min=v_min))
        samples = formed_by(former, readings)
        assert min(s.speed for s in samples) == pytest.approx(v_min)
        assert former.dropped["below v_min"] > 0
        compare(samples, batch(readings, vehicle, v_min=v_min))


def test_a_load_too_low_to_be_true_gives_no_sample():
    readings = []
    for k in range(60):
        t = 10_000 * k
        low = 0.099 if k >= 30 else 0.101
        readings += [
            Reading(t, V, 0, 10.0),
            Reading(t, W, 1, 17.0),
            Reading(t, F, 1, 1e4),
            Reading(t, N, 1, low * VEHICLE.axle_load[0]),
        ]
    samples = formed_by(SampleFormer(VEHICLE, CYCLES), readings)
    assert {s.t_us for s in samples} == {10_000 * k for k in range(1, 30)}


def test_a_stale_or_missing_measured_load_falls_back_to_the_static_one():
    vehicle = replace(VEHICLE, geometry=None)
    readings = [Reading(0, N, 1, 2.0e5)]
    for k in range(1, 100):
        t = 10_000 * k
        readings += [Reading(t, V, 0, 10.0), Reading(t, W, 1, 17.0), Reading(t, F, 1, 1e4)]
    for s in formed_by(SampleFormer(vehicle, CYCLES), readings):
        fresh = s.t_us <= GAP_CYCLES * CYCLES[N]
        assert (s.load, s.load_std) == ((2.0e5, 0.0) if fresh else (245e3, 0.02 * 245e3))


def wheel_gap(cycles):
    """One axle, steady but for a gap of so many cycles in the wheel speed; samples by stamp."""
    readings = []
    for k in range(60):
        t = 10_000 * k
        readings += [Reading(t, V, 0, 10.0), Reading(t, F, 1, 1e4)]
        if not 30 < k < 30 + cycles:
            readings.append(Reading(t, W, 1, 17.0 + 0.01 * k))
    samples = formed_by(SampleFormer(replace(VEHICLE, geometry=None), CYCLES), readings)
    return {s.t_us // 10_000 for s in samples}


@pytest.mark.parametrize("cycles", [1, 2, 3])
def test_a_wheel_gap_up_to_the_allowed_one_is_bridged(cycles):
    assert wheel_gap(cycles) == set(range(1, 59)) - set(range(31, 30 + cycles))


@pytest.mark.parametrize("cycles", [4, 5, 6, 12])
def test_a_wheel_gap_beyond_the_allowed_one_brackets_nothing(cycles):
    # 'readings further apart than this many of their cycles bracket nothing': the two samples at
    # the gap's ends have no acceleration of their own moment.
    assert wheel_gap(cycles) == set(range(1, 30)) | set(range(31 + cycles, 59))


def test_acceleration_is_exact_for_a_wheel_speed_of_constant_acceleration():
    # Uneven stamps around one sample: a quadratic speed is what a skewed difference gets wrong.
    vehicle = replace(VEHICLE, geometry=None)
    stamps = [0, 10_000, 20_000, 24_000, 44_000, 54_000, 64_000]
    readings = []
    for t in stamps:
        s = t * 1e-6
        readings += [
            Reading(t, V, 0, 10.0),
            Reading(t, F, 1, 0.0),
            Reading(t, W, 1, 17.0 + 30.0 * s),
        ]
    for s in formed_by(SampleFormer(vehicle, CYCLES), readings):
        force = -vehicle.wheelset_inertia * 30.0 / vehicle.wheel_radius[0]
        assert s.adhesion * s.load == pytest.approx(force, rel=1e-9)


READINGS = st.lists(
    st.tuples(
        st.integers(0, 25_000),
        st.sampled_from([(W, 1), (W, 2), (F, 1), (F, 2), (V, 0), (N, 1)]),
        st.one_of(st.none(), st.floats(2.0, 20.0)),
    ),
    min_size=4,
    max_size=120,
)


@settings(FIXED, max_examples=200)
@given(READINGS, st.integers(1, 9))
def test_no_sample_is_ever_extrapolated(steps, every):
    vehicle = Locomotive(wheel_radius=(0.6, 0.6), axle_load=(20.0, 20.0), geometry=None)
    former = SampleFormer(vehicle, CYCLES)
    t, readings, samples = 0, [], []
    for k, (dt, (role, axle), value) in enumerate(steps):
        t += dt
        readings.append(Reading(t, role, axle, value))
        former.add(readings[-1])
        if k % every == 0:
            seen = former.collect(t).to_rows()
            # What a sample needs stands in what was there when it was formed.
            known = list(readings)
            samples += [(s, known) for s in seen]
            assert [(s.t_us, s.axle) for s in seen] == sorted((s.t_us, s.axle) for s in seen)
    for s, known in samples:
        for role, axle in ((V, 0), (F, s.axle), (W, s.axle)):
            stamps = [r.t_us for r in known if (r.role, r.axle) == (role, axle)]
            assert min(stamps) <= s.t_us <= max(stamps)
        wheel = {r.t_us for r in known if (r.role, r.axle) == (W, s.axle)}
        assert s.t_us in wheel
        assert min(wheel) < s.t_us < max(wheel)
        speeds = [r.value for r in known if r.role is V and r.value is not None]
        assert min(speeds) <= s.speed <= max(speeds)
        assert np.isfinite([s.slip, s.adhesion, s.slip_var, s.adhesion_var]).all()
    assert len(samples) == len({(s.t_us, s.axle) for s, _ in samples})


def test_samples_do_not_depend_on_how_often_they_are_collected():
    rng = np.random.default_rng(11)
    readings = drive(rng, VEHICLE)
    often = formed_by(SampleFormer(VEHICLE, CYCLES), readings, every_us=1_000)
    seldom = formed_by(SampleFormer(VEHICLE, CYCLES), readings, every_us=100_000)
    assert sorted(often, key=lambda s: (s.t_us, s.axle)) == seldom


@pytest.mark.parametrize("seed", range(6))
@pytest.mark.parametrize(
    "faults", [{}, {"jitter": 900}, {"lost": 0.05, "none": 0.02}, {"twice": 0.2}]
)
def test_a_copy_that_collects_ahead_takes_the_place_of_its_former(seed, faults):
    """Every 20 ms from a random time before, with those further readings that allow it."""
    rng = np.random.default_rng([seed, 4])
    readings = drive(rng, VEHICLE, **faults)
    former, plain = SampleFormer(VEHICLE, CYCLES), SampleFormer(VEHICLE, CYCLES)
    found, expected, served = [], [], 0
    for due_us in range(20_000, 600_000, 20_000):
        cut_us = int(rng.integers(due_us - 4_000, due_us))
        own = [r for r in readings if due_us - 20_000 <= r.t_us < due_us]
        early, late = ([r for r in own if (r.t_us < cut_us) is side] for side in (True, False))
        for reading in early:
            former.add(reading)
        ahead = former.copy()
        collected = ahead.collect(due_us).to_rows()
        follows = not ahead.gave_up
        for reading in late:
            former.add(reading)
            follows = follows and ahead.is_continued_by(reading)
            if follows:
                ahead.add(reading)
        if follows:
            served += 1
            former, collected = ahead, collected + ahead.collect(due_us).to_rows()
        else:
            collected = former.collect(due_us).to_rows()
        found.append(sorted(collected, key=lambda s: (s.t_us, s.axle)))
        for reading in own:
            plain.add(reading)
        expected.append(plain.collect(due_us).to_rows())
        assert former.dropped == plain.dropped
    assert found == expected
    assert served


def test_transfer_does_not_depend_on_how_often_samples_are_collected():
    # The rear bogie's effort comes at half the rate: its bracket closes later than the front's.
    readings = drive(np.random.default_rng(12), VEHICLE, loads=False)
    readings = [r for r in readings if r.role is not F or r.axle < 4 or (r.t_us // 10_000) % 2]
    often = formed_by(SampleFormer(VEHICLE, CYCLES), readings, every_us=1_000)
    seldom = formed_by(SampleFormer(VEHICLE, CYCLES), readings, every_us=100_000)
    assert sorted(often, key=lambda s: (s.t_us, s.axle)) == seldom


def test_covariates_are_those_of_the_samples_time():
    readings = []
    for k in range(100):
        t = 10_000 * k
        readings += [Reading(t, V, 0, 10.0), Reading(t, W, 1, 17.0), Reading(t, F, 1, 1e4)]
        if k == 50:
            readings.append(Reading(t, Role.SANDING, 0, 1.0))
    for every in (10_000, 100_000):
        for s in formed_by(SampleFormer(VEHICLE, CYCLES), readings, every_us=every):
            late = 20_000  # a sample waits a cycle or two for its bracket
            if s.t_us >= 500_000:
                assert s.covariates == {"sanding_active": 1.0}
            elif s.t_us < 500_000 - late:
                assert s.covariates == {}


def test_a_covariate_that_is_not_available_goes_away_and_leaves_old_samples_alone():
    former = SampleFormer(replace(VEHICLE, geometry=None), CYCLES)
    collected = []
    for k in range(30):
        t = 10_000 * k
        former.add(Reading(t, Role.HUMIDITY, 0, 60.0 if k < 15 else None))
        for r in (Reading(t, V, 0, 10.0), Reading(t, W, 1, 17.0), Reading(t, F, 1, 1e4)):
            former.add(r)
        collected += former.collect(t).to_rows()
    assert dict(collected[0].covariates) == {"relative_humidity_percent": 60.0}
    assert dict(collected[-1].covariates) == {}


def test_samples_that_wait_for_late_readings_have_the_channels_of_their_own_time():
    """The vehicle speed is 50 ms late: channels have moved on when a sample is formed."""
    late = Instruments(speed_delay=0.05)
    former = SampleFormer(Locomotive((0.6,), (2e5,), geometry=None), CYCLES, instruments=late)
    samples = []
    for t in range(0, 300_000, 10_000):
        if t % 20_000 == 0 and t >= 60_000:
            former.add(Reading(t, Role.HUMIDITY, 0, t / 10_000))
        for role, value in ((W, 17.0), (F, 1e4), (N, 2e5)):
            former.add(Reading(t, role, 1, value))
        former.add(Reading(t, V, 0, 10.0))
        samples += former.collect(t).to_rows()
    assert len(samples) > 15
    for s in samples:
        held = s.t_us // 20_000 * 2
        wanted = {"relative_humidity_percent": held} if s.t_us >= 60_000 else {}
        # Of one collection a channel counts only where all of its samples have it.
        assert dict(s.covariates) == wanted, s.t_us


def test_a_former_waits_until_a_wheel_speed_can_be_formed_or_given_up():
    former = SampleFormer(Locomotive((0.6,), (2e5,), geometry=None), CYCLES)
    assert former.waits(0)
    for t in (0, 10_000):
        former.add(Reading(t, W, 1, 17.0))
        former.add(Reading(t, V, 0, 10.0))
    assert former.waits(10_000)  # a central difference needs a third one
    former.add(Reading(20_000, W, 1, 17.0))
    assert not former.waits(20_000)
    assert not former.collect(20_000).to_rows()  # no effort yet
    for t in range(30_000, 60_000, 10_000):
        former.add(Reading(t, W, 1, 17.0))
    newest = former.equations.give_up_us + 10_000
    assert not former.waits(newest + 1)
    former.collect(newest + 1)
    assert former.dropped["no bracket"] == 1
    assert former.waits(newest + 1)  # the next one is newer than the vehicle speed


def test_two_readings_of_one_stamp_count_once_and_the_later_one():
    former = SampleFormer(replace(VEHICLE, geometry=None), CYCLES)
    for t in (0, 10_000, 20_000):
        former.add(Reading(t, V, 0, 10.0))
        former.add(Reading(t, F, 1, 1e4))
        former.add(Reading(t, W, 1, 99.0))
        former.add(Reading(t, W, 1, 16.0))
    (sample,) = former.collect(20_000).to_rows()
    assert sample.t_us == 10_000
    assert sample.slip == pytest.approx(0.0)
    assert sample.adhesion == pytest.approx(1e4 / 245e3)


def test_foreign_axles_are_passed_over():
    former = SampleFormer(Locomotive((0.6,), (2e5,), geometry=None), CYCLES)
    for t in (0, 10_000, 20_000):
        for axle in (1, 2, 7):
            for role, value in ((W, 17.0), (F, 1e4), (N, 2e5)):
                former.add(Reading(t, role, axle, value))
        former.add(Reading(t, V, 0, 10.0))
    assert [s.axle for s in former.collect(20_000).to_rows()] == [1]


def test_every_wheel_reading_is_a_sample_or_counted_as_dropped():
    rng = np.random.default_rng(14)
    readings = drive(rng, VEHICLE, lost=0.05, none=0.03)
    former = SampleFormer(VEHICLE, CYCLES)
    samples = formed_by(former, readings)
    samples += former.collect(10**9).to_rows()
    inner = sum(
        max(len(deduplicated(readings, W, axle)[0]) - 2, 0) for axle in range(1, VEHICLE.axles + 1)
    )
    assert len(samples) + sum(former.dropped.values()) == inner


def test_a_sample_is_a_sample():
    samples = formed_by(SampleFormer(VEHICLE, CYCLES), drive(np.random.default_rng(1), VEHICLE))
    assert all(isinstance(s, Sample) for s in samples)
