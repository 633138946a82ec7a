"""Soak: hours of the service in simulated time, with faults at random."""

import argparse
import gc
import os
import sys
import time
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

from tests.histories.faults import Fault, S, draw
from tests.histories.play import judge, play_on, shrink

HISTORY_S = 60
"""Length of a history, s."""
FLAT_MIB = 1.0
"""Most that the memory of one service may grow after its first hour, MiB."""


def resident_mib() -> float:
    """Resident memory of this process, MiB."""
    pages = int(Path("/proc/self/statm").read_text().split()[1])
    return pages * os.sysconf("SC_PAGE_SIZE") / 2**20


def run_history(task: tuple[int, float]) -> tuple[int, list[str], tuple[Fault, ...], float]:
    """Seed, broken rules, the fewest faults that break them, and resident memory, MiB."""
    seed, per_minute = task
    faults = draw(seed, HISTORY_S * S, per_minute)
    found = judge(seed, HISTORY_S * S, faults)
    told = [f"{one.rule}: {one.text}" for one in found]
    fewest = shrink(seed, HISTORY_S * S, faults) if found else faults
    return seed, told, fewest, resident_mib()


def watch_memory(hours: float, per_minute: float, seed: int) -> int:
    """Print the memory of one service after each hour; 1 where it grew by more than `FLAT_MIB`."""
    memory = []
    began = time.monotonic()
    an_hour = round(3600 / HISTORY_S)
    for number in play_on(seed, HISTORY_S * S, per_minute):
        if number % an_hour == 0:
            gc.collect()
            memory.append(resident_mib())
            print(
                f"{number // an_hour} h: {memory[-1]:.1f} MiB, {time.monotonic() - began:.0f} s",
                flush=True,
            )
        if number >= hours * an_hour:
            break
    grown = max(memory[1:], default=memory[0]) - memory[0]
    print(f"one service, {per_minute:g} faults a minute: {memory[0]:.1f} MiB after the first hour,")
    print(f"at most {grown:+.2f} MiB from it later, {memory[-1] - memory[0]:+.2f} at the end")
    return 1 if grown > FLAT_MIB else 0


def main() -> int:
    """Run the command; 1 where a rule was broken."""
    parser = argparse.ArgumentParser(prog="tools/soak", description=__doc__)
    parser.add_argument("--hours", type=float, default=1.0, metavar="H", help="simulated time")
    parser.add_argument(
        "--faults", type=float, default=6.0, metavar="RATE", help="faults a minute (default 6)"
    )
    parser.add_argument("--seed", type=int, default=1, metavar="N", help="of the first history")
    parser.add_argument("--jobs", type=int, default=2, metavar="N", help="histories at a time")
    parser.add_argument(
        "--one-service",
        action="store_true",
        help="one service with the tracker for all hours, not judged: its memory after each",
    )
    options = parser.parse_args()
    if options.one_service:
        if options.hours < 1.0:
            parser.error("--one-service is told hour by hour: --hours 1 or more")
        return watch_memory(options.hours, options.faults, options.seed)
    count = max(round(options.hours * 3600 / HISTORY_S), 1)
    began, broken, memory = time.monotonic(), 0, []
    with ProcessPoolExecutor(options.jobs) as pool:
        tasks = [(options.seed + number, options.faults) for number in range(count)]
        for number, (seed, told, fewest, rss) in enumerate(pool.map(run_history, tasks), 1):
            memory.append(rss)
            if told:
                broken += 1
                print(f"seed {seed}: {len(told)} times, first {told[0]}")
                for fault in fewest:
                    print(f"    {fault}")
            if number % 20 == 0 or number == count:
                hours = number * HISTORY_S / 3600
                print(
                    f"{hours:.2f} h, {broken} broken, {time.monotonic() - began:.0f} s", flush=True
                )
    settled = memory[min(len(memory) - 1, max(len(memory) // 4, 1)) :]
    print(
        f"{count} histories of {HISTORY_S} s, {options.faults:g} faults a minute: {broken} broken"
    )
    print(f"memory of a process: {settled[0]:.1f} MiB, at the end {settled[-1]:.1f} MiB")
    return 1 if broken else 0


if __name__ == "__main__":
    sys.exit(main())
