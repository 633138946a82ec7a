"""Consistency in time: force beside slip, and the change of the speed beside the force.

A force that fits the slips of another time is late; a speed that changes faster than the force can
change it is of another unit. Both from the correlation of columns as they stand, before any fit.
"""

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from adhesion_can.arrays import Array
from adhesion_can.offline.finding import Finding
from adhesion_can.physics.vehicle import GRAVITY
from adhesion_can.sampling.derived_force import find_derived_force

LEAST_ROWS = 60
"""Rows, or pairs of them, without which a correlation says nothing."""
MOST_SHIFT = 60
"""Greatest shift that is tried, rows; a tenth of the rows at most."""
LEAST_SHIFT = 2
"""Least shift that is told, rows: half a row more or less is the instants of sampling."""
LEAST_CORRELATION = 0.7
"""Correlation of force and slip, at the best shift, below which nothing is said."""
LONGEST_S = 0.5
"""Longest delay with which the rest of an answer may still be true: `diagnose` tests it."""
MOST_LEFT = 0.85
"""Share of the unexplained variance that the best shift may leave of that without a shift."""
SPAN_ROWS = 5
"""Rows over which the change of the speed is taken."""
FASTEST = 1.2
"""Change of the speed over that by the force on all axles, from which it cannot be."""
LEAST_RELATION = 0.6
"""Correlation of the two below which forces of others drive the vehicle."""


def inspect_delay(t_us: NDArray[np.int64], slip: Array, adhesion: Array) -> Iterator[Finding]:
    """The shift in time at which force and slip fit best, where it is not 0.

    Args:
        t_us: Stamps of one axle's rows, ascending, µs, shape (n,).
        slip: Slip ratios, shape (n,).
        adhesion: Adhesion coefficients, shape (n,).

    """
    if len(t_us) < LEAST_ROWS or not (step_us := float(np.median(np.diff(t_us)))) > 0:
        return
    middle = float(np.median(np.abs(slip)))
    if not middle > 0:
        return
    # Monotonic, and bent as a curve of adhesion is.
    bent = slip / (np.abs(slip) + middle)
    most = min(MOST_SHIFT, len(t_us) // 10)
    fits = {
        shift: _correlation_at(shift, t_us, step_us, bent, adhesion)
        for shift in range(-most, most + 1)
    }
    best = max(fits, key=lambda shift: fits[shift])
    if abs(best) < LEAST_SHIFT or fits[best] < LEAST_CORRELATION:
        return
    # Beyond its peak a curve falls: slips that come and go fit best half a period later. And what
    # grows to the end of the search is no maximum.
    if fits[0] <= 0.0 or abs(best) == most:
        return
    if 1.0 - fits[best] ** 2 > MOST_LEFT * (1.0 - max(fits[0], 0.0) ** 2):
        return
    late, early = ("force", "slip") if best > 0 else ("slip", "force")
    by = abs(best) * step_us / 1e6
    yield Finding(
        f"the {late} comes {by:.3g} s after the {early}: their correlation is {fits[best]:.2f} so, "
        f"and {fits[0]:.2f} as the rows stand",
        f"put the one that is late back in time; in a table --column NAME=COLUMN,late_s={by:.3g} "
        f"of the {late}, or late_s=-{by:.3g} of the {early}",
        fatal=by > LONGEST_S,
    )


def _correlation_at(
    shift: int, t_us: NDArray[np.int64], step_us: float, slip: Array, adhesion: Array
) -> float:
    """Correlation of slip and the adhesion some rows later, rows without a gap between them."""
    first = np.arange(max(0, -shift), len(t_us) - max(0, shift))
    steps = (t_us[first + shift] - t_us[first]) / step_us
    first = first[np.abs(steps - shift) < 0.1]
    if len(first) < LEAST_ROWS:
        return 0.0
    return _correlation(slip[first], adhesion[first + shift])


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
        f"the speed changes {ratio:.1f} times as fast as this adhesion on all axles can change it",
        "if the column is in km/h, say --column speed_mps=speed_mps,unit=km/h",
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
    found = find_derived_force(t_us, speed, adhesion)
    if found is not None:
        yield Finding(
            "the force is computed from the speed: its rate of change explains "
            f"{100 * found.explained:.0f} % of the force, and their noise has a correlation of "
            f"{found.shared:.2f}",
            "no delay between force and speed can be told from such data; give a measured force",
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
    if _correlation(change, by_force) < LEAST_RELATION:
        return None
    return float(change @ by_force / (by_force @ by_force))


def _correlation(one: Array, other: Array) -> float:
    """Pearson's correlation coefficient; 0 where one of the two is constant."""
    if not (np.ptp(one) > 0 and np.ptp(other) > 0):
        return 0.0
    return float(np.corrcoef(one, other)[0, 1])
