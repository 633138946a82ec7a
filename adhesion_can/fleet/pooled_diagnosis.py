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
    by_kind = [_diagnose_kind(kind, settings) for kind in kinds]
    known = {unit.unit for kind in kinds for unit in kind.units}
    notes = [note for of_kind in by_kind for note in of_kind.notes]
    count = sum(not unit.error and unit.unit not in known for unit in units)
    if count:
        notes.append(
            f"Neither effects nor wheel radii from {counted(count, 'unit')}: too short, or slip "
            "and adhesion hardly vary."
        )
    return FleetDiagnosis(
        vehicles=_rank(units, kinds, by_kind),
        shared=tuple(finding for of_kind in by_kind for finding in of_kind.shared),
        kinds=tuple(KindSummary(kind.name, kind.vehicles, len(kind.units)) for kind in kinds),
        units=len(units),
        diagnosed=sum(unit.has_effects for unit in units),
        false_discovery_rate=settings.false_discovery_rate,
        alpha=settings.alpha,
        notes=tuple(notes),
        spreads={name: spread for of_kind in by_kind for name, spread in of_kind.spreads.items()},
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
    diagnosed = [unit for unit in units if unit.has_effects]
    sizes = EffectSizes.collect([unit.grams for unit in diagnosed if unit.grams is not None])
    known: Known = [{} for _ in diagnosed]
    shared: list[FleetFinding] = []
    vehicles: Mapping[str, tuple[FleetFinding, ...]] = {}
    if len({unit.vehicle for unit in diagnosed}) > 1:
        shared += find_fleet_effects(sizes, diagnosed, known, settings)
        for scope in (Scope.LINE, Scope.DAY):
            shared += find_place_effects(scope, sizes, diagnosed, known, settings)
    coasting = [unit for unit in units if unit.radii]
    statistics = compare_units(diagnosed, sizes.without(known), coasting)
    if kind.compared:
        vehicles = find_vehicle_effects(statistics, settings)
    named = [f"{key.name} of {name}" if name else key.name for key in sizes.keys]
    by_unit = {unit.unit: effects for unit, effects in zip(diagnosed, known, strict=True)}
    sizes_of_findings = size_findings_of(units, by_unit, statistics)
    sized = [sizes_of_findings.with_size(finding) for finding in shared]
    return _OfKind(
        {
            vehicle: tuple(sizes_of_findings.with_size(finding, findings) for finding in findings)
            for vehicle, findings in vehicles.items()
        },
        tuple(
            replace(finding, where=name) if finding.scope is Scope.FLEET else finding
            for finding in sized
        ),
        tuple(f"{name}: {note}" if name else note for note in _notes(kind, diagnosed)),
        {
            effect: spread.variance**0.5
            for effect, spread in zip(named, statistics.effects.spreads, strict=True)
        },
        sizes_of_findings,
    )


def _rank(
    units: Sequence[UnitEvidence], kinds: Sequence[VehicleKind], by_kind: Sequence[_OfKind]
) -> tuple[VehicleSummary, ...]:
    """All vehicles: those with findings first, then those whose recordings name a cause."""
    shared: dict[str, list[FleetFinding]] = defaultdict(list)
    for kind, of_kind in zip(kinds, by_kind, strict=True):
        for vehicle in {unit.vehicle for unit in kind.units}:
            shared[vehicle] += of_kind.shared
    by_vehicle: dict[str, list[UnitEvidence]] = defaultdict(list)
    for unit in units:
        by_vehicle[unit.vehicle].append(unit)
    summaries = []
    for vehicle, of_vehicle in by_vehicle.items():
        bad = [unit for unit in of_vehicle if unit.error or unit.faults]
        findings = tuple(
            finding for of_kind in by_kind for finding in of_kind.vehicles.get(vehicle, ())
        )
        known = {
            effect
            for finding in (*findings, *shared[vehicle])
            for effect in (finding.effect, *finding.rivals)
        }
        reasons = dict.fromkeys(unit.error or unit.faults[0] for unit in bad)
        score = sum(map(_cost, findings)) + FAILED_COST * len(bad) / len(of_vehicle)
        causes = dict(Counter(cause for unit in of_vehicle for cause in unit.causes).most_common())
        summaries.append(
            VehicleSummary(
                vehicle, score, findings, len(of_vehicle), len(bad), tuple(reasons), causes,
                tuple(effect for effect in causes if effect not in known),
                tuple(size for of_kind in by_kind for size in of_kind.sizes.of_causes(vehicle)),
            )
        )  # fmt: skip
    return tuple(sorted(summaries, key=_place))


def _place(summary: VehicleSummary) -> tuple[bool, float, float, str]:
    """What a vehicle is sorted by: a finding, the share of its units with a cause, its cost."""
    by_itself = max(summary.causes.values(), default=0) / summary.units
    clear = not summary.findings
    return clear, -by_itself * clear, -summary.score, summary.vehicle


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
    without = sum(not (unit.error or unit.has_effects) for unit in units)
    if without:
        notes.append(
            f"No effects from {counted(without, 'unit')}: too short, or slip and adhesion hardly "
            "vary."
        )
    for scope, places in (
        ("line", [unit.line for unit in diagnosed]),
        ("day", [unit.day for unit in diagnosed]),
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
    vehicles_by_line: dict[str, set[str]] = defaultdict(set)
    for unit in units:
        if unit.line:
            vehicles_by_line[unit.line].add(unit.vehicle)
    if len({unit.vehicle for unit in units}) < 2:
        return []
    return sorted(line for line, vehicles in vehicles_by_line.items() if len(vehicles) == 1)
