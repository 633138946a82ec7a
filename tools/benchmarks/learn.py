"""A service that corrects itself: TRACKING with and without the model that it learns from its own
readings and applies, and what it learns where nothing is wrong, or what no library has."""

import argparse
import json
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
# The folder of this file is on the path; the worlds and the hunt's tables need theirs.
sys.path[1:1] = [str(ROOT), str(ROOT / "tools" / "hunting")]

from _learn_drive import JUDGED_S, SIZES, SOUND, run_drive  # noqa: E402  after the path
from _report import aside  # noqa: E402
from _rows import positive  # noqa: E402
from _truth_figures import figures_of  # noqa: E402
from outside import same_as  # noqa: E402
from tables import Target, markdown_table, target_table  # noqa: E402

from tests.worlds.outside.kinds import OPEN, SECOND  # noqa: E402
from tools.processes import results_as_done  # noqa: E402

LEAST_TRACKING, MOST_WRONG = 0.85, 0.01
"""Share of the time with TRACKING from 600 s on, and with TRACKING and a wrong setpoint."""
MOST_FALSE = 0.01
"""Share of the drives outside the library in which a false cause may be applied."""
OUTSIDE = (*OPEN, *SECOND)
"""Kinds of drives in which something acts that no library has."""
HEAD = (
    "hidden", "seed", "TRACKING % (of pulling)", "and wrong %", "proposed s", "confirmed s",
    "applied", "and wrong %", "true model", "and wrong %", "found",
)  # fmt: skip


def shares(record, way):
    """TRACKING as a share of the time and of that in which the drive pulls, and TRACKING with a
    wrong setpoint as a share of the time; None where unknown."""
    if way not in record:
        return None, None, None
    figures = figures_of(record[way]["figures"])
    wrong = max(figures.wrong_mu_max, figures.wrong_lambda_m)
    rows = max(figures.rows, 1)
    return figures.tracking / rows, record[way]["tracking_of_pulls"], wrong / rows


def percent(share):
    return "-" if share is None else f"{100 * share:.1f}"


def seconds(value):
    return "-" if value is None else f"{value:.0f}"


def row(record):
    """Cells of a drive."""
    if "error" in record:
        return (record["kind"], str(record["seed"]), record["error"], *[""] * (len(HEAD) - 3))
    cells = {}
    for way in ("plain", "applied", "true"):
        tracking, of_pulls, wrong = map(percent, shares(record, way))
        cells[way] = (f"{tracking} ({of_pulls})", wrong)
    times = (seconds(record["proposed_s"]), seconds(record["confirmed_s"]))
    found = record["found"] or record["outcome"]
    return (
        record["kind"], str(record["seed"]), *cells["plain"], *times, *cells["applied"],
        *cells["true"], found,
    )  # fmt: skip


def is_false(record):
    """Whether a model was confirmed that holds what does not act in a drive outside the library."""
    same = same_as({"kind": record["kind"], "truth": {"effects": [{"effect": record["kind"]}]}})
    # A form of an effect stands behind its name.
    effects = ([name.split()[0] for name in names] for names in record["causes"])
    return any(not same.issuperset(names) for names in effects)


def targets(records):
    """Every target beside its figure."""
    found = []
    hiding = [record for record in records if record["kind"] in SIZES and "error" not in record]
    for kind in dict.fromkeys(record["kind"] for record in hiding):
        own = [shares(record, "applied") for record in hiding if record["kind"] == kind]
        of = f"{kind}, from {JUDGED_S:g} s on"
        # A drive that failed has none of it.
        for place, what in ((0, "TRACKING"), (1, "TRACKING while the drive pulls")):
            least = min(one[place] or 0.0 for one in own)
            met = "met" if least >= LEAST_TRACKING else "FAILED"
            figure = f"{percent(least)} %"
            found.append(Target(f"{what}, {of}", figure, f"at least {LEAST_TRACKING:.0%}", met))
        most = max(wrong or 0.0 for *_, wrong in own)
        met = "met" if most <= MOST_WRONG else "FAILED"
        figure = f"{percent(most)} %"
        found.append(Target(f"and wrong, {of}", figure, f"at most {MOST_WRONG:.0%}", met))
    sound = [record for record in records if record["kind"] == SOUND and "error" not in record]
    if sound:
        hours = sum(record["duration_s"] for record in sound) / 3600
        confirmed = sum(record["confirmed_s"] is not None for record in sound)
        proposed = sum(record["proposals"] for record in sound)
        figure = f"{confirmed} ({proposed} proposed)"
        met = "FAILED" if confirmed else "met"
        found.append(Target(f"confirmed in {hours:.1f} h of sound drives", figure, "0", met))
    outside = [record for record in records if record["kind"] in OUTSIDE and "error" not in record]
    if outside:
        count = sum(map(is_false, outside))
        figure, goal = f"{count} of {len(outside)} drives", f"at most {MOST_FALSE:.0%}"
        met = "met" if count <= MOST_FALSE * len(outside) else "FAILED"
        found.append(Target("a false cause applied, outside the library", figure, goal, met))
    failed = sum("error" in record for record in records)
    found.append(Target("drives that failed", str(failed), "0", "FAILED" if failed else "met"))
    return found


def parse_options(arguments=None):
    parser = argparse.ArgumentParser(prog="tools/bench learn", description=__doc__)
    add = parser.add_argument
    add("--only", nargs="+", default=[*SIZES], choices=[*SIZES, SOUND], metavar="KIND",
        help=f"kinds of drives: {', '.join(SIZES)}")  # fmt: skip
    add("--seeds", type=positive(int), default=1, metavar="N", help="drives of each (default 1)")
    add("--seed", type=positive(int), default=1, metavar="N", help="first seed (default 1)")
    add("--sound", type=int, default=2, metavar="N", help="drives without anything (default 2)")
    add("--outside", type=int, default=0, metavar="N",
        help="drives in which something acts that no library has (default 0)")  # fmt: skip
    add("--seconds", type=positive(float), default=900.0, metavar="S",
        help="duration of a drive (default 900)")  # fmt: skip
    add("--jobs", type=positive(int), default=2, metavar="N", help="drives at a time (default 2)")
    add("--no-true", dest="with_true", action="store_false", help="leave the true model out")
    add("--results", type=Path, metavar="FILE", help="also append each drive as a line of JSON")
    options = parser.parse_args(arguments)
    if options.seconds <= JUDGED_S:
        parser.error(f"--seconds: setpoints are judged from {JUDGED_S:g} s on")
    return options


def main(arguments=None):
    options = parse_options(arguments)
    seeds = range(options.seed, options.seed + options.seeds)
    kinds = [kind for kind in options.only if kind != SOUND]
    tasks = [(kind, seed, options.seconds, options.with_true) for seed in seeds for kind in kinds]
    tasks += [(SOUND, options.seed + n, options.seconds, False) for n in range(options.sound)]
    others = (OUTSIDE[n % len(OUTSIDE)] for n in range(options.outside))
    tasks += [(kind, options.seed + n, options.seconds, False) for n, kind in enumerate(others)]
    records = []
    for number, (_, record) in enumerate(results_as_done(run_drive, tasks, options.jobs), start=1):
        records.append(record)
        said = record.get("error") or record["found"] or record["outcome"]
        aside(f"{number}/{len(tasks)} {record['kind']}: {said} ({record['seconds']} s)")
        if options.results:
            with options.results.open("a") as file:
                file.write(json.dumps(record) + "\n")
    records.sort(key=lambda record: tasks.index(
        next(task for task in tasks if task[:2] == (record["kind"], record["seed"]))
    ))  # fmt: skip
    found = targets(records)
    print(f"{markdown_table(HEAD, list(map(row, records)))}\n\n{target_table(found, 'figure')}")
    return 1 if any(target.verdict == "FAILED" for target in found) else 0


if __name__ == "__main__":
    sys.exit(main())
