"""Losses in the kernel, of a real socket whose buffer overflows."""

import socket
import sys

import pytest

from adhesion_can.service.kernel_losses import (
    INTERFACES,
    count_drops,
    count_unsent,
    enlarge_buffer,
    read_unsent,
)
from adhesion_can.service.reconnecting_bus import ReconnectingBus

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="Linux counts them")


class SocketBus:
    """A bus that shows its socket, as python-can's SocketCAN does."""

    channel_info = "socket"

    def __init__(self, buffer_bytes=None):
        self.socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        if buffer_bytes:
            self.socket.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, buffer_bytes)
        self.socket.bind(("127.0.0.1", 0))
        self.socket.setblocking(False)
        self.lost = False

    def flood(self, frames):
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sender:
            for number in range(frames):
                sender.sendto(number.to_bytes(16, "little"), self.socket.getsockname())

    def waiting(self):
        """Number of frames that were kept; reads them."""
        count = 0
        while True:
            try:
                self.socket.recv(64)
            except BlockingIOError:
                return count
            count += 1

    def recv(self, timeout):
        if self.lost:
            raise OSError("down")

    def set_filters(self, filters):
        pass

    def shutdown(self):
        self.socket.close()


@pytest.fixture
def open_bus():
    """Opens buses, and closes them."""
    opened = []

    def open_one(**options):
        opened.append(SocketBus(**options))
        return opened[-1]

    yield open_one
    for bus in opened:
        bus.shutdown()


def test_every_frame_is_kept_or_counted(open_bus):
    bus = open_bus(buffer_bytes=4096)
    if count_drops(bus) is None:
        pytest.skip("this kernel does not tell")
    bus.flood(2000)
    kept = bus.waiting()
    assert kept < 2000
    assert count_drops(bus) == 2000 - kept
    bus.shutdown()
    assert count_drops(bus) is None


def test_a_bus_gets_a_larger_buffer_as_far_as_the_kernel_gives_it(open_bus):
    bus = open_bus(buffer_bytes=4096)
    before = bus.socket.getsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF)
    enlarge_buffer(bus)
    assert bus.socket.getsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF) > before


def test_losses_of_a_bus_that_was_lost_still_count(open_bus):
    first, second = open_bus(), open_bus()
    if count_drops(first) is None:
        pytest.skip("this kernel does not tell")
    buses = [first, second]
    clock = [0.0, 0.0]
    bus = ReconnectingBus(lambda: buses.pop(0), (), clock=lambda: clock[0], sleep=clock.append)
    # What the service asked for is more than this test wants to fill.
    first.socket.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
    first.flood(2000)
    lost = 2000 - first.waiting()
    assert bus.kernel_drops == lost > 0
    first.lost = True
    bus.receive(0.0)
    assert bus.kernel_drops == lost
    clock[0] = 10.0
    bus.receive(0.0)
    second.socket.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
    second.flood(1500)
    assert bus.kernel_drops == lost + 1500 - second.waiting()
    bus.shutdown()


def test_a_bus_without_a_socket_tells_nothing():
    class Plain:
        channel_info = "plain"

        def set_filters(self, filters):
            pass

    assert count_drops(Plain()) is None
    assert ReconnectingBus(Plain, ()).kernel_drops == 0
    assert count_unsent(Plain()) is None


def test_a_socket_of_another_kind_tells_nothing_of_what_was_sent(open_bus):
    assert count_unsent(open_bus()) is None


def test_what_an_interface_dropped_instead_of_sending(tmp_path):
    folder = tmp_path / "can0" / "statistics"
    folder.mkdir(parents=True)
    (folder / "tx_dropped").write_text("31\n")
    assert read_unsent("can0", tmp_path) == 31
    assert read_unsent("can1", tmp_path) is None
    assert read_unsent("", tmp_path) is None


@pytest.mark.skipif(not (INTERFACES / "lo").exists(), reason="no interfaces are shown here")
def test_the_interfaces_of_this_machine_tell():
    assert read_unsent("lo") is not None
