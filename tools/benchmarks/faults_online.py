"""Physical faults of a drive, played through the core: how long is it sure and wrong?

Each kind of `tests/faults` at its typical and its double size, in drives of a simulator of its own;
a fault stays, and 5 s later the rail turns wet, or it ends after 4 s. The judge reads setpoints and
the truth. Targets: TRACKING and wrong in at most 1 % of the time from 0.5 s after the error has
become big enough to matter, except what cannot be seen in principle; where there is no fault, no
reason and no FAULT is told, but for what a train that coasts does not show.
"""

import argparse
import json
import os
import sys
from collections import Counter
from dataclasses import asdict
from functools import partial
from math import inf, isfinite
from pathlib import Path

import numpy as np
from _report import Report, over_cores
from _rows import add_seed_and_jobs, positive

from tests.faults.catalogue import KINDS, find, pair_name, title
from tests.faults.play import cases, play

MOST_WRONG = 0.01
NO_FAULT = {"coasting"}
"""Reasons that accuse no instrument."""
HEAD = (
    f"{'kind':28}{'size':>10} {'fault':6}{'before':>7}{'tracks':>7}{'wrong':>7}{'late':>7}"
    f"{'long':>6}{'leaves':>7}{'back':>6}{'mu':>7}{'slip':>7}{'most':>6}  says"
)
MEANING = """
shares in % and times in s, the worst of all rounds:
  before  TRACKING in the 5 s before the fault (least)
  tracks  TRACKING from the error on (mean)
  wrong   TRACKING and wrong from the error on; late: from 0.5 s after it
  long    longest stretch of late
  leaves  time from the error until TRACKING was left; - never
  back    time from the end of the fault until TRACKING came back; - never
  mu      relative error of the largest adhesion where it was wrong, %; slip: of its slip ratio
  most    largest adhesion that was sent with TRACKING
  says    reasons that the service gave, and their shares of the time
WRONG: TRACKING and wrong for too long; ACCUSED: a reason where there was no fault (yet)
'cannot be seen': one gain of all efforts or loads; only a ceiling bounds it
"""


def played(task):
    """A case of the catalogue, as a plain object."""
    name, seed, number = task
    one = play(name, cases(name, seed)[number])
    return {
        "kind": name,
        "size": one.case.size,
        "title": title(name),
        "unit": find(name).unit,
        "stays": not isfinite(one.case.until_s),
        "seed": seed,
        "onset_s": one.case.onset_s,
        "error_s": one.error_s,
        "is_big": one.is_big,
        "largest": one.largest,
        "words": one.words,
        "early": one.early,
        **asdict(one.verdict),
    }


def row(rows):
    """A line of the table, and whether it keeps the promise."""
    first = rows[0]
    kind = find(first["kind"])
    late = max(one["wrong_late"] for one in rows)
    worst = {name: max((one[name] for one in rows), key=abs) for name in ("worst_mu", "worst_slip")}
    fault = "event" if kind.event else "stays" if first["stays"] else "ends"
    kept = late <= MOST_WRONG
    accused = any(one["early"] for one in rows) or (kind.event is not None and _is_accused(rows))
    word = "" if kept else "  cannot be seen" if kind.unseen else "  WRONG"
    word += "  ACCUSED" if accused else ""
    text = (
        f"{first['title']:28}{first['size']:>10g} {fault:6}"
        f"{100 * min(one['before'] for one in rows):7.0f}"
        f"{100 * np.mean([one['tracking'] for one in rows]):7.0f}"
        f"{100 * max(one['wrong'] for one in rows):7.1f}{100 * late:7.1f}"
        f"{max(one['longest_s'] for one in rows):6.1f}"
        f"{_time([one['leaves_s'] for one in rows]):>7}{_time([one['back_s'] for one in rows]):>6}"
        f"{100 * worst['worst_mu']:+7.0f}{100 * worst['worst_slip']:+7.0f}"
        f"{max(one['largest'] for one in rows):6.2f}  {_words(rows)}{word}"
    )
    return text, kept or kind.unseen, accused


def _is_accused(rows):
    """Whether an event was taken for a fault."""
    return any(one["faults"] or set(one["words"]) - NO_FAULT for one in rows)


def _words(rows):
    """The reason that was given most, and its share of the time; those before the onset too."""
    said = []
    for key, note in (("words", ""), ("early", " BEFORE")):
        total = Counter()
        for one in rows:
            total.update(one[key])
        said += [f"{word} {100 * share / len(rows):.0f}{note}" for word, share in total.items()]
    return ", ".join(said)


def _time(values):
    """The longest time; - where it never came."""
    longest = max(inf if value is None else value for value in values)
    return "" if np.isnan(longest) else "-" if longest == inf else f"{longest:.1f}"


def _kinds(text):
    chosen = text.split(",")
    for name in chosen:
        if name not in KINDS:
            raise argparse.ArgumentTypeError(f"no kind {name!r}; there are: {', '.join(KINDS)}")
    return chosen


def main():
    parser = argparse.ArgumentParser(prog="tools/bench faults-online", epilog=MEANING)
    parser.formatter_class = partial(argparse.RawDescriptionHelpFormatter, width=100)
    parser.add_argument(
        "--kinds", type=_kinds, default=list(KINDS), metavar="KIND,..", help="these (default all)"
    )
    parser.add_argument(
        "--rounds", type=positive(int), default=1, metavar="N", help="drives a case (default 1)"
    )
    parser.add_argument("--json", metavar="FILE", help="a line a drive; added to what is there")
    parser.add_argument(
        "--pairs", type=int, default=0, metavar="N", help="so many drawn pairs too (default 0)"
    )
    add_seed_and_jobs(parser)
    options = parser.parse_args()
    names = [*options.kinds, *map(pair_name, range(options.seed, options.seed + options.pairs))]
    tasks = [
        (name, options.seed + round_, number)
        for round_ in range(options.rounds)
        for name in names
        for number in range(len(cases(name, options.seed)))
    ]
    results = over_cores(played, tasks, min(options.jobs, os.cpu_count() or 1), "drives")
    if options.json:
        with Path(options.json).open("a", encoding="utf-8") as file:
            file.writelines(json.dumps(one) + "\n" for one in results)
    report = Report()
    print(HEAD)
    broken = accused = 0
    for name in names:
        for number in range(len(cases(name, options.seed))):
            rows = [
                result
                for task, result in zip(tasks, results, strict=True)
                if task[0] == name and task[2] == number
            ]
            text, kept, is_accused = row(rows)
            print(text)
            broken += not kept
            accused += is_accused
    sys.stdout.write(MEANING)
    report.check("cases TRACKING and wrong for too long", str(broken), "0", met=broken == 0)
    report.check(
        "cases with a fault reported and none present", str(accused), "0", met=accused == 0
    )
    report.summarise()


if __name__ == "__main__":
    main()
