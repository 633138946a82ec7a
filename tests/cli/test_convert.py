"""`convert` as a user types it: what it writes, what it says, how it fails."""

import csv
import gzip
import json
import os
import pty
import random
import re
import resource
import subprocess
import sys
from collections import Counter
from contextlib import contextmanager
from hashlib import sha256
from pathlib import Path

import can
import cantools
import pyarrow as pa
import pytest
from asammdf import MDF
from pyarrow import parquet

from adhesion_can import __version__
from adhesion_can.cli.main import main
from adhesion_can.extras import install_extra
from tests.wire import DBC, sealed

CAR = Path(__file__).resolve().parents[1] / "data" / "car.dbc"


def line(t_us, number, data, channel="can0"):
    name = f"{number:08X}" if number > 0x7FF else f"{number:03X}"
    return f"({t_us // 10**6}.{t_us % 10**6:06d}) {channel} {name}#{data.hex().upper()}\n"


def speeds(count, data_id=0x101, raw=1000):
    payload = bytes(2) + b"".join((raw + k).to_bytes(2, "little") for k in range(3))
    return sealed(data_id, payload, count)


@pytest.fixture
def log(tmp_path):
    """40 frames of the contract, of which one has a wrong checksum and two come twice."""
    lines = []
    for number in range(20):
        t_us = 1_700_000_000_000_000 + 10_000 * number
        frame = speeds(number % 15)
        if number == 7:
            frame = b"\0" + frame[1:] if frame[0] else b"\1" + frame[1:]
        lines.append(line(t_us, 0x101, frame))
        lines.append(line(t_us + 250, 0x102, speeds(number % 15, 0x102, 2000 + number)))
        if number in (3, 4):
            lines.append(line(t_us + 300, 0x101, frame))
    lines.append(line(t_us + 400, 0x7A0, b"\1\2"))
    lines.append(line(t_us + 401, 0x18FEF100, bytes(8)))
    lines.insert(5, "no frame at all\n")
    path = tmp_path / "a.log"
    path.write_text("".join(lines))
    return path


def convert(*arguments):
    return main(["convert", *map(str, arguments)])


def fails(capsys, *arguments):
    """Runs the command, which must fail with exit status 2 and one line; returns the line."""
    try:
        code = convert(*arguments)
    except SystemExit as error:
        code = error.code
    assert code == 2
    err = capsys.readouterr().err
    assert err.count("\n") == 1, err
    assert err.startswith("adhesion-can convert: ")
    return err


def rows_of(path):
    content = path.read_bytes()
    text = gzip.decompress(content) if path.suffix == ".gz" else content
    return list(csv.DictReader(text.decode().splitlines()))


def test_every_format_holds_the_same_rows(log, tmp_path):
    for name in ("o.csv", "o.csv.gz", "o.parquet", "o.mf4"):
        assert convert(log, "--out", tmp_path / name, "--signals", "Wheel*") == 0
    rows = rows_of(tmp_path / "o.csv")
    assert rows == rows_of(tmp_path / "o.csv.gz")
    assert Counter(row["message"] for row in rows) == {"WheelSpeeds1": 19, "WheelSpeeds2": 20}
    assert rows[0]["time_s"] == "1700000000.000000000"
    assert rows[1]["time_s"] == "1700000000.000250000"
    assert rows[0]["WheelSpeeds1.WheelSpeed_Ax1"] == "2.0"
    assert rows[0]["WheelSpeeds2.WheelSpeed_Ax4"] == ""
    table = parquet.read_table(tmp_path / "o.parquet")
    assert table.column_names == ["time_s", "time_ns", *list(rows[0])[1:]]
    for row, other in zip(rows, table.to_pylist(), strict=True):
        assert f"{other['time_ns'] // 10**9}.{other['time_ns'] % 10**9:09d}" == row["time_s"]
        for name in rows[0].keys() - {"time_s", "message"}:
            assert other[name] == (float(row[name]) if row[name] else None)
    assert table.schema.field("WheelSpeeds1.WheelSpeed_Ax1").metadata[b"unit"] == b"rad/s"
    with MDF(tmp_path / "o.mf4") as mdf:
        speed = mdf.get("WheelSpeed_Ax4")
        held = [r for r in rows if r["message"] == "WheelSpeeds2"]
        assert speed.samples.tolist() == [float(r["WheelSpeeds2.WheelSpeed_Ax4"]) for r in held]
        assert speed.unit == "rad/s"
        assert mdf.header.abs_time == 1_700_000_000 * 10**9


def test_the_report_tells_what_became_of_every_frame_and_line(log, tmp_path, capsys):
    assert convert(log, "--out", tmp_path / "o.csv", "--json", tmp_path / "o.json") == 0
    out = capsys.readouterr().out
    document = json.loads((tmp_path / "o.json").read_text())
    assert document["frames"] == 44
    assert document["decoded"] == 39
    assert document["messages"] == [
        {
            "name": "WheelSpeeds1",
            "id": 0x101,
            "extended": False,
            "frames": 22,
            "decoded": 19,
            "rejected": {"checksum": 1, "repeat": 2},
            "lost": 1,
        },
        {
            "name": "WheelSpeeds2",
            "id": 0x102,
            "extended": False,
            "frames": 20,
            "decoded": 20,
            "rejected": {},
            "lost": 0,
        },
    ]
    assert document["unknown"] == [
        {"id": 0x7A0, "extended": False, "frames": 1, "name": ""},
        {"id": 0x18FEF100, "extended": True, "frames": 1, "name": ""},
    ]
    assert document["version"] == __version__
    assert document["inputs"] == [
        {"path": str(log), "sha256": sha256(log.read_bytes()).hexdigest()}
    ]
    assert document["dbc"]["sha256"] == sha256(DBC.read_bytes()).hexdigest()
    assert document["lines"] == {"frame": 44, "malformed": 1}
    size = (tmp_path / "o.csv").stat().st_size
    assert document["output"] == {"path": str(tmp_path / "o.csv"), "bytes": size}
    assert re.search(r"WheelSpeeds1 0x101 +22 +19 +repeat: 2, checksum: 1 +1\b", out)
    assert "unknown ids: 2 frames (0x7A0: 1, 0x18FEF100: 1)" in out
    assert "a.log: lines skipped: 1 malformed (line 6, ..)" in out


def test_json_on_stdout_is_all_that_stands_there(log, tmp_path, capsys):
    assert convert(log, "--out", tmp_path / "o.mf4", "--json", "-") == 0
    assert json.loads(capsys.readouterr().out)["decoded"] == 39


def test_several_logs_follow_each_other(log, tmp_path, capsys):
    later = tmp_path / "b.log"
    later.write_text("".join(line(5, 0x101, speeds(k)) for k in (5, 6)))
    assert convert(log, later, "--out", tmp_path / "o.csv") == 0
    rows = rows_of(tmp_path / "o.csv")
    assert [row["time_s"] for row in rows[-2:]] == ["0.000005000"] * 2
    assert "b.log: starts before the previous file ends" in capsys.readouterr().out


def test_time_that_goes_backwards_is_kept_and_reported(tmp_path, capsys):
    path = tmp_path / "a.log"
    path.write_text(line(9, 180, bytes(8)) + line(5, 180, bytes(8)))
    assert convert(path, "--dbc", CAR, "--out", tmp_path / "o.csv") == 0
    assert [row["time_s"] for row in rows_of(tmp_path / "o.csv")] == ["0.000009000", "0.000005000"]
    said = "a.log: 1 frame stamped earlier than the previous frame, stamps kept unchanged"
    assert said in capsys.readouterr().out


def test_globs_match_message_signal_or_both(log, tmp_path):
    globs = ["WheelSpeeds1", "*.WheelSpeed_Ax4", "Aliv?"]
    assert convert(log, "--out", tmp_path / "o.csv", "--signals", *globs) == 0
    assert set(rows_of(tmp_path / "o.csv")[0]) == {
        "time_s",
        "message",
        *(f"WheelSpeeds1.{s}" for s in ("Crc", "Alive", *(f"WheelSpeed_Ax{k}" for k in (1, 2, 3)))),
        "WheelSpeeds2.Alive",
        "WheelSpeeds2.WheelSpeed_Ax4",
    }


def test_frames_of_no_wanted_signal_are_no_rows(log, tmp_path, capsys):
    assert convert(log, "--out", tmp_path / "o.csv", "--signals", "WheelSpeeds2") == 0
    assert len(rows_of(tmp_path / "o.csv")) == 20
    assert "without a selected signal: 22 frames (WheelSpeeds1: 22)" in capsys.readouterr().out


def test_several_channels_are_reported_and_one_can_be_taken(tmp_path, capsys):
    path = tmp_path / "a.log"
    path.write_text("".join(line(k, 180, bytes(8), f"can{k % 3}") for k in range(9)))
    arguments = (path, "--dbc", CAR, "--out", tmp_path / "o.csv")
    assert convert(*arguments) == 0
    assert (
        "received on several channels (can0, can1, can2) and mixed: SPEED"
        in capsys.readouterr().out
    )
    assert convert(*arguments, "--channel", "can1") == 0
    assert [row["time_s"] for row in rows_of(tmp_path / "o.csv")] == [
        f"0.00000{k}000" for k in (1, 4, 7)
    ]
    assert "of other channels: 6 frames (can0: 3, can2: 3)" in capsys.readouterr().out


def test_exports_of_one_recording_lie_over_each_other_in_mf4(log, tmp_path):
    for name in ("WheelSpeeds1", "WheelSpeeds2"):
        assert convert(log, "--out", tmp_path / f"{name}.mf4", "--signals", name) == 0
    with MDF(tmp_path / "WheelSpeeds1.mf4") as one, MDF(tmp_path / "WheelSpeeds2.mf4") as two:
        assert one.header.abs_time == two.header.abs_time == 1_700_000_000 * 10**9
        assert one.get("WheelSpeed_Ax1").timestamps[0] == 0
        assert two.get("WheelSpeed_Ax4").timestamps[0] == 0.00025


def test_mf4_of_times_that_run_back_is_reported(tmp_path, capsys):
    path = tmp_path / "a.log"
    path.write_text("".join(line(k, 180, bytes(8)) for k in (9, 5, 7)))
    message = "MF4 needs ascending times: frames with earlier stamps"
    assert convert(path, "--dbc", CAR, "--out", tmp_path / "o.csv") == 0
    assert message not in capsys.readouterr().out
    assert convert(path, "--dbc", CAR, "--out", tmp_path / "o.mf4") == 0
    assert message in capsys.readouterr().out
    with MDF(tmp_path / "o.mf4") as mdf:
        assert mdf.get("SPEED").timestamps.tolist() == pytest.approx([-4e-6, -2e-6, 0.0])
    path.write_text("".join(line(k, 180, bytes(8)) for k in (5, 7, 9)))
    assert convert(path, "--dbc", CAR, "--out", tmp_path / "o.mf4") == 0
    assert message not in capsys.readouterr().out


TWICE = """VERSION ""
BU_: A
BO_ 256 M: 8 A
 SG_ X : 0|8@1+ (1,0) [0|0] "" A
BO_ 257 M: 8 A
 SG_ X : 0|8@1+ (1,0) [0|0] "" A
BO_ 2147483905 M: 2 A
 SG_ X : 0|8@1+ (1,0) [0|0] "" A
 SG_ Beyond : 8|16@1+ (1,0) [0|0] "" A
"""


@pytest.fixture
def twice(tmp_path):
    """A database with one name for three messages, and frames of each of them on its own bus."""
    (tmp_path / "m.dbc").write_text(TWICE)
    path = tmp_path / "m.log"
    frames = [(256, 8, "can0"), (257, 8, "can1"), (257, 8, "can1"), (257, 3, "can1")]
    lines = [line(k, n, bytes(size), bus) for k, (n, size, bus) in enumerate(frames)]
    path.write_text("".join(lines) + "(0.000009) can2 00000101#0102\n")
    return path, "--dbc", tmp_path / "m.dbc"


def test_messages_of_one_name_are_counted_each_under_its_id(twice, tmp_path, capsys):
    report = tmp_path / "o.json"
    assert convert(*twice, "--out", tmp_path / "o.csv", "--json", report) == 0
    out = capsys.readouterr().out
    counts = [
        (m["name"], m["id"], m["extended"], m["frames"], m["decoded"], m["rejected"])
        for m in json.loads(report.read_text())["messages"]
    ]
    assert counts == [
        ("M", 0x100, False, 1, 1, {}),
        ("M", 0x101, False, 3, 2, {"length": 1}),
        ("M", 0x101, True, 1, 1, {}),
    ]
    assert re.search(r"M 0x100 +1 +1 +0 +0\b", out)
    assert re.search(r"M 0x101 +3 +2 +length: 1 +0\b", out)
    assert re.search(r"M 0x00000101 +1 +1 +0 +0\b", out)
    assert "several channels" not in out


def test_an_undecodable_signal_asked_for_alone_names_the_reason(twice, tmp_path, capsys):
    err = fails(capsys, *twice, "--out", tmp_path / "o.csv", "--signals", "M.Beyond")
    assert "it has M: 5; M.Beyond: cannot be decoded: " in err


def test_the_help_says_where_log_stands_and_what_buses_are_called(log, tmp_path, capsys):
    with pytest.raises(SystemExit):
        convert("--help")
    text = " ".join(capsys.readouterr().out.split())
    assert "put LOG before it or after '--'" in text
    assert "in formats that number their buses: can0, can1, .." in text
    assert convert("--out", tmp_path / "o.csv", "--signals", "WheelSpeeds1", "--", log) == 0


@pytest.mark.parametrize("kind", ["kcd", "sym"])
def test_a_database_of_another_format(tmp_path, kind):
    database = cantools.database.load_file(CAR)
    other = tmp_path / f"car.{kind}"
    other.write_text(getattr(database, f"as_{kind}_string")())
    path = tmp_path / "a.log"
    path.write_text(line(1, 170, bytes(range(8))))
    assert convert(path, "--dbc", CAR, "--out", tmp_path / "a.csv") == 0
    assert convert(path, "--dbc", other, "--out", tmp_path / "b.csv") == 0
    first, second = rows_of(tmp_path / "a.csv"), rows_of(tmp_path / "b.csv")
    values = [{v for k, v in row.items() if "SPEED" in k} for row in (*first, *second)]
    assert values[0] == values[1]


def test_a_recording_of_another_format(log, tmp_path):
    log.write_text(log.read_text().replace("no frame at all\n", ""))  # it would stop python-can
    with can.LogReader(log) as reader, can.Logger(tmp_path / "a.asc") as writer:
        for message in reader:
            writer(message)
    assert convert(log, "--out", tmp_path / "a.csv") == 0
    assert convert(tmp_path / "a.asc", "--out", tmp_path / "b.csv") == 0
    first, second = rows_of(tmp_path / "a.csv"), rows_of(tmp_path / "b.csv")
    for row in (*first, *second):
        del row["time_s"]
    assert first == second


# --- what cannot be done


def test_signals_that_match_nothing_name_what_is_near(log, tmp_path, capsys):
    arguments = (log, "--out", tmp_path / "o.csv", "--signals", "Wheel*")
    err = fails(capsys, *arguments, "wheelspeed1")
    assert "--signals wheelspeed1: matches no message or signal of adhesion.dbc" in err
    assert "similar names: WheelSpeeds1" in err
    assert "cantools dump" in fails(capsys, *arguments, "qqqqqqqq")
    assert not (tmp_path / "o.csv").exists()


def test_a_recording_of_foreign_ids_tells_which(log, tmp_path, capsys):
    for suffix in ("csv", "csv.gz", "parquet", "mf4"):
        err = fails(capsys, log, "--dbc", CAR, "--out", tmp_path / f"o.{suffix}")
        assert "0x101: 22, 0x102: 20" in err
        assert "car.dbc has 3: 0x0AA, 0x0B4, 0x0BE" in err
        assert [path.name for path in tmp_path.iterdir()] == ["a.log"]


def test_what_was_written_before_stays_where_nothing_is_decoded(log, tmp_path, capsys):
    (tmp_path / "o.csv").write_text("old")
    fails(capsys, log, "--dbc", CAR, "--out", tmp_path / "o.csv")
    assert (tmp_path / "o.csv").read_text() == "old"


@pytest.mark.parametrize(
    ("lines", "options", "message"),
    [
        ("", (), "it has no data frames"),
        ("garbage\n", (), "it has no data frames; a.log: lines skipped: 1 malformed"),
        (line(1, 0x101, bytes(8)), (), "1 of 1 frames of known ids are rejected (checksum: 1)"),
        (line(1, 0x101, bytes(3)), (), "1 of 1 frames of known ids are rejected (length: 1)"),
        (
            line(1, 0x101, speeds(0)),
            ("--signals", "VehicleSpeed"),
            "no frame with a selected signal that can be decoded; it has WheelSpeeds1: 1",
        ),
        (
            line(1, 0x101, speeds(0)),
            ("--channel", "can4"),
            "no frame of channel can4; it has can0: 1",
        ),
    ],
)
def test_a_recording_without_a_row_names_the_reason(tmp_path, capsys, lines, options, message):
    path = tmp_path / "a.log"
    path.write_text(lines)
    assert message in fails(capsys, path, "--out", tmp_path / "o.csv", *options)
    assert [path.name for path in tmp_path.iterdir()] == ["a.log"]


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("{log}", "--out", "{dir}/none/o.csv"), "its folder does not exist"),
        (("{log}", "--out", "{dir}/o.xls"), "unknown format"),
        (("{log}", "--out", "{dir}/o.csv", "--json", "{dir}/none/o.json"), "--json"),
        (
            ("{log}", "--out", "{dir}/o.csv", "--json", "{dir}/x/../o.csv"),
            "also the file of --out",
        ),
        (("{log}", "--out", "{dir}/o.csv", "--dbc", "{dir}/o.csv"), "is one of the inputs"),
        (("{dir}/r.csv", "--out", "{dir}/r.csv"), "is one of the inputs"),
        (("{dir}/none.log", "--out", "{dir}/o.csv"), "No such file"),
        (("{log}", "--out", "{dir}/o.csv", "--dbc", "{dir}/none.dbc"), "No such file"),
        (("{log}", "--out", "{dir}/o.csv", "--dbc", "{log}"), "CAN database"),
        (("{log}",), "--out"),
        (("{log}", "--out", "{dir}/d.csv"), "is a folder"),
    ],
)
def test_bad_usage_is_reported_before_the_work(
    log, tmp_path, capsys, monkeypatch, arguments, message
):
    (tmp_path / "x").mkdir()
    (tmp_path / "d.csv").mkdir()
    before = sorted(tmp_path.iterdir())

    def read(*_):
        raise AssertionError("the recording was read")

    monkeypatch.setattr("adhesion_can.recordings.recording.Recording.blocks", read)
    words = [word.format(log=log, dir=tmp_path) for word in arguments]
    assert message in fails(capsys, *words)
    assert sorted(tmp_path.iterdir()) == before


def test_a_missing_extra_is_reported_before_the_work(log, tmp_path, capsys, monkeypatch):
    for name in list(sys.modules):
        if name.startswith(("asammdf", "adhesion_can.reporting.export.mf4_file")):
            monkeypatch.delitem(sys.modules, name)
    monkeypatch.setitem(sys.modules, "asammdf", None)
    err = fails(capsys, log, "--out", tmp_path / "o.mf4")
    assert f"needs asammdf; {install_extra('mf4')}" in err


@contextmanager
def full_disk():
    """No file may grow beyond some bytes: writes fail as on a full disk."""
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (50_000, before[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)


@pytest.mark.parametrize("suffix", ["csv", "csv.gz", "parquet", "mf4", "mcap", "arrow", "arrows"])
def test_a_full_disk_is_reported_and_leaves_nothing(tmp_path, capsys, suffix):
    log = tmp_path / "a.log"
    rng = random.Random(1)
    log.write_text("".join(line(k**2, 170, rng.randbytes(8)) for k in range(10_000)))
    with full_disk():
        err = fails(capsys, log, "--dbc", CAR, "--out", tmp_path / f"o.{suffix}")
    assert "File too large" in err
    assert [path.name for path in tmp_path.iterdir()] == ["a.log"]


@pytest.mark.parametrize("option", [["--progress"], ["--no-progress"], []])
def test_a_terminal_sees_the_progress_of_long_work_or_when_asked(log, tmp_path, capsys, option):
    main_end, other_end = pty.openpty()
    command = [sys.executable, "-W", "error", "-m", "adhesion_can.cli.main", "convert", *option]
    done = subprocess.run(
        [*command, log, "--out", tmp_path / "o.csv"],
        check=True,
        stdout=subprocess.PIPE,
        stderr=other_end,
        text=True,
    )
    os.write(other_end, b"end")
    shown = os.read(main_end, 100_000).decode()
    os.close(other_end)
    os.close(main_end)
    assert ("44 frames" in shown) is (option == ["--progress"])
    assert ("k/s" in shown) is (option == ["--progress"])
    assert convert(log, "--out", tmp_path / "o.csv") == 0
    assert capsys.readouterr() == (done.stdout, "")


@pytest.mark.slow
@pytest.mark.parametrize("suffix", ["csv", "csv.gz", "parquet", "mf4", "mcap", "arrow", "arrows"])
def test_memory_does_not_grow_with_the_recording(tmp_path, suffix):
    peaks = []
    for count in (300_000, 1_500_000):
        log = tmp_path / "a.log"
        with log.open("w") as file:
            file.writelines(line(100 * k, 170, k.to_bytes(8)) for k in range(count))
        code = (
            "import resource, sys; from adhesion_can.cli.main import main; status = main();"
            "print(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss, file=sys.stderr);"
            "sys.exit(status)"
        )
        arguments = ["convert", log, "--dbc", CAR, "--out", tmp_path / f"o.{suffix}"]
        done = subprocess.run(
            [sys.executable, "-c", code, *map(str, arguments)],
            check=True,
            capture_output=True,
            text=True,
        )
        peaks.append(int(done.stderr.split()[-1]) / 1024)
    assert peaks[1] < 1.15 * peaks[0] + 10, peaks  # MiB


# --- folders and pipes


def test_a_folder_gets_a_file_a_message_and_the_report_says_so(log, tmp_path, capsys):
    out = tmp_path / "o"
    assert convert(log, "--out", f"{out}/", "--json", tmp_path / "o.json") == 0
    files = sorted(path.name for path in out.iterdir())
    assert files == ["WheelSpeeds1.parquet", "WheelSpeeds2.parquet", "convert.json"]
    table = parquet.read_table(out / "WheelSpeeds2.parquet")
    assert table.column_names[:3] == ["time_s", "time_ns", "Crc"]
    assert table["WheelSpeed_Ax4"].to_pylist() == [(2000 + k) * 0.002 for k in range(20)]
    assert f"{out}/: 2 files, " in capsys.readouterr().out.replace("\n", "")
    output = json.loads((tmp_path / "o.json").read_text())["output"]
    size = sum((out / name).stat().st_size for name in files[:2])
    assert output == {"path": f"{out}/", "bytes": size, "files": 2}
    listed = json.loads((out / "convert.json").read_text())
    assert listed["adhesion_can.version"] == __version__
    assert [file["rows"] for file in listed["files"]] == [19, 20]
    # Again without the slash: it is a folder by now, and one of ours.
    assert convert(log, "--out", out, "--format", "csv", "--signals", "WheelSpeeds1") == 0
    assert sorted(path.name for path in out.iterdir()) == ["WheelSpeeds1.csv", "convert.json"]


def test_buses_are_kept_apart_where_a_format_can(tmp_path, capsys):
    path = tmp_path / "a.log"
    path.write_text("".join(line(k, 180, bytes(8), f"can{k % 2}") for k in range(9)))
    assert convert(path, "--dbc", CAR, "--out", f"{tmp_path}/o/") == 0
    assert "mixed" not in capsys.readouterr().out
    rows = {
        file.name: parquet.read_metadata(file).num_rows for file in tmp_path.glob("o/*.parquet")
    }
    assert rows == {"SPEED.can0.parquet": 5, "SPEED.can1.parquet": 4}


def piped(log, *arguments):
    command = [sys.executable, "-W", "error", "-m", "adhesion_can.cli.main", "convert", str(log)]
    return subprocess.Popen(
        [*command, "--out", "-", *arguments], stdout=subprocess.PIPE, stderr=subprocess.PIPE
    )


def test_a_stream_goes_to_stdout_and_the_report_to_stderr(log):
    with piped(log, "--format", "arrow") as process:
        with pa.ipc.open_stream(process.stdout) as stream:
            rows = stream.read_all().to_pylist()
        err = process.stderr.read().decode()
    assert process.returncode == 0
    assert "44 frames" in err
    assert len(rows) == 39 * 5
    assert rows[2] == {
        "time_s": 1.7e9,
        "time_ns": 1_700_000_000 * 10**9,
        "channel": "can0",
        "message": "WheelSpeeds1",
        "signal": "WheelSpeed_Ax1",
        "value": 2.0,
        "unit": "rad/s",
    }


def test_a_reader_of_the_stream_that_goes_is_no_error(tmp_path):
    log = tmp_path / "a.log"
    rng = random.Random(1)
    log.write_text("".join(line(k, 170, rng.randbytes(8)) for k in range(200_000)))
    with piped(log, "--dbc", str(CAR)) as process:
        process.stdout.read(10)
        process.stdout.close()
        assert process.stderr.read() == b""
    assert process.returncode == 0


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("--out", "-", "--json", "-"), "--json -: stdout has the Arrow stream"),
        (("--out", "{dir}/o/", "--raster", "10ms"), "--raster writes one table"),
        (("--out", "{dir}/o.mcap", "--raster", "10ms"), "unknown format"),
        (("--out", "{dir}/none/o/"), "its folder does not exist"),
        (("--out", "{dir}/"), "contains files that convert did not write"),
        (("--out", "{log}/"), "is a file; name a folder"),
        (("--out", "{dir}/o.feather"), "it is called .arrow here"),
    ],
)
def test_bad_folders_and_pipes_are_reported(log, tmp_path, capsys, arguments, message):
    words = [word.format(log=log, dir=tmp_path) for word in arguments]
    assert message in fails(capsys, log, *words)
    assert list(tmp_path.iterdir()) == [log]


def test_small_numbers_of_csv_have_no_exponent(tmp_path):
    database = tmp_path / "s.dbc"
    database.write_text(TWICE.replace("(1,0)", "(0.00001,0)", 1))
    path = tmp_path / "a.log"
    path.write_text(line(1, 256, b"\3" + bytes(7)))
    assert convert(path, "--dbc", database, "--out", tmp_path / "o.csv") == 0
    text = rows_of(tmp_path / "o.csv")[0]["M@100.X"]
    assert text == "0.000030000000000000004"  # 3e-05 in cantools' binary arithmetic
    assert float(text) == 3 * 0.00001
