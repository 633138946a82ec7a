"""A bus between a test and a service in a process of its own, on a pair of sockets.

No interface of the kernel and no network is needed, and no frame of the service is lost. What the
service does not fetch in time is dropped as by a kernel, stamped when it was sent.
"""

import os
import select
import signal
import socket
import struct
import subprocess
import sys
import threading
import time
from pathlib import Path

import can

from adhesion_can.bus.frame import Frame
from adhesion_can.recordings.python_can_messages import to_message
from tests.wire import Bench

ROOT = Path(__file__).resolve().parents[1]
RECORD = struct.Struct("<dIB64s")
OPENED, LOST = 0xFFFFFFFE, 0xFFFFFFFF
"""Ids of a record that says that the bus was opened, and of one after which it is gone."""
PATIENCE_S = 60.0
"""Longest wait for what takes well under a second on an idle machine."""
CODE = (
    "import sys, can.interfaces; "
    "can.interfaces.BACKENDS['virtual'] = ('tests.loopback_bus', 'LoopbackBus'); "
    "from adhesion_can.cli.main import main; sys.exit(main())"
)


class LoopbackBus(can.BusABC):
    """The service's end; its channel is the number of a descriptor."""

    def __init__(self, channel, can_filters=None, **_):
        self._socket = socket.socket(fileno=os.dup(int(channel)))
        self.channel_info = "loopback"
        super().__init__(channel, can_filters)
        self._socket.send(RECORD.pack(time.time(), OPENED, 0, b""))

    def _recv_internal(self, timeout):
        if not select.select([self._socket], [], [], timeout)[0]:
            return None, False
        stamp, number, size, data = RECORD.unpack(self._socket.recv(RECORD.size))
        if number == LOST:
            raise can.CanOperationError("the adapter was pulled")
        message = can.Message(stamp, number, is_extended_id=False, data=data[:size])
        return message, False

    def send(self, msg, timeout=None):
        size = len(msg.data)
        self._socket.send(
            RECORD.pack(time.time(), msg.arbitration_id, size, bytes(msg.data).ljust(64, b"\0"))
        )

    def shutdown(self):
        super().shutdown()
        self._socket.close()


class ServiceProcess:
    """`adhesion-can run` on a loopback bus, its frames recorded with the times of their arrival.

    Args:
        folder: Folder in which it runs.
        options: Options of the command.
        stderr: Where its stderr goes; None: into the file `stderr` of the folder.
        environment: Further variables of its environment.

    """

    def __init__(self, folder, *options, stderr=None, environment=None):
        self.folder = folder
        # Sockets that keep the bounds of messages, and tell where there is no room.
        self._own, other = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        self._sending = threading.Lock()
        self.frames = []
        """Time of arrival on the monotonic clock, s, and frame of each frame of the service."""
        self._opened, self._over = threading.Event(), threading.Event()
        words = [sys.executable, "-c", CODE, "run", "-i", "virtual", "-c", str(other.fileno())]
        variables = {**os.environ, **(environment or {})}
        variables["PYTHONPATH"] = str(ROOT)
        with (folder / "stderr").open("wb") as file:
            self.process = subprocess.Popen(
                [*words, *options], cwd=folder, env=variables, stderr=stderr or file,
                stdin=subprocess.DEVNULL, pass_fds=[other.fileno()],
            )  # fmt: skip
        other.close()
        self._threads = [
            threading.Thread(target=work, daemon=True) for work in (self._read, self._drive)
        ]
        for thread in self._threads:
            thread.start()

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self._over.set()
        if self.process.poll() is None:
            self.process.send_signal(signal.SIGCONT)
            self.process.kill()
            self.process.wait(PATIENCE_S)
        for thread in self._threads:
            thread.join(PATIENCE_S)
        self._own.close()

    def lose_bus(self):
        """Make the bus break at the service's end."""
        with self._sending:
            self._own.send(RECORD.pack(time.time(), LOST, 0, b""))

    def count(self):
        """Number of setpoints so far."""
        return len(self.setpoints())

    def setpoints(self, since_s=0.0):
        """Times of arrival and setpoints since a time."""
        recorded = list(self.frames)
        return [(t, f) for t, f in recorded if f.arbitration_id == 0x201 and t >= since_s]

    def wait_for_more(self, number):
        """Wait for so many more setpoints; returns the time at which they were there."""
        wanted = self.count() + number
        self.wait_until(lambda: self.count() >= wanted, f"{number} more setpoints")
        return time.monotonic()

    def wait_until(self, ready, what):
        end = time.monotonic() + PATIENCE_S
        while not ready():
            status = self.process.poll()
            assert status is None, f"ended with {status}: {self.said()}"
            assert time.monotonic() < end, f"no {what} within {PATIENCE_S} s: {self.said()}"
            time.sleep(0.02)

    def said(self):
        return (self.folder / "stderr").read_text(encoding="utf-8", errors="replace")

    def end(self, number=signal.SIGTERM):
        """Send a signal that ends it; returns the exit status and the time that the end took, s."""
        began = time.monotonic()
        self.process.send_signal(number)
        status = self.process.wait(PATIENCE_S)
        took_s = time.monotonic() - began
        # All that it sent is on the way to the reader.
        self._threads[0].join(PATIENCE_S)
        return status, took_s

    def _read(self):
        while True:
            ready = select.select([self._own], [], [], 0.1)[0]
            if not ready:
                if self.process.poll() is not None or self._over.is_set():
                    return
                continue
            try:
                record = self._own.recv(RECORD.size)
            except OSError:
                return
            if not record:
                return
            stamp, number, size, data = RECORD.unpack(record)
            if number == OPENED:
                self._opened.set()
                continue
            frame = Frame(round(stamp * 1e6), number, data[:size])
            self.frames.append((time.monotonic(), frame))

    def _drive(self):
        """A steady drive in real time, from the opening of the bus until the process ends."""
        while not self._opened.wait(0.1):
            if self._over.is_set():
                return
        began = time.monotonic()
        for frame in Bench().drive(0, 600_000_000):
            wait_s = frame.t_us / 1e6 - (time.monotonic() - began)
            if self._over.wait(max(wait_s, 0.0)) or self.process.poll() is not None:
                return
            message = to_message(frame)
            data = bytes(message.data).ljust(64, b"\0")
            record = RECORD.pack(time.time(), frame.arbitration_id, len(message.data), data)
            try:
                with self._sending:
                    self._own.send(record, socket.MSG_DONTWAIT)
            except BlockingIOError:
                continue  # nobody fetches it: a kernel drops it
            except OSError:
                return
