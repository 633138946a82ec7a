"""The service's side of the learner: nothing that its process does holds the loop up."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

from adhesion_can.config import load_configuration
from adhesion_can.learning.child import LearningTask
from adhesion_can.learning.companion import BATCH_US, WAITING_BATCHES, LearningCompanion
from adhesion_can.learning.confirmation import LearningState
from adhesion_can.learning.learner import LearningSettings
from adhesion_can.learning.record import ReadingRecord, join_readings
from adhesion_can.learning.report import LearningReport
from adhesion_can.physics.doubt import Doubt
from adhesion_can.physics.readings import Role
from adhesion_can.service.outputs import Outputs

ROOT = Path(__file__).resolve().parents[2]
PATIENCE_S = 120.0
"""Longest wait for what takes seconds on an idle machine."""
PUT_S = 30.0
"""What 2000 moments take at most: milliseconds on an idle machine. What blocks, blocks for ever."""
TASK = LearningTask(load_configuration(), Path(), LearningSettings())
DEAF = "import time; time.sleep(1000)"
DEAD = "import sys; sys.exit(3)"
SAYS = "import sys; print('{line}', flush=True); sys.stdin.buffer.read()"
ENDS = "import sys; sys.stdin.buffer.read()"


def readings(second, signals=100):
    """Readings of a moment, many of them, so that a pipe is soon full."""
    t_us = np.full(signals, round(second * 1e6), dtype=np.int64)
    return {(Role.WHEEL_SPEED, axle): (t_us, np.zeros(signals)) for axle in range(1, 7)}


def wait_until(ready):
    end = time.monotonic() + PATIENCE_S
    while not ready():
        assert time.monotonic() < end, f"nothing came within {PATIENCE_S} s"
        time.sleep(0.01)


class Started:
    """A companion whose process runs a program, and what it has told the operator."""

    def __init__(self, program, **more):
        self.told = []
        self.companion = LearningCompanion(
            TASK, self.told.append, command=(sys.executable, "-c", program), **more
        )
        self.sent = 0

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.companion.close()

    def send(self, number):
        """Send readings a batch apart; returns how long it took, s."""
        began = time.monotonic()
        for _ in range(number):
            self.sent += 1
            self.companion.observe_readings(readings(self.sent * BATCH_US / 1e6))
        return time.monotonic() - began


def test_a_process_that_takes_nothing_costs_readings_and_no_time():
    with Started(DEAF) as started:
        assert started.send(2000) < PUT_S
        # Batches are of two moments; those that wait, and those in the pipe, are not lost.
        assert started.companion.lost_s >= (1000 - 2 * WAITING_BATCHES) * BATCH_US / 1e6
        losses = [line for line in started.told if "losing readings" in line]
        # Each hole is reported once, not each reading.
        assert 1 <= len(losses) <= 3
        began = time.monotonic()
    assert time.monotonic() - began < PATIENCE_S / 4
    assert started.companion.process_id is not None


def test_a_process_that_is_stopped_ends_with_the_service():
    with Started(ENDS) as started:
        os.kill(started.companion.process_id, signal.SIGSTOP)
        assert started.send(2000) < PUT_S
        process_id = started.companion.process_id
    with pytest.raises(ProcessLookupError):
        os.kill(process_id, 0)


def test_a_process_that_dies_is_reported_once_and_started_again():
    with Started(DEAD, restart_s=0.05) as started:
        wait_until(lambda: started.told)
        while started.companion.restarts < 3:
            assert started.send(2) < PUT_S
            time.sleep(0.06)
        assert len(started.told) == 1
        assert "ended with status 3" in started.told[0]


def test_a_process_that_cannot_be_started_again_is_reported_and_tried_again(monkeypatch):
    with Started(ENDS, restart_s=0.05) as started:
        os.kill(started.companion.process_id, signal.SIGKILL)
        wait_until(lambda: started.told)
        real, failures = subprocess.Popen, [OSError(12, "Cannot allocate memory")]

        def popen(*words, **more):
            if failures:
                raise failures.pop()
            return real(*words, **more)

        monkeypatch.setattr(subprocess, "Popen", popen)
        while started.companion.restarts < 1:
            assert started.send(2) < PUT_S
            time.sleep(0.06)
        assert "cannot be started" in started.told[1]
        assert "memory" in started.told[1]
        assert started.companion.restarts == 1


def test_an_error_of_the_learner_is_said_once():
    line = LearningReport.from_failure(ValueError("x")).to_line().strip()
    with Started(f"print({line!r}, flush=True); raise SystemExit(1)", restart_s=0.05) as started:
        wait_until(lambda: started.told)
        while started.companion.restarts < 2:
            assert started.send(2) < PUT_S
            time.sleep(0.06)
        assert [line for line in started.told if "ValueError: x" in line] == started.told
        assert len(started.told) == 1
        assert started.companion.take_news() is None


def test_readings_behind_a_hole_are_no_part_of_the_batch_before_it():
    """Else a record that is cleared by a hole would not see one."""
    record = ReadingRecord(480.0, 60.0)
    with Started(DEAF) as started:
        companion = started.companion
        companion._batches.put = lambda batch: record.add(join_readings(batch.parts))
        for second in (*np.arange(0.0, 30.13, 0.02), *np.arange(230.0, 240.0, 0.02)):
            companion.observe_readings(readings(second, 1))
    assert record.length_s == pytest.approx(10.0, abs=0.6)


CHILD = (
    "import pickle, sys\n"
    "sys.path[:] = pickle.load(sys.stdin.buffer)\n"
    "from adhesion_can.learning import child, learner\n"
    "def add(self, readings, is_doubted): raise MemoryError('no room')\n"
    "learner.Learner.add = add\n"
    "sys.exit(child.main())\n"
)


@pytest.mark.costly
def test_a_child_that_cannot_take_readings_says_so_and_ends():
    with Started(CHILD, restart_s=1000.0) as started:
        started.send(4)
        wait_until(lambda: started.told)
        assert "failed: MemoryError: no room" in started.told[0]


def test_a_process_that_is_killed_is_not_started_again_at_once():
    with Started(ENDS, restart_s=1000.0) as started:
        os.kill(started.companion.process_id, signal.SIGKILL)
        wait_until(lambda: started.told)
        assert "ended with status -9" in started.told[0]
        assert started.send(50) < PUT_S
        time.sleep(0.2)
        assert started.companion.restarts == 0


def test_the_end_of_the_service_is_the_end_of_the_process_without_a_word():
    with Started(ENDS) as started:
        process_id = started.companion.process_id
        started.send(10)
    assert started.told == []
    with pytest.raises(ProcessLookupError):
        os.kill(process_id, 0)


def test_reports_come_back():
    report = LearningReport(state=LearningState.CONFIRMED, news="found it", examined=2)
    with Started(SAYS.format(line=report.to_line().strip())) as started:
        wait_until(lambda: started.companion.report == report)
        assert started.companion.take_news() == report
        assert started.companion.take_news() is None


@pytest.mark.costly
def test_readings_and_doubt_reach_the_process_in_order():
    """What the child counts is what was put in, less what still gathers for the next batch."""
    program = (
        "import pickle, sys\n"
        "sys.path[:] = pickle.load(sys.stdin.buffer)\n"
        "pickle.load(sys.stdin.buffer)\n"
        "from adhesion_can.learning.report import LearningReport\n"
        "rows, last = 0, 0\n"
        "while True:\n"
        "    try:\n"
        "        batch = pickle.load(sys.stdin.buffer)\n"
        "    except EOFError:\n"
        "        break\n"
        "    for stamps, _ in batch.readings.values():\n"
        "        assert (stamps[1:] >= stamps[:-1]).all() and stamps[0] >= last\n"
        "        rows += len(stamps)\n"
        "    last = int(stamps[-1])\n"
        "    report = LearningReport(t_us=last, examined=rows, spans=int(batch.is_doubted))\n"
        "    print(report.to_line(), end='', flush=True)\n"
    )
    with Started(program) as started:
        started.companion.observe_setpoint(0, Outputs(doubt=Doubt.SPEED))
        started.send(21)
        # Two moments that are a batch apart go together; the last one waits for its next.
        wait_until(lambda: started.companion.report.examined == 20 * 600)
        assert started.companion.report.t_us == 20 * BATCH_US
        assert started.companion.report.spans == 1


@pytest.mark.slow  # a process of the lowest priority gets no time on a busy machine
@pytest.mark.realtime
def test_the_child_has_the_lowest_priority_and_one_thread_of_its_libraries(tmp_path):
    task = LearningTask(TASK.configuration, tmp_path, TASK.settings)
    companion = LearningCompanion(task, print)
    try:
        for moment in range(3):
            companion.observe_readings(readings(moment))
        process_id = companion.process_id
        wait_until(lambda: os.getpriority(os.PRIO_PROCESS, process_id) == 19)
        if hasattr(os, "SCHED_IDLE"):
            wait_until(lambda: os.sched_getscheduler(process_id) == os.SCHED_IDLE)
    finally:
        companion.close()
    with pytest.raises(ProcessLookupError):
        os.kill(process_id, 0)


@pytest.mark.slow  # a process of the lowest priority gets no time on a busy machine
@pytest.mark.realtime
def test_the_child_ends_where_the_service_is_killed():
    program = (
        "import os, sys, time\n"
        "from pathlib import Path\n"
        "from tests.learning.test_companion import TASK\n"
        "from adhesion_can.learning.companion import LearningCompanion\n"
        "companion = LearningCompanion(TASK, print)\n"
        "print(companion.process_id, flush=True)\n"
        "time.sleep(1000)\n"
    )
    with subprocess.Popen(
        [sys.executable, "-c", program],
        env={**os.environ, "PYTHONPATH": str(ROOT)},
        stdout=subprocess.PIPE,
    ) as service:
        child = int(service.stdout.readline())
        os.kill(child, 0)
        service.kill()
        service.wait()
    wait_until(lambda: not Path(f"/proc/{child}").exists() or is_dead(child))


def is_dead(process_id):
    """Whether a process is a zombie, as its parent of last resort may not fetch it."""
    try:
        return Path(f"/proc/{process_id}/stat").read_text().rpartition(")")[2].split()[0] == "Z"
    except FileNotFoundError:
        return True


def test_counts_go_on_where_a_process_is_started_again_and_its_state_does_not():
    report = LearningReport(state=LearningState.CONFIRMED, found="low", examined=3, proposed=1)
    program = f"print({report.to_line().strip()!r}, flush=True); raise SystemExit(3)"
    with Started(program, restart_s=0.05) as started:
        companion = started.companion
        wait_until(lambda: companion.report.examined == 3)
        companion._command = (sys.executable, "-c", DEAF)
        while companion.restarts < 1:
            assert started.send(2) < PUT_S
            time.sleep(0.06)
        wait_until(lambda: companion.report.state is LearningState.UNESTIMATED)
        assert (companion.report.examined, companion.report.proposed) == (3, 1)
        assert companion.report.found == ""
