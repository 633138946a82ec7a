"""Adhesion on the page of a fleet: by line and day, and on a map."""

from collections import defaultdict
from collections.abc import Mapping, Sequence

import numpy as np

from adhesion_can.fleet.overview import FleetOverview, PlaceEstimate
from adhesion_can.fleet.page.words import MOST_ROWS, left_out
from adhesion_can.reporting.charts import (
    BLUE,
    GREEN,
    ORANGE,
    RED,
    Trace,
    axis,
    scatter,
    whiskers,
)
from adhesion_can.reporting.page import Figure, Part, Table, Text

MOST_LINES = 8
"""Largest number of lines that are drawn, those with the most segments."""
COLOURS = (BLUE, ORANGE, GREEN, RED)
SYMBOLS = ("circle", "square", "diamond", "triangle-up", "cross", "x", "star", "triangle-down")
MAP_HEIGHT = 520
"""Height of the map, px."""


def adhesion_parts(estimates: Sequence[PlaceEstimate]) -> list[Part]:
    """Figure by day and table of the lines and days."""
    if not estimates:
        return [Text("No surface has a peak known within 10 %.")]
    by_line: dict[str, list[PlaceEstimate]] = defaultdict(list)
    for estimate in estimates:
        by_line[estimate.line].append(estimate)
    lines = sorted(by_line, key=lambda line: -sum(estimate.segments for estimate in by_line[line]))
    shown = lines[:MOST_LINES]
    parts: list[Part] = []
    if any(estimate.day for estimate in estimates):
        parts.append(_by_day({line: by_line[line] for line in sorted(shown)}, len(lines)))
    rows = [
        (
            estimate.line or "not known",
            estimate.day or "not known",
            f"{estimate.median:.3f}",
            f"{estimate.low:.3f} to {estimate.high:.3f}",
            str(estimate.segments),
            str(estimate.vehicles),
        )
        for estimate in sorted(estimates, key=lambda estimate: estimate.median)[:MOST_ROWS]
    ]
    left = left_out(len(estimates), MOST_ROWS, "pair of line and day")
    columns = ("line", "day", "μ_max", "middle half", "surfaces", "vehicles")
    caption = "Median of μ_max over the surfaces of a line and day, the lowest first."
    note = f"Surfaces whose μ_max is known within 10 %. {left}"
    parts.append(Table(caption, columns, rows, note, sentence_columns=(1,)))
    return parts


def _by_day(by_line: Mapping[str, Sequence[PlaceEstimate]], lines: int) -> Figure:
    data: list[Trace] = []
    for number, (line, of_line) in enumerate(by_line.items()):
        dated = [estimate for estimate in of_line if estimate.day]
        if not dated:
            continue
        colour, symbol = COLOURS[number % len(COLOURS)], SYMBOLS[number % len(SYMBOLS)]
        dash = "solid" if number < len(COLOURS) else "dot"
        half = whiskers(
            [estimate.high - estimate.median for estimate in dated],
            [estimate.median - estimate.low for estimate in dated],
            thickness=1,
            width=3,
        )
        data.append(
            scatter(
                "lines+markers",
                line or "line not known",
                [estimate.day for estimate in dated],
                [estimate.median for estimate in dated],
                error_y=half,
                marker={"color": colour, "size": 8, "symbol": symbol},
                line={"color": colour, "width": 1.2, "dash": dash},
            )
        )
    left = f" Lines not shown, with fewer surfaces: {lines - len(by_line)}." * (
        lines > len(by_line)
    )
    caption = (
        "Largest adhesion μ_max by day: median of the surfaces of a line, with the middle half as "
        f"a bar.{left}"
    )
    layout = {
        "xaxis": axis("day", type="category", categoryorder="category ascending"),
        "yaxis": axis("μ_max", rangemode="tozero"),
        "showlegend": True,
    }
    return Figure(caption, data, layout, 380, "adhesion-by-day")


def map_parts(overview: FleetOverview) -> list[Part]:
    """Map of the surfaces with a position."""
    points = overview.positions
    if not len(points):
        return [
            Text(
                "No position is known. Give it in a TABLE as latitude_deg and longitude_deg, or "
                "in a list of units as latitude and longitude.")
        ]  # fmt: skip
    longitude, latitude, mu = points.T
    low, high = (float(x) for x in np.quantile(mu, (0.02, 0.98)))
    wide = float(np.ptp(longitude)) * np.cos(np.radians(latitude.mean()))
    tall = float(np.ptp(latitude))
    room = 0.05 * max(wide, tall, 1e-3)
    marker = {
        "color": mu,
        "colorscale": "Cividis",
        "cmin": low,
        "cmax": max(high, low + 1e-3),
        "size": 7,
        "colorbar": axis("μ_max", thickness=12, len=0.9),
    }
    hover = "%{y:.4f}° N, %{x:.4f}° E<br>μ_max %{customdata:.3f}<extra></extra>"
    surfaces = scatter(
        "markers", "μ_max of a surface", longitude, latitude,
        marker=marker, customdata=mu, hovertemplate=hover,
    )  # fmt: skip
    ratio = 1.0 / max(float(np.cos(np.radians(latitude.mean()))), 0.05)
    layout = {
        "xaxis": axis("longitude, °", constrain="domain"),
        "yaxis": axis(
            "latitude, °",
            scaleanchor="x",
            scaleratio=ratio,
            range=[float(latitude.min() - room), float(latitude.max() + room)],
        ),
        "showlegend": False,
        "hovermode": "closest",
    }
    left = (
        f" {len(points)} of {overview.located} surfaces shown."
        if overview.located > len(points)
        else ""
    )
    caption = (
        f"Largest adhesion μ_max where it was measured, north up, to scale; yellow is high.{left}"
    )
    return [Figure(caption, [surfaces], layout, MAP_HEIGHT, "map")]
