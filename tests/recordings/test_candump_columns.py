"""candump text in columns against the reader that goes line by line, on any bytes whatever."""

import gzip
import random
import re
import sys
import threading
import tracemalloc
from collections import Counter
from contextlib import contextmanager
from itertools import pairwise

import can
import numpy as np
import pytest
import zstandard
from hypothesis import example, given, settings
from hypothesis import strategies as st

from adhesion_can.bus.block import EXTENDED, Block, Kind
from adhesion_can.bus.frame import ADVANCE, SECOND_SENDER, Frame, Mark
from adhesion_can.errors import RecordingError
from adhesion_can.extras import install_extra
from adhesion_can.recordings.candump import ReadReport, format_frame, format_mark, parse_line
from adhesion_can.recordings.python_can_messages import from_message
from adhesion_can.recordings.recording import Recording
from adhesion_can.recordings.text_columns import candump_form
from adhesion_can.recordings.text_columns import parse as chunk_parser
from adhesion_can.recordings.text_columns.ascii_numbers import decimal, hexadecimal, keep
from adhesion_can.recordings.text_columns.candump_form import CandumpForm
from adhesion_can.recordings.text_columns.matching import match_lines
from adhesion_can.recordings.text_columns.parse import ChunkParser
from adhesion_can.recordings.text_columns.text_source import BACK, FRONT, LINE_LIMIT, Chunk
from tests.bus.bus_helpers import real_data

FD_SIZES = (*range(9), 12, 16, 20, 24, 32, 48, 64)
GOOD = b"(1700000000.123456) can0 123#1122334455667788\n"


@contextmanager
def eager():
    """A parser that reads the smallest group of lines in columns."""
    before, chunk_parser._FEW = chunk_parser._FEW, 1
    try:
        yield
    finally:
        chunk_parser._FEW = before


def chunk_of(content):
    text = np.frombuffer(bytes(FRONT) + content + b"0" * BACK, np.uint8)
    return Chunk(text, FRONT + len(content), 0)


def new_parser():
    return ChunkParser(CandumpForm(), ReadReport())


def check_block(block):
    n = len(block)
    assert n > 0
    assert block.t_ns.shape == block.key.shape == block.kind.shape == (n,)
    assert block.length.shape == block.channel.shape == (n,)
    assert block.words.shape[0] == n
    assert block.words.shape[1] == (8 if block.length.max() > 8 else 1)
    types = [getattr(block, name).dtype for name in ("t_ns", "key", "kind", "length", "channel")]
    assert types == [np.int64, np.uint32, np.uint8, np.uint8, np.uint16]
    assert block.words.dtype == np.uint64
    assert len(set(block.channels)) == len(block.channels)
    assert block.channel.max() < len(block.channels)
    width = block.payload.shape[1]
    assert not block.payload[np.arange(width) >= block.length[:, None]].any(), "0 behind the end"


def assert_same(path, size=1 << 20):
    """Blocks of a file equal its frames one by one; gives them."""
    frames, columns = Recording(path), Recording(path)
    wanted = list(frames)
    blocks = list(columns.blocks(size))
    for block in blocks:
        check_block(block)
    for one, next_one in pairwise(blocks):
        assert next_one.channels[: len(one.channels)] == one.channels
    assert [item for block in blocks for item in block.items()] == wanted
    assert columns.report == frames.report
    assert columns.position == columns.size
    if blocks:
        assert list(Block.concatenate(blocks).items()) == wanted
    return blocks


def assert_same_content(folder, content, size=1 << 20):
    path = folder / "a.log"
    path.write_bytes(content)
    with eager():
        return assert_same(path, size)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("chunks")


# --- words ---------------------------------------------------------------------------------------


@pytest.mark.parametrize("place", range(8))
@pytest.mark.parametrize("others", "09afAF")
def test_words_take_digits_and_nothing_else(place, others):
    """Every byte at every place, against Python's own."""
    characters = np.full((256, 8), ord(others), np.uint8)
    characters[:, place] = np.arange(256)
    words = characters.view("<u8").ravel()
    octets, not_hex = hexadecimal(words.copy())
    numbers, not_decimal = decimal(words.copy(), np.array(keep(0, 8)))
    for row, text in enumerate(map(bytes, characters)):
        is_hex = all(chr(c) in "0123456789abcdefABCDEF" for c in text)
        assert (not_hex[row] == 0) == is_hex
        if is_hex:
            assert octets[4 * row : 4 * row + 4].tobytes() == bytes.fromhex(text.decode())
        assert (not_decimal[row] == 0) == text.isdigit()
        if text.isdigit():
            assert numbers[row] == int(text)


@given(text=st.binary(min_size=8, max_size=8))
def test_words_tell_any_eight_bytes(text):
    words = np.frombuffer(text, "<u8")
    _, not_hex = hexadecimal(words.copy())
    _, not_decimal = decimal(words.copy(), np.array(keep(0, 8)))
    assert (not_hex[0] == 0) == all(chr(c) in "0123456789abcdefABCDEF" for c in text)
    assert (not_decimal[0] == 0) == text.isdigit()


# --- single lines --------------------------------------------------------------------------------

HEAD = b"(1700000000.123456) can0 "
FAST = [
    HEAD + b"123#",
    HEAD + b"123#1122334455667788",
    HEAD + b"7FF#0a1B",
    HEAD + b"00000123#1122",
    HEAD + b"1FFFFFFF#FFFFFFFFFFFFFFFF",
    HEAD + b"123#1122 R",
    HEAD + b"123#1122 T",
    HEAD + b"123#1122\r",
    HEAD + b"123#1122 T\r",
    HEAD + b"123##0",
    HEAD + b"123##F1122334455667788",
    HEAD + b"12345678##1" + b"A5" * 64,
    HEAD + b"123##1112233445566778899AABBCC R",
    b"(0.5) can0 123#1122",
    b"(1.123456789) can0 123#1122",
    b"(9223372036.000000) can0 123#1122",
    b"(12345678.1234567) a 123#",
    b"(123456789.12345678) abcdefghijklmnop 123#00",
    b"(123456789.12345678) abcdefghi 12345678#00",
    b"(1.0) a#b 123#00",
    b"(1.0) \xe9\x00\xff 123#00",
    b"<1700000000.123456> advance 000#",
    b"<1700000000.123456> second-sender 000#\r",
]


@pytest.mark.parametrize("line", FAST)
@pytest.mark.parametrize("end", [b"\n", b""])
def test_lines_of_these_forms_are_read_in_columns(line, end):
    chunk = chunk_of(line + end)
    layout = CandumpForm().find_layout(line + end)
    found = match_lines(layout, chunk.text, np.array([FRONT]), np.array([FRONT + len(line)]))
    assert found.t_ns.shape == (1,)
    parser = new_parser()
    with eager():
        assert list(parser.parse(chunk).items()) == [parse_line(line + end)]
    assert parser._layouts == [layout]


NEAR = [
    HEAD + payload
    for payload in (
        # characters beside the digits, and beside the letters
        *(b"123#112233445566778" + bytes([c]) for c in b"/:;<=>?@G`g_. RrXx\x00\x10\x19\xb0\xc1"),
        *(b"12" + bytes([c]) + b"#11" for c in b"/:@G`g# R\t\x00\x13\xb1"),
        *(b"123##" + bytes([c]) + b"11" for c in b"/:@G`grR#. \x00"),
        *(b"123" + bytes([c]) + b"1122" for c in b'$"!R\x03\xa3 :'),
        # ids
        b"800#11",
        b"FFF#11",
        b"1234#11",
        b"12#11",
        b"0000123#11",
        b"000000123#11",
        b"20000000#11",
        b"20000004#0000000000000000",
        b"3FFFFFFF#1",
        b"40000000#11",
        b"80000123#11",
        b"9FFFFFFF#11",
        b"E0000000#11",
        b"20000000##0",
        # payloads
        b"123#1",
        b"123#11223344556677889",
        b"123#112233445566778899",
        b"123#R",
        b"123#R8",
        b"123#r1122334455667",
        b"123#1122334455667R",
        b"123#11.22.33.44.55",
        b"123#11_9",
        b"123##",
        b"123###",
        b"123##0#",
        b"123##01",
        b"123##0" + b"11" * 9,
        b"123##0" + b"11" * 13,
        b"123##0" + b"11" * 63,
        b"123##0" + b"11" * 65,
        b"123##0" + b"11" * 64 + b"1",
        b"123#1122  R",
        b"123#1122 X",
        b"123#1122 S",
        b"123#1122 V",
        b"123#1122 P",
        b"123#1122 r",
        b"123#1122\tR",
        b"123#1122R",
        b"123#1122 R ",
        b"123#1122 R T",
        b"123#1122 ",
        b"123#1122\r\r",
        b"123#1122\x0b",
        b"123#1122\x0c R",
        b"123",
        b"123 #11",
        b" 123#11",
        b"123#" + b"1" * 3000,
    )
] + [
    b"(1700000000.123456)  can0 123#1122",
    b"(1700000000.123456)\tcan0 123#1122",
    b"(1700000000.123456) can0\t123#1122",
    b"(1700000000.123456) c n0 123#1122",
    b"(1700000000.123456) ca\t0 123#1122",
    b"(1700000000.123456) can\x0b 123#1122",
    b"(1700000000.123456)\x20\x20an0 123#1122",
    b"(1700000000.123456)xcan0 123#1122",
    b"(1700000000.123456] can0 123#1122",
    b"[1700000000.123456) can0 123#1122",
    b"<1700000000.123456> can0 123#1122",
    b"(1700000000,123456) can0 123#1122",
    b"(1700000000:123456) can0 123#1122",
    b"(170000000/.123456) can0 123#1122",
    b"(17000:0000.123456) can0 123#1122",
    b"(/700000000.123456) can0 123#1122",
    b"(1700000000.12345:) can0 123#1122",
    b"(1700000000./23456) can0 123#1122",
    b"(-170000000.123456) can0 123#1122",
    b"(1 00000000.123456) can0 123#1122",
    b"(1700000000.) can0 123#1122",
    b"(.123456) can0 123#1122",
    b"(17000000001.23456) can0 123#1122",
    b"(9223372036.000001) can0 123#1122",
    b"(9999999999.999999) can0 123#1122",
    b"(99999999999.999999) can0 123#1122",
    b"(999999999999999.999999) can0 123#1122",
    b"(1700000000.1234567890) can0 123#1122",
    b"<1700000000.123456> advance 001#",
    b"<1700000000.123456> advance 000#00",
    b"<1700000000.123456> advance 000# R",
    b"<1700000000.12345> advance 000#",
    b"<170000000:.123456> advance 000#",
    b"<1700000000.123456> advancf 000#",
    b"<9999999999.123456> advance 000#",
    b" (1700000000.123456) can0 123#1122",
    b"",
    b"\r",
    b"# comment",
    b"\x00" * 40,
    b"\xff" * 80,
]


@pytest.mark.parametrize("near", NEAR)
def test_a_near_miss_among_its_like_is_read_as_line_by_line(folder, near):
    """Each among good lines of the same lengths, so that a layout that would take it is tried."""
    content = b"".join(line + b"\n" + near + b"\n" for line in FAST)
    assert_same_content(folder, content)
    assert_same_content(folder, content + near)


@pytest.mark.parametrize("place", range(len(GOOD) - 1))
def test_any_byte_in_any_place_of_a_line_is_read_as_line_by_line(folder, place):
    lines = [GOOD[:place] + bytes([c]) + GOOD[place + 1 :] for c in range(256)]
    assert_same_content(folder, b"".join(GOOD + line for line in lines))


@pytest.mark.parametrize(
    "line", [FAST[11], FAST[12], FAST[17], FAST[-2]], ids=["fd64", "fd12", "name", "mark"]
)
def test_any_byte_in_any_place_of_other_lines_is_read_as_line_by_line(folder, line):
    changes = b"\x00\n\r\t #()./09:@AFGRT_`afg\x80\xff"
    places = range(min(len(line), 60))
    lines = [line[:k] + bytes([c]) + line[k + 1 :] for k in places for c in changes]
    assert_same_content(folder, b"\n".join((line, *lines, line)))


def test_reading_lines_of_sixteen_characters_leaves_the_text_as_it_is(folder):
    """Their payloads lie side by side; the lines with two blanks more are read a second time."""
    assert_same_content(folder, b"(1.0) can0 123#\n(1.0)   ab 123#\n" * 20)


# --- whole logs ----------------------------------------------------------------------------------

CHANNELS = (
    "can0",
    "can1",
    "can128",
    "vcan0",
    "a",
    "x#y",
    "elevenchars",
    "sixteencharacter",
    "é",
    "-" * 20,
)


def any_line(rng, base):
    """One line without its end, of all that candump and we write, and of nothing."""
    t = base + rng.randrange(2_000_000)
    digits = rng.choice((6, 6, 6, 9, rng.randrange(1, 10)))
    stamp = f"{t // 1_000_000}.{t % 1_000_000:06d}{rng.randrange(1000):03d}"
    stamp = stamp[: stamp.index(".") + 1 + digits]
    channel = rng.choice(CHANNELS[: rng.choice((1, 2, len(CHANNELS)))])
    number = rng.choice((f"{rng.randrange(0x800):03X}", f"{rng.randrange(1 << 29):08X}"))
    data = rng.randbytes(rng.choice((8, 8, 8, rng.randrange(9)))).hex()
    data = data if rng.random() < 0.1 else data.upper()
    form = rng.random()
    if form < 0.7:
        tail = rng.choice(("", "", "", "", " R", " T"))
        return f"({stamp}) {channel} {number}#{data}{tail}"
    if form < 0.8:
        payload = rng.randbytes(rng.choice(FD_SIZES)).hex().upper()
        return f"({stamp}) {channel} {number}##{rng.randrange(16):X}{payload}"
    if form < 0.85:
        return f"<{t // 1_000_000}.{t % 1_000_000:06d}> {rng.choice((ADVANCE, SECOND_SENDER))} 000#"
    spaced = " ".join(data[i : i + 2] for i in range(0, len(data), 2))
    return rng.choice(
        (
            f"({stamp}) {channel} {number}#R{rng.choice(('', '4'))}",
            f"({stamp}) {channel} 20000088#000008000000FF00",
            f" ({stamp})  {channel}  {number}   [{len(data) // 2}]  {spaced}",
            f" (2023-11-14 22:13:20.{t % 1_000_000:06d})  can0  123   [2]  11 22",
            f"  {channel}  {number}   [{len(data) // 2}]  {spaced}",
            "# comment",
            "",
            "rubbish",
            rng.randbytes(rng.randrange(60)).decode("latin-1"),
        )
    )


def any_log(rng, count):
    base = rng.choice((0, 1, 10**6, 10**12, 17 * 10**14))
    pool = [any_line(rng, base) for _ in range(rng.choice((1, 4, count)))]
    crlf = rng.choice(("\n", "\n", "\r\n"))
    lines = (rng.choice(pool) if rng.random() < 0.5 else any_line(rng, base) for _ in range(count))
    return crlf.join(lines).encode("latin-1") + rng.choice((b"", b"\n", b"\r\n"))


def damaged(rng, content):
    content = bytearray(content)
    for _ in range(rng.choice((0, 1, 5, 40))):
        if content:
            where = rng.randrange(len(content))
            content[where] = rng.choice(b"\n\r\t #()./019:@AFGRTafg<>\x00\xff")
    if rng.random() < 0.3:
        return bytes(content[: rng.randrange(len(content) + 1)])
    return bytes(content)


@pytest.mark.costly
@settings(max_examples=80, deadline=None)
@given(
    seed=st.integers(0, 1 << 32), size=st.sampled_from([1, 2, 7, 45, 46, 47, 100, 1000, 1 << 20])
)
@example(seed=0, size=1)
def test_any_log_is_read_as_line_by_line(folder, seed, size):
    rng = random.Random(seed)
    content = damaged(rng, any_log(rng, rng.choice((3, 30, 200))))
    assert_same_content(folder, content, size)


@pytest.mark.slow
@pytest.mark.long
@pytest.mark.timeout(1800)
@settings(max_examples=3000, deadline=None)
@given(seed=st.integers(0, 1 << 32), size=st.sampled_from([1, 7, 46, 1000, 1 << 20]))
def test_any_log_is_read_as_line_by_line_at_length(folder, seed, size):
    rng = random.Random(seed)
    content = damaged(rng, any_log(rng, rng.choice((3, 30, 200, 1000))))
    assert_same_content(folder, content, size)


@settings(max_examples=150, deadline=None)
@given(content=st.binary(max_size=300), size=st.integers(1, 400))
def test_any_bytes_are_read_as_line_by_line(folder, content, size):
    # Behind a blank line: the first bytes of another format would be an error.
    assert_same_content(folder, b"\n" + content, size)


@settings(max_examples=60, deadline=None)
@given(
    pieces=st.lists(st.sampled_from([*FAST, *NEAR, GOOD[:-1], b"\n", b"\r", b" "]), max_size=40),
    joint=st.sampled_from([b"\n", b"\r\n", b"\r", b"", b" "]),
    size=st.integers(1, 3000),
)
def test_lines_in_any_order_are_read_as_line_by_line(folder, pieces, joint, size):
    assert_same_content(folder, joint.join(pieces), size)


@pytest.mark.costly
@pytest.mark.parametrize("size", [1, 1000, LINE_LIMIT, 1 << 20])
@pytest.mark.parametrize("over", [-2, -1, 0, 1, LINE_LIMIT - 1, LINE_LIMIT, LINE_LIMIT + 1])
def test_lines_about_the_limit_are_read_as_line_by_line(folder, over, size):
    long = b"x" * (LINE_LIMIT + over)
    path = folder / "long.log"
    path.write_bytes(
        GOOD * 3 + long + b"\n" + GOOD * 3 + GOOD[:-1] + b" " * len(long) + b"\n" + long
    )
    assert_same(path, max(size, 1000) if over > 1 else size)


@pytest.mark.costly
def test_the_drive_of_the_car_is_read_as_line_by_line():
    folder = real_data()
    if folder is None:
        pytest.skip("measured data not found; set ADHESION_CAN_REALDATA to their folder")
    blocks = assert_same(folder / "rav4_drive.log.gz")
    assert (
        blocks[-1].channels == ("can0", "can128", "can1", "can129") or len(blocks[-1].channels) == 4
    )


def plain_log(count, rng):
    return [
        Frame(
            17 * 10**14 + 250 * i,
            rng.randrange(0x800) if i % 3 else rng.randrange(1 << 29),
            rng.randbytes(rng.choice((8, 8, 8, 0, 3, 5))),
            f"can{i % 2}",
            i % 3 == 0,
        )
        for i in range(count)
    ]


def test_python_can_reads_the_same(tmp_path):
    frames = plain_log(3000, random.Random(3))
    path = tmp_path / "a.log"
    path.write_text("".join(map(format_frame, frames)))
    with can.LogReader(path) as reader:
        theirs = [from_message(message) for message in reader]
    assert (
        [item for block in Recording(path).blocks() for item in block.items()] == theirs == frames
    )


def test_lines_of_one_form_are_not_read_one_by_one(tmp_path, monkeypatch):
    """What makes it fast: the slow way sees the lines of other forms alone."""
    seen = []
    monkeypatch.setattr(
        candump_form, "read_line", lambda line: seen.append(line) or parse_line(line)
    )
    path = tmp_path / "a.log"
    lines = [*map(format_frame, plain_log(20_000, random.Random(3)))]
    lines += [format_mark(Mark(i, ADVANCE)) for i in range(200)]
    lines += [
        format_frame(Frame(i, 1, bytes(size), "can7", is_fd=True))
        for i, size in enumerate(FD_SIZES * 20)
    ]
    path.write_text("".join(lines) + "rubbish\n" * 3)
    recording = Recording(path)
    assert sum(map(len, recording.blocks(100_000))) == len(lines)
    assert seen.count(b"rubbish\n") == 3
    assert len(seen) < 3 + 2 * chunk_parser._FEW


# --- stamps --------------------------------------------------------------------------------------


@settings(max_examples=200, deadline=None)
@given(
    seconds=st.integers(0, 9_223_372_035),
    fraction=st.text("0123456789", min_size=1, max_size=9),
    width=st.integers(1, 12),
    single=st.booleans(),
)
@example(seconds=1, fraction="000000500", width=1, single=False)
@example(seconds=1, fraction="000001500", width=1, single=False)
@example(seconds=1, fraction="9999995", width=1, single=True)
@example(seconds=9_223_372_035, fraction="999999999", width=1, single=True)
def test_stamps_are_exact_to_their_last_digit(folder, seconds, fraction, width, single):
    """Also of lines that are read one by one; and µs are the nearest, a half the even one."""
    line = f"({seconds:0{width}d}.{fraction}) can0 123#{'R' if single else '11'}\n".encode()
    (block,) = assert_same_content(folder, line * 3)
    t_ns = seconds * 10**9 + int(fraction.ljust(9, "0"))
    assert block.t_ns.tolist() == [t_ns] * 3
    assert block.t_us.tolist() == [parse_line(line).t_us] * 3
    assert parse_line(line).t_us == round(t_ns / 1000) or t_ns > 1 << 52


def test_a_half_of_a_microsecond_goes_to_the_even_one(folder):
    lines = "".join(f"(5.{us:06d}500) can0 123#\n(5.{us:06d}5) can0 123#\n" for us in range(1000))
    (block,) = assert_same_content(folder, lines.encode())
    assert block.t_us.tolist() == [5_000_000 + us + us % 2 for us in range(1000) for _ in "ab"]


def test_differences_are_summed_over_chunks(folder):
    steps = [0, *([10_000, 250, 250, 250] * 200)]
    lines = [f" ({t // 10**6:03d}.{t % 10**6:06d})  can0  123   [2]  11 22\n" for t in steps] + [
        "(0.000100) can0 123#1122\n",
        "<5.000000> advance 000#\n",
    ] * 100
    blocks = assert_same_content(folder, "".join(lines).encode(), 500)
    assert len(blocks) > 10
    frames = np.concatenate([b.t_us[b.kind == Kind.DATA] for b in blocks])
    assert frames.tolist() == np.cumsum([*steps, *[100] * 100]).tolist()


def test_sums_of_differences_end_where_stamps_end(folder):
    line = " (%s)  can0  123   [2]  11 22\n"
    far = [line % "000.000000", line % "9000000000.000000", line % "000.000001"] * 5
    (block,) = assert_same_content(folder, "".join(far).encode())
    assert block.t_us[-1] == 9_223_372_036_000_000


@pytest.mark.parametrize("size", [40, 1 << 20])
def test_stamps_backwards_are_counted_in_microseconds(folder, size):
    stamps = (
        "1.000000500",
        "1.000000400",
        "1.000001600",
        "1.000001400",
        "0.5",
        "0.5",
        "7.0",
        "6.9",
    )
    content = "".join(f"({stamp}) can0 123#\n<9.000000> advance 000#\n" for stamp in stamps)
    assert_same_content(folder, content.encode(), size)


# --- channels, kinds, keys -----------------------------------------------------------------------


def test_channels_stand_in_the_order_of_the_file_and_keep_their_places(folder):
    names = ["can3", "can10", "can1", "a-long-name-of-a-bus", "can2", "can10", "can0"]
    content = "".join(f"(1.0) {name} 123#11\n" * 40 for name in names).encode()
    for size in (100, 1000, 1 << 20):
        blocks = assert_same_content(folder, content, size)
        assert blocks[-1].channels == tuple(dict.fromkeys(names))
        assert Block.concatenate(blocks).channels == blocks[-1].channels


def test_marks_alone_have_a_channel_without_a_name(folder):
    (first, *_, last) = assert_same_content(
        folder, b"<1.000000> advance 000#\n" * 9 + GOOD * 9, 100
    )
    assert first.channels == ("",)
    assert last.channels == ("", "can0")
    assert set(first.kind.tolist()) == {Kind.ADVANCE}


def test_keys_tell_ids_of_both_lengths_apart(folder):
    (block,) = assert_same_content(
        folder, b"(1.0) can0 123#11\n(1.0) can0 00000123#11\n(1.0) can0 20000088#00\n" * 30
    )
    assert block.key[:3].tolist() == [0x123, 0x123 | EXTENDED, 0x88]
    assert block.kind[:3].tolist() == [Kind.DATA, Kind.DATA, Kind.ERROR]


def test_words_are_wide_only_where_a_payload_is(folder):
    (narrow,) = assert_same_content(folder, GOOD * 9 + b"(1.0) can0 123##01122\n" * 9)
    assert narrow.words.shape == (18, 1)
    (wide,) = assert_same_content(folder, GOOD * 9 + b"(1.0) can0 123##0" + b"A5" * 12 + b"\n")
    assert wide.words.shape == (10, 8)
    assert wide.words[-1].tolist() == [0xA5A5A5A5A5A5A5A5, 0xA5A5A5A5] + [0] * 6
    assert wide.words[0].tolist() == [0x8877665544332211] + [0] * 7


def test_as_many_names_as_a_file_can_have(folder):
    content = "".join(f"(1.0) n{i % 700} 123#\n" for i in range(1400)).encode()
    blocks = assert_same_content(folder, content)
    assert len(blocks[-1].channels) == 700


@pytest.mark.costly
def test_more_names_than_columns_can_tell_are_an_error(folder):
    path = folder / "names.log"
    path.write_text("".join(f"(1.0) n{i} 123#R\n" for i in range(66_000)))
    with pytest.raises(RecordingError, match="names of buses"):
        list(Recording(path).blocks())


# --- hints, threads, memory ----------------------------------------------------------------------


@pytest.mark.costly
@settings(max_examples=40, deadline=None)
@given(seed=st.integers(0, 1 << 32), hinted=st.integers(0, 1 << 32))
def test_hints_change_nothing(seed, hinted):
    reports = ReadReport(), ReadReport()
    parsers = [ChunkParser(CandumpForm(), report) for report in reports]
    hints, content = any_log(random.Random(hinted), 60), any_log(random.Random(seed), 100)
    with eager():
        parsers[1].parse(chunk_of(hints))
        before, behind = Counter(reports[1].kinds), parsers[1]._lines
        reports[1].bad_lines.clear()
        alone, helped = (parser.parse(chunk_of(content)) for parser in parsers)
    assert list(alone.items()) == list(helped.items())
    assert alone.t_ns.tolist() == helped.t_ns.tolist()
    assert reports[0].kinds == reports[1].kinds - before
    assert reports[0].bad_lines == [number - behind for number in reports[1].bad_lines]


@pytest.mark.parametrize("packed", [False, True])
def test_a_reader_that_stops_early_leaves_nothing_behind(tmp_path, packed):
    path = tmp_path / "a.log"
    content = b"".join(GOOD.replace(b"1122", b"%04X" % i) for i in range(50_000))
    path.write_bytes(gzip.compress(content) if packed else content)
    recording = Recording(path)
    before = threading.active_count()
    blocks = recording.blocks(10_000)
    next(blocks)
    blocks.close()
    assert threading.active_count() == before
    assert 0 < recording.position < recording.size
    assert 0 < recording.report.kinds["frame"] < 1000


@pytest.mark.parametrize("packed", [False, True])
def test_memory_does_not_grow_with_the_file(tmp_path, packed):
    path = tmp_path / ("a.log.gz" if packed else "a.log")
    content = GOOD * 400_000
    path.write_bytes(gzip.compress(content, 1) if packed else content)
    tracemalloc.start()
    try:
        blocks = Recording(path).blocks(1 << 18)
        count = len(next(blocks))
        tracemalloc.reset_peak()
        assert count + sum(map(len, blocks)) == 400_000
        _, peak = tracemalloc.get_traced_memory()
    finally:
        tracemalloc.stop()
    assert peak < 6 << 20, "of 18 MB"


@pytest.mark.parametrize("packing", ["plain", "gzip", "zstd"])
def test_position_grows_to_the_size_of_the_file(tmp_path, packing):
    path = tmp_path / "a.log"
    content = "".join(map(format_frame, plain_log(40_000, random.Random(1)))).encode()
    pack = {"plain": bytes, "gzip": gzip.compress, "zstd": zstandard.compress}[packing]
    path.write_bytes(pack(content))
    recording = Recording(path)
    assert recording.position == 0
    seen = [recording.position for _ in recording.blocks(100_000)]
    assert len(seen) > 10
    assert seen == sorted(seen)
    assert len(set(seen)) > 5
    assert 0 < seen[0] < recording.size / 2
    assert seen[-1] <= recording.position == recording.size


# --- packed files --------------------------------------------------------------------------------


def zstd_parts(content):
    """Several frames, one of them to be skipped."""
    third = len(content) // 3
    parts = [content[:third], content[third : 2 * third], content[2 * third :]]
    one, two, three = (zstandard.ZstdCompressor(level=1).compress(part) for part in parts)
    skipped = b"\x50\x2a\x4d\x18" + (5).to_bytes(4, "little") + b"hello"
    return one + skipped + two + three


def gzip_parts(content):
    third = len(content) // 3
    return gzip.compress(content[:third]) + gzip.compress(content[third:]) + bytes(20)


PACK = {
    "gzip": gzip.compress,
    "zstd": zstandard.compress,
    "gzip in parts": gzip_parts,
    "zstd in parts": zstd_parts,
}


@pytest.mark.parametrize("way", PACK)
@pytest.mark.parametrize("name", ["a.log", "a.log.gz", "a.log.zst", "a.candump.zst", "a.zst"])
def test_packed_logs_are_known_by_their_first_bytes(tmp_path, way, name):
    frames = plain_log(5000, random.Random(2))
    path = tmp_path / name
    path.write_bytes(PACK[way]("".join(map(format_frame, frames)).encode()))
    blocks = assert_same(path, 10_000)
    assert [item for block in blocks for item in block.items()] == frames
    assert not Recording(path).report.notes


def spoiled(rng, packed):
    packed = bytearray(packed)
    if rng.random() < 0.5:
        return packed[: rng.randrange(4, len(packed))]
    packed[rng.randrange(4, len(packed))] ^= 1 << rng.randrange(8)
    return packed


@pytest.mark.costly
@pytest.mark.parametrize("way", PACK)
def test_what_is_packed_and_spoiled_is_read_as_far_as_line_by_line(tmp_path, way):
    rng = random.Random(way)
    frames = plain_log(4000, rng)
    packed = PACK[way]("".join(map(format_frame, frames)).encode())
    path = tmp_path / "a.log"
    reported = 0
    for _ in range(15):
        path.write_bytes(spoiled(rng, packed))
        if path.read_bytes()[:4] == packed[:4]:
            assert_same(path, rng.choice((3000, 1 << 20)))
            recording = Recording(path)
            found = [item for block in recording.blocks() for item in block.items()]
            if found != frames:
                reported += 1
                assert (
                    recording.report.kinds["cut"] + recording.report.passed_over >= 1
                    or len(found) == 4000
                )
    assert reported > 3


def test_zstd_without_its_package_names_the_extra(tmp_path, monkeypatch):
    path = tmp_path / "a.log.zst"
    path.write_bytes(zstandard.compress(GOOD))
    monkeypatch.setitem(sys.modules, "zstandard", None)
    for read in (iter, Recording.blocks):
        with pytest.raises(RecordingError, match=re.escape(install_extra("zstd"))) as caught:
            next(read(Recording(path)))
        assert "a.log.zst" in str(caught.value)
        assert "\n" not in str(caught.value)
