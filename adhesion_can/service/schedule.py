"""Due times of cyclic messages: T0 + k · cycle with k = 0, 1, 2, ...

T0 is the stamp of the first accepted input. Messages that are due at the same time are sent in
ascending order of their ids.
"""

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray


class Schedule:
    """Next due time of each cyclic message.

    Args:
        cycles_us: Cycle of each message by its name, µs, in the order in which messages with the
            same due time are sent.

    """

    def __init__(self, cycles_us: Mapping[str, int]) -> None:
        self._cycles_us = dict(cycles_us)
        self._due_us: dict[str, int] = {}

    @property
    def started(self) -> bool:
        """Whether T0 is known."""
        return bool(self._due_us)

    @property
    def next_due_us(self) -> int | None:
        """Time at which the next message is due, µs; None before the start."""
        return min(self._due_us.values()) if self._due_us else None

    def is_due(self, name: str, t_us: int) -> bool:
        """Whether a message is due at exactly this time, µs."""
        return self._due_us.get(name) == t_us

    def start(self, t0_us: int) -> None:
        """Make every message due at T0, and then once a cycle."""
        self._due_us = dict.fromkeys(self._cycles_us, t0_us)

    def stop(self) -> None:
        """Forget T0: no message is due until the next start."""
        self._due_us = {}

    def pop_due(self, t_us: int) -> list[str]:
        """Names of the messages due at exactly this time; each is due again a cycle later."""
        names = [name for name, due_us in self._due_us.items() if due_us == t_us]
        for name in names:
            self._due_us[name] = t_us + self._cycles_us[name]
        return names

    def due_times(self, until_us: int) -> NDArray[np.int64]:
        """All due times that are still to come until a time (inclusive), µs, ascending."""
        times = [
            np.arange(due_us, until_us + 1, self._cycles_us[name])
            for name, due_us in self._due_us.items()
        ]
        return np.unique(np.concatenate(times)) if times else np.empty(0, dtype=np.int64)
