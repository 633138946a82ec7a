"""Drives that tell explanations apart: computed ones beside the scenario `sweep`.

Each case hides an effect. A standard drive of 120 s on a dry or a wet rail leaves several
explanations, the right one among them; `--next-drive` computes the manoeuvre, a controller drives
it, and `diagnose` of both says which explanation is left. `sweep` is driven in its place for 60,
120, 240 and 480 s: how long it takes for the same. Cases in which the standard drive leaves one
explanation, or loses the right one, are no pairs and are counted apart.
"""

import json
import sys
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory

import scipy
from _report import Report, over_cores
from _rows import random_parser

from adhesion_can.api.diagnosis import diagnose
from adhesion_can.api.simulation import simulate

STANDARD_S = 120.0
SWEEPS_S = 60.0, 120.0, 240.0, 480.0
EFFECTS = (
    "effort_delay=0.02", "wheel_speed_delay=0.02", "creep_relaxation=0.5", "speed_dependence",
    "falling_friction=0.2", "slow_drift=-0.002", "effort_bias=8000", "adhesion_recovery=1e-6",
    "creep_relaxation=1.0", "effort_delay=0.04", "speed_delay=0.15", "falling_friction:polach=0.3",
    "slow_drift=-0.001", "effort_bias=4000", "wheel_speed_delay=0.04", "adhesion_recovery=4e-7",
)  # fmt: skip
SCENARIOS = "dry", "wet"


def cases(seed):
    """Effect, scenario and seed of every case, without an end."""
    number = 0
    while True:
        for scenario in SCENARIOS:
            for effect in EFFECTS:
                yield effect, scenario, seed + number
                number += 1


def is_right(names, effect):
    """Whether one explanation is left, and it is the hidden effect."""
    wanted = effect.partition("=")[0].partition(":")[0]
    return len(names) == 1 and names[0].split()[0] == wanted


def left_of(found):
    """Names that a diagnosis of two drives leaves: of the explanations, else causes and rivals."""
    if found.remaining is not None:
        return found.remaining.left
    return tuple(name for cause in found.causes for name in (cause.effect, *cause.rivals))


def run_case(case, *, full):
    """What a case gives; None where the standard drive is no pair."""
    effect, scenario, seed = case
    wanted = effect.partition("=")[0].partition(":")[0]
    with TemporaryDirectory() as name:
        folder = Path(name)

        def drive(file, *given, **others):
            made = simulate(*given, effects=[effect], **others)
            return str(made.write(folder / file))

        first = drive("standard.log", scenario, STANDARD_S, seed)
        before = diagnose(first, next_drive=True).next_drive
        names = () if before is None else before.explanations
        row = {"effect": effect, "scenario": scenario, "seed": seed, "before": names}
        row["pair"] = len(names) > 1 and any(name.split()[0] == wanted for name in names)
        if not row["pair"]:
            return row
        row |= {"planned_s": None, "left": (), "right": False, "sweep_s": None}
        if before.plan is not None:
            plan = before.plan
            second = drive("planned.log", scenario, None, seed + 10_000, plan=plan)
            found = diagnose([first, second])
            row |= {
                "planned_s": plan.duration_s,
                "left": left_of(found),
                "causes": [cause.effect for cause in found.causes],
            }
            row["right"] = is_right(row["left"], effect)
        for duration in SWEEPS_S:
            # A sweep of twice the plan and more cannot take less than half of the time.
            if not full and row["planned_s"] and duration >= 2 * row["planned_s"]:
                row["sweep_s"] = f">= {duration:g}"
                break
            third = drive("sweep.log", "sweep", duration, seed + 20_000)
            if is_right(left_of(diagnose([first, third])), effect):
                row["sweep_s"] = duration
                break
        return row


def main():
    parser = random_parser("plans", __doc__.splitlines()[0])
    parser.add_argument("--pairs", type=int, default=20, metavar="N", help="pairs (default 20)")
    parser.add_argument(
        "--full", action="store_true", help="drive every sweep, also where the plan is short enough"
    )
    parser.add_argument("--json", type=Path, metavar="FILE", help="write every case")
    options = parser.parse_args()
    rows, made = [], cases(options.seed)
    while sum(row["pair"] for row in rows) < options.pairs and len(rows) < 5 * options.pairs:
        part = [next(made) for _ in range(max(options.jobs, 1))]
        rows += over_cores(partial(run_case, full=options.full), part, options.jobs, "plans")
        for row in rows[-len(part) :]:
            print(describe(row), file=sys.stderr, flush=True)
        if options.json:
            options.json.write_text(json.dumps(rows), encoding="utf-8")
    pairs = [row for row in rows if row["pair"]][: options.pairs]
    report = Report()
    print("| hidden | rail | explanations before | planned, s | left | sweep, s |")
    print("|---|---|---|---|---|---|")
    for row in pairs:
        print(
            f"| {row['effect']} | {row['scenario']} | {', '.join(row['before'])} | "
            f"{row['planned_s'] or 'no plan'} | {', '.join(row['left']) or '-'} | "
            f"{row['sweep_s'] or 'more than 480'} |"
        )
    right = sum(row["right"] for row in pairs)
    low, high = scipy.stats.binomtest(right, len(pairs)).proportion_ci(method="exact")
    report.write(f"{len(rows) - sum(row['pair'] for row in rows)} of {len(rows)} drives: no pair")
    report.check(
        f"right one alone in {right} of {len(pairs)}",
        f"{100 * right / len(pairs):.0f} % ({100 * low:.0f} to {100 * high:.0f})",
        "90 %",
        met=right >= 0.9 * len(pairs),
    )
    short = sum(row["right"] and is_short(row) for row in pairs)
    report.check(
        "right ones in at most half of the time of sweep",
        f"{short} of {right}",
        "all",
        met=short == right,
    )
    report.summarise()


def is_short(row):
    """Whether the plan takes at most half of the time that `sweep` needs."""
    needed = row["sweep_s"]
    if needed is None or isinstance(needed, str):
        return True
    return row["planned_s"] <= needed / 2


def describe(row):
    what = f"{row['effect']} {row['scenario']} {row['seed']}: {', '.join(row['before']) or '-'}"
    if not row["pair"]:
        return f"{what}: no pair"
    return (
        f"{what}: planned {row['planned_s']} s leaves {', '.join(row['left'])} "
        f"({'right' if row['right'] else 'WRONG'}; causes {row.get('causes')}), "
        f"sweep {row['sweep_s']} s"
    )


if __name__ == "__main__":
    main()
