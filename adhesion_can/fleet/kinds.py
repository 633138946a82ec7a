"""Kinds of vehicles, which alone are compared with each other.

Nobody states a kind; it follows from the data. Units of one kind have the same form: recordings of
a bus or TABLEs, the same number of axles, and the same vehicle's data but for the wheel radii. Of
the vehicles of one form, those with evidence on the same effects belong together: a TABLE of few
columns shows other effects than one with weather and loads. A vehicle with a broken sensor lacks
some effects of its kind and stays in it, so vehicles are joined by the share of effects that they
have in common.
"""

from collections import Counter, defaultdict
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

from adhesion_can.fleet.compare_vehicles import LEAST_VEHICLES
from adhesion_can.fleet.evidence import UnitEvidence, VehicleForm
from adhesion_can.plurals import counted

ALIKE = 0.5
"""Effects that two vehicles of one kind have in common, as a share of those that either has
(Jaccard's index)."""
Effects = frozenset[tuple[str, str]]
"""Effect ids with their forms, on which a vehicle has evidence."""


@dataclass(frozen=True, eq=False)
class VehicleKind:
    """Units of vehicles that are compared with each other.

    Attributes:
        name: Name of the kind; '' where there is no other.
        units: Evidence of its units.

    """

    name: str
    units: tuple[UnitEvidence, ...]

    @property
    def vehicles(self) -> int:
        """Number of vehicles."""
        return len({one.vehicle for one in self.units})

    @property
    def compared(self) -> bool:
        """Whether there are vehicles enough to compare them with each other."""
        return self.vehicles >= LEAST_VEHICLES


def find_kinds(units: Iterable[UnitEvidence]) -> tuple[VehicleKind, ...]:
    """Kinds of some units, that with the most vehicles first.

    Units without effects and without wheel radii have no part in any.

    """
    by_form: dict[VehicleForm, list[UnitEvidence]] = defaultdict(list)
    for one in units:
        if one.has_effects or one.radii:
            by_form[one.form].append(one)
    found = [
        VehicleKind("", tuple(own))
        for form in sorted(by_form, key=repr)
        for own in _split(by_form[form])
    ]
    found.sort(key=lambda kind: (-kind.vehicles, kind.units[0].unit))
    if len(found) < 2:
        return tuple(found)
    return tuple(
        VehicleKind(name, kind.units) for name, kind in zip(_names(found), found, strict=True)
    )


def _split(units: Sequence[UnitEvidence]) -> list[list[UnitEvidence]]:
    """Units of one form, divided by the effects of their vehicles.

    The set of effects that most vehicles have leads; a set joins the first leader that it is like
    (leader algorithm; Hartigan, Clustering Algorithms, 1975). A vehicle without effects joins the
    first.
    """
    effects: dict[str, set[tuple[str, str]]] = defaultdict(set)
    for one in units:
        keys = () if one.grams is None else one.grams.keys
        effects[one.vehicle] |= {(key.effect, key.form) for key in keys}
    sets = Counter(frozenset(own) for own in effects.values() if own)
    leader: dict[Effects, Effects] = {}
    for own in sorted(sets, key=lambda one: (-sets[one], -len(one), sorted(one))):
        like = (
            other
            for other in dict.fromkeys(leader.values())
            if len(own & other) >= ALIKE * len(own | other)
        )
        leader[own] = next(like, own)
    first = next(iter(leader.values()), frozenset())
    divided: dict[Effects, list[UnitEvidence]] = defaultdict(list)
    for one in units:
        divided[leader.get(frozenset(effects[one.vehicle]), first)].append(one)
    return list(divided.values())


def _names(kinds: Sequence[VehicleKind]) -> list[str]:
    """Names of several kinds, each another one.

    Data and axles, the first vehicle where these do not suffice, and a number where one vehicle has
    units of several kinds: its configuration has changed.
    """
    plain = [_plain_name(kind) for kind in kinds]
    often: Mapping[str, int] = Counter(plain)
    names: list[str] = []
    seen: Counter[str] = Counter()
    for name, kind in zip(plain, kinds, strict=True):
        first = min(one.vehicle for one in kind.units)
        longer = name if often[name] == 1 else f"{name}, such as {first}"
        seen[longer] += 1
        names.append(longer if seen[longer] == 1 else f"{longer} ({seen[longer]})")
    return names


def _plain_name(kind: VehicleKind) -> str:
    form = kind.units[0].form
    if form.axles is None:
        return form.data or "others"
    return f"{form.data} of {counted(form.axles, 'axle')}"
