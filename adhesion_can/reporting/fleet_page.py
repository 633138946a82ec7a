"""Page of a fleet: the worst vehicles first, what all share, adhesion by line and day, a map."""

from collections import Counter, defaultdict
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from adhesion_can.reporting.charts import BLUE, GREEN, ORANGE, RED, Trace
from adhesion_can.reporting.page import Figure, Page, Part, Section, Table, Text

if TYPE_CHECKING:
    from adhesion_can.fleet.findings import Finding, FleetDiagnosis
    from adhesion_can.fleet.overview import FleetOverview, PlaceEstimate

MOST_VEHICLES, MOST_ROWS = 100, 60
"""Largest number of vehicles in the first table, and of rows in the others."""
MOST_LINES = 8
"""Largest number of lines that are drawn, those with the most segments."""
COLOURS = (BLUE, ORANGE, GREEN, RED)
SYMBOLS = ("circle", "square", "diamond", "triangle-up", "cross", "x", "star", "triangle-down")
VEHICLE_COLUMNS = ("vehicle", "cause", "size", "p-value", "gain, %", "units", "not told from")
SHARED_COLUMNS = ("of", "effect", "size", "p-value", "gain, %", "units")
RELATIVE = frozenset({"wheel_radius", "speed_scale"})
"""Effects whose size is a relative error, shown in percent."""
UNITS = {"1": "", "1/%": "per %", "1/K": "per K", "1/s": "per s"}
"""Units that are written otherwise."""
MAP_HEIGHT = 520
"""Height of the map, px."""


def fleet_page(overview: "FleetOverview", provenance: Mapping[str, str]) -> Page:
    """Build the page of a fleet.

    Args:
        overview: What the report shows.
        provenance: Version, hashes and command by name.

    """
    found = overview.diagnosis
    sections: dict[str, list[Part]] = {
        "Vehicles": _vehicles(found),
        "Lines, days and the model": _shared(found),
        "Adhesion by line and day": _adhesion(overview.estimates),
        "Map": _map(overview),
        "Failed recordings": _failures(overview),
        "What these data do not tell": [Text(note) for note in found.notes]
        or [Text("Nothing was left out.")],
    }
    return Page(
        title="What is wrong in this fleet, and why?",
        lead=_lead(overview),
        verdict=_verdict(overview),
        sections=[Section(name, parts) for name, parts in sections.items() if parts],
        provenance=provenance,
    )


def _lead(overview: "FleetOverview") -> str:
    found = overview.diagnosis
    verdicts = ", ".join(
        f"{name.replace('_', ' ')} {count}" for name, count in sorted(overview.verdicts.items())
    )
    own = f" Each by itself: {verdicts}." if verdicts else ""
    return (
        f"{found.units} recordings of {len(found.vehicles)} vehicles; {found.diagnosed} of them "
        f"have evidence on effects.{own}"
    )


def _verdict(overview: "FleetOverview") -> list[str]:
    found = overview.diagnosis
    named = found.named
    lines = []
    if named:
        counts = Counter(one.findings[0].effect for one in named)
        causes = ", ".join(f"{name} {count}" for name, count in counts.most_common(6))
        lines.append(
            f"{len(named)} of {len(found.vehicles)} vehicles differ from the others: {causes}."
        )
    else:
        lines.append("No vehicle differs from the others by more than chance and matters.")
    lines += [f"{_owner(one)}: {one.name}, {_size(one)}." for one in found.shared[:5]]
    if not found.shared:
        lines.append("Nothing was found that all vehicles, a line or a day share.")
    if overview.failed:
        lines.append(f"{overview.failed} of {found.units} recordings failed.")
    return lines


def _owner(finding: "Finding") -> str:
    kind = f" ({finding.where})" if finding.where else ""
    names = {"fleet": f"All vehicles{kind}", "line": f"Line {finding.where}"}
    return names.get(str(finding.scope), finding.where)


def _size(finding: "Finding") -> str:
    """Size with its standard error to two digits, and unit; an error of a ratio in percent."""
    relative = finding.effect in RELATIVE
    factor = 100.0 if relative else 1.0
    unit = "%" if relative else UNITS.get(finding.unit, finding.unit)
    value, std = factor * finding.value, factor * finding.std
    if not (np.isfinite(std) and std > 0.0):
        return f"{value:.3g} {unit}".strip()
    digits = int(np.floor(np.log10(std))) - 1
    if -6 <= digits <= 2:
        decimals = max(-digits, 0)
        return f"{value:.{decimals}f} ± {std:.{decimals}f} {unit}".strip()
    return f"{value:.3g} ± {std:.2g} {unit}".strip()


def _gain(finding: "Finding") -> str:
    if finding.gain_percent is None:
        return "-"
    return f"{finding.gain_percent:.1f}{'' if finding.held_out else ' (same rows)'}"


def _vehicles(found: "FleetDiagnosis") -> list[Part]:
    named = found.named
    rows = [
        (
            one.vehicle if first else "",
            finding.name,
            _size(finding),
            f"{finding.p_value:.1g}",
            _gain(finding),
            f"{finding.showing} of {finding.units}",
            ", ".join(finding.rivals) or "-",
        )
        for one in named[:MOST_VEHICLES]
        for first, finding in _numbered(one.findings)
    ]
    parts: list[Part] = []
    if rows:
        note = (
            "Size ± standard error; p-value with all effects counted; gain: fall of the RMSE of "
            "the adhesion on the vehicle's recordings that had no part in the size; units: those "
            "that show it by themselves. A radius comes from coasting. At most "
            f"{100 * found.false_discovery_rate:g} % of such vehicles are expected to be wrong. "
            + _left_out(len(named), MOST_VEHICLES, "vehicles")
        )
        caption = "Vehicles that differ from the others, the worst first."
        parts.append(Table(caption, VEHICLE_COLUMNS, rows, note, sentence_columns=(1, 6)))
    else:
        parts.append(Text("No vehicle has a finding."))
    failing = [one for one in found.vehicles if one.failed and not one.findings]
    if failing:
        failures = [
            (one.vehicle, f"{one.failed} of {one.units}", one.reasons[0] if one.reasons else "-")
            for one in failing[:MOST_ROWS]
        ]
        note = _left_out(len(failing), MOST_ROWS, "vehicles")
        caption = "Vehicles without a finding whose recordings failed or cannot be used."
        columns = ("vehicle", "recordings", "reason")
        parts.append(Table(caption, columns, failures, note, sentence_columns=(2,)))
    clean = len(found.vehicles) - len(named) - len(failing)
    parts.append(Text(f"Nothing is named on the other {clean} vehicles."))
    return parts


def _numbered(findings: "Sequence[Finding]") -> "list[tuple[bool, Finding]]":
    return [(place == 0, finding) for place, finding in enumerate(findings)]


def _left_out(count: int, shown: int, what: str) -> str:
    return f"{count - shown} further {what} are not shown; all are in fleet.json." * (count > shown)


def _shared(found: "FleetDiagnosis") -> list[Part]:
    if not found.shared:
        return [
            Text(
                "No effect is there on most vehicles, and none differs by line or by day: what the "
                "model gets wrong, where it does, belongs to single vehicles."
            )
        ]
    rows = [
        (_owner(one), one.name, _size(one), f"{one.p_value:.1g}", _gain(one),
         f"{one.showing} of {one.units}")
        for one in found.shared[:MOST_ROWS]
    ]  # fmt: skip
    note = (
        "An effect of all vehicles belongs to the model; one of a line or a day shows on whatever "
        f"vehicle was there. The probability of any wrong row is {100 * found.alpha:g} % for each "
        "of the three. " + _left_out(len(found.shared), MOST_ROWS, "findings")
    )
    caption = "Effects that several vehicles share."
    return [Table(caption, SHARED_COLUMNS, rows, note, sentence_columns=(1,))]


def _adhesion(estimates: "Sequence[PlaceEstimate]") -> list[Part]:
    if not estimates:
        return [Text("No segment has a peak that is known within 10 %.")]
    by_line: dict[str, list[PlaceEstimate]] = defaultdict(list)
    for one in estimates:
        by_line[one.line].append(one)
    lines = sorted(by_line, key=lambda line: -sum(one.segments for one in by_line[line]))
    shown = lines[:MOST_LINES]
    parts: list[Part] = []
    if any(one.day for one in estimates):
        parts.append(_by_day({line: by_line[line] for line in sorted(shown)}, len(lines)))
    rows = [
        (
            one.line or "not known",
            one.day or "not known",
            f"{one.median:.3f}",
            f"{one.low:.3f} to {one.high:.3f}",
            str(one.segments),
            str(one.vehicles),
        )
        for one in sorted(estimates, key=lambda one: one.median)[:MOST_ROWS]
    ]
    left = _left_out(len(estimates), MOST_ROWS, "lines and days")
    columns = ("line", "day", "μ_max", "middle half", "segments", "vehicles")
    caption = "Median of μ_max over the segments of a line and day, the lowest first."
    note = f"Segments whose μ_max is known within 10 %. {left}"
    parts.append(Table(caption, columns, rows, note, sentence_columns=(1,)))
    return parts


def _by_day(by_line: "Mapping[str, Sequence[PlaceEstimate]]", lines: int) -> Figure:
    data: list[Trace] = []
    for number, (line, own) in enumerate(by_line.items()):
        dated = [one for one in own if one.day]
        if not dated:
            continue
        data.append(
            {
                "type": "scatter",
                "mode": "lines+markers",
                "name": line or "line not known",
                "x": [one.day for one in dated],
                "y": [one.median for one in dated],
                "error_y": {
                    "type": "data",
                    "symmetric": False,
                    "array": [one.high - one.median for one in dated],
                    "arrayminus": [one.median - one.low for one in dated],
                    "thickness": 1,
                    "width": 3,
                },
                "marker": {"color": COLOURS[number % len(COLOURS)], "size": 8,
                           "symbol": SYMBOLS[number % len(SYMBOLS)]},
                "line": {"color": COLOURS[number % len(COLOURS)], "width": 1.2,
                         "dash": "solid" if number < len(COLOURS) else "dot"},
            }
        )  # fmt: skip
    left = f" {lines - len(by_line)} lines with fewer segments are left out." * (
        lines > len(by_line)
    )
    caption = (
        "Largest adhesion μ_max by day: median of the segments of a line, with the middle half as "
        f"a bar.{left}"
    )
    layout = {
        "xaxis": {
            "title": {"text": "day"},
            "type": "category",
            "categoryorder": "category ascending",
        },
        "yaxis": {"title": {"text": "μ_max"}, "rangemode": "tozero"},
        "showlegend": True,
    }
    return Figure(caption, data, layout, 380, "adhesion-by-day")


def _map(overview: "FleetOverview") -> list[Part]:
    points = overview.positions
    if not len(points):
        return [
            Text("No position is known: a TABLE has it as latitude_deg and longitude_deg, a list "
                 "of units as latitude and longitude.")
        ]  # fmt: skip
    longitude, latitude, mu = points.T
    low, high = (float(x) for x in np.quantile(mu, (0.02, 0.98)))
    wide = float(np.ptp(longitude)) * np.cos(np.radians(latitude.mean()))
    tall = float(np.ptp(latitude))
    room = 0.05 * max(wide, tall, 1e-3)
    data: list[Trace] = [
        {
            "type": "scatter",
            "mode": "markers",
            "name": "μ_max of a segment",
            "x": longitude,
            "y": latitude,
            "marker": {
                "color": mu,
                "colorscale": "Cividis",
                "cmin": low,
                "cmax": max(high, low + 1e-3),
                "size": 7,
                "colorbar": {"title": {"text": "μ_max"}, "thickness": 12, "len": 0.9},
            },
            "customdata": mu,
            "hovertemplate": "%{y:.4f}° N, %{x:.4f}° E<br>μ_max %{customdata:.3f}<extra></extra>",
        }
    ]
    ratio = 1.0 / max(float(np.cos(np.radians(latitude.mean()))), 0.05)
    layout = {
        "xaxis": {"title": {"text": "longitude, °"}, "constrain": "domain"},
        "yaxis": {
            "title": {"text": "latitude, °"},
            "scaleanchor": "x",
            "scaleratio": ratio,
            "range": [float(latitude.min() - room), float(latitude.max() + room)],
        },
        "showlegend": False,
        "hovermode": "closest",
    }
    left = (
        f" {len(points)} of {overview.located} segments are drawn."
        if overview.located > len(points)
        else ""
    )
    caption = (
        f"Largest adhesion μ_max where it was measured, north up, to scale; yellow is high.{left}"
    )
    return [Figure(caption, data, layout, MAP_HEIGHT, "map")]


def _failures(overview: "FleetOverview") -> list[Part]:
    if not overview.failed:
        return [Text("No recording failed.")]
    counts = Counter(_kind(one.reason) for one in overview.failures)
    rows = [(one.unit, one.vehicle, one.reason) for one in overview.failures[:MOST_ROWS]]
    note = _left_out(overview.failed, MOST_ROWS, "recordings").replace(
        "fleet.json", "the table units"
    )
    caption = "Recordings that failed, with the reason."
    kinds = "; ".join(f"{reason}: {count}" for reason, count in counts.most_common(5))
    return [
        Text(f"{overview.failed} recordings failed. The reasons met most: {kinds}."),
        Table(caption, ("recording", "vehicle", "reason"), rows, note, sentence_columns=(0, 1, 2)),
    ]


def _kind(reason: str) -> str:
    """A reason without the name of the file, which begins it."""
    return reason.split(": ", 1)[-1][:120]
