"""Columns of readings give the samples that readings one by one give, to the last bit."""

from dataclasses import fields, replace

import numpy as np
import pytest
from hypothesis import HealthCheck, example, given, settings
from hypothesis import strategies as st

from adhesion_can.physics.effects import ActiveEffect, build_instruments, effect_by_id
from adhesion_can.physics.instruments import PERFECT, Instruments
from adhesion_can.physics.readings import Reading, Role
from adhesion_can.physics.samples import Samples
from adhesion_can.physics.vehicle import Geometry, Locomotive
from adhesion_can.sampling.column_former import ColumnFormer
from adhesion_can.sampling.column_history import ColumnHistory
from adhesion_can.sampling.former import SampleFormer
from adhesion_can.sampling.signal_history import SignalHistory

CYCLES = {
    Role.WHEEL_SPEED: 10_000,
    Role.VEHICLE_SPEED: 20_000,
    Role.TRACTIVE_EFFORT: 10_000,
    Role.AXLE_LOAD: 200_000,
}
SLOW = {
    Role.CURVATURE: 210_000,
    Role.HUMIDITY: 300_000,
    Role.SANDING: 250_000,
    Role.DIRECTION: 170_000,
}
TWO_AXLES = Locomotive(
    wheel_radius=(0.625, 0.61),
    axle_load=(245e3, 230e3),
    wheelset_inertia=210.0,
    geometry=Geometry(axles_per_bogie=(2,)),
)
VEHICLES = {"six axles": Locomotive(), "two axles": TWO_AXLES,
            "no geometry": replace(TWO_AXLES, geometry=None)}  # fmt: skip
LATE = Instruments(
    radius_error={1: 0.01}, inertia_error=20.0, speed_error=0.01, speed_delay=0.035,
    effort_bias=2e3, effort_delay=0.02,
)  # fmt: skip
EARLY = Instruments(speed_delay=-0.03, effort_delay=-0.011)


def lawful(*effects, given=PERFECT):
    """Instruments with laws of effects: id, form and values each."""
    actives = [
        ActiveEffect(effect_by_id(name, form), tuple(values)) for name, form, *values in effects
    ]
    return build_instruments(actives, given)


SHIFT, GAIN = ("load_transfer", "heights", 1.2, 0.7), ("effort_gain", "axle", 0.1, 2.0)
HEAT, TIME = ("effort_gain", "heat", 0.1, 40.0), ("effort_gain", "time", 0.01)
STEP, PITCH = ("speed_error", "step", 0.01, 0.7), ("speed_error", "pitch", 0.1)
OFFSET, SMOOTH = ("speed_error", "offset", 2.0), ("speed_error", "low_pass", 0.4)
BEND, BLEND = ("curving_resistance", "", 2.0), ("brake_blending", "fade", 0.3, 12.0)
SWING = ("wheel_once_per_turn", "", 0.01, 1.0, 2.0)
INSTRUMENTS = {
    "perfect": PERFECT,
    "late": LATE,
    "early": EARLY,
    "shifted loads": lawful(SHIFT, GAIN),
    "memories": lawful(HEAT, TIME, SMOOTH, STEP),
    "other channels": lawful(OFFSET, BEND, PITCH),
    "late with laws": lawful(SHIFT, BLEND, SWING, HEAT, given=LATE),
    "early with laws": lawful(SWING, PITCH, given=EARLY),
}


def drive(seed, vehicle, faults, seconds=1.5):
    """Readings of a drive with all that can go wrong, in the order of their stamps."""
    rng = np.random.default_rng(seed)
    rows = []

    def signal(role, axle, cycle_us, value):
        if rng.random() < faults / 4:
            return  # never received
        begin = int(rng.integers(0, 2 * cycle_us)) + int(rng.random() < faults) * 300_000
        for nominal in range(begin, int(seconds * 1e6), cycle_us):
            if rng.random() < faults / 5:
                continue  # lost
            t_us = nominal + int(rng.integers(-cycle_us // 10, cycle_us // 10 + 1))
            copies = 2 if rng.random() < faults / 10 else 1
            for _ in range(copies):
                missing = rng.random() < faults / 10
                rows.append(Reading(max(t_us, 0), role, axle, None if missing else value()))
        if rng.random() < faults / 2 and len(rows) > 30:
            silent = int(rng.uniform(0, seconds) * 1e6)
            rows[:] = [
                r for r in rows
                if (r.role, r.axle) != (role, axle) or not silent < r.t_us < silent + 2e5
            ]  # fmt: skip

    for axle in range(1, vehicle.axles + 1):
        signal(Role.WHEEL_SPEED, axle, 10_000, lambda: float(16 + rng.normal()))
        signal(Role.TRACTIVE_EFFORT, axle, 10_000, lambda: float(3e4 + 1e4 * rng.normal()))
        if rng.random() < 0.5:
            signal(Role.AXLE_LOAD, axle, 200_000, lambda: float(rng.uniform(1e4, 3e5)))
    signal(Role.VEHICLE_SPEED, 0, 20_000, lambda: float(rng.choice([0.5, 10.0]) + rng.random()))
    signal(Role.HUMIDITY, 0, SLOW[Role.HUMIDITY], lambda: float(rng.uniform(0, 100)))
    signal(Role.SANDING, 0, SLOW[Role.SANDING], lambda: float(rng.integers(0, 2)))
    signal(Role.CURVATURE, 0, SLOW[Role.CURVATURE], lambda: float(rng.uniform(-0.003, 0.003)))
    signal(Role.DIRECTION, 0, SLOW[Role.DIRECTION], lambda: float(rng.integers(0, 4)))
    if rng.random() < faults:  # frames of one stamp
        rows = [replace(r, t_us=r.t_us // 5000 * 5000) for r in rows]
    return sorted(rows, key=lambda r: r.t_us)


def one_by_one(former, readings, due):
    out, waiting = [], iter([*readings, None])
    reading = next(waiting)
    for t_us in due:
        while reading is not None and reading.t_us < t_us:
            former.add(reading)
            reading = next(waiting)
        out.append(former.collect(t_us))
    return out


def in_columns(former, readings, due, cuts):
    """Block after block; a block's due times lie at or before its last stamp."""
    out = []
    for first, last in zip([0, *cuts], [*cuts, len(readings)], strict=True):
        own = readings[first:last]
        columns = {}
        for r in own:
            columns.setdefault((r.role, r.axle), []).append(r)
        former.add(
            {
                key: (
                    np.array([r.t_us for r in rows], dtype=np.int64),
                    np.array([np.nan if r.value is None else r.value for r in rows]),
                )
                for key, rows in columns.items()
            }
        )
        known = own[-1].t_us if last < len(readings) and own else 0
        end = max(due) if last == len(readings) else known
        now = [t for t in due[len(out) :] if t <= end]
        out += former.collect(np.array(now, dtype=np.int64))
    return out


def assert_same(a, b):
    assert len(a) == len(b)
    for one, other in zip(a, b, strict=True):
        for field in fields(Samples):
            if field.name == "covariates":
                assert one.covariates.keys() == other.covariates.keys()
                for name, column in one.covariates.items():
                    np.testing.assert_array_equal(column, other.covariates[name], name)
            else:
                np.testing.assert_array_equal(
                    getattr(one, field.name), getattr(other, field.name), field.name
                )


@pytest.mark.costly
@settings(deadline=None, max_examples=80, derandomize=True,
          suppress_health_check=[HealthCheck.data_too_large])  # fmt: skip
@given(
    st.integers(0, 2**32),
    st.sampled_from(list(VEHICLES)),
    st.sampled_from(list(INSTRUMENTS)),
    st.sampled_from([0.0, 0.1, 0.5, 1.0]),
    st.booleans(),
    st.integers(0, 6),
)
@example(1, "six axles", "perfect", 0.0, False, 3)
@example(2, "six axles", "late with laws", 0.1, True, 4)
@example(3, "no geometry", "memories", 0.1, False, 5)
@example(4, "two axles", "other channels", 0.5, True, 2)
def test_columns_give_what_readings_give(seed, vehicle, instruments, faults, travel, blocks):
    vehicle = VEHICLES[vehicle]
    settings_ = (CYCLES, None, None, INSTRUMENTS[instruments])
    readings = drive(seed, vehicle, faults)
    rng = np.random.default_rng(seed)
    start, step = 5000 * int(rng.integers(0, 10)), int(rng.choice([20_000, 20_000, 7_000, 90_000]))
    due = list(range(start, 2_200_000, step))
    cuts = sorted(int(c) for c in rng.integers(0, len(readings) + 1, blocks))
    one = SampleFormer(vehicle, *settings_, with_travel=travel)
    other = ColumnFormer(SampleFormer(vehicle, *settings_, with_travel=travel).equations)
    expected = one_by_one(one, readings, due)
    assert_same(in_columns(other, readings, due, cuts), expected)
    assert other.dropped == +one.dropped


def test_a_faultless_drive_gives_samples_at_all():
    """That two empty lists are equal shows nothing."""
    former = ColumnFormer(SampleFormer(Locomotive(), CYCLES).equations)
    readings = drive(1, Locomotive(), 0.0)
    got = in_columns(former, readings, list(range(0, 1_500_000, 20_000)), [500])
    assert sum(map(len, got)) > 6 * 70


def test_it_forgets_what_is_settled():
    former = ColumnFormer(SampleFormer(TWO_AXLES, CYCLES).equations)
    t = np.arange(0, 100_000, 10_000, dtype=np.int64)
    for block in range(200):
        at = t + 100_000 * block
        former.add(
            {
                (Role.WHEEL_SPEED, 1): (at, np.full(10, 16.0)),
                (Role.TRACTIVE_EFFORT, 1): (at, np.full(10, 3e4)),
                (Role.VEHICLE_SPEED, 0): (at, np.full(10, 10.0)),
                (Role.HUMIDITY, 0): (at, np.full(10, 50.0)),
            }
        )
        list(former.collect(at[::2]))
    tracks = [former._speed, former._wheel[1], *former._covariates.histories.values()]
    assert max(len(track.t_us) for track in tracks) < 40
    # Efforts are kept until the load that was measured with them is too old.
    cycles_of_load = former._equations.load_age_us / 10_000
    assert len(former._effort[1].t_us) < 40 + cycles_of_load


@pytest.mark.parametrize("first", [0, 5])
def test_an_empty_block_changes_nothing(first):
    former = ColumnFormer(SampleFormer(TWO_AXLES, CYCLES).equations)
    assert list(former.collect(np.empty(0, dtype=np.int64))) == []
    former.add({})
    assert [len(s) for s in former.collect(np.array([first, 20_000]))] == [0, 0]


def test_a_late_reading_before_time_zero_is_kept():
    """A recording that begins at 0, a model with a delay, a block that ends within the delay."""
    one, other = SignalHistory(60_000), ColumnHistory(60_000, lag_us=35_000)
    for stamps in ([0, 20_000], [40_000, 60_000]):
        for t_us in stamps:
            one.add(t_us - 35_000, float(t_us))
        other.extend(np.array(stamps), np.array(stamps, dtype=float))
    assert other.t_us.tolist() == one.times
    assert other.at(np.array([0])).value[0] == one.at(0)


def test_a_direction_that_is_no_direction_leaves_the_travel_as_it_was():
    odd = [1e30, 1.9, -1e300, 2.5]
    one = SampleFormer(TWO_AXLES, CYCLES, with_travel=True)
    other = ColumnFormer(one.equations)
    stamps = np.arange(4, dtype=np.int64) * 1000
    other.add({(Role.DIRECTION, 0): (stamps, np.array(odd))})
    for t_us, value in zip(stamps.tolist(), odd, strict=True):
        one.add(Reading(t_us, Role.DIRECTION, 0, value))
    assert other._direction.value[-1] == one._travel == -1.0
    assert other._direction.value.tolist() == [1.0, 1.0, 1.0, -1.0]
