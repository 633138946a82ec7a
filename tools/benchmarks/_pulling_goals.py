"""Goals of the creep controller beside its rivals, and energies at equal utilisation."""

from itertools import permutations

import numpy as np
from _pulling_cases import CASES
from _pulling_runs import OUR_OTHERS, OURS
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
        others: Rows by (case, controller, setting), those of the rivals at their other settings
            among them, where they were driven.
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
    """Slip energy beside that of each rival, at the same utilisation."""
    cases = [CASES[n].name for n in numbers if CASES[n].kind != "instrument"]
    for rival in RIVALS:
        pairs = []
        for case in cases:
            ours = _front(case, OURS, OUR_OTHERS, found, others)
            theirs = _front(case, rival.name, rival.OTHERS, found, others)
            both = energies_at_equal(ours, theirs)
            pairs += [] if both is None else [both]
        if not pairs:
            report.write(f"slip energy beside {rival.name}: it nowhere pulls as much as ours")
            continue
        mine, their = np.sum(pairs, axis=0)
        what = f"slip energy over that of {rival.name} in {len(pairs)} of {len(cases)} cases"
        report.at_most(what, mine / their, ENERGY_SHARE, ".2f")


def _front(case, name, settings, found, others):
    """Points (utilisation, slip energy) of a controller's settings, as far as they were driven."""
    keys = [(case, name, setting) for setting in settings]
    rows = [found[case, name], *(others[key] for key in keys if key in others)]
    return [(row["utilisation"], row["slip_energy"]) for row in rows]


def energies_at_equal(ours, theirs):
    """Slip energies of both at the largest utilisation that both reach.

    None where they have none in common: all settings of one pull more than the best of the other,
    by more than half a percent.

    Args:
        ours: Points (utilisation, slip energy) of our settings.
        theirs: Those of the other's.

    """
    used = min(max(ours)[0], max(theirs)[0])
    if any(min(front)[0] > used + BEHIND_BEST for front in (ours, theirs)):
        return None
    return energy_at(used, ours), energy_at(used, theirs)


def energy_at(used, front):
    """Smallest slip energy with which a controller reaches a utilisation.

    Between two settings, one with less and one with more, the energy is interpolated.

    Args:
        used: Utilisation, at most the largest of the front.
        front: Points (utilisation, slip energy) of its settings.

    """
    energies = [energy for one, energy in front if one >= used]
    for (one, energy), (other, more) in permutations(front, 2):
        if one < used < other:
            energies.append(energy + (used - one) / (other - one) * (more - energy))
    return min(energies)


def _at_least(report, what, share, least):
    report.check(what, f"{100 * share:.2f} %", f"at least {100 * least:.2f} %", met=share >= least)
