"""Folders of a file a message, Arrow in the long form and MCAP, with cantools as oracle."""

import csv
import json
import math
from base64 import b64decode
from collections import defaultdict
from itertools import count
from pathlib import Path

import numpy as np
import pyarrow as pa
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from mcap.reader import make_reader
from pyarrow import parquet

from adhesion_can.bus.block import Block
from adhesion_can.bus.decoder import Decoder
from adhesion_can.bus.frame import Frame, Mark
from adhesion_can.errors import InputError
from adhesion_can.reporting.export import open_recording
from adhesion_can.reporting.export.messages import MessageRows
from adhesion_can.reporting.export.target import Target, parse_target
from tests.bus.test_decoder import by_cantools, databases, from_text, random_items, same_number
from tests.reporting.test_export import DATABASE, ORIGIN, recorded, same

GOLDEN = Path(__file__).parent / "mcap_schemas.json"
FEW = settings(max_examples=40, deadline=None, suppress_health_check=list(HealthCheck))


def write(target, known, blocks, *, fail=False):
    """Write blocks; what the file says of itself."""
    decoder, rows = Decoder(known), MessageRows(known, by_channel=target.by_channel)
    with open_recording(target, ORIGIN) as writer:
        for block in blocks:
            writer.write(*rows.build(decoder.decode(block), block))
        if fail:
            raise KeyboardInterrupt
    return writer.problems()


def folder(path, suffix=".parquet"):
    return Target(path, suffix, is_folder=True)


def tables(path):
    """The tables of a folder by file name, each a list of dictionaries."""
    found = {}
    for file in sorted(path.iterdir()):
        if file.suffix == ".parquet":
            found[file.stem] = parquet.read_table(file).to_pylist()
        elif file.suffix == ".arrow":
            with pa.ipc.open_file(str(file)) as opened:
                found[file.stem] = opened.read_all().to_pylist()
    return found


def arrow_rows(path):
    opener = pa.ipc.open_file if path.suffix == ".arrow" else pa.ipc.open_stream
    with path.open("rb") as file, opener(file) as opened:
        return opened.read_all().to_pylist()


def mcap_messages(path):
    """(topic, stamp in ns, document) of each message in the order of the file's data."""
    with path.open("rb") as file:
        reader = make_reader(file, validate_crcs=True)
        return [
            (channel.topic, message.log_time, json.loads(message.data))
            for _, channel, message in reader.iter_messages(log_time_order=False)
        ]


# --- every format holds what cantools decodes


def expected_rows(known, items):
    """(channel, message, stamp in ns, values) of what cantools decodes, in the order of frames."""
    names = {(m.frame_id, m.is_extended_frame): m for m in known.db.messages}
    received, _ = by_cantools(known, items)
    found = [
        (place, names[key], values)
        for key, results in received.items()
        for place, values in results
        if not isinstance(values, str) and names[key].signals
    ]
    found.sort(key=lambda one: one[0])
    return [
        (items[place].channel, message.name, 1000 * items[place].t_us, values)
        for place, message, values in found
    ]


def equal(found, wanted):
    kind = np.float64 if isinstance(found, float) else np.int64
    return same_number(found, wanted, np.dtype(kind))


NAMES = count()


@pytest.mark.costly
@FEW
@given(known=databases(), seed=st.integers(0, 2**32))
def test_random_databases_read_back_as_cantools_decodes(tmp_path_factory, known, seed):
    items = random_items(known, seed, 80)
    blocks = [Block.from_frames(part) for part in (items[:50], items[50:51], items[51:])]
    expected = expected_rows(known, items)
    path = tmp_path_factory.getbasetemp() / f"random{next(NAMES)}"
    path.mkdir()
    check_folder(path / "folder", known, blocks, expected)
    check_arrow(path / "a.arrow", known, blocks, expected)
    check_arrow(path / "a.arrows", known, blocks, expected)
    check_mcap(path / "a.mcap", known, blocks, expected, items)


def check_folder(path, known, blocks, expected):
    write(folder(path), known, blocks)
    files = json.loads((path / "convert.json").read_text())["files"]
    found = {(f["channel"], f["message"]): tables(path)[Path(f["file"]).stem] for f in files}
    assert {key: len(rows) for key, rows in found.items()} == {
        (f["channel"], f["message"]): f["rows"] for f in files
    }
    wanted = defaultdict(list)
    for channel, message, t_ns, values in expected:
        wanted[channel, message].append((t_ns, values))
    assert found.keys() == wanted.keys()
    for key, rows in found.items():
        for row, (t_ns, values) in zip(rows, wanted[key], strict=True):
            assert row.pop("time_ns") == t_ns
            assert row.pop("time_s") == t_ns / 1e9
            held = {name: value for name, value in row.items() if value is not None}
            assert held.keys() == values.keys()
            assert all(equal(held[name], values[name]) for name in values)


def check_arrow(path, known, blocks, expected):
    write(Target(path, path.suffix), known, blocks)
    wanted = [
        (t_ns, channel, message, name, values[name])
        for channel, message, t_ns, values in expected
        for name in signal_order(known, message)
        if name in values
    ]
    rows = arrow_rows(path)
    for row, (t_ns, channel, message, name, value) in zip(rows, wanted, strict=True):
        assert (row["time_ns"], row["time_s"]) == (t_ns, t_ns / 1e9)
        assert (row["channel"], row["message"], row["signal"]) == (channel, message, name)
        assert same(row["value"], float(value))


def signal_order(known, message):
    return [s.name for s in known.db.get_message_by_name(message).signals]


def check_mcap(path, known, blocks, expected, items):
    write(Target(path, ".mcap"), known, blocks)
    found = mcap_messages(path)
    frames = [one for one in found if one[0].startswith("/frames/")]
    sent = [item for item in items if not isinstance(item, Mark)]
    for (topic, t_ns, document), frame in zip(frames, sent, strict=True):
        assert (topic, t_ns) == (f"/frames/{frame.channel}", 1000 * frame.t_us)
        assert b64decode(document.pop("data")) == frame.data
        assert document == {
            "id": frame.arbitration_id,
            "is_extended": frame.is_extended,
            "is_rtr": frame.is_remote,
            "is_error": frame.is_error,
            "is_fd": frame.is_fd,
            "dlc": len(frame.data),
        }
    decoded = [one for one in found if not one[0].startswith("/frames/")]
    for (topic, t_ns, document), one in zip(decoded, expected, strict=True):
        channel, message, wanted_ns, values = one
        assert (topic, t_ns) == (f"/{channel}/{message}", wanted_ns)
        assert document.keys() == values.keys()
        for name, value in values.items():
            if math.isfinite(value):
                assert equal(document[name], value)
            else:
                assert document[name] is None
    # Each message stands right behind its frame.
    stamps = [t_ns for _, t_ns, _ in found]
    assert stamps == sorted(stamps)


@pytest.mark.parametrize("suffix", [".parquet", ".arrow"])
@pytest.mark.parametrize("cells", [1, 1 << 20])
def test_a_folder_with_types_units_and_comments(tmp_path, monkeypatch, suffix, cells):
    from adhesion_can.reporting.export import arrow_message, message_folder

    monkeypatch.setattr(arrow_message, "_CELLS", cells)
    monkeypatch.setattr(message_folder, "_CELLS", cells)
    block, expected = recorded()
    parts = [block.select(slice(first, first + 97)) for first in range(0, 600, 97)]
    write(folder(tmp_path / "o", suffix), DATABASE, parts)
    found = tables(tmp_path / "o")
    assert {name: len(rows) for name, rows in found.items()} == {
        name: sum(message == name for _, message, _ in expected) for name in found
    }
    file = tmp_path / "o" / f"Plain{suffix}"
    opened = parquet.read_table(file) if suffix == ".parquet" else pa.ipc.open_file(file).read_all()
    schema = opened.schema
    assert schema.names[:2] == ["time_s", "time_ns"]
    assert schema.field("Scaled").metadata[b"unit"] == b"m/s"
    assert json.loads(schema.field("Gear").metadata[b"values"])["1"] == "first"
    assert schema.field("Count").type == pa.uint8()
    assert {b"version": b"1.2.3", b"message": b"Plain", b"channel": b"can0"}.items() <= (
        schema.metadata.items()
    )
    assert schema.metadata[b"comment"] == b"0x123 A plain message"


def test_a_folder_of_csv_has_no_empty_field_but_those_of_multiplexers(tmp_path):
    block, expected = recorded()
    write(folder(tmp_path / "o", ".csv"), DATABASE, [block])
    for message in {message for _, message, _ in expected}:
        with (tmp_path / "o" / f"{message}.csv").open() as file:
            rows = list(csv.DictReader(file))
        wanted = [(t_ns, values) for t_ns, name, values in expected if name == message]
        for row, (t_ns, values) in zip(rows, wanted, strict=True):
            assert row.pop("time_s") == f"{t_ns // 10**9}.{t_ns % 10**9:09d}"
            assert {name for name, text in row.items() if text} == values.keys()
            assert all(same(type(values[name])(row[name]), values[name]) for name in values)


# --- folders


MESSAGE = """VERSION ""
BU_: A
BO_ 256 M: 1 A
 SG_ time_s : 0|8@1+ (1,0) [0|0] "" A
BO_ 257 N: 1 A
 SG_ X : 0|8@1+ (1,0) [0|0] "" A
"""


def frames(*places):
    """A block of frames: (id, channel) each, a microsecond apart."""
    return Block.from_frames(
        [Frame(place, key, b"\7", bus) for place, (key, bus) in enumerate(places)]
    )


def names(path):
    return sorted(file.name for file in path.iterdir())


def test_a_message_of_several_buses_gets_a_file_for_each(tmp_path):
    known = from_text(MESSAGE)
    block = frames((256, "can0"), (256, "can/1"), (257, "can/1"), (256, "can0"))
    write(folder(tmp_path / "o"), known, [block, block.select(slice(0, 1))])
    assert names(tmp_path / "o") == [
        "M.can0.parquet",
        "M.can_1.parquet",
        "N.parquet",
        "convert.json",
    ]
    found = tables(tmp_path / "o")
    # A signal that is called as a time column is has its message's name in front of it.
    assert [row["M.time_s"] for row in found["M.can0"]] == [7, 7, 7]
    assert [row["time_ns"] for row in found["M.can0"]] == [0, 3000, 0]
    assert [row["time_ns"] for row in found["N"]] == [2000]
    meta = parquet.read_schema(tmp_path / "o" / "M.can_1.parquet").metadata
    assert meta[b"channel"] == b"can/1"


def test_names_that_differ_in_case_alone_are_two_files(tmp_path):
    known = from_text(MESSAGE.replace("257 N", "257 m"))
    write(folder(tmp_path / "o"), known, [frames((256, "a"), (257, "a"))])
    assert names(tmp_path / "o") == ["M.parquet", "convert.json", "m-2.parquet"]


def test_a_second_run_leaves_no_file_of_the_first_and_all_of_others(tmp_path):
    known, path = from_text(MESSAGE), tmp_path / "o"
    path.mkdir()
    write(folder(path), known, [frames((256, "a"), (257, "a"))])
    (path / "notes.txt").write_text("mine")
    assert names(path) == ["M.parquet", "N.parquet", "convert.json", "notes.txt"]
    write(folder(path, ".arrow"), known, [frames((257, "a"))])
    assert names(path) == ["N.arrow", "convert.json", "notes.txt"]


@pytest.mark.parametrize("is_new", [True, False])
def test_a_run_that_fails_keeps_the_files_of_the_one_before(tmp_path, is_new):
    known, path = from_text(MESSAGE), tmp_path / "o"
    if not is_new:
        write(folder(path), known, [frames((256, "a"))])
        before = {file.name: file.read_bytes() for file in path.iterdir()}
    with pytest.raises(KeyboardInterrupt):
        write(folder(path), known, [frames((256, "a"), (257, "a"))], fail=True)
    if is_new:
        assert not path.exists()
    else:
        assert {file.name: file.read_bytes() for file in path.iterdir()} == before


def test_a_run_that_is_stopped_between_two_names_is_fixed_by_the_next(tmp_path, monkeypatch):
    known, path = from_text(MESSAGE), tmp_path / "o"
    whole = Path.replace

    def stop(self, target):
        if Path(target).name == "N.parquet":
            raise KeyboardInterrupt
        return whole(self, target)

    with monkeypatch.context() as patch:
        patch.setattr(Path, "replace", stop)
        with pytest.raises(KeyboardInterrupt):
            write(folder(path), known, [frames((256, "a"), (257, "a"))])
    write(folder(path), known, [frames((257, "a"))])
    assert names(path) == ["N.parquet", "convert.json"]


def test_a_folder_of_others_is_refused(tmp_path):
    (tmp_path / "mine.parquet").write_text("mine")
    with pytest.raises(InputError, match="contains files that convert did not write"):
        parse_target(f"{tmp_path}/", "--out")
    (tmp_path / "convert.json").write_text('{"files": 1}')
    with pytest.raises(
        InputError, match=r"convert\.json.*is not a list of files written by convert"
    ):
        parse_target(f"{tmp_path}/", "--out")


def test_a_list_that_names_files_elsewhere_deletes_none_of_them(tmp_path):
    (tmp_path / "precious").write_text("x")
    path = tmp_path / "o"
    path.mkdir()
    (path / "convert.json").write_text('{"files": [{"file": "../precious"}, {"file": ".."}]}')
    write(folder(path), from_text(MESSAGE), [frames((256, "a"))])
    assert (tmp_path / "precious").read_text() == "x"


# --- Arrow in the long form


def test_the_dictionaries_of_arrow_grow_as_messages_turn_up(tmp_path):
    block, expected = recorded()
    parts = [block.select(slice(first, first + 97)) for first in range(0, 600, 97)]
    for suffix in (".arrow", ".arrows"):
        write(Target(tmp_path / f"a{suffix}", suffix), DATABASE, parts)
    rows = arrow_rows(tmp_path / "a.arrow")
    assert repr(rows) == repr(arrow_rows(tmp_path / "a.arrows"))
    assert len(rows) == sum(len(values) for _, _, values in expected)
    assert {row["unit"] for row in rows if row["signal"] == "Scaled"} == {"m/s"}
    assert names(tmp_path) == ["a.arrow", "a.arrows"]


def test_integers_that_a_float_does_not_hold_are_counted(tmp_path):
    known = from_text('VERSION ""\nBU_: A\nBO_ 256 M: 8 A\n SG_ X : 0|64@1+ (1,0) [0|0] "" A\n')
    numbers = (2**53, 2**53 + 1, 2**64 - 1, 5)
    block = Block.from_frames(
        [Frame(n, 256, value.to_bytes(8, "little")) for n, value in enumerate(numbers)]
    )
    problems = write(Target(tmp_path / "a.arrow", ".arrow"), known, [block])
    assert problems == [
        "2 integers beyond 2^53 are rounded to floats; the other formats have them exactly"
    ]
    assert [row["value"] for row in arrow_rows(tmp_path / "a.arrow")] == [float(n) for n in numbers]


# --- MCAP


def test_the_schemas_of_mcap(tmp_path):
    block, _ = recorded()
    write(Target(tmp_path / "a.mcap", ".mcap"), DATABASE, [block])
    with (tmp_path / "a.mcap").open("rb") as file:
        summary = make_reader(file).get_summary()
        (metadata,) = make_reader(file).iter_metadata()
    assert metadata.metadata == ORIGIN
    schemas = {schema.name: json.loads(schema.data) for schema in summary.schemas.values()}
    assert {schema.encoding for schema in summary.schemas.values()} == {"jsonschema"}
    assert {channel.message_encoding for channel in summary.channels.values()} == {"json"}
    assert schemas == json.loads(GOLDEN.read_text(encoding="utf-8"))
    assert {index.compression for index in summary.chunk_indexes} == {"zstd"}
    assert summary.statistics.message_start_time == block.t_ns[0]


def test_mcap_knows_no_time_before_1970(tmp_path):
    known = from_text(MESSAGE)
    block = Block.from_frames([Frame(-5, 256, b"\1", "can0")])
    problems = write(Target(tmp_path / "a.mcap", ".mcap"), known, [block])
    assert problems == ["2 stamps before 1970 are written as 1970"]


# --- names


@pytest.mark.parametrize(
    ("text", "form", "fix"),
    [
        ("a.feather", None, "it is called .arrow here"),
        ("a.mdf", None, "it is called .mf4 here"),
        ("a", None, "a/ for a folder with one file per message"),
        ("-", "csv", "stdout supports only arrow"),
        (
            "a.csv",
            "parquet",
            "a.csv/ is a folder with one file per message; for a single file, use the suffix",
        ),
    ],
)
def test_a_wrong_name_tells_the_right_one(tmp_path, monkeypatch, text, form, fix):
    monkeypatch.chdir(tmp_path)
    with pytest.raises(InputError, match=fix):
        parse_target(text, "--out", form)
