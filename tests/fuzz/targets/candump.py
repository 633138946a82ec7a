"""candump text: single lines beside python-can, and whole texts by columns beside line by line."""

import io

import can

from adhesion_can.bus.frame import MARKS, Frame, Mark
from adhesion_can.recordings.candump import (
    FD_LENGTHS,
    LAST_US,
    format_frame,
    format_mark,
    read_line,
    stamp_ns,
)
from adhesion_can.recordings.python_can_messages import from_message
from adhesion_can.recordings.recording import Recording
from adhesion_can.recordings.text_columns import parse
from tests.fuzz.octets import Octets
from tests.fuzz.rule import file_of, value_or_refusal

_OTHERS = {"blank", "comment", "malformed", "untimed"}
_FEW = parse._FEW


def candump_line(data):
    """One line: a valid frame or mark that our writer writes alike, or a known kind of line."""
    item = read_line(data)
    if isinstance(item, str):
        assert item in _OTHERS
        return
    assert abs(item.t_us) <= LAST_US
    assert abs(stamp_ns(data, item.t_us) - 1000 * item.t_us) <= 500
    if isinstance(item, Mark):
        assert item.name in MARKS
        assert read_line(format_mark(item).encode()) == item
        return
    assert 0 <= item.arbitration_id < (1 << 29 if item.is_extended or item.is_error else 1 << 11)
    assert len(item.data) in FD_LENGTHS if item.is_fd else len(item.data) <= 8
    assert item.channel
    if item.t_us >= 0:
        assert read_line(format_frame(item).encode("latin-1")) == item
    theirs = _by_python_can(data)
    if theirs is not None and not (item.is_error or theirs.is_error):
        _require_alike(item, theirs)


def _by_python_can(line):
    """The frame that python-can reads in a line; None where it refuses the line."""
    if not line.isascii() or any(0x1C <= octet < 0x20 for octet in line):
        return None  # other characters are white space to it
    try:
        messages = list(can.CanutilsLogReader(io.StringIO(line.decode("ascii"))))
        return from_message(messages[0]) if len(messages) == 1 else None
    except (ValueError, IndexError, OverflowError):
        return None


def _require_alike(ours: Frame, theirs: Frame):
    """The same frame; python-can counts seconds in a float and calls bus 0 'can0'."""
    assert abs(ours.t_us - theirs.t_us) <= 1 + abs(ours.t_us) * 2.0**-51
    assert ours._replace(t_us=0, channel="") == theirs._replace(t_us=0, channel="")


def candump_text(data):
    """A file, packed or not: the same frames, marks and report by columns and line by line.

    The first byte gives the length of the pieces that are read at once, and whether few lines are
    read in columns too.
    """
    choices = Octets(data)
    size, is_eager = 1 + 8 * choices.below(128), choices.below(2)
    path = file_of("a.log", choices.rest())
    lines = value_or_refusal(Recording, path)
    columns = value_or_refusal(Recording, path)
    assert (lines is None) == (columns is None)
    if lines is None:
        return
    parse._FEW = 1 if is_eager else _FEW
    try:
        wanted = value_or_refusal(list, lines)
        blocks = value_or_refusal(list, columns.blocks(size))
    finally:
        parse._FEW = _FEW
    assert (wanted is None) == (blocks is None)
    if wanted is None:
        return
    assert [item for block in blocks for item in block.items()] == wanted
    assert columns.report == lines.report
