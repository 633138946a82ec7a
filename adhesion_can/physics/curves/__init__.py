"""Families of adhesion curves: one protocol, one file each."""

from adhesion_can.physics.curves.base import (
    Conditions,
    CurveFamily,
    Values,
    bounds,
    within_bounds,
)
from adhesion_can.physics.curves.registry import FAMILIES, family_by_name

__all__ = [
    "FAMILIES",
    "Conditions",
    "CurveFamily",
    "Values",
    "bounds",
    "family_by_name",
    "within_bounds",
]
