"""The child process of the learner: readings come by its stdin, reports leave by its stdout.

It has the lowest priority that the system gives, and ends when the service does: its stdin ends
then, whatever ended the service.
"""

import os
import pickle
import signal
import sys
import threading
import time
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO, NamedTuple

from adhesion_can.config import Configuration
from adhesion_can.learning.learner import Learner, LearningSettings
from adhesion_can.learning.report import LearningReport
from adhesion_can.sampling.column_former import Readings

IDLE_S = 1.0
"""Longest wait for readings, s."""
END_S = 0.2
"""Time that a file has to be finished when the service has ended, s."""
FAILED = 1
"""Exit status after an error, which the last report names."""


@dataclass(frozen=True, slots=True)
class LearningTask:
    """What a child process is to do; the first thing that it receives.

    Attributes:
        configuration: Vehicle, roles and settings of the service, without a model.
        folder: Folder of the model files.
        settings: Times of the work.
        in_use: Names of the effects of the model that the service uses.

    """

    configuration: Configuration
    folder: Path
    settings: LearningSettings
    in_use: tuple[str, ...] = ()


class ReadingBatch(NamedTuple):
    """Readings of a part of a second, as a child receives them.

    Attributes:
        readings: Readings of all signals.
        is_doubted: Whether the service doubted curve or readings at their end; None: it could not
            say.

    """

    readings: Readings
    is_doubted: bool | None


def lower_priority() -> None:
    """Take the lowest priority: only the time that nobody else wants."""
    os.nice(19)
    if hasattr(os, "SCHED_IDLE"):
        # A sandbox may forbid it; nice 19 is then the lowest.
        with suppress(PermissionError):
            os.sched_setscheduler(0, os.SCHED_IDLE, os.sched_param(0))


def main() -> int:
    """Learn until stdin ends; returns the exit status, 1 after an error."""
    # A terminal's Ctrl-C is for the service.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    source, sink = sys.stdin.buffer, os.fdopen(os.dup(1), "w", encoding="utf-8")
    os.dup2(2, 1)  # what a library prints is no report

    def tell(report: LearningReport) -> None:
        sink.write(report.to_line())
        sink.flush()

    try:
        lower_priority()
        _learn(source, tell)
    except BrokenPipeError:
        return 0  # the service has ended
    except Exception as error:  # noqa: BLE001  whatever it was: the service reports it
        tell(LearningReport.from_failure(error))
        return FAILED
    return 0


def _learn(source: BinaryIO, tell: Callable[[LearningReport], None]) -> None:
    """Receive the task, then readings in a thread, and work on them until they end."""
    task = pickle.load(source)  # noqa: S301  the service's own pipe
    learner = Learner(task.configuration, task.folder, tell, task.settings, task.in_use)
    came, has_ended = threading.Event(), threading.Event()

    def receive() -> None:
        try:
            while True:
                batch: ReadingBatch = pickle.load(source)  # noqa: S301
                learner.add(batch.readings, batch.is_doubted)
                came.set()
        except (EOFError, pickle.UnpicklingError):
            pass
        except Exception as error:  # noqa: BLE001  a process that is deaf would outlive the service
            tell(LearningReport.from_failure(error))
            os._exit(FAILED)
        has_ended.set()
        came.set()
        # A diagnosis is not waited for; a file that is being written may be finished.
        time.sleep(END_S)
        os._exit(0)

    threading.Thread(target=receive, name="readings", daemon=True).start()
    while not has_ended.is_set():
        if not learner.work():
            came.wait(IDLE_S)
            came.clear()


if __name__ == "__main__":
    sys.exit(main())
