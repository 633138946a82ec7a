"""Soak: hours of the service in simulated time, with faults at random."""

import argparse
import gc
import os
import sys
import time
from concurrent.futures import Future, ProcessPoolExecutor
from dataclasses import dataclass
from multiprocessing import get_context
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

from tests.histories.faults import Fault, S, draw
from tests.histories.play import judge, play_on, shrink
from tools.benchmarks._report import Report

HISTORY_S = 60
"""Length of a history, s."""
AN_HOUR = 3600 // HISTORY_S
"""Histories of an hour."""
FLAT_MIB = 1.0
"""Most that the memory of one service may grow after its first hour, MiB."""
LEAST_H = 2.0
"""Least number of hours of which the growth after the first can be told."""


@dataclass(frozen=True)
class Soak:
    """What is run.

    Attributes:
        hours: Simulated time.
        per_minute: Faults a minute.
        seed: Seed of the first history.

    """

    hours: float
    per_minute: float
    seed: int

    @property
    def count(self) -> int:
        """Number of histories."""
        return max(round(self.hours * AN_HOUR), 1)


def run_history(task: tuple[int, float]) -> tuple[int, list[str], tuple[Fault, ...]]:
    """Seed, broken rules, and the fewest faults that break them."""
    seed, per_minute = task
    faults = draw(seed, HISTORY_S * S, per_minute)
    found = judge(seed, HISTORY_S * S, faults)
    told = [f"{one.rule}: {one.text}" for one in found]
    return seed, told, shrink(seed, HISTORY_S * S, faults) if found else faults


def judge_histories(soak: Soak, jobs: int) -> int:
    """Number of histories in which a rule was broken; each is printed with its seed."""
    began, broken = time.monotonic(), 0
    with ProcessPoolExecutor(jobs) as pool:
        tasks = [(soak.seed + number, soak.per_minute) for number in range(soak.count)]
        for number, (seed, told, fewest) in enumerate(pool.map(run_history, tasks), 1):
            if told:
                broken += 1
                print(f"seed {seed}: {len(told)} times, first {told[0]}")
                for fault in fewest:
                    print(f"    {fault}")
            if number % 20 == 0 or number == soak.count:
                took_s = time.monotonic() - began
                print(
                    f"histories: {number / AN_HOUR:.2f} h, {broken} broken, {took_s:.0f} s",
                    flush=True,
                )
    return broken


def watch_memory(soak: Soak) -> list[float]:
    """Resident memory of one service after each of its hours, MiB."""
    memory: list[float] = []
    began = time.monotonic()
    for number in play_on(soak.seed, HISTORY_S * S, soak.per_minute):
        if number % AN_HOUR == 0:
            gc.collect()
            memory.append(resident_mib())
            took_s = time.monotonic() - began
            hours = number // AN_HOUR
            print(f"one service: {hours} h, {memory[-1]:.1f} MiB, {took_s:.0f} s", flush=True)
        if number >= soak.count:
            return memory
    raise AssertionError("histories have no end")


def resident_mib() -> float:
    """Resident memory of this process, MiB."""
    pages = int(Path("/proc/self/statm").read_text().split()[1])
    return pages * os.sysconf("SC_PAGE_SIZE") / 2**20


def main() -> int:
    """Run the command; 1 where a target was missed."""
    parser = argparse.ArgumentParser(prog="tools/soak", description=__doc__)
    parser.add_argument("--hours", type=float, default=1.0, metavar="H", help="simulated time")
    parser.add_argument(
        "--faults", type=float, default=6.0, metavar="RATE", help="faults a minute (default 6)"
    )
    parser.add_argument("--seed", type=int, default=1, metavar="N", help="of the first history")
    parser.add_argument("--jobs", type=int, default=2, metavar="N", help="processes at a time")
    parser.add_argument(
        "--only",
        choices=("histories", "memory"),
        help="histories of a minute, each judged; or one service with the tracker for all hours, "
        f"its memory after each (by default both, memory from --hours {LEAST_H:g} on)",
    )
    options = parser.parse_args()
    soak = Soak(options.hours, options.faults, options.seed)
    with_memory = options.only != "histories" and soak.hours >= LEAST_H
    if options.only == "memory" and not with_memory:
        parser.error(f"growth after the first hour needs more of them: --hours {LEAST_H:g} or more")
    # A new interpreter, whose memory holds nothing of the histories.
    with ProcessPoolExecutor(1, get_context("spawn")) as alone:
        memory = alone.submit(watch_memory, soak) if with_memory else None
        broken = None
        if options.only != "memory":
            broken = judge_histories(soak, max(options.jobs - with_memory, 1))
        return tell(soak, broken, memory)


def tell(soak: Soak, broken: int | None, memory: "Future[list[float]] | None") -> int:
    """Print the figures beside their targets; 1 where one was missed."""
    report = Report()
    after = None if memory is None else memory.result()
    print(f"{soak.hours:g} h of simulated time, {soak.per_minute:g} faults a minute")
    if broken is not None:
        what = f"of {soak.count} histories of {HISTORY_S} s, those in which a rule was broken"
        report.at_most(what, broken, 0, "d")
    if after is not None:
        grown, at_end = max(after[1:]) - after[0], after[-1] - after[0]
        what = f"one service, growth after its first hour, when it had {after[0]:.1f} MiB"
        value = f"{grown:+.2f} MiB, {at_end:+.2f} at the end"
        report.check(what, value, f"at most {FLAT_MIB:g} MiB", met=grown <= FLAT_MIB)
    return 1 if report.missed else 0


if __name__ == "__main__":
    sys.exit(main())
