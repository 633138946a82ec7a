"""Logs of other tools: the frames of one bus, written in each tool's form."""

import base64
import gzip

import pytest

from adhesion_can.bus.frame import Frame
from adhesion_can.cli.main import main
from adhesion_can.errors import RecordingError
from adhesion_can.recordings.formats import FRAME_TABLE, detect_format
from adhesion_can.recordings.recording import Recording

BEGIN_S = 1_581_670_628
FRAMES = [
    (BEGIN_S * 10**6 + 160_000 + n * 10_000, 0x120 if n % 3 else 0x18FEF1FE, bytes([n] * (n % 9)))
    for n in range(60)
]


def octets(data, mark=" ", form="{:02X}"):
    return mark.join(form.format(byte) for byte in data)


def gvret(t_us, number, data):
    cells = [t_us, f"{number:08X}", "true" if number > 0x7FF else "false", "Rx", 1, len(data)]
    return ",".join(map(str, cells)) + "," + octets(data, ",")


def css(t_us, number, data):
    cells = [f"{t_us / 1e6:.6f}", 1, f"{number:X}", int(number > 0x7FF), len(data), len(data),
             0, 0, 0, octets(data, "")]  # fmt: skip
    return ";".join(map(str, cells))


def hcrl(t_us, number, data):
    return f"{t_us / 1e6:.6f},{number:04x},{len(data)},{octets(data, ',', '{:02x}')},R".replace(
        ",,", ","
    )


def hcrl_text(t_us, number, data):
    return (f"Timestamp: {t_us / 1e6:.6f}        ID: {number:04x}    000    DLC: {len(data)}    "
            f"{octets(data, ' ', '{:02x}')}")  # fmt: skip


def clock(t_us, mark=":", digits=4):
    seconds = t_us // 10**6 % 86_400
    fraction = f"{t_us % 10**6:06d}"[:digits]
    return f"{seconds // 3600:02d}:{seconds // 60 % 60:02d}:{seconds % 60:02d}{mark}{fraction}"


def busmaster(t_us, number, data):
    kind = "x" if number > 0x7FF else "s"
    return f"{clock(t_us)} Rx 1 0x{number:03X} {kind} {len(data)} {octets(data)} "


def busmaster_decimal(t_us, number, data):
    kind = "x" if number > 0x7FF else "s"
    return f"{clock(t_us)} Rx 1 {number} {kind} {len(data)} {octets(data, ' ', '{:d}')} "


def microchip(t_us, number, data):
    return f"{t_us // 1000};RX;0x{number:08X};{len(data)};" + "".join(
        f"0x{byte:02X};" for byte in data
    )


def crtd(t_us, number, data):
    return f"{t_us / 1e6:.6f} 1R{'29' if number > 0x7FF else '11'} {number:08X} {octets(data)} "


def carbus(t_us, number, data):
    since = t_us - FRAMES[0][0]
    stamp = f"{since // 10**6:02d},{since % 10**6:06d}"
    return f"{stamp}\t1\t0004\t{number:X}\t{len(data)}\t{octets(data)}\t00000000\tZ       \t"


def clx(t_us, number, data):
    day = f"14T{clock(t_us, '', 3).replace(':', '')}"
    return f"{day};{int(number > 0x7FF)};{number:x};{octets(data, '', '{:02x}')}"


def python_can(t_us, number, data):
    cells = [f"{t_us / 1e6}", f"{number:#x}", int(number > 0x7FF), 0, 0, len(data),
             base64.b64encode(data).decode()]  # fmt: skip
    return ";".join(map(str, cells))


def cabana(t_us, number, data):
    return f"{t_us / 1e6:.6f},{number},1,{octets(data, '', '{:02x}')}"


BUSMASTER_HEAD = [
    "***BUSMASTER Ver 2.4.0***",
    "***PROTOCOL CAN***",
    "***START DATE AND TIME 14:2:2020 08:57:08:160***",
    "***{}***",
    "***SYSTEM MODE***",
    "***<Time><Tx/Rx><Channel><CAN ID><Type><DLC><DataBytes>***",
]
CLX_HEAD = ["# Logger type: CL2000", "# Time: 20200214T085708", '# Value separator: ";"',
            "# Time format: 4", "Timestamp;Type;ID;Data"]  # fmt: skip
CSS = "TimestampEpoch;BusChannel;ID;IDE;DLC;DataLength;Dir;EDL;BRS;DataBytes"
PYTHON_CAN = "timestamp;arbitration_id;extended;remote;error;dlc;data"
DAY_US = 1_581_638_400 * 10**6
TOOLS = {
    "GVRET": (["Time Stamp,ID,Extended,Dir,Bus,LEN,D1,D2,D3,D4,D5,D6,D7,D8"], gvret, 0, "can1"),
    "CSS": ([CSS], css, 0, "can1"),
    "HCRL": ([], hcrl, 0, ""),
    "HCRL text": ([], hcrl_text, 0, ""),
    "BUSMASTER": ([x.format("HEX") for x in BUSMASTER_HEAD], busmaster, 0, "can1"),
    "BUSMASTER decimal": ([x.format("DEC") for x in BUSMASTER_HEAD], busmaster_decimal, 0, "can1"),
    "BUSMASTER without a date": (["***HEX***"], busmaster, -DAY_US, "can1"),
    "Microchip": (["//-----", "CAN BUS Analyzer", "//-----"], microchip, 0, ""),
    "CRTD": ([f"{BEGIN_S}.000000 CXX Tool Output V138"], crtd, 0, "can1"),
    "CARBUS": (["@ TEXT @ 2 @ 64 @ 0 @ 55 @ 1 @ 00:00:10.1 @"], carbus, -FRAMES[0][0], "can1"),
    "CLX": (CLX_HEAD, clx, 0, ""),
    "CLX without a date": (CLX_HEAD[-1:], clx, 13 * 86_400 * 10**6 - DAY_US, ""),
    "python-can, semicolons": ([PYTHON_CAN], python_can, 0, ""),
    "Cabana": (["time,addr,bus,data"], cabana, 0, "can1"),
}  # fmt: skip


def written(path, tool, frames=FRAMES):
    head, form, *_ = TOOLS[tool]
    path.write_text("\n".join([*head, *(form(*frame) for frame in frames)]) + "\n")
    return path


@pytest.mark.parametrize("name", ["a.csv", "a.log", "a.txt", "a.trc", "a"])
@pytest.mark.parametrize("tool", TOOLS)
def test_every_tool_gives_the_same_frames(tmp_path, tool, name):
    recording = Recording(written(tmp_path / name, tool))
    _, _, shift_us, channel = TOOLS[tool]
    wanted = [
        Frame(t_us + shift_us, number, data, channel, is_extended=number > 0x7FF)
        for t_us, number, data in FRAMES
    ]
    assert list(recording) == wanted
    joined = [frame for block in Recording(recording.path).blocks() for frame in block.items()]
    assert joined == wanted
    assert recording.report.passed_over == 0
    assert recording.report.remarks[0].startswith("read as ")


@pytest.mark.parametrize("tool", ["GVRET", "BUSMASTER", "HCRL"])
def test_packed_ones_too(tmp_path, tool):
    plain = written(tmp_path / "a.txt", tool)
    packed = tmp_path / "a.txt.gz"
    packed.write_bytes(gzip.compress(plain.read_bytes()))
    assert list(Recording(packed)) == list(Recording(plain))


@pytest.mark.parametrize("tool", TOOLS)
def test_lines_that_are_no_frames_are_counted(tmp_path, tool):
    path = written(tmp_path / "a.txt", tool)
    lines = path.read_text().splitlines()
    lines[-20:-20] = ["what is this", "1;2;3"]
    lines[-1] = lines[-1][: len(lines[-1]) // 3]
    path.write_text("\n".join(lines))
    recording = Recording(path)
    assert len(list(recording)) == len(FRAMES) - 1
    assert recording.report.passed_over == 3


def test_milliseconds_that_are_not_padded(tmp_path):
    path = tmp_path / "a.log"
    lines = [f"22:20:{n // 1000:02d}:{n % 1000} Rx 0 0000021A s 1 FE " for n in range(990, 1012)]
    path.write_text("\n".join(["***HEX***", *lines]))
    begin_us = (22 * 3600 + 20 * 60) * 10**6
    assert [f.t_us - begin_us for f in Recording(path)] == [n * 1000 for n in range(990, 1012)]


@pytest.mark.parametrize("end", ["\r", "\r\n"])
@pytest.mark.parametrize("tool", ["CARBUS", "GVRET"])
def test_other_ends_of_lines(tmp_path, tool, end):
    path = written(tmp_path / "a.txt", tool)
    wanted = list(Recording(path))
    path.write_bytes(path.read_bytes().replace(b"\n", end.encode()))
    assert list(Recording(path)) == wanted


def test_a_stamp_past_midnight_runs_on(tmp_path):
    frames = [(86_399_990_000 + n * 5_000, 0x120, b"\1") for n in range(10)]
    path = written(tmp_path / "a.log", "BUSMASTER without a date", frames)
    assert [frame.t_us for frame in Recording(path)] == [t_us for t_us, _, _ in frames]


def test_frames_without_times_are_refused(tmp_path):
    path = tmp_path / "a.csv"
    path.write_text("ID,Data Bytes\n" + "0000021A,FE 36 12\n" * 30)
    with pytest.raises(RecordingError, match="without their times; export it with them"):
        list(Recording(path))


@pytest.mark.parametrize(
    "text",
    [
        "time_s,slip,adhesion\n0,0.1,0.2\n",
        "id,name,value\n1,a,2\n",
        "1.5,20,3\n2.5,21,4\n",
        "some words\nand more of them\n",
        "",
    ],
)
def test_what_is_no_log_of_frames(tmp_path, text):
    assert detect_format(tmp_path / "a.log", text.encode()) != FRAME_TABLE


def test_convert_takes_them_as_any_recording(tmp_path, capsys):
    database = tmp_path / "a.dbc"
    database.write_text('VERSION ""\nBU_: A\nBO_ 288 M: 1 A\n SG_ s : 0|8@1+ (1,0) [0|0] "" A\n')
    rows = {}
    for tool in ("CSS", "GVRET", "HCRL"):
        path = written(tmp_path / f"{tool}.csv", tool)
        words = ["convert", str(path), "--dbc", str(database), "--out", str(tmp_path / "o.csv")]
        assert main(words) == 0
        rows[tool] = (tmp_path / "o.csv").read_text()
        assert "read as " in capsys.readouterr().out
    assert rows["CSS"] == rows["GVRET"] == rows["HCRL"]
    assert rows["CSS"].count("\n") > 10
