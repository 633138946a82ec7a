"""Where the frames of `monitor` come from: what a source is, and a bus as one.

A source is asked at each turn for the frames that came since the last one, and for the time.
"""

import time
from collections import deque
from collections.abc import Iterable, Iterator
from typing import Protocol

from adhesion_can.bus.frame import Frame
from adhesion_can.monitoring.snapshot import Origin, Transport
from adhesion_can.service.bus_listener import BusListener
from adhesion_can.service.core import ServiceCore
from adhesion_can.service.replay import with_answers

TURN_S = 0.06
"""Longest time of a turn, s: the view comes at 10 Hz, whatever the frame rate."""
NOTES = 4
"""Number of lines for the operator that are kept."""
ON_ITS_WAY_US = 200_000
"""Longest time from a frame's stamp until it is taken here, µs."""
LOOKED_AT = 64
"""Number of frames between two looks at the clock."""


class Source(Protocol):
    """Frames as they come."""

    origin: Origin
    """Where the service's messages come from."""
    made_here: frozenset[tuple[int, bool]]
    """Ids of frames that are on no bus, since the service runs here."""

    def take(self) -> Iterable[Frame]:
        """Frames that came since the last call."""

    @property
    def now_us(self) -> int:
        """Time of the source, µs."""

    @property
    def generation(self) -> int:
        """Number of jumps: what was known before one holds no more."""

    def transport(self) -> Transport:
        """How the frames come."""

    def close(self) -> None:
        """End."""


class LiveSource:
    """Frames of a bus.

    Args:
        listener: Listener, started.
        name: Name of the bus.
        core: Service that runs here; None: one on the bus is shown.
        notes: Lines for the operator.

    """

    def __init__(
        self, listener: BusListener, name: str, core: ServiceCore | None, notes: deque[str]
    ) -> None:
        self.origin = Origin.SENT if core is None else Origin.ESTIMATED_HERE
        self.made_here = frozenset() if core is None else core.messages.ids
        self.generation = 0
        self._listener = listener
        self._name = name
        self._core = core
        self._notes = notes

    @property
    def now_us(self) -> int:
        """Time of this host, µs."""
        return self._listener.clock()

    def take(self) -> Iterator[Frame]:
        """Frames that came since the last call, as many as a turn has time for."""
        until_s = time.monotonic() + TURN_S
        while frames := self._listener.take(LOOKED_AT):
            yield from frames if self._core is None else with_answers(frames, self._core)
            if time.monotonic() >= until_s:
                return
        if self._core is not None:
            # A silent bus makes the service's inputs stale; what is on its way counts before that.
            yield from self._core.due_frames(self.now_us - ON_ITS_WAY_US)

    def transport(self) -> Transport:
        """How the frames come."""
        return Transport(
            name=self._name,
            origin=self.origin,
            is_open=self._listener.is_open,
            dropped=self._listener.dropped,
            notes=tuple(self._notes),
        )

    def close(self) -> None:
        """Close the bus."""
        self._listener.stop()
