"""Signs of slip and force: one that is reversed, one that is missing, or one of the two late."""

from collections.abc import Iterator

import numpy as np

from adhesion_can.offline.consistency import MOST_LEFT, Shift, find_shift
from adhesion_can.offline.finding import Finding
from adhesion_can.offline.points import LEAST_ROWS, MeasuredPoints
from adhesion_can.offline.rim_speed import known_ratio

CLEAR_SLIP, CLEAR_ADHESION = 0.002, 0.02
"""Sizes from which slip and adhesion have a sign beyond their noise."""
MOST_OPPOSITE = 0.8
"""Share of such rows with opposite signs from which one of the two counts the other way."""
UNSIGNED, BOTH_WAYS = 0.001, 0.1
"""Share of the rows below 0 of a column without sign, and least share of either sign of the other
column that shows it."""
LEAST_SPREAD = 0.2
"""Range of most of a column's sizes, as a share of the middle one, that it has where it varies."""
MOST_USED = 0.3
"""Middle slip beyond which a contact hardly transmits what the signs are compared by."""


def inspect_signs(points: MeasuredPoints) -> Iterator[Finding]:
    """Slip and force with opposite signs: one of them is reversed, or late by half a swing."""
    clear = (np.abs(points.slip) > CLEAR_SLIP) & (np.abs(points.adhesion) > CLEAR_ADHESION)
    count = int(clear.sum())
    if count < LEAST_ROWS:
        return
    opposite = float(np.mean(points.slip[clear] * points.adhesion[clear] < 0))
    if opposite <= MOST_OPPOSITE or (not points.table and known_ratio(points.slip) is not None):
        return
    what = f"slip and force have opposite signs in {100 * opposite:.0f} % of {count} rows"
    turn = "in braking both are below 0; write sign = -1 for the reversed role"
    if points.table:
        turn = (
            "in braking both are below 0; pass --column slip=slip,sign=-1, or the same for the "
            "force"
        )
    shift: Shift | None = None
    if points.t_us is not None and not np.any(np.diff(points.t_us) < 0):
        shift = find_shift(points.t_us, points.slip, points.adhesion)
    unexplained_by_sign = 1.0 if shift is None else 1.0 - min(shift.unshifted, 0.0) ** 2
    if shift is None or unexplained_by_sign < MOST_LEFT * shift.unexplained:
        yield Finding(what, turn)
        return
    what += (
        f"; the {shift.late} may lag the {shift.early} by {abs(shift.by_s):.3g} s: their "
        f"correlation is {shift.correlation:.2f} with this shift, and {-shift.unshifted:.2f} "
        "with one sign reversed"
    )
    if shift.unexplained < MOST_LEFT * unexplained_by_sign:
        yield Finding(what, shift.fix)
    else:
        yield Finding(what, f"{turn}; if one is late, {shift.fix}")


def inspect_missing_sign(points: MeasuredPoints) -> Iterator[Finding]:
    """A slip or a force that is never below 0 while the other is in many rows: no sign at all.

    Rows in which either is near 0 do not count: in friction braking no force is measured. Of a
    recording the slips have their sign, and efforts that stand still look alike.
    """
    clear = (np.abs(points.slip) > CLEAR_SLIP) & (np.abs(points.adhesion) > CLEAR_ADHESION)
    is_used = float(np.median(np.abs(points.slip))) <= MOST_USED
    if not points.table or int(clear.sum()) < LEAST_ROWS or not is_used:
        return
    slip, force = points.slip[clear], points.adhesion[clear]
    fix = "write both below 0 in braking; the slip is (rim speed - speed) / speed"
    for name, values, other, others in (
        ("slip", slip, "force", force),
        ("force", force, "slip", slip),
    ):
        low, middle, high = np.quantile(np.abs(values), (0.1, 0.5, 0.9))
        varies = high - low > LEAST_SPREAD * middle  # what stands still has another fault
        below, share = float(np.mean(values < 0)), float(np.mean(others < 0))
        if varies and below <= UNSIGNED and BOTH_WAYS <= share <= 1.0 - BOTH_WAYS:
            yield Finding(
                f"the {name} is never below 0, but the {other} is in {100 * share:.0f} % of the "
                f"rows: the {name} has no sign",
                fix,
            )
