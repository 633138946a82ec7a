"""Drives that hide an effect, and what hides in them; shares no code with the product.

`make_world(kind, seed, path)` writes a candump log (for `out:table` a sample table) and
returns its truth.
"""

from tests.worlds.kinds import KINDS, NULLS, OUTSIDE, PAIRS, SINGLES
from tests.worlds.truth import Truth
from tests.worlds.world import make_world

__all__ = ["KINDS", "NULLS", "OUTSIDE", "PAIRS", "SINGLES", "Truth", "make_world"]
