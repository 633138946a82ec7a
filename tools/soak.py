"""Soak: hours of the service in simulated time, with faults at random."""

import argparse
import os
import sys
import time
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

from tests.histories.faults import Fault, S, draw
from tests.histories.play import judge, shrink

HISTORY_S = 60
"""Length of a history, s."""


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


def main() -> int:
    """Run the command; 1 where a rule was broken."""
    parser = argparse.ArgumentParser(prog="tools/soak", description=__doc__)
    parser.add_argument("--hours", type=float, default=1.0, metavar="H", help="simulated time")
    parser.add_argument(
        "--faults", type=float, default=6.0, metavar="RATE", help="faults a minute (default 6)"
    )
    parser.add_argument("--seed", type=int, default=1, metavar="N", help="of the first history")
    parser.add_argument("--jobs", type=int, default=2, metavar="N", help="histories at a time")
    options = parser.parse_args()
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
