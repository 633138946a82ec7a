"""Frames that the kernel dropped: before this process read them, or instead of sending them."""

import socket
import struct
import sys
from pathlib import Path

import can

SO_MEMINFO = 55
"""Option of Linux that gives the state of a socket's memory (include/uapi/asm-generic/socket.h)."""
MEMINFO = struct.Struct("9I")
DROPS = 8
"""Place of the number of dropped packets (SK_MEMINFO_DROPS, include/uapi/linux/sock_diag.h)."""
BUFFER_BYTES = 4 << 20
"""Receive buffer that is asked for, bytes: a second of a full bus, at some 800 bytes a frame. The
kernel gives what `net.core.rmem_max` allows."""

INTERFACES = Path("/sys/class/net")
"""Folder in which Linux shows its network interfaces."""


def socket_of(bus: can.BusABC) -> socket.socket | None:
    """Socket behind a bus; None where the interface has none that it shows, as SocketCAN does."""
    bus_socket = getattr(bus, "socket", None)
    return bus_socket if isinstance(bus_socket, socket.socket) else None


def enlarge_buffer(bus: can.BusABC) -> None:
    """Ask for a receive buffer that outlasts a pause of this process."""
    bus_socket = socket_of(bus)
    if bus_socket is None:
        return
    if bus_socket.getsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF) < BUFFER_BYTES:
        bus_socket.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, BUFFER_BYTES)


def count_drops(bus: can.BusABC) -> int | None:
    """Number of frames that the kernel dropped for want of room since the bus was opened.

    The kernel counts modulo 2³². None where it gives no count: another system, or no socket.
    """
    bus_socket = socket_of(bus)
    if bus_socket is None or sys.platform != "linux":
        return None
    try:
        info = bus_socket.getsockopt(socket.SOL_SOCKET, SO_MEMINFO, MEMINFO.size)
    except OSError:
        # A kernel before 4.12, or a closed socket.
        return None
    return int(MEMINFO.unpack(info)[DROPS]) if len(info) == MEMINFO.size else None


def count_unsent(bus: can.BusABC) -> int | None:
    """Number of frames, of any sender, that the interface dropped instead of sending them.

    So the kernel does with an adapter that only listens, and the sender does not learn of it. None
    where the bus is no SocketCAN interface.
    """
    bus_socket = socket_of(bus)
    if bus_socket is None or bus_socket.family != getattr(socket, "AF_CAN", None):
        return None
    (name, *_) = bus_socket.getsockname()
    return read_unsent(name)


def read_unsent(interface: str, interfaces: Path = INTERFACES) -> int | None:
    """Number of frames that an interface dropped instead of sending; None where nothing shows.

    Args:
        interface: Name of the interface, '' for all of them.
        interfaces: Folder of the interfaces.

    """
    if not interface:
        return None
    try:
        return int((interfaces / interface / "statistics" / "tx_dropped").read_text())
    except (OSError, ValueError):
        return None
