"""A benchmark as rows that can be run alone: its options, and the run with its targets counted."""

import argparse
import os
import time
from functools import partial

from _report import Report


def row_parser(name, rows, more=""):
    """Parser of a benchmark's command line, with --only."""
    described = "; ".join(f"{row}: {measure.__doc__}" for row, measure in rows.items())
    parser = argparse.ArgumentParser(prog=f"tools/bench {name}", epilog=f"rows: {described}{more}")
    parser.add_argument(
        "--only",
        type=partial(_chosen, rows),
        default=list(rows),
        metavar="ROW,..",
        help="these rows (default all)",
    )
    return parser


def _chosen(rows, text):
    chosen = text.split(",")
    for name in chosen:
        if name not in rows:
            raise argparse.ArgumentTypeError(f"no row {name!r}; there are: {', '.join(rows)}")
    return chosen


def random_parser(name, description):
    """Parser of a benchmark that draws at random, over several processes: --seed and --jobs."""
    parser = argparse.ArgumentParser(prog=f"tools/bench {name}", description=description)
    add_seed_and_jobs(parser)
    return parser


def add_seed_and_jobs(parser, jobs="processes (default all)"):
    add, count = parser.add_argument, positive(int)
    add("--seed", type=count, default=1, metavar="N", help="of all random numbers (default 1)")
    add("--jobs", type=count, default=os.cpu_count() or 1, metavar="N", help=jobs)


def positive(kind):
    """Type of an option that is a positive number."""

    def convert(text):
        value = kind(text)
        if not 0 < value < float("inf"):
            raise argparse.ArgumentTypeError(f"{text} is not a positive number")
        return value

    convert.__name__ = kind.__name__
    return convert


def run_rows(rows, options, *more):
    """Each row that was chosen, and the targets at the end."""
    report = Report()
    for name in options.only:
        print(f"\n{name}: {rows[name].__doc__}", flush=True)
        began = time.perf_counter()
        rows[name](report, options, *more)
        report.write(f"({time.perf_counter() - began:.0f} s)")
    report.summarise()
