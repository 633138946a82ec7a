"""Page of a check, and the tables that it shares with the terminal."""

from collections.abc import Iterator, Mapping, Sequence

import numpy as np

from adhesion_can.config import Configuration
from adhesion_can.offline.check import CheckResult
from adhesion_can.offline.check_table import TableCheck
from adhesion_can.offline.compare_noise import ComparedNoise
from adhesion_can.offline.fault_history import FaultHistory
from adhesion_can.physics.samples import Samples
from adhesion_can.reporting.charts import (
    BLUE,
    GREY,
    ORANGE,
    RED,
    Trace,
    axis,
    panel_layout,
    place,
    scatter,
)
from adhesion_can.reporting.check_words import KINDS, NOISE_NOTE, WRONG, Checked, verdict
from adhesion_can.reporting.data_quality import quality_parts
from adhesion_can.reporting.drive.signal_panels import SIGNAL_COLUMNS, SignalPanels, signal_panels
from adhesion_can.reporting.page import Figure, Items, Page, Part, Table, Text
from adhesion_can.reporting.time_panels import Panel, panels_figure
from adhesion_can.reporting.time_panels import line as trace_line
from adhesion_can.result_text import TimeScale

NOISE_COLUMNS = ("sensor", "estimated", "configured", "unit", "correlation time")
COLUMN_COLUMNS = ("column", "lowest", "highest", "empty", "taken for")
MOST_POINTS = 4000
"""Largest number of samples that are drawn."""


def signal_rows(result: CheckResult) -> list[tuple[str, ...]]:
    """Cells of the table of signals, a row each."""
    return [
        (
            name,
            seen.unit,
            str(seen.readings),
            "-" if seen.readings == seen.not_available else f"{seen.lowest:.6g}",
            "-" if seen.readings == seen.not_available else f"{seen.highest:.6g}",
        )
        for name, seen in result.signals.items()
        if seen.readings
    ]


def column_rows(result: TableCheck) -> list[tuple[str, ...]]:
    """Cells of the table of columns, a row each."""
    return [
        (
            column.name,
            "-" if column.lowest is None else f"{column.lowest:.6g}",
            "-" if column.highest is None else f"{column.highest:.6g}",
            str(column.missing),
            column.meaning,
        )
        for column in result.columns
    ]


def noise_row(compared: ComparedNoise) -> tuple[str, ...]:
    """Estimated and configured noise of a sensor, as text."""
    noise, lasts = compared.estimate, "not known"
    if noise.std is None:
        estimated = f"not known: {noise.reason}"
    elif noise.reason:
        estimated = f"below {noise.std_error:.3g}"
    else:
        estimated = f"{noise.std:.3g}"
    if noise.std is not None and noise.lasts_s is not None:
        lasts = f"{noise.lasts_s:.2g} s" if noise.lasts_s else f"0 (up to {noise.seen_s:.2g} s)"
    return compared.name, estimated, f"{compared.configured:.3g}", compared.unit, lasts


def recording_page(
    result: CheckResult, config: Configuration, provenance: Mapping[str, str]
) -> Page:
    """Build the page of the check of recordings."""
    counts = {
        "frames": result.frames,
        "frames with other ids": result.unknown,
        "frames stamped earlier than the previous frame": result.clamped,
        "samples": len(result.samples),
    }
    records = result.receiver.records
    sections: dict[str, list[Part]] = {
        **_findings([result]),
        "Signals and frames over time": [_over_time(result, config)],
        "Messages": quality_parts(records, counts, result.dropped, ()),
        "Signals": [Table("Range of each signal.", SIGNAL_COLUMNS, signal_rows(result))],
        "Excitation": _excitation(result.samples),
    }
    if result.noise:
        rows = [noise_row(compared) for compared in result.noise]
        caption = "Noise of the sensors, estimated from the readings, standard deviation."
        sections["Noise"] = [Table(caption, NOISE_COLUMNS, rows, f"{NOISE_NOTE}.")]
    lead = (
        f"{result.frames} frames in {result.duration_s:.1f} s, processed as the service would; "
        f"{len(result.samples)} samples of slip and adhesion."
    )
    begin = TimeScale.beginning_at(result.first_us).heading()
    return _page("Is this recording usable?", lead, [result], sections, provenance, begin)


def table_page(results: Sequence[TableCheck], provenance: Mapping[str, str]) -> Page:
    """Build the page of the check of tables of samples."""
    sections: dict[str, list[Part]] = _findings(results)
    for result in results:
        parts: list[Part] = [
            Table(f"Columns of {result.name}.", COLUMN_COLUMNS, column_rows(result),
                  sentence_columns=(4,))
        ]  # fmt: skip
        if result.samples is not None:
            parts += _excitation(result.samples)
        sections[result.name] = parts
    rows = sum(result.rows for result in results)
    lead = f"{rows} rows of {', '.join(result.name for result in results)}."
    return _page("Is this table usable?", lead, results, sections, provenance)


def _page(
    title: str,
    lead: str,
    results: Sequence[Checked],
    sections: Mapping[str, Sequence[Part]],
    provenance: Mapping[str, str],
    begin: str = "",
) -> Page:
    failures = WRONG.lines(results)
    said = verdict(results)
    return Page(
        title=title,
        lead=lead,
        verdict=[f"{said[0].upper()}{said[1:]}{':' if failures else '.'}", *failures],
        sections=sections,
        provenance=provenance,
        begin=begin,
    )


def _findings(results: Sequence[Checked]) -> dict[str, list[Part]]:
    """Section with the sentences of a check by their kind, but for those of the verdict."""
    parts: list[Part] = []
    for kind in KINDS:
        lines = kind.lines(results)
        if lines and kind is not WRONG:
            parts += [Text(f"{kind.tag} ({kind.meaning}):"), Items(lines)]
    return {"Findings": parts} if parts else {}


def _over_time(result: CheckResult, config: Configuration) -> Part:
    """Signals, and below them the frames that were accepted, rejected and lost."""
    times = TimeScale.beginning_at(result.first_us)
    signals = SignalPanels.none()
    if result.drive_signals is not None:
        signals = signal_panels(result.drive_signals, config, times.zero_us)
    panels = [*signals.panels, *_frame_panels(result.faults, times)]
    if not panels:
        return Text("There are no frames to show.")
    lost = result.faults.total("rejected") + result.faults.total("lost")
    caption = (
        f"{signals.caption} Frames of the configured messages are counted in spans of "
        f"{result.faults.width_us / 1e6:g} s. "
        + ("Some were rejected, or are missing according to their counters." if lost
           else "No frame was rejected, and no counter shows a missing one.")
    )  # fmt: skip
    return panels_figure(caption, panels, "time, s", "over-time")


def _frame_panels(faults: FaultHistory, times: TimeScale) -> Iterator[Panel]:
    """Frames per second: accepted ones, and where there are any the rejected and lost ones."""
    if faults.first_us is None:
        return
    since_s, rates = faults.rates()
    t_s = since_s + (faults.first_us - times.zero_us) / 1e6
    axis = {"rangemode": "tozero"}

    def rate(kind: str, colour: str) -> Trace:
        style = {"color": colour, "width": 1.5, "shape": "hvh"}
        return trace_line(kind, t_s, rates[kind], style)

    yield Panel("frames accepted, 1/s", [rate("accepted", BLUE)], axis, 70.0)
    if faults.total("rejected") + faults.total("lost"):
        faulty = [rate("rejected", RED), rate("lost", ORANGE)]
        yield Panel("frames rejected and lost, 1/s", faulty, axis, 70.0)


def _excitation(samples: Samples) -> list[Part]:
    """Histogram of the slips that were driven, and the samples themselves."""
    usable = np.isfinite(samples.slip) & np.isfinite(samples.adhesion)
    slip, adhesion = samples.slip[usable], samples.adhesion[usable]
    if not len(slip):
        return [Text("No sample could be formed, so there is no slip to show.")]
    low, high = np.quantile(slip, (0.001, 0.999))
    room = max(0.05 * float(high - low), 1e-4)
    edges = np.linspace(float(low) - room, float(high) + room, 81)
    counts, _ = np.histogram(slip, edges)
    bars = {"type": "bar", "name": "samples", "x": (edges[1:] + edges[:-1]) / 2, "y": counts,
            "marker": {"color": BLUE}}  # fmt: skip
    thin = slice(None, None, -(-len(slip) // MOST_POINTS))
    marker = {"color": GREY, "size": 3, "opacity": 0.45}
    points = scatter(
        "markers", "adhesion", slip[thin], adhesion[thin], hoverinfo="skip", marker=marker
    )
    tall = np.quantile(adhesion, (0.001, 0.999))
    space = max(0.08 * float(tall[1] - tall[0]), 1e-3)
    axes = [
        axis("samples", rangemode="tozero"),
        axis("adhesion μ", range=[float(tall[0]) - space, float(tall[1]) + space]),
    ]
    layout = panel_layout(axes, "slip ratio λ", 460, (1.0, 1.6)) | {"bargap": 0.05}
    for name in ("xaxis", "xaxis2"):
        layout[name]["range"] = [float(edges[0]), float(edges[-1])]
    drawn = len(slip[thin])
    caption = (
        f"Slip in the data: number of samples, and below the adhesion ({drawn} of {len(slip)} "
        "samples, evenly over time). A peak can be identified if the slip goes beyond it."
    )
    return [Figure(caption, [bars | place(0), points | place(1)], layout, 460, "excitation")]
