"""candump text: every form of line that can-utils writes, and every form that nobody writes.

The expected values are written by hand from can-utils' own sources (lib.c, candump.c), not taken
from the reader.
"""

import gzip
import io
import json
import shutil
import subprocess
import time

import can
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from adhesion_can.bus.frame import ADVANCE, MARKS, SECOND_SENDER, Frame, Mark
from adhesion_can.recordings.candump import (
    ReadReport,
    format_frame,
    format_mark,
    looks_like_candump,
    parse_line,
    read_candump,
)
from adhesion_can.recordings.recording import Recording
from tests.bus.bus_helpers import DATA

T = 1_700_000_000_123_456
EIGHT = bytes(range(0x11, 0x99, 0x11))
TWELVE = bytes.fromhex("112233445566778899AABBCC")


def classic(data=b"\x11\x22", number=0x123, channel="can0", t_us=T):
    return Frame(t_us, number, data, channel)


def read(text):
    report = ReadReport()
    content = text.encode() if isinstance(text, str) else text
    return list(read_candump(io.BytesIO(content), report)), report


# --- one line each -------------------------------------------------------------------------------

LOG_LINES = {
    # candump -L and -l
    "(1700000000.123456) can0 123#1122": classic(),
    "(1700000000.123456) can0 123#": classic(b""),
    "(1700000000.123456) can0 123#1122334455667788": classic(EIGHT),
    "(1700000000.123456) vcan1 7FF#00": classic(b"\x00", 0x7FF, "vcan1"),
    "(1700000000.123456) can0 00000123#1122": Frame(T, 0x123, b"\x11\x22", "can0", True),
    "(1700000000.123456) can0 1FFFFFFF#1122": Frame(T, 0x1FFFFFFF, b"\x11\x22", "can0", True),
    # padded device names, since several interfaces were named
    "(1700000000.123456)   can0 123#1122": classic(),
    # -L -x: direction behind the frame
    "(1700000000.123456) can0 123#1122 R": classic(),
    "(1700000000.123456) can0 123#1122 T": classic(),
    # remote requests, with and without a length
    "(1700000000.123456) can0 123#R": Frame(T, 0x123, b"", "can0", is_remote=True),
    "(1700000000.123456) can0 123#R4": Frame(T, 0x123, b"", "can0", is_remote=True),
    "(1700000000.123456) can0 00000123#R8 T": Frame(T, 0x123, b"", "can0", True, is_remote=True),
    # error frames: the flag is bit 29 of the id, the rest says what happened
    "(1700000000.123456) can0 20000004#0000000000000000": Frame(T, 4, b"", "can0", is_error=True),
    "(1700000000.123456) can0 20000088#000008000000FF00": Frame(
        T, 0x88, b"", "can0", is_error=True
    ),
    # CAN FD: one digit of flags
    "(1700000000.123456) can0 123##0": Frame(T, 0x123, b"", "can0", is_fd=True),
    "(1700000000.123456) can0 123##1112233445566778899AABBCC": Frame(
        T, 0x123, TWELVE, "can0", is_fd=True
    ),
    "(1700000000.123456) can0 00000123##311": Frame(T, 0x123, b"\x11", "can0", True, is_fd=True),
    # separators, which cansend and older logs have
    "(1700000000.123456) can0 123#11.22": classic(),
    "(1700000000.123456) can0 123##0.11.22": Frame(T, 0x123, b"\x11\x22", "can0", is_fd=True),
    # lower case, tabs, short and long fractions
    "(1700000000.123456) can0 1ab#ddeeff": classic(b"\xdd\xee\xff", 0x1AB),
    "(1700000000.123456)\tcan0\t123#1122": classic(),
    "(0.5) can0 123#1122": classic(t_us=500_000),
    "(1700000000.123456789) can0 123#1122": classic(t_us=T + 1),
}

COLUMN_LINES = {
    # -ta; SFF ids are indented once an EFF id was seen
    " (1700000000.123456)  can0  123   [2]  11 22": classic(),
    " (1700000000.123456)  can0       123   [2]  11 22": classic(),
    " (1700000000.123456)  can0  00000123   [2]  11 22": Frame(T, 0x123, b"\x11\x22", "can0", True),
    " (1700000000.123456)  can0  123   [0]": classic(b""),
    " (1700000000.123456)  can0  123   [0] ": classic(b""),
    " (1700000000.123456)  can0  123   [8]  11 22 33 44 55 66 77 88": classic(EIGHT),
    # log2long puts no blank in front
    "(1700000000.123456)  can0       123   [2]  11 22                     '.\"'": classic(),
    "(1700000000.123456)  can0       123   [0]                            ''": classic(b""),
    # -tz, -td
    " (000.000000)  can0  123   [2]  11 22": classic(t_us=0),
    " (012.345678)  can0  123   [2]  11 22": classic(t_us=12_345_678),
    # -tA
    " (2023-11-14 22:13:20.123456)  can0  123   [2]  11 22": classic(),
    " (2024-02-29 00:00:00.000000)  can0  123   [2]  11 22": classic(t_us=1_709_164_800_000_000),
    # -x
    " (1700000000.123456)  can0  RX - -  123   [2]  11 22": classic(),
    " (1700000000.123456)  can0  TX - -  123   [2]  11 22": classic(),
    " (1700000000.123456)  can0  RX B -  123  [12]  11 22 33 44 55 66 77 88 99 AA BB CC": Frame(
        T, 0x123, TWELVE, "can0", is_fd=True
    ),
    " (1700000000.123456)  can0  RX B E  00000123  [01]  11": Frame(
        T, 0x123, b"\x11", "can0", True, is_fd=True
    ),
    # -a: text behind the bytes, which may look like more of them
    " (1700000000.123456)  can0  123   [8]  11 22 33 44 55 66 77 88   '.\"3DUfw.'": classic(EIGHT),
    " (1700000000.123456)  can0  123   [2]  41 42                     'AB'": classic(b"AB"),
    " (1700000000.123456)  can0  123   [5]  20 41 42 20 27            ' AB ''": classic(b" AB '"),
    # FD: two digits between the brackets, also below ten
    " (1700000000.123456)  can0  123  [08]  11 22 33 44 55 66 77 88": Frame(
        T, 0x123, EIGHT, "can0", is_fd=True
    ),
    " (1700000000.123456)  can0  123  [00]": Frame(T, 0x123, b"", "can0", is_fd=True),
    " (1700000000.123456)  can0  123  [12]  11 22 33 44 55 66 77 88 99 AA BB CC": Frame(
        T, 0x123, TWELVE, "can0", is_fd=True
    ),
    " (1700000000.123456)  can0  123  [64] " + " 5A" * 64: Frame(
        T, 0x123, b"\x5a" * 64, "can0", is_fd=True
    ),
    # remote requests and error frames
    " (1700000000.123456)  can0  123   [0]  remote request": Frame(
        T, 0x123, b"", "can0", is_remote=True
    ),
    " (1700000000.123456)  can0  123   [4]  remote request": Frame(
        T, 0x123, b"", "can0", is_remote=True
    ),
    " (1700000000.123456)  can0  20000004   [8]  00 00 00 00 00 00 00 00   ERRORFRAME": Frame(
        T, 4, b"", "can0", is_error=True
    ),
    " (1700000000.123456)  can0  20000088   [8]  00 00 08 00 00 00 FF 00   ERRORFRAME": Frame(
        T, 0x88, b"", "can0", is_error=True
    ),
}
FRAME_LINES = LOG_LINES | COLUMN_LINES


@pytest.mark.parametrize("end", ["\n", "\r\n", ""], ids=["LF", "CRLF", "cut"])
@pytest.mark.parametrize(("line", "frame"), FRAME_LINES.items(), ids=FRAME_LINES.keys())
def test_every_form_of_line_gives_its_frame(line, frame, end):
    assert parse_line((line + end).encode()) == frame
    assert looks_like_candump((line + end).encode())


OTHER_LINES = {
    "": "blank",
    "   \t ": "blank",
    "# comment": "comment",
    "; comment": "comment",
    "* comment": "comment",
    "// comment": "comment",
    # candump without -t
    "  can0  123   [2]  11 22": "untimed",
    "  can0  00000123   [8]  01 02 03 04 05 06 07 08   '........'": "untimed",
    # candump -S (bytes swapped) and -i (binary): not to be read as if they were in order
    " (1700000000.123456)  can0  123   [2]  22`11": "malformed",
    " (1700000000.123456)  can0  123   [2]  00010001 00100010": "malformed",
    " (1700000000.123456)  can0  123   [1]  00010001": "malformed",
    # CAN XL
    "(1700000000.123456) can0 00123#81:00:12345678#112233": "malformed",
    "(1700000000.123456) can0 00123#81:00:12345678#" + "A5" * 2048: "malformed",
    # what candump says besides frames
    "DROPCOUNT: dropped 7 CAN frames on 'can0' socket (total drops 7)": "malformed",
    "\tcontroller-problem{rx-error-warning}": "malformed",
    # damaged lines
    "(1700000000.123456) can0 123#112": "malformed",
    "(1700000000.123456) can0 123#11GG": "malformed",
    "(1700000000.123456) can0 123#112233445566778899": "malformed",
    "(1700000000.123456) can0 123##1112233445566778899": "malformed",
    "(1700000000.123456) can0 123##": "malformed",
    "(1700000000.123456) can0 123": "malformed",
    "(1700000000.123456) can0 800#11": "malformed",
    "(1700000000.123456) can0 1234#11": "malformed",
    "(1700000000.123456) can0 800007FF#11": "malformed",
    "(1700000000) can0 123#11": "malformed",
    "1700000000.123456 can0 123#11": "malformed",
    "(-1.000000) can0 123#11": "malformed",
    "(1e9.0) can0 123#11": "malformed",
    "(1700000000.123456) can0 123#1122 X": "malformed",
    "(1700000000.123456) can0 123#11 22": "malformed",
    "(1700000000.123456)  can0  123   [3]  11 22": "malformed",
    "(1700000000.123456)  can0  123   [9]  11 22 33 44 55 66 77 88 99": "malformed",
    "(1700000000.123456)  can0  123  [09]  11 22 33 44 55 66 77 88 99": "malformed",
    "(1700000000.123456)  can0  800   [2]  11 22": "malformed",
    "(2024-02-30 00:00:00.000000)  can0  123   [2]  11 22": "malformed",
    "(soon)  can0  123   [2]  11 22": "malformed",
    "<1700000000.123456> no-such-mark 000#": "malformed",
    "<1700000000.123456> advance 001#": "malformed",
    "<1700000000.1> advance 000#": "malformed",
    "\x00\x01\x02": "malformed",
    "é": "malformed",
}


@pytest.mark.parametrize(("line", "kind"), OTHER_LINES.items(), ids=[k[:50] for k in OTHER_LINES])
def test_every_other_line_is_reported_by_kind(line, kind):
    assert parse_line((line + "\n").encode()) == kind
    assert parse_line((line + "\r\n").encode()) == kind
    items, report = read(line + "\n")
    assert items == []
    assert report.kinds == {kind: 1}
    bad = kind not in ("blank", "comment")
    assert report.bad_lines == ([1] if bad else [])
    assert report.passed_over == bad


@pytest.mark.parametrize(
    ("line", "frame"),
    [
        ("(1700000000.123456) can0 123#1122334455667788_E", classic(EIGHT)),
        ("(1700000000.123456) can0 123#R8_9", Frame(T, 0x123, b"", "can0", is_remote=True)),
        (" (1700000000.123456)  can0  123   {E}  11 22 33 44 55 66 77 88", classic(EIGHT)),
    ],
)
def test_raw_length_codes_of_candump_8_lose_no_frame(line, frame):
    """`candump -8` (2021) says the raw DLC of 8-byte frames: `_9`.. behind the payload, or {9}."""
    assert parse_line(line.encode()) == frame


def test_a_line_of_sixty_thousand_characters_is_refused_quickly():
    nasty = [
        b"(1.0)" + b" " * 60_000 + b"x",
        b"(1.0) can0 RX" + b" " * 20_000 + b"x" * 20_000,
        b"(1.0) can0 123 [8]" + b" 11" * 20_000,
        b"(" * 60_000,
        b"(1.0) can0 123#" + b"1" * 60_000,
        b"(1.0) " + b"c" * 16_000,
        b"(1.0)  can0  RX - -  " + b" " * 16_000,
        b"(1.0)  can0  123   [8] " + b" 11" * 5_000 + b"!",
        b"<1.000000> " + b"a" * 16_000,
    ]
    before = time.process_time()  # of this process alone, however busy the machine is
    for line in nasty:
        if len(line) > 16384:
            assert parse_line(line) == "malformed", line[:30]
        else:
            parse_line(line)
        looks_like_candump(line)
    assert time.process_time() - before < 1.0


# --- whole files ---------------------------------------------------------------------------------


def described(item):
    if isinstance(item, Mark):
        return [item.t_us, item.name]
    flags = [name for name in ("extended", "fd", "remote", "error") if getattr(item, f"is_{name}")]
    number = f"{item.arbitration_id:03x}" if not item.is_error else f"{item.arbitration_id:x}"
    return [item.t_us, item.channel, number, item.data.hex(), " ".join(flags)]


@pytest.mark.parametrize("crlf", [False, True], ids=["LF", "CRLF"])
def test_golden_file_of_mixed_lines(crlf):
    content = (DATA / "candump_mixed.log").read_bytes().replace(b"\r\n", b"\n").rstrip(b"\n")
    golden = json.loads((DATA / "candump_mixed.json").read_text())
    items, report = read(content.replace(b"\n", b"\r\n") if crlf else content)
    assert [described(item) for item in items] == golden["items"]
    assert report.kinds == golden["kinds"]
    assert report.bad_lines == golden["bad_lines"]
    assert report.backwards == golden["backwards"]
    assert report.passed_over == golden["passed_over"]


def test_frames_stamped_backwards_are_counted_and_kept():
    stamps = (5, 4, 6, 6, 1, 2)
    items, report = read("".join(f"({t}.000000) can0 123#\n" for t in stamps))
    assert [item.t_us // 1_000_000 for item in items] == list(stamps)
    assert report.backwards == 2


def test_only_the_first_ten_bad_lines_are_named_and_all_are_counted():
    _, report = read("bad\n" * 25 + "(1.000000) can0 123#\n")
    assert report.bad_lines == list(range(1, 11))
    assert report.passed_over == report.kinds["malformed"] == 25
    assert report.kinds["frame"] == 1


def test_every_line_is_counted_once():
    lines = [*FRAME_LINES, *OTHER_LINES]
    _, report = read("\n".join(lines) + "\n")
    assert report.kinds.total() == len(lines)


@pytest.mark.parametrize("length", range(1, 41))
def test_a_last_line_cut_anywhere_is_cut_or_a_shorter_frame(length):
    whole = "(1700000000.123456) can0 123#1122334455"
    items, report = read("(1.000000) can0 7FF#\n" + whole[:length])
    if len(items) == 1:
        assert report.kinds == {"frame": 1, "cut": 1}
        assert report.bad_lines == [2]
    else:
        assert items[1].data == bytes.fromhex(whole[29:length])
        assert report.passed_over == 0


def test_an_empty_file_and_a_binary_one_give_no_frames():
    assert read(b"") == ([], ReadReport())
    items, report = read(bytes(range(256)) * 20)
    assert items == []
    assert report.passed_over == report.kinds.total() > 0


# --- candump -td ---------------------------------------------------------------------------------


def columns(micros):
    return "".join(
        f" ({t // 1_000_000:03d}.{t % 1_000_000:06d})  can0  123   [2]  11 22\n" for t in micros
    )


def differences(stamps):
    return [b - a for a, b in zip([stamps[0], *stamps], stamps, strict=False)]


def cyclic(cycle_us, burst, spacing_us, cycles, jitter=()):
    """Stamps from 0 on of a bus that sends `burst` frames back to back each cycle."""
    stamps = [
        k * cycle_us + i * spacing_us + (jitter[(k * burst + i) % len(jitter)] if jitter else 0)
        for k in range(cycles)
        for i in range(burst)
    ]
    return [t - stamps[0] for t in stamps]


@pytest.mark.parametrize("burst", [2, 3, 4, 6, 8, 12])
@pytest.mark.parametrize("jitter", [(), (0, 3, 1, 7, 2, 5, 4)], ids=["steady", "jitter"])
def test_differences_are_summed(burst, jitter):
    """What -td writes is differences, however regular the bus is and however long its bursts."""
    stamps = cyclic(10_000, burst, 250, 40, jitter)
    items, report = read(columns(differences(stamps)))
    assert [item.t_us for item in items] == stamps
    assert any("td" in note for note in report.notes)
    assert report.backwards == 0


@settings(max_examples=60, deadline=None)
@given(gaps=st.lists(st.integers(0, 50_000), min_size=3, max_size=60), first=st.integers(0, 10**9))
@example(gaps=[10_000] * 20, first=0)
def test_stamps_that_rise_are_never_taken_for_differences(gaps, first):
    stamps = [first]
    for gap in gaps:
        stamps.append(stamps[-1] + gap)
    items, report = read(columns(stamps))
    assert [item.t_us for item in items] == stamps
    assert not report.notes


@pytest.mark.parametrize("spacing_us", [250, 1, 0])
def test_zero_based_stamps_with_a_few_steps_back_stay_stamps(spacing_us):
    """Two interfaces with clocks of their own: -tz may step back now and then.

    With clocks of a millisecond the frames of a burst carry one stamp, which is no step back.
    """
    stamps = cyclic(10_000, 4, spacing_us, 40)
    for i in (19, 59, 103):
        stamps[i], stamps[i + 1] = stamps[i + 1], stamps[i]
    items, report = read(columns(stamps))
    assert [item.t_us for item in items] == stamps
    assert report.backwards == 3


# --- round trip, and other readers ---------------------------------------------------------------

fd_sizes = st.sampled_from([*range(9), 12, 16, 20, 24, 32, 48, 64])
names = st.from_regex(r"[A-Za-z][A-Za-z0-9_.:-]{0,14}", fullmatch=True)


@st.composite
def frames(draw, channels=names):
    kind = draw(st.sampled_from(["data", "data", "fd", "remote", "error"]))
    extended = draw(st.booleans()) and kind != "error"
    top = 0x1FFFFFFF if extended or kind == "error" else 0x7FF
    data = b""
    if kind in ("data", "fd"):
        size = draw(fd_sizes if kind == "fd" else st.integers(0, 8))
        data = draw(st.binary(min_size=size, max_size=size))
    return Frame(
        draw(st.integers(0, 4_000_000_000_000_000)),
        draw(st.integers(0, top)),
        data,
        draw(channels),
        extended,
        kind == "fd",
        kind == "remote",
        kind == "error",
    )


@settings(max_examples=300, deadline=None)
@given(frame=frames())
def test_what_is_written_is_read_back(frame):
    line = format_frame(frame)
    assert line.endswith("\n")
    assert line.startswith("(")
    assert parse_line(line.encode()) == frame


def test_a_frame_without_channel_takes_the_default_one():
    assert format_frame(Frame(1, 0x12, b"\xab")) == "(0.000001) can0 012#AB\n"
    assert format_frame(Frame(1, 0x12, b""), channel="vcan3") == "(0.000001) vcan3 012#\n"


def test_golden_lines_are_can_utils_own():
    golden = {
        Frame(T, 0x101, EIGHT, "can0"): "(1700000000.123456) can0 101#1122334455667788\n",
        Frame(T, 0x101, b"", "can1", True): "(1700000000.123456) can1 00000101#\n",
        Frame(T, 1, b"", "can0", is_remote=True): "(1700000000.123456) can0 001#R\n",
        Frame(T, 1, TWELVE, "can0", is_fd=True): (
            "(1700000000.123456) can0 001##0112233445566778899AABBCC\n"
        ),
    }
    for frame, line in golden.items():
        assert format_frame(frame) == line


@settings(max_examples=100, deadline=None)
@given(t_us=st.integers(0, 10**16), name=st.sampled_from(sorted(MARKS)))
def test_marks_are_read_back_and_canplayer_passes_over_them(t_us, name):
    line = format_mark(Mark(t_us, name))
    assert parse_line(line.encode()) == Mark(t_us, name)
    # canplayer: "if (buf[0] != '(')" the line is skipped; log2asc does the same.
    assert not line.startswith("(")
    assert line.endswith("\n")
    assert line.count("\n") == 1


def python_can_frames(path):
    """python-can's own reading of a file, as frames."""
    with can.LogReader(path) as reader:
        return [
            Frame(
                round(m.timestamp * 1e6),
                m.arbitration_id,
                b"" if m.is_error_frame else bytes(m.data),
                str(m.channel),
                m.is_extended_id,
                m.is_fd,
                m.is_remote_frame,
                m.is_error_frame,
            )
            for m in reader
        ]


def comparable(frame):
    # python-can forgets number and channel of an error frame.
    return (
        frame._replace(arbitration_id=0, channel="", is_extended=True) if frame.is_error else frame
    )


@settings(max_examples=30, deadline=None)
@given(written=st.lists(frames(st.sampled_from(["can0", "vcan1"])), max_size=30))
def test_python_can_reads_our_log_as_we_do(tmp_path_factory, written):
    # python-can knows an error frame by BUSERROR alone.
    written = [
        f._replace(arbitration_id=f.arbitration_id | 0x80) if f.is_error else f for f in written
    ]
    path = tmp_path_factory.mktemp("log") / "ours.log"
    path.write_text("".join(map(format_frame, written)))
    theirs = [comparable(f)._replace(channel="") for f in python_can_frames(path)]
    ours = [comparable(f)._replace(channel="") for f in Recording(path)]
    assert ours == theirs
    channels = [f.channel for f in python_can_frames(path) if not f.is_error]
    assert channels == [f.channel for f in Recording(path) if not f.is_error]


def test_python_can_and_we_agree_on_its_own_log(tmp_path):
    path = tmp_path / "theirs.log"
    messages = [
        can.Message(timestamp=1.5, arbitration_id=0x101, is_extended_id=False, data=EIGHT),
        can.Message(timestamp=1.6, arbitration_id=0x101, is_extended_id=True, data=b""),
        can.Message(timestamp=1.7, arbitration_id=0x12, is_extended_id=False, is_rx=False),
        can.Message(timestamp=1.8, arbitration_id=1, is_extended_id=False, is_remote_frame=True),
        can.Message(timestamp=1.9, arbitration_id=1, is_fd=True, data=TWELVE, bitrate_switch=True),
        can.Message(timestamp=2.0, is_error_frame=True),
    ]
    with can.Logger(path) as writer:
        for message in messages:
            writer(message)
    ours = [comparable(f)._replace(channel="") for f in Recording(path)]
    theirs = [comparable(f)._replace(channel="") for f in python_can_frames(path)]
    assert ours == theirs
    assert len(ours) == len(messages)


def test_python_can_reads_a_log_with_marks_as_empty_frames(tmp_path):
    frame = Frame(2_000_000, 0x101, EIGHT, "can0")
    path = tmp_path / "run.log"
    path.write_text(
        format_mark(Mark(1_000_000, ADVANCE))
        + format_frame(frame)
        + format_mark(Mark(3_000_000, SECOND_SENDER))
    )
    assert list(Recording(path)) == [
        Mark(1_000_000, ADVANCE),
        frame,
        Mark(3_000_000, SECOND_SENDER),
    ]
    first, second, third = python_can_frames(path)
    assert second == frame
    for empty in (first, third):
        assert (empty.arbitration_id, empty.data) == (0, b"")


@pytest.mark.skipif(not shutil.which("log2long"), reason="can-utils is not installed")
def test_log2long_turns_our_log_into_columns_that_read_the_same():
    # log2long writes error frames with their payload and 8-digit ids: the reader has to cope.
    written = [f._replace(t_us=T + 1000 * i) for i, f in enumerate(LOG_LINES.values())]
    text = "".join(map(format_frame, written))
    long = subprocess.run(
        ["log2long"], input=text, capture_output=True, text=True, check=True, timeout=20
    ).stdout
    assert long.count("\n") == len(written)
    items, report = read(long)
    assert items == written
    assert report.passed_over == 0


@pytest.mark.skipif(not shutil.which("log2asc"), reason="can-utils is not installed")
def test_log2asc_passes_over_marks(tmp_path):
    path = tmp_path / "run.log"
    text = [format_frame(classic(t_us=T + i)) + format_mark(Mark(T + i, ADVANCE)) for i in range(5)]
    path.write_text("".join(text))
    out = subprocess.run(
        ["log2asc", "-I", str(path), "can0"], capture_output=True, text=True, check=True, timeout=20
    )
    assert out.stdout.count(" Rx ") == 5


# --- arbitrary bytes -----------------------------------------------------------------------------

parts = st.sampled_from(
    [
        b"(", b")", b"<", b">", b"#", b"##", b"R", b" ", b"  ", b"\n", b"\r\n", b"\t", b".",
        b"(1.0)", b"(1700000000.123456)", b"can0", b"123", b"00000123", b"20000080", b"[8]",
        b"[12]", b"[", b"]", b"11", b" 11 22", b"remote request", b"ERRORFRAME", b"RX - -",
        b"advance", b"000#", b"2024-01-01 00:00:00.0", b"'", b"_E", b"\x00", b"\xff", b"\xb2",
    ]
)  # fmt: skip
texts = st.one_of(st.binary(max_size=200), st.lists(parts, max_size=30).map(b"".join))


def check_never_raises(content):
    items, report = read(content)
    lines = content.split(b"\n")
    count = len(lines) - (lines[-1] == b"")
    assert report.kinds.total() == count, "every line is counted"
    assert (
        len(items) + report.passed_over + report.kinds["blank"] + report.kinds["comment"] == count
    )
    for item in items:
        assert item.t_us >= 0
        if isinstance(item, Frame):
            assert item.arbitration_id <= (
                0x1FFFFFFF if item.is_extended or item.is_error else 0x7FF
            )
            assert len(item.data) <= (64 if item.is_fd else 8)
            assert item.is_data or item.data == b""
    for line in lines:
        looks_like_candump(line)


@settings(max_examples=400, deadline=None)
@given(content=texts)
def test_no_bytes_whatever_raise(content):
    check_never_raises(content)


@pytest.mark.slow
@settings(max_examples=20_000, deadline=None)
@given(content=texts)
def test_no_bytes_whatever_raise_at_length(content):
    check_never_raises(content)


@settings(max_examples=60, deadline=None)
@given(content=texts, garbage=texts)
def test_garbage_between_frames_costs_no_frame(content, garbage):
    good = [Frame(1_000_000 * i, 0x101, bytes([i] * 8), "can0") for i in range(1, 4)]
    first, second, third = (format_frame(f).encode() for f in good)
    items, _ = read(b"".join([first, content, b"\n", second, garbage, b"\n", third]))
    assert [f for f in items if f in good] == good


# --- gzip ----------------------------------------------------------------------------------------

MANY = [
    Frame(1_000_000 + i * 10_000, 0x100 + i % 512, bytes([i % 256] * 8), "can0")
    for i in range(3000)
]


def test_gzip_is_read_whatever_the_file_is_called(tmp_path):
    text = "".join(map(format_frame, MANY)).encode()
    for name in ("a.log.gz", "a.log", "a", "a.gz"):
        path = tmp_path / name
        path.write_bytes(gzip.compress(text))
        assert list(Recording(path)) == MANY, name


@pytest.mark.parametrize("share", [0.02, 0.3, 0.9, 0.9999])
def test_truncated_gzip_gives_what_came_before_and_says_so(tmp_path, share):
    text = "".join(map(format_frame, MANY)).encode()
    packed = gzip.compress(text)
    path = tmp_path / "cut.log.gz"
    path.write_bytes(packed[: int(len(packed) * share)])
    recording = Recording(path)
    found = list(recording)
    assert found == MANY[: len(found)]
    assert len(found) >= len(MANY) * (share - 0.35)
    assert recording.report.kinds["cut"] == 1
    assert any("ends early" in note for note in recording.report.notes)


@pytest.mark.parametrize("position", [3, 12, 500, 2000, -6, -1])
def test_damaged_gzip_never_raises_and_is_reported(tmp_path, position):
    text = "".join(map(format_frame, MANY)).encode()
    packed = bytearray(gzip.compress(text))
    packed[position] ^= 0xFF
    path = tmp_path / "bad.log.gz"
    path.write_bytes(packed)
    recording = Recording(path)
    for item in recording:
        assert isinstance(item, Frame)
    assert recording.report.kinds["cut"] + recording.report.passed_over > 0 or position == 3


def test_a_long_head_of_comments_does_not_hide_the_log(tmp_path):
    """The tolerant reader serves a log with 60 lines of head, packed or not, whatever its name."""
    head = "# recorded on the test track\n" * 60
    text = (head + "".join(map(format_frame, MANY[:20]))).encode()
    for name in ("head.log", "head.log.gz", "HEAD.LOG", "head.csv.log"):
        path = tmp_path / name
        path.write_bytes(gzip.compress(text) if name.endswith("gz") else text)
        recording = Recording(path)
        assert list(recording) == MANY[:20], name
        assert recording.report.kinds["comment"] == 60


def test_garbage_at_the_head_does_not_hide_the_log(tmp_path):
    path = tmp_path / "boot.log.gz"
    text = "bootloader says hello\n" * 60 + "".join(map(format_frame, MANY[:20]))
    path.write_bytes(gzip.compress(text.encode()))
    recording = Recording(path)
    assert list(recording) == MANY[:20]
    assert recording.report.kinds["malformed"] == 60
