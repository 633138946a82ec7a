"""Figures of a diagnosis as Plotly's JSON: before and after, each against the measurement."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from adhesion_can.arrays import Array
from adhesion_can.diagnosis.cause_result import EnvironmentSizes
from adhesion_can.diagnosis.evidence import Decision, ModelScore
from adhesion_can.diagnosis.formatting import (
    axis_scale,
    short,
    three_digits,
    unit_text,
    value_and_unit,
)
from adhesion_can.diagnosis.gain_result import Gain
from adhesion_can.diagnosis.plot_result import (
    CurveData,
    PredictionPlot,
    Profile,
    SimulationPlot,
)
from adhesion_can.diagnosis.result import FamilyResult, SegmentResult
from adhesion_can.normal_quantiles import NORMAL_95
from adhesion_can.physics.burckhardt import adhesion
from adhesion_can.physics.channels import channel_label
from adhesion_can.physics.estimate import Estimate
from adhesion_can.reporting.charts import (
    AT_MOST,
    BLUE,
    DARK,
    GREY,
    ORANGE,
    Trace,
    axis,
    insert_gaps,
    panel_layout,
    peak_mark,
    place,
    scatter,
    suffix,
    thinned,
    whiskers,
)
from adhesion_can.reporting.diagnosis_tables import DECISIONS
from adhesion_can.reporting.page import Figure
from adhesion_can.reporting.time_panels import Panel, line, panels_figure
from adhesion_can.result_text import HELD_OUT_RMSE, TimeScale

BEFORE, AFTER, MEASURED = ORANGE, BLUE, GREY
PLAIN, EXTENDED = "plain curve", "extended model"
FLOOR = "splines, deciding data"
FAMILY_COLOURS = (BEFORE, AFTER, "#009e73", "#cc79a7", "#b8860b")
"""Colours of the families, Burckhardt's first."""
MOST_POINTS, FEW_POINTS = 3000, 1000
"""Largest number of points of a scatter plot, and number below which they are drawn larger."""


def gain_figure(gain: Gain, *, extended: bool) -> Figure:
    """RMSE before and after beside the noise floor, with the gain's interval."""
    names = [PLAIN, EXTENDED if extended else "empirical curve", FLOOR]
    values = [gain.rmse_before, gain.rmse_after, gain.noise_floor]
    # The gain is a share of `before`: its interval is one of `after`.
    best, worst = (gain.rmse_before * (1.0 - end / 100.0) for end in reversed(gain.interval))
    known = np.isfinite([best, worst]).all()
    above_after, below_after = max(worst - gain.rmse_after, 0.0), max(gain.rmse_after - best, 0.0)
    ends = (above_after, below_after) if known else (None, None)
    bars = _bars(
        names, values, [three_digits(value) for value in values], [BEFORE, AFTER, MEASURED]
    )
    above, below = ([None, end, None] for end in ends)
    bars["error_x"] = whiskers(above, below, color=DARK, thickness=1.4, width=5)
    layout = {
        "xaxis": axis("RMSE of the adhesion", rangemode="tozero"),
        "yaxis": {"type": "category", "autorange": "reversed"},
        "bargap": 0.35,
    }
    caption = (
        f"RMSE of the adhesion on held-out data: {PLAIN} and {names[1]}. The whisker is the 95 % "
        f"interval of the gain. '{FLOOR}' is the RMSE on other rows, the deciding data, of a fit "
        "with the named effects and a spline in every channel. It can be larger than that of a "
        "model on the held-out data."
    )
    return Figure(caption, [bars], layout, 210)


def model_figure(models: Sequence[ModelScore]) -> Figure:
    """Held-out errors of the models that were compared, the best first."""
    colours = [
        BEFORE
        if model.decision is None
        else AFTER
        if model.decision is Decision.NAMED
        else MEASURED
        for model in models
    ]
    names = [
        model.name if model.decision is None else f"{model.name}: {DECISIONS[model.decision].name}"
        for model in models
    ]
    scores = [model.held_out_rmse for model in models]
    bars = _bars(names, scores, [f"{score:.3f}" for score in scores], colours)
    layout = {
        "xaxis": axis(HELD_OUT_RMSE, rangemode="tozero"),
        "yaxis": {"type": "category", "autorange": "reversed", "automargin": True},
        "bargap": 0.3,
    }
    caption = (
        "What decided: RMSE of the whitened residuals of each fitted model on the deciding data, "
        "each block predicted from the other blocks, in standard deviations σ of the noise. "
        "Smaller is better; a paired test over the blocks shows whether another model is worse."
    )
    return Figure(caption, [bars], layout, 90 + 30 * len(models), "models")


def simulation_figure(plot: SimulationPlot, times: TimeScale, *, extended: bool) -> Figure:
    """Wheel speed and adhesion of one axle: measured, before and, where extended, after."""
    t = plot.time_s - times.zero_us / 1e6
    panels = []
    measured, before, after = plot.wheel_speed, plot.simulated_before, plot.simulated_after
    error = "simulated minus measured wheel speed, rad/s"
    plotted = (
        ("wheel speed, rad/s", measured, before, after),
        (error, None, before - measured, after - measured),
        ("adhesion coefficient μ", plot.adhesion, plot.predicted_before, plot.predicted_after),
    )
    for row, (title, seen, was, now) in enumerate(plotted):
        shown = [(_MEASURED, seen)] if seen is not None else []
        shown += [(_BEFORE, was), (_AFTER, now)] if extended else [(_BEFORE, was)]
        styles, lines = [style for style, _ in shown], [line for _, line in shown]
        x, *ys = thinned(*insert_gaps(t, *lines), at_most=AT_MOST)
        traces = [_line(style, x, y, legend=row == 0) for style, y in zip(styles, ys, strict=True)]
        panels.append(Panel(title, traces, {}, 150.0))
    caption = (
        f"{plot.recording}, axle {plot.axle}, measured and simulated. "
        "Wheel speed is simulated from the measured effort and vehicle speed, restarted every "
        f"{plot.restart_s:g} s; adhesion is predicted from the measured slip."
    )
    return panels_figure(caption, panels, "time, s", "measured-and-simulated")


def prediction_figure(prediction: PredictionPlot, *, extended: bool) -> Figure:
    """Measured against predicted adhesion: before and, where extended, after."""
    shown = [(_BEFORE, prediction.before), (_AFTER, prediction.after)][: 1 + extended]
    measured = prediction.measured
    ends = _y_span([measured, *(predicted for _, predicted in shown)])
    data: list[Trace] = []
    axes = []
    for row, (style, predicted) in enumerate(shown):
        error = float(np.sqrt(np.nanmean((measured - predicted) ** 2)))
        marker = {"color": style["line"]["color"], "size": 4, "opacity": 0.5}
        name = f"{style['name']}, RMSE {short(error)}"
        points = scatter("markers", name, measured, predicted, marker=marker, hoverinfo="skip")
        dashed = {"color": DARK, "width": 1.2, "dash": "dash"}
        ideal = scatter(
            "lines", "predicted = measured", ends, ends, line=dashed, showlegend=row == 0
        )
        data += [points | place(row), ideal | place(row)]
        axes.append(axis(f"predicted μ, {style['name']}", range=ends))
    height = 90 + 260 * len(shown)
    layout = panel_layout(axes, "measured adhesion coefficient μ", height)
    for row in range(len(shown)):
        layout[f"xaxis{suffix(row)}"]["range"] = ends
    caption = (
        f"Measured and predicted adhesion, {len(measured)} of {prediction.rows} rows. A table of "
        "samples has no wheel speed to simulate; adhesion is predicted from the slip of each "
        "row. On the dashed line the prediction is exact. RMSE: of the adhesion in the rows shown."
    )
    return Figure(caption, data, layout, height, "measured-against-predicted")


def profile_figure(profile: Profile) -> Figure:
    """Mean residual over bins of a channel, before and after, with standard errors."""
    data: list[Trace] = []
    for style, mean, std in (
        (_BEFORE, profile.before, profile.before_std),
        (_AFTER, profile.after, profile.after_std),
    ):
        colour = style["line"]["color"]
        marker = {"color": colour, "size": 8}
        bars = whiskers(_known(std), color=colour, thickness=1.3, width=3)
        points = scatter("markers", style["name"], profile.at, mean, marker=marker, error_y=bars)
        data.append(points)
    dashed = {"color": DARK, "width": 1.6, "dash": "dash"}
    data.append(line("change by the extended model", profile.at, profile.fitted, dashed))
    unit = unit_text(profile.unit)
    name = channel_label(profile.channel)
    layout = {
        "xaxis": axis(f"{name}, {unit}" if unit else name),
        "yaxis": axis("mean residual of μ", zeroline=True, zerolinecolor=MEASURED),
    }
    caption = (
        f"Measured minus predicted adhesion over {name} in all data, averaged in bins, with "
        "standard errors; positive if the surface provides more than predicted. The dashed line "
        "is the change that the extended model makes: where it meets the points of the plain "
        "curve, the points of the extended model are at 0."
    )
    return Figure(caption, data, layout, 380)


def _cloud(slip: Array, mu: Array) -> Trace:
    """The data as points, of which few are drawn larger."""
    every = max(-(-len(slip) // MOST_POINTS), 1)
    few = len(slip) < FEW_POINTS
    marker = {"color": MEASURED, "size": 5 if few else 3, "opacity": 0.8 if few else 0.4}
    x, y = slip[::every], mu[::every]
    return scatter("markers", "data", x, y, marker=marker, hoverinfo="skip")


def curve_figure(
    surface: SegmentResult, times: TimeScale, curves: CurveData, *, extended: bool
) -> Figure:
    """Curve and data of one surface: as measured and, where extended, with the effects out."""
    clouds = [(surface.base, _BEFORE, curves.slip, curves.adhesion)]
    if extended:
        corrected = (curves.corrected_slip, curves.corrected_adhesion)
        clouds.append((surface.extended, _AFTER, *corrected))
    data: list[Trace] = []
    end = 1.02 * max(float(np.nanmax(slip, initial=0.0)) for _, _, slip, _ in clouds)
    grid = np.linspace(0.0, end or 0.2, 201)
    for row, (estimate, style, slip, mu) in enumerate(clouds):
        cloud = _cloud(slip, mu) | {"showlegend": row == 0}
        x, y = grid, adhesion(grid, *estimate.theta)
        if row and curves.shape is not None:
            x, y = curves.shape
        curve = _line(style, x, y, legend=True)
        curve["line"] = {**style["line"], "width": 2.4}
        data += [trace | place(row) for trace in (cloud, curve, *_peak(estimate, style))]
    span = _y_span([mu for _, _, _, mu in clouds])
    axes = [
        axis(f"μ, {which}", range=span)
        for which in ("as measured", "effects removed")[: len(clouds)]
    ]
    height = 70 + 275 * len(clouds)
    layout = panel_layout(axes, "slip ratio λ", height)
    for row in range(len(clouds)):
        layout[f"xaxis{suffix(row)}"]["range"] = [0.0, float(grid[-1])]
    when = f"{times.seconds(surface.from_s):.0f} to {times.seconds(surface.to_s):.0f} s"
    caption = (
        f"Adhesion curve of the longest surface ({surface.recording}, {when}) and the measured "
        "data. "
    )
    if extended:
        caption += (
            "Below: the base curve of the extended model, and the data with its effects removed. "
        )
    caption += "Diamonds: identifiable peaks, with standard deviations."
    return Figure(caption, data, layout, height)


def family_figure(families: Sequence[FamilyResult], curves: CurveData) -> Figure:
    """Curves of all families side by side, with the data as measured."""
    data: list[Trace] = [_cloud(curves.slip, curves.adhesion)]
    for family, colour in zip(families, FAMILY_COLOURS, strict=False):
        style = _style(family.title, colour, 2.6 if family.chosen else 1.4)
        if not family.chosen:
            style["line"]["dash"] = "dash"
        data.append(_line(style, family.slip, family.adhesion, legend=True))
    layout = {
        "xaxis": axis("slip ratio λ", rangemode="tozero"),
        "yaxis": axis("adhesion coefficient μ", range=_y_span([curves.adhesion])),
    }
    caption = (
        "Curve families side by side, each fitted alone, at the mean speed and load of the longest "
        "surface; the solid line is the family of the extended model's base curve."
    )
    return Figure(caption, data, layout, 400)


def _peak(estimate: Estimate, style: Trace) -> list[Trace]:
    """Peak with its standard deviations, where it is identifiable."""
    if not estimate.identifiable.both:
        return []
    peak = (estimate.lambda_m, estimate.lambda_m_std), (estimate.mu_max, estimate.mu_max_std)
    colours = style["line"]["color"], DARK
    return [peak_mark(f"peak, {style['name']}", *peak, colours, showlegend=False)]


# ------------------------------------------------------------------------------- ingredients


def _style(name: str, colour: str, width: float) -> Trace:
    return {"name": name, "legendgroup": name, "line": {"color": colour, "width": width}}


_MEASURED = _style("measured", MEASURED, 1.2)
_BEFORE = _style(PLAIN, BEFORE, 2.4)
_AFTER = _style(EXTENDED, AFTER, 1.2)


def _line(style: Mapping[str, Any], x: Array, y: Array, *, legend: bool) -> Trace:
    return {"type": "scatter", "mode": "lines", **style, "x": x, "y": y, "showlegend": legend}


def _bars(names: Sequence[str], sizes: Sequence[float], texts: Any, colours: Any) -> Trace:
    """Horizontal bars with their sizes as text inside."""
    return {"type": "bar", "orientation": "h", "y": names, "x": sizes, "marker": {"color": colours},
            "text": texts, "textposition": "inside", "insidetextanchor": "start",
            "hoverinfo": "x+y"}  # fmt: skip


def _known(std: Array) -> Array:
    """Standard errors, 0 where there is none."""
    return np.where(np.isfinite(std), std, 0.0)


def _y_span(clouds: list[Array]) -> list[float]:
    """Range of the axis: all but the outermost data, and 0."""
    values = np.concatenate(clouds)
    values = values[np.isfinite(values)]
    if not len(values):
        return [0.0, 0.5]
    low, high = np.quantile(values, (0.002, 0.998))
    room = 0.08 * max(float(high - low), 1e-3)
    return [min(float(low), 0.0) - room, float(high) + room]


ROW_HEIGHT, MARGINS_HEIGHT = 19, 110
"""Height of an environment and of the margins, px."""
MOST_PARTITIONS = 8
"""Largest number of partitions that are drawn, those with the largest spread."""


def environment_figure(environments: Sequence[EnvironmentSizes]) -> Figure:
    """Size of one effect in every environment, with 95 % intervals (a forest plot).

    Args:
        environments: Sizes of one effect, at least one partition, the largest spread first.

    """
    drawn = list(environments[:MOST_PARTITIONS])
    # Of several parameters the figure shows the one that varies most.
    effect, parameter, unit = drawn[0].effect, drawn[0].parameter, drawn[0].unit
    drawn, size = [part for part in drawn if part.parameter == parameter], drawn[0].size
    factor, text = axis_scale(size, unit)
    data = [
        _points([part for part in drawn if part.refutes is refutes], factor, refutes=refutes)
        for refutes in (False, True)
        if any(part.refutes is refutes for part in drawn)
    ]
    names = [level.level for part in drawn for level in part.levels]
    layout = {
        "xaxis": axis(f"{parameter}, {text or 'no unit'}"),
        "yaxis": {
            "type": "category",
            "autorange": "reversed",
            "categoryorder": "array",
            "categoryarray": names,
            "automargin": True,
        },
        "shapes": [
            {
                "type": "line",
                "x0": factor * size,
                "x1": factor * size,
                "y0": 0,
                "y1": 1,
                "yref": "paper",
                "layer": "below",
                "line": {"color": DARK, "width": 1.2, "dash": "dot"},
            }
        ],
        "showlegend": len(data) > 1,
    }
    caption = (
        f"{effect}: {parameter} in parts of the data, with 95 % intervals. The dotted line is its "
        f"value in all parts together, {value_and_unit(size, unit)}. A cause has one size "
        "everywhere."
    )
    return Figure(caption, data, layout, MARGINS_HEIGHT + ROW_HEIGHT * len(names))


def _points(environments: Sequence[EnvironmentSizes], factor: float, *, refutes: bool) -> Trace:
    """Points with whiskers of some partitions, in one colour."""
    levels = [level for part in environments for level in part.levels]
    half = [factor * NORMAL_95 * level.std for level in levels]
    return scatter(
        "markers",
        "sizes that differ" if refutes else "sizes that agree",
        [factor * level.value for level in levels],
        [level.level for level in levels],
        error_x=whiskers(half, thickness=1.2, width=3),
        marker={"color": ORANGE if refutes else BLUE, "size": 6},
    )
