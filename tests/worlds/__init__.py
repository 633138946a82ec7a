"""Drives that hide an effect, and what hides in them; shares no code with the product.

`make_world(kind, seed, path)` writes a candump log (for `out:table` and `points:..` a sample
table) and returns its truth.
"""

from tests.worlds.kinds import (
    CONTACT_EFFECTS,
    CONTACTS,
    KINDS,
    LAWS,
    NULLS,
    OUTSIDE,
    PAIRS,
    POINTS,
    SINGLES,
)
from tests.worlds.truth import Truth
from tests.worlds.world import make_world

__all__ = [
    "CONTACTS",
    "CONTACT_EFFECTS",
    "KINDS",
    "LAWS",
    "NULLS",
    "OUTSIDE",
    "PAIRS",
    "POINTS",
    "SINGLES",
    "Truth",
    "make_world",
]
