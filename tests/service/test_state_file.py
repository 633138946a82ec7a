"""`run --state F` with files that are none, disks that are read-only, and a second service."""

import errno
import os
import signal
import stat
import subprocess
import sys
from pathlib import Path

import pytest

from adhesion_can.cli.main import main
from adhesion_can.config import load_configuration
from adhesion_can.errors import InputError
from adhesion_can.service.file_lock import file_lock
from adhesion_can.service.kept_state import KeptState, fingerprint
from adhesion_can.service.state_file import read_state
from tests.terminals import Terminal

WORDS = ["run", "-i", "virtual", "-c", "state", "--duration", "0.1", "--state"]
"""Words of a service on a bus without a frame, which therefore ends with 1."""
CODE = "import sys; from adhesion_can.cli.main import main; sys.exit(main())"
EMPTY = KeptState(fingerprint(load_configuration()))


def run(path):
    """Status and stderr of a service of its own, which must not hang."""
    words = [sys.executable, "-c", CODE, *WORDS, str(path)]
    done = subprocess.run(words, check=False, capture_output=True, text=True, timeout=200)
    return done.returncode, done.stderr


@pytest.mark.parametrize("form", ["pipe", "device"])
def test_what_is_no_file_is_refused_and_stays(tmp_path, form):
    path = tmp_path / "state"
    if form == "pipe":
        os.mkfifo(path)
    else:
        try:
            os.mknod(path, 0o666 | stat.S_IFCHR, os.makedev(1, 7))
            os.close(os.open(path, os.O_RDONLY))
        except OSError as error:
            pytest.skip(f"no device can be made and opened here ({error})")
    kind = path.stat().st_mode
    status, said = run(path)
    assert status == 2
    assert said == (
        f"adhesion-can run: --state {path}: is a pipe or a device, not a file; name a file\n"
    )
    assert path.stat().st_mode == kind
    assert [one.name for one in tmp_path.iterdir()] == ["state"]


def read(path):
    told = []
    return read_state(load_configuration(), path, told.append), told


@pytest.mark.parametrize("code", [errno.EROFS, errno.EACCES])
def test_a_damaged_file_on_a_disk_that_is_read_only_stays_and_is_told(tmp_path, monkeypatch, code):
    path = tmp_path / "state"
    path.write_text("{")

    def fails(*_):
        raise OSError(code, os.strerror(code))

    monkeypatch.setattr("pathlib.os.replace", fails)
    state, told = read(path)
    assert state == EMPTY
    (line,) = told
    assert "damaged: not JSON; starting cold; it cannot be renamed" in line
    assert os.strerror(code) in line
    assert path.read_text() == "{"


@pytest.mark.usefixtures("restored_signals")
def test_a_service_begins_cold_on_a_disk_that_is_read_only(tmp_path, monkeypatch, capsys):
    path = tmp_path / "state"
    path.write_text("{")
    opened = os.open

    def read_only(name, flags, *rest, **named):
        if flags & (os.O_CREAT | os.O_WRONLY | os.O_RDWR):
            raise OSError(errno.EROFS, os.strerror(errno.EROFS), str(name))
        return opened(name, flags, *rest, **named)

    def fails(*_):
        raise OSError(errno.EROFS, os.strerror(errno.EROFS))

    monkeypatch.setattr("os.open", read_only)
    monkeypatch.setattr("os.replace", fails)
    assert main([*WORDS, str(path)]) == 1
    said = capsys.readouterr().err
    assert "starting cold; it cannot be renamed (Read-only" in said
    assert [one.name for one in tmp_path.iterdir()] == ["state"]


def test_a_refused_file_that_cannot_be_renamed_is_not_written_over(tmp_path):
    path = tmp_path / "state"
    path.write_text("{")
    (tmp_path / "state.refused").mkdir()
    with pytest.raises(InputError, match=r"nor renamed to state\.refused .*out of the way"):
        read(path)
    assert path.read_text() == "{"


def test_a_refused_file_behind_a_link_is_renamed_where_it_is(tmp_path):
    (folder := tmp_path / "there").mkdir()
    (folder / "real").write_text("{")
    victim = tmp_path / "victim"
    victim.write_text("precious")
    (folder / "real.refused").symlink_to(victim)
    path = tmp_path / "state"
    path.symlink_to(folder / "real")
    assert read(path)[0] == EMPTY
    assert (folder / "real.refused").read_text() == "{"
    assert not (folder / "real.refused").is_symlink()
    assert victim.read_text() == "precious"
    assert path.is_symlink()


def test_a_file_of_any_bytes_is_refused_or_read(tmp_path):
    path = tmp_path / "state"
    for content in (b"\xff\xfe", bytes(5_000_000), b"[" * 100_000, b'"\\ud800"'):
        path.write_bytes(content)
        state, told = read(path)
        assert state == EMPTY
        assert len(told) == 1


@pytest.mark.usefixtures("restored_signals")
def test_a_second_service_on_one_state_is_refused(tmp_path, capsys):
    path = tmp_path / "state"
    with file_lock(path, "state"):
        assert main([*WORDS, str(path)]) == 2
    said = capsys.readouterr().err
    assert said == (
        f"adhesion-can run: --state {path}: is in use by another process of adhesion-can; stop "
        f"that process, or name another file ({path}.lock)\n"
    )
    assert main([*WORDS, str(path)]) == 1
    assert main([*WORDS, str(path)]) == 1


@pytest.mark.costly
def test_two_services_and_a_third_after_the_first_was_killed(tmp_path):
    path = tmp_path / "state"
    first = Terminal(f"adhesion-can run -i virtual -c first --state {path}", tmp_path, "first")
    try:
        first.wait_for("listening on", 200.0)
        status, said = run(path)
        assert status == 2
        assert "is in use by another process of adhesion-can" in said
    finally:
        first.process.send_signal(signal.SIGKILL)
        first.process.wait(60)
        for file in first.files:
            file.close()
    assert run(path)[0] == 1
    assert Path(f"{path}.lock").exists()
