"""Formulas for mechanisms that the library does not have, beside pysindy on the same tables.

A mechanism is a law of a drawn kind in a column of a table, with its size and its constants drawn
(`tests/worlds/mechanisms.py`). `diagnose` reads the table. pysindy gets more than a user has: the
adhesion over the true curve, and a library of these kinds alone, with their constants on a grid on
which the true exponents lie. Its number of terms is chosen by cross-validation.
"""

import json
import subprocess
import sys
from contextlib import redirect_stderr, redirect_stdout
from io import StringIO
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import NamedTuple

import numpy as np
from _peer_environment import peer_python
from _report import Report, aside, over_cores
from _rows import positive, random_parser

from tests.worlds.mechanisms import KINDS, follow, make_mechanism, write_mechanism

HERE = Path(__file__).resolve().parent
NOTHING = "nothing"
"""Kind of a table without a mechanism: whoever names nothing is right."""
LEAST_RATIO = 3.0
"""Size of a dependence over its error from which its form counts."""
LAGS_S = (2.0, 4.0, 8.0, 12.0)
"""Time constants of the lags that pysindy may use, s."""
LEAST_CURVE = 0.05
"""Adhesion of the curve below which a row says nothing about a factor."""


class Answer(NamedTuple):
    """What `diagnose` said of a table.

    Attributes:
        kind: Kind of the law in it.
        ratio: Size of the dependence over the error with which it can be measured at best.
        right: Whether a formula of that kind is named.
        sure: Whether something is named that is not of that kind, without another form as good.
        found: What is named, as text.

    """

    kind: str
    ratio: float
    right: bool
    sure: bool
    found: str


def answer(task):
    """What `diagnose` says of a mechanism, whose residual table is left for pysindy."""
    from adhesion_can.cli.main import main

    seed, kind, folder = task
    nothing = kind == NOTHING
    mechanism = make_mechanism(seed, KINDS[0] if nothing else kind, size=0.0 if nothing else None)
    columns, strong = mechanism.columns, np.abs(mechanism.curve) > LEAST_CURVE
    np.savez(
        Path(folder) / f"{seed}.npz",
        kind=kind,
        lagging=[follow(columns["wind"], time_s) for time_s in LAGS_S],
        wind=columns["wind"],
        salt=columns["salt"],
        factor=np.where(strong, columns["adhesion"], 0.0) / np.where(strong, mechanism.curve, 1.0),
        strong=strong,
    )
    with TemporaryDirectory() as own, redirect_stdout(StringIO()), redirect_stderr(StringIO()):
        table, out = write_mechanism(mechanism, Path(own) / "t.csv"), Path(own) / "d.json"
        main(["diagnose", str(table), "--json", str(out)])
        causes = json.loads(out.read_text())["causes"]
    right = any(c["effect"] == "formula" and kind in c["title"] for c in causes)
    right = not causes if nothing else right
    about = [c for c in causes if c["effect"] == "formula" or c["effect"].startswith("channel:")]
    sure = not right and any(not c["other_formulas"] for c in about)
    names = " + ".join(c["form"] or c["effect"] for c in causes)
    return Answer(kind, mechanism.ratio, right, sure, names or "nothing")


def by_pysindy(folder, report):
    """Kinds of the terms that pysindy leaves in each table, by its seed; None without pysindy."""
    python = peer_python("pysindy", ("pysindy",), report)
    if python is None:
        return None
    words = [str(python), "-E", "-s", str(HERE / "_sindy.py"), str(folder)]
    done = subprocess.run(words, capture_output=True, text=True, check=False)
    if done.returncode:
        report.write(f"pysindy failed: {(done.stderr or done.stdout).strip().splitlines()[-1:]}")
        return None
    return json.loads(done.stdout)


def main():
    parser = random_parser("formulas", __doc__.splitlines()[0])
    parser.add_argument("--runs", type=positive(int), default=100, metavar="N", help="mechanisms")
    options, report = parser.parse_args(), Report()
    with TemporaryDirectory() as folder:
        seeds = [1000 * options.seed + number for number in range(options.runs)]
        tasks = [(seed, KINDS[n % len(KINDS)], folder) for n, seed in enumerate(seeds)]
        nulls = [1000 * options.seed + 900 + number for number in range(options.runs // 5)]
        tasks += [(seed, NOTHING, folder) for seed in nulls]
        seeds += nulls
        answers = over_cores(answer, tasks, options.jobs, "formulas")
        aside("pysindy on the same tables")
        theirs = by_pysindy(folder, report)
    counted = [one for one in answers if one.ratio > LEAST_RATIO]
    peers = {} if theirs is None else _judged(theirs["kinds"], seeds, answers)
    ways = [f"pysindy by {way}" for way in peers]
    heads = ["kind", "mechanisms", "right", "sure of another"]
    heads += [f"{way}: {what}" for way in ways for what in ("right", "another")]
    print(f"| {' | '.join(heads)} |")
    print(f"|{'---|' * len(heads)}")
    for kind in (*KINDS, NOTHING):
        mine = [one.kind == kind for one in answers]
        own = [one for one, counts in zip(answers, mine, strict=True) if counts]
        cells = [kind, len(own), sum(one.right for one in own), sum(one.sure for one in own)]
        for right, wrong in peers.values():
            cells += [int(right[mine].sum()), int(wrong[mine].sum())]
        print(f"| {' | '.join(map(str, cells))} |")
    for one in answers:
        if one.sure:
            what = f"{one.kind}, {one.ratio:.0f} times its error: {one.found}"
            report.write(f"sure of another: {what}")
    share = sum(one.right for one in counted) / max(len(counted), 1)
    what = f"form right in {len(counted)} mechanisms above {LEAST_RATIO:g} times their error"
    report.check(what, f"{100 * share:.0f} %", "60 %", met=share >= 0.6)
    sure = sum(one.sure for one in answers if one.kind != NOTHING) / options.runs
    report.check("sure of another form", f"{100 * sure:.0f} %", "at most 3 %", met=sure <= 0.03)
    for way, (right, _) in peers.items():
        other = float(right[: options.runs].mean())
        ratio = share / other if other else np.inf
        what = f"share of right forms over pysindy {theirs['version']}'s by {way}"
        report.check(what, f"{ratio:.2f}", "2", met=ratio >= 2.0)
    report.summarise()
    sys.exit(0)


def _judged(kinds, seeds, answers):
    """Whether pysindy's terms are of the right kind alone, and whether of another, by optimiser."""
    found = {}
    for way, by_seed in kinds.items():
        pairs = [(by_seed[str(s)], one.kind) for s, one in zip(seeds, answers, strict=True)]
        right = np.array([terms == ([] if kind == NOTHING else [kind]) for terms, kind in pairs])
        found[way] = right, np.array([bool(terms) for terms, _ in pairs]) & ~right
    return found


if __name__ == "__main__":
    main()
