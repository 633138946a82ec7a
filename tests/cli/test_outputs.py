"""What a command writes takes no other file's place, and nothing half written stays behind."""

import json
import os
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from adhesion_can.bus.database import packaged_path
from adhesion_can.cli.main import main

CODE = "import sys; from adhesion_can.cli.main import main; sys.exit(main())"
COMMAND = [sys.executable, "-W", "error", "-c", CODE]


@pytest.fixture(scope="module")
def drive(tmp_path_factory):
    log = tmp_path_factory.mktemp("drive") / "drive.log"
    arguments = ["--scenario", "dry", "--duration", "2", "--seed", "1", "--log", str(log)]
    assert main(["simulate", *arguments]) == 0
    return log


@pytest.fixture
def files(drive, tmp_path, monkeypatch):
    """A folder with a recording under several names, and with what a command may read besides."""
    shutil.copy(drive, tmp_path / "drive.log")
    os.link(tmp_path / "drive.log", tmp_path / "hard.csv")
    (tmp_path / "soft.log").symlink_to("drive.log")
    shutil.copy(packaged_path(), tmp_path / "own.dbc")
    (tmp_path / "c.toml").write_text('[bus]\ndatabase = "own.dbc"\n')
    (tmp_path / "m.toml").write_text("")
    (tmp_path / "folder").mkdir()
    monkeypatch.chdir(tmp_path)
    return tmp_path


def fails(capsys, *arguments):
    """Runs the command, which must fail with exit status 2 and one line; returns the line."""
    assert main(list(arguments)) == 2
    said = capsys.readouterr()
    assert said.err.count("\n") == 1, said.err
    assert said.out == ""
    return said.err


def state(folder):
    return {path.name: path.read_bytes() for path in folder.iterdir() if path.is_file()}


INPUT = "is one of the inputs; name another file"
TOO = "is also the file of --out .csv; name another file"
REFUSED = [
    ("replay drive.log --frames drive.log", "--frames drive.log: is one of"),
    ("replay drive.log --json drive.log", INPUT),
    ("replay drive.log --table hard.csv", INPUT),
    ("replay drive.log --frames soft.log", INPUT),
    ("replay soft.log --frames folder/../drive.log", INPUT),
    ("replay drive.log --frames a.log --json ./a.log", "is also the file of --frames"),
    ("replay drive.log --config c.toml --json c.toml", INPUT),
    ("replay drive.log --config c.toml --json own.dbc", INPUT),
    ("replay drive.log --dbc own.dbc --frames own.dbc", INPUT),
    ("replay drive.log --frames folder", "is a folder"),
    ("replay drive.log --json ", "is a folder"),
    ("replay drive.log --json none/a.json", "its folder does not exist"),
    ("check drive.log --json drive.log", INPUT),
    ("identify drive.log --json soft.log", INPUT),
    ("calibrate drive.log --out drive.log", INPUT),
    ("calibrate drive.log --json drive.log", INPUT),
    ("calibrate drive.log --speed hard.csv --json hard.csv", INPUT),
    ("calibrate drive.log --config c.toml --json c.toml", INPUT),
    ("calibrate drive.log --config c.toml --out c.toml --json c.toml", "is also the file of --out"),
    ("diagnose drive.log --extended soft.log", INPUT),
    ("diagnose drive.log --json a --html a", "is also the file of --html"),
    ("convert drive.log --out hard.csv", INPUT),
    ("convert drive.log --out a.csv --json soft.log", INPUT),
    ("convert drive.log --out a.csv --dbc own.dbc --json own.dbc", INPUT),
    ("simulate --scenario dry --log a.log --truth a.log", "is also the file of --log"),
    ("simulate --scenario dry --log c.toml --config c.toml", INPUT),
    ("run -i virtual -c x --log c.toml --config c.toml", INPUT),
    ("run -i virtual -c x --log a --state a", "is also the file of --log"),
    (
        "simulate --scenario dry --log a.BLF",
        "name it a.log, then convert it with 'can_logconvert a.log a.BLF'",
    ),
    (
        "simulate --scenario dry --log a.db.b.db",
        "name it a.db.b.log, then convert it with 'can_logconvert a.db.b.log a.db.b.db'",
    ),
    ("run -i virtual -c x --log a.csv.gz", "the file is written as candump text"),
    ("replay drive.log --frames a.asc", "the file is written as candump text"),
    (
        "replay drive.log --frames a.log.zst",
        "candump text is compressed as .gz only; name it a.log.gz",
    ),
    ("monitor drive.log --plain --record a.mf4", "the file is written as candump text"),
    ("demo --out folder --json folder/demo.log", "is also the file of --out demo.log"),
    ("experiment 1 --out folder --json folder/experiment-1.csv", TOO),
]


@pytest.mark.parametrize(("command", "told"), REFUSED, ids=[command for command, _ in REFUSED])
def test_no_output_takes_the_place_of_another_file(files, capsys, monkeypatch, command, told):
    def read(*_):
        raise AssertionError("the work was begun")

    monkeypatch.setattr("adhesion_can.recordings.recording.Recording.blocks", read)
    before = state(files)
    words = command.split(" ")
    assert told in fails(capsys, *words)
    assert state(files) == before


def test_a_model_is_an_input_too(files, capsys):
    (files / "m.toml").write_text("[base]\nc1 = 0.4\nc2 = 30.0\nc3 = 0.4\n")
    line = fails(capsys, "replay", "drive.log", "--model", "m.toml", "--json", "m.toml")
    assert "--json m.toml: is one of the inputs" in line


@pytest.mark.parametrize(
    ("command", "option"),
    [
        (("replay", "drive.log"), "--frames"),
        (("convert", "drive.log"), "--out"),
        (("check", "drive.log"), "--json"),
    ],
)
def test_a_name_that_is_too_long_is_told_in_one_line(files, capsys, command, option):
    name = "x" * 300 + ".csv"
    assert "File name too long" in fails(capsys, *command, option, name)
    other = () if command[0] != "convert" else ("--out", "a.csv")
    assert "File name too long" in fails(capsys, command[0], name, *other)
    assert {path.name for path in files.iterdir()} == {*state(files), "folder"}


@pytest.mark.parametrize("mode", [(), ("--realtime",)])
@pytest.mark.parametrize(
    ("span", "told"),
    [
        (("--from", "nan"), "--from: nan is not a time"),
        (("--from", "inf"), "--from: inf is not a time"),
        (("--from", "-1"), "--from: -1.0 is not a time"),
        (("--to", "nan"), "--to: nan is not a time"),
        (("--to", "-0.5"), "--to: -0.5 is not a time"),
        (("--from", "2", "--to", "1.5"), "--to 1.5: is before --from 2"),
    ],
)
def test_a_span_that_is_none_is_told_before_the_work(files, capsys, monkeypatch, mode, span, told):
    def read(*_):
        raise AssertionError("the work was begun")

    monkeypatch.setattr("adhesion_can.cli.replay.open_recordings", read)
    assert told in fails(capsys, "replay", str(files / "drive.log"), *mode, *span)


# --- how a process ends


def test_a_sigterm_leaves_nothing_half_written(tmp_path):
    arguments = ["simulate", "--scenario", "dry", "--duration", "100000", "--log", "a.log"]
    with subprocess.Popen([*COMMAND, *arguments], cwd=tmp_path, stderr=subprocess.PIPE) as process:
        wait_for(tmp_path, ".a.log.*.part")
        process.terminate()
        _, err = process.communicate(timeout=60)
    assert process.returncode == 128 + signal.SIGTERM
    assert err == b""
    assert list(tmp_path.iterdir()) == []


@pytest.mark.costly
@pytest.mark.parametrize("suffix", ["csv", "parquet", "mf4"])
def test_a_sigterm_ends_a_conversion(drive, tmp_path, suffix):
    """The signal comes between two blocks."""
    code = (
        "import os, signal, sys; from adhesion_can.recordings.recording import Recording as R;"
        "from adhesion_can.cli.main import main; blocks = R.blocks\n"
        "def ended(self, *options):\n"
        "    yield from blocks(self, *options)\n"
        "    os.kill(os.getpid(), signal.SIGTERM)\n"
        "R.blocks = ended; sys.exit(main())"
    )
    command = [sys.executable, "-c", code, "convert", drive, "--out", f"a.{suffix}"]
    done = subprocess.run(command, cwd=tmp_path, check=False, capture_output=True)
    assert done.returncode == 128 + signal.SIGTERM
    assert done.stderr == b""
    assert list(tmp_path.iterdir()) == []


@pytest.mark.costly
@pytest.mark.timeout(300)
def test_a_sigterm_ends_the_workers_of_an_experiment(tmp_path):
    arguments = ["experiment", "3", "--runs", "40", "--jobs", "2", "--out", "x"]
    with subprocess.Popen([*COMMAND, *arguments], cwd=tmp_path, stderr=subprocess.PIPE) as process:
        wait_for(tmp_path, "x")
        time.sleep(3.0)  # somewhere in the work, which takes minutes
        process.terminate()
        process.communicate(timeout=100)  # ends when the workers have closed stderr, too
    assert process.returncode == 128 + signal.SIGTERM


def wait_for(folder, pattern):
    """Until a folder is there, or a file that something was written to: it is surely open."""
    until = time.monotonic() + 60
    while not any(path.stat().st_size for path in folder.glob(pattern)):
        assert time.monotonic() < until
        time.sleep(0.02)


def test_the_handler_of_sigterm_is_put_back(drive):
    assert signal.getsignal(signal.SIGTERM) is signal.SIG_DFL
    assert main(["check", str(drive)]) == 0
    assert signal.getsignal(signal.SIGTERM) is signal.SIG_DFL


@pytest.mark.parametrize(
    "arguments",
    [("convert", "--out", "a.csv"), ("convert", "--out", "a.csv", "--json", "-"), ("check",)],
)
@pytest.mark.parametrize("buffering", ["", "1"])
def test_a_full_stdout_is_told_in_one_line(drive, tmp_path, arguments, buffering):
    with Path("/dev/full").open("wb") as full:
        done = subprocess.run(
            [*COMMAND, arguments[0], drive, *arguments[1:]],
            cwd=tmp_path,
            env={**os.environ, "PYTHONUNBUFFERED": buffering},
            check=False,
            stdout=full,
            stderr=subprocess.PIPE,
            text=True,
        )
    assert done.returncode == 2
    assert done.stderr == (
        f"adhesion-can {arguments[0]}: stdout: No space left on device; free some space, or write "
        "elsewhere\n"
    )


def test_another_error_of_the_system_is_not_taken_for_one_of_stdout(drive, monkeypatch):
    def broken(*_):
        raise OSError(5, "Input/output error")

    monkeypatch.setattr("adhesion_can.recordings.recording.Recording.blocks", broken)
    with pytest.raises(OSError, match="Input/output"):
        main(["check", str(drive)])


# --- names in sentences


def test_files_of_one_name_in_two_folders_are_told_apart(files, capsys):
    (files / "drive.log").write_text("garbage\n" + (files / "drive.log").read_text())
    shutil.copy(files / "drive.log", files / "folder" / "drive.log")
    assert main(["convert", "drive.log", "folder/drive.log", "--out", "o.csv"]) == 0
    out = capsys.readouterr().out
    assert "folder/drive.log: starts before the previous file ends" in out
    assert "\ndrive.log: lines skipped: 1 malformed" in out
    assert "\nfolder/drive.log: lines skipped: 1 malformed" in out


def test_a_file_that_is_given_twice_begins_twice(files, capsys):
    log = str(files / "drive.log")
    assert main(["convert", log, log, "--out", "o.csv"]) == 0
    assert "drive.log: starts before the previous file ends" in capsys.readouterr().out


def test_tables_of_one_name_are_told_apart(files):
    lines = [f"{t},0.0{t % 9 + 1},0.{t % 9 + 11}\n" for t in range(99)]
    text = "time_s,slip,adhesion\n" + "".join(lines) + "nan,nan,nan\n"
    for path in (files / "t.csv", files / "folder" / "t.csv"):
        path.write_text(text)
    arguments = ["t.csv", "folder/t.csv", "--json", "o.json"]
    assert main(["identify", *arguments]) == 0
    problems = json.loads((files / "o.json").read_text())["problems"]
    assert [line.split(":")[0] for line in problems] == ["t.csv", "folder/t.csv"]
