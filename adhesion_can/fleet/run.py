"""All units through the workers, a bounded number at a time."""

from collections import deque
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import CancelledError
from dataclasses import dataclass, replace
from math import inf
from time import monotonic
from typing import Any

from distributed import Client, as_completed
from distributed.comm.core import CommClosedError
from distributed.scheduler import KilledWorker

from adhesion_can.errors import InputError
from adhesion_can.fleet.cluster import count_threads
from adhesion_can.fleet.work import Outcome, Task, give_up, work_on

IN_FLIGHT = 2
"""Units that a worker has at a time: one in work, one that waits, so that it never waits."""
DEATHS = 3
"""Deaths of its worker after which a unit counts as failed. The last time it runs alone: a unit
that only waited behind the one that is at fault goes through."""
LOOK_S = 5.0
"""Time between two looks at the number of workers, s."""


@dataclass(frozen=True, slots=True)
class _Try:
    """A task that is in work, with the number of workers that died of it before."""

    task: Task
    deaths: int = 0


def run_fleet(
    client: Client, tasks: Iterable[Task], work: Callable[[Task], Outcome] = work_on
) -> Iterator[Outcome]:
    """Outcomes of units, in the order in which they end.

    At most `IN_FLIGHT` units a worker are with the scheduler, so that its memory does not grow with
    their number.

    Args:
        client: Client of a cluster, whose workers are ready.
        tasks: Units with all that a worker needs.
        work: Function that a worker calls for each of them.

    Raises:
        InputError: The data set cannot be written.

    """
    return _Flight(client, tasks, work).run()


class _Flight:
    """Units in work.

    Args:
        client: Client of a cluster.
        tasks: Tasks that are still to be done.
        work: Function that a worker calls for each of them.

    """

    def __init__(
        self, client: Client, tasks: Iterable[Task], work: Callable[[Task], Outcome]
    ) -> None:
        self._client, self._work = client, work
        self._waiting = iter(tasks)
        self._again: deque[_Try] = deque()
        self._alone: deque[_Try] = deque()
        self._flying: dict[Any, _Try] = {}
        self._completed = as_completed(loop=client.loop)
        self._exhausted = False
        self._window, self._looked_s, self._number = 0, -inf, 0

    def run(self) -> Iterator[Outcome]:
        """Outcomes in the order in which they come."""
        try:
            while self._flying or self._again or self._alone or not self._exhausted:
                self._fill()
                if self._flying:
                    outcome = self._land(next(self._completed))
                    if outcome is not None:
                        yield outcome
        finally:
            for future in self._flying:
                future.cancel()

    def _fill(self) -> None:
        """Submit as many units as there is room for."""
        if monotonic() - self._looked_s >= LOOK_S:
            self._window = IN_FLIGHT * count_threads(self._client)
            self._looked_s = monotonic()
        while self._again and len(self._flying) < self._window:
            self._submit(self._again.popleft())
        while not self._exhausted and len(self._flying) < self._window:
            task = next(self._waiting, None)
            if task is None:
                self._exhausted = True
            else:
                self._submit(_Try(task))
        if self._alone and not self._flying:
            self._submit(self._alone.popleft())

    def _submit(self, attempt: _Try) -> None:
        self._number += 1
        key = ("unit", attempt.task.unit.unit_id, self._number)
        future = self._client.submit(self._work, attempt.task, key=key, pure=False)
        self._flying[future] = attempt
        self._completed.add(future)

    def _land(self, future: Any) -> Outcome | None:
        """Outcome of a unit that came back; None where it is tried again."""
        attempt = self._flying.pop(future)
        try:
            outcome: Outcome = future.result()
        except KilledWorker:
            attempt = replace(attempt, deaths=attempt.deaths + 1)
            if attempt.deaths >= DEATHS:
                return give_up(attempt.task, attempt.deaths)
            (self._alone if attempt.deaths == DEATHS - 1 else self._again).append(attempt)
            return None
        except (CancelledError, CommClosedError) as error:
            fix = "once the scheduler is available again, the same command continues from here"
            raise InputError("fleet", "the scheduler is no longer available", fix) from error
        return outcome
