"""Parts of figures: panels one under the other, axes, colours and lines, as Plotly's JSON."""

from collections.abc import Mapping, Sequence
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from adhesion_can.arrays import Array

Trace = dict[str, Any]

AT_MOST = 4000
"""Largest number of points of a line: a few for each column of pixels."""

MARGINS = 78
"""Height of the margins above and below the panels of a figure, px."""

MAX_STEPS = 5.0
"""Longest distance between joined points of a line, in median steps of its abscissa."""

DARK = "#1b2430"
"""Colour of lines that show the truth or a bound."""
BLUE, ORANGE, GREY = "#0b5fa5", "#d55e00", "#8a95a3"
GREEN, RED = "#2e8b57", "#b03a5b"
"""Colours of the figures of all pages, which stand out from light paper by 3 : 1."""


def scatter(mode: str, name: str, x: Any, y: Any, **rest: Any) -> Trace:
    """Trace of lines, of markers or of both."""
    return {"type": "scatter", "mode": mode, "name": name, "x": x, "y": y, **rest}


def whiskers(length: Any, below: Any = None, **style: Any) -> Trace:
    """Error bars.

    Args:
        length: Lengths, and where `below` is given lengths of the upper halves.
        below: Lengths of the lower halves; None: both halves are alike.
        style: Colour, thickness and width.

    """
    if below is None:
        return {"type": "data", "array": length, **style}
    return {"type": "data", "symmetric": False, "array": length, "arrayminus": below, **style}


def peak_mark(
    name: str,
    lambda_m: tuple[float, float | None],
    mu_max: tuple[float, float | None],
    colours: tuple[str, str],
    **rest: Any,
) -> Trace:
    """A diamond at the peak of a curve, with whiskers of its standard deviations.

    Args:
        name: Name of the trace.
        lambda_m: Slip ratio of the peak, and its standard deviation where it is known.
        mu_max: Adhesion at the peak, and its standard deviation where it is known.
        colours: Colours of the diamond and of the whiskers.
        rest: Further entries of the trace.

    """

    def bars(std: float | None) -> Trace:
        known = std if std is not None and np.isfinite(std) else 0.0
        return whiskers([known], color=colours[1], thickness=1.4, width=4)

    return scatter(
        "markers",
        name,
        [lambda_m[0]],
        [mu_max[0]],
        **rest,
        error_x=bars(lambda_m[1]),
        error_y=bars(mu_max[1]),
        marker={"color": colours[0], "size": 10, "symbol": "diamond"},
    )


def axis(title: str, **rest: Any) -> Trace:
    """Axis with a title."""
    return {"title": {"text": title}, **rest}


def suffix(row: int) -> str:
    """Suffix of the names of a panel's axes in Plotly; the first panel is row 0."""
    return "" if row == 0 else str(row + 1)


def place(row: int) -> Trace:
    """Axes of a trace in a panel."""
    return {"xaxis": f"x{suffix(row)}", "yaxis": f"y{suffix(row)}"}


def domains(
    count: int, height: int, gap: int, weights: Sequence[float] | None = None
) -> list[list[float]]:
    """Vertical extents of panels one under the other, `gap` px apart, as shares of the height.

    Args:
        count: Number of panels.
        height: Height of the figure, px.
        gap: Distance between two panels, px.
        weights: Heights of the panels relative to each other; None: all are alike.

    """
    space = gap / (height - MARGINS)
    shares = np.ones(count) if weights is None else np.asarray(weights, dtype=np.float64)
    heights = (1.0 - space * (count - 1)) * shares / shares.sum()
    tops = 1.0 - np.concatenate([[0.0], np.cumsum(heights + space)[:-1]])
    pairs = zip(tops.tolist(), heights.tolist(), strict=True)
    return [[max(top - panel_height, 0.0), min(top, 1.0)] for top, panel_height in pairs]


def vertical_line(x: float, row: int, dash: str) -> Trace:
    """Vertical line through a whole panel."""
    line = {"color": DARK, "width": 1.2, "dash": dash}
    refs = {"xref": f"x{suffix(row)}", "yref": f"y{suffix(row)} domain"}
    return {"type": "line", **refs, "x0": x, "x1": x, "y0": 0, "y1": 1, "line": line}


def log_axis(numbers: Sequence[float]) -> Trace:
    """Logarithmic axis around the positive numbers, with ticks at 1, 2 and 5."""
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


def panel_layout(
    axes: Sequence[Mapping[str, Any]],
    title: str,
    height: int,
    weights: Sequence[float] | None = None,
) -> dict[str, Any]:
    """Layout of panels one under the other with a common abscissa.

    Args:
        axes: Ordinate of each panel.
        title: Title of the abscissa.
        height: Height of the figure, px.
        weights: Heights of the panels relative to each other; None: all are alike.

    """
    layout: dict[str, Any] = {}
    places = domains(len(axes), height, 22, weights)
    for row, (y, domain) in enumerate(zip(axes, places, strict=True)):
        axis_suffix, last = suffix(row), row + 1 == len(axes)
        layout[f"yaxis{axis_suffix}"] = {**y, "domain": domain}
        x = {"anchor": f"y{axis_suffix}", "showticklabels": last}
        x |= {"matches": "x"} if row else {}
        layout[f"xaxis{axis_suffix}"] = x | (axis(title) if last else {})
    return layout


def mean_and_interval(values: Array) -> Array:
    """Mean, 5 % and 95 % of the finite values of each column, shape (3, columns)."""
    out = np.full((3, values.shape[1]), np.nan)
    for k, column in enumerate(values.T):
        known = column[np.isfinite(column)]
        if len(known):
            out[:, k] = known.mean(), *np.quantile(known, (0.05, 0.95))
    return out


def value_range(spans: Sequence[Array], truth: Array) -> list[float]:
    """Range of an axis that shows the truth and all but the outermost percents of the series."""
    known = np.concatenate([span[np.isfinite(span)] for span in spans])
    low, high = np.quantile(known, (0.02, 0.98))
    low, high = min(low, truth.min()), max(high, truth.max())
    room = 0.06 * (high - low) or 0.1 * abs(high)
    return [float(low - room), float(high + room)]


def faded(colour: str) -> str:
    """Transparent colour of an area, from the '#rrggbb' of its line."""
    red, green, blue = (int(colour[k : k + 2], 16) for k in (1, 3, 5))
    return f"rgba({red},{green},{blue},0.13)"


def runs(rows: NDArray[np.bool_]) -> list[tuple[int, int]]:
    """First row, and the row after the last one, of each run of true values; shape (n,)."""
    edges = np.flatnonzero(np.diff(rows.astype(np.int8), prepend=0, append=0)).tolist()
    return list(zip(edges[::2], edges[1::2], strict=True))


def band(x: Array, lower: Array, upper: Array) -> tuple[Array, Array]:
    """Outline of the area between two series, for a trace that is filled to itself.

    Args:
        x: Abscissa, shape (n,).
        lower: Lower end, shape (n,); where one of the three is not finite the area is cut.
        upper: Upper end, shape (n,).

    Returns:
        Abscissa and ordinate, with NaN between one part of the area and the next.

    """
    known = np.isfinite(x) & np.isfinite(lower) & np.isfinite(upper)
    xs, ys = [np.empty(0)], [np.empty(0)]
    for first, end in runs(known):
        part = slice(first, end)
        gap = [np.nan] if len(xs) > 1 else []
        xs += [np.array(gap), x[part], x[part][::-1]]
        ys += [np.array(gap), upper[part], lower[part][::-1]]
    return np.concatenate(xs), np.concatenate(ys)


def thinned(x: Array, *ys: Array, at_most: int = AT_MOST) -> tuple[Array, ...]:
    """Series thinned for display: extremes and gaps are kept, in their order.

    The first and the last row are kept, and of each bin the rows in which a series is smallest and
    largest and one in which it has a gap.

    Args:
        x: Abscissa, shape (n,).
        ys: Series over the abscissa, shape (n,) each, at least one; not finite is a gap.
        at_most: Largest number of rows kept.

    Returns:
        `x` and `ys` in the rows kept.

    """
    if len(x) <= at_most:
        return (x, *ys)
    gaps = [~np.isfinite(y) for y in ys]
    a_bin = sum(2 + bool(gap.any()) for gap in gaps)
    if not a_bin or at_most < 2 + a_bin:
        raise ValueError(f"{len(ys)} series do not fit into {at_most} rows")
    kept = {0, len(x) - 1}
    edges = np.linspace(0, len(x), (at_most - 2) // a_bin + 1).astype(int).tolist()
    for first, last in pairwise(edges):
        for y, gap in zip(ys, gaps, strict=True):
            known = np.flatnonzero(~gap[first:last])
            if len(known):
                part = y[first:last][known]
                kept |= {first + int(known[part.argmin()]), first + int(known[part.argmax()])}
            if len(known) < last - first:
                kept.add(first + int(gap[first:last].argmax()))
    rows_kept = np.array(sorted(kept))
    return tuple(series[rows_kept] for series in (x, *ys))


def insert_gaps(x: Array, *ys: Array, longest: float | None = None) -> tuple[Array, ...]:
    """Series with a gap inserted wherever the abscissa jumps.

    Args:
        x: Abscissa, ascending, shape (n,).
        ys: Series over the abscissa, shape (n,) each.
        longest: Longest distance between joined points; None for `MAX_STEPS` median steps.

    Returns:
        `x` and `ys`, a row longer for each gap.

    """
    step = np.diff(x)
    if not len(step):
        return (x, *ys)
    longest = MAX_STEPS * float(np.median(step)) if longest is None else longest
    after = np.flatnonzero(step > longest) + 1
    between = (x[after - 1] + x[after]) / 2
    return (np.insert(x, after, between), *(np.insert(y, after, np.nan) for y in ys))
