"""Blocks decoded in columns: protected messages, and what is not decoded."""

import random
from collections import Counter
from pathlib import Path

import numpy as np
import pytest
from cantools.database import load_string
from cantools.database.can import Database, Message, Signal
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from adhesion_can.bus.block import EXTENDED, Block
from adhesion_can.bus.codec import MessagePlan
from adhesion_can.bus.database import INPUT_MESSAGES, CanDatabase, e2e_data_id, load_database
from adhesion_can.bus.decoder import Decoder
from adhesion_can.bus.frame import Frame, Mark
from adhesion_can.bus.id_codes import UNSEEN, KeyCodes
from adhesion_can.bus.receiver import Receiver
from adhesion_can.bus.rejection import REJECTIONS, Rejection
from adhesion_can.bus.roles import bind, packaged_choices
from tests.bus.bus_helpers import DBC, sealed

FAST = settings(max_examples=120, deadline=None, suppress_health_check=list(HealthCheck))
OWN = load_database(DBC)


def database(*messages):
    return CanDatabase(Path("random.dbc"), "", Database(list(messages), strict=False))


# --- protected messages --------------------------------------------------------------------------


def faulty_drive(seed, frames=3000):
    """Our input messages with every fault of a bus, their values within their ranges."""
    rng = random.Random(seed)
    messages = [OWN.message(name) for name in INPUT_MESSAGES]
    plans = {m.name: MessagePlan(m) for m in messages}
    counts, t_us, items = Counter(), 1_000_000, []
    for _ in range(frames):
        t_us += rng.choice([500, 500, 500, 500, 30_000]) if rng.random() < 0.99 else 3_000_000
        message = rng.choice(messages[:4] if rng.random() < 0.9 else messages)
        values = {
            s.name: rng.uniform(float(s.minimum), float(s.maximum))
            for s in message.signals
            if s.name not in ("Crc", "Alive")
        }
        step = rng.choice([0, 2, 3, 4, 9]) if rng.random() < 0.05 else 1
        counts[message.name] += step
        count = 15 if rng.random() < 0.01 else counts[message.name] % 15
        body = sealed(e2e_data_id(message), count, plans[message.name].encode(values))
        fault = rng.random()
        if fault < 0.02:
            body = body[: rng.randrange(8)]
        elif fault < 0.05:
            place = rng.randrange(1, 8)
            body = body[:place] + bytes([body[place] ^ 1 << rng.randrange(8)]) + body[place + 1 :]
        frame = Frame(t_us, message.frame_id, body, "can0")
        if 0.05 < fault < 0.06:
            frame = frame._replace(data=b"", is_remote=True)
        items.append(frame)
        if 0.06 < fault < 0.07:
            items.append(Mark(t_us, "advance"))
    return items


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("size", [10_000, 700, 13])
def test_faults_are_judged_as_frame_by_frame(seed, size):
    messages = bind(packaged_choices(), OWN, [0.5] * 6, "test")
    receiver, decoder = Receiver(messages), Decoder(OWN)
    items = faulty_drive(seed)
    wanted, found = [], []
    for item in items:
        outcome = receiver.accept(item) if isinstance(item, Frame) else None
        wanted.append(outcome if isinstance(outcome, Rejection) else None)
    for begin in range(0, len(items), size):
        part = items[begin : begin + size]
        reasons = [None] * len(part)
        for columns in decoder.decode(Block.from_frames(part)):
            for row, code in zip(columns.rows.tolist(), columns.outcome.tolist(), strict=True):
                reasons[row] = REJECTIONS[code - 1] if code else None
        found += reasons
    assert found == wanted
    assert {r.value for r in Rejection} - {"range", "multiplexer"} <= set(wanted)
    lost = {r.message.plan.name: r.lost for r in receiver.records}
    assert sum(lost.values()) > 0
    counts = decoder.report.messages
    assert {name: count.lost for name, count in counts.items()} == lost
    for record in receiver.records:
        count = counts[record.message.plan.name]
        assert (count.frames, count.decoded) == (record.frames, record.accepted)
        assert count.rejected == record.rejected


def test_each_channel_has_counters_of_its_own():
    message = OWN.message("WheelSpeeds1")
    items = [
        Frame(
            t * 10_000, message.frame_id, sealed(0x101, (t + 7 * bus) % 15, bytes(8)), f"can{bus}"
        )
        for t in range(40)
        for bus in (0, 1)
    ]
    decoder = Decoder(OWN)
    for part in (items[:31], items[31:]):
        block = Block.from_frames(part, channels=("can0", "can1"))
        (columns,) = decoder.decode(block)
        assert not columns.outcome.any()
    assert decoder.report.messages["WheelSpeeds1"].lost == 0
    (columns,) = Decoder(OWN).decode(Block.from_frames([i._replace(channel="") for i in items]))
    assert columns.outcome.any()


def test_a_protected_frame_that_is_too_long_is_refused_and_an_open_one_is_decoded():
    long = sealed(0x101, 0, bytes(8)) + bytes(4)
    (columns,) = Decoder(OWN).decode(Block.from_frames([Frame(0, 0x101, long, is_fd=True)]))
    assert [REJECTIONS[code - 1] for code in columns.outcome] == ["length"]
    known = database(Message(1, "Open", 2, [Signal("S", 0, 16, byte_order="little_endian")]))
    (columns,) = Decoder(known).decode(
        Block.from_frames([Frame(0, 1, b"\x01\x02" + bytes(10), is_fd=True)])
    )
    assert columns.outcome.tolist() == [0]
    assert columns.signals["S"].values.tolist() == [0x0201]


@pytest.mark.parametrize("others", [[], [Frame(0, 9, bytes(64), is_fd=True)]])
def test_a_long_message_in_short_frames_is_refused(others):
    signals = [Signal("First", 0, 8), Signal("Last", 504, 8), Signal("Across", 60, 8)]
    known = database(Message(1, "Long", 64, signals, is_fd=True))
    items = [*others, Frame(0, 1, b"\x07\x01"), Frame(0, 1, bytes(8))]
    (columns,) = Decoder(known).decode(Block.from_frames(items))
    assert [REJECTIONS[code - 1] for code in columns.outcome] == ["length", "length"]
    assert columns.words.shape == (2, 8)
    assert columns.signals.keys() == {"First", "Last", "Across"}


# --- what is not decoded -------------------------------------------------------------------------


def test_signals_not_wanted_are_passed_over_and_reported():
    decoder = Decoder(OWN, lambda message, signal: (message, signal) == ("WheelSpeeds1", "Alive"))
    frames = [Frame(0, number, sealed(number, 3, bytes(8))) for number in (0x101, 0x102, 0x102)]
    (columns,) = decoder.decode(Block.from_frames(frames))
    assert columns.signals.keys() == {"Alive"}
    assert columns.signals["Alive"].values.tolist() == [3]
    assert decoder.report.passed_over == {"WheelSpeeds2": 2}
    assert decoder.report.frames == 3


def test_what_cannot_be_decoded_is_left_out_and_reported():
    inner = Message(3, "Inner", 1, [], header_id=5)
    known = database(
        Message(1, "Box", 8, [], contained_messages=[inner]),
        Message(2, "Odd", 16, [
            Signal("Wide", 0, 80), Signal("Behind", 120, 16), Signal("Good", 80, 8),
            Signal("Early", 7 + 8 * 15, 12, byte_order="big_endian"),
        ], strict=False),
    )  # fmt: skip
    decoder = Decoder(known)
    frames = [Frame(0, 1, bytes(8)), Frame(0, 2, bytes(range(16)), is_fd=True)]
    (columns,) = decoder.decode(Block.from_frames(frames))
    assert columns.signals.keys() == {"Good"}
    assert columns.signals["Good"].values.tolist() == [10]
    assert decoder.report.passed_over == {"Box": 1}
    assert decoder.report.undecodable == {
        "Box": "a container of other messages",
        "Odd.Wide": "longer than 64 bits",
        "Odd.Behind": "reaches beyond the 16 bytes of its message",
        "Odd.Early": "reaches beyond the 16 bytes of its message",
    }


def test_a_protection_without_room_for_it_is_reported_and_not_checked():
    text = """VERSION ""
BO_ 5 Short: 1 Vector__XXX
 SG_ S : 0|8@1+ (1,0) [0|0] "" Vector__XXX
BA_DEF_ BO_ "E2EDataId" INT 0 65535;
BA_DEF_DEF_ "E2EDataId" 0;
BA_ "E2EDataId" BO_ 5 7;
"""
    decoder = Decoder(CanDatabase(Path("short.dbc"), "", load_string(text)))
    (columns,) = decoder.decode(Block.from_frames([Frame(0, 5, b"\x09")]))
    assert columns.signals["S"].values.tolist() == [9]
    assert columns.outcome.tolist() == [0]
    assert decoder.report.undecodable == {"Short.E2EDataId": "it does not fit into 1 bytes"}


def test_a_row_of_unknown_selector_keeps_its_counter():
    """The checksum is right, so the frame was sent: the next one is in order."""
    message = OWN.message("AxleSetpoint")
    pages = [1, 2, 7, 4]
    frames = [
        Frame(i * 3000, 0x204, sealed(0x204, i, bytes([0, page << 4, *range(6)])))
        for i, page in enumerate(pages)
    ]
    decoder = Decoder(OWN)
    (columns,) = decoder.decode(Block.from_frames(frames))
    assert columns.message is message
    assert [REJECTIONS[code - 1] if code else None for code in columns.outcome] == [
        None, None, "multiplexer", None,
    ]  # fmt: skip
    assert decoder.report.messages["AxleSetpoint"].rejected == {"multiplexer": 1}


def test_a_block_without_a_row():
    decoder = Decoder(OWN)
    assert decoder.decode(Block.from_frames([])) == []
    assert decoder.decode(Block.from_frames([Mark(0, "advance")])) == []
    assert decoder.report.frames == 0
    assert decoder.report.marks == 1


@pytest.mark.parametrize("size", [8, 64])
def test_a_message_that_no_frame_can_carry_is_left_out(size):
    """As databases of SAE J1939 have them, whose parts come under another id."""
    decoder = Decoder(database(Message(0x10, "Long", 100, [Signal("S", 700, 16)], strict=False)))
    assert decoder.decode(Block.from_frames([Frame(0, 0x10, bytes(size), is_fd=size > 8)])) == []
    assert decoder.report.passed_over == {"Long": 1}
    assert "100 bytes" in decoder.report.undecodable["Long.S"]


# --- codes of ids --------------------------------------------------------------------------------

KEYS = st.one_of(st.integers(0, 0x7FF), st.integers(EXTENDED, EXTENDED | 0x1FFFFFFF))


@FAST
@given(known=st.lists(KEYS, unique=True, max_size=40), blocks=st.lists(st.lists(KEYS), max_size=4))
def test_codes_tell_every_id_apart(known, blocks):
    codes = KeyCodes(known)
    every = [key for block in blocks for key in block]
    for block in [known, *blocks, [*known, *every]]:
        found = codes.encode(np.array(block, dtype=np.uint32))
        assert [codes.keys[code] for code in found.tolist()] == block
    assert codes.keys[1 : 1 + len(known)] == known


def test_a_bus_of_random_ids_is_counted_though_no_code_is_left():
    rng = np.random.default_rng(1)
    keys = (rng.integers(0, 1 << 29, 6000) | EXTENDED).astype(np.uint32)
    decoder = Decoder(OWN)
    codes = KeyCodes([0x101])
    assert (codes.encode(keys) == UNSEEN).any()
    assert (codes.encode(np.array([0x101], dtype=np.uint32)) == 1).all()
    frames = [Frame(0, key & ~EXTENDED, b"", is_extended=True) for key in keys.tolist()]
    frames += [Frame(0, 0x101, sealed(0x101, 0, bytes(8)))]
    for part in (frames[:3000], frames[3000:]):
        decoder.decode(Block.from_frames(part))
    report = decoder.report
    every = Counter((key & ~EXTENDED, True) for key in keys.tolist())
    assert 1000 <= len(report.unknown) < 1100
    assert all(count == every[key] for key, count in report.unknown.items())
    assert report.unknown.total() + report.unknown_beyond == len(keys)
    assert report.frames == len(frames)
    assert report.messages["WheelSpeeds1"].decoded == 1


def test_messages_of_one_name_are_counted_each_for_itself():
    known = database(
        *(Message(number, "M", 1, [Signal("S", 0, 8)], strict=False) for number in (0x10, 0x20))
    )
    decoder = Decoder(known)
    for items in ([(0x10, b"a"), (0x20, b""), (0x20, b"b")], [(0x20, b"c")]):
        decoder.decode(Block.from_frames([Frame(0, number, data) for number, data in items]))
    report = decoder.report
    assert {key: count.frames for key, count in report.counts.items()} == {
        ("M", 0x10, False): 1,
        ("M", 0x20, False): 3,
    }
    assert report.counts["M", 0x20, False].rejected == {"length": 1}
    together = report.messages["M"]
    assert (together.frames, together.decoded, together.lost) == (4, 3, 0)
    assert together.rejected == {"length": 1}
    assert report.counts["M", 0x10, False].frames == 1  # and stays so
    assert report.frames == 4


@pytest.mark.parametrize(
    ("line", "reason"),
    [
        ('SG_ S : 8|8@1+ (1,0) [0|0] "" B', "has this name"),
        ('SG_ S m1 : 8|8@1+ (1,0) [0|0] "" B', "has this name"),
        (f'SG_ T : 8|8@1+ ({10**400},0) [0|0] "" B', "is not finite"),
        (f'SG_ T : 8|8@1+ (1,{10**400}) [0|0] "" B', "is not finite"),
    ],
)
def test_a_signal_that_is_no_number_has_a_reason(line, reason):
    """cantools reads the one of two namesakes with the factor of the other."""
    text = 'BO_ 256 M: 8 A\n SG_ X M : 0|8@1+ (1,0) [0|0] "" B\n'
    text += f' SG_ S : 16|8@1+ (1,0) [0|0] "" B\n {line}\n'
    known = CanDatabase(Path("text.dbc"), "", load_string(text, strict=False))
    undecodable = Decoder(known).report.undecodable
    assert all(reason in found for found in undecodable.values())
    assert undecodable.keys() == {f"M.{line.split()[1]}"}


def test_namesakes_on_pages_of_their_own_are_decoded():
    text = 'BO_ 256 M: 8 A\n SG_ X M : 0|8@1+ (1,0) [0|0] "" B\n'
    text += ' SG_ S m1 : 8|8@1+ (1,0) [0|0] "" B\n SG_ S m2 : 16|8@1+ (1,0) [0|0] "" B\n'
    known = CanDatabase(Path("text.dbc"), "", load_string(text, strict=False))
    assert not Decoder(known).report.undecodable


def test_a_limit_beyond_all_numbers_is_no_limit():
    text = f'BO_ 256 M: 8 A\n SG_ S : 0|8@1+ (1,0) [-{10**400}|{10**400}] "" B\n'
    known = CanDatabase(Path("text.dbc"), "", load_string(text, strict=False))
    assert not Decoder(known).report.undecodable


def test_a_selector_that_is_no_number_selects_nothing():
    """A signalling NaN too, without a warning."""
    text = 'BO_ 256 M: 8 A\n SG_ X M : 0|32@1- (1,0) [0|0] "" B\n'
    text += ' SG_ S m1 : 32|8@1+ (1,0) [0|0] "" B\nSIG_VALTYPE_ 256 X : 1;\n'
    known = CanDatabase(Path("text.dbc"), "", load_string(text, strict=False))
    frames = [Frame(0, 256, bytes([0, 0, quiet, 0x7F, 9, 0, 0, 0])) for quiet in (0xA0, 0xC0)]
    (columns,) = Decoder(known).decode(Block.from_frames(frames))
    assert [REJECTIONS[code - 1] for code in columns.outcome] == [Rejection.MULTIPLEXER] * 2
