"""Bus loggings in MDF 4 as blocks: the frames of python-can's reader, in many layouts."""

import gc
import gzip
import re
import struct
import sys
import threading
import tracemalloc
from contextlib import closing
from datetime import UTC, datetime

import can
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from adhesion_can.bus.block import Block, Kind
from adhesion_can.errors import RecordingError
from adhesion_can.extras import install_extra
from adhesion_can.recordings import recording as recordings
from adhesion_can.recordings.candump import ReadReport
from adhesion_can.recordings.recording import Recording

asammdf = pytest.importorskip("asammdf")
mf4_source = pytest.importorskip("adhesion_can.recordings.mf4")

START = 1_700_000_000
COLUMNS = ("t_ns", "key", "kind", "length", "channel", "words")
# A file that asammdf gives up half-way leaves an object whose end complains.
GIVEN_UP = pytest.mark.filterwarnings(
    "ignore::ResourceWarning", "ignore::pytest.PytestUnraisableExceptionWarning"
)


@pytest.fixture
def collected():
    """What is given up goes in the test that gave it up."""
    yield
    gc.collect()


def framewise(path):
    """Blocks' oracle: python-can's frames, their report, and the error that ends them."""
    recording, blocks, error = Recording(path), [], None
    try:
        blocks.extend(recording.python_can_blocks())
    except RecordingError as stopped:
        error = str(stopped)
    return joined(blocks), recording.report, error


def assert_equal(found, wanted):
    assert found.channels == wanted.channels
    for name in COLUMNS:
        a, b = getattr(found, name), getattr(wanted, name)
        assert a.dtype == b.dtype
        np.testing.assert_array_equal(a, b, err_msg=name)


def joined(blocks):
    return Block.concatenate(blocks) if blocks else Block.from_frames([])


def direct(path, size=50_000):
    """Blocks without the help of python-can's reader, and their report."""
    report = ReadReport()
    with closing(mf4_source.open_mf4(path)) as mdf:
        given = list(mf4_source.mf4_blocks(mdf, report, size))
    shares = [share for _, share in given]
    assert shares == sorted(shares)
    assert not shares or shares[-1] == 1
    return [block for block, _ in given], report


def assert_direct(path, size=50_000):
    """The direct way gives what the frames give."""
    blocks, report = direct(path, size)
    wanted, counted, error = framewise(path)
    assert error is None
    assert_equal(joined(blocks), wanted)
    assert report == counted
    for block in blocks:
        assert block.words.shape[1] == (1 if block.length.max() <= 8 else 8)
    return blocks


def assert_same_route(path, note=None):
    """Whatever the file: the blocks of a recording are its frames, with the same end."""
    recording, blocks, error = Recording(path), [], None
    notes = [] if note is None else [f"read frame by frame: {note}"]
    try:
        blocks.extend(recording.blocks())
    except RecordingError as stopped:
        error = str(stopped)
    wanted, counted, raised = framewise(path)
    assert_equal(joined(blocks), wanted)
    assert recording.report.notes == notes
    recording.report.notes.clear()
    assert (recording.report, error) == (counted, raised)
    return len(wanted), error


# --- files of python-can's writer ----------------------------------------------------------------


def message(number, **changes):
    fields = {
        "timestamp": START + number * 0.000_123_457,
        "arbitration_id": 0x100 + number,
        "data": bytes([number % 256] * 8),
        "is_extended_id": False,
        "channel": number % 2,
    }
    return can.Message(**{**fields, **changes})


def all_kinds():
    for n in range(0, 240, 8):
        yield message(n)
        yield message(n + 1, is_extended_id=True, arbitration_id=0x18FEF100 + n)
        yield message(n + 2, data=bytes(range(n % 9)), channel=n % 5)
        yield message(n + 3, is_fd=True, data=bytes(range(64 if n < 120 else 12)))
        yield message(n + 4, is_remote_frame=True, data=None, dlc=n % 9)
        yield message(n + 5, is_error_frame=True, data=b"\1" * 8)
        yield message(n + 6, is_fd=True, data=b"", is_extended_id=True)
        yield message(n + 6, data=b"\xff", channel=None)  # at the same time


def written(path, messages, level=2):
    # The writer moves stamps from before its own start to it.
    shift = datetime.now(UTC).timestamp() + 60 - START
    with can.Logger(path, compression_level=level) as log:
        for item in messages:
            item.timestamp += shift
            log(item)
    return path


@pytest.mark.parametrize("level", [0, 1, 2])
@pytest.mark.parametrize("size", [1, 7, 100, 50_000])
def test_python_cans_own_files(tmp_path, level, size):
    path = written(tmp_path / "a.mf4", all_kinds(), level)
    blocks = assert_direct(path, size)
    assert {kind for block in blocks for kind in block.kind} == set(range(4))
    assert blocks[-1].channels == ("can0", "can1", "can3", "can4", "can2")
    assert_same_route(path)


def test_a_packed_file_is_read_frame_by_frame(tmp_path):
    path = tmp_path / "a.mf4.gz"
    path.write_bytes(gzip.compress(written(tmp_path / "a.mf4", all_kinds()).read_bytes()))
    assert assert_same_route(path) == (240, None)


def test_blocks_have_about_the_rows_that_were_asked_for(tmp_path):
    path = logged(tmp_path / "a.mf4", *(group(3000, seed=seed, bus=seed) for seed in range(10)))
    blocks = assert_direct(path, 4000)
    assert all(2000 <= len(block) <= 12_000 for block in blocks[:-1])


# --- files of other loggers ----------------------------------------------------------------------

FIELDS = {
    "BusChannel": "<u1",
    "ID": "<u4",
    "IDE": "<u1",
    "DLC": "<u1",
    "DataLength": "<u1",
    "DataBytes": "(8,)u1",
    "Dir": "<u1",
    "EDL": "<u1",
}


def group(count, *, name="CAN_DataFrame", seed=1, bus=1, stamps=None, **fields):
    """A group of records: its name, stamps and structure; fields of type None are left out."""
    rng = np.random.default_rng(seed)
    types = {k: t for k, t in {**FIELDS, **fields}.items() if t is not None}
    samples = np.zeros(count, [(f"{name}.{k}", t) for k, t in types.items()])
    limits = {"IDE": 2, "EDL": 2, "DLC": 9, "DataLength": 9, "ID": 1 << 11, "Dir": 2}
    for key in types:
        column = samples[f"{name}.{key}"]
        if column.dtype.kind == "S":
            column[:] = rng.choice([b"Rx", b"Tx"], count)
        else:
            column[...] = rng.integers(0, limits.get(key, 256), column.shape)
    if "BusChannel" in types:
        samples[f"{name}.BusChannel"] = bus
    if stamps is None:
        stamps = np.cumsum(rng.integers(0, 3000, count)) / 1e6
    return name, np.asarray(stamps, float), samples


def logged(path, *groups, start=START, bus_type=asammdf.Source.BUS_TYPE_CAN):
    source = asammdf.Source("bus", "bus", "", asammdf.Source.SOURCE_BUS, bus_type)
    with asammdf.MDF(version="4.10") as mdf:
        mdf.header.start_time = datetime.fromtimestamp(start, UTC)
        for name, stamps, samples in groups:
            signal = asammdf.Signal(samples, stamps, name=name, source=source)
            mdf.append(signal, common_timebase=True)
        mdf.save(path, overwrite=True)
    return path


def flagged(part):
    part[2]["CAN_DataFrame.ID"] |= 0xE000_0000
    return part


LAYOUTS = {
    "eight bytes": [group(300)],
    "sixty-four bytes": [group(300, DataBytes="(64,)u1")],
    "few bytes": [group(300, DataBytes="(3,)u1")],
    "no bus": [group(300, BusChannel=None)],
    "no EDL": [group(300, EDL=None)],
    "wide id, whose upper bits are flags": [flagged(group(300))],
    "big-endian id": [group(300, ID=">u4")],
    "direction as text": [group(300, Dir="S2")],
    "a group a bus": [group(300, seed=n, bus=n) for n in (3, 1, 2)],
    "errors first": [group(9, name="CAN_ErrorFrame"), group(300)],
    "errors without a text": [
        group(9, name="CAN_ErrorFrame", ID=None, IDE=None, DataLength=None, DataBytes=None),
        group(300),
    ],
    "remote only": [group(30, name="CAN_RemoteFrame", DataLength=None, DataBytes=None)],
    "late remote": [group(300), group(3, name="CAN_RemoteFrame", stamps=[9, 9.5, 10])],
    "an empty group": [group(0), group(20), group(0, name="CAN_ErrorFrame")],
    "no frame": [group(0)],
    "one frame": [group(1)],
    "one stamp": [group(30, seed=n, stamps=np.full(30, 0.5)) for n in (1, 2)],
    "stamps backwards": [group(4, stamps=[3, 1, 2, 5]), group(3, seed=2, stamps=[2, 4, 1])],
    "halves of µs": [group(9, stamps=np.arange(9) * 0.5e-6)],
    "another structure": [group(9, name="CAN_OverloadFrame"), group(3)],
}


@pytest.mark.parametrize("start", [0, START, START + 0.123_457])
@pytest.mark.parametrize("layout", LAYOUTS)
def test_layouts_of_other_loggers(tmp_path, layout, start):
    path = logged(tmp_path / "a.mf4", *LAYOUTS[layout], start=start)
    for size in (3, 100, 50_000):
        assert_direct(path, size)


STRANGE = {
    "CAN_DataFrame.BusChannel is of type uint16": [group(30, BusChannel="<u2", bus=1000)],
    "CAN_DataFrame.DataLength is of type float64": [group(30, DataLength="<f8")],
    "CAN_DataFrame.ID is of type int32": [group(30, ID="<i4")],
    "CAN_DataFrame.Dir is of type float32": [group(30, Dir="<f4")],
    "CAN_DataFrame.DataBytes is of type uint8": [group(30, DataBytes="u1")],
    "CAN_DataFrame lacks DataLength": [group(30), group(30, DataLength=None, bus=2)],
    "CAN_RemoteFrame lacks DLC": [group(9), group(9, name="CAN_RemoteFrame", DLC=None)],
    "stamps that are not times": [group(1200, stamps=[*np.arange(1199) / 1e3, np.nan])],
}


@pytest.mark.parametrize("note", STRANGE)
def test_strange_layouts_go_to_python_cans_reader(tmp_path, note):
    path = logged(tmp_path / "a.mf4", *STRANGE[note])
    with pytest.raises(mf4_source.NotInColumnsError, match=note):
        direct(path)
    assert_same_route(path, note)


@pytest.mark.parametrize("bus_type", [asammdf.Source.BUS_TYPE_LIN, asammdf.Source.BUS_TYPE_NONE])
def test_other_buses_are_passed_over(tmp_path, bus_type):
    path = logged(tmp_path / "a.mf4", group(30), bus_type=bus_type)
    assert direct(path) == ([], ReadReport())
    assert assert_same_route(path) == (0, None)


def with_ids(part, flag):
    """A group whose odd rows have an id of 29 bits, marked by the highest bit or not."""
    part[2]["CAN_DataFrame.ID"] |= np.where(
        np.arange(len(part[2])) % 2, 0x18FE_0000 | flag, 0
    ).astype("u4")
    return part


@pytest.mark.parametrize("flag", [0, 1 << 31], ids=["by its size", "by the highest bit"])
def test_without_the_channel_ide_the_id_says_how_long_it_is(tmp_path, flag):
    path = logged(tmp_path / "a.mf4", with_ids(group(300, IDE=None), flag))
    blocks, _ = direct(path)
    found = joined(blocks)
    ids = found.key & 0x1FFF_FFFF
    assert ((ids > 0x7FF) == np.arange(300) % 2).all()
    assert ((found.key >> 31) == np.arange(300) % 2).all()
    assert_equal(Block.from_frames(Recording(path)), found)


def test_a_short_id_with_the_highest_bit_is_an_extended_one(tmp_path):
    path = logged(tmp_path / "a.mf4", flagged(group(9, IDE=None)))
    blocks, _ = direct(path)
    assert (joined(blocks).key >> 31 == 1).all()


def test_decoded_signals_are_named(tmp_path):
    with asammdf.MDF() as mdf:
        for name in ("speed", "force", "load", "slope", "rain"):
            mdf.append(asammdf.Signal(np.arange(9.0), np.arange(9.0), name=name))
        mdf.save(tmp_path / "a.mf4")
    with pytest.raises(
        RecordingError, match=r"decoded signals \(speed, force, load, slope, \.\.\)"
    ):
        list(Recording(tmp_path / "a.mf4").blocks())


def test_mdf_3_is_refused_with_its_version(tmp_path):
    with asammdf.MDF(version="3.30") as mdf:
        mdf.append(asammdf.Signal(np.arange(9.0), np.arange(9.0), name="speed"))
        path = mdf.save(tmp_path / "a.mdf")
    for name in ("a.mf4", "a.dat"):
        with pytest.raises(RecordingError, match=r"of version 3\.30; save it as version 4\.10"):
            Recording(path.rename(tmp_path / name))
        path = tmp_path / name


NAMES = st.sampled_from(["CAN_DataFrame", "CAN_ErrorFrame", "CAN_RemoteFrame"])
STAMPS = st.lists(st.integers(0, 12), max_size=12)


@settings(max_examples=60, deadline=None)
@given(
    groups=st.lists(st.tuples(NAMES, STAMPS, st.integers(0, 4)), min_size=1, max_size=4),
    fd=st.booleans(),
    sorted_=st.booleans(),
    size=st.integers(1, 30),
)
def test_any_merge_of_groups(tmp_path_factory, groups, fd, sorted_, size):
    path = tmp_path_factory.mktemp("any") / "a.mf4"
    parts = []
    for seed, (name, ticks, bus) in enumerate(groups):
        stamps = np.array(sorted(ticks) if sorted_ else ticks, float) * 0.1
        width = "(64,)u1" if fd else "(8,)u1"
        parts.append(
            group(len(stamps), name=name, seed=seed, bus=bus, stamps=stamps, DataBytes=width)
        )
    assert_direct(logged(path, *parts), size)


# --- a file written by hand ----------------------------------------------------------------------


class ByHand:
    """Blocks of an MDF 4 file, one behind the other."""

    def __init__(self, version=b"4.10"):
        number = int(version.replace(b".", b""))
        self.bytes = bytearray(
            struct.pack("<8s8s8s4xH34x", b"MDF     ", version.ljust(8), b"by hand ", number)
        )
        self.head = self.add(b"HD", [0] * 6, struct.pack("<Qhh4x16x", START * 10**9, 0, 0))

    def add(self, tag, links, data):
        self.bytes += b"\0" * (-len(self.bytes) % 8)
        address = len(self.bytes)
        size = 24 + 8 * len(links) + len(data)
        self.bytes += struct.pack("<2s2s4xQQ", b"##", tag, size, len(links))
        self.bytes += struct.pack(f"<{len(links)}Q", *links) + data
        return address

    def link(self, block, place, address):
        struct.pack_into("<Q", self.bytes, block + 24 + 8 * place, address)

    def text(self, text):
        return self.add(b"TX", [], text.encode() + b"\0")

    def channel(self, name, kind, start, bits, *, follows=0, inner=0, rule=0, form=0, sync=0):
        """A channel: its bits from a start in the record, and what stands behind or in it."""
        links = [follows, inner, self.text(name), 0, rule, 0, 0, 0]
        offset, bit = divmod(start, 8)
        data = struct.pack("<BBBBIIII4x48x", kind, sync, form, bit, offset, bits, 0, 0)
        return self.add(b"CN", links, data)

    def records(self, number, count, size, flags, *, channels=0, source=0, follows=0):
        data = struct.pack("<QQHH4xII", number, count, flags, 0, size, 0)
        return self.add(b"CG", [follows, channels, 0, source, 0, 0], data)

    def group(self, records, data, id_size=0):
        block = self.add(b"DG", [0, records, data, 0], struct.pack("<B7x", id_size))
        self.link(self.head, 0, block)


def unsorted_logging(path, count, *, claimed=None):
    """Bits packed close, payloads of any length in a group of their own, records as they came."""
    file = ByHand()
    source = file.add(b"SI", [0, 0, 0], struct.pack("<BBB5x", 2, 2, 0))
    nanoseconds = struct.pack("<BBHHHdddd", 1, 0, 0, 0, 2, 0.0, 0.0, 0.0, 1e-9)
    rule = file.add(b"CC", [0] * 4, nanoseconds)
    fields = [("ID", 64, 29), ("IDE", 93, 1), ("EDL", 94, 1), ("BusChannel", 96, 4)]
    inner = data_bytes = file.channel("CAN_DataFrame.DataBytes", 1, 112, 64, form=10)
    for name, start, bits in [*fields, ("DataLength", 100, 7)]:
        inner = file.channel(f"CAN_DataFrame.{name}", 0, start, bits, follows=inner)
    frame = file.channel("CAN_DataFrame", 0, 64, 112, inner=inner, form=10)
    master = file.channel("t", 2, 0, 64, follows=frame, rule=rule, sync=1)
    rng, rows, offset = np.random.default_rng(5), b"", 0
    for n in range(count):
        payload = rng.bytes(int(rng.choice([0, 3, 8, 8, 8, 12, 64 if n > count // 2 else 5])))
        flags = 0x123 + n % 50 | n % 2 << 29 | (len(payload) > 8) << 30
        word = n % 3 | len(payload) << 4
        rows += struct.pack("<BQIHQ", 1, n * 1_000_500, flags, word, offset)
        rows += struct.pack("<BI", 2, len(payload)) + payload
        offset += 4 + len(payload)
    payloads = file.records(2, count, offset, 1)
    file.link(data_bytes, 5, payloads)
    claimed = count if claimed is None else claimed
    frames = file.records(1, claimed, 22, 6, channels=master, source=source, follows=payloads)
    file.group(frames, file.add(b"DT", [], rows), id_size=1)
    path.write_bytes(file.bytes)
    return path


@pytest.mark.parametrize("size", [10, 1000, 50_000])
def test_an_unsorted_file_with_payloads_apart(tmp_path, size):
    blocks = assert_direct(unsorted_logging(tmp_path / "a.mf4", 2500), size)
    rows = joined(blocks)
    assert len(rows) == 2500
    assert set(rows.kind) == {Kind.DATA, Kind.FD}
    assert rows.channels == ("can0", "can1", "can2")
    assert set(rows.length) == {0, 3, 5, 8, 12, 64}
    assert (rows.t_us - START * 1_000_000)[:3].tolist() == [0, 1000, 2001]


# --- faults --------------------------------------------------------------------------------------


def test_records_that_are_marked_as_invalid_are_reported(tmp_path):
    name, stamps, samples = group(2500)
    source = asammdf.Source("", "", "", asammdf.Source.SOURCE_BUS, asammdf.Source.BUS_TYPE_CAN)
    bad = np.arange(2500) % 7 == 3
    with asammdf.MDF(version="4.10") as mdf:
        mdf.append(asammdf.Signal(samples, stamps, name=name, source=source, invalidation_bits=bad))
        mdf.save(tmp_path / "a.mf4")
    count, error = assert_same_route(
        tmp_path / "a.mf4", "some records are missing, or marked as invalid"
    )
    assert (count, error) == (np.count_nonzero(~bad), None)


@pytest.mark.parametrize("claimed", [2501, 2999, 3000, 3001, 9000])
def test_records_that_are_not_there_are_reported(tmp_path, claimed):
    path = unsorted_logging(tmp_path / "a.mf4", 2500, claimed=claimed)
    count, error = assert_same_route(path, "some records are missing, or marked as invalid")
    # python-can's reader asks for a thousand at a time, and stops where there are none.
    assert count == 2500
    assert (error is None) == (claimed <= 3000)


@pytest.fixture
def copied(monkeypatch):
    """The reader is a copy of this process, with what a test replaces in it.

    Other tests may have left threads, with which a new process would read.
    """
    monkeypatch.setattr(threading, "active_count", lambda: 1)


@pytest.mark.usefixtures("copied")
@pytest.mark.parametrize("reads", [0, 1, 2, 5])
def test_what_is_left_is_read_frame_by_frame(tmp_path, monkeypatch, reads):
    read, done = mf4_source._Group.read, []

    def failing(self, count):
        if len(done) == reads:
            raise mf4_source.NotInColumnsError("so it is")
        done.append(count)
        return read(self, count)

    monkeypatch.setattr(recordings, "_ROWS", 100)
    monkeypatch.setattr(mf4_source._Group, "read", failing)
    path = logged(tmp_path / "a.mf4", *LAYOUTS["stamps backwards"], *LAYOUTS["a group a bus"])
    assert assert_same_route(path, "so it is") == (907, None)


@pytest.mark.usefixtures("copied")
@pytest.mark.parametrize("rows", [300, 1000, 1500, 50_000])
def test_damage_ends_both_ways_alike(tmp_path, monkeypatch, rows):
    path = logged(tmp_path / "a.mf4", group(5000))
    get = asammdf.MDF.get

    def failing(self, *args, record_offset, record_count, **others):
        if record_offset + record_count > 3000:
            raise struct.error("bad luck")
        return get(self, *args, record_offset=record_offset, record_count=record_count, **others)

    monkeypatch.setattr(asammdf.MDF, "get", failing)
    monkeypatch.setattr(recordings, "_ROWS", rows)
    count, error = assert_same_route(path, "bad luck")
    assert count == 3000
    assert "a.mf4: python-can stops after 3000 frames (bad luck)" in error


@GIVEN_UP
@pytest.mark.usefixtures("collected")
@pytest.mark.parametrize("part", np.linspace(0.001, 0.999, 12))
@pytest.mark.parametrize("kind", ["sorted", "unsorted"])
def test_a_truncated_file_is_one_error(tmp_path, kind, part):
    path = tmp_path / "a.mf4"
    whole = logged(path, group(900)) if kind == "sorted" else unsorted_logging(path, 900)
    path.write_bytes(whole.read_bytes()[: int(part * whole.stat().st_size)])
    with pytest.raises(RecordingError) as error:
        list(Recording(path).blocks())
    assert str(error.value).startswith(f"{path}: python-can stops after 0 frames (")
    assert "\n" not in str(error.value)
    assert_same_route(path)


@GIVEN_UP
@pytest.mark.usefixtures("collected")
@pytest.mark.parametrize(
    "content", [b"", b"MDF ", b"MDF     4.10    " + bytes(300), b"no recording\n" * 40]
)
def test_a_foreign_file_is_one_error(tmp_path, content):
    path = tmp_path / "a.mf4"
    path.write_bytes(content)
    count, error = assert_same_route(path)
    assert count == 0
    assert error.startswith(f"{path}: ")


@pytest.mark.usefixtures("copied")
def test_without_asammdf_the_extra_is_named(tmp_path, monkeypatch):
    path = logged(tmp_path / "a.mf4", group(3))
    monkeypatch.setitem(sys.modules, "asammdf", None)
    with pytest.raises(RecordingError, match=re.escape(f"needs asammdf; {install_extra('mf4')}")):
        list(Recording(path).blocks())


@pytest.mark.usefixtures("copied")
def test_the_position_follows_the_rows(tmp_path, monkeypatch):
    monkeypatch.setattr(recordings, "_ROWS", 100)
    recording = Recording(logged(tmp_path / "a.mf4", group(1000), group(500, seed=2)))
    seen = [recording.position / recording.size for _ in recording.blocks()]
    assert len(seen) >= 8
    assert seen == sorted(set(seen))
    assert 0 < seen[0] < 0.2
    assert recording.position == recording.size


# --- speed and memory ----------------------------------------------------------------------------


@pytest.mark.slow
def test_memory_does_not_grow_with_the_file(tmp_path):
    peaks = []
    for count in (500_000, 4_000_000):  # asammdf reads 4 MiB at a time
        parts = (group(count // 2, seed=seed, bus=seed) for seed in (1, 2))
        recording = Recording(logged(tmp_path / f"{count}.mf4", *parts))
        gc.collect()
        tracemalloc.start()
        assert sum(len(block) for block in recording.blocks()) == count
        peaks.append(tracemalloc.get_traced_memory()[1])
        tracemalloc.stop()
        assert recording.report.kinds.total() == count
        assert recording.report.notes == []
    assert peaks[1] < 1.3 * peaks[0]
    assert peaks[1] < 32 << 20
