"""The service's side of the learner: a child process that never holds the loop up.

The loop puts readings into a bounded queue; a thread writes them to the child. A child that is
stopped or slow makes the queue fill, and readings are lost, which is counted and reported. One that
dies is started again after a while, with an empty record.
"""

import os
import pickle
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from queue import Empty, SimpleQueue
from typing import IO, NamedTuple

from adhesion_can.learning.child import LearningTask, ReadingBatch
from adhesion_can.learning.doubted import is_doubted
from adhesion_can.learning.record import join_readings
from adhesion_can.learning.report import LearningReport
from adhesion_can.sampling.column_former import Readings
from adhesion_can.service.behind import Behind
from adhesion_can.service.outputs import Outputs

BATCH_US, MOST_FRAMES = 500_000, 5_000
"""Time, µs, and largest number of frames whose readings go to the child together."""
WAITING_BATCHES = 60
"""Largest number of batches that wait: half a minute."""
RESTART_S = 60.0
"""Time after which a child that has died is started again, s."""
END_S = 1.0
"""Time that the child has to end with the service, s."""
PROGRAM = (
    "import pickle, sys\n"
    "sys.path[:] = pickle.load(sys.stdin.buffer)\n"
    "from adhesion_can.learning.child import main\n"
    "sys.exit(main())\n"
)
"""Program of the child, which finds modules where the service does."""


class _FrameReadings(NamedTuple):
    """Readings of some frames, in the order in which they came, and whether they are doubted."""

    parts: list[Readings]
    is_doubted: bool | None


class LearningCompanion:
    """Runs a learner in a process of its own, and keeps its latest report.

    `observe_readings`, `observe_setpoint` and `take_news` are called by the loop, and never wait.

    Args:
        task: What the child is to do.
        notify: Callback with a line for the operator; called in other threads, too.
        command: Command that starts the child.
        restart_s: Time after which a child that has died is started again, s.

    """

    def __init__(
        self,
        task: LearningTask,
        notify: Callable[[str], None],
        *,
        command: Sequence[str] = (sys.executable, "-c", PROGRAM),
        restart_s: float = RESTART_S,
    ) -> None:
        self.report = LearningReport()
        """Latest report of the child."""
        self.restarts = 0
        """Number of times that the child was started again."""
        self.failures = 0
        """Number of times that it could not be."""
        self._task = task
        self._notify = notify
        self._command = command
        self._restart_s = restart_s
        self._is_doubted: bool | None = None
        self._parts: list[Readings] = []
        self._since_us = 0
        self._news: SimpleQueue[LearningReport] = SimpleQueue()
        self._process: subprocess.Popen[bytes] | None = None
        self._greeted: subprocess.Popen[bytes] | None = None
        """Process that has its task."""
        self._started_s = -float("inf")
        self._has_died = False
        """Whether a death of the child was reported."""
        self._closing = False
        self._start()
        self._batches: Behind[_FrameReadings] = Behind(
            "learning",
            self._write,
            capacity=WAITING_BATCHES,
            finish=lambda _: self._end_input(),
            fills=lambda: notify("--learn: losing readings: the learning process is too slow"),
            flows=lambda lost: notify(
                f"--learn: continues; {lost * BATCH_US / 1e6:g} s of readings lost"
            ),
        )

    @property
    def lost_s(self) -> float:
        """Time whose readings did not reach the child since it was too slow, s."""
        return self._batches.lost * BATCH_US / 1e6

    @property
    def process_id(self) -> int | None:
        """Id of the child's process; None where there is none."""
        process = self._process
        return None if process is None else process.pid

    def observe_readings(self, readings: Readings) -> None:
        """Take the readings of an accepted frame."""
        if not readings:
            return
        stamps, _ = next(iter(readings.values()))
        t_us = int(stamps[0])
        parts = self._parts
        if parts and t_us - self._since_us > 2 * BATCH_US:
            # What came before a hole goes alone, so that the record sees the hole.
            self._batches.put(_FrameReadings(parts, self._is_doubted))
            parts = self._parts = []
        if not parts:
            self._since_us = t_us
        parts.append(readings)
        if t_us - self._since_us >= BATCH_US or len(parts) >= MOST_FRAMES:
            self._parts = []
            self._batches.put(_FrameReadings(parts, self._is_doubted))

    def observe_setpoint(self, _t_us: int, outputs: Outputs) -> None:
        """Take what a setpoint says of the readings."""
        self._is_doubted = is_doubted(outputs)

    def take_news(self) -> LearningReport | None:
        """The next report with news for the operator; None where there is none."""
        try:
            return self._news.get_nowait()
        except Empty:
            return None

    def close(self) -> None:
        """End the child; waits a second at most."""
        self._closing = True
        self._batches.end()
        process = self._process
        if process is None:
            return
        try:
            process.wait(END_S)
        except subprocess.TimeoutExpired:
            # Stopped, or its pipe is full: nothing that it has is missed.
            process.kill()
            process.wait()
        self._batches.wait(END_S)
        self._reader.join(END_S)

    # -------------------------------------------------------------------------------- in threads

    def _start(self) -> None:
        """Start the child, and the thread that reads its reports."""
        self._started_s = time.monotonic()
        # It begins anew: what is left of the one before are the counts.
        before = self.report
        self.report = LearningReport(examined=before.examined, proposed=before.proposed)
        self._process = process = subprocess.Popen(  # noqa: S603  our own program
            self._command,
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            env=_environment(os.environ),
        )
        self._reader = threading.Thread(
            target=self._read, args=(process,), name="learning reports", daemon=True
        )
        self._reader.start()

    def _write(self, batches: list[_FrameReadings]) -> None:
        """Send batches to the child; starts it again where it is time."""
        process = self._process
        if process is None or process.poll() is not None:
            if self._closing or time.monotonic() - self._started_s < self._restart_s:
                return
            try:
                self._start()
            except OSError as error:
                self.failures += 1
                self._notify(
                    f"--learn: the learning process cannot be started: {error}; it is tried again "
                    f"in {self._restart_s:g} s"
                )
                return
            self.restarts += 1
            process = self._process
        if process is not self._greeted and process is not None:
            # Here, as the task is more than a pipe holds, and the child may not read.
            self._greeted = process
            self._send(process, sys.path)
            self._send(process, self._task)
        for batch in batches:
            if process is not None:
                self._send(process, ReadingBatch(join_readings(batch.parts), batch.is_doubted))

    @staticmethod
    def _send(process: subprocess.Popen[bytes], item: object) -> None:
        """Send one thing; a child that has died is noticed where its reports are read."""
        if process.stdin is None:
            return
        try:
            pickle.dump(item, process.stdin)
            process.stdin.flush()
        except (BrokenPipeError, ValueError):
            return

    def _end_input(self) -> None:
        """Let the child see the end of its input."""
        process = self._process
        if process is not None and process.stdin is not None:
            _close(process.stdin)

    def _read(self, process: subprocess.Popen[bytes]) -> None:
        """Read reports until the child ends; say once that one has died."""
        last, before = LearningReport(), self.report
        if process.stdout is not None:
            with process.stdout as lines:
                for line in lines:
                    last = LearningReport.from_line(line.decode("utf-8"))
                    if last.is_failure:
                        break  # told below, once
                    self.report = last = replace(
                        last,
                        examined=before.examined + last.examined,
                        proposed=before.proposed + last.proposed,
                    )
                    if last.news:
                        self._news.put(last)
        status = process.wait()
        if process.stdin is not None:
            _close(process.stdin)
        if self._closing or self._has_died:
            return
        self._has_died = True
        reason = last.news if last.is_failure else f"ended with status {status}"
        self._notify(
            f"--learn: the learning process {reason}; it is started again every "
            f"{self._restart_s:g} s, and further ends are not reported"
        )


def _close(pipe: IO[bytes]) -> None:
    """Close the writing end of a pipe, whether or not somebody reads it."""
    with suppress(BrokenPipeError):
        pipe.close()


def _environment(given: Mapping[str, str]) -> dict[str, str]:
    """Environment of the child: one thread, so that it takes one core at most."""
    thread_limits = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")
    return {**given, **dict.fromkeys(thread_limits, "1")}
