"""What the live benchmark's processes share: the drive that is played, and a bus that is timed."""

import os
import sys
import threading
import time
from typing import NamedTuple

import numpy as np

if "ADHESION_CAN_EMULATED" in os.environ:
    # python-can imports asammdf where it is installed, and that polars, which needs more of a
    # processor than the emulated one has, and ends Python there. No MF4 file is read here.
    sys.modules["asammdf"] = None

import can

from adhesion_can.bus.frame import Frame
from adhesion_can.config import load_configuration
from adhesion_can.simulation.run import RunSettings, Simulation
from adhesion_can.simulation.scenarios import scenario_by_name

FOREIGN = 0x5A0
"""First identifier of foreign frames, which no message of ours has."""
LEAD_S = 1.0
"""Time before the first frame is sent, in which the other side gets ready, s."""


class Bus(NamedTuple):
    """A bus of python-can.

    Attributes:
        interface: Name of the interface.
        channel: Name of the channel.

    """

    interface: str
    channel: str

    def open(self, **options):
        return can.Bus(interface=self.interface, channel=self.channel, **options)


def drive_frames(seconds, foreign_rate):
    """Frames of a dry drive, full input set, with foreign ones between them; by their stamps."""
    config = load_configuration()
    simulation = Simulation(RunSettings(scenario_by_name("dry"), seconds), config.database)
    frames = [frame for step in simulation.run() for frame in step]
    rng = np.random.default_rng(1)
    count = round(foreign_rate * seconds)
    stamps = np.sort(rng.uniform(frames[0].t_us, frames[-1].t_us, count)).astype(np.int64)
    frames += [
        Frame(int(t_us), FOREIGN + k % 64, rng.bytes(8), is_extended=False)
        for k, t_us in enumerate(stamps)
    ]
    return sorted(frames, key=lambda frame: frame.t_us)


def play(bus, frames, pauses_s=()):
    """Send frames at their stamps, from now on; returns how many were sent.

    Args:
        bus: Open bus.
        frames: Frames by stamp.
        pauses_s: Begins and ends of spans in which nothing is sent, s since the first frame.

    """
    first_us, began = frames[0].t_us, time.perf_counter()
    sent = 0
    for frame in frames:
        at_s = (frame.t_us - first_us) / 1e6
        if any(begin <= at_s < end for begin, end in pauses_s):
            continue
        wait_s = began + at_s - time.perf_counter()
        if wait_s > 0:
            time.sleep(wait_s)
        bus.send(
            can.Message(
                arbitration_id=frame.arbitration_id,
                data=frame.data,
                is_extended_id=frame.is_extended,
            )
        )
        sent += 1
    return sent


class TimedBus:
    """A bus that notes when a frame came, and how long after it one of ours was on the bus.

    Args:
        bus: Open bus.
        watched: Identifier of our frame.

    """

    def __init__(self, bus, watched):
        self.bus, self.watched = bus, watched
        self.channel_info = bus.channel_info
        self.delays_us, self.received, self.sent = [], 0, 0
        self._came_ns = None
        self._settled_s, self._since = 0.0, None

    def settle(self, seconds):
        """Leave out the first seconds from now on in `cpu_share`."""
        self._settled_s = time.perf_counter() + seconds

    def cpu_share(self):
        """Share of a core that this process took since it settled."""
        wall, cpu = self._since
        return (time.process_time() - cpu) / (time.perf_counter() - wall)

    def recv(self, timeout):
        message = self.bus.recv(timeout)
        if self._since is None and time.perf_counter() > self._settled_s:
            self._since = time.perf_counter(), time.process_time()
        self._came_ns = None if message is None else time.perf_counter_ns()
        self.received += message is not None
        return message

    def send(self, message):
        self.bus.send(message)
        self.sent += 1
        if message.arbitration_id == self.watched and self._came_ns is not None:
            self.delays_us.append((time.perf_counter_ns() - self._came_ns) / 1e3)

    def set_filters(self, filters):
        self.bus.set_filters(filters)

    def shutdown(self):
        self.bus.shutdown()


def play_beside(bus, frames):
    """A thread that plays frames on a bus of its own after `LEAD_S`."""

    def run():
        with bus.open() as own:
            time.sleep(LEAD_S)
            play(own, frames)

    thread = threading.Thread(target=run, daemon=True)
    thread.start()
    return thread
