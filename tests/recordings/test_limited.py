"""Work in a process of its own: what it gives, and that it ends whatever it does."""

import os
import signal
import sys
import tempfile
import threading
from functools import partial
from pathlib import Path

import numpy as np
import pytest

from adhesion_can.errors import TableError
from adhesion_can.recordings.limited import LimitError, Limits, read_limited

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


def writing(size):
    with tempfile.NamedTemporaryFile(delete=False) as file:
        file.write(bytes(size))
        yield file.name


@pytest.fixture(params=["copy", "new"])
def way(request, monkeypatch):
    """Both ways: with a second thread the process cannot be copied."""
    if request.param == "copy":
        monkeypatch.setattr(threading, "active_count", lambda: 1)  # whatever other tests left
        yield
        return
    end = threading.Event()
    thread = threading.Thread(target=end.wait)
    thread.start()
    yield
    end.set()
    thread.join()


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


@pytest.mark.usefixtures("way")
def children():
    """Children of this process; other tests may have left some."""
    return set(Path(f"/proc/self/task/{os.getpid()}/children").read_text().split())


@pytest.mark.skipif(sys.platform != "linux", reason="the list of children is Linux's")
def test_the_process_ends_with_its_reader():
    before = children()
    found = read_limited(partial(counted, 10**9), FEW)
    next(found)
    assert len(children() - before) == 1
    found.close()
    assert children() <= before


def test_the_limits_grow_with_the_file():
    small, large = Limits.of_file(10_000), Limits.of_file(1 << 30)
    assert small.processor_s == 5
    assert small.memory < 500 << 20
    assert large.processor_s > 1000 * small.processor_s
    assert large.memory > 40 << 30
