"""The Burckhardt curve with the peak of another family's curve."""

from functools import cache

import numpy as np

from adhesion_can.arrays import Array
from adhesion_can.physics.burckhardt import SLIP_MAX, CurveParameters, adhesion
from adhesion_can.physics.curves.base import Conditions, CurveFamily, Values
from adhesion_can.physics.curves.burckhardt_family import curve_with_peak

_NEAR = np.linspace(0.3, 3.0, 60)
"""Slips at which the two curves are compared, in units of λ_m."""
_EXPONENTS = np.geomspace(0.2, 12.0, 240)
"""Values of c2·λ_m that are tried, 2 % apart."""


def burckhardt_with_same_peak(
    family: CurveFamily, values: Values, conditions: Conditions, slip_max: float = SLIP_MAX
) -> CurveParameters:
    """(c1, c2, c3) of the Burckhardt curve with the same peak that is nearest around it.

    The peak is met exactly; of the curves that have it, one for each c2, the one of least squares
    over 0.3 to 3 times λ_m is taken.

    Args:
        family: Family of the curve.
        values: Values of the family's parameters.
        conditions: Speed and load, numbers.
        slip_max: End of the valid range, slip ratio.

    """
    top = family.peak(values, conditions, slip_max)
    mu_max, lambda_m = float(top.mu_max), float(top.lambda_m)
    slip = _NEAR * lambda_m
    curve = family.adhesion(slip, values, conditions)
    distance = np.sum((mu_max * _unit_curves() - curve) ** 2, axis=1)
    return curve_with_peak(mu_max, lambda_m, float(_EXPONENTS[np.argmin(distance)]))


@cache
def _unit_curves() -> Array:
    """Curves with a peak of 1 at slip 1, one for each exponent, shape (exponents, slips)."""
    return np.stack([adhesion(_NEAR, *curve_with_peak(1.0, 1.0, x)) for x in _EXPONENTS.tolist()])
