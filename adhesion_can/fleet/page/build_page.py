"""Page of a fleet: the worst vehicles first, what all share, adhesion by line and day, a map."""

from collections import Counter
from collections.abc import Mapping, Sequence

from adhesion_can.fleet.findings import FleetDiagnosis, VehicleSummary
from adhesion_can.fleet.overview import FleetOverview
from adhesion_can.fleet.page.adhesion import adhesion_parts, map_parts
from adhesion_can.fleet.page.sizes import size_parts
from adhesion_can.fleet.page.vehicles import named_alone, vehicle_parts
from adhesion_can.fleet.page.words import (
    MOST_ROWS,
    format_gain,
    format_size,
    left_out,
    owner,
)
from adhesion_can.plurals import counted
from adhesion_can.reporting.page import Items, Page, Part, Table, Text

MOST_SENTENCES = 5
"""Largest number of vehicles with a sentence of their own at the top of the page."""
SHARED_COLUMNS = ("of", "effect", "size", "p-value", "gain, %", "units")


def fleet_page(
    overview: FleetOverview, provenance: Mapping[str, str], commands: Sequence[str] = ()
) -> Page:
    """Build the page of a fleet.

    Args:
        overview: What the report shows.
        provenance: Version, hashes and command by name.
        commands: Commands to run next, each with the vehicle that it is for.

    """
    diagnosis = overview.diagnosis
    sections: dict[str, list[Part]] = {
        "Vehicles": vehicle_parts(diagnosis),
        "What to run next": [Items(commands)] if commands else [],
        "Sizes by vehicle": size_parts(diagnosis),
        "Lines, days and the model": _shared(diagnosis),
        "Adhesion by line and day": adhesion_parts(overview.estimates),
        "Map": map_parts(overview),
        "Failed recordings": _failures(overview),
        "What these data do not show": [Text(note) for note in diagnosis.notes]
        or [Text("Nothing was dropped.")],
    }
    return Page(
        title="What is wrong in this fleet, and why?",
        lead=_lead(overview),
        verdict=_verdict(overview),
        sections={name: parts for name, parts in sections.items() if parts},
        provenance=provenance,
    )


def _lead(overview: FleetOverview) -> str:
    diagnosis = overview.diagnosis
    verdicts = ", ".join(
        f"{name.replace('_', ' ')} {count}" for name, count in sorted(overview.verdicts.items())
    )
    own_verdicts = f" Each on its own: {verdicts}." if verdicts else ""
    return (
        f"{counted(diagnosis.units, 'recording')} of "
        f"{counted(len(diagnosis.vehicles), 'vehicle')}, "
        f"{diagnosis.diagnosed} with evidence on effects.{own_verdicts}"
    )


def _verdict(overview: FleetOverview) -> list[str]:
    diagnosis = overview.diagnosis
    named = diagnosis.named
    lines = []
    if named:
        counts = Counter(vehicle.findings[0].effect for vehicle in named)
        causes = ", ".join(f"{name} {count}" for name, count in counts.most_common(6))
        lines.append(
            f"{len(named)} of {counted(len(diagnosis.vehicles), 'vehicle')} "
            f"{'differs' if len(named) == 1 else 'differ'} from the others: {causes}."
        )
        lines += [_sized(vehicle) for vehicle in named[:MOST_SENTENCES]]
    elif diagnosis.compared:
        lines.append("No vehicle differs significantly and relevantly from the others.")
    for kind in diagnosis.kinds:
        if kind.vehicles and not kind.compared:
            what = f"{counted(kind.vehicles, 'vehicle')} {'is' if kind.vehicles == 1 else 'are'}"
            of = f" ({kind.name})" if kind.name else ""
            lines.append(f"{what} too few to be compared with each other{of}.")
    if diagnosis.named_alone:
        count = len({vehicle.vehicle for vehicle, _ in diagnosis.named_alone})
        shown = "; ".join(
            named_alone(vehicle, effect) for vehicle, effect in diagnosis.named_alone[:3]
        )
        more = f"; and {len(diagnosis.named_alone) - 3} more" * (len(diagnosis.named_alone) > 3)
        lines.append(
            f"Recordings of {counted(count, 'vehicle')} name a cause on their own that no "
            f"comparison confirms: {shown}{more}."
        )
    lines += [
        f"{owner(finding)}: {finding.name}, {finding.parameter} {format_size(finding)}."
        for finding in diagnosis.shared[:5]
    ]
    if not diagnosis.shared:
        lines.append("No effect is shared by all vehicles, a line or a day.")
    if overview.failed:
        lines.append(f"{overview.failed} of {counted(diagnosis.units, 'recording')} failed.")
    return lines


def _sized(vehicle: VehicleSummary) -> str:
    """Sizes of what a vehicle has, in a sentence."""
    causes = "; ".join(
        f"{finding.name}, {finding.parameter} {format_size(finding)}"
        for finding in vehicle.findings
    )
    return f"{vehicle.vehicle}: {causes}."


def _shared(diagnosis: FleetDiagnosis) -> list[Part]:
    if not diagnosis.shared:
        return [
            Text("No effect was found on most vehicles, and no effect differs by line or by day.")
        ]
    rows = [
        (owner(finding), finding.name, format_size(finding), f"{finding.p_value:.1g}",
         format_gain(finding), f"{finding.showing} of {finding.units}")
        for finding in diagnosis.shared[:MOST_ROWS]
    ]  # fmt: skip
    note = (
        "An effect of all vehicles belongs to the model; an effect of a line or a day shows on "
        "every vehicle that was there. For each of the three, the probability of any wrong row "
        f"is {100 * diagnosis.alpha:g} %. " + left_out(len(diagnosis.shared), MOST_ROWS, "finding")
    )
    caption = "Effects that several vehicles share."
    return [Table(caption, SHARED_COLUMNS, rows, note, sentence_columns=(1,))]


def _failures(overview: FleetOverview) -> list[Part]:
    if not overview.failed:
        return [Text("No recording failed.")]
    counts = Counter(_reason(failure.reason) for failure in overview.failures)
    rows = [
        (failure.unit, failure.vehicle, failure.reason) for failure in overview.failures[:MOST_ROWS]
    ]
    note = left_out(overview.failed, MOST_ROWS, "recording", "the table units")
    caption = "Recordings that failed, with the reason."
    kinds = "; ".join(f"{reason}: {count}" for reason, count in counts.most_common(5))
    return [
        Text(f"{counted(overview.failed, 'recording')} failed. Most frequent reasons: {kinds}."),
        Table(caption, ("recording", "vehicle", "reason"), rows, note, sentence_columns=(0, 1, 2)),
    ]


def _reason(reason: str) -> str:
    """A reason without the path or URL of the file, with which most start."""
    where, _, rest = reason.partition(": ")
    return (rest if "/" in where else reason)[:120]
