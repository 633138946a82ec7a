"""What workers are made to do in tests; they import it."""

import os
import signal

from adhesion_can.fleet.work import Outcome, Task, work_on


def work_until_deadly(task: Task) -> Outcome:
    """Analyse a unit; the worker of one whose name says so ends at once, as by a lack of memory."""
    if "deadly" in task.unit.path:
        os.kill(os.getpid(), signal.SIGKILL)
    return work_on(task)


def do_nothing(task: Task) -> Outcome:
    """No work."""
    return Outcome(task.unit.path, task.unit.vehicle, None, None, None)
