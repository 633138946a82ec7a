"""Consistency in time: force beside slip, and the change of the speed beside the force.

A force that fits the slips of another time is late; a speed that changes faster than the force can
change it is of another unit. Both from the correlation of columns as they stand, before any fit.
"""

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from adhesion_can.arrays import Array
from adhesion_can.offline.finding import Finding
from adhesion_can.physics.vehicle import GRAVITY
from adhesion_can.sampling.derived_force import correlation, find_derived_force

LEAST_ROWS = 60
"""Rows, or pairs of them, without which a correlation says nothing."""
MOST_SHIFT = 60
"""Greatest shift that is tried, rows; a tenth of the rows at most."""
LEAST_SHIFT = 2
"""Least shift that is reported, rows: half a row more or less is the instants of sampling."""
LEAST_CORRELATION = 0.7
"""Correlation of force and slip, at the best shift, below which nothing is said."""
LONGEST_S = 0.5
"""Longest delay with which the rest of an answer may still be true: `diagnose` tests it."""
MOST_LEFT = 0.85
"""Share of the unexplained variance that the best explanation may leave of that of another one."""
BORDERS, BORDER_PLACES = 2, 41
"""Changes of the rail that may stand for a delay, and places at which each is tried."""
SPAN_ROWS = 5
"""Rows over which the change of the speed is taken."""
FASTEST = 1.2
"""Change of the speed over that by the force on all axles, from which it cannot be."""
LEAST_RELATION = 0.6
"""Correlation of the two below which forces of others drive the vehicle."""


class Shift(NamedTuple):
    """Shift in time at which force and slip fit best.

    Attributes:
        by_s: Time from the slip to the force that fits it, s; below 0 where the slip is late.
        correlation: Correlation of slip and force at this shift.
        unshifted: Correlation of the rows as they are.

    """

    by_s: float
    correlation: float
    unshifted: float

    @property
    def late(self) -> str:
        """The column that is late."""
        return "force" if self.by_s > 0 else "slip"

    @property
    def early(self) -> str:
        """The other column."""
        return "slip" if self.by_s > 0 else "force"

    @property
    def unexplained(self) -> float:
        """Share of the force's variance that the slips do not explain at this shift."""
        return 1.0 - self.correlation**2

    @property
    def fix(self) -> str:
        """What to do about it."""
        by = abs(self.by_s)
        return (
            f"shift the late one; in a table, pass --column NAME=COLUMN,late_s={by:.3g} for the "
            f"{self.late}, or late_s=-{by:.3g} for the {self.early}"
        )


def find_shift(t_us: NDArray[np.int64], slip: Array, adhesion: Array) -> Shift | None:
    """The shift in time at which force and slip fit best; None where it is 0 or they hardly fit.

    Args:
        t_us: Stamps of one axle's rows, ascending, µs, shape (n,).
        slip: Slip ratios, shape (n,).
        adhesion: Adhesion coefficients, shape (n,).

    """
    if len(t_us) < LEAST_ROWS or not (step_us := float(np.median(np.diff(t_us)))) > 0:
        return None
    bent = _bent(slip)
    if bent is None:
        return None
    most = min(MOST_SHIFT, len(t_us) // 10)
    fits = {
        shift: _correlation_at(shift, t_us, step_us, bent, adhesion)
        for shift in range(-most, most + 1)
    }
    best = max(fits, key=lambda shift: fits[shift])
    # What grows to the end of the search is no maximum.
    if abs(best) < LEAST_SHIFT or fits[best] < LEAST_CORRELATION or abs(best) == most:
        return None
    return Shift(best * step_us / 1e6, fits[best], fits[0])


def _bent(slip: Array) -> Array | None:
    """Slips made monotonic and bent as a curve of adhesion is; None where most of them are 0."""
    middle = float(np.median(np.abs(slip)))
    return slip / (np.abs(slip) + middle) if middle > 0 else None


def inspect_delay(t_us: NDArray[np.int64], slip: Array, adhesion: Array) -> Iterator[Finding]:
    """The shift in time at which force and slip fit best, where nothing else explains them so well.

    Args:
        t_us: Stamps of one axle's rows, ascending, µs, shape (n,).
        slip: Slip ratios, shape (n,).
        adhesion: Adhesion coefficients, shape (n,).

    """
    shift = find_shift(t_us, slip, adhesion)
    # Beyond its peak a curve falls: slips that come and go fit best half a period later.
    if shift is None or shift.unshifted <= 0.0:
        return
    if shift.unexplained > MOST_LEFT * (1.0 - shift.unshifted**2):
        return
    by_borders = _unexplained_by_borders(slip, adhesion)
    if by_borders < shift.unexplained:
        return
    by = abs(shift.by_s)
    what = (
        f"the {shift.late} lags the {shift.early} by {by:.3g} s: their correlation is "
        f"{shift.correlation:.2f} with this shift, and {shift.unshifted:.2f} without"
    )
    if shift.unexplained <= MOST_LEFT * by_borders:
        yield Finding(what, shift.fix, fatal=by > LONGEST_S)
    else:
        what += "; a change of the surface explains the rows about as well"
        yield Finding(what, f"if one is late, {shift.fix}", fatal=False)


def _unexplained_by_borders(slip: Array, adhesion: Array) -> float:
    """Share of the force's variance that is left where the rail may change up to `BORDERS` times.

    Between two borders the force is a straight line over the bent slips; each border is where it
    leaves least.
    """
    bent, total = _bent(slip), float(np.var(adhesion)) * len(adhesion)
    if bent is None or total <= 0:
        return 1.0
    borders = [0, len(slip)]
    columns = np.stack([np.ones_like(bent), bent, adhesion, bent**2, bent * adhesion, adhesion**2])
    sums = np.concatenate([np.zeros((6, 1)), np.cumsum(columns, axis=1)], axis=1)
    places = np.unique(np.linspace(0, len(slip), BORDER_PLACES).astype(int))
    for _ in range(BORDERS):
        free = [p for p in places if min(abs(p - b) for b in borders) >= LEAST_ROWS // 2]
        if not free:
            break
        tried = [sorted([*borders, place]) for place in free]
        borders = min(tried, key=lambda them: _residual_square(sums, them))
    return _residual_square(sums, borders) / total


def _residual_square(sums: Array, borders: list[int]) -> float:
    """Sum of squares that lines between borders leave, from running sums of the moments."""
    n, x, y, xx, xy, yy = np.diff(sums[:, borders], axis=1)
    spread = xx - x * x / n
    slope = (xy - x * y / n) / np.where(spread > 0, spread, 1.0)
    left = yy - y * y / n - np.where(spread > 0, slope**2 * spread, 0.0)
    return float(np.sum(np.maximum(left, 0.0)))


def _correlation_at(
    shift: int, t_us: NDArray[np.int64], step_us: float, slip: Array, adhesion: Array
) -> float:
    """Correlation of slip and the adhesion some rows later, rows without a gap between them."""
    first = np.arange(max(0, -shift), len(t_us) - max(0, shift))
    steps = (t_us[first + shift] - t_us[first]) / step_us
    first = first[np.abs(steps - shift) < 0.1]
    if len(first) < LEAST_ROWS:
        return 0.0
    return correlation(slip[first], adhesion[first + shift])


def inspect_acceleration(
    t_us: NDArray[np.int64], speed: Array, adhesion: Array
) -> Iterator[Finding]:
    """A speed that changes faster than the adhesion, on all axles, can change it.

    Args:
        t_us: Stamps of one axle's rows, ascending, µs, shape (n,).
        speed: Vehicle speed, m/s, shape (n,).
        adhesion: Adhesion coefficients, shape (n,).

    """
    ratio = acceleration_ratio(t_us, speed, adhesion)
    if ratio is None or ratio < FASTEST:
        return
    yield Finding(
        f"the speed changes {ratio:.1f} times faster than this adhesion on all axles allows",
        "if the column is in km/h, pass --column speed_mps=speed_mps,unit=km/h",
        fatal=False,
    )


def inspect_derived_force(
    t_us: NDArray[np.int64], speed: Array, adhesion: Array
) -> Iterator[Finding]:
    """An adhesion that was computed from the rate of change of the speed.

    Args:
        t_us: Stamps of one axle's rows, ascending, µs, shape (n,).
        speed: Vehicle speed, m/s, shape (n,).
        adhesion: Adhesion coefficients, shape (n,).

    """
    derived = find_derived_force(t_us, speed, adhesion)
    if derived is not None:
        yield Finding(
            "the force is computed from the speed: the rate of change of the speed explains "
            f"{100 * derived.explained:.0f} % of the force, and their noise correlates by "
            f"{derived.shared:.2f}",
            "such data show no delay between force and speed; use a measured force",
            fatal=False,
        )


def acceleration_ratio(t_us: NDArray[np.int64], speed: Array, adhesion: Array) -> float | None:
    """Change of the speed over μ g t, by least squares; None where the two are hardly related.

    Args:
        t_us: Stamps of one axle's rows, ascending, µs, shape (n,).
        speed: Vehicle speed, m/s, shape (n,).
        adhesion: Adhesion coefficients, shape (n,).

    """
    steps_s = np.diff(t_us) / 1e6
    if len(t_us) < LEAST_ROWS or not (step_s := float(np.median(steps_s))) > 0:
        return None
    pushed = GRAVITY * np.concatenate([[0.0], np.cumsum((adhesion[1:] + adhesion[:-1]) * steps_s)])
    first = np.arange(0, len(t_us) - SPAN_ROWS, SPAN_ROWS)
    last = first + SPAN_ROWS
    whole = (t_us[last] - t_us[first]) / 1e6 < 1.5 * SPAN_ROWS * step_s
    first, last = first[whole], last[whole]
    if len(first) < LEAST_ROWS:
        return None
    change, by_force = speed[last] - speed[first], (pushed[last] - pushed[first]) / 2.0
    if correlation(change, by_force) < LEAST_RELATION:
        return None
    return float(change @ by_force / (by_force @ by_force))
