"""The tracker: how exact, how soon, how seldom wrong, how fast; each figure beside its target."""

import argparse
import os
import time

from _accuracy import accuracy, slow
from _alarms import alarm_row, delay_row
from _cost import memory_row, time_row
from _doubt import excitation_row, variables_row
from _report import Report

ROWS = {
    "accuracy": accuracy,
    "delay": delay_row,
    "alarms": alarm_row,
    "time": time_row,
    "memory": memory_row,
    "variables": variables_row,
    "slow": slow,
    "excitation": excitation_row,
}


def names(text):
    chosen = text.split(",")
    for name in chosen:
        if name not in ROWS:
            raise argparse.ArgumentTypeError(f"no row {name!r}; there are: {', '.join(ROWS)}")
    return chosen


def positive(kind):
    def convert(text):
        value = kind(text)
        if not 0 < value < float("inf"):
            raise argparse.ArgumentTypeError(f"{text} is not a positive number")
        return value

    convert.__name__ = kind.__name__
    return convert


def parsed():
    rows = "; ".join(f"{name}: {row.__doc__}" for name, row in ROWS.items())
    parser = argparse.ArgumentParser(prog="tools/bench identification", epilog=f"rows: {rows}")
    count, hours = positive(int), positive(float)
    add = parser.add_argument
    add("--only", type=names, default=list(ROWS), metavar="ROW,..", help="these rows (default all)")
    add("--runs", type=count, default=50, metavar="N",
        help="Monte-Carlo runs of accuracy and variables; four times as many for delay and "
        "excitation, a twelfth for slow (default 50)")  # fmt: skip
    add("--hours", type=hours, default=30.0, metavar="H",
        help="of 100 Hz data without a change, for alarms (default 30)")  # fmt: skip
    add("--soak-updates", type=count, default=200_000, metavar="N",
        help="over which the day of memory is spread (default 200000)")  # fmt: skip
    add("--seed", type=count, default=1, metavar="N", help="of all random numbers (default 1)")
    add("--jobs", type=count, default=os.cpu_count() or 1, metavar="N",
        help="processes; time and memory take one (default all)")  # fmt: skip
    return parser.parse_args()


def main():
    options = parsed()
    report = Report()
    for name in options.only:
        print(f"\n{name}: {ROWS[name].__doc__}", flush=True)
        began = time.perf_counter()
        ROWS[name](report, options)
        report.tell(f"({time.perf_counter() - began:.0f} s)")
    print(f"\n{report.met} of {report.met + len(report.missed)} targets met")
    for what in report.missed:
        print(f"  MISSED: {what}")


if __name__ == "__main__":
    main()
