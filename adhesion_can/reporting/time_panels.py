"""Panels over one abscissa, read by one cursor: the figures of a drive over time or distance."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from adhesion_can.arrays import Array
from adhesion_can.reporting.charts import MARGINS, Trace, axis, panel_layout, place, scatter
from adhesion_can.reporting.page import Figure

GAP = 22
"""Distance between two panels without a heading, px."""
AXLE_COLOURS = ("#0b5fa5", "#d55e00", "#2e8b57", "#b03a5b", "#8a6d00", "#6a4c93", "#0e7c86",
                "#7a4a1e")  # fmt: skip
"""Colours of the axles from the first on, which stand out from light paper by 3 : 1."""
DASHES = ("solid", "dash", "dot")
"""Dashes of the axles: another one for each round through the colours."""


@dataclass(frozen=True, slots=True)
class Panel:
    """A panel of a figure.

    Attributes:
        title: Quantity with its unit, the heading of the panel.
        traces: Traces of Plotly, without axes.
        axis: Ordinate, as Plotly has it.
        height: Height, px.

    """

    title: str
    traces: Sequence[Trace]
    axis: Mapping[str, Any] = field(default_factory=dict)
    height: float = 120.0


def axle_style(axle: int) -> dict[str, Any]:
    """Line of an axle, from 1 on."""
    turn, number = divmod(axle - 1, len(AXLE_COLOURS))
    return {"color": AXLE_COLOURS[number], "width": 1.3, "dash": DASHES[turn % len(DASHES)]}


def line(name: str, x: Array, y: Array, style: Mapping[str, Any], *, hold: bool = False) -> Trace:
    """A line of a panel.

    Args:
        name: Name in the heading of the panel.
        x: Abscissa, ascending, shape (n,).
        y: Ordinate, NaN for a gap, shape (n,).
        style: Colour, width and dash.
        hold: Whether a value holds until the next one.

    """
    shape = {"shape": "hv"} if hold else {}
    return scatter("lines", name, x, y, line={**style, **shape})


def span_line(
    name: str,
    spans: Sequence[tuple[int, int]],
    begins: Array,
    ends: Array,
    style: Mapping[str, Any],
) -> Trace:
    """Bar over spans in the row of its own name, on an axis of categories.

    Args:
        name: Name of the row.
        spans: First row of the data and the row after the last one, of each span.
        begins: Abscissa at which each row of the data begins, shape (n,).
        ends: Abscissa at which each row of the data ends, shape (n,).
        style: Colour and width.

    """
    x = [v for first, end in spans for v in (begins[first], ends[end - 1], None)]
    y = [v for _ in spans for v in (name, name, None)]
    return scatter("lines", name, x or [None], y or [name], line=style, showlegend=False)


def panels_figure(
    caption: str,
    panels: Sequence[Panel],
    abscissa: str,
    name: str,
    marks: Mapping[str, Any] | None = None,
) -> Figure:
    """Figure of panels one below the other.

    Args:
        caption: Content of the figure and how to read it.
        panels: Panels from the top to the bottom, at least one.
        abscissa: Title of the abscissa.
        name: Short name of the figure.
        marks: Shapes and annotations of Plotly's layout.

    """
    heights = [panel.height for panel in panels]
    height = round(sum(heights)) + GAP * (len(panels) - 1) + MARGINS
    axes = [{**panel.axis, **axis(panel.title)} for panel in panels]
    layout = panel_layout(axes, abscissa, height, heights) | dict(marks or {})
    data = [
        trace | place(row) | {"meta": panel.title}
        for row, panel in enumerate(panels)
        for trace in panel.traces
    ]
    return Figure(caption, data, layout, height, name, heights)
