"""Vehicles on the page of a fleet: their findings, the worst first, and their kinds."""

from adhesion_can.fleet.compare_vehicles import LEAST_VEHICLES
from adhesion_can.fleet.findings import FleetDiagnosis, VehicleSummary
from adhesion_can.fleet.page.words import (
    MOST_ROWS,
    format_gain,
    format_pooled,
    format_size,
    left_out,
)
from adhesion_can.plurals import counted
from adhesion_can.reporting.page import Part, Table, Text

MOST_VEHICLES = 100
"""Largest number of vehicles in the first table."""
UNKNOWN = "-"
"""Cell of a size that no recording has."""
ALONE_COLUMNS = ("vehicle", "cause", "size", "recordings")
FAILING_COLUMNS = ("vehicle", "recordings", "reason")
VEHICLE_COLUMNS = ("vehicle", "cause", "size", "p-value", "gain, %", "units", "rivals")


def vehicle_parts(diagnosis: FleetDiagnosis) -> list[Part]:
    """Tables of findings, of what recordings name by themselves, of failures and of kinds."""
    named = diagnosis.named
    rows = [
        (
            "" if place else vehicle.vehicle,
            finding.name,
            format_size(finding),
            f"{finding.p_value:.1g}",
            format_gain(finding),
            f"{finding.showing} of {finding.units}",
            ", ".join(finding.rivals) or "-",
        )
        for vehicle in named[:MOST_VEHICLES]
        for place, finding in enumerate(vehicle.findings)
    ]
    parts: list[Part] = []
    if rows:
        note = (
            "Size ± standard error: mean over the vehicle's recordings, listed under 'Sizes by "
            "vehicle'; p-value corrected for all effects; gain: reduction of the RMSE of the "
            "adhesion on recordings of the vehicle that had no part in finding it; units: those "
            "that show it on their own. A radius comes from coasting. At most "
            f"{100 * diagnosis.false_discovery_rate:g} % of these vehicles are expected to be "
            "wrong. " + left_out(len(named), MOST_VEHICLES, "vehicle")
        )
        caption = "Vehicles that differ from the others, worst first."
        parts.append(Table(caption, VEHICLE_COLUMNS, rows, note, sentence_columns=(1, 6)))
    else:
        parts.append(Text("The comparison of vehicles finds nothing."))
    alone = diagnosis.named_alone
    if alone:
        by_recordings = [
            (
                vehicle.vehicle,
                effect,
                own_size(vehicle, effect),
                f"{vehicle.causes[effect]} of {vehicle.units}",
            )
            for vehicle, effect in alone[:MOST_ROWS]
        ]
        note = (
            "Each recording was diagnosed on its own. If several recordings of a vehicle agree, "
            "the cause is likely real; a single one may be chance. Size: mean over these "
            "recordings. " + left_out(len(alone), MOST_ROWS, "cause")
        )
        caption = "Causes named by recordings alone, not by a comparison of vehicles."
        parts.append(Table(caption, ALONE_COLUMNS, by_recordings, note, sentence_columns=(1, 2)))
    by_themselves = {vehicle.vehicle for vehicle, _ in alone}
    failing = [vehicle for vehicle in diagnosis.vehicles if vehicle.failed and not vehicle.findings]
    if failing:
        failures = [
            (
                vehicle.vehicle,
                f"{vehicle.failed} of {vehicle.units}",
                vehicle.reasons[0] if vehicle.reasons else "-",
            )
            for vehicle in failing[:MOST_ROWS]
        ]
        note = left_out(len(failing), MOST_ROWS, "vehicle")
        caption = "Vehicles without a finding whose recordings failed or cannot be used."
        parts.append(Table(caption, FAILING_COLUMNS, failures, note, sentence_columns=(2,)))
    listed = {vehicle.vehicle for vehicle in [*named, *failing]} | by_themselves
    clean = len(diagnosis.vehicles) - len(listed)
    if clean and listed:
        what = "the other vehicle" if clean == 1 else f"the other {clean} vehicles"
        parts.append(Text(f"Nothing is named on {what}."))
    return parts + _kinds(diagnosis)


def _kinds(diagnosis: FleetDiagnosis) -> list[Part]:
    """Table of the kinds, where there are several."""
    if len(diagnosis.kinds) < 2:
        return []
    rows = [
        (kind.name, str(kind.vehicles), str(kind.units), "yes" if kind.compared else "no, too few")
        for kind in diagnosis.kinds[:MOST_ROWS]
    ]
    note = (
        "Vehicles are of one kind if their data have the same form (recordings or TABLEs, "
        "number of axles, configured vehicle except for its wheel radii) and can show the same "
        f"effects. A kind is compared if it has at least {LEAST_VEHICLES} vehicles. "
        + left_out(len(diagnosis.kinds), MOST_ROWS, "kind")
    )
    caption = "Kinds of vehicles: each vehicle is compared only with those of its kind."
    columns = ("kind", "vehicles", "units", "compared")
    return [Table(caption, columns, rows, note, sentence_columns=(0,))]


def named_alone(vehicle: VehicleSummary, effect: str) -> str:
    """A cause that recordings of a vehicle name by themselves."""
    size = own_size(vehicle, effect)
    count = f"{vehicle.causes[effect]} of {counted(vehicle.units, 'recording')}"
    return f"{vehicle.vehicle}: {effect}, {count}" + f", {size}" * (size != UNKNOWN)


def own_size(vehicle: VehicleSummary, effect: str) -> str:
    """Mean size of a cause over the recordings of a vehicle that name it, form by form."""
    sizes = [size for size in vehicle.cause_sizes if size.effect == effect]
    return "; ".join(f"{size.parameter} {format_pooled(size)}" for size in sizes) or UNKNOWN
