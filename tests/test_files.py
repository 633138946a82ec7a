"""Every output of the package, in folders and on disks as others make them."""

import errno
import gzip
import json
import os
import re
import resource
import stat
import threading
from pathlib import Path

import numpy as np
import pytest

from adhesion_can.api.simulation import simulate
from adhesion_can.bus.database import load_database
from adhesion_can.bus.decoder import Decoder
from adhesion_can.cli.main import main
from adhesion_can.cli.outputs import write_json
from adhesion_can.config.model_file import read_model, write_model
from adhesion_can.config.plan_file import read_plan, write_plan
from adhesion_can.config.toml_tables import load_toml
from adhesion_can.control.plan_follower import DrivingPlan, PlanStep
from adhesion_can.errors import InputError
from adhesion_can.estimation.extended.model import ExtendedModel
from adhesion_can.files import OutputFile, whole_file
from adhesion_can.fleet.dataset import put
from adhesion_can.fleet.places import open_place
from adhesion_can.fleet.units import read_manifest
from adhesion_can.input_files import read_small_file
from adhesion_can.reporting.export import open_recording
from adhesion_can.reporting.export.layout import Field, FieldColumn, Group, GroupRows
from adhesion_can.reporting.export.messages import MessageRows
from adhesion_can.reporting.export.target import file_target, parse_target
from adhesion_can.reporting.page import write_page
from adhesion_can.reporting.pictures import write_pictures
from adhesion_can.service.frame_log import FrameLog
from adhesion_can.service.kept_state import KeptState
from adhesion_can.service.secoc_files import TripFile, read_key
from adhesion_can.service.state_keeper import StateKeeper
from tests.reporting.test_export import DATABASE, recorded, write
from tests.reporting.test_page import figure, page

PACKAGE = Path(__file__).resolve().parent.parent / "adhesion_can"


def log(path):
    with FrameLog(path, print) as out:
        out.write("(1.000000) can0 101#00\n")


def keep_state(path):
    """The state of a service; what its thread would only tell is raised."""
    told = []
    keeper = StateKeeper(path, KeptState("vehicle"), 1.0, told.append)
    keeper._write(KeptState("other"))
    keeper.end()
    assert keeper.wait()
    if told:
        raise InputError(*told[0].split(": ", 1), "")


def export(path):
    write(path, recorded(60)[0], 7)


WRITERS = {
    "text": (lambda path: write_json(str(path), {"a": 1}), "a.json"),
    "gzip": (lambda path: simulate("dry", 0.1).write(path), "a.log.gz"),
    "page": (lambda path: write_page(page(figure()), path), "a.html"),
    "picture": (lambda path: write_pictures(page(figure()), path), "a.svg"),
    "plan": (
        lambda path: write_plan(DrivingPlan((PlanStep(2.0, "coast"),), 10.0), path),
        "a.toml",
    ),
    "model": (lambda path: write_model(ExtendedModel((0.4, 30.0, 0.4)), path), "a.toml"),
    "log": (log, "a.log"),
    "state": (keep_state, "a.json"),
    "trip": (lambda path: TripFile(path).next_trip(), "trip"),
    **{
        suffix: (export, f"a.{suffix}")
        for suffix in ("csv", "csv.gz", "parquet", "mf4", "mcap", "arrow", "arrows")
    },
    "fleet": (lambda path: put(open_place(str(path.parent)), str(path), b"x"), "a.parquet"),
}
OLD = b"7\n"
"""What stands in a file before; a trip counter has to be one."""

every_writer = pytest.mark.parametrize("kind", WRITERS)
not_the_fleet = pytest.mark.parametrize("kind", [kind for kind in WRITERS if kind != "fleet"])


def made(kind, folder):
    """Function that writes a file of a kind, and its path."""
    writer, name = WRITERS[kind]
    path = folder / name
    return lambda: writer(path), path


def names(folder):
    """Names in a folder, without those of locks, which stay."""
    return sorted(path.name for path in folder.iterdir() if path.suffix != ".lock")


@every_writer
def test_a_link_under_a_name_that_was_foreseeable_is_not_followed(tmp_path, kind):
    (folder := tmp_path / "out").mkdir()
    victim = tmp_path / "victim"
    victim.write_text("precious")
    run, path = made(kind, folder)
    planted = [
        folder / f"{path.name}.{suffix}"
        for suffix in ("part", "part1", "part2", "tmp", f"{os.getpid()}.part")
    ]
    for link in planted:
        link.symlink_to(victim)
    run()
    assert victim.read_text() == "precious"
    assert all(link.readlink() == victim for link in planted)
    assert path.is_file()
    assert not path.is_symlink()
    assert names(folder) == sorted([path.name, *(link.name for link in planted)])


@every_writer
def test_the_rights_on_a_file_are_kept(tmp_path, kind):
    run, path = made(kind, tmp_path)
    path.write_bytes(OLD)
    for rights in (0o600, 0o640, 0o666):
        path.chmod(rights)
        run()
        assert path.read_bytes() != OLD
        assert stat.S_IMODE(path.stat().st_mode) == rights


@every_writer
def test_a_new_file_has_the_rights_that_the_umask_leaves(tmp_path, kind):
    run, path = made(kind, tmp_path)
    before = os.umask(0o027)
    try:
        run()
    finally:
        os.umask(before)
    assert stat.S_IMODE(path.stat().st_mode) == 0o640


@every_writer
@pytest.mark.parametrize("code", [errno.ENOSPC, errno.EIO, errno.EDQUOT])
def test_a_disk_that_takes_no_more_leaves_the_old_file(tmp_path, monkeypatch, kind, code):
    run, path = made(kind, tmp_path)
    path.write_bytes(OLD)

    def full(_):
        raise OSError(code, os.strerror(code))

    monkeypatch.setattr("os.fsync", full)
    if kind == "log":  # goes on without a log
        run()
        assert names(tmp_path) == ["a.log", "a.log.part"]
    else:
        with pytest.raises(InputError, match=os.strerror(code)):
            run()
        assert names(tmp_path) == [path.name]
    assert path.read_bytes() == OLD


@every_writer
def test_a_folder_that_is_read_only_is_told_in_one_line(tmp_path, monkeypatch, kind):
    run, path = made(kind, tmp_path)
    path.write_bytes(OLD)
    opened = os.open

    def read_only(name, flags, *rest, **named):
        if flags & os.O_CREAT and not Path(name).exists():
            raise OSError(errno.EROFS, os.strerror(errno.EROFS), str(name))
        return opened(name, flags, *rest, **named)

    monkeypatch.setattr("os.open", read_only)
    with pytest.raises(InputError, match="Read-only file system") as error:
        run()
    assert "\n" not in str(error.value)
    assert path.read_bytes() == OLD
    assert names(tmp_path) == [path.name]


@not_the_fleet
def test_a_link_that_the_user_named_is_followed(tmp_path, kind):
    (folder := tmp_path / "elsewhere").mkdir()
    run, path = made(kind, tmp_path)
    there = folder / path.name
    there.write_bytes(OLD)
    path.symlink_to(there.relative_to(tmp_path))
    run()
    assert path.is_symlink()
    assert there.read_bytes() != OLD
    assert names(folder) == [path.name]


@not_the_fleet
def test_a_full_device_stays_one(tmp_path, kind):
    if kind in ("state", "trip"):
        pytest.skip("a service refuses a device there")
    (folder := tmp_path / "out").mkdir()
    device = tmp_path / "full"
    try:
        os.mknod(device, 0o666 | stat.S_IFCHR, os.makedev(1, 7))
        os.close(os.open(device, os.O_WRONLY))
    except OSError as error:
        pytest.skip(f"no device can be made and opened here ({error})")
    run, path = made(kind, folder)
    path.symlink_to(device)
    if kind == "log":
        run()
    else:
        with pytest.raises(InputError, match="No space left"):
            run()
    assert device.is_char_device()
    assert path.readlink() == device
    assert names(folder) == [path.name]
    assert names(tmp_path) == ["full", "out"]


@not_the_fleet
def test_a_pipe_gets_what_a_file_gets(tmp_path, kind):
    if kind in ("state", "trip"):
        pytest.skip("a service refuses a pipe there")
    (folder := tmp_path / "out").mkdir()
    run, path = made(kind, folder)
    run()
    as_file = path.read_bytes()
    path.unlink()
    os.mkfifo(path)
    read = []
    reader = threading.Thread(target=lambda: read.append(path.read_bytes()), daemon=True)
    reader.start()
    run()
    reader.join(100)
    # Not all formats give the same bytes twice.
    assert len(read[0]) == pytest.approx(len(as_file), rel=0.05)
    assert path.is_fifo()
    assert names(folder) == [path.name]


def test_what_is_written_is_on_the_disk_before_it_has_its_name(tmp_path, monkeypatch):
    done = []
    fsync, replace = os.fsync, os.replace
    monkeypatch.setattr("os.fsync", lambda n: (done.append(os.fstat(n).st_mode), fsync(n)))
    monkeypatch.setattr("os.replace", lambda *names: (done.append("named"), replace(*names)))
    with whole_file(tmp_path / "a", durable=True) as file:
        file.write("x")
    content, name, folder = done
    assert stat.S_ISREG(content)
    assert name == "named"
    assert stat.S_ISDIR(folder)


def test_no_other_module_writes_files():
    """One place to look at; a recording of a bus by python-can would be another."""
    writing = re.compile(
        r"""open\([^)]*["'][wax]\+?b?["']|write_text|write_bytes|\.part["'{]|"""
        r"os\.(replace|rename)\(|mkstemp|NamedTemporaryFile"
    )
    found = {
        f"{path.relative_to(PACKAGE)}: {line.strip()}"
        for path in PACKAGE.rglob("*.py")
        for line in path.read_text(encoding="utf-8").splitlines()
        if path.name != "files.py" and writing.search(line) and "os.fdopen(pipe" not in line
    }
    assert not found


# --- the part of an interrupted recording


def interrupt(path):
    with whole_file(path, keep_part=True) as file:
        file.write("so far")
        raise KeyboardInterrupt


def test_the_part_of_a_recording_is_kept_and_never_takes_a_place(tmp_path):
    victim = tmp_path / "victim"
    victim.write_text("precious")
    path = tmp_path / "a.log"
    path.write_text("old")
    (tmp_path / "a.log.part").symlink_to(victim)
    (tmp_path / "a.log.2.part").symlink_to(tmp_path / "nowhere")
    for _ in range(2):
        with pytest.raises(KeyboardInterrupt):
            interrupt(path)
    assert victim.read_text() == "precious"
    assert path.read_text() == "old"
    assert (tmp_path / "a.log.3.part").read_text() == "so far"
    assert (tmp_path / "a.log.4.part").read_text() == "so far"
    assert not (tmp_path / "nowhere").exists()
    assert len(list(tmp_path.iterdir())) == 6


def test_a_recording_may_be_begun_from_the_part_of_an_earlier_one(tmp_path, monkeypatch):
    """Its part was once the temporary name of the same file, and refused."""
    monkeypatch.chdir(tmp_path)
    simulate("dry", 0.5).write(tmp_path / "run.log")
    text = Path("run.log").read_text()
    Path("run.log").rename("run.log.part")
    assert main(["replay", "run.log.part", "--frames", "run.log"]) == 0
    assert Path("run.log.part").read_text() == text


def test_a_name_as_long_as_the_system_takes_is_one(tmp_path):
    for name in ("ü" * 125 + ".json", "x" * 250 + ".json"):
        write_json(str(tmp_path / name), {"a": 1})
        assert json.loads((tmp_path / name).read_text()) == {"a": 1}


# --- names that are ours, in a folder that the user named


def test_links_in_a_folder_of_messages_are_replaced_and_not_followed(tmp_path):
    victim = tmp_path / "victim"
    victim.write_text("precious")
    (folder := tmp_path / "out").mkdir()
    planted = [
        folder / name
        for name in (".1.csv.part", ".Plain.csv.part", ".convert.json.part", "convert.json.part")
    ]
    (folder / "convert.json").write_text('{"files": [{"file": "Plain.csv"}]}')
    (folder / "Plain.csv").symlink_to(victim)
    for link in planted:
        link.symlink_to(victim)
    block = recorded(60)[0]
    target = parse_target(f"{folder}/", "--out", "csv")
    with open_recording(target, {}) as writer:
        rows = MessageRows(DATABASE, by_channel=True)
        writer.write(*rows.build(Decoder(DATABASE).decode(block), block))
    assert victim.read_text() == "precious"
    assert not (folder / "Plain.csv").is_symlink()
    assert json.loads((folder / "convert.json").read_text())["files"][0]["rows"]
    assert {path.name for path in folder.iterdir() if path.is_symlink()} == {
        link.name for link in planted
    }


def test_the_next_log_takes_no_name_that_is_a_link(tmp_path):
    (tmp_path / "a.1.log").symlink_to(tmp_path / "nowhere")
    with FrameLog(tmp_path / "a.log", print) as out:
        out.write("0\n")
        out.request_next()
        out.write("1\n")
    assert (tmp_path / "a.2.log").read_text() == "1\n"
    assert not (tmp_path / "nowhere").exists()


@pytest.mark.parametrize("command", ["demo", "experiment"])
def test_files_of_a_folder_are_written_under_names_of_ours(command):
    """Each output of a command whose --out is a folder."""
    text = (PACKAGE / "cli" / f"{command}.py").read_text()
    outputs = [
        line
        for line in text.splitlines()
        if re.search(r"(whole_file|write_json)\(", line) and "options.json" not in line
    ]
    assert outputs
    assert all("own_name=True" in line for line in outputs)


# --- pipes


def test_a_pipe_that_nobody_reads_is_told(tmp_path, monkeypatch):
    monkeypatch.setattr("adhesion_can.files.READER_WAIT_S", 0.1)
    os.mkfifo(tmp_path / "pipe")
    with pytest.raises(InputError, match="is a pipe without a reader; start its reader first"):
        OutputFile(tmp_path / "pipe")


def test_a_service_does_not_wait_for_the_reader_of_its_log(tmp_path, monkeypatch):
    monkeypatch.setattr("adhesion_can.pipes.READER_S", 0.1)
    os.mkfifo(tmp_path / "a.log")
    with pytest.raises(InputError, match="is a pipe without a reader"):
        FrameLog(tmp_path / "a.log", print)


def test_a_reader_that_comes_late_gets_all(tmp_path):
    path = tmp_path / "pipe.gz"
    os.mkfifo(path)
    read = []
    reader = threading.Timer(0.3, lambda: read.append(path.read_bytes()))
    reader.start()
    with whole_file(path) as file:
        file.write("x" * 1_000_000)
    reader.join(100)
    assert gzip.decompress(read[0]) == b"x" * 1_000_000


# --- small files that a user gives


READERS = {
    "key": (read_key, "a file of its owner with 32 digits"),
    "trip": (lambda path: TripFile(path).next_trip(), ""),
    "configuration": (load_toml, ""),
    "model": (read_model, ""),
    "plan": (read_plan, ""),
    "database": (load_database, ""),
    "manifest": (read_manifest, ""),
}


@pytest.mark.parametrize("kind", READERS)
@pytest.mark.parametrize("form", ["pipe", "device", "folder"])
def test_what_is_no_file_is_refused_at_once(tmp_path, kind, form):
    path = tmp_path / "a.dbc"
    if form == "pipe":
        os.mkfifo(path)
    elif form == "device":
        path.symlink_to("/dev/zero")
    else:
        path.mkdir()
    raised = []

    def read():
        try:
            READERS[kind][0](path)
        except InputError as error:
            raised.append(error)

    thread = threading.Thread(target=read, daemon=True)
    thread.start()
    thread.join(60)
    assert not thread.is_alive()
    (error,) = raised
    assert "\n" not in str(error)
    said = {"folder": ("Is a directory", "is a pipe or a device")}
    assert any(words in str(error) for words in said.get(form, ("is a pipe or a device",)))
    assert {one.name for one in tmp_path.iterdir()} == {"a.dbc"}


def test_a_file_that_is_too_large_is_told_with_its_limit(tmp_path):
    (tmp_path / "a").write_bytes(bytes(1001))
    assert len(read_small_file(tmp_path / "a", 1001)) == 1001
    with pytest.raises(InputError, match="larger than 1000 bytes; check that it is the right file"):
        read_small_file(tmp_path / "a", 1000)


def test_one_row_of_a_group_is_enough_for_a_part_to_be_joined(tmp_path):
    """Parts are closed while others are written: there may be more than descriptors."""
    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    resource.setrlimit(resource.RLIMIT_NOFILE, (min(128, soft), hard))
    try:
        with open_recording(file_target(tmp_path / "a.csv", "out"), {}) as writer:
            for number in range(200):
                group = Group(f"m{number}", (Field("x", np.dtype(np.int64)),))
                column = FieldColumn(np.array([number]))
                writer.write([GroupRows(group, np.array([0]), np.array([number]), [column])])
    finally:
        resource.setrlimit(resource.RLIMIT_NOFILE, (soft, hard))
    lines = (tmp_path / "a.csv").read_text().splitlines()
    assert len(lines) == 201
    assert {line.count(",") for line in lines} == {201}
    assert names(tmp_path) == ["a.csv"]
