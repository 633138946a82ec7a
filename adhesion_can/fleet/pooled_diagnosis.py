"""Diagnosis of a whole fleet from the evidence of its units, without their recordings.

What belongs to the model shows on all vehicles, what belongs to a line or a day on all vehicles
there, and what belongs to a vehicle on that vehicle alone. So the steps are:

1. `find_fleet_effects`: effects that are there on most vehicles, taken out of every unit;
2. `find_place_effects`: effects that differ on a line, then on a day, taken out of its units;
3. `find_vehicle_effects`: vehicles that differ from what is left of the others.
"""

from collections import defaultdict
from collections.abc import Sequence

from adhesion_can.fleet.compare_vehicles import LEAST_VEHICLES
from adhesion_can.fleet.effect_sizes import EffectSizes
from adhesion_can.fleet.evidence import UnitEvidence
from adhesion_can.fleet.findings import Finding, FleetDiagnosis, Scope, VehicleSummary
from adhesion_can.fleet.settings import FleetSettings
from adhesion_can.fleet.shared_findings import Known, find_fleet_effects, find_place_effects
from adhesion_can.fleet.vehicle_findings import compare_units, find_vehicle_effects

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
    diagnosed = [one for one in units if one.grams is not None and one.grams.keys]
    sizes = EffectSizes.collect([one.grams for one in diagnosed if one.grams is not None])
    known: Known = [{} for _ in diagnosed]
    shared: list[Finding] = []
    vehicles = {one.vehicle for one in units}
    if len({one.vehicle for one in diagnosed}) > 1:
        shared += find_fleet_effects(sizes, diagnosed, known, settings)
        for scope in (Scope.LINE, Scope.DAY):
            shared += find_place_effects(scope, sizes, diagnosed, known, settings)
    coasting = [one for one in units if one.radii]
    statistics = compare_units(diagnosed, sizes.without(known), coasting)
    found = find_vehicle_effects(statistics, settings)
    return FleetDiagnosis(
        vehicles=_rank(units, found),
        shared=tuple(shared),
        units=len(units),
        diagnosed=len(diagnosed),
        false_discovery_rate=settings.false_discovery_rate,
        alpha=settings.alpha,
        notes=tuple(_notes(units, diagnosed, len(vehicles))),
        spreads={
            " ".join(filter(None, (key.effect, key.form, f"axle {key.axle}" if key.axle else ""))):
            spread.variance**0.5
            for key, spread in zip(sizes.keys, statistics.effects.spreads, strict=True)
        },
    )  # fmt: skip


def _rank(
    units: Sequence[UnitEvidence], found: dict[str, tuple[Finding, ...]]
) -> tuple[VehicleSummary, ...]:
    """All vehicles: those with findings first, and of either kind those that cost most."""
    own: dict[str, list[UnitEvidence]] = defaultdict(list)
    for one in units:
        own[one.vehicle].append(one)
    summaries = []
    for vehicle, theirs in own.items():
        bad = [one for one in theirs if one.error or one.faults]
        findings = found.get(vehicle, ())
        reasons = dict.fromkeys(one.error or one.faults[0] for one in bad)
        score = sum(map(_cost, findings)) + FAILED_COST * len(bad) / len(theirs)
        summaries.append(
            VehicleSummary(vehicle, score, findings, len(theirs), len(bad), tuple(reasons))
        )
    return tuple(sorted(summaries, key=lambda one: (not one.findings, -one.score, one.vehicle)))


def _cost(finding: Finding) -> float:
    """Fall of the RMSE, %; of a wheel at least its error of slip beside a typical peak, %."""
    gain = finding.gain_percent or 0.0
    if finding.source == "coasting":
        return max(gain, 100.0 * abs(finding.value) / TYPICAL_PEAK)
    return gain


def _notes(
    units: Sequence[UnitEvidence], diagnosed: Sequence[UnitEvidence], vehicles: int
) -> list[str]:
    notes = []
    if vehicles < LEAST_VEHICLES:
        notes.append(
            f"Vehicles are compared with each other from {LEAST_VEHICLES} on; here are {vehicles}, "
            "so no effect is called that of a vehicle: the diagnosis of each unit stands alone."
        )
    without = sum(not one.error for one in units) - len(diagnosed)
    if without > 0:
        notes.append(
            f"{without} units were worked through and have no evidence on effects: too short, "
            "or slip and adhesion hardly vary."
        )
    for scope, places in (
        ("line", [one.line for one in diagnosed]),
        ("day", [one.day for one in diagnosed]),
    ):
        if diagnosed and not any(places):
            notes.append(f"No {scope} is known: an effect of a {scope} cannot be told.")
    alone = _driven_alone(diagnosed)
    if alone:
        shown = ", ".join(alone[:5]) + (" .." if len(alone) > 5 else "")
        notes.append(f"Driven by one vehicle alone, so not told from it: line {shown}.")
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
