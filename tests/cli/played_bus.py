"""A bus that plays a recording by a clock of its own: `run` as it is, and faster than real time."""

import signal
from functools import partial
from pathlib import Path

import can
import numpy as np
import pytest

from adhesion_can.bus.frame import Frame, to_us
from adhesion_can.cli.main import main
from adhesion_can.recordings.python_can_messages import from_message, to_message
from adhesion_can.recordings.recording import Recording
from adhesion_can.service.live import LiveService
from tests.wire import decoded, seal_ok


class PlayedBus:
    """Delivers the frames of a recording at their stamps, and keeps what it is given to send.

    Time passes while a frame is waited for, and only then. After the last frame the process is
    asked to stop, as by a user.
    """

    channel_info = "a played recording"

    def __init__(self, log: Path, until_s: float) -> None:
        frames = [frame for frame in Recording(log) if isinstance(frame, Frame)]
        self.begun_us = self.now_us = frames[0].t_us
        self._frames = [f for f in frames if f.t_us < self.begun_us + until_s * 1e6]
        self._next = 0
        self.sent: list[Frame] = []

    def clock(self) -> int:
        return self.now_us

    def recv(self, timeout: float) -> can.Message | None:
        if self._next == len(self._frames):
            signal.raise_signal(signal.SIGTERM)
            return None
        frame, latest_us = self._frames[self._next], self.now_us + round(timeout * 1e6)
        self.now_us = min(max(frame.t_us, self.now_us), latest_us)
        if frame.t_us > latest_us:
            return None
        self._next += 1
        return to_message(frame)

    def send(self, message: can.Message) -> None:
        assert to_us(message.timestamp) <= self.now_us
        self.sent.append(from_message(message))

    def set_filters(self, filters: object) -> None:
        pass

    def shutdown(self) -> None:
        pass

    def texts(self, name: str, signal_name: str) -> np.ndarray:
        """Values of a signal that was sent, by their names."""
        return np.array([str(value) for value in self._values(name, signal_name)])

    def numbers(self, name: str, signal_name: str) -> np.ndarray:
        """Values of a signal that was sent; NaN where it was not available."""
        values = self._values(name, signal_name)
        return np.array([v if isinstance(v, int | float) else np.nan for v in values])

    def _values(self, name: str, signal_name: str) -> list:
        frames = [f for f in self.sent if f.arbitration_id == IDS[name]]
        assert all(map(seal_ok, frames))
        return [decoded(f)[signal_name] for f in frames]

    def time_s(self, name: str) -> np.ndarray:
        """Time since the first frame at which a message was sent, s."""
        stamps = [f.t_us for f in self.sent if f.arbitration_id == IDS[name]]
        return (np.array(stamps) - self.begun_us) / 1e6


IDS = {"AdhesionSetpoint": 0x201, "AdhesionQuality": 0x203, "ServiceStatus": 0x211}
AT_THE_END = 10
"""Number of frames with which the service ends: every message once, AxleSetpoint for six axles."""


def run_on_recording(
    monkeypatch: pytest.MonkeyPatch, log: Path, *options: str, until_s: float = np.inf
) -> PlayedBus:
    """The bus after `adhesion-can run` on it."""
    bus = PlayedBus(log, until_s)
    monkeypatch.setattr("adhesion_can.cli.run.bus_opener", lambda _: lambda: bus)
    monkeypatch.setattr("adhesion_can.cli.run.LiveService", partial(LiveService, clock=bus.clock))
    handlers = {n: signal.getsignal(n) for n in (signal.SIGINT, signal.SIGTERM)}
    try:
        assert main(["run", "-i", "virtual", "-c", "played", *options]) == 0
    finally:
        for number, handler in handlers.items():
            signal.signal(number, handler)
    # With its last frames the service takes back what it sent: no part of the drive.
    end = [frame.arbitration_id for frame in bus.sent[-AT_THE_END:]]
    assert (end[0], end[-1]) == (IDS["AdhesionSetpoint"], IDS["ServiceStatus"])
    del bus.sent[-AT_THE_END:]
    return bus
