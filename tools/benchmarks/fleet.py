"""`adhesion-can fleet`: what workers cost beside one process, what a death costs, memory, causes.

Recordings are simulated. "One process" calls the same function for one unit after another, files of
the data set included, with everything imported. Workers are those of the command without
--scheduler, started before the clock is.
"""

import os
import signal
import subprocess
import sys
import tempfile
import time
from itertools import pairwise
from pathlib import Path
from statistics import median

import psutil
from _fleet_causes import causes_row
from _real_data import real_data
from _rows import positive, row_parser, run_rows

from adhesion_can.bus.database import load_database
from adhesion_can.config import load_configuration
from adhesion_can.fleet.cluster import open_cluster, require_workers
from adhesion_can.fleet.dataset import DataSet
from adhesion_can.fleet.plan import make_plan
from adhesion_can.fleet.run import IN_FLIGHT, run_fleet
from adhesion_can.fleet.schema import STEPS, TABLES
from adhesion_can.fleet.units import find_units
from adhesion_can.fleet.work import work_on
from adhesion_can.recordings.candump import format_frame
from adhesion_can.simulation.run import RunSettings, Simulation
from adhesion_can.simulation.scenarios import scenario_by_name
from tests.fleet.tables import rows

WORKERS = 2
LEAST_SHARE = 0.9
OVERHEAD_S = 0.05
GROWTH = 1.1
"""Memory with 10 000 units over that with 100, from which it is not flat."""
SAMPLE_S = 0.5


def write_drive(path, duration_s, seed=1, scenario="dry-wet-dry"):
    """A simulated drive as candump text."""
    settings = RunSettings(scenario_by_name(scenario), duration_s, seed=seed)
    lines = [format_frame(f) for step in Simulation(settings, load_database()).run() for f in step]
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text("".join(lines))


def link_drives(folder, count, duration_s):
    """One short drive under many names."""
    first = folder / "drives" / "0" / "0.log"
    write_drive(first, duration_s, scenario="dry")
    for number in range(1, count):
        path = folder / "drives" / str(number // 1000) / f"{number}.log"
        path.parent.mkdir(exist_ok=True)
        os.link(first, path)
    return folder / "drives"


def tasks_of(folder, out, steps=STEPS):
    """Tasks of all recordings below a folder."""
    units = find_units([str(folder)], None, str(out))
    plan = make_plan(units, str(out), steps, lambda path: load_configuration(path, None))
    return list(plan.tasks(DataSet(str(out)).read_units()))


def in_one_process(tasks):
    """Wall time of all units one after another, s, and what became of them."""
    began = time.perf_counter()
    outcomes = [work_on(task) for task in tasks]
    return time.perf_counter() - began, outcomes


def over_workers(client, tasks, kill_after=None):
    """Wall time of all units over the workers, s, and what became of them."""
    began, outcomes = time.perf_counter(), []
    for outcome in run_fleet(client, tasks):
        outcomes.append(outcome)
        if len(outcomes) == kill_after:
            os.kill(next(iter(client.run(os.getpid).values())), signal.SIGKILL)
    return time.perf_counter() - began, outcomes


def spent_s(client):
    """Processor time of this process, which has the scheduler, and of the workers, s."""
    return time.process_time() + sum(client.run(time.process_time).values())


def throughput(report, options):
    """Units per second and worker, two workers beside one process."""
    with tempfile.TemporaryDirectory() as name, open_cluster(None, WORKERS) as client:
        folder = Path(name)
        for number in range(options.drives):
            write_drive(folder / "drives" / "a" / f"{number}.log", options.seconds, seed=number)
        warm = tasks_of(folder / "drives", folder / "warm", ("check",))
        require_workers(client, None, str(folder / "warm"), None)
        over_workers(client, warm)
        shares, alone = [], []
        for turn in range(options.runs):
            one, _ = in_one_process(tasks_of(folder / "drives", folder / f"one{turn}"))
            two, outcomes = over_workers(client, tasks_of(folder / "drives", folder / f"two{turn}"))
            require_done(outcomes)
            shares.append(one / two / WORKERS)
            alone.append(one)
        speed = options.drives * options.seconds / median(alone)
        report.write(
            f"{options.drives} drives of {options.seconds:g} s, all steps: one process "
            f"{median(alone):.1f} s ({speed:.1f} x real time); shares "
            f"{', '.join(f'{share:.2f}' for share in shares)}"
        )
        at_least(report, "throughput of a worker / of one process", median(shares), LEAST_SHARE)


def killed(report, options):
    """One of two workers killed in the middle: the same result, at most its units' time more."""
    with tempfile.TemporaryDirectory() as name, open_cluster(None, WORKERS) as client:
        folder = Path(name)
        for number in range(options.drives):
            write_drive(folder / "drives" / "a" / f"{number}.log", options.seconds, seed=number)
        more, limits, same = [], [], []
        for turn in range(options.runs):
            whole, kept = folder / f"whole{turn}", folder / f"killed{turn}"
            require_workers(client, None, str(whole), None)
            whole_s, _ = over_workers(client, tasks_of(folder / "drives", whole))
            tasks = tasks_of(folder / "drives", kept)
            killed_s, outcomes = over_workers(client, tasks, kill_after=options.drives // 3)
            require_done(outcomes)
            more.append(killed_s - whole_s)
            limits.append(IN_FLIGHT * WORKERS * whole_s / options.drives)
            same.append(all(rows(whole, t.name) == rows(kept, t.name) for t in TABLES))
            client.wait_for_workers(WORKERS)
        report.write(f"more: {', '.join(f'{one:.1f} s' for one in more)}")
        report.check("rows of all tables", "the same" if all(same) else "others", "the same",
                     met=all(same))  # fmt: skip
        report.at_most("more time, s; target: time of its units", median(more), median(limits),
                       ".1f")  # fmt: skip


def short(report, options):
    """1 000 short recordings: time of a worker for each beyond that of a plain loop."""
    with tempfile.TemporaryDirectory() as name, open_cluster(None, WORKERS) as client:
        folder = Path(name)
        drives = link_drives(folder, options.units, 0.2)
        require_workers(client, None, str(folder), None)
        spent = [spent_s(client)]
        one, _ = in_one_process(tasks_of(drives, folder / "one", ("check",)))
        spent.append(spent_s(client))
        two, outcomes = over_workers(client, tasks_of(drives, folder / "two", ("check",)))
        spent.append(spent_s(client))
        require_done(outcomes)
        cost = (two * WORKERS - one) / options.units
        loop, workers = (1e3 * (b - a) / options.units for a, b in pairwise(spent))
        report.write(
            f"{options.units} drives of 0.2 s, check: plain loop {1e3 * one / options.units:.1f} ms"
            f" each, {WORKERS} workers {two:.1f} s in all"
        )
        report.write(
            f"processor time: {loop:.1f} ms each in the loop, {workers:.1f} ms with scheduler and "
            "workers"
        )
        report.at_most("overhead each, s of a worker", cost, OVERHEAD_S)


def memory(report, options):
    """Largest memory of scheduler (and command) and of a worker, from 100 to 10 000 units."""
    found = {}
    for count in (100, *options.counts):
        with tempfile.TemporaryDirectory() as name:
            drives = link_drives(Path(name), count, 0.05)
            found[count] = watch(drives, Path(name) / "out")
        scheduler, worker, seconds = found[count]
        report.write(f"{count} units: scheduler {scheduler:.0f} MB, worker {worker:.0f} MB, "
                     f"{seconds:.0f} s")  # fmt: skip
    most = options.counts[-1]
    for place, what in enumerate(("scheduler", "worker")):
        ratio = found[most][place] / found[100][place]
        report.at_most(f"{what}: {most} units / 100 units", ratio, GROWTH, ".2f")


def watch(drives, out):
    """Largest memory of the command and of one of its workers, MB, and the time it took, s."""
    words = ["fleet", drives, "--out", out, "--steps", "check", "--workers", WORKERS]
    began = time.perf_counter()
    process = subprocess.Popen([sys.executable, "-m", "adhesion_can.cli.main", *map(str, words)],
                               stdout=subprocess.DEVNULL)  # fmt: skip
    most = [0.0, 0.0]
    whole = psutil.Process(process.pid)
    while process.poll() is None:
        most[0] = max(most[0], resident(whole))
        most[1] = max([most[1], *map(resident, whole.children(recursive=True))])
        time.sleep(SAMPLE_S)
    if process.returncode:
        raise SystemExit("the command failed")
    return *most, time.perf_counter() - began


def resident(process):
    """Memory of a process, MB; 0 of one that has ended."""
    try:
        return process.memory_info().rss / 1e6
    except psutil.Error:
        return 0.0


def causes(report, options):
    """Faults hidden in 200 simulated locomotives, and thirteen trolleybus missions."""
    with tempfile.TemporaryDirectory() as name:
        missions = real_data("ztbus/*.csv.gz")
        folder = options.keep or Path(name)
        causes_row(report, folder, missions, options.vehicles, options.seed, options.workers)


def require_done(outcomes):
    """A unit that failed makes the figures those of something else."""
    for outcome in outcomes:
        if outcome.failed_step is not None:
            raise SystemExit(f"{outcome.path}: {outcome.failed_step}: {outcome.error}")


def at_least(report, what, value, least):
    report.check(what, f"{value:.2f}", f"at least {least:g}", met=value >= least)


ROWS = {
    "throughput": throughput,
    "killed": killed,
    "short": short,
    "memory": memory,
    "causes": causes,
}


def main():
    parser = row_parser("fleet", ROWS)
    add, number = parser.add_argument, positive(int)
    add("--drives", type=number, default=12, help="of throughput and killed (default 12)")
    add("--seconds", type=positive(float), default=60.0, help="of each of them (default 60)")
    add("--runs", type=number, default=3, help="of throughput and killed, in turns (default 3)")
    add("--units", type=number, default=1000, help="of short (default 1000)")
    add("--counts", type=lambda text: tuple(map(int, text.split(","))), default=(1000, 10_000),
        help="of memory, beside 100 (default 1000,10000)")  # fmt: skip
    add("--vehicles", type=number, default=200, help="of causes (default 200)")
    add("--seed", type=lambda text: tuple(map(int, text.split(","))), default=(1,),
        help="of causes, several with commas (default 1)")  # fmt: skip
    add("--workers", type=number, default=WORKERS, help=f"of causes (default {WORKERS})")
    add("--keep", type=Path, metavar="FOLDER",
        help="recordings and data sets of causes stay here, fleet.html among them")  # fmt: skip
    run_rows(ROWS, parser.parse_args())


if __name__ == "__main__":
    main()
