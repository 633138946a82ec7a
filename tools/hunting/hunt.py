"""The hunt: drives with something hidden, `diagnose` on each, the figures beside their targets."""

import argparse
import secrets
import sys
import time
from collections.abc import Sequence
from functools import partial
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
# The folder of this file is on the path; the worlds need the project's.
sys.path.insert(1, str(ROOT))

from judge import JudgedRecord, judge_record  # noqa: E402  after the path
from plan import Results, Task, build_tasks, check_kinds, code_version  # noqa: E402
from tables import confusion, target_table, targets  # noqa: E402
from work import DiagnosisOptions, work  # noqa: E402

from tools.processes import results_as_done  # noqa: E402


def parse_options(arguments: Sequence[str] | None = None) -> argparse.Namespace:
    """Options of the command line."""
    parser = argparse.ArgumentParser(prog="tools/hunt", description=__doc__)
    add = parser.add_argument
    add("--rounds", type=int, default=20, metavar="N", help="rounds of drives (default 20)")
    add("--only", nargs="+", default=[], metavar="KIND",
        help="effects, pair:A+B, null:.., out:.., contact:NAME, contact:NAME+A, points:NAME, or "
        "single, law, pair, null, out, contact, contact+, points; worlds by others: outside, "
        "outside:open, outside:aside, outside:second, mech, beside, memory, car; forms of drives: "
        "short, table, drives")  # fmt: skip
    add("--jobs", type=int, default=2, metavar="N", help="drives at a time (default 2)")
    add("--seed", type=int, metavar="N",
        help="of the first round (default: fresh, or that of the hunt to continue)")  # fmt: skip
    add("--results", type=Path, default=ROOT / "build" / "hunt.jsonl", metavar="FILE",
        help="JSON lines; a killed hunt continues there (default build/hunt.jsonl)")  # fmt: skip
    add("--table", type=Path, metavar="FILE.md", help="matrix and targets as Markdown")
    add("--print", dest="only_print", action="store_true", help="no drives: print the results")
    add("--holdout", action="store_true", help="hold out a fresh drive of the same world")
    add("--keep", type=Path, metavar="DIR", help="leave drives and diagnoses there")
    add(
        "--entry", default=DiagnosisOptions.entry, metavar="MODULE:FUNCTION", help=argparse.SUPPRESS
    )
    options = parser.parse_args(arguments)
    try:
        check_kinds(options.only)
    except ValueError as error:
        parser.error(str(error))
    if options.rounds < 1 or options.jobs < 1 or (options.seed is not None and options.seed < 0):
        parser.error("--rounds and --jobs must be at least 1, --seed not negative")
    return options


def main(arguments: Sequence[str] | None = None) -> int:
    """Hunt and print; 0: every target met or not excluded, 1: one failed."""
    options = parse_options(arguments)
    version = code_version()
    results = Results(options.results, version)
    seed = options.seed if options.seed is not None else results.seed
    if seed is None:
        seed = secrets.randbelow(2**31)
    if not options.only_print:
        results.begin(seed)
        if options.keep:
            options.keep.mkdir(parents=True, exist_ok=True)
        diagnosis_options = DiagnosisOptions(options.entry, options.holdout, keep=options.keep)
        hunt(
            results,
            build_tasks(seed, options.rounds, options.only),
            diagnosis_options,
            options.jobs,
        )
        if code_version() != version:
            aside("the code changed while the hunt ran: the figures are of neither version")
    rows = [
        judge_record(record) for record in results.records() if record["holdout"] == options.holdout
    ]
    text = report(rows, seed, version)
    print(text)
    if options.table:
        options.table.write_text(text + "\n")
    return 1 if any(t.verdict == "FAILED" for t in targets(rows)) else 0


def hunt(
    results: Results, tasks: Sequence[Task], diagnosis_options: DiagnosisOptions, jobs: int
) -> None:
    """Do what is not done yet, each drive in processes of its own; results come as they are."""
    done = {
        (r["kind"], r["seed"])
        for r in results.records()
        if r["holdout"] == diagnosis_options.holdout
    }
    open_tasks = [task for task in tasks if (task.kind, task.seed) not in done]
    aside(f"{len(open_tasks)} of {len(tasks)} drives to go, into {results.path}")
    if not open_tasks:
        return
    began = time.perf_counter()
    worker = partial(work, diagnosis_options=diagnosis_options)
    done_work = results_as_done(worker, open_tasks, jobs)
    for number, (_, record) in enumerate(done_work, start=1):
        results.add(record)
        row = judge_record(record)
        spent = time.perf_counter() - began
        left = spent / number * (len(open_tasks) - number)
        aside(
            f"{number}/{len(open_tasks)} {row.kind}: {row.outcome} {' + '.join(row.answer)} "
            f"({row.seconds:.1f} s; {left / 60:.0f} min to go)"
        )


def report(rows: Sequence[JudgedRecord], seed: int, version: str) -> str:
    """The whole of what a hunt has to say, as Markdown."""
    found = targets(rows)
    counts = {v: sum(t.verdict == v for t in found) for v in ("met", "not met", "FAILED")}
    head = (
        f"{len(rows)} drives; first seed {seed}, code {version}. Of {len(found)} targets "
        f"{counts['met']} met, {counts['not met']} not met but not excluded by the bound, "
        f"{counts['FAILED']} failed."
    )
    return "\n\n".join((head, target_table(found), confusion(rows)))


def aside(text: str) -> None:
    """A line about the progress."""
    print(text, file=sys.stderr, flush=True)


if __name__ == "__main__":
    sys.exit(main())
