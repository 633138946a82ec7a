"""Setpoints beside the truth: drives that hide something, the service with and without the model
that `diagnose` wrote from them. A run that was stopped goes on where it was."""

import argparse
import secrets
import sys
from collections import Counter
from pathlib import Path

import numpy as np

ROOT = Path(__file__).resolve().parents[2]
# The folder of this file is on the path; the worlds and the hunt's bookkeeping need theirs.
sys.path[1:1] = [str(ROOT), str(ROOT / "tools" / "hunting")]

from _report import aside  # noqa: E402  after the path
from _rows import positive  # noqa: E402
from _truth_drive import run_drive  # noqa: E402
from _truth_figures import (  # noqa: E402
    LEAST_REACHED,
    OF_ALL,
    OF_ALL_WITH_MODEL,
    OF_EACH,
    figures_of,
    pooled,
)
from plan import Results, code_version  # noqa: E402
from tables import Target, markdown_table, target_table  # noqa: E402

from tests.worlds import CONTACT_EFFECTS, KINDS, PAIRS, SINGLES  # noqa: E402
from tools.processes import results_as_done  # noqa: E402

NULLS = ("null:0", "null:surfaces")
CONTACTS = ("contact:extended", "contact:fastsim", "contact:polach-dry", "contact:polach-wet")
"""Contacts with a peak: beside a plateau λ_m means nothing."""
OUTSIDE = ("out:hump", "out:periodic")
PAIRS_A_ROUND, CONTACT_EFFECTS_A_ROUND = 3, 2
GROUPS = ("null", "single", "contact", "out", "pair")
WITH_PEAK = tuple(k for k in CONTACT_EFFECTS if k.partition("+")[0] in CONTACTS)
USED = {*NULLS, *SINGLES, *CONTACTS, *WITH_PEAK, *OUTSIDE, *PAIRS}
VALUES = ("mu_max", "lambda_m")
WAYS = ("plain", "model")


def group_of(kind):
    head = kind.partition(":")[0]
    return head if head in GROUPS else "single"


def build_tasks(seed, rounds, only, duration_s):
    """(kind, seed, duration) of every drive, round by round; the same however many rounds."""
    tasks = []
    for number in range(rounds):
        rng = np.random.default_rng([seed, number])
        pairs = [PAIRS[k] for k in rng.choice(len(PAIRS), PAIRS_A_ROUND, replace=False)]
        chosen = rng.choice(len(WITH_PEAK), CONTACT_EFFECTS_A_ROUND, replace=False)
        everything = [
            *NULLS,
            *SINGLES,
            *CONTACTS,
            *OUTSIDE,
            *pairs,
            *(WITH_PEAK[k] for k in chosen),
        ]
        kinds = [k for k in everything if not only or k in only or group_of(k) in only]
        kinds += [k for k in only if k in USED and k not in kinds]
        tasks += [(kind, seed + number, duration_s) for kind in kinds]
    return tasks


def row_name(kind):
    """Row of a kind in the table: pairs and contacts with an effect have one each together."""
    if kind.startswith("pair:"):
        return "two effects"
    return "contact and effect" if "+" in kind else kind


def targets(records):
    """Every target beside its figure."""
    rows = {}
    for record in records:
        rows.setdefault(row_name(record["kind"]), []).append(record)
    found = []
    for value, symbol in (("mu_max", "μ_max"), ("lambda_m", "λ_m")):
        worst = max(
            ((figures(own, "plain").wrong(value), name) for name, own in rows.items()),
            default=(np.nan, "-"),
            key=lambda one: np.nan_to_num(one[0], nan=-1.0),
        )
        share_target(
            found, f"TRACKING with a wrong {symbol}, worst kind ({worst[1]})", worst[0], OF_EACH
        )
        for way, most in (("plain", OF_ALL), ("model", OF_ALL_WITH_MODEL)):
            what = f"TRACKING with a wrong {symbol}, mean of all kinds, {way}"
            share_target(found, what, mean_of_kinds(rows, way, value), most)
        more = [
            name
            for name, own in rows.items()
            if figures(own, "model").wrong(value) > figures(own, "plain").wrong(value)
        ]
        met = "no data" if not rows else "FAILED" if more else "met"
        found.append(
            Target(f"more wrong {symbol} with the model", ", ".join(more) or "none", "none", met)
        )
    for way in WAYS:
        least = min(
            ((figures(own, way).reached_at(0.05), name) for name, own in rows.items()),
            default=(np.nan, "-"),
            key=lambda one: np.nan_to_num(one[0], nan=2.0),
        )
        verdict = (
            "no data" if np.isnan(least[0]) else "met" if least[0] >= LEAST_REACHED else "FAILED"
        )
        what = f"adhesion reached at λ_m, 5 % quantile, worst kind ({least[1]}), {way}"
        found.append(Target(what, percent(least[0], 1), f"at least {LEAST_REACHED:.0%}", verdict))
    failed = sum("error" in record for record in records)
    verdict = "FAILED" if failed else "met"
    found.append(Target("drives that failed", str(failed), "0", verdict))
    return found


def share_target(found, what, value, most):
    verdict = "no data" if np.isnan(value) else "met" if value <= most else "FAILED"
    found.append(Target(what, percent(value, 1), f"at most {most:.0%}", verdict))


def mean_of_kinds(rows, way, value):
    shares = [figures(own, way).wrong(value) for own in rows.values()]
    known = [share for share in shares if not np.isnan(share)]
    return float(np.mean(known)) if known else np.nan


def figures(records, way):
    """Figures of some records as of one drive."""
    return pooled(figures_of(record[way]) for record in records if "error" not in record)


def kinds_table(records):
    """A row for each kind: 'plain, with the model' in each cell."""
    head = ("hidden", "drives", "TRACKING %", "wrong μ_max %", "wrong λ_m %", "rms μ_max %",
            "rms λ_m %", "reached, 5 % quantile", "reached, median", "named")  # fmt: skip
    names = dict.fromkeys(row_name(record["kind"]) for record in records)
    lines = []
    for name in names:
        own = [record for record in records if row_name(record["kind"]) == name]
        both = [figures(own, way) for way in WAYS]
        answers = Counter(" + ".join(r.get("causes", ["failed"])) or "nothing" for r in own)
        lines.append(
            (
                name,
                str(len(own)),
                pair(both, lambda f: f.tracking_share()),
                *(pair(both, lambda f, v=v: f.wrong(v)) for v in VALUES),
                *(pair(both, lambda f, v=v: f.rms(v), 1) for v in VALUES),
                pair(both, lambda f: f.reached_at(0.05), 1),
                pair(both, lambda f: f.reached_at(0.5), 1),
                ", ".join(f"{answer} {n}" for answer, n in answers.most_common(3)),
            )
        )
    return markdown_table(head, lines)


def pair(both, figure, digits=0):
    return ", ".join(percent(figure(f), digits).removesuffix(" %") for f in both)


def percent(value, digits):
    return "-" if np.isnan(value) else f"{100 * value:.{digits}f} %"


def report(records, seed, version):
    """The whole of it as Markdown."""
    found = targets(records)
    head = (
        f"{len(records)} drives; first seed {seed}, code {version}. Cells: plain, with the model "
        f"that diagnose wrote from the drive. {sum(t.verdict == 'met' for t in found)} of "
        f"{len(found)} targets met."
    )
    return "\n\n".join((head, kinds_table(records), target_table(found, "figure")))


def parse_options(arguments=None):
    parser = argparse.ArgumentParser(prog="tools/bench truth", description=__doc__)
    add = parser.add_argument
    add("--rounds", type=positive(int), default=1, metavar="N", help="rounds of drives (default 1)")
    add("--only", nargs="+", default=[], metavar="KIND",
        help=f"kinds of worlds, or {', '.join(GROUPS)}")  # fmt: skip
    add("--jobs", type=positive(int), default=2, metavar="N", help="drives at a time (default 2)")
    add("--seed", type=positive(int), metavar="N",
        help="of the first round (default: fresh, or that of the run to continue)")  # fmt: skip
    add("--seconds", type=positive(float), default=240.0, metavar="S",
        help="duration of a drive (default 240)")  # fmt: skip
    add("--results", type=Path, default=ROOT / "build" / "truth.jsonl", metavar="FILE",
        help="JSON lines; a stopped run continues there (default build/truth.jsonl)")  # fmt: skip
    add("--table", type=Path, metavar="FILE.md", help="table and targets as Markdown")
    add("--print", dest="only_print", action="store_true", help="no drives: print the results")
    options = parser.parse_args(arguments)
    for name in options.only:
        if name not in USED and name not in GROUPS:
            why = "without a peak" if name in KINDS else "unknown"
            there = ", ".join((*GROUPS, *NULLS, *SINGLES, *CONTACTS, *OUTSIDE))
            parser.error(f"no kind {name!r} here ({why}): {there}, pairs, contacts with an effect")
    return options


def tasks_left(tasks, records):
    """Tasks that are not done yet; a drive that failed is tried again."""
    done = {(r["kind"], r["seed"], r["duration_s"]) for r in records if "error" not in r}
    return [task for task in tasks if task not in done]


def drive_all(results, tasks, jobs):
    """Do what is not done yet; each record is written as it comes."""
    left = tasks_left(tasks, results.records())
    aside(f"{len(left)} of {len(tasks)} drives to go, into {results.path}")
    if not left:
        return
    for number, (_, record) in enumerate(results_as_done(run_drive, left, jobs), start=1):
        results.add(record)
        said = record.get("error") or " + ".join(record["causes"]) or "nothing"
        aside(f"{number}/{len(left)} {record['kind']}: {said} ({record['seconds']} s)")


def main(arguments=None):
    options = parse_options(arguments)
    version = code_version()
    results = Results(options.results, version)
    seed = options.seed if options.seed is not None else results.seed
    seed = secrets.randbelow(2**31) if seed is None else seed
    if not options.only_print:
        results.begin(seed)
        drive_all(
            results, build_tasks(seed, options.rounds, options.only, options.seconds), options.jobs
        )
        if code_version() != version:
            aside("the code changed while this ran: the figures are of neither version")
    records = [r for r in results.records() if r["duration_s"] == options.seconds]
    text = report(records, seed, version)
    print(text)
    if options.table:
        options.table.write_text(text + "\n")
    return 1 if any(t.verdict == "FAILED" for t in targets(records)) else 0


if __name__ == "__main__":
    sys.exit(main())
