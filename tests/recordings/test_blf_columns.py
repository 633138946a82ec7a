"""Vector's binary logs in columns: beside python-can's reader, and what it does not say."""

import gzip
import io
import itertools
import random
import struct
from datetime import UTC, datetime

import can
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from adhesion_can.bus.block import Block, Kind
from adhesion_can.errors import RecordingError
from adhesion_can.recordings.python_can_messages import from_message
from adhesion_can.recordings.recording import Recording
from tests.recordings import wire_blf as wire

START_NS = 1000 * round(datetime(2023, 11, 14, 22, 13, 20, 123_000, UTC).timestamp() * 1e6)
FLOAT_US = 1  # python-can's seconds in a float are 0.24 us apart, which may round the other way


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("blf")


def by_python_can(content):
    """Its frames, as far as a block tells them apart: it knows no remote frame of CAN FD."""
    frames = map(from_message, can.BLFReader(io.BytesIO(content)))
    return list(Block.from_frames(frames).items())


def read(folder, content, size=4 << 20, name="a.blf"):
    path = folder / name
    path.write_bytes(content)
    recording = Recording(path)
    blocks = list(recording.blocks(size))
    return blocks, recording.report


def items(blocks):
    return [item for block in blocks for item in block.items()]


def assert_alike(found, wanted):
    assert [f._replace(t_us=0) for f in found] == [f._replace(t_us=0) for f in wanted]
    for a, b in zip(found, wanted, strict=True):
        assert abs(a.t_us - b.t_us) <= FLOAT_US


IDS = st.integers(0, (1 << 29) - 1).flatmap(lambda n: st.sampled_from([n | 1 << 31, n & 0x7FF, n]))
CHANNELS = st.integers(0, 9)
STAMPS = st.fixed_dictionaries(
    {
        "stamp": st.one_of(st.integers(0, 10**13), st.integers(0, 10**6)),
        "unit": st.sampled_from([1, 2, 0]),
        "version": st.sampled_from([1, 2]),
    }
)
OBJECTS = st.one_of(
    st.builds(
        lambda i, d, c, f, k, dlc, m: wire.classic(i, d, c, f, dlc, k, **m),
        IDS, st.binary(max_size=8), CHANNELS, st.sampled_from([0, 1, 0x80, 0x81]),
        st.sampled_from([1, 86]), st.one_of(st.none(), st.integers(0, 255)), STAMPS,
    ),
    st.builds(
        lambda i, d, c, f, g, v, m: wire.fd(i, d, c, f, g, v, **m),
        IDS, st.binary(max_size=64), CHANNELS, st.sampled_from([0, 1, 0x80]), st.integers(0, 7),
        st.one_of(st.none(), st.integers(0, 255)), STAMPS,
    ),
    st.builds(
        lambda i, d, c, f, v, t, m: wire.fd64(
            i, d, c, f, v, (40 if m["version"] == 2 else 32) + 40 + len(d) if t else 0, t, **m
        ),
        IDS, st.binary(max_size=64), CHANNELS, st.sampled_from([0x1000, 0x7000, 0, 0x10, 0x1010]),
        st.one_of(st.none(), st.integers(0, 64)), st.sampled_from([b"", bytes(8)]), STAMPS,
    ),
    st.builds(lambda i, c, m: wire.error(i, c, **m), IDS, CHANNELS, STAMPS),
    # Other things: statistics, markers whose text looks like an object, and large ones.
    st.builds(
        lambda k, b, m: wire.obj(k, b, **m),
        st.sampled_from([4, 65, 96, 115, 9999]),
        st.one_of(st.binary(max_size=60), st.just(b"LOBJ" * 9), st.just(70_000).map(bytes)),
        STAMPS,
    ),
)  # fmt: skip


@pytest.mark.costly
@settings(max_examples=100)
@given(
    objects=st.lists(OBJECTS, max_size=40),
    cuts=st.lists(st.integers(0, 1 << 20), max_size=6),
    methods=st.lists(st.sampled_from([0, 2]), min_size=7, max_size=7),
    size=st.sampled_from([1, 500, 4 << 20]),
)
def test_any_objects_in_any_containers_are_read_as_by_python_can(
    folder, objects, cuts, methods, size
):
    data = b"".join(objects)
    edges = sorted({0, len(data), *(cut % (len(data) + 1) for cut in cuts)})
    parts = [data[a:b] for a, b in itertools.pairwise(edges)]
    content = wire.blf(*map(wire.container, parts, methods))
    wanted = by_python_can(content)
    blocks, report = read(folder, content, size)
    assert_alike(items(blocks), wanted)
    assert not report.notes
    if blocks:
        assert items([Block.concatenate(blocks)]) == items(blocks)
    others = len(objects) - len(wanted)
    assert report.kinds["other"] == others
    assert read(folder, gzip.compress(content), size, "b.blf.gz")[1].kinds == report.kinds
    assert items(read(folder, gzip.compress(content), size, "b.blf.gz")[0]) == items(blocks)


MESSAGES = st.tuples(
    st.integers(0, 10**6), st.integers(0, (1 << 29) - 1), st.booleans(), st.binary(max_size=8),
    st.integers(0, 4), st.sampled_from(["data", "data", "fd", "remote", "error"]),
)  # fmt: skip


@settings(max_examples=60)
@given(
    rows=st.lists(MESSAGES, max_size=60),
    level=st.sampled_from([-1, 0, 9]),
    most=st.sampled_from([1000, 5000, 128 * 1024]),
)
def test_what_python_cans_writer_writes_is_read_as_by_its_reader(folder, rows, level, most):
    path = folder / "written.blf"
    t_us = 1_700_000_000_000_000
    with can.BLFWriter(path, compression_level=level, max_container_size=most) as writer:
        for step, ident, extended, data, channel, form in rows:
            t_us += step
            writer.on_message_received(
                can.Message(
                    timestamp=t_us / 1e6, is_extended_id=extended,
                    arbitration_id=ident if extended else ident & 0x7FF,
                    data=data * (8 if form == "fd" and len(data) == 8 else 1) or None,
                    channel=channel, is_fd=form == "fd", is_remote_frame=form == "remote",
                    is_error_frame=form == "error",
                )
            )  # fmt: skip
    content = path.read_bytes()
    blocks, report = read(folder, content)
    assert_alike(items(blocks), by_python_can(content))
    assert not report.notes


def small():
    objects = [
        wire.classic(0x101, bytes(range(8)), stamp=1_000),
        wire.fd64(0x18FEF100 | 1 << 31, bytes(range(13)), 2, stamp=2_001),
        wire.obj(96, b"a marker with LOBJ in it", stamp=2_500),
        wire.fd(0x7FF, bytes(range(64)), stamp=7),
        wire.error(channel=2, stamp=100_000, unit=1),
        wire.classic(0x102, b"", dlc=4, stamp=5, kind=86),
        wire.classic(0x103, b"abcdefgh", 1, 0x80, stamp=9_999_999_999),
    ]
    data = b"".join(objects)
    return data, wire.blf(
        wire.container(data[:60]), wire.container(data[60:300], method=0),
        wire.container(data[300:]),
    )  # fmt: skip


def test_stamps_are_exact_to_the_nanosecond_and_every_kind_is_what_it_is(folder):
    blocks, report = read(folder, small()[1])
    rows = Block.concatenate(blocks)
    assert (rows.t_ns - START_NS).tolist() == [
        1_000, 2_001, 7, 1_000_000_000, 5, 9_999_999_999,
    ]  # fmt: skip
    assert rows.kind.tolist() == [Kind.DATA, Kind.FD, Kind.FD, Kind.ERROR, Kind.DATA, Kind.REMOTE]
    assert rows.length.tolist() == [8, 13, 64, 0, 4, 0]
    assert rows.channels == ("can0", "can1")
    assert report.kinds == {"frame": 2, "fd": 2, "error": 1, "remote": 1, "other": 1}
    assert bytes(rows.payload[1][:14]) == bytes([*range(13), 0])


@pytest.mark.costly
def test_a_file_cut_at_any_byte_gives_what_is_whole_and_says_so(folder):
    _, content = small()
    whole = items(read(folder, content)[0])
    for length in range(144, len(content)):
        blocks, report = read(folder, content[:length])
        found = items(blocks)
        assert found == whole[: len(found)]
        states = f"{length} of the {len(content)} bytes that its header states"
        assert report.notes == [f"the file is truncated: it has {states}"]
        # A logger that lost power never came to write its length.
        lost = content[:8] + content[8:16] + bytes(8) + content[24:length]
        blocks, report = read(folder, lost)
        assert items(blocks) == found
        told = [note for note in report.notes if "is truncated" in note or "damaged" in note]
        assert told or len(found) == len(whole) or is_edge(content, length)
    for length in range(72):  # as far as the fields of the head reach
        what = "it ends there" if length else "the file is empty"
        with pytest.raises(RecordingError, match=rf"header cannot be read \({what}\)"):
            read(folder, content[:length])


def is_edge(content, length):
    """Whether a container ends there, its padding left out: nothing shows that more came."""
    place = 144
    while place < length:
        (size,) = struct.unpack_from("<L", content, place + 8)
        if place + size <= length <= place + size + size % 4:
            return True
        place += size + size % 4
    return place == length


def test_any_damage_costs_what_stands_there_and_is_reported(folder):
    objects = [wire.classic(0x100 + n, bytes([n % 256] * 8), stamp=1000 * n) for n in range(400)]
    parts = [b"".join(objects[n : n + 20]) for n in range(0, 400, 20)]
    content = wire.blf(*map(wire.container, parts))
    whole = items(read(folder, content)[0])
    assert len(whole) == 400
    rng = random.Random(5)
    kept = []
    for _ in range(200):
        damaged = bytearray(content)
        place = rng.randrange(144, len(content))
        damaged[place] ^= rng.randrange(1, 256)
        blocks, report = read(folder, bytes(damaged))
        found = items(blocks)
        changed = [f for f in found if f not in whole]
        assert len(changed) <= 20, "no more than a container of them"
        kept.append(len(found))
        assert found == whole or report.notes or changed
    assert sorted(kept)[len(kept) // 2] >= 380
    assert min(kept) >= 340


def test_a_container_that_claims_or_holds_much_takes_little_memory(folder):
    import tracemalloc

    bomb = wire.container(bytes(64 << 20))
    liar = wire.container(wire.classic(1, b"a"), claimed=0xFFFFFFFF)
    long = wire.container(b"x" * 100, method=0, size=0xFFFFFFF0)
    content = wire.blf(liar, bomb, long)
    tracemalloc.start()
    try:
        blocks, report = read(folder, content)
        most = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    assert len(items(blocks)) == 1
    assert report.notes
    assert most < 24 << 20


@pytest.mark.parametrize(
    ("made", "note"),
    [
        (wire.container(wire.classic(1, b"a"), method=7), "unknown compression 7"),
        (wire.container(wire.fd64(1, b"a", valid=65)), "impossible"),
        (wire.container(wire.classic(1, b"a", version=3)), "impossible"),
        (wire.container(wire.classic(1, b"a", stamp=1 << 63)), "impossible"),
        (wire.container(wire.obj(1, b"abc")), "impossible"),
        (wire.container(wire.fd64(1, b"abc", extra=30)), "impossible"),
        (wire.container(b"what is this, then?"), "damaged"),
        (wire.container(wire.obj(1, bytes(16), size=4)), "damaged"),
        (wire.container(wire.obj(96, bytes(16), size=1 << 30)), "is truncated"),
        (b"nothing of a container here", "damaged"),
    ],
)
def test_what_no_writer_writes_is_passed_over_and_reported(folder, made, note):
    good = wire.container(wire.classic(2, b"good"))
    blocks, report = read(folder, wire.blf(good, made))
    assert [f.data for f in items(blocks)] == [b"good"]
    assert any(note in told for told in report.notes), report.notes
    if "is truncated" not in note:
        blocks, report = read(folder, wire.blf(good, made, good))
        assert [f.data for f in items(blocks)] == [b"good"] * 2


def test_a_start_that_is_no_date_counts_from_0_as_in_python_can(folder):
    content = wire.blf(wire.container(wire.classic(1, b"a", stamp=5)), start=(0,) * 8)
    (frame,) = items(read(folder, content)[0])
    assert frame == by_python_can(content)[0]
    assert frame.t_us == 0


@pytest.mark.parametrize("size", [0, 71, 100, 143])
def test_a_head_that_claims_too_few_bytes_has_its_144_all_the_same(folder, size):
    content = bytearray(wire.blf(wire.container(wire.classic(1, b"a"))))
    content[4:8] = size.to_bytes(4, "little")
    blocks, report = read(folder, bytes(content))
    assert [f.data for f in items(blocks)] == [b"a"]
    assert report.notes == [f"the file header claims a length of {size} bytes; using 144"]
