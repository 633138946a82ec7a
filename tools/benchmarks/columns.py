"""A user's own column on a tyre rig: sweeps in random order, so that time explains nothing.

x1 is the slip angle under a neutral name, with pauses of 5, 1 and 0.1 s between the sweeps. x2 is a
factor of our own in the straight-running rows, 1 + 0.05 x2 with a normal x2 for each sweep. The
data are measured ones that are not part of the project:
`$ADHESION_CAN_REALDATA/tyre_rig_83kPa.csv.gz`.
"""

import csv
import gzip
import io
import json
import os
from contextlib import redirect_stderr, redirect_stdout
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import scipy
from _real_data import real_data
from _report import over_cores
from _rows import positive, row_parser, run_rows

from adhesion_can.physics.effects.formula import formula_of

NAME = "tyre_rig_83kPa.csv.gz"
GAP_S, STRAIGHT_DEG = 0.5, 0.5
FACTOR = 0.05
PAUSES_S = 5.0, 1.0, 0.1
COLUMNS = ("slip", "longitudinal_force_N", "normal_load_N", "speed_mps")


def read_rig():
    """Columns of the rig, and the rows of each sweep."""
    (path,) = real_data(NAME)
    with gzip.open(path, "rt") as file:
        rows = list(csv.DictReader(file))
    columns = {name: np.array([float(row[name]) for row in rows]) for name in rows[0]}
    cuts = np.flatnonzero(np.diff(columns["time_s"]) > GAP_S) + 1
    return columns, np.split(np.arange(len(rows)), cuts)


def table(rig, sweeps, rng, column, pause_s=PAUSES_S[0]):
    """Columns of a table with the sweeps in random order, and the one that matters.

    Of 'null' the column is that of x2, and nothing depends on it.
    """
    rows, time_s, own, clock = [], [], [], 0.0
    for place in rng.permutation(len(sweeps)):
        sweep = sweeps[place]
        elapsed = rig["time_s"][sweep] - rig["time_s"][sweep[0]]
        rows.append(sweep)
        time_s.append(clock + elapsed)
        own.append(np.full(len(sweep), rng.normal()))
        clock += elapsed[-1] + pause_s
    rows, time_s, own = (np.concatenate(part) for part in (rows, time_s, own))
    found = {"time_s": time_s, **{name: rig[name][rows] for name in COLUMNS}}
    if column == "x1":
        return {**found, "x1": rig["slip_angle_deg"][rows]}
    factor = FACTOR if column == "x2" else 0.0
    found["longitudinal_force_N"] = found["longitudinal_force_N"] * (1.0 + factor * own)
    straight = np.abs(rig["slip_angle_deg"][rows]) < STRAIGHT_DEG
    straight &= np.abs(rig["inclination_deg"][rows]) < STRAIGHT_DEG
    return {name: values[straight] for name, values in {**found, "x2": own}.items()}


def named(seed, column, pause_s, number):
    """Ids that `diagnose` names in one order, and channels of its formula."""
    from adhesion_can.cli.main import main

    rig, sweeps = read_rig()
    columns = table(rig, sweeps, np.random.default_rng([seed, number]), column, pause_s)
    with TemporaryDirectory() as folder:
        path, answer = Path(folder) / "t.csv", Path(folder) / "d.json"
        values = np.column_stack(list(columns.values()))
        np.savetxt(path, values, delimiter=",", header=",".join(columns), comments="", fmt="%.6g")
        with redirect_stdout(io.StringIO()), redirect_stderr(io.StringIO()):
            main(["diagnose", str(path), "--json", str(answer)])
        causes = json.loads(answer.read_text())["causes"]
    return [name for cause in causes for name in causes_named(cause)]


def causes_named(cause):
    """Id of a cause; of a formula the channels on which it depends, as if each was named."""
    if cause["effect"] != "formula":
        return [cause["effect"]]
    values = {name: one["value"] for name, one in cause["parameters"].items()}
    return [f"channel:{name}" for name in formula_of(cause["form"], values).channels]


def names_of_orders(column, pause_s, options):
    """What is named in each of the orders."""
    answer = partial(named, options.seed, column, pause_s)
    return over_cores(answer, range(options.runs), options.jobs, f"{column}, {pause_s:g} s")


def row(column, pause_s, report, options):
    found = names_of_orders(column, pause_s, options)
    right = sum(f"channel:{column}" in names for names in found)
    drifts = sum("slow_drift" in names for names in found)
    share = right / len(found)
    what = f"{column} named in {right} of {len(found)} orders, {pause_s:g} s between sweeps"
    report.check(what, f"{100 * share:.0f} %", "95 %", met=share >= 0.95)
    report.check(f"{column}: time named", f"{drifts} times", "never", met=drifts == 0)
    others = sorted({name for names in found for name in names} - {f"channel:{column}"})
    report.write(f"named besides: {', '.join(others) or 'nothing'}")


def x1_row(report, options):
    """The slip angle as a column of a neutral name."""
    for pause_s in PAUSES_S:
        row("x1", pause_s, report, options)


def x2_row(report, options):
    """A factor of our own, written into the forces."""
    row("x2", PAUSES_S[0], report, options)
    six = [power_of_sweeps(options.seed, number) for number in range(options.runs)]
    t, power = np.median(six, axis=0)[0], np.mean(six, axis=0)[1]
    report.write(
        f"bound: a regression of the straight sweeps' levels on load and x2, which knows that a "
        f"level is 1 + {FACTOR} x2 and a power of the load, has t = {t:.1f} (median) and finds x2 "
        f"in {100 * power:.0f} % at a level of 5 %"
    )


def null_row(report, options):
    """The same column as x2 where nothing depends on it: the price of finding it."""
    found = names_of_orders("null", PAUSES_S[0], options)
    wrong = sum("channel:x2" in names for names in found)
    drifts = sum("slow_drift" in names for names in found)
    what = f"x2 that changes nothing named in {wrong} of {len(found)} orders"
    # At a level of 5 % more than this has a probability of 5 % at most.
    most = int(scipy.stats.binom.ppf(0.95, len(found), 0.05))
    report.check(what, f"{100 * wrong / len(found):.0f} %", f"{most} at most", met=wrong <= most)
    report.check("null: time named", f"{drifts} times", "never", met=drifts == 0)


def power_of_sweeps(seed, number):
    """Noncentral t of x2 in a regression of the straight sweeps' levels, and its power at 5 %."""
    rig, sweeps = read_rig()
    columns = table(rig, sweeps, np.random.default_rng([seed, number]), "x2")
    sweep = np.concatenate([[0], np.cumsum(np.diff(columns["time_s"]) > GAP_S)])
    forces = columns["longitudinal_force_N"] / (1.0 + FACTOR * columns["x2"])
    load = columns["normal_load_N"]
    levels = sweep_levels(columns["slip"], forces / load, load, sweep)
    x2, log_load = (
        np.bincount(sweep, values) / np.bincount(sweep) for values in (columns["x2"], np.log(load))
    )
    known = np.column_stack([np.ones_like(log_load), log_load])
    free = x2 - known @ np.linalg.lstsq(known, x2, rcond=None)[0]
    scatter = levels - known @ np.linalg.lstsq(known, levels, rcond=None)[0]
    freedom = len(levels) - 3
    std = np.sqrt(scatter @ scatter / (freedom + 1))
    t = FACTOR * np.sqrt(free @ free) / std
    limit = scipy.stats.t.ppf(0.975, freedom)
    distribution = scipy.stats.nct(freedom, t)
    return t, distribution.sf(limit) + distribution.cdf(-limit)


def sweep_levels(slip, adhesion, load, sweep):
    """Logarithm of each sweep's adhesion over that of one curve with powers of the load."""
    size, log_load = np.abs(slip), np.log(load / load.mean())
    number = sweep.max() + 1

    def curve(values):
        c1, c2, c3, by_load, rise_by_load = values[:5]
        rise = -np.expm1(-c2 * np.exp(rise_by_load * log_load) * size)
        factor = np.exp(by_load * log_load + np.append(values[5:], 0.0)[sweep])
        return np.sign(slip) * (c1 * rise - c3 * size) * factor

    start = [1.2, 25.0, 1.0, 0.0, 0.0] + [0.0] * (number - 1)
    found = scipy.optimize.least_squares(lambda v: curve(v) - adhesion, start).x
    return np.append(found[5:], 0.0)


ROWS = {"x1": x1_row, "x2": x2_row, "null": null_row}


def main():
    parser = row_parser("columns", ROWS)
    count = positive(int)
    add = parser.add_argument
    add("--runs", type=count, default=50, metavar="N", help="orders of the sweeps (default 50)")
    add("--seed", type=count, default=1, metavar="N", help="of all random numbers (default 1)")
    add("--jobs", type=count, default=os.cpu_count() or 1, metavar="N", help="processes")
    run_rows(ROWS, parser.parse_args())


if __name__ == "__main__":
    main()
