"""A benchmark as rows that can be run alone: its options, and the run with its targets counted."""

import argparse
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
    print(f"\n{report.met} of {report.met + len(report.missed)} targets met")
    for what in report.missed:
        print(f"  MISSED: {what}")
