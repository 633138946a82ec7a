"""Soak: hours of the service in simulated time, with faults at random."""

import argparse
import gc
import hashlib
import json
import os
import signal
import sys
import time
from collections.abc import Sequence
from dataclasses import dataclass, field
from multiprocessing import get_context
from multiprocessing.connection import Connection
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

from tests.histories.faults import Fault, S, draw
from tests.histories.play import estimator_of, judge, play_on, shrink
from tools.benchmarks._report import Report
from tools.processes import end_processes, results_as_done

ROOT = Path(__file__).resolve().parent.parent
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


@dataclass
class Found:
    """What was found so far.

    Attributes:
        histories: Number of histories judged.
        broken: Number of those in which a rule was broken.
        memory: Resident memory of the one service after each of its hours, MiB.

    """

    histories: int = 0
    broken: int = 0
    memory: list[float] = field(default_factory=list)


def run_history(task: tuple[int, float]) -> tuple[int, list[str], tuple[Fault, ...]]:
    """Seed, broken rules, and the fewest faults that break them."""
    seed, per_minute = task
    faults = draw(seed, HISTORY_S * S, per_minute)
    estimator = estimator_of(seed)
    found = judge(seed, HISTORY_S * S, faults, estimator)
    told = [f"{one.rule}: {one.text}" for one in found]
    return seed, told, shrink(seed, HISTORY_S * S, faults, estimator) if found else faults


class Record:
    """Histories that were judged before, in a file: of this code and this rate of faults alone.

    Args:
        path: The file; None keeps nothing.
        per_minute: Faults a minute.

    """

    def __init__(self, path: Path | None, per_minute: float) -> None:
        self._path = path
        self._same = {"code": hash_of_code(), "per_minute": per_minute}
        self.broken: dict[int, bool] = {}
        """Whether a rule was broken, by seed."""
        if path is not None and path.exists():
            for line in path.read_text().splitlines():
                entry = json.loads(line)
                if self._same.items() <= entry.items():
                    self.broken[entry["seed"]] = entry["broken"]

    def add(self, seed: int, *, broken: bool) -> None:
        """Note a history that was judged."""
        self.broken[seed] = broken
        if self._path is not None:
            entry = {**self._same, "seed": seed, "broken": broken}
            with self._path.open("a") as file:
                file.write(json.dumps(entry) + "\n")


def hash_of_code() -> str:
    """Hash of the service and of what plays and judges the histories, and of nothing else.

    A change of what a service never loads, as the diagnosis, leaves the histories as they are.
    """
    digest = hashlib.sha256()
    for path in loaded_code():
        digest.update(str(path.relative_to(ROOT)).encode() + path.read_bytes())
    return digest.hexdigest()[:16]


def loaded_code() -> list[Path]:
    """Files that a history loads, and the databases."""
    judge(0, S, (), estimator_of(0))  # what is imported on the first use is loaded then
    files = (getattr(module, "__file__", None) for module in list(sys.modules.values()))
    ours = [ROOT / folder for folder in ("adhesion_can", "tests/histories")]
    loaded = {Path(file) for file in files if file and _is_in(Path(file), ours)}
    return sorted(loaded | set((ROOT / "dbc").glob("*.dbc")))


def _is_in(path: Path, folders: Sequence[Path]) -> bool:
    """Whether a file is in one of some folders."""
    return any(folder in path.parents for folder in folders)


def judge_histories(soak: Soak, jobs: int, found: Found, record: Record) -> None:
    """Judge all histories; one in which a rule was broken is printed with its seed."""
    began = time.monotonic()
    seeds = range(soak.seed, soak.seed + soak.count)
    known = [record.broken[seed] for seed in seeds if seed in record.broken]
    found.histories, found.broken = len(known), sum(known)
    if known:
        print(f"histories: {len(known)} of {soak.count} were judged before", flush=True)
    tasks = [(seed, soak.per_minute) for seed in seeds if seed not in record.broken]
    for _, (seed, told, fewest) in results_as_done(run_history, tasks, jobs):
        found.histories += 1
        if told:
            found.broken += 1
            print(f"seed {seed}: {len(told)} times, first {told[0]}")
            for fault in fewest:
                print(f"    {fault}")
        record.add(seed, broken=bool(told))
        if found.histories % 20 == 0 or found.histories == soak.count:
            took_s = time.monotonic() - began
            print(
                f"histories: {found.histories / AN_HOUR:.2f} h, {found.broken} broken, "
                f"{took_s:.0f} s",
                flush=True,
            )


class OneService:
    """One service with the tracker for all hours, in a process of its own."""

    def __init__(self, soak: Soak):
        # A new interpreter, whose memory holds nothing of the histories.
        context = get_context("spawn")
        self._reader, writer = context.Pipe(duplex=False)
        self._process = context.Process(target=watch_memory, args=(soak, writer))
        self._process.start()
        writer.close()

    def wait(self, found: Found) -> None:
        """Wait for its end.

        Raises:
            ChildProcessError: If it ended before its hours were over.

        """
        self.collect(found, is_waiting=True)
        self._process.join()
        if self._process.exitcode:
            text = f"the one service ended after {len(found.memory)} h, with exit code"
            raise ChildProcessError(f"{text} {self._process.exitcode}; its words are above")

    def collect(self, found: Found, *, is_waiting: bool = False) -> None:
        """Take what it told until now, or until its end."""
        while is_waiting or self._reader.poll():
            try:
                found.memory.append(self._reader.recv())
            except EOFError:
                return


def watch_memory(soak: Soak, writer: Connection) -> None:
    """Resident memory of one service after each of its hours, MiB, told as they come."""
    signal.signal(signal.SIGINT, signal.SIG_DFL)
    began = time.monotonic()
    for number in play_on(soak.seed, HISTORY_S * S, soak.per_minute):
        if number % AN_HOUR == 0:
            gc.collect()
            memory = resident_mib()
            writer.send(memory)
            took_s = time.monotonic() - began
            hours = number // AN_HOUR
            # Blocks in use beside it: what grows without them is freed memory in fragments.
            blocks = sys.getallocatedblocks()
            print(
                f"one service: {hours} h, {memory:.2f} MiB, {blocks} blocks in use, {took_s:.0f} s",
                flush=True,
            )
        if number >= soak.count:
            return


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
    parser.add_argument(
        "--record",
        type=Path,
        metavar="FILE",
        help="keep the judged part, and continue there where the command was stopped; histories of "
        "another code or rate of faults are run again",
    )
    options = parser.parse_args()
    soak = Soak(options.hours, options.faults, options.seed)
    with_memory = options.only != "histories" and soak.hours >= LEAST_H
    if options.only == "memory" and not with_memory:
        parser.error(f"growth after the first hour needs more of them: --hours {LEAST_H:g} or more")
    jobs = None if options.only == "memory" else max(options.jobs - with_memory, 1)
    signal.signal(signal.SIGTERM, signal.default_int_handler)
    record = Record(options.record, options.faults)
    return run(soak, jobs, record, with_memory=with_memory)


def run(soak: Soak, jobs: int | None, record: Record, *, with_memory: bool) -> int:
    """Run both parts, or as much as there is time for until the command is stopped."""
    found = Found()
    one_service = OneService(soak) if with_memory else None
    is_stopped, crash = False, None
    try:
        if jobs is not None:
            judge_histories(soak, jobs, found, record)
        if one_service is not None:
            one_service.wait(found)
    except KeyboardInterrupt:
        is_stopped = True
        if one_service is not None:
            one_service.collect(found)
    except ChildProcessError as error:
        crash = error
    finally:
        end_processes()
    is_missed = tell(soak, found, is_stopped=is_stopped)
    if crash is not None:
        print(f"  CRASHED: {crash}")
    return 1 if is_missed or is_stopped or crash is not None else 0


def tell(soak: Soak, found: Found, *, is_stopped: bool) -> bool:
    """Print the figures beside their targets; whether one was missed."""
    report = Report()
    print(f"{soak.hours:g} h of simulated time, {soak.per_minute:g} faults a minute")
    if is_stopped:
        done = f"{found.histories / AN_HOUR:.2f} h of histories, {len(found.memory)} h of one"
        print(f"  STOPPED before the end, after {done} service: the figures cover these")
    if found.histories:
        what = f"of {found.histories} histories of {HISTORY_S} s, those in which a rule was broken"
        report.at_most(what, found.broken, 0, "d")
    if len(found.memory) >= LEAST_H:
        first, *others = found.memory
        grown, at_end = max(others) - first, others[-1] - first
        what = f"one service, growth after its first hour, when it had {first:.1f} MiB"
        value = f"{grown:+.2f} MiB, {at_end:+.2f} at the end"
        report.check(what, value, f"at most {FLAT_MIB:g} MiB", met=grown <= FLAT_MIB)
    return bool(report.missed)


if __name__ == "__main__":
    sys.exit(main())
