"""Figures of a drive: estimates and signals over time and distance, the curve of each surface."""

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from adhesion_can.arrays import Array
from adhesion_can.physics.burckhardt import adhesion
from adhesion_can.physics.doubt import DESCRIPTIONS, Doubt
from adhesion_can.physics.objection import Objection
from adhesion_can.physics.status import Status
from adhesion_can.reporting.charts import (
    BLUE,
    DARK,
    GREEN,
    GREY,
    ORANGE,
    RED,
    Trace,
    axis,
    band,
    faded,
    insert_gaps,
    peak_mark,
    runs,
    scatter,
    suffix,
)
from adhesion_can.reporting.drive.history import DOUBTS, STATUSES
from adhesion_can.reporting.drive.recorder import DriveRecord
from adhesion_can.reporting.drive.signal_panels import SignalPanels
from adhesion_can.reporting.drive.surfaces import SampleCloud, SurfaceSpan
from adhesion_can.reporting.page import Figure
from adhesion_can.reporting.time_panels import Panel, line, panels_figure, span_line
from adhesion_can.result_text import TimeScale, plus_minus

STATUS_COLOURS: Mapping[Status, str] = {
    Status.INIT: GREY,
    Status.TRACKING: GREEN,
    Status.LOW_EXCITATION: BLUE,
    Status.SURFACE_CHANGE: "#b8860b",
    Status.STALE_INPUT: ORANGE,
    Status.FAULT: RED,
}
"""Colour of each status; its name is next to it."""
KMH = 3.6
"""Kilometres per hour in a metre per second."""
MOST_LINES = 150
"""Number of surface changes beyond which they are not drawn as lines."""
FROM_KM = 2000.0
"""Distance from which a drive is shown in kilometres, m."""


def overview_figure(
    record: DriveRecord,
    truth: Sequence[Mapping[str, Any]] = (),
    signals: SignalPanels | None = None,
    *,
    over_distance: bool = False,
) -> Figure:
    """Estimates with their bands, signals, status and doubt over time or distance.

    Args:
        record: Drive as the service saw it.
        truth: Surfaces of a simulated drive, as the file of --truth has them.
        signals: Panels of the signals, over time alone; None: the vehicle speed alone is shown.
        over_distance: Whether distance is the abscissa; else time is.

    """
    scale = _Abscissa(record, over_distance=over_distance)
    with_signals = signals is not None and bool(signals.panels)
    panels = [*_estimate_panels(record, truth, scale, with_speed=not with_signals)]
    if signals is not None:
        panels += signals.panels
    rows = _state_rows(record, scale)
    axis = {"type": "category", "range": [len(rows) - 0.4, -0.6]}
    panels.append(Panel("status and doubt", rows, axis, 26.0 * max(len(rows), 1)))
    marks: dict[str, Any] = {"annotations": _names(truth, scale)}
    if len(record.surfaces) <= MOST_LINES:
        begins = np.array([s.from_us for s in record.surfaces[1:]], dtype=np.float64)
        marks["shapes"] = [
            {"type": "line", "xref": "x", "yref": f"y{suffix(row)} domain", "x0": at, "x1": at,
             "y0": 0, "y1": 1, "line": {"color": GREY, "width": 1, "dash": "dot"}}
            for at in scale.of(begins).tolist() for row in range(len(panels) - 1)
        ]  # fmt: skip
    where = "distance" if over_distance else "time"
    caption = (
        f"Estimates over {where}: maximum adhesion, its slip ratio, status and doubt. Dotted "
        f"lines: surface changes declared by the service. {_resolution(record)}"
    )
    if signals is not None and signals.panels:
        caption += f" Signals: {signals.caption[0].lower()}{signals.caption[1:]}"
    return panels_figure(caption, panels, scale.title, f"over-{where}", marks)


def _estimate_panels(
    record: DriveRecord,
    truth: Sequence[Mapping[str, Any]],
    scale: "_Abscissa",
    *,
    with_speed: bool,
) -> Iterator[Panel]:
    """Peak of the curve as it was sent, and the vehicle speed where it is asked for."""
    history = record.history
    t_s = (history.first_us + history.last_us) / 2e6
    at = scale.of(history.first_us / 2 + history.last_us / 2)
    columns = (at, *history.lowest.T, *history.highest.T, *history.lower.T, *history.upper.T)
    _, x, *rest = insert_gaps(t_s, *columns)
    lowest, highest, lower, upper = rest[:3], rest[3:6], rest[6:8], rest[8:10]
    for row, (title, name) in enumerate(
        (
            ("maximum adhesion μ<sub>max</sub>", "mu_max"),
            ("its slip ratio λ<sub>m</sub>", "lambda_m"),
        )
    ):
        bx, by = band(x, lower[row], upper[row])
        area = {"fill": "toself", "fillcolor": faded(BLUE), "hoverinfo": "skip"}
        traces = [line("95 % interval", bx, by, {"color": BLUE, "width": 0}) | area]
        style = {"color": BLUE, "width": 1.5}
        traces.append(line("estimate", *_envelope(x, lowest[row], highest[row]), style))
        if truth:
            traces.append(_true_line(truth, name, scale))
        highs = [highest[row], np.array([float(s[name]) for s in truth])]
        yield Panel(title, traces, {"range": [0.0, _top(highs)]}, 190.0)
    if with_speed:
        style = {"color": ORANGE, "width": 1.5}
        points = _envelope(x, KMH * lowest[2], KMH * highest[2])
        speed = line("vehicle", *points, style)
        yield Panel("vehicle speed, km/h", [speed], {"rangemode": "tozero"}, 110.0)


def _resolution(record: DriveRecord) -> str:
    count = len(record.history)
    total = record.counts.by_status.total()
    if total <= count:
        return "Every setpoint is drawn."
    return f"{total} setpoints are thinned to {count} points; extremes are kept."


class _Abscissa:
    """Time in s, or distance in m or km, at stamps of a drive."""

    def __init__(self, record: DriveRecord, *, over_distance: bool) -> None:
        times = TimeScale.beginning_at(record.first_us)
        self._zero_us = times.zero_us
        self._known: tuple[Array, Array] | None = None
        self.title = "time, s"
        if over_distance:
            in_km = record.distance >= FROM_KM
            self.title = "distance travelled, km" if in_km else "distance travelled, m"
            way = record.history.distance / (1000.0 if in_km else 1.0)
            self._known = record.history.last_us.astype(np.float64), way

    def of(self, t_us: Array) -> Array:
        """Abscissa at stamps, µs, shape (n,)."""
        if self._known is None:
            return np.asarray((t_us - self._zero_us) / 1e6)
        if not len(self._known[0]):
            return np.zeros(len(t_us))
        return np.interp(t_us, *self._known)


def _envelope(x: Array, low: Array, high: Array) -> tuple[Array, Array]:
    """A line through the smallest and the largest value of each bin."""
    if np.array_equal(low, high, equal_nan=True):
        return x, low
    return np.repeat(x, 2), np.column_stack([low, high]).ravel()


def _top(series: Sequence[Array]) -> float:
    """Upper end of an axis from 0: all but the outermost values, and some room."""
    values = np.concatenate(series)
    values = values[np.isfinite(values)]
    return 1.2 * float(np.quantile(values, 0.995)) if len(values) else 0.5


def _true_line(truth: Sequence[Mapping[str, Any]], name: str, scale: "_Abscissa") -> Trace:
    ends = np.array([[s["from_s"], s["to_s"]] for s in truth], dtype=np.float64)
    x = np.append(scale.of(1e6 * ends.ravel()).reshape(-1, 2), np.full((len(ends), 1), np.nan), 1)
    y = np.repeat([float(s[name]) for s in truth], 3)
    style = {"color": DARK, "width": 1.5, "dash": "dash"}
    return line("truth", x.ravel(), y, style)


def _names(truth: Sequence[Mapping[str, Any]], scale: _Abscissa) -> list[dict[str, Any]]:
    """Names of the true surfaces, at the top of the first panel."""
    middles = np.array([5e5 * (s["from_s"] + s["to_s"]) for s in truth], dtype=np.float64)
    return [
        {"x": x, "xref": "x", "y": 1.0, "yref": "y domain", "yanchor": "top",
         "text": str(surface["name"]), "showarrow": False}
        for x, surface in zip(scale.of(middles).tolist(), truth, strict=True)
    ]  # fmt: skip


def state_name(state: Status | Doubt | Objection) -> str:
    """Name of a status, doubt or objection in a text."""
    return state.name.lower().replace("_", " ")


def _state_rows(record: DriveRecord, scale: _Abscissa) -> list[Trace]:
    """Bar over the spans of each status and doubt that occurs."""
    history = record.history
    begins, ends = (scale.of(v.astype(np.float64)) for v in (history.first_us, history.last_us))
    states = [
        (state_name(status), STATUS_COLOURS[status], history.statuses[:, place])
        for place, status in enumerate(STATUSES)
    ]
    states += [
        (f"doubt: {state_name(doubt)}", ORANGE, history.doubts[:, place])
        for place, doubt in enumerate(DOUBTS)
        if doubt in DESCRIPTIONS
    ]
    rows: list[Trace] = []
    for name, colour, counts in states:
        spans = runs(counts > 0)
        if spans:
            rows.append(span_line(name, spans, begins, ends, {"color": colour, "width": 9}))
    return rows


# ------------------------------------------------------------------------------------- curves


def surface_figures(
    record: DriveRecord,
    shown: Sequence[SurfaceSpan],
    slip_max: float,
    truth: Sequence[Mapping[str, Any]] = (),
) -> list[Figure]:
    """Curve of each surface with its data.

    Args:
        record: Drive as the service saw it.
        shown: Surfaces to show.
        slip_max: Largest slip ratio that the estimator uses.
        truth: Surfaces of a simulated drive, as the file of --truth has them.

    """
    times = TimeScale.beginning_at(record.first_us)
    height = 300 if len(shown) > 1 else 420
    number = {id(surface): place for place, surface in enumerate(record.surfaces, start=1)}
    return [
        _curve_figure(surface, number[id(surface)], times, slip_max, truth, height)
        for surface in shown
    ]


def _curve_figure(
    surface: SurfaceSpan,
    number: int,
    times: TimeScale,
    slip_max: float,
    truth: Sequence[Mapping[str, Any]],
    height: int,
) -> Figure:
    out, cloud = surface.last, surface.cloud or SampleCloud.empty()
    slip = np.abs(cloud.slip)
    adhesions = cloud.adhesion * np.copysign(1.0, cloud.slip)
    driven = float(np.quantile(slip, 0.999)) if len(slip) else 0.1
    end = min(1.05 * max(driven, 1.3 * (out.setpoint.lambda_m or 0.0)), slip_max)
    grid = np.linspace(0.0, end, 161)
    data: list[Trace] = [
        scatter("markers", name, slip[rows], adhesions[rows],
                marker={"color": colour, "size": 4, "opacity": 0.45, "symbol": symbol},
                hoverinfo="skip")
        for name, colour, symbol, rows in (
            ("traction", GREY, "circle", cloud.slip >= 0),
            ("braking", ORANGE, "x", cloud.slip < 0),
        )
        if rows.any()
    ]  # fmt: skip
    end_s = surface.to_us / 1e6
    true = next((rail for rail in truth if rail["from_s"] < end_s <= rail["to_s"] + 0.1), None)
    if out.theta is not None:
        style = {"color": BLUE, "width": 2.4}
        data.append(line("last curve sent", grid, adhesion(grid, *out.theta), style))
    if true is not None:
        theta = (float(true[name]) for name in ("c1", "c2", "c3"))
        style = {"color": DARK, "width": 1.5, "dash": "dash"}
        data.append(line("truth", grid, adhesion(grid, *theta), style))
    point = out.setpoint
    if point.mu_max is not None and point.lambda_m is not None:
        peak = (point.lambda_m, out.lambda_m_std), (point.mu_max, out.mu_max_std)
        data.append(peak_mark("peak ± standard deviation", *peak, (BLUE, BLUE)))
    span = times.span(surface.from_us, surface.to_us).replace(" .. ", " to ")
    name = "" if true is None else f" ({true['name']})"
    caption = (
        f"Surface {number}{name}, {span} s: μ_max {plus_minus(point.mu_max, out.mu_max_std)}, "
        f"λ_m {plus_minus(point.lambda_m, out.lambda_m_std)}; {len(slip)} of {cloud.total} "
        "samples shown."
    )
    layout = {
        "xaxis": axis("slip ratio |λ|", range=[0.0, end]),
        "yaxis": axis("adhesion μ", range=_span(adhesions, point.mu_max)),
    }
    return Figure(caption, data, layout, height, f"surface-{number}")


def _span(values: Array, peak: float | None) -> list[float]:
    known = np.append(values, peak if peak is not None else 0.3)
    low, high = np.quantile(known, (0.005, 0.995))
    top = max(float(high), peak or 0.0)
    return [min(float(low), 0.0) - 0.04 * top, 1.12 * top]
