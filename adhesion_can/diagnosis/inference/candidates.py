"""What the data can tell at all, and why not where they cannot."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from adhesion_can.diagnosis.drive.drive_data import Course
from adhesion_can.diagnosis.regression.model import Candidate
from adhesion_can.diagnosis.result import Untested
from adhesion_can.physics.effects import EFFECTS, Effect

LEAST_ROWS, LEAST_BLOCKS = 400, 9
LEAST_RANGE = 0.004
"""Range of |λ| (5 to 95 % of the rows) below which there is no curve in the data."""
LEAST_ADHESION = 0.01
"""Likewise of |μ|."""
OF_SIGNALS = frozenset({"wheelset_inertia", "speed_delay"})
OF_SPEED = frozenset(
    {"speed_dependence", "falling_friction", "creep_relaxation", "adhesion_recovery"}
)
"""Effects that a TABLE cannot tell: at all, and without a speed."""
IMITATED = 0.995
"""Share of a signature that the curve imitates, from which nothing can be said of the effect."""
COASTING = 0.005
"""|μ| of an axle that coasts."""


def candidates_of(courses: Sequence[Course]) -> tuple[tuple[Candidate, ...], list[Untested]]:
    """Effects that the recordings can be tested for, and those that they cannot."""
    found: list[Candidate] = []
    untested: dict[str, str] = {}
    for effect in EFFECTS:
        why = _missing(effect, courses)
        if why:
            untested[effect.id] = why
            continue
        if any(p.axle for p in effect.parameters):
            axles = sorted(set.union(*(set(np.unique(c.axle).tolist()) for c in courses)))
            found += [Candidate(effect, int(axle)) for axle in axles]
        else:
            found.append(Candidate(effect))
    return tuple(found), [Untested(what, why) for what, why in untested.items()]


def _missing(effect: Effect, courses: Sequence[Course]) -> str:
    """Why an effect cannot be tested; '' where it can."""
    if effect.needs:
        return _missing_signal(effect, courses)
    if any(course.table for course in courses) and effect.id in OF_SIGNALS:
        return "a table gives slip and adhesion, not the wheel speed that they were formed from"
    axles = max(len(np.unique(course.axle)) for course in courses)
    if axles < 2 and effect.id in {"wheel_radius", "rail_cleaning"}:
        return "all rows are of one axle"
    if not all(course.has_speed for course in courses) and effect.id in OF_SPEED:
        return "the table has no column speed_mps"
    if not all(course.has_load for course in courses) and effect.id == "load_dependence":
        return "the loads are not measured"
    return ""


def _missing_signal(effect: Effect, courses: Sequence[Course]) -> str:
    known = set.intersection(*(set(course.covariates) for course in courses))
    needed = sorted(known.intersection(effect.needs))
    if not needed:
        return _no_signal(effect, courses)
    still = all(_constant(courses, name) for name in needed)
    return f"{' and '.join(needed)} does not change in these data" if still else ""


def _no_signal(effect: Effect, courses: Sequence[Course]) -> str:
    """Whether a channel is not there at all, or not there often enough."""
    for course in courses:
        for name in effect.needs:
            count = course.lost.get(f"channel {name}", 0)
            if count:
                return f"{name} is not available in {count} of its readings in {course.name}"
    return f"no signal gives {' or '.join(effect.needs)}"


def _constant(courses: Sequence[Course], name: str) -> bool:
    values = np.concatenate([course.covariates[name] for course in courses])
    return not len(values) or float(np.ptp(values)) == 0.0


def too_little(courses: Sequence[Course], block: NDArray[np.int64]) -> str:
    """Why the data carry no verdict at all; '' where they do.

    Args:
        courses: with at least one row.
        block: number of each row's block, negative where it is kept back.

    """
    for count, fewest, what in (
        (np.count_nonzero(block >= 0), LEAST_ROWS, "to decide on"),
        (np.count_nonzero(block < 0), LEAST_ROWS // 4, "to hold out"),
    ):
        if count < fewest:
            return f"{count} usable rows {what}: at least {fewest} are needed"
    blocks = len(np.unique(block))
    if blocks < LEAST_BLOCKS:
        return (
            f"the usable part of the drive is too short: {blocks} blocks of time, where "
            f"{LEAST_BLOCKS} are the least from which a part can be held out"
        )
    seen = [course.observe() for course in courses]
    for name, least, words in (
        ("slip", LEAST_RANGE, "slip"),
        ("adhesion", LEAST_ADHESION, "adhesion"),
    ):
        size = np.abs(np.concatenate([getattr(one, name) for one in seen]))
        low, high = map(float, np.quantile(size, [0.05, 0.95]))
        if high - low < least:
            return (
                f"the {words} hardly varies ({low:.4f} to {high:.4f}): a curve needs creep swept "
                "from near 0 to beyond its peak"
            )
    return ""


def remarks(courses: Sequence[Course]) -> list[Untested]:
    """What else these drives cannot tell."""
    found = []
    for course in courses:
        if course.table:
            continue
        idle = np.abs(course.observe().adhesion) < COASTING
        if not _lasting(idle, course):
            found.append(
                Untested(
                    f"wheel against ground speed in {course.name}",
                    "no axle coasts for a second: errors of speed and radius and a bias of effort "
                    "are told by the curve alone",
                )
            )
        found += [
            Untested(f"axle {axle} in {course.name}", "no usable row of it is there")
            for axle in range(1, len(course.radius) + 1)
            if not (course.axle == axle).any()
        ]
    return found


def _lasting(idle: np.ndarray, course: Course) -> bool:
    """Whether a fifth of the rows of some second of an axle coast: noise alone does not do that."""
    second = np.floor(course.t_s).astype(np.int64) + 100_000 * course.axle
    numbers, inverse = np.unique(second, return_inverse=True)
    share = np.bincount(inverse, idle) / np.maximum(np.bincount(inverse), 1)
    return bool(len(numbers) and share.max() > 0.2)
