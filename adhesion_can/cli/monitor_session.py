"""A session of `monitor`: source, state and recorder, and times as people type them."""

import time
from contextlib import ExitStack
from dataclasses import replace
from math import isfinite
from pathlib import Path
from typing import Any

from adhesion_can.bus.frame import Frame
from adhesion_can.cli.monitor_learned import LearnedFolder
from adhesion_can.cli.monitor_log import LogSource
from adhesion_can.cli.monitor_source import Source
from adhesion_can.config import Configuration
from adhesion_can.errors import InputError
from adhesion_can.files import whole_file
from adhesion_can.monitoring.snapshot import Snapshot
from adhesion_can.monitoring.state import MonitorState
from adhesion_can.recordings.candump import format_frame

STEP_S = 0.1
"""Part of a recording that a step shows, s."""


class MonitorSession:
    """What is shown, and what somebody may do about it. Nothing is sent.

    Args:
        configuration: Database, roles and vehicle.
        source: Where the frames come from.
        learned: Models that a service has learned; None: they are not shown.

    """

    def __init__(
        self,
        configuration: Configuration,
        source: Source,
        learned: LearnedFolder | None = None,
    ) -> None:
        self.paused = False
        """Whether the view stands still."""
        self._configuration = configuration
        self._source = source
        self._learned = learned
        self._state = MonitorState(configuration)
        self._generation = source.generation
        self._shown: Snapshot | None = None
        self._recorder: _Recorder | None = None
        self._note = ""

    @property
    def log(self) -> LogSource | None:
        """The source where it is a recording."""
        return self._source if isinstance(self._source, LogSource) else None

    @property
    def is_at_end(self) -> bool:
        """Whether there is nothing more to come."""
        return self.log is not None and self.log.is_at_end

    def turn(self) -> Snapshot:
        """Take the frames that came, and give what is to be shown."""
        self._feed(self._source.take())
        if self._shown is None or not self.paused or self.log is not None:
            self._shown = self._state.snapshot(self._source.now_us)
        return self._with_transport(self._shown)

    def run_until(self, t_us: int) -> Snapshot:
        """Take the frames of a recording up to a time, µs, or its end, however long it takes."""
        if self.log is not None:
            self._feed(self.log.take_all(t_us))
        # Behind the end of a recording every message would count as silent.
        return self._with_transport(self._state.snapshot(self._source.now_us))

    def toggle_pause(self) -> None:
        """Stop or go on: a recording itself, of a bus the view."""
        self.paused = not self.paused
        if self.log is not None:
            self.log.paused = self.paused

    def step(self) -> None:
        """Show a tenth of a second more, paused."""
        if not self.paused:
            self.toggle_pause()
        if self.log is not None:
            self.log.step(STEP_S)
        self._shown = None

    def jump(self, text: str) -> None:
        """Go to a time of the recording; what is being recorded ends there.

        Args:
            text: Time after the first frame, as 120 or 2:00; with a sign it counts from the
                present one.

        Raises:
            InputError: It is not a time.

        """
        if self.log is None:
            return
        value, is_relative = typed_time(text, "jump to")
        if self._recorder is not None:
            self.toggle_recording()
        self.log.jump(self.log.position_s + value if is_relative else value)
        self._shown = None

    def faster(self, factor: float) -> None:
        """Multiply the speed of a recording."""
        if self.log is not None:
            self.log.faster(factor)

    def toggle_recording(self, path: Path | None = None) -> None:
        """Start to record what comes, or end it.

        Args:
            path: Path of the file; None: one named by date and time in the present folder.

        Raises:
            InputError: The file cannot be written, or is there already.

        """
        if self._recorder is not None:
            recorder, self._recorder = self._recorder, None
            recorder.close()
            self._note = f"recorded {recorder.count} frames to {recorder.path}"
            return
        if path is None:
            stamp = time.strftime("%Y%m%d-%H%M%S")
            path = Path(f"monitor-{stamp}.log")
            if path.exists():
                raise InputError(str(path), "is there already", "try again in a second")
        self._recorder = _Recorder(path)

    def close(self) -> None:
        """End the recording and the source."""
        if self._recorder is not None:
            self.toggle_recording()
        self._source.close()

    def _feed(self, frames: Any) -> None:
        if self._source.generation != self._generation:
            self._generation = self._source.generation
            self._state = MonitorState(self._configuration)
        for frame in frames:
            self._state.feed(frame)
            key = frame.arbitration_id, frame.is_extended
            if self._recorder is not None and key not in self._source.made_here:
                self._recorder.add(frame)

    def _with_transport(self, snapshot: Snapshot) -> Snapshot:
        transport = replace(self._source.transport(), paused=self.paused)
        notes = (*transport.notes, self._note) if self._note else transport.notes
        if self._recorder is not None:
            name, count = str(self._recorder.path), self._recorder.count
            transport = replace(transport, recording=name, recorded=count)
        learned = () if self._learned is None else self._learned.sentences()
        return replace(
            snapshot,
            remarks=(*snapshot.remarks, *learned),
            transport=replace(transport, notes=notes),
        )


class _Recorder:
    """Frames to a file of candump text, which appears whole."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self.count = 0
        self._stack = ExitStack()
        self._file = self._stack.enter_context(whole_file(path, keep_part=True))

    def add(self, frame: Frame) -> None:
        self._file.write(format_frame(frame))
        self.count += 1

    def close(self) -> None:
        self._stack.close()


FIX = "give seconds or minutes:seconds, as 120, 2:00 or +10"


def typed_time(text: str, what: str) -> tuple[float, bool]:
    """Time that was typed, s, and whether it has a sign.

    Args:
        text: Seconds, minutes:seconds or hours:minutes:seconds, perhaps with + or - in front.
        what: What asks for it, for the error.

    Raises:
        InputError: It is not a time.

    """
    bare = text.strip()
    sign = bare[:1] if bare[:1] in ("+", "-") else ""
    parts = bare.removeprefix(sign).split(":")
    try:
        numbers = [float(part) for part in parts]
    except ValueError:
        numbers = []
    whole = all(number.is_integer() for number in numbers[:-1])
    below = all(number < 60 for number in numbers[1:])
    if not (
        1 <= len(numbers) <= 3
        and all(isfinite(number) and number >= 0 for number in numbers)
        and whole
        and below
    ):
        raise InputError(f"{what} {text!r}", "is not a time", FIX)
    seconds = 0.0
    for number in numbers:
        seconds = 60.0 * seconds + number
    return (-seconds if sign == "-" else seconds), bool(sign)
