"""The curve families by name."""

from collections.abc import Mapping
from types import MappingProxyType

from adhesion_can.physics.curves.base import CurveFamily
from adhesion_can.physics.curves.burckhardt_c4 import BurckhardtC4
from adhesion_can.physics.curves.burckhardt_family import Burckhardt
from adhesion_can.physics.curves.free import Free
from adhesion_can.physics.curves.magic_formula import MagicFormula
from adhesion_can.physics.curves.polach import Polach

_ALL: tuple[CurveFamily, ...] = (Burckhardt(), BurckhardtC4(), Polach(), MagicFormula(), Free())

FAMILIES: Mapping[str, CurveFamily] = MappingProxyType({family.name: family for family in _ALL})
"""Families by name: Burckhardt first, the others in the order in which they were added."""


def family_by_name(name: str) -> CurveFamily:
    """Curve family of that name; KeyError with the names that exist."""
    if name not in FAMILIES:
        raise KeyError(f"no curve family {name!r}; known: {', '.join(FAMILIES)}")
    return FAMILIES[name]
