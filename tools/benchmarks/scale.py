"""What a large fleet needs: bytes, cores, memory, money, and where the run breaks first.

Costs of a unit come from a data set of `adhesion-can fleet` (--fleet OUT) or from the options; the
queue of 100 000 units is simulated (`_fleet_queue.py`).
"""

import argparse
import math
import time
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from adhesion_can.fleet.schema import STEPS, seconds_column
from tools.benchmarks._fleet_queue import Cost, Failures, Outcome, Run, draw_lengths

DAY_H, YEAR_D = 24.0, 365.0
MIB, GB = 2.0**20, 1e9


@dataclass(frozen=True)
class Fleet:
    """Size of a fleet and prices, which are assumptions: put in your own.

    Attributes:
        locomotives: Number of locomotives.
        hours: Recorded hours of a locomotive in a day.
        kept_d: Days that recordings are kept, d.
        rows_bytes_per_unit: Size of a unit's rows in the data set, bytes.
        worker_gib: Memory of a worker, GiB.
        core_hour: Price of a core for an hour.
        gb_month: Price of a GB in the object store for a month.

    """

    locomotives: int
    hours: float
    kept_d: float
    rows_bytes_per_unit: float
    worker_gib: float
    core_hour: float
    gb_month: float


LEAST_RATIO = 1.5
"""Ratio of the longest to the shortest recording from which fixed time and time per hour differ."""


def fit_steps(folder: Path) -> tuple[dict[str, tuple[float, float]], float]:
    """Fixed time and time per hour of each step, and the spread of their sum.

    By least squares with both at least 0 over the finished units of a data set, relative errors
    counted. The spread is the standard deviation of the logarithm of the sum over its prediction.
    """
    import pyarrow.dataset as ds
    from scipy.optimize import nnls

    steps = ("read", *STEPS)
    columns = ["duration_s", "status", *(seconds_column(step) for step in steps)]
    rows = ds.dataset(folder / "units", format="parquet", partitioning=None).to_table(
        columns=columns,
        filter=(ds.field("status") == "done") & (ds.field("duration_s") > 0.0),
    )
    if not len(rows):
        raise SystemExit(f"--fleet {folder}: no finished unit of a known duration")
    hours = np.asarray(rows["duration_s"], dtype=float) / 3600.0
    # Where all are of one length, nothing tells what of it does not depend on the length.
    fixed = np.ones_like(hours) if hours.max() >= LEAST_RATIO * hours.min() else 0.0 * hours
    design = np.column_stack([fixed, hours])
    seconds = {
        step: np.nan_to_num(np.asarray(rows[seconds_column(step)].to_pylist(), dtype=float))
        for step in steps
    }
    total = np.maximum(sum(seconds.values()), 1e-6)
    # Long units vary by more: rows are divided by what is expected of them.
    whole = np.full(len(hours), total.mean())
    for _ in range(4):
        found = {
            step: tuple(map(float, nnls(design / whole[:, None], own / whole)[0]))
            for step, own in seconds.items()
        }
        whole = np.maximum(design @ np.sum(list(found.values()), axis=0), 1e-6)
    return found, float(np.std(np.log(total / whole)))


def fit_cost(folder: Path, cost: Cost) -> Cost:
    """Fixed time and time per hour of a unit, from those of its steps; printed, step by step."""
    steps, spread = fit_steps(folder)
    print(f"{'step':>10} {'fixed':>9} {'an hour':>9}")
    for step, (fixed, per_hour) in steps.items():
        print(f"{step:>10} {fixed:>7.2f} s {per_hour:>7.1f} s")
    fixed, per_hour = np.sum(list(steps.values()), axis=0)
    return replace(cost, fixed_s=float(fixed), per_hour_s=float(per_hour), spread=spread)


def year(fleet: Fleet, cost: Cost) -> list[tuple[str, str]]:
    """Rows of the table of a year."""
    unit_s = cost.fixed_s + cost.per_hour_s
    units_per_day = fleet.locomotives * fleet.hours
    cores = units_per_day * unit_s / 86400.0
    in_per_day = units_per_day * cost.bytes_per_hour
    out_per_day = units_per_day * fleet.rows_bytes_per_unit
    core_money = fleet.hours * YEAR_D * unit_s / 3600.0 * fleet.core_hour
    kept_gb = fleet.hours * fleet.kept_d * cost.bytes_per_hour / GB
    rows_gb = fleet.hours * YEAR_D * fleet.rows_bytes_per_unit / GB
    store_money = (kept_gb + rows_gb / 2.0) * 12.0 * fleet.gb_month
    return [
        ("units (an hour each) a day", f"{units_per_day:,.0f}"),
        ("recordings in, a day", f"{in_per_day / 1e12:.2f} TB, {rate(in_per_day)}"),
        ("recordings in, a year", f"{in_per_day * YEAR_D / 1e15:.2f} PB"),
        (f"recordings kept ({fleet.kept_d:g} d)", f"{in_per_day * fleet.kept_d / 1e12:,.0f} TB"),
        ("rows out, a year", f"{out_per_day * YEAR_D / 1e12:.2f} TB"),
        ("core time of an hour", f"{unit_s:.1f} s ({3600.0 / unit_s:.0f} x real time)"),
        ("cores, busy day and night", f"{math.ceil(cores):,}"),
        ("memory of these workers", f"{cores * fleet.worker_gib:,.0f} GiB"),
        ("units a second to hand out", f"{units_per_day / 86400.0:.2f}"),
        ("dispatcher busy", f"{units_per_day / 86400.0 * cost.dispatch_s:.2%}"),
        ("cores of a locomotive, a year", f"{core_money:.2f} at {fleet.core_hour:g} a core hour"),
        ("store of a locomotive, a year", f"{store_money:.2f} at {fleet.gb_month:g} a GB month"),
    ]


def rate(bytes_per_day: float) -> str:
    """Mean transfer rate, MB/s."""
    return f"{bytes_per_day / 86400.0 / 1e6:,.0f} MB/s"


def print_runs(options: argparse.Namespace, cost: Cost, failures: Failures) -> None:
    """The table of simulated runs."""
    lengths = draw_lengths(options.units, np.random.default_rng(options.seed))
    whole = np.floor(lengths).astype(int)
    rest = lengths - whole
    hour_long = np.concatenate([np.ones(whole.sum()), rest[rest > 0.0]])
    print(
        f"\n{options.units:,} units, {lengths.sum():,.0f} h recorded (80 % of an hour, 19.5 % of "
        f"less, 0.5 % of 24 h); a worker lives {failures.worker_life_h:g} h;"
        f"\n{failures.broken:.2%} of the units cannot be read, {failures.deadly:.2%} kill each "
        "worker that takes them"
    )
    head = f"{'workers':>8} {'order':>15} {'makespan':>10} {'useful':>8} {'lost':>8}"
    print(f"{head} {'dispatcher':>11} {'in flight':>10} {'deaths':>7} {'failed':>7}")
    for workers in options.workers:
        for order, chosen in (
            ("as they come", lengths),
            ("longest first", np.sort(lengths)[::-1]),
            ("cut at an hour", hour_long),
        ):
            run = Run(
                list(chosen), workers, cost, failures, window=options.window, seed=options.seed
            )
            print(line(workers, order, run.play()), flush=True)


def line(workers: int, order: str, outcome: Outcome) -> str:
    """A row of the table of runs."""
    useful = outcome.useful_s / (outcome.makespan_s * workers)
    return (
        f"{workers:>8} {order:>15} {outcome.makespan_s / 3600.0:>8.2f} h {useful:>8.1%} "
        f"{outcome.lost_s / outcome.useful_s:>8.2%} {outcome.dispatcher:>11.2%} "
        f"{outcome.in_flight:>10} {outcome.deaths:>7} {outcome.failed:>7}"
    )


def main() -> None:
    parser = argparse.ArgumentParser(prog="tools/bench scale", description=__doc__)
    add = parser.add_argument
    add("--fleet", type=Path, metavar="OUT", help="data set whose units show the costs")
    add("--units", type=int, default=100_000)
    add("--workers", type=int, nargs="+", default=[2, 100, 1000, 4000, 10_000])
    add("--window", type=int, default=2, help="units that a worker holds")
    add("--seed", type=int, default=1)
    add("--fixed-s", type=float, default=0.2, help="core time of a unit of any length")
    add("--per-hour-s", type=float, default=141.0, help="core time for an hour of recording")
    add("--spread", type=float, default=0.1, help="standard deviation of the logarithm of the time")
    add("--mb-per-hour", type=float, default=22.0, help="size of an hour of recording (BLF)")
    add("--request-s", type=float, default=0.1, help="time to the first byte of the store")
    add("--worker-mb-per-s", type=float, default=50.0, help="transfer rate of a worker")
    add("--store-mb-per-s", type=float, default=5000.0, help="transfer rate of the store")
    add("--dispatch-ms", type=float, default=3.0, help="core time of the scheduler for a unit")
    add("--worker-life-h", type=float, default=100.0, help="mean life of a worker")
    add("--restart-s", type=float, default=60.0, help="time until a worker is replaced")
    add("--broken", type=float, default=2e-3, help="share of units that cannot be read")
    add("--deadly", type=float, default=1e-4, help="share of units that kill their worker")
    add("--locomotives", type=int, default=10_000)
    add("--hours", type=float, default=24.0, help="recorded hours a day")
    add("--kept-d", type=float, default=30.0, help="days that recordings are kept")
    add("--kb-out", type=float, default=71.0, help="rows of a unit in the data set")
    add("--worker-gib", type=float, default=1.0, help="memory of a worker")
    add("--core-hour", type=float, default=0.04, help="price of a core for an hour")
    add("--gb-month", type=float, default=0.02, help="price of a GB for a month")
    options = parser.parse_args()
    cost = Cost(
        options.fixed_s, options.per_hour_s, options.spread, options.mb_per_hour * 1e6,
        options.request_s, options.worker_mb_per_s * 1e6, options.store_mb_per_s * 1e6,
        options.dispatch_ms * 1e-3,
    )  # fmt: skip
    if options.fleet:
        cost = fit_cost(options.fleet, cost)
        print(
            f"costs of {options.fleet}: {cost.fixed_s:.2f} s + {cost.per_hour_s:.1f} s an hour, "
            f"spread {cost.spread:.2f}"
        )
    fleet = Fleet(
        options.locomotives, options.hours, options.kept_d, options.kb_out * 1e3,
        options.worker_gib, options.core_hour, options.gb_month,
    )  # fmt: skip
    print(f"{fleet.locomotives:,} locomotives, {fleet.hours:g} h a day recorded, 365 days")
    for name, value in year(fleet, cost):
        print(f"  {name:36} {value}")
    began = time.monotonic()
    print_runs(
        options, cost,
        Failures(options.worker_life_h, options.restart_s, options.broken, options.deadly),
    )  # fmt: skip
    print(f"\n(simulated in {time.monotonic() - began:.0f} s)")


if __name__ == "__main__":
    main()
