"""Notices to a service manager, read from the socket that systemd would listen on."""

import socket
from contextlib import suppress

import pytest

from adhesion_can.service.service_manager import ServiceManager


class Clock:
    now_s = 100.0

    def __call__(self):
        return self.now_s


@pytest.fixture(params=["path", "abstract"])
def manager_socket(request, tmp_path):
    """Socket of a manager, and its name in the environment."""
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as own:
        own.settimeout(5.0)
        if request.param == "path":
            name = str(tmp_path / "notify")
            own.bind(name)
        else:
            name = f"@adhesion-can-test-{tmp_path.name}"
            own.bind(name.replace("@", "\0"))
        yield own, name


def test_ready_alive_and_stopping_are_told(manager_socket):
    own, name = manager_socket
    clock = Clock()
    manager = ServiceManager({"NOTIFY_SOCKET": name, "WATCHDOG_USEC": "2000000"}, clock)
    manager.ready("listening on can0")
    assert own.recv(200) == b"READY=1\nSTATUS=listening on can0"
    for step_s in (0.0, 0.4, 0.59, 0.02, 1.0):
        clock.now_s += step_s
        manager.alive()
    manager.stopping()
    # At 0, 1.01 and 2.01 s: half of what the watchdog waits for lies between them.
    assert [own.recv(200) for _ in range(4)] == [b"WATCHDOG=1"] * 3 + [b"STOPPING=1"]


def test_without_a_watchdog_nothing_is_told_of_each_turn(manager_socket):
    own, name = manager_socket
    manager = ServiceManager({"NOTIFY_SOCKET": name})
    manager.alive()
    manager.stopping()
    assert own.recv(200) == b"STOPPING=1"


@pytest.mark.parametrize("environment", [{}, {"NOTIFY_SOCKET": "/nowhere/at/all"}])
def test_without_a_manager_nothing_happens(environment):
    manager = ServiceManager({**environment, "WATCHDOG_USEC": "1000"})
    manager.ready("")
    manager.alive()
    manager.stopping()


def test_a_manager_that_does_not_read_holds_nobody_up(manager_socket):
    own, name = manager_socket
    clock = Clock()
    manager = ServiceManager({"NOTIFY_SOCKET": name, "WATCHDOG_USEC": "2000000"}, clock)
    for _ in range(5000):
        clock.now_s += 1.0
        manager.alive()
    own.setblocking(False)
    waiting = 0
    with suppress(BlockingIOError):
        while own.recv(200):
            waiting += 1
    assert 0 < waiting < 5000
    # One that reads again need not wait for half an interval.
    clock.now_s += 0.11
    manager.alive()
    assert own.recv(200) == b"WATCHDOG=1"
