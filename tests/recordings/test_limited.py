"""Work in a process of its own: what it gives, and that it ends whatever it does."""

import os
import signal
import sys
import tempfile
import threading
import time
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from pathlib import Path

import numpy as np
import psutil
import pytest

from adhesion_can.errors import TableError
from adhesion_can.recordings import limited
from adhesion_can.recordings.limited import LimitError, read_limited
from adhesion_can.recordings.limited_work import Job, Limits

FEW = Limits(processor_s=1, memory=100 << 20, disk=1 << 20)


def counted(size):
    for number in range(size):
        yield number, np.full(3, number)


def endless():
    while True:
        pass


def greedy():
    yield np.ones(400 << 20, np.uint8).sum()


def refusing():
    yield 1
    raise TableError("f.mf4", "no slip", "add one")


def failing():
    yield 1
    raise KeyError("a\nb")


def crashing():
    yield 1
    os.kill(os.getpid(), signal.SIGSEGV)


def talking():
    os.write(1, b"out")
    os.write(2, b"err")
    yield 1


def here():
    yield str(Path.cwd())


def writing(size):
    with tempfile.NamedTemporaryFile(delete=False) as file:
        file.write(bytes(size))
        yield file.name


WAYS = {
    "copy": limited._Copy,
    "template": lambda job: limited._Template.of_this_process().copy(job),
    "new": limited._New,
}


@pytest.fixture(params=WAYS)
def way(request, monkeypatch):
    """All ways, whatever threads other tests left."""
    monkeypatch.setattr(limited, "_start", WAYS[request.param])
    return request.param


@pytest.mark.parametrize(
    ("platform", "threads", "way"),
    [("linux", 1, "_Copy"), ("linux", 2, "_CopyOfTemplate"), ("darwin", 1, "_New")],
)
def test_the_way_depends_on_system_and_threads(monkeypatch, tmp_path, platform, threads, way):
    monkeypatch.setattr(sys, "platform", platform)
    monkeypatch.setattr(threading, "active_count", lambda: threads)
    process = limited._start(Job(partial(counted, 3), FEW, "", str(tmp_path)))
    process.stop()
    assert type(process).__name__ == way


@pytest.mark.usefixtures("way")
def test_items_come_in_their_order():
    found = list(read_limited(partial(counted, 100), FEW))
    assert [number for number, _ in found] == list(range(100))
    assert all((array == number).all() for number, array in found)


@pytest.mark.usefixtures("way")
def test_a_refusal_is_the_same_error():
    found = read_limited(refusing, FEW)
    assert next(found) == 1
    with pytest.raises(TableError, match=r"f.mf4: no slip; add one") as error:
        next(found)
    assert error.value.fix == "add one"


@pytest.mark.usefixtures("way")
@pytest.mark.parametrize(
    ("work", "words"),
    [
        (endless, "more than 1 s of processor time"),
        (greedy, "more than 100 MiB of memory"),
        (crashing, r"ended early \(SIGSEGV\)"),
        (failing, r"failed \(KeyError: 'a\\nb'\)"),
        (partial(writing, 3 << 20), r"failed \(OSError: .*[Ff]ile too large"),
    ],
)
def test_what_goes_too_far_is_one_error(work, words):
    with pytest.raises(LimitError, match=words):
        list(read_limited(work, FEW))


@pytest.mark.usefixtures("way")
def test_nothing_is_said_beside_the_items(capfd):
    assert list(read_limited(talking, FEW)) == [1]
    assert capfd.readouterr() == ("", "")


@pytest.mark.usefixtures("way")
def test_what_is_left_in_the_way_is_taken_away():
    (name,) = read_limited(partial(writing, 10), FEW)
    assert not Path(name).exists()


def processes():
    """Processes below this one; other tests may have left some."""
    return {process.pid for process in psutil.Process().children(recursive=True)}


def test_the_process_ends_with_its_reader(way):
    list(read_limited(partial(counted, 1), FEW))  # a template starts, and stays
    before = processes()
    found = read_limited(partial(counted, 10**9), FEW)
    next(found)
    assert len(processes() - before) == (2 if way == "template" else 1)  # with what guards it
    found.close()
    until_s = time.monotonic() + 30
    while not processes() <= before:  # the guard of a copy ends just after it
        assert time.monotonic() < until_s
        time.sleep(0.01)


def test_copies_of_a_template_are_where_this_process_is(monkeypatch, tmp_path):
    monkeypatch.setattr(limited, "_start", WAYS["template"])
    for name in "ab":
        (tmp_path / name).mkdir()
        monkeypatch.chdir(tmp_path / name)
        assert list(read_limited(here, FEW)) == [str(tmp_path / name)]


def test_a_template_that_was_killed_starts_again(monkeypatch):
    monkeypatch.setattr(limited, "_start", WAYS["template"])
    template = limited._Template.of_this_process()
    template._process.kill()
    template._process.wait()
    assert list(read_limited(here, FEW)) == [str(Path.cwd())]
    assert limited._Template.of_this_process() is not template


def test_a_template_that_is_gone_is_one_error(tmp_path):
    template = limited._Template()
    template._process.kill()
    template._process.wait()
    with pytest.raises(LimitError, match="its reader cannot start"):
        template.copy(Job(here, FEW, "", str(tmp_path)))
    template._requests.close()


def test_many_threads_read_at_the_same_time(monkeypatch):
    monkeypatch.setattr(limited, "_start", WAYS["template"])
    with ThreadPoolExecutor(8) as pool:
        sizes = [*range(24), *range(24)]
        read = pool.map(lambda size: list(read_limited(partial(counted, size), FEW)), sizes)
        assert [len(items) for items in read] == sizes


def test_the_limits_grow_with_the_file():
    small, large = Limits.of_file(10_000), Limits.of_file(1 << 30)
    assert small.processor_s == 5
    assert small.memory < 500 << 20
    assert large.processor_s > 1000 * small.processor_s
    assert large.memory > 40 << 30
