"""Mechanisms that no library has: how one is written down, and which of them are set aside.

Of the first set twelve are set aside by a rule that knows nothing but the names: those with the
smallest SHA-256. The second set, written later, is set aside as a whole. What a diagnosis answers
on either is looked at once, when nothing is tuned any more.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from hashlib import sha256

import numpy as np

from tests.worlds.mechanism import Change, Scene

MechanismLaw = Callable[[Scene, float, np.random.Generator], Change]
LABELS = ("small", "medium", "large")
ASIDE_COUNT = 12


@dataclass(frozen=True)
class Mechanism:
    """A mechanism from the literature.

    Attributes:
        name: Name of its law's function.
        law: what it changes in a drive at a size; its docstring has formula and source.
        sizes: Small, medium and large.
        unit: of the size.
        channel: Channel that the residual depends on; None: none of the bus. A factor in it, or a
            formula in it, is no false name.
        same: Effects of the library that are physically the same, each with the reason. To name
            one of them is no false name.
        second: Whether it is of the second set.

    """

    name: str
    law: MechanismLaw
    sizes: tuple[float, float, float]
    unit: str
    channel: str | None = None
    same: Mapping[str, str] = field(default_factory=dict)
    second: bool = False

    @property
    def acceptable(self) -> frozenset[str]:
        """Effects and channels (`channel:NAME`) that are no false name."""
        own = {f"channel:{self.channel}"} if self.channel else set()
        return frozenset({*self.same, *own})

    @property
    def source(self) -> str:
        """Formula and literature."""
        return self.law.__doc__ or ""


MECHANISMS: dict[str, Mechanism] = {}


def mechanism(
    *,
    sizes: tuple[float, float, float],
    unit: str,
    channel: str | None = None,
    same: Mapping[str, str] | None = None,
    second: bool = False,
) -> Callable[[MechanismLaw], MechanismLaw]:
    """Enter a law among the mechanisms under the name of its function."""

    def entered(law: MechanismLaw) -> MechanismLaw:
        name = law.__name__
        MECHANISMS[name] = Mechanism(name, law, sizes, unit, channel, same or {}, second)
        return law

    return entered


def set_aside(names: list[str]) -> tuple[str, ...]:
    """The twelve names with the smallest SHA-256, in the order given."""
    first = sorted(names, key=lambda name: sha256(name.encode()).hexdigest())[:ASIDE_COUNT]
    return tuple(name for name in names if name in first)
