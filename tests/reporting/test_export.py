"""Files of columns, read back with the tools that people read them with."""

import csv
import gzip
import json
import random
import re
import sys
from collections import defaultdict
from dataclasses import replace
from decimal import Decimal
from pathlib import Path

import cantools
import numpy as np
import pyarrow as pa
import pytest
from asammdf import MDF
from asammdf.blocks.conversion_utils import from_dict
from cantools.database.errors import DecodeError
from hypothesis import given
from hypothesis import strategies as st
from pyarrow import parquet

from adhesion_can.bus.block import Block
from adhesion_can.bus.database import CanDatabase
from adhesion_can.bus.decoder import Decoder
from adhesion_can.bus.frame import Frame
from adhesion_can.errors import InputError
from adhesion_can.extras import install_extra
from adhesion_can.reporting.export import open_recording, open_table
from adhesion_can.reporting.export.csv_file import time_texts
from adhesion_can.reporting.export.layout import Field, FieldColumn, Group, GroupRows, Raw
from adhesion_can.reporting.export.messages import MessageRows
from adhesion_can.reporting.export.mf4_file import _conversion, _stored
from adhesion_can.reporting.export.target import (
    SUFFIXES,
    file_target,
    parse_target,
    require_format,
)

DBC = """VERSION ""
BU_: A
BO_ 291 Plain: 8 A
 SG_ Scaled : 0|16@1+ (0.002,-3.5) [0|0] "m/s" A
 SG_ Motorola : 23|16@0- (0.01,0) [0|0] "kN" A
 SG_ Count : 32|8@1+ (1,0) [0|0] "" A
 SG_ Gear : 40|3@1+ (1,0) [0|0] "-" A
 SG_ Steps : 48|12@1- (5,100) [0|0] "N" A
BO_ 292 Wide: 8 A
 SG_ All64 : 0|64@1+ (1,0) [0|0] "" A
BO_ 293 Reals: 8 A
 SG_ Single : 0|32@1- (1,0) [0|0] "V" A
 SG_ Fine : 32|32@1+ (1e-07,-180) [0|0] "deg" A
BO_ 2566844926 CCVS1: 8 A
 SG_ WheelBasedVehicleSpeed : 8|16@1+ (0.00390625,0) [0|250.996] "km/h" A
BO_ 2566834709 Muxed: 8 A
 SG_ Page M : 0|4@1+ (1,0) [0|0] "" A
 SG_ Sub m1M : 4|4@1+ (1,0) [0|0] "" A
 SG_ Always : 8|8@1+ (0.5,-40) [0|0] "degC" A
 SG_ First m0 : 16|8@1- (1,0) [0|0] "A" A
 SG_ Second m1 : 16|8@1+ (0.1,0) [0|0] "bar" A
 SG_ Nested m3 : 24|24@1+ (0.001,0) [0|0] "l" A
 SG_ P2 m2 : 16|4@1+ (1,0) [0|0] "" A
 SG_ P3 m3 : 16|4@1+ (1,0) [0|0] "" A
 SG_ P4 m4 : 16|4@1+ (1,0) [0|0] "" A
 SG_ P5 m5 : 16|4@1+ (1,0) [0|0] "" A
CM_ BO_ 291 "A plain message";
CM_ SG_ 291 Scaled "Speed <of> the wheel & more, \u00fc";
VAL_ 291 Gear 0 "neutral" 1 "first" 7 "not available" ;
VAL_ 291 Scaled 65535 "not available" ;
SIG_VALTYPE_ 293 Single : 1;
SG_MUL_VAL_ 2566834709 Nested Sub 3-5;
SG_MUL_VAL_ 2566834709 Sub Page 1-1;
SG_MUL_VAL_ 2566834709 First Page 0-0;
SG_MUL_VAL_ 2566834709 Second Page 1-1;
SG_MUL_VAL_ 2566834709 P2 Page 2-2;
SG_MUL_VAL_ 2566834709 P3 Page 3-3;
SG_MUL_VAL_ 2566834709 P4 Page 4-4;
SG_MUL_VAL_ 2566834709 P5 Page 5-5;
"""
DB = cantools.database.load_string(DBC)
DATABASE = CanDatabase(Path("test.dbc"), "0" * 64, DB)
T0_NS = 1_700_000_000_123_456_789
ORIGIN = {"version": "1.2.3", "inputs": '["a.log"]'}


def recorded(count=600, seed=1):
    """(block, what cantools says of each frame that it decodes: t_ns, message, values)."""
    rng = random.Random(seed)
    # The last message comes late: its columns are not known at the start.
    frames, expected, t_ns = [], [], T0_NS
    for number in range(count):
        known = DB.messages[: 4 if number < count // 2 else None]
        message = rng.choice(known)
        data = rng.randbytes(8)
        if message.name == "Muxed" and rng.random() < 0.9:
            data = bytes([rng.choice((0, 0x31, 0x41, 0x51, 2, 3, 4, 5))]) + data[1:]
        key = message.frame_id
        frames.append(Frame(0, key, data, "can0", message.is_extended_frame))
        t_ns += rng.choice((1, 999, 250_000, 10_000_001))
        frames[-1] = frames[-1]._replace(t_us=t_ns)  # in ns, put right below
        try:
            values = message.decode(data, decode_choices=False)
        except DecodeError:
            continue
        expected.append((t_ns, message.name, values))
    block = Block.from_frames([frame._replace(t_us=0) for frame in frames])
    return replace(block, t_ns=np.array([frame.t_us for frame in frames])), expected


def write(path, block, size=10_000, *, fail=False):
    decoder, rows = Decoder(DATABASE), MessageRows(DATABASE)
    with open_recording(file_target(path, "out"), ORIGIN) as writer:
        for first in range(0, len(block), size):
            part = block.select(slice(first, first + size))
            writer.write(*rows.build(decoder.decode(part), part))
        if fail:
            raise KeyboardInterrupt
    return decoder.report


def same(a, b):
    return a == b or (a != a and b != b)


def csv_rows(path):
    content = path.read_bytes()
    text = gzip.decompress(content) if path.suffix == ".gz" else content
    return list(csv.DictReader(text.decode().splitlines()))


# --- recordings


@pytest.mark.parametrize("name", ["a.csv", "a.csv.gz"])
def test_csv_reads_back_as_cantools_decodes(tmp_path, name):
    block, expected = recorded()
    write(tmp_path / name, block)
    rows = csv_rows(tmp_path / name)
    assert len(rows) == len(expected)
    for row, (t_ns, message, values) in zip(rows, expected, strict=True):
        assert Decimal(row.pop("time_s")) * 10**9 == t_ns
        assert row.pop("message") == message
        held = {column: text for column, text in row.items() if text}
        assert held.keys() == {f"{message}.{signal}" for signal in values}
        for signal, value in values.items():
            text = held[f"{message}.{signal}"]
            kind = int if isinstance(value, int) else float
            assert same(kind(text), value)


def test_parquet_reads_back_as_cantools_decodes(tmp_path):
    block, expected = recorded()
    write(tmp_path / "a.parquet", block)
    table = parquet.read_table(tmp_path / "a.parquet")
    rows = table.to_pylist()
    assert len(rows) == len(expected)
    for row, (t_ns, message, values) in zip(rows, expected, strict=True):
        assert row.pop("time_ns") == t_ns
        assert row.pop("time_s") == t_ns / 1e9
        assert row.pop("message") == message
        held = {column: value for column, value in row.items() if value is not None}
        assert held.keys() == {f"{message}.{signal}" for signal in values}
        for signal, value in values.items():
            assert same(held[f"{message}.{signal}"], value)
            assert isinstance(held[f"{message}.{signal}"], type(value))


def test_parquet_says_units_comments_values_and_where_it_comes_from(tmp_path):
    write(tmp_path / "a.parquet", recorded()[0])
    schema = parquet.read_schema(tmp_path / "a.parquet")
    scaled = schema.field("Plain.Scaled")
    assert scaled.metadata[b"unit"] == b"m/s"
    assert scaled.metadata[b"comment"].decode() == "Speed <of> the wheel & more, \u00fc"
    assert json.loads(scaled.metadata[b"values"]) == {"127.57": "not available"}
    gear = json.loads(schema.field("Plain.Gear").metadata[b"values"])
    assert gear == {"0": "neutral", "1": "first", "7": "not available"}
    assert schema.metadata[b"version"] == b"1.2.3"
    assert schema.field("time_ns").type == pa.int64()
    assert pa.types.is_dictionary(schema.field("message").type)
    assert schema.field("Plain.Count").type == pa.uint8()
    assert schema.field("Plain.Steps").type == pa.int16()
    assert schema.field("Wide.All64").type == pa.uint64()


def mf4_columns(path):
    """{(message, signal): (times in s after the start, values)} of what is valid."""
    columns = {}
    with MDF(path) as mdf:
        for place, group in enumerate(mdf.groups):
            for channel in group.channels[1:]:
                raw = channel.name == "Gear"  # whose values have texts
                signal = mdf.get(channel.name, group=place, raw=raw)
                columns[group.channel_group.acq_name, channel.name] = (
                    signal.timestamps,
                    signal.samples,
                )
        start_ns = mdf.header.abs_time
    return start_ns, columns


def test_mf4_reads_back_as_cantools_decodes(tmp_path):
    block, expected = recorded()
    write(tmp_path / "a.mf4", block)
    start_ns, columns = mf4_columns(tmp_path / "a.mf4")
    assert start_ns == expected[0][0]
    wanted = defaultdict(list)
    for t_ns, message, values in expected:
        for signal, value in values.items():
            wanted[message, signal].append(((t_ns - start_ns) / 1e9, value))
    assert columns.keys() == wanted.keys()
    for name, pairs in wanted.items():
        times, values = columns[name]
        assert times.tolist() == [t for t, _ in pairs]
        assert len(values) == len(pairs)
        assert all(same(a, b) for a, (_, b) in zip(values.tolist(), pairs, strict=True)), name


def test_the_time_of_mf4_begins_where_the_recording_does(tmp_path):
    """Two files of one recording lie over each other, whatever rows each of them holds."""
    with open_recording(file_target(tmp_path / "a.mf4", "out"), {}) as writer:
        writer.begin(T0_NS)
        decoder, rows = Decoder(DATABASE), MessageRows(DATABASE)
        frames = [Frame(0, 291, bytes(8)), Frame(0, 291, bytes(8))]
        block = replace(
            Block.from_frames(frames), t_ns=np.array([T0_NS + 5 * 10**9, T0_NS + 7 * 10**9])
        )
        writer.write(*rows.build(decoder.decode(block), block))
    start_ns, columns = mf4_columns(tmp_path / "a.mf4")
    assert start_ns == T0_NS
    assert columns["Plain", "Count"][0].tolist() == [5.0, 7.0]


@given(st.lists(st.integers(0, 20), min_size=1, max_size=20))
def test_the_times_of_mf4_rise_within_what_is_written_at_once(tmp_path_factory, seconds):
    path = tmp_path_factory.getbasetemp() / "rising.mf4"
    count = len(seconds)
    group = Group("M", (Field("place"), Field("even", optional=True)))
    places = np.arange(count)
    numbers = places.astype(float)
    columns = [FieldColumn(numbers), FieldColumn(numbers, places % 2 == 1)]
    with open_recording(file_target(path, "out"), {}) as writer:
        writer.begin(0)
        writer.write([GroupRows(group, places, np.array(seconds) * 10**9, columns)])
    _, held = mf4_columns(path)
    order = sorted(range(count), key=lambda row: seconds[row])  # stable
    assert held["M", "place"][0].tolist() == [seconds[row] for row in order]
    assert held["M", "place"][1].tolist() == order
    assert held["M", "even"][1].tolist() == [row for row in order if row % 2 == 0]


def test_mf4_says_units_comments_values_and_where_it_comes_from(tmp_path):
    write(tmp_path / "a.mf4", recorded()[0])
    with MDF(tmp_path / "a.mf4") as mdf:
        assert mdf.version == "4.10"
        assert mdf.start_time.timestamp() == pytest.approx(T0_NS / 1e9, abs=0.02)
        assert "version: 1.2.3" in mdf.header.comment
        scaled = mdf.get("Scaled")
        assert scaled.unit == "m/s"
        comment = "Speed <of> the wheel & more, \u00fc [127.57 = not available]"
        assert scaled.comment == comment
        assert mdf.get("Scaled", raw=True).samples.dtype == np.uint16
        assert mdf.get("Fine", raw=True).samples.dtype == np.uint32
        texts = set(mdf.get("Gear").samples.tolist())
        assert texts == {b"neutral", b"first", b"not available", b"2", b"3", b"4", b"5", b"6"}
        (place,) = (i for i, g in enumerate(mdf.groups) if g.channel_group.acq_name == "Plain")
        group = mdf.groups[place].channel_group
        assert group.comment == "0x123 A plain message"
        assert group.acq_source.name == "Plain"
        assert group.acq_source.bus_type == 2  # CAN


@pytest.mark.parametrize("size", [1, 7, 97, 599])
def test_blocks_of_any_size_give_the_same_file(tmp_path, size):
    block, _ = recorded()
    one, many = tmp_path / "one", tmp_path / "many"
    for folder, of in ((one, 10_000), (many, size)):
        folder.mkdir()
        for suffix in SUFFIXES:
            write(folder / f"a{suffix}", block, of)
        assert sorted(p.name for p in folder.iterdir()) == sorted(f"a{s}" for s in SUFFIXES)
    for suffix in (".csv", ".csv.gz"):
        assert csv_rows(one / f"a{suffix}") == csv_rows(many / f"a{suffix}")
    assert (one / "a.csv").read_bytes() == (many / "a.csv").read_bytes()
    # NaN is no NaN to Arrow's equality.
    tables = [parquet.read_table(folder / "a.parquet") for folder in (one, many)]
    assert tables[0].schema.equals(tables[1].schema, check_metadata=True)
    assert repr(tables[0].to_pylist()) == repr(tables[1].to_pylist())
    first, second = (mf4_columns(folder / "a.mf4") for folder in (one, many))
    assert first[0] == second[0]
    assert first[1].keys() == second[1].keys()
    for name, (times, values) in first[1].items():
        assert times.tobytes() == second[1][name][0].tobytes()
        assert values.tobytes() == second[1][name][1].tobytes()


def test_frames_that_were_rejected_are_in_no_column(tmp_path):
    block, expected = recorded()
    report = write(tmp_path / "a.csv", block)
    rejected = sum(count.rejected.total() for count in report.messages.values())
    assert rejected > 0
    assert rejected + len(expected) == len(block)


def test_a_large_table_is_written_in_row_groups(tmp_path, monkeypatch):
    from adhesion_can.reporting.export import parquet_file

    monkeypatch.setattr(parquet_file, "_CELLS", 1)  # then 1024 rows
    block, expected = recorded(3000)
    for size, name in ((10_000, "a.parquet"), (700, "b.parquet")):
        write(tmp_path / name, block, size)
        table = parquet.read_table(tmp_path / name)
        assert table["time_ns"].to_pylist() == [t_ns for t_ns, _, _ in expected]
    groups = parquet.ParquetFile(tmp_path / "a.parquet").metadata
    assert groups.row_group(0).num_rows == 1024
    assert groups.num_row_groups == -(-len(expected) // 1024)


def test_a_name_that_stands_twice_gets_its_id(tmp_path):
    text = DBC.replace("BO_ 292 Wide", "BO_ 292 Plain").replace("All64", "Scaled")
    database = CanDatabase(Path("t.dbc"), "", cantools.database.load_string(text, strict=False))
    frames = [Frame(1, 291, bytes(8)), Frame(2, 292, b"\1" + bytes(7))]
    with open_recording(file_target(tmp_path / "a.csv", "out"), {}) as writer:
        block = Block.from_frames(frames)
        writer.write(*MessageRows(database).build(Decoder(database).decode(block), block))
    first, second = csv_rows(tmp_path / "a.csv")
    assert (first["message"], first["Plain@123.Scaled"]) == ("Plain@123", "-3.5")
    assert (second["message"], second["Plain@124.Scaled"]) == ("Plain@124", "1")


def test_a_recording_of_nothing_has_a_header(tmp_path):
    for suffix in SUFFIXES:
        with open_recording(file_target(tmp_path / f"a{suffix}", "out"), ORIGIN):
            pass
    assert (tmp_path / "a.csv").read_text() == "time_s,message\n"
    assert parquet.read_table(tmp_path / "a.parquet").num_rows == 0
    with MDF(tmp_path / "a.mf4") as mdf:
        assert not mdf.groups


# --- whole or not at all


@pytest.mark.parametrize("suffix", SUFFIXES)
@pytest.mark.parametrize("size", [97, 10_000])
def test_a_failure_leaves_what_was_there(tmp_path, suffix, size):
    path = tmp_path / f"a{suffix}"
    path.write_text("old")
    with pytest.raises(KeyboardInterrupt):
        write(path, recorded()[0], size, fail=True)
    assert path.read_text() == "old"
    assert list(tmp_path.iterdir()) == [path]


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_a_failure_at_the_end_leaves_nothing(tmp_path, suffix, monkeypatch):
    def refuse(*_):
        raise OSError(28, "No space left on device")

    with monkeypatch.context() as patch:
        patch.setattr(Path, "replace", refuse)
        with pytest.raises(InputError, match="No space left on device"):
            write(tmp_path / f"a{suffix}", recorded()[0])
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_a_failing_removal_does_not_hide_the_error(tmp_path, suffix, monkeypatch):
    def refuse(*_, **__):
        raise OSError(30, "Read-only file system")

    with monkeypatch.context() as patch:
        patch.setattr(Path, "unlink", refuse)
        with pytest.raises(KeyboardInterrupt):
            write(tmp_path / f"a{suffix}", recorded()[0], fail=True)


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_a_name_that_is_too_long_is_told(tmp_path, suffix):
    path = tmp_path / ("x" * 300 + suffix)
    with pytest.raises(InputError, match="File name too long"):
        parse_target(str(path), "--out")
    with pytest.raises(InputError, match="File name too long"):
        write(path, recorded()[0])


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_a_folder_that_is_not_there_is_told(tmp_path, suffix):
    with pytest.raises(InputError, match=r"No such file|does not exist"):
        write(tmp_path / "none" / f"a{suffix}", recorded()[0])


@pytest.mark.parametrize(("suffix", "library"), [(".parquet", "pyarrow"), (".mf4", "asammdf")])
def test_a_missing_extra_is_told_with_the_line_that_mends_it(
    tmp_path, suffix, library, monkeypatch
):
    for name in list(sys.modules):
        if name.startswith((library, "adhesion_can.reporting.export.")):
            monkeypatch.delitem(sys.modules, name)
    monkeypatch.setitem(sys.modules, library, None)
    line = re.escape(install_extra(suffix.removeprefix(".")))
    with pytest.raises(InputError, match=rf"needs {library}.*{line}"):
        require_format(tmp_path / f"a{suffix}", "--out")


@pytest.mark.parametrize("name", ["a.xls", "a", "a.gz", "a.parquet.gz"])
def test_a_format_that_nobody_knows_is_told(tmp_path, name):
    with pytest.raises(InputError, match=r"--out .*unknown format"):
        require_format(tmp_path / name, "--out")


# --- tables

STATUS = {0: "INIT", 1: "TRACKING", 5: "FAULT"}
FIELDS = (
    Field("status", np.dtype(np.int64), names=STATUS, text=True),
    Field("mu_max", unit="-", comment="peak", optional=True, spec=".9g"),
)
T_NS = np.array([5_000_000_000, 5_020_000_000, 5_040_000_000])
TABLE = [
    FieldColumn(np.array([0, 1, 5])),
    FieldColumn(np.array([np.nan, 0.1234567891234, 0.3]), np.array([True, False, False])),
]


def table(path, parts):
    with open_table(path, FIELDS, ORIGIN) as write_rows:
        for part in parts:
            columns = [
                FieldColumn(c.values[part], None if c.missing is None else c.missing[part])
                for c in TABLE
            ]
            write_rows(T_NS[part], columns)
    return path


PARTS = [[slice(0, 3)], [slice(0, 1), slice(1, 3)], []]


@pytest.mark.parametrize("parts", PARTS)
def test_a_plain_table_in_every_format(tmp_path, parts):
    rows = 3 if parts else 0
    text = table(tmp_path / "a.csv", parts).read_text().splitlines()
    assert text[0] == "time_s,status,mu_max"
    assert (
        text[1:]
        == [
            "5.000000,INIT,",
            "5.020000,TRACKING,0.123456789",
            "5.040000,FAULT,0.3",
        ][:rows]
    )
    held = parquet.read_table(table(tmp_path / "a.parquet", parts))
    assert held.column_names == ["time_s", "status", "mu_max"]
    assert (
        held.to_pylist()
        == [
            {"time_s": 5.0, "status": "INIT", "mu_max": None},
            {"time_s": 5.02, "status": "TRACKING", "mu_max": 0.1234567891234},
            {"time_s": 5.04, "status": "FAULT", "mu_max": 0.3},
        ][:rows]
    )
    with MDF(table(tmp_path / "a.mf4", parts)) as mdf:
        status, mu = mdf.get("status"), mdf.get("mu_max")
        assert status.samples.tolist() == [b"INIT", b"TRACKING", b"FAULT"][:rows]
        assert mdf.header.abs_time == (5_000_000_000 if rows else 0)
        assert status.timestamps.tolist() == pytest.approx([0.0, 0.02, 0.04][:rows])
        assert mu.samples.tolist() == [0.1234567891234, 0.3][: max(rows - 1, 0)]
        assert (mu.unit, mu.comment) == ("-", "peak")


# --- texts and raw values


@given(
    st.lists(st.one_of(st.integers(-(10**19) // 2, 10**18), st.integers(-(10**10), 10**11))),
    st.integers(1, 9),
)
def test_stamps_as_text_are_exact(t_ns, decimals):
    texts = time_texts(np.array(t_ns, dtype=np.int64), decimals)
    for t, text in zip(t_ns, texts, strict=True):
        whole, fraction = divmod(abs(t), 10**9)
        sign = "-" if t < 0 else ""
        assert text == f"{sign}{whole}.{f'{fraction:09d}'[:decimals]}"


@given(
    st.lists(st.integers(0, 2**32 - 1), min_size=1),
    st.floats(1e-12, 1e12),
    st.floats(-1e6, 1e6),
    st.sampled_from([-1, 1]),
)
def test_a_raw_value_comes_back_from_its_number(raws, scale, steps, sign):
    raw = Raw(np.dtype("u4"), sign * scale, steps * scale)
    numbers = np.array(raws) * raw.scale + raw.offset
    field = Field("x", raw=raw)
    stored, _ = _stored(field, FieldColumn(numbers))
    assert stored.tolist() == raws
    again = from_dict(_conversion(field)).convert(stored)
    assert again.tolist() == numbers.tolist()


@given(st.lists(st.floats()))
def test_floats_read_back_exactly(tmp_path_factory, numbers):
    path = tmp_path_factory.getbasetemp() / "floats.csv"
    group = Group("M", (Field("x"),))
    places = np.arange(len(numbers))
    with open_recording(file_target(path, "out"), {}) as writer:
        writer.write(
            [GroupRows(group, places, places, [FieldColumn(np.array(numbers, dtype=float))])]
        )
    read = [float(row["M.x"]) for row in csv_rows(path)]
    assert list(map(repr, read)) == list(map(repr, numbers))  # nan and -0.0, too
