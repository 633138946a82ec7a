"""Locks between processes: who holds one keeps it until its end, however that comes."""

import errno
import os
import signal
import subprocess
import sys
import threading
import time

import pytest

from adhesion_can.errors import InputError
from adhesion_can.service.file_lock import file_lock

HOLDER = """
import sys, time
from pathlib import Path
from adhesion_can.service.file_lock import file_lock
with file_lock(Path(sys.argv[1]), "state"):
    print("held", flush=True)
    time.sleep(600)
"""


def taken(path, wait_s=0.0):
    """Whether another has the lock."""
    try:
        with file_lock(path, "--state x", wait_s=wait_s):
            return False
    except InputError as error:
        return "is in use by another process" in str(error)


@pytest.mark.parametrize("number", [signal.SIGKILL, signal.SIGTERM])
def test_a_lock_is_held_until_the_process_ends(tmp_path, number):
    path = tmp_path / "state"  # which is not there yet
    words = [sys.executable, "-c", HOLDER, str(path)]
    with subprocess.Popen(words, stdout=subprocess.PIPE, text=True) as holder:
        assert holder.stdout.readline() == "held\n"
        assert taken(path)
        path.write_text("by its owner")
        assert taken(path)
        holder.send_signal(number)
        holder.wait(60)
    assert not taken(path)
    assert path.read_text() == "by its owner"


def test_the_lock_stays_while_the_file_is_replaced(tmp_path):
    path = tmp_path / "state"
    with file_lock(path, "state"):
        for _ in range(3):
            (tmp_path / "new").write_text("x")
            (tmp_path / "new").replace(path)
            assert taken(path)
    assert not taken(path)


def test_two_names_of_one_file_have_one_lock(tmp_path):
    (folder := tmp_path / "there").mkdir()
    path = tmp_path / "link"
    path.symlink_to(folder / "state")
    with file_lock(path, "state"):
        assert taken(folder / "state")
        assert taken(tmp_path / "there" / ".." / "there" / "state")
        assert not taken(folder / "other")
    assert not (tmp_path / "link.lock").exists()


def test_a_lock_that_is_released_in_time_is_had(tmp_path):
    path = tmp_path / "trip"
    entered, leave = threading.Event(), threading.Event()

    def hold():
        with file_lock(path, "trip"):
            entered.set()
            leave.wait(60)

    holder = threading.Thread(target=hold)
    holder.start()
    assert entered.wait(60)
    assert taken(path, wait_s=0.05)
    threading.Timer(0.2, leave.set).start()
    assert not taken(path, wait_s=60.0)
    holder.join()


def test_a_lock_whose_file_was_taken_away_is_had_anew(tmp_path, monkeypatch):
    """Else two could hold one: that of the old file and that of the new one."""
    path = tmp_path / "state"
    lock = tmp_path / "state.lock"
    opened, removed = os.open, []

    def open_and_remove(name, *rest, **named):
        number = opened(name, *rest, **named)
        if not removed:
            removed.append(lock.unlink())
        return number

    monkeypatch.setattr("os.open", open_and_remove)
    with file_lock(path, "state"):
        assert lock.exists()
        assert taken(path)


def test_a_lock_can_be_read_by_its_owner_alone(tmp_path):
    """Whoever can open it can hold it."""
    with file_lock(tmp_path / "state", "state"):
        assert (tmp_path / "state.lock").stat().st_mode & 0o777 == 0o600


@pytest.mark.parametrize("form", ["link", "pipe", "folder"])
def test_what_stands_in_the_place_of_a_lock_is_told(tmp_path, form):
    lock = tmp_path / "state.lock"
    if form == "link":
        lock.symlink_to(tmp_path / "nowhere")
    elif form == "pipe":
        os.mkfifo(lock)
    else:
        lock.mkdir()
    began = time.monotonic()
    with (
        pytest.raises(InputError, match=r"^--state s: .*state\.lock"),
        file_lock(tmp_path / "state", "--state s"),
    ):
        pass
    assert time.monotonic() - began < 60
    assert not (tmp_path / "nowhere").exists()


@pytest.mark.parametrize("code", ["EROFS", "EACCES"])
def test_what_nobody_can_write_needs_no_lock(tmp_path, monkeypatch, code):
    def fails(name, *_, **__):
        raise OSError(getattr(errno, code), os.strerror(getattr(errno, code)), str(name))

    monkeypatch.setattr("adhesion_can.service.file_lock.os.open", fails)
    with file_lock(tmp_path / "state", "state"):
        pass
    (tmp_path / "state.lock").write_text("")
    with pytest.raises(InputError, match="cannot be locked"), file_lock(tmp_path / "state", "s"):
        pass
