"""Diagnosis of a whole fleet from the evidence of its units, without their recordings.

What belongs to the model shows on all vehicles, what belongs to a line or a day on all vehicles
there, and what belongs to a vehicle on that vehicle alone. So the steps are:

1. `find_fleet_effects`: effects that are there on most vehicles, taken out of every unit;
2. `find_place_effects`: effects that differ on a line, then on a day, taken out of its units;
3. `find_vehicle_effects`: vehicles that differ from what is left of the others.

This is done for each kind of vehicle by itself (`kinds`): a trolleybus differs from a locomotive in
more than its faults.
"""

from collections import Counter, defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

from adhesion_can.fleet.compare_vehicles import LEAST_VEHICLES
from adhesion_can.fleet.effect_sizes import EffectSizes
from adhesion_can.fleet.evidence import UnitEvidence
from adhesion_can.fleet.findings import (
    FleetDiagnosis,
    FleetFinding,
    KindSummary,
    Scope,
    VehicleSummary,
)
from adhesion_can.fleet.kinds import VehicleKind, find_kinds
from adhesion_can.fleet.settings import FleetSettings
from adhesion_can.fleet.shared_findings import Known, find_fleet_effects, find_place_effects
from adhesion_can.fleet.size_findings import FindingSizes, size_findings_of
from adhesion_can.fleet.vehicle_findings import COASTING, compare_units, find_vehicle_effects
from adhesion_can.plurals import counted

FAILED_COST = 10.0
"""Cost of a vehicle all of whose units failed, beside a gain in percent of the RMSE."""
TYPICAL_PEAK = 0.05
"""Slip ratio of a typical peak, beside which a wheel's error of radius is counted."""


def diagnose_fleet(
    units: Sequence[UnitEvidence], settings: FleetSettings | None = None
) -> FleetDiagnosis:
    """Findings of the fleet, its lines and days, and its vehicles.

    Args:
        units: Evidence of all units, failed ones too.
        settings: Rates of false findings and least sizes; None: the defaults.

    """
    settings = settings or FleetSettings()
    kinds = find_kinds(units) or (VehicleKind("", tuple(units)),)
    found = [_diagnose_kind(one, settings) for one in kinds]
    known = {unit.unit for kind in kinds for unit in kind.units}
    notes = [note for one in found for note in one.notes]
    count = sum(not one.error and one.unit not in known for one in units)
    if count:
        notes.append(
            f"Neither effects nor wheel radii from {counted(count, 'unit')}: too short, or slip "
            "and adhesion hardly vary."
        )
    return FleetDiagnosis(
        vehicles=_rank(units, kinds, found),
        shared=tuple(finding for one in found for finding in one.shared),
        kinds=tuple(KindSummary(one.name, one.vehicles, len(one.units)) for one in kinds),
        units=len(units),
        diagnosed=sum(one.has_effects for one in units),
        false_discovery_rate=settings.false_discovery_rate,
        alpha=settings.alpha,
        notes=tuple(notes),
        spreads={name: spread for one in found for name, spread in one.spreads.items()},
    )


@dataclass(frozen=True, slots=True)
class _OfKind:
    """Findings of the vehicles of one kind.

    Attributes:
        vehicles: Findings by vehicle.
        shared: Findings of the kind, of lines and of days.
        notes: What the data do not allow to show, a sentence each.
        spreads: Spread between units of each effect, by its name.
        sizes: Sizes in the units of the kind.

    """

    vehicles: Mapping[str, tuple[FleetFinding, ...]]
    shared: tuple[FleetFinding, ...]
    notes: tuple[str, ...]
    spreads: Mapping[str, float]
    sizes: FindingSizes


def _diagnose_kind(kind: VehicleKind, settings: FleetSettings) -> _OfKind:
    """Findings of the units of one kind.

    Args:
        kind: Evidence of the units; its name is '' where there is no other.
        settings: Rates of false findings and least sizes.

    """
    units, name = kind.units, kind.name
    diagnosed = [one for one in units if one.has_effects]
    sizes = EffectSizes.collect([one.grams for one in diagnosed if one.grams is not None])
    known: Known = [{} for _ in diagnosed]
    shared: list[FleetFinding] = []
    vehicles: Mapping[str, tuple[FleetFinding, ...]] = {}
    if len({one.vehicle for one in diagnosed}) > 1:
        shared += find_fleet_effects(sizes, diagnosed, known, settings)
        for scope in (Scope.LINE, Scope.DAY):
            shared += find_place_effects(scope, sizes, diagnosed, known, settings)
    coasting = [one for one in units if one.radii]
    statistics = compare_units(diagnosed, sizes.without(known), coasting)
    if kind.compared:
        vehicles = find_vehicle_effects(statistics, settings)
    named = [f"{key.name} of {name}" if name else key.name for key in sizes.keys]
    by_unit = {one.unit: own for one, own in zip(diagnosed, known, strict=True)}
    found = size_findings_of(units, by_unit, statistics)
    sized = [found.with_size(one) for one in shared]
    return _OfKind(
        {
            vehicle: tuple(found.with_size(one, own) for one in own)
            for vehicle, own in vehicles.items()
        },
        tuple(replace(one, where=name) if one.scope is Scope.FLEET else one for one in sized),
        tuple(f"{name}: {note}" if name else note for note in _notes(kind, diagnosed)),
        {
            effect: spread.variance**0.5
            for effect, spread in zip(named, statistics.effects.spreads, strict=True)
        },
        found,
    )


def _rank(
    units: Sequence[UnitEvidence], kinds: Sequence[VehicleKind], found: Sequence[_OfKind]
) -> tuple[VehicleSummary, ...]:
    """All vehicles: those with findings first, then those whose recordings name a cause."""
    shared: dict[str, list[FleetFinding]] = defaultdict(list)
    for kind, of_kind in zip(kinds, found, strict=True):
        for vehicle in {one.vehicle for one in kind.units}:
            shared[vehicle] += of_kind.shared
    own: dict[str, list[UnitEvidence]] = defaultdict(list)
    for one in units:
        own[one.vehicle].append(one)
    summaries = []
    for vehicle, theirs in own.items():
        bad = [one for one in theirs if one.error or one.faults]
        findings = tuple(one for of_kind in found for one in of_kind.vehicles.get(vehicle, ()))
        told = [*findings, *shared[vehicle]]
        known = {effect for one in told for effect in (one.effect, *one.rivals)}
        reasons = dict.fromkeys(one.error or one.faults[0] for one in bad)
        score = sum(map(_cost, findings)) + FAILED_COST * len(bad) / len(theirs)
        causes = dict(Counter(cause for one in theirs for cause in one.causes).most_common())
        summaries.append(
            VehicleSummary(
                vehicle, score, findings, len(theirs), len(bad), tuple(reasons), causes,
                tuple(effect for effect in causes if effect not in known),
                tuple(size for of_kind in found for size in of_kind.sizes.of_causes(vehicle)),
            )
        )  # fmt: skip
    return tuple(sorted(summaries, key=_place))


def _place(one: VehicleSummary) -> tuple[bool, float, float, str]:
    """What a vehicle is sorted by: a finding, the share of its units with a cause, its cost."""
    by_itself = max(one.causes.values(), default=0) / one.units
    return not one.findings, -by_itself * (not one.findings), -one.score, one.vehicle


def _cost(finding: FleetFinding) -> float:
    """Fall of the RMSE, %; of a wheel at least its error of slip beside a typical peak, %."""
    gain = finding.gain_percent or 0.0
    if finding.source == COASTING:
        return max(gain, 100.0 * abs(finding.value) / TYPICAL_PEAK)
    return gain


def _notes(kind: VehicleKind, diagnosed: Sequence[UnitEvidence]) -> list[str]:
    notes = []
    units = kind.units
    if not kind.compared:
        notes.append(
            f"Vehicles are compared with each other if there are at least {LEAST_VEHICLES}; here "
            f"there are {kind.vehicles}, so no effect is assigned to a vehicle and each unit has "
            "its own diagnosis only."
        )
    without = sum(not (one.error or one.has_effects) for one in units)
    if without:
        notes.append(
            f"No effects from {counted(without, 'unit')}: too short, or slip and adhesion hardly "
            "vary."
        )
    for scope, places in (
        ("line", [one.line for one in diagnosed]),
        ("day", [one.day for one in diagnosed]),
    ):
        if diagnosed and not any(places):
            notes.append(f"No {scope} is known, so effects of a {scope} cannot be found.")
    alone = _driven_alone(diagnosed)
    if alone:
        shown = ", ".join(alone[:5]) + (" .." if len(alone) > 5 else "")
        notes.append(
            "Driven by a single vehicle, so its effects cannot be distinguished from the "
            f"vehicle's: line {shown}."
        )
    return notes


def _driven_alone(units: Sequence[UnitEvidence]) -> list[str]:
    """Lines that one vehicle alone has been on, where there are several vehicles."""
    on: dict[str, set[str]] = defaultdict(set)
    for one in units:
        if one.line:
            on[one.line].add(one.vehicle)
    if len({one.vehicle for one in units}) < 2:
        return []
    return sorted(line for line, vehicles in on.items() if len(vehicles) == 1)
