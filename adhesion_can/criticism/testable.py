"""What the data can tell at all, and why not where they cannot."""

from collections.abc import Sequence

import numpy as np

from adhesion_can.criticism.course import Course
from adhesion_can.criticism.diagnosis import Untested
from adhesion_can.criticism.model import Candidate
from adhesion_can.physics.effects import EFFECTS, Effect
from adhesion_can.physics.effects.speed_dependence import SpeedDependence

LEAST_ROWS, LEAST_BLOCKS = 400, 9
LEAST_RANGE = 0.004
"""Range of |λ| (5 to 95 % of the rows) below which there is no curve in the data."""
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
    known = set.intersection(*(set(course.covariates) for course in courses))
    if effect.needs and not known.intersection(effect.needs):
        return f"no signal gives {' or '.join(effect.needs)}"
    tables = [course.table for course in courses]
    if any(tables) and effect.id in {"wheelset_inertia", "speed_delay"}:
        return "a table gives slip and adhesion, not the wheel speed that they were formed from"
    axles = max(len(np.unique(course.axle)) for course in courses)
    if axles < 2 and effect.id in {"wheel_radius", "rail_cleaning"}:
        return "all rows are of one axle"
    if not all(course.has_speed for course in courses) and (
        isinstance(effect, SpeedDependence)
        or effect.id in {"falling_friction", "creep_relaxation", "adhesion_recovery"}
    ):
        return "the table has no column speed_mps"
    if not all(course.has_load for course in courses) and effect.id == "load_dependence":
        return "the table has no column normal_load_N"
    return ""


def too_little(courses: Sequence[Course], blocks: int) -> str:
    """Why the data carry no verdict at all; '' where they do."""
    rows = sum(len(course) for course in courses)
    if rows < LEAST_ROWS:
        return f"{rows} usable rows: at least {LEAST_ROWS} are needed"
    if blocks < LEAST_BLOCKS:
        return (
            f"the drive is too short: {blocks} blocks of time, where {LEAST_BLOCKS} are the least "
            "from which a part can be held out"
        )
    slip = np.abs(np.concatenate([course.observe().slip for course in courses]))
    low, high = np.quantile(slip, [0.05, 0.95])
    if high - low < LEAST_RANGE:
        return (
            f"the slip hardly varies ({low:.4f} to {high:.4f}): a curve needs creep swept from "
            "near 0 to beyond its peak"
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
