"""Sizes on the page of a fleet: a forest plot of each cause, and what each recording says."""

from collections import defaultdict
from collections.abc import Sequence
from pathlib import PurePosixPath
from typing import NamedTuple

from adhesion_can.fleet.findings import FleetDiagnosis
from adhesion_can.fleet.page.words import (
    MOST_ROWS,
    format_value,
    left_out,
    owner,
    size_axis,
)
from adhesion_can.fleet.pooled_size import PooledSize, UnitSize
from adhesion_can.normal_quantiles import NORMAL_95
from adhesion_can.reporting.charts import (
    BLUE,
    DARK,
    GREEN,
    GREY,
    ORANGE,
    Trace,
    axis,
    scatter,
    whiskers,
)
from adhesion_can.reporting.page import Figure, Part, Table, Text

MOST_FIGURES, MOST_MARKS = 6, 36
"""Largest number of forest plots, and of rows of one."""
ROW_PX, ROOM_PX = 24, 110
"""Height of a row of a forest plot, and of the rest of the figure, px."""
LONGEST = 16
"""Largest number of characters of a name beside a forest plot."""
SOURCES = {
    "diagnosis": ("named by diagnose", BLUE, "circle"),
    "fit": ("fitted, not named", ORANGE, "square"),
    "first order": ("below 2 standard errors", GREY, "triangle-up"),
    "coasting": ("coasting", GREEN, "circle"),
}
"""Words, colour and symbol of each origin of a size."""
MEAN = "mean"
"""Origin of a row that is the mean of a vehicle."""
MARKS = {**SOURCES, MEAN: ("mean", DARK, "diamond")}
"""Words, colour and symbol of each origin of a row of a forest plot."""
COLUMNS = ("vehicle", "recording", "cause", "size", "origin")


class _Row(NamedTuple):
    """Row of a forest plot.

    Attributes:
        name: Name of the vehicle, and of its recording.
        value: Size.
        std: Standard error of it.
        origin: Key of `MARKS`.

    """

    name: str
    value: float
    std: float
    origin: str


def size_parts(diagnosis: FleetDiagnosis) -> list[Part]:
    """Forest plots of the causes, and the table of the recordings."""
    shared = [
        (owner(finding), finding.pooled)
        for finding in diagnosis.shared
        if finding.pooled is not None
    ]
    by_cause: dict[str, list[PooledSize]] = defaultdict(list)
    for size in _sizes_of_vehicles(diagnosis):
        by_cause[f"{size.name} {size.parameter}"].append(size)
    if not shared and not by_cause:
        return [Text("No recording has a size of a cause that was named.")]
    figures = [_shared_figure(whose, size) for whose, size in shared]
    figures += [_vehicles_figure(sizes) for sizes in by_cause.values()]
    parts: list[Part] = [*figures[:MOST_FIGURES]]
    if len(figures) > MOST_FIGURES:
        parts.append(Text(left_out(len(figures), MOST_FIGURES, "cause")))
    rows = [
        (
            unit_size.vehicle,
            _recording(unit_size),
            size.name,
            f"{size.parameter} {format_value(size, unit_size.value, unit_size.std)}",
            SOURCES[unit_size.source][0],
        )
        for sizes in by_cause.values()
        for size in sizes
        for unit_size in size.sizes
    ]
    if rows:
        parts.append(
            Table(
                "Size of each cause in each recording of the vehicles that have it.",
                COLUMNS,
                rows[:MOST_ROWS],
                NOTE + left_out(len(rows), MOST_ROWS, "size"),
                sentence_columns=(1, 2, 4),
            )
        )
    return parts


NOTE = (
    "Size ± standard error. Named by diagnose: as 'adhesion-can diagnose' finds it in this "
    "recording. Fitted, not named: this recording alone does not name the cause; it is fitted "
    "alone next to the adhesion curve. Below 2 standard errors: too small in this recording to be "
    "fitted, estimated to first order. Coasting: as 'adhesion-can calibrate' finds the radius. "
)


def _sizes_of_vehicles(diagnosis: FleetDiagnosis) -> "list[PooledSize]":
    """Sizes of findings of vehicles, then of causes that recordings name by themselves."""
    sizes = [
        finding.pooled
        for vehicle in diagnosis.named
        for finding in vehicle.findings
        if finding.pooled is not None
    ]
    return sizes + [
        size
        for vehicle in diagnosis.vehicles
        for size in vehicle.cause_sizes
        if size.effect in vehicle.causes_alone
    ]


def _recording(size: UnitSize) -> str:
    """The end of a recording's path or URL: its folder and its name."""
    parts = PurePosixPath(size.recording.partition("?")[0]).parts
    return "/".join(parts[-2:]) or size.unit_id


def _vehicles_figure(sizes: Sequence[PooledSize]) -> Figure:
    """Forest plot of a cause: each recording of the vehicles that have it, and their means."""
    rows: list[_Row] = []
    for size in sizes:
        for vehicle, (mean, unit_sizes) in size.by_vehicle.items():
            rows += [
                _Row(f"{_cut(vehicle)} {_cut(_recording(unit_size).rsplit('/', 1)[-1])}",
                     unit_size.value, unit_size.std, unit_size.source) for unit_size in unit_sizes
            ]  # fmt: skip
            rows.append(_Row(f"<b>{_cut(vehicle)}</b>", mean.value, mean.std, MEAN))
    caption = (
        f"{sizes[0].name} in each recording of the vehicles that have it, with 95 % intervals. "
        "Diamond: mean of a vehicle"
    )
    return _forest(caption, rows, sizes[0], sizes[0] if len(sizes) == 1 else None)


def _shared_figure(whose: str, size: PooledSize) -> Figure:
    """Forest plot of an effect that vehicles share: the mean of each vehicle."""
    rows = [
        _Row(_cut(vehicle), mean.value, mean.std, MEAN)
        for vehicle, (mean, _) in size.by_vehicle.items()
    ]
    caption = (
        f"{whose}: {size.name} on each vehicle, with 95 % intervals. Diamond: mean of a vehicle"
    )
    return _forest(caption, rows, size, size)


def _forest(
    caption: str, rows: Sequence[_Row], size: PooledSize, pooled: PooledSize | None
) -> Figure:
    """Forest plot; a band where the rows have one pooled size.

    Args:
        caption: Content of the figure.
        rows: Rows from the top.
        size: Size whose effect, parameter and unit the axis has.
        pooled: Size of the band; None: there is none.

    """
    shown = rows[:MOST_MARKS]
    factor, title = size_axis(size)
    data: list[Trace] = []
    for origin in dict.fromkeys(row.origin for row in shown):
        name, colour, symbol = MARKS[origin]
        placed_rows = [(place, row) for place, row in enumerate(shown) if row.origin == origin]
        half = [factor * NORMAL_95 * row.std for _, row in placed_rows]
        data.append(
            scatter(
                "markers",
                name,
                [factor * row.value for _, row in placed_rows],
                [place for place, _ in placed_rows],
                customdata=[row.name for _, row in placed_rows],
                hovertemplate="%{customdata}<br>%{x:.5g} ± %{error_x.array:.2g}<extra></extra>",
                error_x=whiskers(half, color=colour, thickness=1.6, width=4),
                marker={"color": colour, "size": 11 if origin == MEAN else 8, "symbol": symbol},
            )
        )
    shapes = [] if pooled is None else _band(factor, pooled)
    layout = {
        "xaxis": axis(title, nticks=6, exponentformat="e"),
        "yaxis": {
            "tickvals": list(range(len(shown))),
            "ticktext": [row.name for row in shown],
            "range": [len(shown) - 0.4, -0.6],
            "automargin": True,
            "showgrid": False,
            "zeroline": False,
        },
        "shapes": shapes,
        "showlegend": True,
        "hovermode": "closest",
    }
    more = left_out(len(rows), MOST_MARKS, "row")
    band = "; band: the mean with its 95 % interval" * (pooled is not None)
    text = f"{caption}{band}. {more}".strip()
    return Figure(text, data, layout, ROOM_PX + ROW_PX * len(shown), f"sizes-{size.effect}")


def _band(factor: float, pooled: PooledSize) -> list[Trace]:
    """Vertical band of a mean with its 95 % interval, and a line at the mean."""
    half = NORMAL_95 * pooled.std
    span = {"xref": "x", "yref": "y domain", "y0": 0, "y1": 1, "layer": "below"}
    low, high = (factor * (pooled.value + sign * half) for sign in (-1.0, 1.0))
    middle = factor * pooled.value
    return [
        {"type": "rect", **span, "x0": low, "x1": high, "fillcolor": BLUE, "opacity": 0.15,
         "line": {"width": 0}},
        {"type": "line", **span, "x0": middle, "x1": middle,
         "line": {"color": BLUE, "width": 1.2, "dash": "dot"}},
    ]  # fmt: skip


def _cut(name: str) -> str:
    """A name short enough to stand beside a figure."""
    return name if len(name) <= LONGEST else f"{name[: LONGEST - 1]}…"
