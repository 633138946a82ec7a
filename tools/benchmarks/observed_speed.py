"""Slip without a radar: error, coverage, how long it is known and what reliefs cost in force.

The trains are those of `tests/worlds/without_radar.py`, which share no code with the filter. Odd
seeds are for development, even ones for a look at the end.
"""

import argparse
import sys
import time
from pathlib import Path

import numpy as np

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(1, str(ROOT))

from _observed_runs import (  # noqa: E402  after the path
    SPEEDS,
    WAYS,
    drive,
    figures,
    force_share,
    radar_error,
)
from _observed_service import SETPOINTS, serve  # noqa: E402
from _report import Report  # noqa: E402
from _rows import positive  # noqa: E402

LARGEST_RMS, COVERAGE, LEAST_KNOWN, LEAST_FORCE = 0.002, (0.90, 0.97), 0.5, 0.98
MOST_WRONG, LEAST_TRACKING = 0.02, 0.5
SILENT = ("steady", "sweeps")
"""Ways that show no absolute speed: the slip must never be known."""
WITH_RELIEFS = ("reliefs", "sweeps-reliefs")


def line(found):
    """Figures as text; an em dash where the slip was never known."""
    if np.isnan(found["rms"]):
        return "known 0 % of the time"
    return (
        f"known {found['known']:.0%} of the time, slip error {found['rms']:.5f} rms with a stated "
        f"{found['stated']:.5f}, coverage of 95 % intervals {found['coverage']:.1%}"
    )


def judge(report, way, record, reference):
    """One way of driving beside its targets."""
    whole = figures(record)
    report.write(f"{way}: {line(whole)}")
    for speed in SPEEDS:
        report.write(f"  {speed:g} m/s: {line(figures(record, record.speed == speed))}")
    if way in SILENT:
        what = f"{way}: share of the time in which the slip is known"
        report.check(what, f"{whole['known']:.1%}", "0", met=whole["known"] == 0)
        return
    low, high = COVERAGE
    if whole["known"] > 0:
        report.at_most(f"{way}: slip error while known, rms", whole["rms"], LARGEST_RMS, ".5f")
        report.check(
            f"{way}: coverage of 95 % intervals",
            f"{whole['coverage']:.1%}",
            f"{low:.0%} to {high:.0%}",
            met=low <= whole["coverage"] <= high,
        )
    if way not in WITH_RELIEFS:
        return
    report.check(
        f"{way}: share of the time in which the slip is known",
        f"{whole['known']:.0%}",
        f"at least {LEAST_KNOWN:.0%}",
        met=whole["known"] >= LEAST_KNOWN,
    )
    share = force_share(record, reference)
    report.check(
        f"{way}: force beside the same drive with a radar and no relief",
        f"{share.mean():.1%}, the worst drive {share.min():.1%}",
        f"at least {LEAST_FORCE:.0%}",
        met=share.mean() >= LEAST_FORCE,
    )


def measure(report, options):
    first = options.after + 1 + ((options.after % 2 == 0) != (options.seeds == "odd"))
    seeds = range(first, first + 2 * options.drives, 2)
    report.write(
        f"{options.drives} {options.seeds} seeds from {first} on at each of {len(SPEEDS)} speeds, "
        f"{options.duration:g} s; error, coverage and share of all axles that pull"
    )
    if options.service:
        measure_service(report, options, seeds)
        return
    references = {}
    for way in options.only:
        began = time.perf_counter()
        record = drive(way, seeds, options.duration)
        sweeps = WAYS[way].sweeps
        if way in WITH_RELIEFS and sweeps not in references:
            references[sweeps] = drive("sweeps" if sweeps else "steady", seeds, options.duration)
        if way in SILENT:
            references[sweeps] = record
        judge(report, way, record, references.get(sweeps))
        if way == "steady":
            error = radar_error(record)
            report.write(f"radar of 0.04 m/s each 10 ms, means of 50 ms: {error:.5f} rms")
        report.write(f"({time.perf_counter() - began:.0f} s)")


def measure_service(report, options, seeds):
    """Setpoints of the service, by way of driving."""
    for way in options.only:
        began = time.perf_counter()
        found = [serve(way, seed, v, options.duration) for seed in seeds for v in SPEEDS]
        tracking, objected, wrong = (
            np.array([getattr(one, name).mean() for one in found])
            for name in ("tracking", "objected", "wrong")
        )
        report.write(
            f"{way}: {len(found)} drives, a relief is missing {objected.mean():.1%} of the time; "
            f"TRACKING and wrong in {(wrong > 0).sum()} of them, the worst {wrong.max():.1%}; "
            f"TRACKING by speed: "
            + ", ".join(f"{tracking[k :: len(SPEEDS)].mean():.0%}" for k in range(len(SPEEDS)))
            + f" ({time.perf_counter() - began:.0f} s)"
        )
        if way.startswith("radar"):
            report.write(f"  TRACKING {tracking.mean():.1%}, and wrong {wrong.mean():.2%}")
            continue
        report.at_most(f"{way}: TRACKING and wrong", wrong.mean(), MOST_WRONG, ".2%")
        if way.endswith("excursions"):
            report.check(
                f"{way}: share of the time in TRACKING",
                f"{tracking.mean():.0%}",
                f"at least {LEAST_TRACKING:.0%}",
                met=tracking.mean() >= LEAST_TRACKING,
            )


def parse_options(arguments=None):
    parser = argparse.ArgumentParser(prog="tools/bench observed-speed", description=__doc__)
    add, count = parser.add_argument, positive(int)
    add("--seeds", choices=("odd", "even"), default="odd", help="which half (default odd)")
    add("--after", type=int, default=0, metavar="N", help="seeds above N (default 0)")
    add("--drives", type=count, default=10, metavar="N", help="drives a speed (default 10)")
    add("--duration", type=positive(float), default=120.0, metavar="S", help="s (default 120)")
    about = "ways (default all; with --service those of " + ", ".join(SETPOINTS) + ")"
    add("--only", type=lambda text: text.split(","), metavar="WAY,..", help=about)
    about = "judge the setpoints of the whole service: a minute or two for each drive and way"
    add("--service", action="store_true", help=about)
    options = parser.parse_args(arguments)
    known = SETPOINTS if options.service else WAYS
    options.only = options.only or list(known)
    for way in options.only:
        if way not in known:
            parser.error(f"no way {way!r}; there are: {', '.join(known)}")
    return options


def main():
    report = Report()
    measure(report, parse_options())
    report.summarise()


if __name__ == "__main__":
    main()
