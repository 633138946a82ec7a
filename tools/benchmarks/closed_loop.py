"""The reference creep controller beside others on the same rails, by the frames of one bus.

Locomotive, service and controller exchange frames as on a bench. Utilisation is the mean force over
the mean of the smaller of the available adhesion and the motors' limit, from the start on. A
run-away is a creep beyond three times that of the peak for more than half a second.

Slip energies are compared at equal utilisation, case by case: ours and each rival are driven at two
settings, and what counts is the least energy of each, interpolated between its settings, at the
largest utilisation that both reach. So each is free to choose its setting for the case. Where one
pulls more at all its settings than the other at its best, there is nothing to compare.
"""

import json
import sys
from pathlib import Path

import numpy as np
from _pulling_cases import CASES
from _pulling_goals import judge
from _pulling_runs import MAKERS, OUR_OTHERS, OURS, Task, pull
from _report import Report, over_cores
from _rival_controllers import RIVALS
from _rows import random_parser

from adhesion_can.reporting.page import require_extra, write_page

OTHERS = {rival.name: rival.OTHERS for rival in RIVALS} | {OURS: OUR_OTHERS}


def main():
    parser = random_parser("closed-loop", __doc__.splitlines()[0])
    parser.add_argument("--only", metavar="TEXT", help="cases whose names contain this text")
    parser.add_argument("--json", type=Path, metavar="FILE", help="write figures, goals and traces")
    parser.add_argument("--html", type=Path, metavar="FILE", help="write a page with the traces")
    parser.add_argument(
        "--rivals", type=Path, metavar="FILE",
        help="take the rivals from an earlier --json of the same seed",
    )  # fmt: skip
    parser.add_argument(
        "--usual", action="store_true", help="each controller at its usual setting alone"
    )
    options = parser.parse_args()
    numbers = [n for n, case in enumerate(CASES) if (options.only or "") in case.name]
    if not numbers:
        parser.error(f"no case has {options.only!r} in its name")
    if options.html:
        require_extra("--html")
    tasks, known = _tasks(numbers, options.seed, usual=options.usual), {}
    if options.rivals:
        rows = json.loads(options.rivals.read_text(encoding="utf-8"))["rows"]
        known = {_key(row): row for row in rows if row["controller"] != OURS}
    todo = [task for task in tasks if _key_of(task) not in known]
    new = over_cores(pull, todo, options.jobs, "closed loop")
    known |= {_key(row): row for row in new}
    rows = [known[_key_of(task)] for task in tasks]
    found = {(row["case"], row["controller"]): row for row in rows if row["setting"] is None}
    others = {(row["case"], row["controller"], row["setting"]): row for row in rows}
    report = Report()
    _print_tables(numbers, found)
    _print_summary(numbers, found)
    judge(numbers, found, others, report)
    report.summarise()
    if options.json:
        document = {"seed": options.seed, "rows": rows, "goals": report.checks}
        options.json.write_text(json.dumps(document), encoding="utf-8")
    if options.html:
        from _pulling_page import make_page

        write_page(make_page(numbers, found, report, options.seed), options.html)
    sys.exit(0)


def _tasks(numbers, seed, *, usual):
    tasks = [Task(n, name, None, seed, traced=True) for n in numbers for name in MAKERS]
    if usual:
        return tasks
    return tasks + [
        Task(n, name, setting, seed)
        for n in numbers
        if CASES[n].kind != "instrument"
        for name, settings in OTHERS.items()
        for setting in settings
    ]


def _key(row):
    return row["case"], row["controller"], row["setting"], row["seed"]


def _key_of(task):
    return CASES[task.case].name, task.name, task.setting, task.seed


def _print_tables(numbers, found):
    print("utilisation, % / energy lost in slip, % of the work / longest run-away, s")
    print(f"| case | {' | '.join(MAKERS)} |")
    print(f"|{'---|' * (len(MAKERS) + 1)}")
    for number in numbers:
        cells = [found[CASES[number].name, name] for name in MAKERS]
        texts = [
            f"{100 * x['utilisation']:.1f} / {100 * x['slip_energy']:.1f} / {x['run_away_s']:.1f}"
            for x in cells
        ]
        print(f"| {CASES[number].name} | {' | '.join(texts)} |")
    print("\nours: largest creep over that of the peak, s beyond twice it (mean of the axles) and")
    print("three times it (worst axle), share of the slip energy in excursions, of the time held")
    print("| case | worst | beyond 2 | beyond 3 | excursions | held |")
    print("|---|---|---|---|---|---|")
    for number in numbers:
        row = found[CASES[number].name, OURS]
        print(
            f"| {row['case']} | {row['worst']:.1f} | {row['beyond_s']:.2f} s | "
            f"{row['run_away_s']:.2f} s | {100 * row['excursions']:.1f} % | "
            f"{100 * row['held']:.0f} % |"
        )
    print()


def _print_summary(numbers, found):
    """Mean utilisation by kind of case, and the worst of all cases."""
    cases = [CASES[n] for n in numbers]
    kinds = [kind for kind in ("steady", "changing") if any(c.kind == kind for c in cases)]
    heads = [f"{sum(c.kind == kind for c in cases)} {kind}" for kind in kinds]
    heads += [f"all {len(cases)}", "worst", "longest time beyond 3 λ_m"]
    print(f"| force used | {' | '.join(heads)} |\n|{'---|' * (len(heads) + 1)}")
    for name in MAKERS:
        used = {case.name: found[case.name, name]["utilisation"] for case in cases}
        groups = [[used[c.name] for c in cases if c.kind == kind] for kind in kinds]
        cells = [100 * np.mean(group) for group in (*groups, list(used.values()))]
        texts = [f"{cell:.1f} %" for cell in (*cells, 100 * min(used.values()))]
        away_s = max(found[case.name, name]["run_away_s"] for case in cases)
        print(f"| {name} | {' | '.join(texts)} | {away_s:.1f} s |")
    print()


if __name__ == "__main__":
    main()
