"""Blocks decoded in columns, with cantools and the frame-by-frame receiver as oracles."""

import math
import random
import struct
from collections import Counter
from pathlib import Path

import cantools
import numpy as np
import pytest
from cantools.database.can import Database, Message, Signal
from cantools.database.conversion import BaseConversion
from cantools.database.errors import DecodeError
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from adhesion_can.bus.block import Block
from adhesion_can.bus.database import CanDatabase, e2e_data_id, load_database
from adhesion_can.bus.decoder import Decoder
from adhesion_can.bus.frame import MARKS, Frame, Mark
from adhesion_can.bus.rejection import REJECTIONS
from adhesion_can.recordings.recording import Recording
from tests.bus.bus_helpers import DATA, DBC, real_data, sealed

FAST = settings(max_examples=120, deadline=None, suppress_health_check=list(HealthCheck))
LONG = settings(max_examples=3000, deadline=None, suppress_health_check=list(HealthCheck))
OWN = load_database(DBC)


def database(*messages):
    return CanDatabase(Path("random.dbc"), "", Database(list(messages), strict=False))


def from_text(text):
    return CanDatabase(Path("text.dbc"), "", cantools.database.load_string(text, strict=False))


# --- the oracle ----------------------------------------------------------------------------------


def by_cantools(known, items):
    """Per key: (place, values or reason) of its data frames; and what else there is, counted."""
    received, others = {}, Counter()
    for place, item in enumerate(items):
        if isinstance(item, Mark):
            others["mark"] += 1
        elif not item.is_data:
            others["remote" if item.is_remote else "error"] += 1
        else:
            number, extended = item.arbitration_id, item.is_extended
            try:
                message = known.db.get_message_by_frame_id(number, force_extended_id=extended)
            except KeyError:
                others[number, extended] += 1
                continue
            try:
                found = message.decode(item.data, decode_choices=False)
            except (DecodeError, ValueError, OverflowError):
                found = "length" if len(item.data) < message.length else "multiplexer"
            received.setdefault((number, extended), []).append((place, found))
    return received, others


def same_number(found, wanted, dtype):
    if isinstance(wanted, int) and dtype != np.float64:
        return found == wanted
    # An integer that no type of 64 bits holds is the nearest float.
    wanted = float(wanted)
    return struct.pack("<d", found) == struct.pack("<d", wanted) or math.isnan(found + wanted)


def check_signal(name, column, outcome, results):
    present = np.ones(len(outcome), dtype=bool) if column.present is None else column.present
    values = column.values.tolist()
    types = set()
    for place, (_, result) in enumerate(results):
        if outcome[place]:
            continue
        assert present[place] == (name in result), (name, place)
        if present[place]:
            types.add(type(result[name]))
            assert same_number(values[place], result[name], column.values.dtype), (name, place)
    if float in types:
        assert column.values.dtype == np.float64


def check_block(known, decoder, items):
    block = Block.from_frames(items)
    received, others = by_cantools(known, items)
    decoded = decoder.decode(block)
    keys = {(c.message.frame_id, c.message.is_extended_frame): c for c in decoded}
    assert len(keys) == len(decoded)
    assert keys.keys() == received.keys()
    for key, results in received.items():
        columns = keys[key]
        assert columns.rows.tolist() == [place for place, _ in results]
        assert columns.t_ns.tolist() == [1000 * items[place].t_us for place, _ in results]
        reasons = [REJECTIONS[code - 1] if code else None for code in columns.outcome.tolist()]
        assert reasons == [r if isinstance(r, str) else None for _, r in results]
        assert set(columns.signals) == {s.name for s in columns.message.signals}
        for name, column in columns.signals.items():
            check_signal(name, column, columns.outcome, results)
    return received, others


def check_all(known, blocks):
    """A decoder over blocks that follow each other, and its report."""
    decoder = Decoder(known)
    frames, rejected, unknown, others = Counter(), Counter(), Counter(), Counter()
    for items in blocks:
        received, counted = check_block(known, decoder, items)
        for results in received.values():
            for _, result in results:
                rejected[result if isinstance(result, str) else None] += 1
        for key, results in received.items():
            frames[known.db.get_message_by_frame_id(key[0], force_extended_id=key[1]).name] += len(
                results
            )
        for key, count in counted.items():
            (others if isinstance(key, str) else unknown)[key] += count
    report = decoder.report
    assert {name: count.frames for name, count in report.messages.items()} == frames
    assert report.unknown == unknown
    assert (report.remote, report.error, report.marks) == tuple(
        others[kind] for kind in ("remote", "error", "mark")
    )
    assert sum(count.decoded for count in report.messages.values()) == rejected.pop(None, 0)
    assert sum((count.rejected for count in report.messages.values()), Counter()) == rejected
    assert report.frames + report.marks == sum(len(items) for items in blocks)
    assert not report.undecodable


# --- random databases ----------------------------------------------------------------------------

SCALES = [1, 1, 1, 2, 10, 3, 0.5, 0.01, 2e-5, -1, -0.25, 127, 2**40, 1e18, 1.0, 4.0, 2**63]
OFFSETS = [0, 0, 0, -40, 1, -67.67, 1000.5, 7, -(2**50), 1e-3, 0.0, -273.0, 2**63, -(2**63)]


@st.composite
def fields(draw, first, bits, most=6):
    """Cut a run of bits into fields with holes: (first, length) each."""
    found, at = [], first
    while at < first + bits and len(found) < most:
        at += draw(st.integers(0, 5))
        room = first + bits - at
        if room < 1:
            break
        whole = [n for n in (8, 16, 32, 64) if n <= room]
        length = draw(
            st.sampled_from(whole)
            if whole and draw(st.booleans())
            else st.integers(1, min(64, room))
        )
        found.append((at, length))
        at += length
    return found


def placed(name, first, length, big, **more):
    """A signal whose first bit, counted along the payload in its byte order, is `first`."""
    start = 8 * (first // 8) + 7 - first % 8 if big else first
    return Signal(name, start, length, byte_order="big_endian" if big else "little_endian", **more)


@st.composite
def conversions(draw, length, choices=(None,)):
    return BaseConversion.factory(
        scale=draw(st.sampled_from(SCALES)),
        offset=draw(st.sampled_from(OFFSETS)),
        is_float=length in (16, 32, 64) and draw(st.booleans()),
        choices=draw(st.sampled_from(choices)),
    )


IDS = st.sampled_from([(0x10, False), (0x7FF, False), (0x10, True), (0x18FEF100, True), (0, False)])


@st.composite
def plain(draw, name, frame_id, extended):
    size = draw(st.sampled_from([1, 2, 3, 5, 8, 8, 8, 12, 64]))
    intel = 8 * draw(st.integers(0, size))
    found = []
    for big, first, bits in ((False, 0, intel), (True, intel, 8 * size - intel)):
        for at, length in draw(fields(first, bits)):
            conversion = draw(conversions(length, (None, {0: "zero", 3: "three"})))
            signed = draw(st.booleans())
            found.append(
                placed(f"S{len(found)}", at, length, big, conversion=conversion, is_signed=signed)
            )
    return Message(
        frame_id, name, size, found, is_extended_frame=extended, strict=True, is_fd=size > 8
    )


PAGES = st.lists(st.integers(0, 7), min_size=1, max_size=4, unique=True)


@st.composite
def selectors(draw, big):
    """Outer and Second at the root, Inner on some pages of Outer, one byte each."""
    found = []
    for place, (name, above) in enumerate((("Outer", None), ("Inner", "Outer"), ("Second", None))):
        scale, offset = draw(st.sampled_from([(1, 0), (1, 0), (2, 1), (0.5, 0), (-1, 0)]))
        choices = draw(st.sampled_from([None, None, {5: "five", 200: "many"}]))
        found.append(
            placed(
                name,
                8 * place + (2 if big else 0),
                draw(st.integers(2, 6)),
                big,
                is_signed=draw(st.booleans()),
                conversion=BaseConversion.factory(scale=scale, offset=offset, choices=choices),
                is_multiplexer=True,
                multiplexer_ids=draw(PAGES) if above else None,
                multiplexer_signal=above,
            )
        )
    return found


@st.composite
def multiplexed(draw, name, frame_id, extended):
    size, big = draw(st.sampled_from([8, 64])), draw(st.booleans())
    found = draw(selectors(big))
    for at, length in draw(fields(24, 8 * size - 24, most=8)):
        above = draw(st.sampled_from([None, "Outer", "Inner", "Second"]))
        found.append(
            placed(
                f"S{len(found)}",
                at,
                length,
                big,
                is_signed=draw(st.booleans()),
                conversion=draw(conversions(length)),
                multiplexer_ids=draw(PAGES) if above else None,
                multiplexer_signal=above,
            )
        )
    return Message(frame_id, name, size, found, is_extended_frame=extended, strict=True)


@st.composite
def databases(draw):
    places = draw(st.lists(IDS, min_size=1, max_size=4, unique=True))
    kinds = [draw(st.sampled_from([plain, multiplexed])) for _ in places]
    return database(
        *(draw(kind(f"M{i}", *at)) for i, (kind, at) in enumerate(zip(kinds, places, strict=True)))
    )


LENGTHS = [*range(9), 12, 16, 20, 24, 32, 48, 64]
SMALL = (0, 1, 2, 3, 4, 5, 7, 8, 16, 20, 64, 0x80, 0xFF)


def random_items(known, seed, count):
    """Frames of the database's messages mostly; small bytes often, which selectors know."""
    rng = random.Random(seed)
    places = [(m.frame_id, m.is_extended_frame, m.length) for m in known.db.messages] * 3
    places += [(0x123, False, 8), (0x1234567, True, 8)]
    found = []
    for t_us in range(count):
        number, extended, size = rng.choice(places)
        kind = rng.randrange(20)
        if kind == 0:
            found.append(Mark(t_us, rng.choice(sorted(MARKS))))
            continue
        fitting = [length for length in LENGTHS if length >= size]
        size = rng.choice(LENGTHS) if kind < 4 else fitting[0]
        data = bytes(rng.choice(SMALL) for _ in range(size))
        data = rng.choice([data, data, rng.randbytes(size), data[:3] + rng.randbytes(size)])[:size]
        frame = Frame(t_us, number, data, rng.choice(["can0", "can1"]), extended, is_fd=size > 8)
        if kind == 1:
            frame = frame._replace(data=b"", is_remote=True, is_fd=False)
        elif kind == 2:
            frame = frame._replace(data=b"", is_error=True, is_extended=False, is_fd=False)
        found.append(frame)
    return found


def check_random(known, seed):
    items = random_items(known, seed, 80)
    check_all(known, [items[:50], [], items[50:51], items[51:]])


SEEDS = st.integers(0, 2**32)


@pytest.mark.costly
@FAST
@given(known=databases(), seed=SEEDS)
def test_columns_equal_cantools(known, seed):
    check_random(known, seed)


@pytest.mark.slow
@pytest.mark.long
@LONG
@given(known=databases(), seed=SEEDS)
def test_columns_equal_cantools_at_length(known, seed):
    check_random(known, seed)


# --- databases as they are met -------------------------------------------------------------------

J1939 = """VERSION ""
NS_ :
BS_:
BU_: ECU
BO_ 2364540158 EEC1: 8 ECU
 SG_ EngineSpeed : 24|16@1+ (0.125,0) [0|8031.875] "rpm" ECU
 SG_ ActualTorque : 16|8@1+ (1,-125) [-125|125] "%" ECU
BO_ 2566844926 CCVS: 8 ECU
 SG_ WheelSpeed : 8|16@1+ (0.00390625,0) [0|251] "km/h" ECU
BO_ 2565864449 Tree: 8 ECU
 SG_ Group M : 0|4@1+ (1,0) [0|0] "" ECU
 SG_ Part m1M : 4|4@1+ (1,0) [0|0] "" ECU
 SG_ Serial m0 : 8|56@1+ (1,0) [0|0] "" ECU
 SG_ Latitude m1 : 8|32@1- (1E-007,0) [0|0] "deg" ECU
 SG_ Hours m2 : 40|24@1+ (0.05,0) [0|0] "h" ECU
 SG_ Fault m1 : 55|16@0- (1,0) [0|0] "" ECU
BO_ 100 Double: 64 ECU
 SG_ Energy : 0|64@1- (1,0) [0|0] "J" ECU
 SG_ Power : 71|32@0- (1,0) [0|0] "W" ECU
 SG_ Across : 61|64@0+ (1,0) [0|0] "" ECU
 SG_ Total : 300|64@1+ (1,0) [0|0] "" ECU
 SG_ Shifted : 448|64@1+ (1,-1) [0|0] "" ECU
SIG_VALTYPE_ 100 Energy : 2;
SIG_VALTYPE_ 100 Power : 1;
SG_MUL_VAL_ 2565864449 Part Group 1-1, 3-5;
SG_MUL_VAL_ 2565864449 Serial Group 0-0, 7-7;
SG_MUL_VAL_ 2565864449 Latitude Part 1-2;
SG_MUL_VAL_ 2565864449 Hours Part 3-3, 9-12;
SG_MUL_VAL_ 2565864449 Fault Part 9-9;
"""


def without(text, *starts):
    return "\n".join(line for line in text.split("\n") if not line.strip().startswith(starts))


@pytest.mark.parametrize("seed", range(20))
def test_j1939_with_nested_extended_multiplexing_and_fd_equal_cantools(seed):
    # What overlaps in the message of 64 bytes goes out: cantools refuses such a message whole.
    known = from_text(without(J1939, "SG_ Across"))
    check_random(known, seed)


def test_j1939_pages_by_hand():
    known = from_text(J1939)
    payloads = ["0700000000000000", "11FFFFFFFF000000", "9300000000010203", "0200000000000000"]
    number = known.db.get_message_by_name("Tree").frame_id
    items = [Frame(i, number, bytes.fromhex(p), is_extended=True) for i, p in enumerate(payloads)]
    (tree,) = Decoder(known).decode(Block.from_frames(items))
    assert tree.outcome.tolist() == [0, 0, 0, 1 + REJECTIONS.index("multiplexer")]
    present = {name: column.present for name, column in tree.signals.items()}
    assert present["Group"] is None
    assert {n: p[:3].tolist() for n, p in present.items() if p is not None} == {
        "Part": [False, True, True],
        "Serial": [True, False, False],
        "Latitude": [False, True, False],
        "Hours": [False, False, True],
        "Fault": [False, False, True],
    }
    assert tree.signals["Latitude"].values[1] == -1 * 1e-7
    assert tree.signals["Hours"].values[2] == 0x030201 * 0.05


def test_types_follow_the_conversion():
    known = from_text(without(J1939, "SG_ Across"))
    frames = [Frame(0, 100, b"\xff" * 64, is_fd=True), Frame(0, 100, bytes(64), is_fd=True)]
    (columns,) = Decoder(known).decode(Block.from_frames(frames))
    found = {name: column.values for name, column in columns.signals.items()}
    assert found["Total"].dtype == np.uint64
    assert found["Total"].tolist() == [2**64 - 1, 0]
    assert found["Shifted"].dtype == np.float64, "-1 to 2**64 - 2: no integer of 64 bits holds it"
    assert found["Shifted"].tolist() == [2.0**64, -1.0]
    assert found["Energy"].dtype == found["Power"].dtype == np.float64


def test_floats_come_out_as_they_are():
    """Minus zero, infinities and numbers next to none: as they were sent, and as cantools says."""
    known = from_text(without(J1939, "SG_ Across"))
    patterns = [(0, 63), (0x7FF, 52), (0xFFF, 52), (1, 0), (0x7FF8, 48), (0x7FF4, 48)]
    frames = [
        Frame(t_us, 100, (bits << shift).to_bytes(8, "little") + bytes(56), is_fd=True)
        for t_us, (bits, shift) in enumerate([(1, 63), *patterns])
    ]
    check_all(known, [frames])
    (columns,) = Decoder(known).decode(Block.from_frames(frames))
    energy = columns.signals["Energy"].values
    assert np.signbit(energy[0])
    assert energy[:5].tolist() == [0.0, 0.0, math.inf, -math.inf, 5e-324]
    assert np.isnan(energy[5:]).all()


def test_our_own_messages_equal_cantools_where_the_protection_is_right():
    rng = random.Random(5)
    items, count = [], Counter()
    for t_us in range(0, 900_000, 1000):
        message = rng.choice(OWN.db.messages)
        body = bytearray(rng.randbytes(8))
        if message.name == "AxleSetpoint":
            body[1] = (body[1] & 0x0F) | rng.randint(1, 6) << 4
        sent = sealed(e2e_data_id(message), count[message.name] % 15, body)
        count[message.name] += 1
        items.append(Frame(t_us, message.frame_id, sent))
    check_all(OWN, [items])


@pytest.mark.costly
def test_the_drive_of_a_car_equals_cantools():
    folder = real_data()
    if folder is None:
        pytest.skip("measured data not found; set ADHESION_CAN_REALDATA to their folder")
    known = load_database(DATA / "car.dbc")
    items = list(Recording(folder / "rav4_drive.log.gz"))
    decoder = Decoder(known)
    received, others = check_block(known, decoder, items)
    assert len(received[170, False]) > 4000
    assert decoder.report.unknown == others
    assert decoder.report.frames == 135_468
    assert not decoder.report.messages["WHEEL_SPEEDS"].rejected


def test_one_name_on_several_pages_is_one_column():
    """As .sym files have it: each page gives the name a place of its own."""
    known = database(Message(1, "Pages", 8, [
        Signal("Page", 0, 4, is_multiplexer=True),
        Signal("Same", 8, 8, multiplexer_ids=[1], multiplexer_signal="Page"),
        Signal("Same", 16, 16, multiplexer_ids=[2], multiplexer_signal="Page",
               conversion=BaseConversion.factory(scale=0.5)),
        Signal("Other", 8, 8, multiplexer_ids=[3], multiplexer_signal="Page"),
    ]))  # fmt: skip
    check_all(known, [random_items(known, seed, 60) for seed in range(5)])
