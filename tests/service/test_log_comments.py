"""Comments in the service's log, and the readers of others that must not stumble over them."""

import io
import shutil
import subprocess

import pytest
from can.io.canutils import CanutilsLogReader
from hypothesis import given
from hypothesis import strategies as st

from adhesion_can.recordings.candump import read_line
from adhesion_can.service.log_comments import (
    LONGEST_LINE,
    format_comment,
    format_stamp,
    read_comments,
    stamp_of,
)

FRAME = "({}.000000) can0 123#0{}\n"
OF_CAN_UTILS = 398
"""Longest line with its end, bytes, that log2asc and canplayer of can-utils 2020.11 take."""
WORDS = st.text(min_size=1, max_size=1000).filter(lambda text: text.strip() != "")


@given(st.integers(0, 10**15), WORDS)
def test_any_text_is_an_empty_frame_to_python_can_and_nothing_to_the_others(t_us, text):
    comment = format_comment(format_stamp(t_us), "learn", text)
    for line in comment.splitlines(keepends=True):
        assert len(line.encode()) <= LONGEST_LINE <= OF_CAN_UTILS
        assert line[0] != "("
        assert read_line(line.encode()) == "comment"
    log = FRAME.format(1, 1) + comment + FRAME.format(2, 2)
    first, *between, last = CanutilsLogReader(io.StringIO(log))
    assert (first.data, last.data) == (b"\x01", b"\x02")
    assert all(m.dlc == m.arbitration_id == 0 for m in between)
    assert all(m.timestamp == pytest.approx(t_us / 1e6) for m in between)


def test_a_comment_without_the_empty_frame_would_be_noticed():
    with pytest.raises(ValueError, match="unpack"):
        list(CanutilsLogReader(io.StringIO("# learn: speed low\n")))


@pytest.mark.skipif(not shutil.which("log2asc"), reason="can-utils is not installed")
def test_log2asc_passes_over_a_long_comment(tmp_path):
    path = tmp_path / "a.log"
    comment = format_comment("1.000000", "learn", "a" * 5000)
    path.write_text(FRAME.format(1, 1) + comment + FRAME.format(2, 2))
    done = subprocess.run(
        ["log2asc", "-I", str(path), "can0"], capture_output=True, text=True, check=True, timeout=20
    )
    assert done.stdout.count("123") == 2
    assert "too long" not in done.stderr


@given(st.integers(0, 10**15), st.text("AZaz09+/=", min_size=1, max_size=2000))
def test_a_comment_is_read_as_it_was_written(t_us, text):
    lines = format_comment(format_stamp(t_us), "some-kind", text).encode().splitlines()
    others = format_comment(format_stamp(t_us), "other", "x" * 500).encode().splitlines()
    assert list(read_comments([*others, *lines, b"# free", *others], "some-kind")) == [
        (t_us, text.encode())
    ]


@pytest.mark.parametrize("missing", [0, 1])
def test_a_comment_whose_lines_are_not_all_there_is_damaged_or_shorter(missing):
    lines = format_comment("1.000000", "kind", "x" * 1000).encode().splitlines()
    assert len(lines) == 3
    del lines[missing]
    if missing == 0:
        with pytest.raises(ValueError, match="start is missing"):
            list(read_comments(lines, "kind"))
    else:
        ((_, text),) = read_comments(lines, "kind")
        assert len(text) < 1000


@pytest.mark.parametrize("line", ["(1.500000) can0 123#00\n", "<1.500000> advance 000#\n"])
def test_a_line_of_the_log_has_a_stamp(line):
    assert stamp_of(line) == "1.500000"
