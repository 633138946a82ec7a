"""Recordings of every format, their faults, and files that appear whole or not at all."""

import contextlib
import gc
import gzip
import logging
import os
import random
import sqlite3
import stat
import threading
from itertools import pairwise
from pathlib import Path

import can
import pytest

from adhesion_can.bus.block import Block
from adhesion_can.bus.frame import Frame, Mark
from adhesion_can.errors import AdhesionCanError, InputError, RecordingError
from adhesion_can.files import whole_file
from adhesion_can.input_files import file_sha256
from adhesion_can.recordings import python_can_readers
from adhesion_can.recordings import recording as recordings
from adhesion_can.recordings.candump import format_frame
from adhesion_can.recordings.python_can_messages import from_message, to_message
from adhesion_can.recordings.recording import Recording

T = 1_700_000_000_123_456
# python-can's readers leave their file open where their constructor raises.
LEAVES_FILES_OPEN = pytest.mark.filterwarnings("ignore::ResourceWarning")
SUFFIXES = (".asc", ".blf", ".trc", ".csv", ".db")
KNOWS_CHANNEL = (".asc", ".blf", ".trc")
KNOWS_ALL_KINDS = (".asc", ".blf", ".csv", ".db")


def plain_frames(count=60):
    """Data frames of both id lengths and every size, on two channels."""
    rng = random.Random(7)
    return [
        Frame(
            T + i * 10_000 + rng.randrange(2000),
            rng.randrange(0x800) if i % 3 else rng.randrange(0x800, 1 << 29),
            rng.randbytes(i % 9),
            f"can{i % 2}",
            i % 3 == 0,
        )
        for i in range(count)
    ]


OTHER_KINDS = [
    Frame(T + 700_000, 0x123, b"", "can0", is_remote=True),
    Frame(T + 710_000, 0x12345678, b"", "can0", True, is_remote=True),
    Frame(T + 720_000, 0x80, b"", "can0", is_error=True),
]


def message_of(frame):
    """python-can's message, made here and not by the package."""
    return can.Message(
        timestamp=frame.t_us / 1e6,
        arbitration_id=frame.arbitration_id,
        data=frame.data or None,
        channel=frame.channel,
        is_extended_id=frame.is_extended,
        is_fd=frame.is_fd,
        is_remote_frame=frame.is_remote,
        is_error_frame=frame.is_error,
        check=not frame.is_error,
    )


def written(path, frames):
    if path.suffix == ".log":
        path.write_text("".join(map(format_frame, frames)))
        return path
    with can.Logger(path) as writer:
        for frame in frames:
            writer(message_of(frame))
    return path


def relative(frames, *, channel):
    """Frames with stamps from the first one on; formats differ in where they start."""
    start = frames[0].t_us
    return [
        f._replace(
            t_us=f.t_us - start,
            channel=f.channel if channel else "",
            # What an error frame says differs: none of it is ours.
            arbitration_id=0 if f.is_error else f.arbitration_id,
            is_extended=True if f.is_error else f.is_extended,
        )
        for f in frames
    ]


def assert_same_frames(found, wanted):
    assert [f._replace(t_us=0) for f in found] == [f._replace(t_us=0) for f in wanted]
    for a, b in zip(found, wanted, strict=True):
        assert abs(a.t_us - b.t_us) <= 1, "a microsecond"


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_every_format_equals_the_candump_reading(tmp_path, suffix):
    frames = plain_frames() + (OTHER_KINDS if suffix in KNOWS_ALL_KINDS else [])
    candump = list(Recording(written(tmp_path / "a.log", frames)))
    assert candump == frames
    found = list(Recording(written(tmp_path / f"a{suffix}", frames)))
    assert_same_frames(relative(found, channel=False), relative(candump, channel=False))


@pytest.mark.parametrize("suffix", KNOWS_CHANNEL)
def test_formats_with_channels_name_them_as_candump_does(tmp_path, suffix):
    frames = plain_frames()
    found = list(Recording(written(tmp_path / f"a{suffix}", frames)))
    assert [f.channel for f in found] == [f.channel for f in frames]


@pytest.mark.parametrize("suffix", [".csv", ".db"])
def test_formats_without_channels_leave_them_open(tmp_path, suffix):
    found = list(Recording(written(tmp_path / f"a{suffix}", plain_frames())))
    assert {f.channel for f in found} == {""}


@pytest.mark.parametrize("suffix", [".blf", ".csv", ".db"])
def test_absolute_stamps_are_kept(tmp_path, suffix):
    (found, *_) = Recording(written(tmp_path / f"a{suffix}", plain_frames()))
    assert abs(found.t_us - plain_frames()[0].t_us) <= 1


@pytest.mark.parametrize("suffix", [".asc", ".blf"])
def test_fd_frames_survive(tmp_path, suffix):
    frames = [
        Frame(T + i * 1000, 0x100 + i, bytes(range(size)), "can0", is_fd=True)
        for i, size in enumerate((1, 8, 12, 64))  # python-can's .asc takes 0 bytes for remote
    ]
    found = list(Recording(written(tmp_path / f"fd{suffix}", frames)))
    assert_same_frames(relative(found, channel=True), relative(frames, channel=True))


@pytest.mark.parametrize("suffix", [".log", *KNOWS_ALL_KINDS])
def test_the_report_counts_by_kind_in_every_format(tmp_path, suffix):
    recording = Recording(written(tmp_path / f"a{suffix}", plain_frames(10) + OTHER_KINDS))
    assert len(list(recording)) == 13
    assert recording.report.kinds == {"frame": 10, "remote": 2, "error": 1}
    assert recording.report.backwards == 0
    assert recording.report.passed_over == 0


@pytest.mark.parametrize("suffix", [".asc", ".blf", ".csv", ".trc"])
def test_formats_other_than_candump_may_be_packed(tmp_path, suffix):
    frames = plain_frames(20)
    plain = written(tmp_path / f"a{suffix}", frames)
    packed = tmp_path / f"a{suffix}.gz"
    packed.write_bytes(gzip.compress(plain.read_bytes()))
    assert list(Recording(packed)) == list(Recording(plain))


@LEAVES_FILES_OPEN
@pytest.mark.usefixtures("collected")
def test_a_packed_database_is_an_error_with_a_fix(tmp_path):
    plain = written(tmp_path / "a.db", plain_frames(5))
    packed = tmp_path / "a.db.gz"
    packed.write_bytes(gzip.compress(plain.read_bytes()))
    with pytest.raises(RecordingError) as error:
        list(Recording(packed))
    assert_one_line(error.value, packed.name)


def test_stamps_backwards_are_counted_in_every_format(tmp_path):
    frames = plain_frames(4)
    frames[2] = frames[2]._replace(t_us=T - 5_000_000)
    for suffix in (".log", ".csv", ".db"):
        recording = Recording(written(tmp_path / f"a{suffix}", frames))
        assert len(list(recording)) == 4
        assert recording.report.backwards == 1, suffix


# --- blocks --------------------------------------------------------------------------------------


def items_of(recording):
    return [item for block in recording.blocks() for item in block.items()]


@pytest.mark.parametrize("rows", [7, 50_000])
@pytest.mark.parametrize("packed", [False, True])
@pytest.mark.parametrize("suffix", [".log", *SUFFIXES])
def test_blocks_hold_what_the_frames_one_by_one_are(tmp_path, monkeypatch, suffix, packed, rows):
    monkeypatch.setattr(recordings, "_ROWS", rows)
    frames = plain_frames() + (OTHER_KINDS if suffix in (".log", *KNOWS_ALL_KINDS) else [])
    path = written(tmp_path / f"a{suffix}", frames)
    if packed:
        if suffix == ".db":
            pytest.skip("python-can reads no packed data base")
        plain, path = path, tmp_path / f"a{suffix}.gz"
        path.write_bytes(gzip.compress(plain.read_bytes()))
    one_by_one, columns = Recording(path), Recording(path)
    wanted, blocks = list(one_by_one), list(columns.blocks())
    by_rows = suffix in (".csv", ".db")
    assert [item for block in blocks for item in block.items()] == wanted
    assert columns.report == one_by_one.report
    assert len(blocks) == (-(-len(wanted) // rows) if by_rows else 1)
    for one, following in pairwise(blocks):
        assert following.channels[: len(one.channels)] == one.channels
    assert list(Block.concatenate(blocks).items()) == wanted
    assert columns.position == columns.size


@pytest.mark.parametrize("suffix", [".asc", ".blf", ".csv", ".trc", ".csv.gz"])
def test_position_of_other_formats_grows(tmp_path, monkeypatch, suffix):
    monkeypatch.setattr(recordings, "_ROWS", 500)
    monkeypatch.setattr(recordings, "_CHUNK", 1 << 14)
    frames = [f._replace(t_us=T + 1000 * i) for i, f in enumerate(plain_frames(20_000))]
    path = written(tmp_path / f"a{suffix.removesuffix('.gz')}", frames)
    if suffix.endswith(".gz"):
        plain, path = path, tmp_path / f"a{suffix}"
        path.write_bytes(gzip.compress(plain.read_bytes()))
    recording = Recording(path)
    seen = [recording.position for _ in recording.blocks(1 << 14)]
    assert len(seen) == 40 if "csv" in suffix else len(seen) >= 4
    assert seen == sorted(seen)
    assert len(set(seen)) > 2
    assert 0 < seen[0] < seen[-1] <= recording.position == recording.size


@pytest.mark.costly
def test_mf4_gives_blocks(tmp_path):
    pytest.importorskip("asammdf")
    path = tmp_path / "a.mf4"
    frames = [
        Frame(T + 1000 * i, 0x100 + i, bytes([i] * 8), f"can{i % 2}", i % 3 == 0) for i in range(50)
    ]
    with can.Logger(path) as writer:
        for frame in frames:
            writer(message_of(frame))
    recording = Recording(path)
    found = items_of(recording)
    assert found == list(Recording(path))
    assert_same_frames(found, frames)
    assert recording.position == recording.size


@pytest.mark.parametrize("rows", [4, 10, 50_000])
def test_blocks_of_what_came_before_the_damage_are_given(tmp_path, monkeypatch, rows):
    monkeypatch.setattr(recordings, "_ROWS", rows)
    whole = written(tmp_path / "a.csv", plain_frames(20))
    lines = whole.read_text().splitlines()
    lines[11] = "what,is,this"
    whole.write_text("\n".join(lines))
    recording = Recording(whole)
    found = []

    def read():
        for block in recording.blocks():
            found.extend(block.items())

    with pytest.raises(RecordingError) as error:
        read()
    assert len(found) == 10
    assert_one_line(error.value, "a.csv", "10 frames")
    assert recording.report.kinds["frame"] == 10


@pytest.mark.parametrize("content", [b"", b"\n", b"# nothing\n\r\n"])
def test_an_empty_file_has_no_blocks(tmp_path, content):
    path = tmp_path / "a.log"
    path.write_bytes(content)
    assert list(Recording(path).blocks()) == []


def test_zstd_around_another_format_is_an_error_with_a_fix(tmp_path):
    zstandard = pytest.importorskip("zstandard")
    path = tmp_path / "a.csv.zst"
    path.write_bytes(zstandard.compress(b"timestamp,arbitration_id\n"))
    with pytest.raises(RecordingError) as error:
        Recording(path)
    assert_one_line(error.value, "a.csv.zst", "zstd -d")


# --- candump text under other names --------------------------------------------------------------


@pytest.mark.parametrize(
    "name", ["a.log", "a.txt", "a", "a.candump", "a.log.1", "2024.05.01", "x.LOG"]
)
def test_candump_text_is_known_by_its_lines(tmp_path, name):
    path = tmp_path / name
    path.write_text("".join(map(format_frame, plain_frames(5))))
    assert list(Recording(path)) == plain_frames(5)


def test_an_empty_file_is_an_empty_recording(tmp_path):
    for name in ("a.log", "a.txt", "a"):
        path = tmp_path / name
        path.write_bytes(b"")
        recording = Recording(path)
        assert list(recording) == []
        assert recording.report.kinds == {}


def test_a_log_of_garbage_is_counted_and_gives_nothing(tmp_path):
    path = tmp_path / "a.log"
    path.write_bytes(random.Random(1).randbytes(5000))
    recording = Recording(path)
    assert list(recording) == []
    kinds = recording.report.kinds
    assert recording.report.passed_over == kinds.total() - kinds["comment"] - kinds["blank"] > 5


def test_a_line_longer_than_the_limit_is_split_not_swallowed(tmp_path):
    path = tmp_path / "a.log"
    good = plain_frames(2)
    path.write_bytes(
        format_frame(good[0]).encode() + b"\x00" * 200_000 + b"\n" + format_frame(good[1]).encode()
    )
    recording = Recording(path)
    assert list(recording) == good
    assert recording.report.kinds["malformed"] + recording.report.kinds["cut"] >= 1


def test_a_recording_can_be_read_twice(tmp_path):
    path = written(tmp_path / "a.log", plain_frames(5))
    recording = Recording(path)
    assert list(recording) == list(recording)
    assert recording.size == path.stat().st_size
    assert recording.sha256 == file_sha256(path)


# --- what cannot be read -------------------------------------------------------------------------


def assert_one_line(error, *parts):
    text = str(error)
    assert "\n" not in text
    assert "\r" not in text
    assert len(text) < 400
    assert "; " in text, "the fix stands behind a semicolon"
    for part in parts:
        assert part in text


def test_a_missing_file_is_named(tmp_path):
    with pytest.raises(RecordingError) as error:
        Recording(tmp_path / "nowhere.log")
    assert_one_line(error.value, "nowhere.log", "No such file")


def test_a_folder_is_not_a_recording(tmp_path):
    with pytest.raises(RecordingError) as error:
        Recording(tmp_path)
    assert_one_line(error.value, tmp_path.name)


@pytest.mark.parametrize("name", ["a.pcap", "a.bin", "a.mat", "a.json.gz", "a.xlsx"])
def test_a_wrong_suffix_is_an_error_with_a_fix(tmp_path, name):
    path = tmp_path / name
    path.write_bytes(b"\x01\x02 something else\n" * 10)
    with pytest.raises(RecordingError) as error:
        list(Recording(path))
    assert_one_line(error.value, name, "candump")


@LEAVES_FILES_OPEN
@pytest.mark.usefixtures("collected")
@pytest.mark.parametrize("suffix", SUFFIXES)
def test_another_format_under_this_suffix_is_an_error_or_empty(tmp_path, suffix):
    path = tmp_path / f"a{suffix}"
    path.write_bytes(b"This is no recording at all.\nNor is this.\n" * 20)
    try:
        assert list(Recording(path)) == []
    except RecordingError as error:
        assert_one_line(error, path.name)


def damaged(content, rng, way):
    content = bytearray(content)
    if way == "cut":
        return content[: rng.randrange(1, len(content))]
    if way == "flipped":
        for _ in range(4):
            content[rng.randrange(len(content))] ^= rng.randrange(1, 256)
        return content
    if way == "hole":
        first = rng.randrange(len(content))
        del content[first : first + rng.randrange(1, 60)]
        return content
    return bytearray(rng.randbytes(rng.randrange(1, 600)))


@pytest.fixture
def collected():
    """What a test left open is closed before the next one begins."""
    yield
    gc.collect()


def check_damage(tmp_path, suffix, way, times):
    whole = written(tmp_path / f"whole{suffix}", plain_frames(20)).read_bytes()
    rng = random.Random(f"{suffix} {way}")
    raised = {}
    for i in range(times):
        path = tmp_path / f"bad{i}{suffix}"
        path.write_bytes(damaged(whole, rng, way))
        try:
            for frame in Recording(path):
                assert isinstance(frame, Frame)
        except AdhesionCanError as error:
            assert_one_line(error, path.name)
        except Exception as error:  # noqa: BLE001  whatever it is, it must not come out
            raised.setdefault(f"{type(error).__module__}.{type(error).__name__}", str(error)[:80])
            del error
        path.unlink()
    assert not raised, "only our own errors may come out"


@pytest.mark.costly
@pytest.mark.filterwarnings(
    "ignore::ResourceWarning", "ignore::pytest.PytestUnraisableExceptionWarning"
)
@pytest.mark.parametrize("way", ["cut", "flipped", "hole", "noise"])
@pytest.mark.parametrize("suffix", SUFFIXES)
@pytest.mark.usefixtures("collected")
def test_a_damaged_file_raises_our_own_error_alone(tmp_path, suffix, way):
    check_damage(tmp_path, suffix, way, 12)


@pytest.mark.slow
@pytest.mark.filterwarnings(
    "ignore::ResourceWarning", "ignore::pytest.PytestUnraisableExceptionWarning"
)
@pytest.mark.parametrize("way", ["cut", "flipped", "hole", "noise"])
@pytest.mark.parametrize("suffix", SUFFIXES)
@pytest.mark.usefixtures("collected")
def test_a_damaged_file_raises_our_own_error_alone_at_length(tmp_path, suffix, way):
    check_damage(tmp_path, suffix, way, 400)


def test_what_came_before_the_damage_is_kept(tmp_path):
    whole = written(tmp_path / "a.csv", plain_frames(20))
    lines = whole.read_text().splitlines()
    lines[11] = "what,is,this"
    whole.write_text("\n".join(lines))
    recording = Recording(whole)
    found = []

    def read():
        for frame in recording:
            found.append(frame)  # noqa: PERF402  a list would lose them with the exception

    with pytest.raises(RecordingError) as error:
        read()
    assert len(found) == 10
    assert_one_line(error.value, "a.csv", "10 frames")
    assert recording.report.kinds["frame"] == 10


@pytest.mark.parametrize("stamp", ["nan", "inf", "-inf", "1e400"])
def test_a_stamp_that_is_no_number_raises_our_own_error(tmp_path, stamp):
    path = tmp_path / "a.csv"
    path.write_text(
        f"timestamp,arbitration_id,extended,remote,error,dlc,data\n{stamp},0x123,0,0,0,1,/w==\n"
    )
    with pytest.raises(RecordingError) as error:
        list(Recording(path))
    assert_one_line(error.value, "a.csv")


@LEAVES_FILES_OPEN
@pytest.mark.usefixtures("collected")
def test_a_database_without_the_table_is_our_own_error(tmp_path):
    path = tmp_path / "a.db"
    with sqlite3.connect(path) as connection:
        connection.execute("CREATE TABLE other (x)")
    connection.close()
    with pytest.raises(RecordingError) as error:
        list(Recording(path))
    assert_one_line(error.value, "a.db")


@LEAVES_FILES_OPEN
@pytest.mark.usefixtures("collected")
def test_mf4_without_asammdf_names_the_extra(tmp_path):
    pytest.importorskip("can.io.mf4")
    try:
        import asammdf  # noqa: F401
    except ImportError:
        pass
    else:
        pytest.skip("asammdf is installed")
    path = tmp_path / "a.mf4"
    path.write_bytes(b"MDF     4.10    " + bytes(100))
    with pytest.raises(RecordingError) as error:
        list(Recording(path))
    assert_one_line(error.value, "a.mf4", "adhesion-can[mf4]")


# --- messages ------------------------------------------------------------------------------------


def test_frames_go_to_python_can_and_back():
    for frame in plain_frames(20):
        message = to_message(frame)
        message.channel = frame.channel
        assert from_message(message) == frame


@pytest.mark.parametrize(
    ("channel", "name"), [(0, "can0"), (3, "can3"), ("vcan0", "vcan0"), ("1", "can1"), (None, "")]
)
def test_channels_have_names(channel, name):
    message = can.Message(timestamp=1.0, arbitration_id=1, channel=channel)
    assert from_message(message).channel == name


@pytest.mark.parametrize("micros", [0, 1, 999_999, T, 2_147_483_648_000_001, 4_102_444_800_999_999])
def test_seconds_come_back_as_the_same_microseconds(micros):
    assert from_message(can.Message(timestamp=micros / 1e6, arbitration_id=1)).t_us == micros


# --- whole files ---------------------------------------------------------------------------------


class BrokenError(Exception):
    """Raised by the tests alone."""


@pytest.mark.parametrize("name", ["a.txt", "a.log.gz", "a.gz"])
@pytest.mark.parametrize("mode", ["w", "wb"])
def test_a_whole_file_holds_what_was_written(tmp_path, name, mode):
    path = tmp_path / name
    text = "Größe λ\r\n" * 1000
    with whole_file(path, mode) as file:
        assert not path.exists()
        file.write(text if mode == "w" else text.encode())
    content = path.read_bytes()
    assert (gzip.decompress(content) if name.endswith("gz") else content) == text.encode()
    assert [p.name for p in tmp_path.iterdir()] == [name]


@pytest.mark.costly
@pytest.mark.parametrize("name", ["a.txt", "a.log.gz"])
@pytest.mark.parametrize("mode", ["w", "wb"])
@pytest.mark.parametrize("kind", [BrokenError, KeyboardInterrupt, SystemExit])
def test_an_exception_leaves_nothing_behind(tmp_path, name, mode, kind):
    def write():
        with whole_file(tmp_path / name, mode) as file:
            file.write("half" * 10_000 if mode == "w" else b"half" * 10_000)
            raise kind

    with pytest.raises(kind):
        write()
    gc.collect()
    assert list(tmp_path.iterdir()) == []


def test_an_exception_leaves_the_old_file_as_it_was(tmp_path):
    path = tmp_path / "a.csv"
    path.write_text("old")

    def write():
        with whole_file(path) as file:
            file.write("new")
            raise BrokenError

    with pytest.raises(BrokenError):
        write()
    assert path.read_text() == "old"
    with whole_file(path) as file:
        file.write("new")
    assert path.read_text() == "new"
    assert list(tmp_path.iterdir()) == [path]


@pytest.mark.parametrize("mode", ["w", "wb"])
def test_a_pipe_is_written_to_and_stays_one(tmp_path, mode):
    path = tmp_path / "pipe.csv"
    os.mkfifo(path)
    read = []
    reader = threading.Thread(target=lambda: read.append(path.read_bytes()), daemon=True)
    reader.start()
    with whole_file(path, mode) as file:
        file.write("λ" if mode == "w" else "λ".encode())
    reader.join(60)
    assert read == ["λ".encode()]
    assert path.is_fifo()
    assert list(tmp_path.iterdir()) == [path]


def test_an_exception_does_not_take_a_pipe_away(tmp_path):
    path = tmp_path / "pipe.csv"
    os.mkfifo(path)
    reader = os.open(path, os.O_RDONLY | os.O_NONBLOCK)
    with pytest.raises(BrokenError), whole_file(path):
        raise BrokenError
    os.close(reader)
    assert path.is_fifo()


@pytest.mark.skipif(os.geteuid() != 0, reason="to make a device needs root")
def test_a_device_stays_one(tmp_path):
    """A file in its place would take the machine's /dev/null away from all others."""
    path = tmp_path / "null"
    try:
        os.mknod(path, 0o666 | stat.S_IFCHR, os.makedev(1, 3))
        path.write_bytes(b"")
    except OSError as error:
        pytest.skip(f"no device can be made and opened here ({error})")
    with whole_file(path) as file:
        file.write("x")
    assert path.is_char_device()
    assert list(tmp_path.iterdir()) == [path]


def test_the_file_that_a_link_names_is_written(tmp_path):
    (folder := tmp_path / "runs").mkdir()
    path = tmp_path / "latest.csv"
    path.symlink_to(folder / "1.csv")
    for text in ("first", "second"):
        with whole_file(path) as file:
            file.write(text)
        assert (folder / "1.csv").read_text() == text
    assert path.is_symlink()
    assert [one.name for one in folder.iterdir()] == ["1.csv"]


def test_a_link_to_itself_gives_way_to_the_file(tmp_path):
    path = tmp_path / "a.csv"
    path.symlink_to(path)
    with whole_file(path) as file:
        file.write("x")
    assert path.read_text() == "x"


def test_a_missing_folder_is_an_error_with_a_fix(tmp_path):
    path = tmp_path / "none" / "a.csv"
    with pytest.raises(InputError) as error, whole_file(path) as file:
        file.write("x")
    assert_one_line(error.value, "a.csv")


def test_a_folder_in_the_place_of_the_file_is_our_own_error_and_leaves_nothing(tmp_path):
    path = tmp_path / "out.csv"
    path.mkdir()
    with pytest.raises(InputError) as error, whole_file(path) as file:
        file.write("x")
    assert_one_line(error.value, "out.csv")
    assert [p.name for p in tmp_path.iterdir()] == ["out.csv"]


def test_packed_output_does_not_depend_on_the_hour(tmp_path):
    path = tmp_path / "a.log.gz"
    contents = set()
    for _ in range(2):
        with whole_file(path) as file:
            file.write("same\n" * 100)
        contents.add(path.read_bytes())
    (content,) = contents
    assert content[4:8] == bytes(4), "RFC 1952: MTIME, 0 where no time stamp is available"


def test_a_packed_recording_written_by_us_reads_back(tmp_path):
    path = tmp_path / "a.log.gz"
    frames = plain_frames()
    with whole_file(path) as file:
        for frame in frames:
            file.write(format_frame(frame))
    found = list(Recording(path))
    assert found == frames
    assert not any(isinstance(item, Mark) for item in found)


@pytest.mark.parametrize(("length", "t_s", "what"), [(80, 1.0, "80 bytes"), (8, 1e13, "stamped")])
def test_a_frame_that_no_bus_carries_ends_the_reading_like_any_fault(
    length, t_s, what, tmp_path, monkeypatch
):
    path = tmp_path / "a.csv"
    path.write_text("timestamp,arbitration_id\n")
    messages = [
        can.Message(timestamp=1.0, arbitration_id=1, data=b"ab"),
        can.Message(timestamp=t_s, arbitration_id=1, data=bytes(length), is_fd=True, check=False),
    ]

    class Reader(list):
        def __enter__(self):
            return self

        def __exit__(self, *_):
            pass

    readers = {**python_can_readers._READERS, ".csv": (lambda _: Reader(messages), "rt")}
    monkeypatch.setattr(python_can_readers, "_READERS", readers)
    recording = Recording(path)
    given = []
    with pytest.raises(RecordingError, match=f"after 1 frames .*{what}"):
        given.extend(recording.blocks())
    for block in Recording(path).blocks():
        assert len(block) == 1
        break


# --- what a reader passes over -------------------------------------------------------------------


def read_both_ways(path):
    """A recording of the path, read in frames and in blocks, and what each reported."""
    by_frame, by_block = Recording(path), Recording(path)
    items = list(by_frame)
    assert [item for block in by_block.blocks() for item in block.items()] == items
    assert by_block.report == by_frame.report
    return items, by_frame.report


def test_lines_that_python_can_warns_of_are_reported_once(tmp_path, capfd):
    path = written(tmp_path / "a.trc", plain_frames(20))
    lines = path.read_text().splitlines()
    lines[-5:-5] = ["what", "and this", "and all of this here"]
    path.write_text("\n".join(lines))
    items, report = read_both_ways(path)
    assert len(items) == 20
    counted, logged = sorted(report.notes)
    assert logged.startswith("python-can reports 2 warnings")
    assert "'what'" in logged
    assert "3 of 23 lines" in counted  # of one of them it logs nothing
    assert not capfd.readouterr().err
    assert not logging.getLogger("can.io").handlers


def test_a_reader_that_is_left_early_tells_its_warnings_and_listens_no_more(tmp_path):
    path = written(tmp_path / "a.trc", plain_frames(20))
    lines = path.read_text().splitlines()
    lines[-19:-19] = ["x" * 1000]
    path.write_text("\n".join(lines))
    recording = Recording(path)
    frames = iter(recording)
    for _ in range(5):
        next(frames)
    logging.getLogger("can.interfaces").warning("of something else")
    frames.close()
    (note,) = recording.report.notes
    assert note.startswith("python-can reports a warning")
    assert len(note) < 200
    assert not logging.getLogger("can.io").handlers


@pytest.mark.parametrize("suffix", [*SUFFIXES, ".trc.gz", ".asc.gz"])
def test_whole_files_are_read_without_a_note(tmp_path, suffix):
    path = written(tmp_path / f"a{suffix}", plain_frames(20))
    assert read_both_ways(path)[1].notes == []


def test_a_blf_that_is_cut_is_reported(tmp_path):
    path = written(tmp_path / "a.blf", plain_frames(20_000))
    whole = path.read_bytes()
    path.write_bytes(whole[: len(whole) * 2 // 3])
    recording = Recording(path)
    with contextlib.suppress(RecordingError):
        list(recording)
    (note,) = recording.report.notes
    assert f"{len(whole) * 2 // 3} of the {len(whole)} bytes" in note


@pytest.mark.parametrize("packed", [False, True])
def test_an_asc_that_is_cut_is_reported(tmp_path, packed):
    path = written(tmp_path / "a.asc", plain_frames(20))
    lines = path.read_bytes().splitlines(keepends=True)
    path = tmp_path / ("b.asc.gz" if packed else "b.asc")
    text = b"".join(lines[:15])
    path.write_bytes(gzip.compress(text) if packed else text)
    items, report = read_both_ways(path)
    assert 5 < len(items) < 20
    (note,) = report.notes
    assert "may be truncated" in note


# --- what is no file, and marks in front of text -------------------------------------------------


def test_a_pipe_is_reported_before_anything_waits_for_it(tmp_path):
    path = tmp_path / "a.log"
    os.mkfifo(path)
    with pytest.raises(RecordingError) as error:
        Recording(path)
    assert_one_line(error.value, "a.log", "is a pipe", "write it to a file first")
    ends = os.pipe()  # as a shell's <(..)
    try:
        with pytest.raises(RecordingError, match="is a pipe"):
            Recording(Path(f"/dev/fd/{ends[0]}"))
    finally:
        for end in ends:
            os.close(end)


@pytest.mark.parametrize("suffix", ["", ".gz"])
def test_a_byte_order_mark_is_no_part_of_the_first_line(tmp_path, suffix):
    frames = plain_frames(5)
    text = b"\xef\xbb\xbf" + "".join(map(format_frame, frames)).encode()
    path = tmp_path / f"a.log{suffix}"
    path.write_bytes(gzip.compress(text) if suffix else text)
    items, report = read_both_ways(path)
    assert items == frames
    assert report.kinds == {"frame": 5}
    named = tmp_path / "a.candump"  # known by its first line alone
    named.write_bytes(text[: text.index(b"\n") + 1])
    assert read_both_ways(named)[0] == frames[:1]


@pytest.mark.parametrize("suffix", [".log", ".log.gz"])
@pytest.mark.parametrize("size", [40, 1 << 20])
def test_comments_are_whole_lines_wherever_chunks_end(tmp_path, monkeypatch, suffix, size):
    frame = b"(1.000000) can0 123#00\n"
    comments = [b"# first\n", b"#second\n", b"#\n", b"# a longer one, longer than a chunk is\n"]
    text = comments[0] + comments[1] + 3 * frame + comments[2] + frame + comments[3] + frame
    path = tmp_path / f"a{suffix}"
    opened = gzip.open if suffix.endswith("gz") else open
    with opened(path, "wb") as file:
        file.write(text + b"# cut")
    monkeypatch.setattr(recordings, "_CHUNK", size)
    assert list(Recording(path).comments()) == comments


def test_other_formats_have_no_comments(tmp_path):
    path = tmp_path / "a.asc"
    written(path, plain_frames(3))
    assert list(Recording(path).comments()) == []
