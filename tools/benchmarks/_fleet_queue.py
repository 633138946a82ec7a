"""Simulation of a fleet's run: units, workers that die, a dispatcher, an object store."""

from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import simpy


@dataclass(frozen=True)
class Cost:
    """Seconds that a unit takes; measured ones come from `tools/bench fleet`.

    Attributes:
        fixed_s: Core time of a unit whatever its length, s.
        per_hour_s: Core time for an hour of recording, s.
        spread: Standard deviation of the logarithm of the core time.
        bytes_per_hour: Size of an hour of recording, bytes.
        request_s: Time to the first byte of the object store, s.
        worker_bytes_per_s: Transfer rate of one worker, bytes/s.
        store_bytes_per_s: Transfer rate of the object store for all workers together, bytes/s.
        dispatch_s: Core time of scheduler and client for a unit, s.

    """

    fixed_s: float
    per_hour_s: float
    spread: float
    bytes_per_hour: float
    request_s: float
    worker_bytes_per_s: float
    store_bytes_per_s: float
    dispatch_s: float


@dataclass(frozen=True)
class Failures:
    """Failures of workers and units.

    Attributes:
        worker_life_h: Mean life of a worker, exponentially distributed, h.
        restart_s: Time until a dead worker is replaced, s.
        broken: Share of units that cannot be read; they cost the fixed time.
        deadly: Share of units that kill each worker that takes them.
        attempts: Workers that a unit may kill before it is given up.

    """

    worker_life_h: float
    restart_s: float
    broken: float
    deadly: float
    attempts: int = 3


@dataclass(frozen=True)
class Outcome:
    """Figures of one run.

    Attributes:
        makespan_s: Time from the first unit to the last, s.
        done: Number of units that were analysed.
        failed: Number of units that became a row with an error.
        useful_s: Core time of units that were finished, s.
        lost_s: Core time of units whose worker died, s.
        deaths: Number of workers that died.
        waiting: Share of the workers' time without a unit, before the last unit was handed out.
        dispatcher: Share of the makespan in which the dispatcher was busy.
        in_flight: Largest number of units that the dispatcher knew at once.

    """

    makespan_s: float
    done: int
    failed: int
    useful_s: float
    lost_s: float
    deaths: int
    waiting: float
    dispatcher: float
    in_flight: int


def draw_lengths(units: int, rng: np.random.Generator) -> np.ndarray:
    """Lengths of recordings, h: loggers that begin a file each hour, ends of shifts, whole days."""
    kind = rng.choice(3, size=units, p=[0.80, 0.195, 0.005])
    return np.select([kind == 0, kind == 1], [1.0, rng.uniform(0.01, 1.0, units)], 24.0)


class Run:
    """One run of the queue: each worker holds a window of units, the running one among them."""

    def __init__(
        self,
        lengths_h: Sequence[float],
        workers: int,
        cost: Cost,
        failures: Failures,
        *,
        window: int,
        seed: int,
    ) -> None:
        self.cost, self.failures = cost, failures
        self.rng = np.random.default_rng(seed)
        count = len(lengths_h)
        self.lengths = np.asarray(lengths_h, dtype=float)
        self.noise = np.exp(self.rng.normal(-(cost.spread**2) / 2, cost.spread, count))
        fate = self.rng.random(count)
        self.broken = fate < failures.broken
        self.deadly = (fate >= failures.broken) & (fate < failures.broken + failures.deadly)
        self.killed = np.zeros(count, dtype=int)
        self.pool = deque(range(count))
        self.window = window
        self.env = simpy.Environment()
        self.dispatcher = simpy.Resource(self.env)
        self.finished = self.env.event()
        self.left = count
        self.done = self.failed = self.deaths = self.known = self.in_flight = self.transfers = 0
        self.useful = self.lost = self.waited = self.dispatched = 0.0
        self.workers = [self.env.process(self.work()) for _ in range(workers)]

    def play(self) -> Outcome:
        """Run until every unit is done or given up."""
        self.env.run(until=self.finished)
        span = self.env.now
        return Outcome(
            span, self.done, self.failed, self.useful, self.lost, self.deaths,
            self.waited / (span * len(self.workers)), self.dispatched / span, self.in_flight,
        )  # fmt: skip

    def hand_out(self, store: simpy.Store):
        """The dispatcher gives one more unit to a worker, if there is one."""
        with self.dispatcher.request() as turn:
            yield turn
            if not self.pool:
                return
            unit = self.pool.popleft()
            self.known += 1
            self.in_flight = max(self.in_flight, self.known)
            self.dispatched += self.cost.dispatch_s
            yield self.env.timeout(self.cost.dispatch_s)
        yield store.put(unit)

    def work(self):
        """A place for a worker: lives of workers, one after the other."""
        while True:
            store = simpy.Store(self.env)
            ends_at = self.env.now + self.rng.exponential(self.failures.worker_life_h * 3600.0)
            for _ in range(self.window):
                self.env.process(self.hand_out(store))
            yield from self.live(store, ends_at)
            self.deaths += 1
            # Units that waited at the dead worker go back; the scheduler hands them to others.
            self.known -= len(store.items)
            self.pool.extendleft(store.items)
            yield self.env.timeout(self.failures.restart_s)

    def live(self, store: simpy.Store, ends_at: float):
        """One worker until it dies."""
        while True:
            began = self.env.now
            asked = store.get()
            lives = self.env.timeout(max(ends_at - began, 0.0))
            yield asked | lives
            if not asked.triggered:
                asked.cancel()
                return
            unit = asked.value
            self.waited += self.env.now - began
            transfer, core = self.seconds(unit)
            left = ends_at - self.env.now
            # A deadly unit kills at its end; a worker's life may end before it.
            if self.deadly[unit] or transfer + core > left:
                yield self.env.timeout(min(transfer + core, left))
                self.lose(unit, min(transfer + core, left))
                return
            self.transfers += 1
            yield self.env.timeout(transfer)
            self.transfers -= 1
            yield self.env.timeout(core)
            self.finish(core, analysed=not self.broken[unit])
            self.env.process(self.hand_out(store))

    def seconds(self, unit: int) -> tuple[float, float]:
        """Time of the transfer of a unit, at the present load of the store, and core time, s."""
        cost, length = self.cost, 0.0 if self.broken[unit] else self.lengths[unit]
        share = cost.store_bytes_per_s / (self.transfers + 1)
        rate = min(cost.worker_bytes_per_s, share)
        transfer = cost.request_s + cost.bytes_per_hour * self.lengths[unit] / rate
        return transfer, (cost.fixed_s + cost.per_hour_s * length) * self.noise[unit]

    def finish(self, core: float, *, analysed: bool) -> None:
        """Count a unit that became a row."""
        self.useful += core
        self.done += analysed
        self.failed += not analysed
        self.close()

    def lose(self, unit: int, spent: float) -> None:
        """Give a unit back whose worker died, or give it up."""
        self.lost += spent
        self.killed[unit] += 1
        if self.killed[unit] >= self.failures.attempts:
            self.failed += 1
            self.close()
        else:
            self.known -= 1
            self.pool.appendleft(unit)  # dask keeps the priority of a unit that comes back

    def close(self) -> None:
        """Count a unit as ended."""
        self.known -= 1
        self.left -= 1
        if not self.left:
            self.finished.succeed()
