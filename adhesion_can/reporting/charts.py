"""What figures are made of: panels one under the other, axes, colours, as Plotly's JSON."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from adhesion_can.physics.burckhardt import Array

Trace = dict[str, Any]

MARGINS = 78
"""Of a figure's height, above and below its panels, px."""

DARK = "#1b2430"
"""Of truth and bounds."""


def suffix(row: int) -> str:
    """What Plotly writes behind the names of a panel's axes; the first panel is row 0."""
    return "" if row == 0 else str(row + 1)


def place(row: int) -> Trace:
    """Puts a trace into a panel."""
    return {"xaxis": f"x{suffix(row)}", "yaxis": f"y{suffix(row)}"}


def domains(count: int, height: int, gap: int) -> list[list[float]]:
    """Shares of a figure's height that panels one under the other take, `gap` px apart."""
    space = gap / (height - MARGINS)
    each = (1.0 - space * (count - 1)) / count
    bottoms = (max((count - 1 - row) * (each + space), 0.0) for row in range(count))
    return [[bottom, min(bottom + each, 1.0)] for bottom in bottoms]


def upright(x: float, row: int, dash: str) -> Trace:
    """A line through a whole panel at one abscissa."""
    line = {"color": DARK, "width": 1.2, "dash": dash}
    refs = {"xref": f"x{suffix(row)}", "yref": f"y{suffix(row)} domain"}
    return {"type": "line", **refs, "x0": x, "x1": x, "y0": 0, "y1": 1, "line": line}


def log_axis(numbers: Sequence[float]) -> Trace:
    """A logarithmic axis about those of the numbers that it can show, ticks at 1, 2 and 5."""
    shown = [x for x in numbers if np.isfinite(x) and x > 0]
    if not shown:
        return {"type": "log"}
    low, high = np.log10(min(shown)), np.log10(max(shown))
    room = max(0.06 * (high - low), 0.35 - 0.5 * (high - low))
    low, high = low - room, high + room
    decades = range(int(np.floor(low)), int(np.ceil(high)) + 1)
    steps = (1, 2, 5) if high - low < 2.5 else (1,)
    ticks = [step * 10.0**k for k in decades for step in steps]
    texts = [np.format_float_positional(tick, trim="-", precision=9) for tick in ticks]
    return {"type": "log", "range": [low, high], "tickvals": ticks, "ticktext": texts}


def rows(axes: Sequence[Mapping[str, Any]], title: str, height: int) -> dict[str, Any]:
    """Layout of panels one under the other on one abscissa."""
    layout: dict[str, Any] = {}
    for row, (y, domain) in enumerate(zip(axes, domains(len(axes), height, gap=22), strict=True)):
        own, last = suffix(row), row + 1 == len(axes)
        layout[f"yaxis{own}"] = {**y, "domain": domain}
        x = {"anchor": f"y{own}", "showticklabels": last}
        x |= {"matches": "x"} if row else {}
        layout[f"xaxis{own}"] = x | ({"title": {"text": title}} if last else {})
    return layout


def spread(values: Array) -> Array:
    """Mean, 5 % and 95 % of the finite values of each column, shape (3, columns)."""
    out = np.full((3, values.shape[1]), np.nan)
    for k, column in enumerate(values.T):
        known = column[np.isfinite(column)]
        if len(known):
            out[:, k] = known.mean(), *np.quantile(known, (0.05, 0.95))
    return out


def value_range(spans: Sequence[Array], truth: Array) -> list[float]:
    """Range of an axis: what is shown from the begin, but for its outermost percents."""
    known = np.concatenate([span[np.isfinite(span)] for span in spans])
    low, high = np.quantile(known, (0.02, 0.98))
    low, high = min(low, truth.min()), max(high, truth.max())
    room = 0.06 * (high - low) or 0.1 * abs(high)
    return [float(low - room), float(high + room)]


def faded(colour: str) -> str:
    """A colour for an area, from the '#rrggbb' of its line."""
    red, green, blue = (int(colour[k : k + 2], 16) for k in (1, 3, 5))
    return f"rgba({red},{green},{blue},0.13)"
