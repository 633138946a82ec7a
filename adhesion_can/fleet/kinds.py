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
        return len({unit.vehicle for unit in self.units})

    @property
    def compared(self) -> bool:
        """Whether there are vehicles enough to compare them with each other."""
        return self.vehicles >= LEAST_VEHICLES


def find_kinds(units: Iterable[UnitEvidence]) -> tuple[VehicleKind, ...]:
    """Kinds of some units, that with the most vehicles first.

    Units without effects and without wheel radii have no part in any.

    """
    by_form: dict[VehicleForm, list[UnitEvidence]] = defaultdict(list)
    for unit in units:
        if unit.has_effects or unit.radii:
            by_form[unit.form].append(unit)
    kinds = [
        VehicleKind("", tuple(kind_units))
        for form in sorted(by_form, key=repr)
        for kind_units in _split(by_form[form])
    ]
    kinds.sort(key=lambda kind: (-kind.vehicles, kind.units[0].unit))
    if len(kinds) < 2:
        return tuple(kinds)
    return tuple(
        VehicleKind(name, kind.units) for name, kind in zip(_names(kinds), kinds, strict=True)
    )


def _split(units: Sequence[UnitEvidence]) -> list[list[UnitEvidence]]:
    """Units of one form, divided by the effects of their vehicles.

    The set of effects that most vehicles have leads; a set joins the first leader that it is like
    (leader algorithm; Hartigan, Clustering Algorithms, 1975). A vehicle without effects joins the
    first.
    """
    effects: dict[str, set[tuple[str, str]]] = defaultdict(set)
    for unit in units:
        keys = () if unit.grams is None else unit.grams.keys
        effects[unit.vehicle] |= {(key.effect, key.form) for key in keys}
    sets = Counter(
        frozenset(vehicle_effects) for vehicle_effects in effects.values() if vehicle_effects
    )
    leader: dict[Effects, Effects] = {}
    for joining in sorted(
        sets, key=lambda effect_set: (-sets[effect_set], -len(effect_set), sorted(effect_set))
    ):
        like = (
            other
            for other in dict.fromkeys(leader.values())
            if len(joining & other) >= ALIKE * len(joining | other)
        )
        leader[joining] = next(like, joining)
    first = next(iter(leader.values()), frozenset())
    divided: dict[Effects, list[UnitEvidence]] = defaultdict(list)
    for unit in units:
        divided[leader.get(frozenset(effects[unit.vehicle]), first)].append(unit)
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
        first = min(unit.vehicle for unit in kind.units)
        longer = name if often[name] == 1 else f"{name}, such as {first}"
        seen[longer] += 1
        names.append(longer if seen[longer] == 1 else f"{longer} ({seen[longer]})")
    return names


def _plain_name(kind: VehicleKind) -> str:
    form = kind.units[0].form
    if form.axles is None:
        return form.data or "others"
    return f"{form.data} of {counted(form.axles, 'axle')}"
