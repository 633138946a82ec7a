"""A word where nobody is heard on a bus, and the name of the bus for people."""

import argparse
import time
from collections.abc import Callable

from adhesion_can.config import Configuration

SILENT_S = 2.0
"""Time without a frame after which it is said, s; every cyclic message comes sooner."""
SHOWN_MESSAGES = 3
"""Number of messages that are named where nothing is received."""
UNNAMED = ("unknown", "closed")
"""What python-can calls a bus that does not name itself, and we one that is not open yet."""


class SilenceWatch:
    """Reports once that what is waited for has not come.

    Args:
        sentence: What is said.
        notify: Callback with the sentence.
        clock: Monotonic clock, s.

    """

    def __init__(
        self,
        sentence: str,
        notify: Callable[[str], None],
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self._sentence = sentence
        self._notify = notify
        self._clock = clock
        self._since_s: float | None = None
        self._is_over = False

    def look(self, *, heard: bool) -> None:
        """Look whether it has come; cheap, for every turn of a loop."""
        if self._is_over:
            return
        now_s = self._clock()
        if self._since_s is None:
            self._since_s = now_s
        if heard:
            self._is_over = True
        elif now_s - self._since_s >= SILENT_S:
            self._notify(self._sentence)
            self._is_over = True


def bus_name(options: argparse.Namespace, channel_info: str) -> str:
    """Name of a bus: its own, or interface and channel where python-can knows none."""
    if channel_info not in UNNAMED:
        return channel_info
    words = (getattr(options, "interface", None), getattr(options, "channel", None))
    return " ".join(str(word) for word in words if word) or channel_info


def nothing_received(config: Configuration, bus: str) -> str:
    """Sentence that nothing came on a bus, and what was waited for."""
    return (
        f"nothing received on {bus} yet: is this the vehicle's bus, and does it carry "
        f"{name_inputs(config)}? (candump or python -m can.viewer shows it)"
    )


def name_inputs(config: Configuration) -> str:
    """Names of the messages that the configuration reads; of many only the first ones."""
    plans = [message.plan for message in config.messages]
    named = ", ".join(f"{plan.name} {plan.frame_id:#x}" for plan in plans[:SHOWN_MESSAGES])
    return named + (", .." if len(plans) > SHOWN_MESSAGES else "")
