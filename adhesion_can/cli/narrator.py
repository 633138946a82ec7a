"""Lines for the operator of `run`: text or JSON on stderr, not more than a log can take."""

import logging
import time
from collections.abc import Callable
from typing import Any, TextIO

from pythonjsonlogger.json import JsonFormatter

from adhesion_can.physics.doubt import Doubt, doubt_sentence
from adhesion_can.physics.objection import NEEDS_RELIEF, Objection, objection_sentence
from adhesion_can.physics.status import Status
from adhesion_can.printable import printable
from adhesion_can.result_text import TimeScale, plus_minus
from adhesion_can.service.outputs import Outputs

FORMATS = ("text", "json")
QUIET_US = 1_000_000
"""Shortest time between two lines about the same status, µs."""
BURST, LINES_PER_S = 30, 2.0
"""Number of lines that may come at once, and rate at which further ones may come, 1/s."""
KEPT_LINES = 10
"""Number of those lines that changes of status, objection and doubt leave for all others."""
_LEVELS = {Status.FAULT: logging.ERROR, Status.STALE_INPUT: logging.WARNING}


class Narrator:
    """Reports what happens: each change of status or doubt, and at a terminal once a second.

    Lines beyond the rate are left out and their number reported with the next one. A new status or
    doubt waits instead: the latest one is reported as soon as there is room. A status that changes
    all the time leaves room for other lines: that the bus is gone is said in any case.

    Args:
        file: Stream to write to.
        form: 'text', or 'json' for one JSON object a line.
        clock: Monotonic clock, s.
        is_taken: Function that returns whether the stream takes another line; where it does not,
            lines are left out as beyond the rate.

    """

    def __init__(
        self,
        file: TextIO,
        form: str = "text",
        clock: Callable[[], float] = time.monotonic,
        is_taken: Callable[[], bool] = lambda: True,
    ) -> None:
        handler = logging.StreamHandler(file)
        if form == "json":
            names = {"levelname": "level"}
            handler.setFormatter(
                JsonFormatter(
                    "%(levelname)s %(message)s",
                    rename_fields=names,
                    timestamp="time",
                )
            )
        # Of this narrator alone: no other library's lines, no other handlers.
        self._logger = logging.Logger("adhesion_can")  # noqa: LOG001
        self._logger.addHandler(handler)
        self._cleaned = printable if form == "text" else str  # JSON has escapes of its own
        self._lives = form == "text" and file.isatty()
        self._clock = clock
        self._is_taken = is_taken
        self._room, self._counted_s = float(BURST), clock()
        self._left_out = 0
        self._is_text = form == "text"
        self._times: TimeScale | None = None
        """Scale of the times in lines of text, from the first setpoint on."""
        self._status: Status | None = None
        self._printed_us = 0
        self._doubt = Doubt.NONE
        self._objection = Objection.NONE

    def print(self, line: str) -> None:
        """Report what was done."""
        self._write(logging.INFO, line)

    def warn(self, line: str) -> None:
        """Report what somebody should look at."""
        self._write(logging.WARNING, line)

    def print_setpoint(self, t_us: int, outputs: Outputs) -> None:
        """Report a new status, objection or doubt at a due time, µs.

        In text the date is given once, and times count from there; JSON has the bus's stamps.
        """
        if self._times is None:
            self._times = TimeScale.beginning_at(t_us) if self._is_text else TimeScale()
            if self._times.begin:
                self._write(logging.INFO, f"times in s since {self._times.begin}")
        self._print_status(t_us, outputs)
        objection, doubt = outputs.objection, outputs.doubt
        if objection is not self._objection and self._has_room(KEPT_LINES):
            known = self._objection in NEEDS_RELIEF
            self._objection = objection
            sentence = objection_sentence(objection)
            otherwise = "the slips are known again" if known else "the readings agree again"
            self._warn_of(t_us, sentence, otherwise, {"objection": objection.name})
        # 'Not available' in between neither confirms the last doubt nor takes it away.
        if doubt not in (self._doubt, Doubt.NOT_AVAILABLE) and self._has_room(KEPT_LINES):
            self._doubt = doubt
            self._warn_of(t_us, doubt_sentence(doubt), "no more doubt", {"doubt": doubt.name})

    def _warn_of(self, t_us: int, sentence: str, otherwise: str, fields: dict[str, Any]) -> None:
        """Warn by a sentence; where it is empty, say what holds again."""
        level = logging.WARNING if sentence else logging.INFO
        line = f"{self._time(t_us)} {sentence or otherwise}"
        self._tell(level, line, {"bus_time_s": t_us / 1e6, **fields})

    def _print_status(self, t_us: int, outputs: Outputs) -> None:
        # A log file wants changes alone; a person at a terminal wants to see that it lives.
        if outputs.status is self._status and (
            not self._lives or t_us - self._printed_us < QUIET_US
        ):
            return
        if not self._has_room(KEPT_LINES):
            return
        self._status, self._printed_us = outputs.status, t_us
        point = outputs.setpoint
        line = (
            f"{self._time(t_us)} {outputs.status.name:15} "
            f"mu_max {plus_minus(point.mu_max, outputs.mu_max_std)}  "
            f"lambda_m {plus_minus(point.lambda_m, outputs.lambda_m_std)}"
            f"{'  speed observed' if outputs.speed_observed else ''}"
        )
        fields: dict[str, Any] = {
            "bus_time_s": t_us / 1e6,
            "status": outputs.status.name,
            "mu_max": point.mu_max,
            "lambda_m": point.lambda_m,
        }
        if outputs.speed_observed:
            fields["speed_source"] = "observed"
        self._tell(_LEVELS.get(outputs.status, logging.INFO), line, fields)

    def _time(self, t_us: int) -> str:
        return f"{(self._times or TimeScale()).seconds(t_us / 1e6):.2f}"

    def _write(self, level: int, line: str) -> None:
        """Write a line where the rate allows it."""
        if self._has_room():
            self._tell(level, line)
        else:
            self._left_out += 1

    def _has_room(self, kept: int = 0) -> bool:
        """Whether the rate allows a line more than those that are kept for others."""
        now_s = self._clock()
        self._room = min(self._room + (now_s - self._counted_s) * LINES_PER_S, float(BURST))
        self._counted_s = now_s
        return self._room >= kept + 1.0 and self._is_taken()

    def _tell(self, level: int, line: str, fields: dict[str, Any] | None = None) -> None:
        self._room -= 1.0
        if self._left_out:
            fields = {**(fields or {}), "lines_left_out": self._left_out}
            line = f"{line} ({self._left_out} lines dropped before)"
            self._left_out = 0
        self._logger.log(level, "%s", self._cleaned(line), extra=fields)
