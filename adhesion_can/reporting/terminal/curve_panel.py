"""The identified curve with its band and the operating points, and the history of its peak."""

from collections.abc import Sequence
from math import isfinite

import numpy as np
from rich.text import Text

from adhesion_can.arrays import Array
from adhesion_can.monitoring.snapshot import (
    HistoryPoint,
    OperatingPoint,
    ServiceView,
    Snapshot,
)
from adhesion_can.normal_quantiles import NORMAL_95
from adhesion_can.physics.burckhardt import adhesion, adhesion_slope
from adhesion_can.physics.status import Status
from adhesion_can.reporting.terminal.boxes import boxed
from adhesion_can.reporting.terminal.canvas import DOTS_ACROSS, Canvas, nice_ceiling
from adhesion_can.reporting.terminal.words import STATUS_LETTERS, STATUS_STYLES

LABEL = 6
"""Width of the labels of an upright axis, cells, with the axis."""
CURVE, BAND, POINT, PEAK = "bold cyan", "blue", "white", "bold green"
TRUTH, SETPOINT = "bold red", "yellow"
LEGENDS = (
    "⣀ curve  ░ its 95 % band  ◆ peak  ┊ setpoint  · samples of 5 s  1-9 axles now",
    "⣀ curve  ░ 95 %  ◆ peak  ┊ setpoint  · samples  1-9 axles now",
    "░ 95 % ◆ peak ┊ set · sample 1-9 axles",
    "░95% ◆peak ┊set ·data 1-9 axle",
)
STATUS_LEGENDS = (
    "T tracking  l low excitation  C surface change  i init  s stale input  F fault",
    "T tracking  l low excitation  C change  i init  s stale  F fault",
    "letters: key ?",
)
"""Legends of the letters of the status; the widest that fits is shown."""
SHORT_STATUS = {
    "T": "T track",
    "l": "l low",
    "C": "C change",
    "i": "i init",
    "s": "s stale",
    "F": "F fault",
}
"""Legend of each letter where there is room for those on the screen alone."""
MOST_AXES = 9
"""Number of axles that a digit can mark."""


def curve_band(slip: Array, service: ServiceView) -> Array | None:
    """Half width of the 95 % band of the curve at slip ratios, same shape; None: not known.

    The messages carry the deviations of the peak alone. So the curve is stretched in μ and in λ
    as those of μ_max and λ_m allow, to first order, as if both erred independently:
    var μ = (μ/μ_max)² var μ_max + (μ′ λ/λ_m)² var λ_m.

    Args:
        slip: Slip ratios, not negative.
        service: Curve and deviations.

    """
    stds = (service.mu_max_std, service.lambda_m_std)
    if service.theta is None or not service.mu_max or not service.lambda_m:
        return None
    if stds[0] is None or stds[1] is None or not (isfinite(stds[0]) and isfinite(stds[1])):
        return None
    height = adhesion(slip, *service.theta) / service.mu_max * stds[0]
    place = adhesion_slope(slip, *service.theta) * slip / service.lambda_m * stds[1]
    return np.asarray(NORMAL_95 * np.hypot(height, place))


def curve_panel(snapshot: Snapshot, width: int, height: int) -> list[Text]:
    """Adhesion over slip ratio: curve, band, peak, setpoint, samples and axles."""
    service = snapshot.service
    columns, rows = width - 2 - LABEL, height - 4
    slip_end, adhesion_end = _ends(snapshot)
    canvas = Canvas(columns, rows)
    for axle in snapshot.axles:
        if axle.slip is not None and axle.adhesion is not None and axle.axle <= MOST_AXES:
            sign = 1.0 if axle.slip >= 0 else -1.0
            place = (abs(axle.slip) / slip_end, sign * axle.adhesion / adhesion_end)
            canvas.mark(*place, str(axle.axle), "bold reverse")
    for point in _points_of_the_rail(snapshot):
        canvas.dot(point.slip / slip_end, point.adhesion / adhesion_end, POINT)
    if snapshot.true_peak is not None:
        true = snapshot.true_peak
        canvas.mark(true.lambda_m / slip_end, true.mu_max / adhesion_end, "x", TRUTH)
    if service is not None:
        _draw_curve(canvas, snapshot, service, slip_end, adhesion_end)
    lines = _with_axis(canvas.rows(), adhesion_end)
    lines.append(_slip_axis(slip_end, columns))
    truth = "" if snapshot.true_peak is None else "  x truth"
    fitting = [legend + truth for legend in LEGENDS if len(legend + truth) <= width - 2]
    lines.append(Text(fitting[0] if fitting else "", "dim"))
    return boxed("adhesion over slip ratio", lines, width, height)


def _points_of_the_rail(snapshot: Snapshot) -> list[OperatingPoint]:
    """Samples since the rail last changed: earlier ones are of another curve."""
    service = snapshot.service
    if service is None or service.surface_age_s is None:
        return list(snapshot.points)
    since_us = service.t_us - service.surface_age_s * 1e6
    return [point for point in snapshot.points if point.t_us >= since_us]


def _ends(snapshot: Snapshot) -> tuple[float, float]:
    """Ends of both axes: all of the peak's surroundings, and of what is measured."""
    slips = [abs(a.slip) for a in snapshot.axles if a.slip is not None]
    heights = [abs(a.adhesion) for a in snapshot.axles if a.adhesion is not None]
    if snapshot.points:
        # A few samples stray far, most of all at low speed.
        slips.append(float(np.quantile([p.slip for p in snapshot.points], 0.98)))
        heights.append(float(np.quantile([p.adhesion for p in snapshot.points], 0.98)))
    service, true = snapshot.service, snapshot.true_peak
    if service is not None and service.lambda_m and service.mu_max:
        slips.append(2.0 * service.lambda_m)
        heights.append(1.15 * service.mu_max)
    if true is not None:
        slips.append(1.2 * true.lambda_m)
        heights.append(1.1 * true.mu_max)
    return nice_ceiling(max([0.02, *slips])), nice_ceiling(max([0.05, *heights]))


def _draw_curve(
    canvas: Canvas, snapshot: Snapshot, service: ServiceView, slip_end: float, adhesion_end: float
) -> None:
    if service.lambda_m and service.mu_max:
        canvas.mark(service.lambda_m / slip_end, service.mu_max / adhesion_end, "◆", PEAK)
    if service.theta is None:
        return
    if service.creep_speed is not None and snapshot.speed is not None:
        target = service.creep_speed / max(snapshot.speed, snapshot.v_min)
        canvas.upright(target / slip_end, "┊", SETPOINT)
    slip = np.linspace(0.0, slip_end, canvas.width * DOTS_ACROSS)
    curve = adhesion(slip, *service.theta)
    canvas.line((slip / slip_end).tolist(), (curve / adhesion_end).tolist(), CURVE)
    middle = (np.arange(canvas.width) + 0.5) / canvas.width * slip_end
    band = curve_band(middle, service)
    if band is not None:
        centre = adhesion(middle, *service.theta)
        for column, (low, high) in enumerate(zip(centre - band, centre + band, strict=True)):
            canvas.shade(column, float(low) / adhesion_end, float(high) / adhesion_end, BAND)


def _with_axis(rows: Sequence[Text], end: float) -> list[Text]:
    """Lines with an upright axis from 0 to an end in front of them."""
    labels = {0: f"{end:.3g}", len(rows) - 1: "0"}
    if len(rows) >= 5:
        labels[len(rows) // 2] = f"{end * (1 - (len(rows) // 2 + 0.5) / len(rows)):.2g}"
    return [
        Text.assemble((f"{labels.get(k, ''):>{LABEL - 1}}", "dim"), ("│", "dim"), row)
        for k, row in enumerate(rows)
    ]


def _slip_axis(end: float, columns: int) -> Text:
    middle, right = f"{end / 2:.3g}", f"{end:.3g}"
    axis = "0".ljust(columns // 2 - len(middle) // 2) + middle
    return Text(" " * LABEL + axis.ljust(columns - len(right)) + right, "dim")


def history_panel(snapshot: Snapshot, width: int, height: int, span_s: float) -> list[Text]:
    """μ_max and λ_m over time with their bands, and the status as a row of letters."""
    columns = width - 2 - LABEL
    rows = height - 4
    upper = (rows + 1) // 2
    from_us = snapshot.t_us - span_s * 1e6
    points = [point for point in snapshot.history if point.t_us >= from_us]
    ages = [(point.t_us - from_us) / (span_s * 1e6) for point in points]
    lines = _strip("mu", [(p.mu_max, p.mu_max_std) for p in points], ages, columns, upper)
    lines += _strip(
        "lam", [(p.lambda_m, p.lambda_m_std) for p in points], ages, columns, rows - upper
    )
    lines.append(Text.assemble(" " * LABEL, _status_row(points, ages, columns)))
    left, right = f"-{span_s:.0f} s", "now"
    legend = _status_legend(points, columns - len(left) - len(right) - 2)
    middle = legend.center(columns - len(left) - len(right))
    lines.append(Text(" " * LABEL + left + middle + right, "dim"))
    title = "mu_max, lambda_m and status"
    return boxed(title, lines, width, height)


def _status_legend(points: Sequence[HistoryPoint], width: int) -> str:
    """What the letters of the status mean, in at most a number of cells."""
    present = dict.fromkeys(STATUS_LETTERS[point.status] for point in points)
    short = "  ".join(SHORT_STATUS[letter] for letter in present)
    legends = [*STATUS_LEGENDS[:-1], short, short.replace("  ", " "), STATUS_LEGENDS[-1]]
    return next((legend for legend in legends if len(legend) <= width), "")


def _strip(
    name: str,
    values: Sequence[tuple[float | None, float | None]],
    ages: Sequence[float],
    columns: int,
    rows: int,
) -> list[Text]:
    """One quantity over time; its axis starts at 0."""
    canvas = Canvas(columns, rows)
    known = [value for value, _ in values if value is not None]
    end = nice_ceiling(1.25 * max(known, default=0.0)) if known else 1.0
    heights = [float("nan") if value is None else value / end for value, _ in values]
    canvas.line(list(ages), heights, CURVE)
    for age, (value, std) in zip(ages, values, strict=True):
        if value is not None and std is not None and isfinite(std):
            column = min(int(age * columns), columns - 1)
            reach = NORMAL_95 * std
            canvas.shade(column, (value - reach) / end, (value + reach) / end, BAND)
    lines = _with_axis(canvas.rows(), end)
    if rows >= 3:
        lines[1] = Text.assemble((f"{name:>{LABEL - 1}}", "bold"), ("│", "dim"), canvas.rows()[1])
    return lines


def _severity(status: Status) -> float:
    """Rank of a status where several hold, as the service ranks them: INIT below STALE_INPUT."""
    return 3.5 if status is Status.INIT else float(status)


def _status_row(points: Sequence[HistoryPoint], ages: Sequence[float], columns: int) -> Text:
    """The status in each column; the most severe one where several fall into it."""
    severest: dict[int, HistoryPoint] = {}
    for age, point in zip(ages, points, strict=True):
        column = min(int(age * columns), columns - 1)
        if column not in severest or _severity(point.status) > _severity(severest[column].status):
            severest[column] = point
    text = Text()
    for column in range(columns):
        if column in severest:
            status = severest[column].status
            text.append(STATUS_LETTERS[status], STATUS_STYLES[status])
        else:
            text.append(" ")
    return text
