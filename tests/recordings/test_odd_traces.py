"""Vector's and PEAK's traces as other tools write them: each line beside what it means."""

import pytest

from adhesion_can.bus.frame import Frame
from adhesion_can.errors import RecordingError
from adhesion_can.recordings.recording import Recording

HEAD = (
    "date Mon Dec 31 04:20:30.951 pm 2018\nbase {} timestamps absolute\nno internal events logged\n"
)
SAID = "Length = 160000 BitCount = 84"
MANY = 40
"""Lines of a kind, with which they are read in columns."""


def asc(path, lines, base="hex"):
    path.write_text(HEAD.format(base) + "\n".join(lines) + "\n")
    return path


def read(path):
    """Frames and report, the same one by one and in blocks."""
    recording = Recording(path)
    frames = list(recording)
    blocks = Recording(path)
    assert [frame for block in blocks.blocks() for frame in block.items()] == frames
    assert blocks.report == recording.report
    return frames, recording.report


def frame(n, number, data, **others):
    return Frame(n * 10_000, number, data, "can0", **others)


@pytest.mark.parametrize("count", [3, MANY])
def test_the_id_at_the_end_counts_where_a_name_stands_in_its_place(tmp_path, count):
    names = ("WHEELS", "ED", "ACC", "120", "ADx")
    lines, wanted = [], []
    for n in range(count):
        lines.append(f"{n / 100:11.6f} 1  {names[n % 5]:15} Rx   d 2 {n:02X} 00  {SAID} ID = 288")
        wanted.append(frame(n, 0x120, bytes([n, 0])))
        lines.append(f"{n / 100:11.6f} 1  BIG             Tx   d 1 {n:02X}  {SAID} ID = 380261540x")
        wanted.append(frame(n, 0x16AA54A4, bytes([n]), is_extended=True))
    frames, report = read(asc(tmp_path / "a.asc", lines))
    assert frames == wanted
    assert report.passed_over == 0


def test_an_id_at_the_end_that_is_that_in_front_changes_nothing(tmp_path):
    lines = [
        f"{n / 100:11.6f} 1  657             Rx   d 2 {n:02X} 00  Length = 1 BitCount = 8 ID = 1623"
        for n in range(MANY)
    ]
    assert read(asc(tmp_path / "a.asc", lines))[0] == [
        frame(n, 0x657, bytes([n, 0])) for n in range(MANY)
    ]


def test_a_number_is_no_name_whatever_stands_at_the_end(tmp_path):
    lines = [
        f"{n / 100:11.6f} 3  200             Tx   d 1 {n:02X}  {SAID} ID = 88888888x"
        for n in range(3)
    ]
    frames, _ = read(asc(tmp_path / "a.asc", lines))
    assert [one.arbitration_id for one in frames] == [0x200] * 3


def test_decimal_ids_with_names(tmp_path):
    lines = [
        f"{n / 100:11.6f} 1  WHEELS Rx d 2 {n:03d} 255  Length = 1 BitCount = 8 ID = 288"
        for n in range(9)
    ]
    frames, _ = read(asc(tmp_path / "a.asc", lines, "dec"))
    assert frames == [frame(n, 288, bytes([n, 255])) for n in range(9)]


def test_names_without_an_id_are_told(tmp_path):
    lines = [f"{n / 100:11.6f} 1  WHEELS Rx d 1 00" for n in range(5)]
    lines.append(f"{0.05:11.6f} 1  120 Rx d 1 07")
    frames, report = read(asc(tmp_path / "a.asc", lines))
    assert frames == [frame(5, 0x120, b"\7")]
    assert report.passed_over == 5
    assert "5 lines with a name in place of the id: log ids as numbers" in report.notes


@pytest.mark.parametrize("count", [3, MANY])
@pytest.mark.parametrize(("code", "length"), [(9, 12), (10, 16), (13, 32), (15, 64)])
def test_can_fd_in_classic_lines_keeps_all_its_bytes(tmp_path, count, code, length):
    data = [bytes([n] * length) for n in range(count)]
    lines = [f"{n / 100:11.6f} 1 200 Rx d {code} {data[n].hex(' ').upper()}" for n in range(count)]
    lines[1:1] = [f"{0.0:11.6f} 1 120 Rx d 2 01 02"]
    frames, report = read(asc(tmp_path / "a.asc", lines))
    wanted = [frame(n, 0x200, data[n], is_fd=True) for n in range(count)]
    assert frames == [wanted[0], frame(0, 0x120, b"\1\2"), *wanted[1:]]
    assert report.passed_over == 0


@pytest.mark.parametrize("count", [3, MANY])
def test_stamps_below_0(tmp_path, count):
    lines = [f"{(n - 2) / 100:11.6f} 1  120 Rx d 1 {n:02X}" for n in range(count)]
    frames, report = read(asc(tmp_path / "a.asc", lines))
    assert frames == [frame(n - 2, 0x120, bytes([n])) for n in range(count)]
    assert (report.passed_over, report.backwards) == (0, 0)


# --- PEAK ----------------------------------------------------------------------------------------

START = ";$STARTTIME=43874.0\n"
START_US = 1_581_552_000 * 10**6


def trc(path, version, lines, columns=""):
    head = f";$FILEVERSION={version}\n{START}" + (f";$COLUMNS={columns}\n" if columns else "")
    path.write_text(head + "; a comment\n" + "\n".join(lines) + "\n")
    return path


@pytest.mark.parametrize("count", [3, MANY])
def test_version_1_2(tmp_path, count):
    ids = ["0120" if n % 3 else "16AA54A4" for n in range(count)]
    lines = [f"{n + 1:7})  {10.0 * n:10.1f} {n % 2 + 1}  Rx  {ids[n]}  2  {n:02X} 28"
             for n in range(count)]  # fmt: skip
    lines.append("     99)      9999.0  1  Error      0008  4  00 19 08 08")
    frames, _ = read(trc(tmp_path / "a.trc", "1.2", lines))
    assert frames == [
        Frame(START_US + n * 10_000, 0x120 if n % 3 else 0x16AA54A4, bytes([n, 0x28]),
              f"can{n % 2}", is_extended=n % 3 == 0)
        for n in range(count)
    ]  # fmt: skip


@pytest.mark.parametrize("count", [3, MANY])
@pytest.mark.parametrize("columns", ["O,T,I,l,D", "N,O,T,I,l,D", "N,O,T,B,I,l,D", "O,T,I,d,l,D"])
def test_columns_that_a_trace_may_lack(tmp_path, count, columns):
    fields = {"T": "DT", "B": "1", "I": "0120", "d": "Rx", "l": "2"}
    lines = []
    for n in range(count):
        row = fields | {"N": str(n + 1), "O": f"{10.0 * n:.3f}", "D": f"{n:02X} 28"}
        lines.append("  ".join(f"{row[column]:>6}" for column in columns.split(",")))
    frames, report = read(trc(tmp_path / "a.trc", "2.1", lines, columns))
    assert frames == [
        Frame(START_US + n * 10_000, 0x120, bytes([n, 0x28]), "can0") for n in range(count)
    ]
    assert report.passed_over == 0


@pytest.mark.parametrize("version", ["3.0", "2.2", "0.9"])
def test_a_version_that_is_not_read_is_named(tmp_path, version):
    path = trc(tmp_path / "a.trc", version, ["1  0.0 DT 0120 Rx 1 00"], "N,O,T,I,d,l,D")
    with pytest.raises(
        RecordingError, match=rf"version {version} of PEAK's format; supported: 1\.0"
    ):
        list(Recording(path).blocks())
