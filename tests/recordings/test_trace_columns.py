"""Text traces (.asc, .trc) in columns: beside python-can's readers, and what they do not read."""

import gzip
import io
import random

import can
import pytest
from can.io.trc import TRCFileVersion
from hypothesis import given, settings
from hypothesis import strategies as st

from adhesion_can.bus.block import Block
from adhesion_can.errors import RecordingError
from adhesion_can.recordings.python_can_messages import from_message
from adhesion_can.recordings.recording import Recording
from adhesion_can.recordings.text_columns import parse as columns
from adhesion_can.recordings.text_columns.odd_lines import PythonCanLines

FLOAT_US = 1  # python-can's seconds in a float are 0.24 us apart, which may round the other way
READERS = {".asc": can.ASCReader, ".trc": can.TRCReader}


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("trace")


@pytest.fixture(params=[1, 24], ids=["eager", "usual"])
def few(request, monkeypatch):
    """Whether few lines are read in columns, too."""
    monkeypatch.setattr(columns, "_FEW", request.param)


def by_python_can(text, suffix):
    """Frames of python-can's reader, its buses numbered from 0 in both formats."""
    frames = []
    for message in READERS[suffix](io.StringIO(text, newline=None)):
        if suffix == ".trc":
            message.channel -= 1
        frames.append(from_message(message))
    return list(Block.from_frames(frames).items())


def read(folder, text, suffix, size=4 << 20):
    path = folder / f"a{suffix}"
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    recording = Recording(path)
    return [item for block in recording.blocks(size) for item in block.items()], recording.report


def assert_alike(found, wanted):
    assert [f._replace(t_us=0) for f in found] == [f._replace(t_us=0) for f in wanted]
    for a, b in zip(found, wanted, strict=True):
        assert abs(a.t_us - b.t_us) <= FLOAT_US


# --- what python-can's writers write -------------------------------------------------------------

MESSAGES = st.tuples(
    st.integers(0, 10**6), st.integers(0, (1 << 29) - 1), st.booleans(), st.binary(max_size=8),
    st.integers(0, 11), st.sampled_from(["data"] * 4 + ["fd", "remote", "error"]), st.booleans(),
)  # fmt: skip


def written(rows, suffix, folder, version=TRCFileVersion.V2_1):
    path = folder / f"written{suffix}"
    t_us = 1_700_000_000_000_000
    with can.Logger(path) as writer:
        if suffix == ".trc":
            writer.file_version = version
        for step, ident, extended, data, channel, form, is_rx in rows:
            t_us += step
            if suffix == ".trc" and form != "data":
                continue  # its writer warns of them and leaves them out
            writer(
                can.Message(
                    timestamp=t_us / 1e6, is_extended_id=extended,
                    arbitration_id=ident if extended else ident & 0x7FF,
                    data=data * (8 if form == "fd" and len(data) == 8 else 1) or None,
                    channel=channel, is_fd=form == "fd", is_remote_frame=form == "remote",
                    is_error_frame=form == "error", is_rx=is_rx,
                )
            )  # fmt: skip
    return path.read_bytes().decode()


@pytest.mark.usefixtures("few")
@pytest.mark.parametrize(
    ("suffix", "version"),
    [(".asc", None), (".trc", TRCFileVersion.V1_0), (".trc", TRCFileVersion.V2_1)],
)
@settings(max_examples=25)
@given(rows=st.lists(MESSAGES, max_size=60), times=st.sampled_from([1, 8]))
def test_what_python_cans_writers_write_is_read_as_by_its_readers(
    folder, suffix, version, rows, times
):
    text = written(rows * times, suffix, folder, version)
    found, report = read(folder, text, suffix)
    assert_alike(found, by_python_can(text, suffix))
    assert report.passed_over == 0


# --- what other tools write ----------------------------------------------------------------------

ASC_HEAD = (
    "date Sam Sep 30 15:06:13.191 2017\nbase hex  timestamps absolute\ninternal events logged\n"
)
VECTOR = """// version 9.0.0
Begin Triggerblock Sat Sep 30 15:06:13.191 2017
   0.000000 Start of measurement
   0.015991 CAN 1 Status:chip status error active
   0.015991 1  Statistic: D 0 R 0 XD 0 XR 0 E 0 O 0 B 0.00%
   {t} 1  1A2             Rx   d 8 01 02 03 04 05 06 07 08  Length = 244015 BitCount = 125
   {t} 2  18FEF100x       Tx   d 3 aB cd 0f  Length = 1 BitCount = 2
   {t} 1  7FF             Rx   r 8 Length = 0
   {t} 1  7FF             Rx   r
   {t} 2  ErrorFrame	ECC: 10100010
   {t} 2  0               Rx   D 0
   {t} CANFD   1 Rx        1a1                                   1 0 d 32 {d32} {last}
   {t} CANFD   2 Tx   1C4D80A7x   Name_of_it                     0 1 9 12 {d12} {last}
   {t} CANFD   3 Rx        1a1                                   1 0 0  0 {last}
   {t} CANFD   2 Rx   ErrorFrame                                 0 0 0 0 Length
   {t} J1939TP FEE3p 6 0 0 - Rx d 23 A0 0F A6 60 3B D1 40 1F DE 80 3E E1 00 A6
   {t} 1  Error in transmission
End TriggerBlock
"""
LAST = "  118000  245 323040 b0003bc9 460a0250 460a0250 20011736 20010205"
D32, D12 = bytes(range(32)).hex(" "), bytes(range(12)).hex(" ")


def vector(count=40, head=ASC_HEAD):
    """Lines as Vector's tools write them, each form often enough to be read in columns."""
    begin, middle, end = VECTOR.partition("   {t} 1  1A2")
    more, _, last = end.partition("End TriggerBlock")
    lines = (middle + more).splitlines(keepends=True)
    out = [head, begin]
    for n in range(count):
        for place, line in enumerate(lines):
            stamp = f"{n * 37 // 2}.{(n * 7919 + place) % 1_000_000:06d}"
            out.append(line.format(t=stamp, d32=D32, d12=D12, last=LAST))
    return "".join([*out, "End TriggerBlock", last])


TRC = {
    "1.1": (
        ";$FILEVERSION=1.1\n;$STARTTIME=43008.920986006946\n;\n",
        [
            "{n:6})  {t:12.1f}  Rx         0100  8  01 02 03 04 05 06 07 08 ",
            "{n:6})  {t:12.1f}  Tx     18FEF100  3  aB CD 0f ",
            "{n:6})  {t:12.1f}  Rx         0100  8  RTR ",
            "{n:6})  {t:12.1f}  Warng  FFFFFFFF  4  00 00 00 08  BUSHEAVY ",
            "{n:6})  {t:12.1f}  Rx         07FF  0 ",
            "{n:6})  {t:12.1f}  Rx         07FF  0  RTR ",
        ],
    ),
    "1.3": (
        ";$FILEVERSION=1.3\n;$STARTTIME=43008.920986006946\n;\n",
        [
            "{n:6}) {t:14.1f}  1  Rx        0100 -  8    01 02 03 04 05 06 07 08",
            "{n:6}) {t:14.3f}  2  Tx    1AB5E6F0 -  2    4A 0b",
            "{n:6}) {t:14.1f}  2  Error     0008 -  4    00 19 08 08",
            "{n:6}) {t:14.1f}  1  Rx        0100 -  3    RTR",
            "{n:6}) {t:14.1f}  1  Rx        0100 -  0",
            "{n:6}) {t:14.1f}  1  Rx        0100 -  0    RTR",
        ],
    ),
    "2.0": (
        ";$FILEVERSION=2.0\n;$STARTTIME=43008.920986006946\n;$COLUMNS=N,O,T,I,d,l,D\n;\n",
        [
            "{n:7} {t:13.3f} DT     0300 Rx  8  00 00 00 00 04 00 00 00",
            "{n:7} {t:13.3f} FB     0500 Tx 12  01 02 03 04 05 06 07 08 09 0A 0B 0C",
            "{n:7} {t:13.3f} BI 18EFC034 Rx 24  " + bytes(range(24)).hex(" "),
            "{n:7} {t:13.3f} FE     0333 Rx  0 ",
            "{n:7} {t:13.3f} RR     0100 Rx  8",
            "{n:7} {t:13.3f} ER          Rx     04 00 02 00 00",
            "{n:7} {t:13.3f} ST          Rx     00 00 00 08",
        ],
    ),
    "2.1": (
        ";$FILEVERSION=2.1\n;$STARTTIME=43008.920986006946\n;$COLUMNS=N,O,T,B,I,d,R,L,D\n;\n",
        [
            "{n:7} {t:13.3f} DT  1      0300 Rx -  8    00 00 00 00 04 00 00 00 ",
            "{n:7} {t:13.3f} FD  2 18EFC034 Rx -  9    " + bytes(range(12)).hex(" ") + " ",
            "{n:7} {t:13.3f} DT 12      0300 Tx -  1    77",
            "{n:7} {t:13.3f} RR  1      0100 Rx -  3   ",
            "{n:7} {t:13.3f} DT  1      0300 Rx -  2    7788",
        ],
    ),
    "1.0": (
        ";   C:\\trace.trc\n;    +-current number\n",
        [
            "{n:6})     {t:5.0f}  0001 8 01 02 03 04 05 06 07 08",
            "{n:6})     {t:5.0f}  FFFFFFFF 4 00 00 00 04 BUSLIGHT",
            "{n:6})     {t:5.0f}  18FEF100 2  ab CD",
            "{n:6})     {t:5.0f}  0004 6 RTR",
            "{n:6})     {t:5.0f}  0004 0",
            "{n:6})     {t:5.0f}  0004 0 RTR",
        ],
    ),
}


def peak(version, count=40, end="\r\n"):
    head, forms = TRC[version]
    lines = [
        form.format(n=n * len(forms) + place + 1, t=(n * 9973 + place) / 8)
        for n in range(count)
        for place, form in enumerate(forms)
    ]
    return (head + "\n".join(lines) + "\n").replace("\n", end)


@pytest.mark.usefixtures("few")
@pytest.mark.parametrize("version", TRC)
@pytest.mark.parametrize("end", ["\n", "\r\n"])
def test_peaks_lines_of_every_version_are_read_as_by_python_can(folder, version, end):
    text = peak(version, end=end)
    found, report = read(folder, text, ".trc")
    wanted = by_python_can(text, ".trc")
    assert len(wanted) >= 80
    assert_alike(found, wanted)
    assert read(folder, gzip.compress(text.encode()), ".trc.gz")[0] == found
    assert report.passed_over == 0
    lost = 40 * len(TRC[version][1]) - len(found)
    notes = [note for note in report.notes if f"{lost} of" in note]
    assert bool(notes) == (lost > 0)


@pytest.mark.usefixtures("few")
@pytest.mark.parametrize("end", ["\n", "\r\n", "\r"])
def test_vectors_lines_are_read_as_by_python_can(folder, end):
    text = vector().replace("\n", end)
    wanted = by_python_can(vector(), ".asc")
    found, report = read(folder, text, ".asc")
    assert_alike(found, wanted)
    assert len(found) == 40 * 10
    assert not report.notes
    assert report.passed_over == 0
    # Statistics, the state of a chip, and twice forty lines of other things.
    assert report.kinds["other"] == 2 + 2 * 40
    assert read(folder, gzip.compress(text.encode()), ".asc.gz")[0] == found


def test_most_lines_are_read_in_columns(folder, monkeypatch):
    single = []
    inner = PythonCanLines.read

    def counted(self, lines):
        single.extend(lines)
        return inner(self, lines)

    monkeypatch.setattr(PythonCanLines, "read", counted)
    for suffix, text, share in [
        (".asc", vector(400), 0.7), *((".trc", peak(version, 400), 0.8) for version in TRC),
    ]:  # fmt: skip
        single.clear()
        found, _ = read(folder, text, suffix)
        kinds = {".asc": 12}.get(suffix) or len(text.splitlines()) // 400
        assert len(found) > 400
        assert len(single) < share * 400 * kinds, suffix


def test_stamps_keep_their_nanoseconds(folder):
    lines = "".join(f" 12.34567890{n} 1  123  Rx  d 1 0{n}\n" for n in range(10))
    path = folder / "ns.asc"
    path.write_text(ASC_HEAD + lines * 5)
    (block,) = Recording(path).blocks()
    assert block.t_ns.tolist() == [12_345_678_900 + n for n in range(10)] * 5
    path = folder / "ns.trc"
    head, _ = TRC["2.0"]
    path.write_text(head + "".join(f"1 0.123456 DT 0001 Rx 1 0{n}\n" for n in range(10)) * 5)
    (block,) = Recording(path).blocks()
    assert set((block.t_ns % 1000).tolist()) == {456}


def test_decimal_files_are_read(folder):
    text = vector().replace("base hex", "base dec").replace("1A2", "418").replace("7FF", "99")
    lines = [line for line in text.splitlines() if "CANFD" not in line and "FEF" not in line]
    text = "\n".join(lines)
    found, _ = read(folder, text, ".asc")
    assert found[0].arbitration_id == 418
    assert_alike(found, by_python_can(text, ".asc"))


def test_relative_stamps_are_summed_over_all_events(folder):
    text = (
        "date Sat Sep 30 15:06:13.191 2017\nbase hex timestamps relative\n"
        "   0.100000 1  123  Rx   d 1 01\n"
        "   0.200000 1  Statistic: D 0 R 0\n"
        "   0.300000 1  123  Rx   d 1 02\n"
    )
    found, report = read(folder, text, ".asc")
    assert [f.t_us for f in found] == [100_000, 600_000]
    assert any("differences" in note for note in report.notes)


def test_the_first_line_behind_a_short_head_is_not_lost(folder):
    text = (
        "date Sat Sep 30 15:06:13.191 2017\nbase hex\n 0.1 1 123 Rx d 1 01\n 0.2 1 123 Rx d 1 02\n"
    )
    assert len(by_python_can(text, ".asc")) == 1, "python-can drops it"
    assert len(read(folder, text, ".asc")[0]) == 2


# --- damage --------------------------------------------------------------------------------------

BAD = [
    " 0.5 1 12G Rx d 8 01", " 0.5 1 123 Rx d 2 01 XX", " 0.5 1 123 Rx d", " 0.5 1 123 Rx",
    " 0.5 99999999 123 Rx d 1 01", " 0.5 1 3FFFFFFFx Rx d 1 01", " 0.5 1 1_2Gx Rx d 1 01",
    " 9999999999999999.0 1 123 Rx d 1 01", " garbage without a stamp", "data",
]  # fmt: skip


@pytest.mark.usefixtures("few")
@pytest.mark.parametrize("bad", BAD)
def test_a_bad_line_costs_itself_alone_and_is_counted(folder, bad):
    lines = [f" 0.{n:06d} 1  123  Rx   d 2 01 {n:02X}" for n in range(60)]
    whole, _ = read(folder, ASC_HEAD + "\n".join(lines) + "\n", ".asc")
    lines[30:30] = [bad]
    found, report = read(folder, ASC_HEAD + "\n".join(lines) + "\n", ".asc")
    assert found == whole
    assert report.kinds["malformed"] == 1
    assert report.bad_lines == [34]


def test_a_number_that_no_bus_can_have_is_a_bad_line_among_its_like(folder):
    lines = [f" 0.{n:06d} {n % 2 + 1:8}  123  Rx   d 1 {n:02X}\n" for n in range(60)]
    lines[30] = lines[30].replace("       1", "00065536")
    found, report = read(folder, ASC_HEAD + "".join(lines), ".asc")
    assert [frame.data[0] for frame in found] == [n for n in range(60) if n != 30]
    assert {frame.channel for frame in found} == {"can0", "can1"}
    assert report.bad_lines == [34]


def test_what_vectors_tools_write_around_the_events_is_no_bad_line(folder):
    around = (
        "// version 8.1.0\n\n  \n# a comment\n; another\nEnd TriggerBlock\n"
        "Begin Triggerblock Sat Sep 30 10:06:13.191 PM 2017\n0.000000 Start of measurement\n"
        "no internal events logged\n// previous log file: a.asc\n"
    )
    text = f"{ASC_HEAD} 0.1 1 123 Rx d 1 01\n{around} 0.2 1 123 Rx d 1 01\n"
    found, report = read(folder, text, ".asc")
    assert len(found) == 2
    assert report.passed_over == report.kinds["other"] == 0


@pytest.mark.costly
@pytest.mark.parametrize("suffix", [".asc", ".trc"])
def test_any_byte_changed_anywhere_gives_what_python_can_gives(folder, suffix):
    text = vector(12) if suffix == ".asc" else peak("2.1", 30)
    rng = random.Random(3)
    compared = 0
    for _ in range(150):
        changed = bytearray(text.encode())
        place = rng.randrange(200, len(changed))
        changed[place] = rng.choice(b"0123456789abcdefx Rr\t\n\r:;,.-DdFT\x00\x1c\x85\xff")
        found, report = read(folder, bytes(changed), suffix)
        try:
            wanted = by_python_can(changed.decode(), suffix)
        except (ValueError, KeyError, IndexError):
            continue
        if not report.passed_over:
            compared += 1
            assert_alike(found, wanted)
    assert compared > 60


@pytest.mark.parametrize("suffix", [".asc", ".trc"])
def test_a_trace_cut_anywhere_gives_what_is_whole(folder, suffix):
    text = vector(2) if suffix == ".asc" else peak("2.1", 4)
    whole, _ = read(folder, text, suffix)
    for length in range(text.index("      1 " if suffix == ".trc" else "Begin"), len(text), 3):
        found, _ = read(folder, text[:length], suffix)
        assert found[:-1] == whole[: max(len(found) - 1, 0)], "of the last line a part may be left"


@pytest.mark.parametrize(
    ("text", "says"),
    [
        (";$FILEVERSION=2.1\n;$STARTTIME=4\n1 2 DT 1 Rx 0\n", "no column"),
        (";$FILEVERSION=2.1\n;$STARTTIME=inf\n1 2 DT 1 Rx 0\n", ""),
    ],
)
def test_a_head_that_cannot_be_read_is_an_error(folder, text, says):
    with pytest.raises(RecordingError, match=r"a\.trc.*header cannot be read") as error:
        read(folder, text, ".trc")
    assert says in str(error.value)


def test_code_pages_in_names_do_not_stop_the_reading(folder):
    text = vector(3).replace("// version", "// für").encode("cp1252")
    found, _ = read(folder, text, ".asc")
    assert found == read(folder, vector(3), ".asc")[0]


def test_a_comment_is_no_frame_also_where_nothing_follows_it(folder):
    text = ";$F.LEVERSION=2.0\r\n;$50 09 0A00B0 00 000 08\r\n"
    assert len(by_python_can(text, ".trc")) == 1, "python-can takes it for one"
    assert read(folder, text, ".trc")[0] == []
