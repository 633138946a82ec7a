"""Traces of other tools (.blf, .asc, .trc) by columns, beside python-can's readers."""

import io
import struct
import zlib
from functools import partial

import can

from adhesion_can.bus.block import Block
from adhesion_can.bus.frame import MAX_PAYLOAD
from adhesion_can.recordings.python_can_messages import from_message
from adhesion_can.recordings.recording import Recording
from adhesion_can.recordings.text_columns import parse as columns
from tests.fuzz.octets import Octets
from tests.fuzz.rule import file_of, value_or_refusal

_FEW = columns._FEW
_MOST = 2000  # frames of python-can's reader, which can go round for ever
_REFUSALS = (ValueError, KeyError, IndexError, OverflowError, ArithmeticError, struct.error,
             zlib.error, TypeError, can.io.blf.BLFParseError)  # fmt: skip


def blf(data):
    """A .blf file; the first byte gives the number of bytes of objects that are parsed at once."""
    choices = Octets(data)
    size = 1 + 16 * choices.below(256)
    content = choices.rest()
    found, report = _read(file_of("a.blf", content), size)
    if found is None or report.notes:
        return  # of damage python-can makes other things, or goes round for ever
    _compare(found, partial(can.BLFReader, io.BytesIO(content)), 0)


def asc(data):
    """An .asc file; by the first byte few lines are read in columns too."""
    _trace(data, ".asc", can.ASCReader, 0)


def trc(data):
    """A .trc file; by the first byte few lines are read in columns too."""
    _trace(data, ".trc", can.TRCReader, 1)


def _trace(data, suffix, reader, first_bus):
    choices = Octets(data)
    is_eager = choices.below(2)
    content = choices.rest().removeprefix(b"\xef\xbb\xbf")
    if content.startswith((b"\x1f\x8b", b"\x28\xb5\x2f\xfd")):
        return  # packings have tests of their own
    columns._FEW = 1 if is_eager else _FEW
    try:
        found, report = _read(file_of(f"a{suffix}", content), 1 << 20)
    finally:
        columns._FEW = _FEW
    if found is None or report.passed_over or "relative" in content.decode("latin-1").lower():
        return
    try:
        text = content.decode()
    except UnicodeDecodeError:
        return
    if all(not line.strip() or line.lstrip().startswith(";") for line in text.splitlines()):
        return  # python-can takes the last line of a head that nothing follows for a frame
    # Where 'internal events logged' does not end a head, python-can's .asc reader drops a line.
    make = partial(reader, io.StringIO(text, newline=None))
    _compare(found, make, first_bus, reader_loses_a_line=suffix == ".asc")


def _read(path, size):
    """Frames of a file, and its report; None where it is refused."""
    recording = value_or_refusal(Recording, path)
    if recording is None:
        return None, None
    blocks = value_or_refusal(list, recording.blocks(size))
    if blocks is None:
        return None, recording.report
    found = [item for block in blocks for item in block.items()]
    assert sum(recording.report.kinds[k] for k in ("frame", "fd", "remote", "error")) == len(found)
    assert all(len(frame.data) <= MAX_PAYLOAD for frame in found)
    if blocks:
        assert list(Block.concatenate(blocks).items()) == found
    return found, recording.report


def _compare(found, make_reader, first_bus, *, reader_loses_a_line=False):
    """The same frames; python-can counts seconds in a float."""
    wanted = []
    try:
        for message in make_reader():
            message.channel = (message.channel or 0) - first_bus
            wanted.append(from_message(message))
            assert len(wanted) <= _MOST
    except _REFUSALS:
        return
    wanted = list(Block.from_frames(wanted).items())
    if reader_loses_a_line and len(found) == len(wanted) + 1:
        found = found[1:]
    assert len(found) == len(wanted)
    for ours, theirs in zip(found, wanted, strict=True):
        assert ours._replace(t_us=0) == theirs._replace(t_us=0)
        assert abs(ours.t_us - theirs.t_us) <= 1 + abs(ours.t_us) * 2.0**-51
