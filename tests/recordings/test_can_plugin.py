"""Our reader of candump text as python-can's plug-in, by python-can's own reader and commands."""

import gzip
import io
import logging
import sys
import threading

import can
import can.logconvert
import can.player
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from adhesion_can.recordings.can_plugin import CandumpReader

GOOD = [
    "(1700000000.123456) can0 123#0102030405060708",
    "(1700000000.123456789) vcan1 12345678#R8 T",
    "(1700000000.2) 3 7FF##3" + "AB" * 12 + " R",
    "(1700000000.25) can0 20000080#0000000000000000",
    "(1700000000.3) can0 123#R",
]
BAD = ["", "what is this", "(170", "(1.0) can0 12#00", "(1.0) can0 123#0", "(x) can0 123#00",
       "(1.0) can0 123#GG", "# a comment", "\x00\x01", "(1.0) can0"]  # fmt: skip


def same(one, other):
    return one.equals(other, timestamp_delta=None) and one.timestamp == other.timestamp


def assert_same(found, wanted):
    assert len(found) == len(wanted)
    for one, other in zip(found, wanted, strict=True):
        assert one.equals(other, timestamp_delta=None), (one, other)
        assert one.timestamp == other.timestamp
        assert one.dlc == other.dlc


def ours(text):
    return list(CandumpReader(io.BytesIO(text.encode())))


def theirs(text):
    return list(can.CanutilsLogReader(io.StringIO(text)))


FRAMES = st.builds(
    lambda t, ident, ext, data, bus, form, rx, brs, esi: can.Message(
        timestamp=t / 1e6, arbitration_id=ident if ext else ident & 0x7FF, is_extended_id=ext,
        data=(data * (2 if len(data) in (6, 8) and form == "fd" else 1)) or None, channel=bus,
        is_fd=form == "fd", is_remote_frame=form == "remote", is_error_frame=form == "error",
        is_rx=rx, bitrate_switch=brs, error_state_indicator=esi,
    ),
    st.integers(0, 2 * 10**15), st.integers(0, (1 << 29) - 1), st.booleans(), st.binary(max_size=8),
    st.sampled_from([0, 3, "vcan0", "can1", "slcan9"]),
    st.sampled_from(["data"] * 3 + ["fd", "remote", "error"]), st.booleans(), st.booleans(),
    st.booleans(),
)  # fmt: skip


@settings(max_examples=60)
@given(messages=st.lists(FRAMES, min_size=1, max_size=30), bad=st.lists(st.sampled_from(BAD)))
def test_a_good_file_is_read_as_by_python_can_and_bad_lines_change_nothing(messages, bad):
    text = io.StringIO()
    writer = can.CanutilsLogWriter(text)
    for message in messages:
        writer.on_message_received(message)
    text = text.getvalue()
    wanted = theirs(text)
    assert_same(ours(text), wanted)
    lines = text.splitlines()
    for number, line in enumerate(bad):
        lines.insert(number * 7 % (len(lines) + 1), line)
    assert_same(ours("\n".join(lines)), wanted)


def test_lines_of_can_utils_are_read_with_all_their_digits_and_flags():
    text = "\n".join(GOOD)
    assert_same(ours(text), theirs(text))


def test_lines_that_python_can_cannot_read_are_read():
    lines = [
        " (1700000000.100000)  can0  123   [2]  0A 0B",
        "(1700000000.200000) can0 123#0A.0B",
        "(1700000000.300000) can0 123##A0102",
    ]
    found = ours("\n".join(lines))
    assert [bytes(message.data) for message in found] == [b"\x0a\x0b", b"\x0a\x0b", b"\x01\x02"]
    assert [message.timestamp for message in found] == [1_700_000_000 + n / 10 for n in (1, 2, 3)]


def test_can_utils_differences_are_summed():
    lines = [f" (000.00{n % 3}000)  can0  123   [1]  0{n % 8}" for n in range(9)]
    stamps = [round(message.timestamp, 6) for message in ours("\n".join(lines))]
    assert stamps == sorted(stamps)
    assert stamps[-1] == 0.009


@pytest.fixture
def log(tmp_path):
    path = tmp_path / "drive.candump"
    path.write_text("\n".join([*GOOD[:2], "what is this", *GOOD[2:], *BAD]) + "\n")
    return path


def test_log_reader_finds_the_plug_in_by_its_suffix(log, caplog):
    with can.LogReader(log, any_argument=1) as reader:
        assert isinstance(reader, CandumpReader)
        found = list(reader)
    assert_same(found, theirs("\n".join(GOOD)))
    assert reader.report.passed_over == 9
    (record,) = caplog.records
    assert record.levelno == logging.WARNING
    assert "skipped 9 lines (3, " in record.getMessage()
    packed = log.with_name("drive.candump.gz")
    packed.write_bytes(gzip.compress(log.read_bytes()))
    with can.LogReader(packed) as reader:
        assert_same(list(reader), found)


def test_python_can_keeps_its_own_reader_of_log(tmp_path):
    path = tmp_path / "a.log"
    path.write_text("\n".join(GOOD))
    with can.LogReader(path) as reader:
        assert type(reader) is can.CanutilsLogReader


def test_python_cans_player_plays_past_a_bad_line(log, monkeypatch):
    channel = "plugin-player"
    monkeypatch.setattr(sys, "argv", ["can_player", "-i", "virtual", "-c", channel,
                                      "--ignore-timestamps", str(log)])  # fmt: skip
    with can.Bus(interface="virtual", channel=channel) as bus:
        player = threading.Thread(target=can.player.main)
        player.start()
        found = [bus.recv(30) for _ in range(4)]
        player.join(30)
        assert bus.recv(0) is None
    wanted = [message for message in theirs("\n".join(GOOD)) if not message.is_error_frame]
    assert [m.arbitration_id for m in found] == [m.arbitration_id for m in wanted]
    assert [bytes(m.data) for m in found] == [bytes(m.data) for m in wanted]


def test_python_cans_converter_converts_past_a_bad_line(log, tmp_path, monkeypatch):
    out = tmp_path / "out.log"
    monkeypatch.setattr(sys, "argv", ["can_logconvert", str(log), str(out)])
    can.logconvert.main()
    found, wanted = theirs(out.read_text()), theirs("\n".join(GOOD))
    assert [m.arbitration_id for m in found] == [m.arbitration_id for m in wanted]
