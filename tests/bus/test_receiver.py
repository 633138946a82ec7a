"""Frames in, readings out: every reason to reject, and what a rejected frame must not do."""

import itertools
import struct
from collections import Counter
from dataclasses import replace
from math import inf
from pathlib import Path

import numpy as np
import pytest
from cantools.database import load_string
from hypothesis import given, settings
from hypothesis import strategies as st

from adhesion_can.bus.block import Block
from adhesion_can.bus.database import CanDatabase, load_database
from adhesion_can.bus.frame import Frame
from adhesion_can.bus.receiver import Receiver
from adhesion_can.bus.rejection import Rejection
from adhesion_can.bus.roles import SignalChoice, bind, cycles_by_role, packaged_choices
from adhesion_can.config import load_configuration
from adhesion_can.errors import ConfigError, RecordingError
from adhesion_can.offline.recording_fit import SeenIds, require_accepted
from adhesion_can.physics.readings import Reading, Role
from tests.bus.bus_helpers import payload_of, sealed

RADII = (0.625,) * 6
DATABASE = load_database()
BOUND = bind(packaged_choices(), DATABASE, RADII, "test")
MS = 1000


def receiver():
    return Receiver(BOUND)


def wheel_payload(count=0, *, speeds=(0, 0, 0), data_id=0x101):
    raw = payload_of(*((16 * (i + 1), 16, v) for i, v in enumerate(speeds)))
    return sealed(data_id, count, raw)


def speed_payload(count=0, speed=0, source=1, direction=1):
    return sealed(0x111, count, payload_of((16, 16, speed), (32, 4, source), (36, 2, direction)))


def environment(count=0, air=120, rail=120, humidity=100, sand=0, rain=0):
    fields = ((16, 8, air), (24, 8, rail), (32, 8, humidity), (40, 1, sand), (41, 2, rain))
    return sealed(0x141, count, payload_of(*fields))


def by_role(readings):
    return {(r.role, r.axle): r.value for r in readings}


def record_of(subject, name):
    (record,) = [r for r in subject.records if r.message.plan.name == name]
    return record


def test_the_bus_is_asked_for_the_bound_messages_alone():
    ids = [(one.number, one.is_extended) for one in receiver().ids]
    assert sorted(ids) == sorted((m.plan.frame_id, m.plan.is_extended) for m in BOUND)


# --- what is accepted ----------------------------------------------------------------------------


def test_readings_are_in_si_and_carry_the_stamp_of_their_frame():
    subject = receiver()
    readings = subject.accept(Frame(7 * MS, 0x101, wheel_payload(speeds=(50000, 500, 0xFFFF))))
    assert readings == [
        Reading(7 * MS, Role.WHEEL_SPEED, 1, pytest.approx(100.0)),
        Reading(7 * MS, Role.WHEEL_SPEED, 2, pytest.approx(1.0)),
        Reading(7 * MS, Role.WHEEL_SPEED, 3, None),
    ]
    record = record_of(subject, "WheelSpeeds1")
    assert (record.frames, record.accepted, record.readings, record.not_available) == (1, 1, 3, 1)


def test_all_of_the_contract_in_si_units():
    subject = receiver()
    frames = [
        (0x121, payload_of((16, 16, -30000), (32, 16, 30000), (48, 16, 0x7FFF))),
        (0x132, payload_of((16, 16, 24500), (32, 16, 0xFFFF), (48, 16, 0))),
        (0x151, payload_of((16, 16, -2500), (32, 16, 3333))),
    ]
    found = {}
    for data_id, raw in frames:
        found |= by_role(subject.accept(Frame(0, data_id, sealed(data_id, 0, raw))))
    found |= by_role(subject.accept(Frame(0, 0x111, speed_payload(0, 12345, 4, 2))))
    found |= by_role(subject.accept(Frame(0, 0x141, environment(0, 0, 254, 200, 1, 3))))
    expected = {
        (Role.TRACTIVE_EFFORT, 1): -300e3,
        (Role.TRACTIVE_EFFORT, 2): 300e3,
        (Role.TRACTIVE_EFFORT, 3): None,
        (Role.AXLE_LOAD, 4): 245e3,
        (Role.AXLE_LOAD, 5): None,
        (Role.AXLE_LOAD, 6): 0.0,
        (Role.GRADIENT, 0): -0.025,
        (Role.CURVATURE, 0): 0.003333,
        (Role.VEHICLE_SPEED, 0): 24.69,
        (Role.SPEED_SOURCE, 0): 4,
        (Role.DIRECTION, 0): 2,
        (Role.AMBIENT_TEMPERATURE, 0): -40,
        (Role.RAIL_TEMPERATURE, 0): 87,
        (Role.HUMIDITY, 0): 100,
        (Role.SANDING, 0): 1,
        (Role.RAIN, 0): 3,
    }
    assert found.keys() == expected.keys()
    for key, value in expected.items():
        assert found[key] == (None if value is None else pytest.approx(value)), key


def test_minus_0x8000_is_a_value_and_0x7fff_is_none():
    subject = receiver()
    raw = payload_of((16, 16, 0x8000), (32, 16, 0x7FFF), (48, 16, 0x7FFE))
    values = by_role(subject.accept(Frame(0, 0x121, sealed(0x121, 0, raw))))
    assert list(values.values()) == [-327680.0, None, 327660.0]


def test_every_bound_message_has_the_cycle_of_the_contract():
    cycles = {m.plan.name: m.cycle_us for m in BOUND}
    assert cycles == {
        "WheelSpeeds1": 10 * MS,
        "WheelSpeeds2": 10 * MS,
        "VehicleSpeed": 20 * MS,
        "TractiveEffort1": 10 * MS,
        "TractiveEffort2": 10 * MS,
        "AxleLoads1": 200 * MS,
        "AxleLoads2": 200 * MS,
        "Environment": 1000 * MS,
        "TrackGeometry": 200 * MS,
    }
    assert cycles_by_role(BOUND)[Role.VEHICLE_SPEED] == 20 * MS
    assert {m.data_id for m in BOUND} == {m.plan.frame_id for m in BOUND}


# --- what is none of ours ------------------------------------------------------------------------


@pytest.mark.parametrize(
    "frame",
    [
        Frame(0, 0x101, wheel_payload(), is_extended=True),
        Frame(0, 0x101, b"", is_remote=True),
        Frame(0, 0x101, wheel_payload(), is_remote=True),
        Frame(0, 0x101, b"", is_error=True),
        Frame(0, 0x101, wheel_payload(), is_error=True),
        Frame(0, 0x100, wheel_payload()),
        Frame(0, 0x201, wheel_payload()),
        Frame(0, 0x7FF, b""),
    ],
    ids=["extended", "remote", "remote+data", "error", "error+data", "other", "output", "empty"],
)
def test_frames_that_are_none_of_ours_change_nothing(frame):
    subject = receiver()
    assert subject.accept(frame) is None
    assert subject.rejected == 0
    assert all(r.frames == 0 for r in subject.records)


def test_an_fd_frame_of_eight_bytes_is_judged_by_its_payload():
    subject = receiver()
    good = Frame(0, 0x101, wheel_payload(0), is_fd=True)
    assert len(subject.accept(good)) == 3
    assert subject.accept(Frame(10 * MS, 0x101, bytes(8), is_fd=True)) is Rejection.CHECKSUM


# --- rejections ----------------------------------------------------------------------------------


@pytest.mark.parametrize("size", [0, 1, 2, 7, 12, 64])
def test_wrong_length_is_rejected_before_anything_is_read(size):
    subject = receiver()
    payload = (wheel_payload() + bytes(64))[:size]
    assert subject.accept(Frame(0, 0x101, payload, is_fd=size > 8)) is Rejection.LENGTH
    assert record_of(subject, "WheelSpeeds1").rejected == {Rejection.LENGTH: 1}


@pytest.mark.parametrize("bit", range(64))
def test_any_flipped_bit_is_a_checksum_fault(bit):
    subject = receiver()
    word = int.from_bytes(wheel_payload(3, speeds=(1, 2, 3)), "little") ^ (1 << bit)
    outcome = subject.accept(Frame(0, 0x101, word.to_bytes(8, "little")))
    assert outcome is Rejection.CHECKSUM


def test_another_messages_frame_under_our_id_is_a_checksum_fault():
    subject = receiver()
    assert subject.accept(Frame(0, 0x102, wheel_payload(0))) is Rejection.CHECKSUM


@pytest.mark.parametrize(
    ("can_id", "payload"),
    [
        (0x141, environment(humidity=240)),  # 120 %
        (0x141, environment(humidity=201)),  # 100.5 %
        (0x141, environment(humidity=254)),
        (0x111, speed_payload(source=9)),
        (0x111, speed_payload(source=5)),
        (0x111, speed_payload(source=15)),
    ],
    ids=["120%", "100.5%", "127%", "source 9", "source 5", "source 15"],
)
def test_a_value_out_of_its_range_rejects_the_whole_frame(can_id, payload):
    subject = receiver()
    assert subject.accept(Frame(0, can_id, payload)) is Rejection.RANGE
    (record,) = [r for r in subject.records if r.frames]
    assert record.rejected == {Rejection.RANGE: 1}
    assert record.readings == record.accepted == record.not_available == 0


@pytest.mark.parametrize(
    ("can_id", "payload"),
    [
        (0x141, environment(humidity=200)),
        (0x141, environment(humidity=255)),
        (0x141, environment(air=0, rail=255)),
        (0x111, speed_payload(speed=0xFFFE, source=0, direction=3)),
    ],
    ids=["100%", "humidity not available", "-40 degC", "131.068 m/s"],
)
def test_the_ends_of_the_range_are_inside_it(can_id, payload):
    assert isinstance(receiver().accept(Frame(0, can_id, payload)), list)


def test_repeat_and_order():
    subject = receiver()
    assert isinstance(subject.accept(Frame(0, 0x101, wheel_payload(4))), list)
    assert subject.accept(Frame(10 * MS, 0x101, wheel_payload(4))) is Rejection.REPEAT
    assert subject.accept(Frame(20 * MS, 0x101, wheel_payload(8))) is Rejection.ORDER
    assert subject.accept(Frame(30 * MS, 0x101, wheel_payload(3))) is Rejection.ORDER
    assert isinstance(subject.accept(Frame(50 * MS, 0x101, wheel_payload(5))), list)
    record = record_of(subject, "WheelSpeeds1")
    assert record.rejected == {Rejection.REPEAT: 1, Rejection.ORDER: 2}
    assert (record.frames, record.accepted, subject.rejected, subject.lost) == (5, 2, 3, 0)


def test_a_count_of_fifteen_under_a_right_checksum_is_rejected_as_order():
    subject = receiver()
    assert isinstance(subject.accept(Frame(0, 0x101, wheel_payload(14))), list)
    assert subject.accept(Frame(10 * MS, 0x101, wheel_payload(15))) is Rejection.ORDER
    assert isinstance(subject.accept(Frame(20 * MS, 0x101, wheel_payload(0))), list)
    assert subject.lost == 0


def test_each_message_has_a_counter_of_its_own():
    subject = receiver()
    for i in range(30):
        for can_id in (0x101, 0x102):
            payload = wheel_payload((i + can_id) % 15, data_id=can_id)
            assert isinstance(subject.accept(Frame(i * 10 * MS, can_id, payload)), list)
    assert subject.rejected == subject.lost == 0


@pytest.mark.parametrize("fault", ["length", "checksum", "range"])
def test_a_frame_rejected_for_another_reason_never_moves_the_counters_baseline(fault):
    subject = receiver()
    assert isinstance(subject.accept(Frame(0, 0x141, environment(4))), list)
    bad = {
        "length": environment(5)[:7],
        "checksum": bytes([environment(5)[0] ^ 1]) + environment(5)[1:],
        "range": environment(5, humidity=240),
    }[fault]
    assert subject.accept(Frame(1000 * MS, 0x141, bad)) == Rejection(fault)
    # Had 5 moved the baseline, 5 would be a repeat.
    assert isinstance(subject.accept(Frame(2000 * MS, 0x141, environment(5))), list)
    assert subject.lost == 0


def test_a_frame_of_the_new_count_that_is_damaged_does_not_help_to_establish_it():
    subject = receiver()
    subject.accept(Frame(0, 0x101, wheel_payload(0)))
    assert subject.accept(Frame(10 * MS, 0x101, wheel_payload(7))) is Rejection.ORDER
    assert subject.accept(Frame(20 * MS, 0x101, wheel_payload(8))) is Rejection.ORDER
    assert subject.accept(Frame(30 * MS, 0x101, bytes(8))) is Rejection.CHECKSUM
    assert subject.accept(Frame(40 * MS, 0x101, wheel_payload(9))) is Rejection.ORDER


@settings(max_examples=60, deadline=None)
@given(
    faults=st.lists(
        st.sampled_from(["ok", "ok", "ok", "drop", "flip", "short", "repeat"]), max_size=80
    )
)
def test_counts_add_up_over_any_sequence_of_faults(faults):
    """A sender counts on, a bus loses, damages and repeats: nothing is counted twice or never."""
    subject = receiver()
    expected = Counter()
    sent = dropped_run = lost = 0
    exact = True
    last = None
    for i, fault in enumerate(faults):
        payload = wheel_payload(sent % 15)
        sent += 1
        if fault == "drop":
            dropped_run += 1
            continue
        if fault in ("flip", "short"):
            bad = payload[:-1] if fault == "short" else payload[:-1] + bytes([payload[-1] ^ 4])
            expected["length" if fault == "short" else "checksum"] += 1
            assert isinstance(subject.accept(Frame(i * 10 * MS, 0x101, bad)), Rejection)
            dropped_run += 1
            continue
        outcome = subject.accept(Frame(i * 10 * MS, 0x101, payload))
        if dropped_run <= 2 or last is None:
            assert isinstance(outcome, list)
            lost += dropped_run if last is not None else 0
        else:
            exact = False  # the supervision must find its way back; see test_e2e
        if isinstance(outcome, list):
            last, dropped_run = sent, 0
        if fault == "repeat" and exact:
            expected["repeat"] += 1
            assert subject.accept(Frame(i * 10 * MS + 1, 0x101, payload)) is Rejection.REPEAT
        if not exact:
            break
    record = record_of(subject, "WheelSpeeds1")
    assert record.frames == record.accepted + sum(record.rejected.values())
    assert record.readings == 3 * record.accepted
    if exact:
        assert record.rejected == expected
        assert subject.lost == lost


def test_a_rejected_frame_yields_no_reading_and_leaves_no_trace_in_gaps():
    subject = receiver()
    subject.accept(Frame(0, 0x101, wheel_payload(0)))
    for i in range(1, 5):
        assert subject.accept(Frame(i * 10 * MS, 0x101, bytes(8))) is Rejection.CHECKSUM
    subject.accept(Frame(50 * MS, 0x101, wheel_payload(1, speeds=(5, 5, 5))))
    record = record_of(subject, "WheelSpeeds1")
    assert record.longest_gap_us == 50 * MS
    assert record.gap_at_us == 0
    assert record.late == 1
    assert (record.first_us, record.last_us) == (0, 50 * MS)


def test_a_block_of_rejected_frames_leaves_no_trace_in_gaps_either():
    subject = receiver()
    block = Block.from_frames([Frame(i * 10 * MS, 0x101, bytes(8)) for i in range(3)])
    subject.accept_block(block, block.t_us)
    record = record_of(subject, "WheelSpeeds1")
    assert (record.frames, record.accepted) == (3, 0)
    assert (record.first_us, record.last_us, record.late) == (None, None, 0)


@settings(max_examples=100, deadline=None)
@given(
    can_id=st.sampled_from([0x101, 0x111, 0x141, 0x151, 0x7FF]),
    data=st.binary(max_size=64),
    flags=st.tuples(st.booleans(), st.booleans(), st.booleans(), st.booleans()),
)
def test_no_frame_whatever_raises(can_id, data, flags):
    outcome = receiver().accept(Frame(0, can_id, data, "can0", *flags))
    assert outcome is None or isinstance(outcome, (list, Rejection))


# --- channels, protections, other databases ------------------------------------------------------


def bound(*choices):
    return Receiver(bind(choices, DATABASE, RADII, "test"))


def test_a_role_with_a_channel_hears_that_channel_only():
    subject = bound(
        SignalChoice(Role.VEHICLE_SPEED, 0, "VehicleSpeed", "VehicleSpeed", channel="can1")
    )
    assert subject.accept(Frame(0, 0x111, speed_payload(0, 500), "can0")) is None
    assert len(subject.accept(Frame(0, 0x111, speed_payload(0, 500), "can1"))) == 1


@pytest.mark.parametrize("in_blocks", [False, True])
def test_frames_on_another_channel_than_the_role_has_are_reported_by_both(in_blocks):
    choice = SignalChoice(Role.VEHICLE_SPEED, 0, "VehicleSpeed", "VehicleSpeed", channel="can1")
    subject = bound(choice)
    frames = [Frame(i, 0x111, speed_payload(i, 500), f"can{i}") for i in (0, 2)]
    if in_blocks:
        block = Block.from_frames(frames)
        subject.accept_block(block, block.t_us)
    else:
        for frame in frames:
            subject.accept(frame)
    with pytest.raises(
        RecordingError, match=r'has channel = "can1", .* are on can0, can2; write the channel'
    ):
        require_accepted(subject, 2, SeenIds(), load_configuration(None), "a.log")


def test_the_same_message_on_two_channels_is_two_messages_with_two_counters():
    subject = bound(
        SignalChoice(Role.WHEEL_SPEED, 1, "WheelSpeeds1", "WheelSpeed_Ax1", channel="can0"),
        SignalChoice(Role.WHEEL_SPEED, 2, "WheelSpeeds1", "WheelSpeed_Ax2", channel="can1"),
    )
    for i in range(6):
        first = subject.accept(
            Frame(i * 10 * MS, 0x101, wheel_payload(i, speeds=(1, 2, 3)), "can0")
        )
        second = subject.accept(
            Frame(i * 10 * MS, 0x101, wheel_payload((i + 7) % 15, speeds=(4, 5, 6)), "can1")
        )
        assert by_role(first) == {(Role.WHEEL_SPEED, 1): pytest.approx(0.002)}
        assert by_role(second) == {(Role.WHEEL_SPEED, 2): pytest.approx(0.010)}
    assert subject.rejected == subject.lost == 0


def test_without_protection_neither_checksum_nor_counter_is_asked_for():
    subject = bound(
        SignalChoice(Role.VEHICLE_SPEED, 0, "VehicleSpeed", "VehicleSpeed", protection="none")
    )
    raw = payload_of((0, 8, 0xAA), (8, 4, 15), (16, 16, 500))
    for i in range(4):
        assert by_role(subject.accept(Frame(i * MS, 0x111, raw))) == {
            (Role.VEHICLE_SPEED, 0): pytest.approx(1.0)
        }
    assert subject.accept(Frame(5 * MS, 0x111, raw[:5])) is Rejection.LENGTH


def test_data_id_factor_sign_and_unit_of_a_choice_hold():
    subject = bound(
        SignalChoice(
            Role.VEHICLE_SPEED,
            0,
            "VehicleSpeed",
            "VehicleSpeed",
            unit="km/h",
            factor=1.01,
            sign=-1,
            data_id=0xBEEF,
        )
    )
    raw = payload_of((16, 16, 5000))  # 10 in the database's unit, which the choice calls km/h
    assert subject.accept(Frame(0, 0x111, sealed(0x111, 0, raw))) is Rejection.CHECKSUM
    (reading,) = subject.accept(Frame(0, 0x111, sealed(0xBEEF, 0, raw)))
    assert reading.value == pytest.approx(-10 / 3.6 * 1.01)


def test_the_offset_of_a_choice_is_taken_from_its_value():
    """An error that `calibrate` found: in SI, behind factor and unit."""
    choice = SignalChoice(
        Role.VEHICLE_SPEED, 0, "VehicleSpeed", "VehicleSpeed", unit="km/h", offset=0.25
    )
    (reading,) = bound(choice).accept(Frame(0, 0x111, speed_payload(0, 5000)))
    assert reading.value == pytest.approx(10 / 3.6 - 0.25)


def test_a_choice_may_take_all_ones_as_a_value():
    subject = bound(
        SignalChoice(
            Role.AMBIENT_TEMPERATURE,
            0,
            "Environment",
            "AmbientTemperature",
            not_available=False,
        )
    )
    # 87.5 degC is beyond the stated range: without 'not available' it is out of range.
    assert subject.accept(Frame(0, 0x141, environment(air=255))) is Rejection.RANGE


def test_only_the_signals_that_have_a_role_can_reject_a_frame():
    subject = bound(SignalChoice(Role.VEHICLE_SPEED, 0, "VehicleSpeed", "VehicleSpeed"))
    assert isinstance(subject.accept(Frame(0, 0x111, speed_payload(0, 500, source=9))), list)


# --- databases with faults -----------------------------------------------------------------------


def bound_of(size, *signals, role=Role.WHEEL_SPEED, extra=""):
    """A message of these lines of a DBC, whose signal S has a role."""
    lines = "".join(f" SG_ {signal} A\n" for signal in signals)
    text = f'VERSION ""\nBU_: A\nBO_ 256 M: {size} A\n{lines}{extra}'
    database = CanDatabase(Path("u.dbc"), "", load_string(text, "dbc", strict=False))
    return bind([SignalChoice(role, 1, "M", "S")], database, RADII, "c.toml")


@pytest.mark.parametrize(
    ("size", "place"), [(8, "56|16@1+"), (8, "60|16@0+"), (8, "0|72@1+"), (2, "12|16@1+")]
)
def test_a_role_on_a_signal_that_leaves_its_message_is_reported(size, place):
    with pytest.raises(
        ConfigError, match=r"M\.S cannot be decoded: .*; correct the signal"
    ) as error:
        bound_of(size, f'S : {place} (0.01,0) [0|0] "rad/s"')
    assert error.value.where == "c.toml: roles.wheel_speed.1"


@pytest.mark.parametrize(
    ("lines", "what"),
    [
        (['X M : 60|8@1+ (1,0) [0|0] ""', 'S m1 : 0|16@1+ (1,0) [0|0] "rad/s"'], "multiplexer X"),
        (['X M : 56|8@1+ (1,0) [0|0] ""', 'S m1 : 0|16@1+ (1,0) [0|0] "rad/s"'], None),
        (['X : 60|8@1+ (1,0) [0|0] ""', 'S : 0|16@1+ (1,0) [0|0] "rad/s"'], None),
    ],
)
def test_a_role_whose_selector_leaves_its_message_is_reported(lines, what):
    if what is None:  # of faults of other signals nothing is asked
        assert bound_of(8, *lines)
        return
    with pytest.raises(ConfigError, match=what):
        bound_of(8, *lines)


def test_a_multiplexed_signal_is_read_where_its_selector_says_that_it_is_there():
    lines = ['X M : 0|8@1+ (1,0) [0|0] ""', 'S m1 : 8|16@1+ (0.01,0) [0|0] "rad/s"']
    single, many = Receiver(bound_of(8, *lines)), Receiver(bound_of(8, *lines))
    frames = [Frame(k, 256, bytes([k % 3, 100 + k, 0]) + bytes(5)) for k in range(6)]
    readings = [one for frame in frames for one in single.accept(frame)]
    assert [(one.t_us, one.value) for one in readings] == [(1, 1.01), (4, 1.04)]
    block = many.accept_block(Block.from_frames(frames), np.arange(6))
    stamps, values = block.readings[(Role.WHEEL_SPEED, 1)]
    assert (stamps.tolist(), values.tolist()) == ([1, 4], [1.01, 1.04])


def test_a_multiplexed_signal_that_is_absent_hides_none_behind_it():
    lines = [
        'X M : 0|8@1+ (1,0) [0|0] ""',
        'S m1 : 8|16@1+ (0.01,0) [0|0] "rad/s"',
        'T m2 : 8|16@1+ (0.01,0) [0|0] "rad/s"',
        'U : 24|16@1+ (0.01,0) [0|0] "rad/s"',
    ]
    text = 'VERSION ""\nBU_: A\nBO_ 256 M: 8 A\n' + "".join(f" SG_ {line} A\n" for line in lines)
    choices = [
        SignalChoice(Role.WHEEL_SPEED, axle, "M", name) for axle, name in enumerate("STU", 1)
    ]
    database = CanDatabase(Path("u.dbc"), "", load_string(text, "dbc"))
    subject = Receiver(bind(choices, database, RADII, "c.toml"))
    found = [
        {reading.axle: reading.value for reading in subject.accept(Frame(0, 256, data + bytes(3)))}
        for data in (bytes([1, 100, 0, 200, 0]), bytes([2, 100, 0, 200, 0]))
    ]
    assert found == [{1: 1.0, 3: 2.0}, {2: 1.0, 3: 2.0}]


@pytest.mark.parametrize("unit", ["N", "kN"])
@pytest.mark.parametrize("value", [1e306, -1e306, 1e308, inf, -inf, float("nan"), 1e200, -0.5])
def test_a_number_that_is_none_in_si_is_out_of_range_in_blocks_too(unit, value):
    messages = bound_of(
        8,
        f'S : 0|64@1- (1,0) [0|0] "{unit}"',
        role=Role.TRACTIVE_EFFORT,
        extra="SIG_VALTYPE_ 256 S : 2;\n",
    )
    frames = [Frame(i, 256, struct.pack("<d", number)) for i, number in enumerate((value, 1.0))]
    one, other = Receiver(messages), Receiver(messages)
    outcomes = [one.accept(frame) for frame in frames]
    received = other.accept_block(Block.from_frames(frames), np.array([0, 1]))
    (times, values) = received.readings[Role.TRACTIVE_EFFORT, 1]
    fits = abs(value) * {"N": 1, "kN": 1000}[unit] < inf
    assert (outcomes[0] is not Rejection.RANGE) == fits
    readings = [r for found in outcomes if isinstance(found, list) for r in found]
    assert times.tolist() == [r.t_us for r in readings] == ([0, 1] if fits else [1])
    assert values.tolist() == [r.value for r in readings]
    (a,), (b,) = one.records, other.records
    assert a.rejected == b.rejected == ({} if fits else {Rejection.RANGE: 1})
    assert (a.not_available, b.not_available) == (0, 0)


# --- stuck signals -------------------------------------------------------------------------------


def noisy_frames(count, frozen_from, seed=0):
    """Speeds of three wheels with noise; from a frame on those of the first wheel are frozen."""
    raw = 5000 + np.random.default_rng(seed).integers(-20, 20, (count, 3))
    raw[frozen_from:, 0] = raw[frozen_from, 0]
    return [
        Frame(10 * MS * i, 0x101, wheel_payload(i % 15, speeds=row))
        for i, row in enumerate(raw.tolist())
    ]


def test_a_stuck_signal_is_not_available_and_the_others_of_its_frame_are():
    subject = receiver()
    found = [by_role(subject.accept(frame)) for frame in noisy_frames(900, 800)]
    assert None not in [value for one in found[:800] for value in one.values()]
    assert {key[1] for key, value in found[-1].items() if value is None} == {1}
    record = record_of(subject, "WheelSpeeds1")
    assert 60 < record.stuck == subject.stuck < 100
    assert record.stuck == [one[Role.WHEEL_SPEED, 1] for one in found].count(None)
    assert (record.not_available, record.readings) == (0, 2700)
    assert subject.stuck_signals == ["wheel_speed.1"]
    subject.accept(Frame(10_000 * MS, 0x101, wheel_payload(0, speeds=(1, 2, 3))))
    assert subject.stuck_signals == []


@given(st.integers(0, 1 << 20), st.integers(300, 700), st.lists(st.integers(1, 799), max_size=6))
@settings(max_examples=20)
def test_blocks_leave_out_what_single_frames_do(seed, frozen_from, cuts):
    frames = noisy_frames(800, frozen_from, seed)
    single, many = receiver(), receiver()
    wanted = [
        (one.t_us, one.value)
        for frame in frames
        for one in single.accept(frame)
        if (one.role, one.axle) == (Role.WHEEL_SPEED, 1)
    ]
    found = []
    for begin, end in itertools.pairwise(sorted({0, *cuts, 800})):
        block = Block.from_frames(frames[begin:end])
        stamps, values = many.accept_block(block, block.t_us).readings[Role.WHEEL_SPEED, 1]
        numbers = [None if np.isnan(value) else value for value in values.tolist()]
        found += zip(stamps.tolist(), numbers, strict=True)
    assert found == wanted
    assert many.stuck == single.stuck
    assert many.stuck_signals == single.stuck_signals


def test_a_stuck_signal_goes_through_where_the_configuration_says_so():
    choices = [replace(choice, stuck_check=False) for choice in packaged_choices()]
    single, many = (Receiver(bind(choices, DATABASE, RADII, "test")) for _ in range(2))
    frames = noisy_frames(900, 500)
    found = [by_role(single.accept(frame)) for frame in frames]
    assert None not in [value for one in found for value in one.values()]
    block = Block.from_frames(frames)
    received = many.accept_block(block, block.t_us).readings
    assert all(np.isfinite(values).all() for _, values in received.values())
    assert (single.stuck, many.stuck) == (0, 0)


def test_speeds_and_efforts_alone_are_supervised():
    supervised = {key for record in receiver().records for key in record.stuck_checks}
    axles = range(1, 7)
    per_axle = (Role.WHEEL_SPEED, Role.TRACTIVE_EFFORT)
    wanted = {(role, axle) for role in per_axle for axle in axles}
    assert supervised == wanted | {(Role.VEHICLE_SPEED, 0)}
