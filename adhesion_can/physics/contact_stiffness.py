"""Stiffness of the wheel/rail contact near zero slip: Hertz's ellipse and Kalker's coefficient c11.

Linear theory (Kalker 1967): F = G a b c11 λ for a wheel, with G the shear modulus and a, b the
semi-axes of the contact ellipse. Over the wheel's load Q this is the slope dμ/dλ of a clean contact
at zero slip. It falls with Q^(−1/3), since a b grows with Q^(2/3).

Sources: K. L. Johnson, "Contact Mechanics", Cambridge 1985, section 4.2; J. J. Kalker,
"Three-Dimensional Elastic Bodies in Rolling Contact", Kluwer 1990, appendix E.
"""

from dataclasses import dataclass
from functools import cache
from math import inf, pi, sqrt

import numpy as np
from numpy.typing import ArrayLike

from adhesion_can.arrays import Array

SHEAR_MODULUS = 8.2e10
"""Shear modulus G of steel, N/m²."""

POISSON = 0.28
"""Poisson's ratio of steel."""

RAIL_HEAD_RADIUS = 0.3
"""Transverse radius of the head of an unworn UIC 60 rail, m."""

AXIS_RATIO = 0.5
"""Ratio a/b of the semi-axes where the profiles are not known: that of the Eurosprinter in Polach
2005. A worn tread lies close to the rail and makes the ellipse wide; a cone on an unworn rail has
1.6."""

REFERENCE_LOAD = 2.0e5
"""Wheelset load where the load is not known, N."""

_AXIS_RATIO = np.array([*np.arange(0.1, 1.0, 0.1), *(1.0 / np.arange(1.0, 0.05, -0.1))])
"""a/b of the columns of `_C11`: 0.1 .. 0.9, then 1 .. 10 in equal steps of b/a."""
_C11 = np.array(
    [
        [2.51, 2.59, 2.68, 2.78, 2.88, 2.98, 3.09, 3.19, 3.29,
         3.40, 3.51, 3.65, 3.82, 4.06, 4.37, 4.84, 5.57, 6.96, 10.7],
        [3.31, 3.37, 3.44, 3.53, 3.62, 3.72, 3.81, 3.91, 4.01,
         4.12, 4.22, 4.36, 4.54, 4.78, 5.10, 5.57, 6.34, 7.78, 11.7],
        [4.85, 4.81, 4.80, 4.82, 4.83, 4.91, 4.97, 5.05, 5.12,
         5.20, 5.30, 5.42, 5.58, 5.80, 6.11, 6.57, 7.34, 8.82, 12.9],
    ]
)  # fmt: skip
"""Kalker's c11 for Poisson's ratios 0, 1/4 and 1/2 (rows) and the axis ratios of `_AXIS_RATIO`."""


@dataclass(frozen=True, slots=True)
class ContactEllipse:
    """Hertz's ellipse of contact.

    Attributes:
        a: Semi-axis along the direction of rolling, m.
        b: Semi-axis across the direction of rolling, m.

    """

    a: float
    b: float


def kalker_c11(axis_ratio: float, poisson: float = POISSON) -> float:
    """Kalker's creep coefficient c11, by interpolation of his table.

    Args:
        axis_ratio: Ratio a/b of the semi-axes along and across the direction of rolling, 0.1..10.
        poisson: Poisson's ratio of both bodies, 0..0.5.

    """
    place = np.log(np.clip(axis_ratio, _AXIS_RATIO[0], _AXIS_RATIO[-1]))
    rows = [float(np.interp(place, np.log(_AXIS_RATIO), row)) for row in _C11]
    return float(np.interp(poisson, (0.0, 0.25, 0.5), rows))


def axis_ratio(
    wheel_radius: float, rail_radius: float = RAIL_HEAD_RADIUS, profile_radius: float = inf
) -> float:
    """Ratio a/b of the semi-axes of the ellipse, from the radii of wheel and rail, by bisection.

    Args:
        wheel_radius: Rolling radius of the wheel, m.
        rail_radius: Transverse radius of the rail's head, m.
        profile_radius: Transverse radius of the wheel's tread, m: infinite for a cone, negative for
            a hollow tread.

    """
    along, across = 0.5 / wheel_radius, 0.5 * (1.0 / rail_radius + 1.0 / profile_radius)
    low, high = 1e-3, 1e3
    for _ in range(100):
        ratio = sqrt(low * high)
        own_along, own_across = _curvatures(ratio)
        # The wider ellipse belongs to the smaller curvature across.
        too_long = own_along / own_across < along / across
        low, high = (low, ratio) if too_long else (ratio, high)
    return sqrt(low * high)


def contact_ellipse(
    wheel_load: float, wheel_radius: float, ratio: float = AXIS_RATIO
) -> ContactEllipse:
    """Ellipse of contact of two steel bodies (Johnson 1985, eq. 4.25 to 4.28).

    Args:
        wheel_load: Load of one wheel, N.
        wheel_radius: Rolling radius of the wheel, m.
        ratio: Ratio a/b of the semi-axes along and across the direction of rolling.

    """
    plane_modulus = SHEAR_MODULUS / (1.0 - POISSON)  # E* of two equal bodies: E/(2 (1 - ν²))
    # 1/(2R) = 3 Q S/(2 π E* a b b), with S the shape of `_curvatures`.
    shape = _curvatures(ratio)[0]
    b = (3.0 * wheel_load * wheel_radius * shape / (pi * plane_modulus * ratio)) ** (1.0 / 3.0)
    return ContactEllipse(ratio * b, b)


def initial_stiffness(load: ArrayLike, wheel_radius: float, ratio: float = AXIS_RATIO) -> Array:
    """Slope dμ/dλ of a clean contact at zero slip, G a b c11/Q, of the shape of `load`.

    Args:
        load: Wheelset load, N, half of it on each wheel; NaN where unknown, which counts as
            `REFERENCE_LOAD`.
        wheel_radius: Rolling radius of the wheel, m.
        ratio: Ratio a/b of the semi-axes along and across the direction of rolling.

    """
    relative = np.asarray(load, dtype=np.float64) / REFERENCE_LOAD
    share = np.where(np.isfinite(relative), relative, 1.0) ** (-1.0 / 3.0)
    return np.asarray(_reference_stiffness(wheel_radius, ratio) * share)


@cache
def _reference_stiffness(wheel_radius: float, ratio: float) -> float:
    """G a b c11/Q at `REFERENCE_LOAD`."""
    wheel_load = REFERENCE_LOAD / 2
    ellipse = contact_ellipse(wheel_load, wheel_radius, ratio)
    return SHEAR_MODULUS * ellipse.a * ellipse.b * kalker_c11(ratio) / wheel_load


def _curvatures(ratio: float) -> tuple[float, float]:
    """Shape factors of the relative curvatures along and across, at a ratio a/b.

    In units of 3 Q/(2 π E* a b b): with p the longer and q the shorter semi-axis, m = 1 − (q/p)²,
    (q/p²)(K − E)/m in the direction of p and (q/p²)((p/q)² E − K)/m in that of q.
    """
    long, short = max(ratio, 1.0), min(ratio, 1.0)  # in units of b
    m = 1.0 - (short / long) ** 2
    if m < 1e-7:  # a circle
        return 0.25 * pi, 0.25 * pi
    k, e = _elliptic_integrals(m)
    scale = short / long**2 / m
    of_long, of_short = scale * (k - e), scale * ((long / short) ** 2 * e - k)
    return (of_long, of_short) if ratio > 1.0 else (of_short, of_long)


def _elliptic_integrals(m: float) -> tuple[float, float]:
    """Complete elliptic integrals K(m), E(m) by the arithmetic-geometric mean, 0 ≤ m < 1.

    Abramowitz & Stegun 1964, section 17.6.
    """
    mean, geometric, rest, power = 1.0, sqrt(1.0 - m), m, 1.0
    while abs(mean - geometric) > 1e-15 * mean:
        difference = 0.5 * (mean - geometric)
        mean, geometric = 0.5 * (mean + geometric), sqrt(mean * geometric)
        power *= 2.0
        rest += power * difference**2
    k = pi / (2.0 * mean)
    return k, k * (1.0 - 0.5 * rest)
