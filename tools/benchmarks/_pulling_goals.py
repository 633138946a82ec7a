"""Goals of the creep controller beside its rivals, and energies at equal utilisation."""

from itertools import permutations

import numpy as np
from _pulling_cases import CASES
from _pulling_runs import OURS
from _rival_controllers import RIVALS, Oracle

STEADY_SHARE, CHANGING_SHARE = 0.97, 0.94
BEHIND_BEST, BEHIND_ORACLE = 0.005, 0.02
ENERGY_SHARE = 0.8
RUN_AWAY_S = 0.5


def judge(numbers, found, others, report):
    """Print every goal beside its figure.

    Args:
        numbers: Numbers of the cases.
        found: Rows by (case, controller), each rival at its usual setting.
        others: Rows of the rivals at their other settings.
        report: Report that prints and counts.

    """
    mine = {CASES[n].name: found[CASES[n].name, OURS] for n in numbers}
    for number in numbers:
        case = CASES[number]
        used = mine[case.name]["utilisation"]
        wanted = {"steady": STEADY_SHARE, "changing": CHANGING_SHARE}.get(case.kind)
        if wanted is not None:
            _at_least(report, f"{case.name}: utilisation", used, wanted)
        rivals = {rival.name: found[case.name, rival.name]["utilisation"] for rival in RIVALS}
        best = max(rivals, key=rivals.get)
        what = f"{case.name}: beside the best rival ({best})"
        _at_least(report, what, used, rivals[best] - BEHIND_BEST)
    means = {
        name: np.mean([found[case, name]["utilisation"] for case in mine])
        for name in (OURS, Oracle.name, *(rival.name for rival in RIVALS))
    }
    for rival in RIVALS:
        _at_least(report, f"mean, beside {rival.name}", means[OURS], means[rival.name])
    _at_least(report, "mean, beside the oracle", means[OURS], means[Oracle.name] - BEHIND_ORACLE)
    for case, row in mine.items():
        away_s = row["run_away_s"]
        report.at_most(f"{case}: longest run-away, s", away_s, RUN_AWAY_S, ".2f")
    _judge_energy(numbers, found, others, report)


def _judge_energy(numbers, found, others, report):
    """Slip energy beside that of each rival, where a setting of it pulls as much as ours."""
    cases = [CASES[n].name for n in numbers if CASES[n].kind != "instrument"]
    for rival in RIVALS:
        mine, theirs = [], []
        for case in cases:
            own = found[case, OURS]
            rows = [found[case, rival.name]]
            rows += [others[case, rival.name, setting] for setting in rival.OTHERS]
            front = [(row["utilisation"], row["slip_energy"]) for row in rows]
            energy = energy_at(own["utilisation"], front)
            if energy is not None:
                mine.append(own["slip_energy"])
                theirs.append(energy)
        if not mine:
            report.write(f"slip energy beside {rival.name}: it nowhere pulls as much as ours")
            continue
        what = f"slip energy over that of {rival.name} in {len(mine)} of {len(cases)} cases"
        report.at_most(what, sum(mine) / sum(theirs), ENERGY_SHARE, ".2f")


def energy_at(used, front):
    """Smallest slip energy of a rival at a utilisation; None where it does not reach that.

    It reaches it where a setting has as much, less half a percent. Between two settings, one with
    less and one with more, the energy is interpolated.

    Args:
        used: Utilisation.
        front: Points (utilisation, slip energy) of its settings.

    """
    energies = [energy for one, energy in front if one >= used - BEHIND_BEST]
    for (one, energy), (other, more) in permutations(front, 2):
        if one < used < other:
            energies.append(energy + (used - one) / (other - one) * (more - energy))
    return min(energies, default=None)


def _at_least(report, what, share, least):
    report.check(what, f"{100 * share:.2f} %", f"at least {100 * least:.2f} %", met=share >= least)
