"""Stamps that run back for good: a new stretch, nothing lost, every step told."""

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from adhesion_can.bus.block import Block
from adhesion_can.bus.frame import Frame
from adhesion_can.cli.main import main
from adhesion_can.errors import RecordingError
from adhesion_can.recordings.candump import format_frame
from adhesion_can.recordings.drive_time import DriveTime, hole_us
from adhesion_can.recordings.problems import describe_problems
from adhesion_can.recordings.recording import Recording
from adhesion_can.recordings.sequence import blocks_in_sequence, open_recordings

MS, S = 1_000, 1_000_000
IDS = (0x101, 0x102, 0x111)
HOLE_US = hole_us(60.0)


def frames(from_us, count, step_us=10 * MS, channel="can0"):
    return [
        Frame(from_us + n * step_us, IDS[n % 3], bytes([n % 256]), channel) for n in range(count)
    ]


def written(path, items):
    path.write_text("".join(map(format_frame, items)))
    return path


def stamps(*paths, size=None):
    """Stamps of recordings in the time of the drive, µs, and what is said of them."""
    recordings = open_recordings(paths)
    if size is not None:
        for one in recordings:
            one.blocks = lambda _=0, one=one: pieces(one, size)
    blocks = list(blocks_in_sequence(recordings))
    assert [b.t_ns.tolist() for b in blocks if not len(b)] == []
    return np.concatenate([b.t_us for b in blocks]).tolist(), describe_problems(recordings)


def pieces(recording, size):
    for block in Recording.blocks(recording):
        for start in range(0, len(block), size):
            yield block.select(slice(start, start + size))


@pytest.mark.parametrize("size", [None, 1, 7, 33])
@pytest.mark.parametrize(
    ("name", "back_us"),
    [
        ("NTP", 3 * S),
        ("a little", 150 * MS),
        ("16-bit ms", 65_536 * MS),
        ("32-bit µs", 1 << 32),
        ("reboot", 1700 * 10**6 * S),
    ],
)
def test_a_step_back_begins_a_new_stretch(tmp_path, name, back_us, size):
    begin = 1_700_000_000 * S if back_us < 60 * S or name == "reboot" else 10_000 * S
    first = frames(begin, 100)
    second = frames(first[-1].t_us + 10 * MS - back_us, 100)
    assert second[0].t_us >= 0
    found, said = stamps(written(tmp_path / "a.log", [*first, *second]), size=size)
    moved = first[-1].t_us + HOLE_US - second[0].t_us
    assert found == [f.t_us for f in first] + [f.t_us + moved for f in second]
    (sentence,) = said
    stepped_s = (back_us - 10 * MS) / 1e6
    assert f"steps back 1 time (by {stepped_s:.3f} s at frame 101)" in sentence


def test_several_steps_are_all_told(tmp_path):
    parts = [frames(100 * S, 60) for _ in range(5)]
    found, said = stamps(written(tmp_path / "a.log", [f for part in parts for f in part]))
    assert all(b >= a for a, b in pairwise(found))
    assert sum(b - a == HOLE_US for a, b in pairwise(found)) == 4
    assert "steps back 4 times" in said[0]
    assert "at frame 181, .." in said[0]


@pytest.mark.parametrize("late", [1, 5, 19, 150])
def test_a_few_late_frames_are_no_new_stretch(tmp_path, late):
    items = frames(100 * S, 200)
    items[50:50] = frames(90 * S, late, step_us=0)
    found, said = stamps(written(tmp_path / "a.log", items))
    assert found == [f.t_us for f in items]
    assert said == [
        (
            "a.log: 1 frame stamped earlier than the previous frame, "
            "read with the time of the previous frame"
        )
    ]


def test_a_bus_that_comes_in_later_than_another_is_no_step(tmp_path):
    """A logger that empties the buffers of two buses in turn: no message ever runs back."""
    items = []
    for turn in range(20):
        for channel in ("can0", "can1"):
            items += frames(100 * S + turn * S, 100, channel=channel)
    found, _ = stamps(written(tmp_path / "a.log", items))
    assert found == [f.t_us for f in items]


def test_newest_first_is_an_error(tmp_path):
    path = written(tmp_path / "a.log", frames(100 * S, 300)[::-1])
    with pytest.raises(
        RecordingError, match=r"newest first; reverse the lines, for example with 'tac'"
    ):
        list(blocks_in_sequence(open_recordings([path])))


def test_a_step_near_the_end_of_the_file(tmp_path):
    items = [*frames(100 * S, 100), *frames(10 * S, 8)]
    found, said = stamps(written(tmp_path / "a.log", items))
    assert found[-8] - found[-9] == HOLE_US
    assert "at frame 101" in said[0]


@settings(max_examples=60, deadline=None)
@given(
    lengths=st.lists(st.integers(220, 260), min_size=1, max_size=4),
    begins=st.lists(st.integers(0, 10**9), min_size=5, max_size=5),
    size=st.integers(10, 300),
)
def test_every_frame_is_kept_in_its_order(tmp_path_factory, lengths, begins, size):
    path = tmp_path_factory.mktemp("d") / "a.log"
    items = [f for at, n in zip(begins, lengths, strict=False) for f in frames(at * MS, n)]
    recording = Recording(written(path, items))
    blocks = list(DriveTime(60.0).blocks(recording, pieces(recording, size)))
    assert sum(map(len, blocks)) == len(items)
    joined = Block.concatenate(blocks)
    assert [f.data for f in joined.items()] == [f.data for f in items]
    last = np.maximum.accumulate(joined.t_us)
    assert (joined.t_us >= last - 100 * MS).all()


# --- dates in the heads of .asc files ------------------------------------------------------------


def asc(path, clock, stamps_s):
    lines = [f"date Mon Dec 31 {clock} 2018", "base hex  timestamps absolute",
             "no internal events logged"]  # fmt: skip
    lines += [f"{t:11.6f} 1  101             Rx   d 2 {n:02X} 00" for n, t in enumerate(stamps_s)]
    path.write_text("\n".join(lines) + "\n")
    return path


def test_asc_files_follow_each_other_by_their_dates(tmp_path):
    a = asc(tmp_path / "a.asc", "04:20:30.951 pm", [0.01, 0.02, 5.02])
    b = asc(tmp_path / "b.asc", "04:40:30.951 pm", [0.01, 0.02])
    assert stamps(a, b) == ([10_000, 20_000, 5_020_000, 1_200_010_000, 1_200_020_000], [])
    with pytest.raises(RecordingError, match="starts before"):
        stamps(b, a)


@pytest.mark.parametrize(
    ("clock", "later_s"),
    [("16:20:30", -0.951), ("04:20:31.951 PM", 1.0), ("05:20:30.951 pm", 3600.0)],
)
def test_forms_of_the_date(tmp_path, clock, later_s):
    a = Recording(asc(tmp_path / "a.asc", "04:20:30.951 pm", [0.01]))
    b = Recording(asc(tmp_path / "b.asc", clock, [0.01]))
    assert b.head_date_us - a.head_date_us == round(later_s * 1e6)


def test_a_file_without_a_date_has_none(tmp_path):
    path = tmp_path / "a.asc"
    path.write_text("base hex  timestamps absolute\n   0.01 1  101 Rx   d 1 00\n")
    assert Recording(path).head_date_us is None
    assert Recording(written(tmp_path / "a.log", frames(0, 3))).head_date_us is None


def test_stamps_below_0_are_moved_for_a_drive_alone(tmp_path):
    path = asc(tmp_path / "a.asc", "04:20:30.951 pm", [-0.02, -0.01, 0.0, 0.01])
    found, said = stamps(path)
    assert found == [0, 10_000, 20_000, 30_000]
    assert said == ["a.asc: stamps start at -0.020 s and are shifted to 0"]
    blocks = list(Recording(path).blocks())
    assert blocks[0].t_us.tolist() == [-20_000, -10_000, 0, 10_000]


# --- commands ------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def drives(tmp_path_factory):
    """A drive, and the same with the clock set back in the middle."""
    folder = tmp_path_factory.mktemp("drives")
    words = ["simulate", "--scenario", "dry", "--duration", "4", "--log", str(folder / "a.log")]
    assert main(words) == 0
    lines = (folder / "a.log").read_text().splitlines(keepends=True)
    half = len(lines) // 2
    back = [f"({float(x[1:].split(')')[0]) - 3.0:.6f}){x.split(')', 1)[1]}" for x in lines[half:]]
    # Both on a clock of today, so that no stamp is below 0.
    whole = [f"({float(x[1:].split(')')[0]) + 1000:.6f}){x.split(')', 1)[1]}" for x in lines]
    back = [f"({float(x[1:].split(')')[0]) + 1000:.6f}){x.split(')', 1)[1]}" for x in back]
    (folder / "whole.log").write_text("".join(whole))
    (folder / "back.log").write_text("".join([*whole[:half], *back]))
    return folder


@pytest.mark.costly
def test_no_half_of_a_drive_is_lost(drives, tmp_path, capsys):
    rows = {}
    for name in ("whole", "back"):
        log, out = str(drives / f"{name}.log"), tmp_path / f"{name}.csv"
        assert main(["replay", log, "--table", str(out)]) == 0
        rows[name] = len(out.read_text().splitlines())
        said = capsys.readouterr().out
        assert ("steps back 1 time" in said) is (name == "back")
        assert "stamped earlier" not in said
    assert rows["back"] == pytest.approx(rows["whole"], abs=4)


def test_check_says_it_as_a_warning(drives, capsys):
    assert main(["check", str(drives / "back.log")]) == 0
    said = capsys.readouterr().out
    assert "WARNING: back.log: the clock steps back 1 time" in said
    assert "no frames for" not in said


@pytest.mark.parametrize("suffix", [".csv", ".mf4"])
def test_convert_gives_a_time_that_runs_forward(drives, tmp_path, suffix):
    if suffix == ".mf4":
        pytest.importorskip("asammdf")
    out = tmp_path / f"o{suffix}"
    words = ["--raster", "10ms"] if suffix == ".csv" else []
    assert main(["convert", str(drives / "back.log"), "--out", str(out), *words]) == 0
    if suffix == ".csv":
        times = [float(line.split(",")[0]) for line in out.read_text().splitlines()[1:]]
        assert all(b > a for a, b in pairwise(times))
        assert times[-1] - times[0] == pytest.approx(4 + 61, abs=1)
