"""The paper's figures, with every estimator in them: as Plotly's JSON for a page."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from adhesion_can.arrays import Array
from adhesion_can.experiments.figures_of_merit import (
    NoiseLevelResult,
    compute_figures,
    quartiles,
    rms,
)
from adhesion_can.experiments.simulated_data import MU_MAX, QUANTITIES, simulate_data
from adhesion_can.physics.burckhardt import adhesion
from adhesion_can.reporting.charts import (
    DARK,
    MARGINS,
    Trace,
    axis,
    domains,
    faded,
    log_axis,
    mean_and_interval,
    panel_layout,
    place,
    scatter,
    suffix,
    value_range,
    vertical_line,
    whiskers,
)
from adhesion_can.reporting.experiment_style import (
    COLOURS,
    NAMES,
    in_order,
    is_shown,
    line_style,
)
from adhesion_can.reporting.page import Figure

CLOUD = "#9aa5b1"
BINS = (12, 60)
"""Smallest and largest number of bins of a histogram; between them one for each 8 values."""


def figures(outcome: NoiseLevelResult) -> list[Figure]:
    """All figures of one noise level."""
    return [
        curves(outcome),
        over_updates(outcome, QUANTITIES[:3]),
        over_updates(outcome, ("mu_max",)),
        error_over_updates(outcome),
        histograms(outcome),
        slips_needed(outcome) if outcome.experiment.ramp else accuracy(outcome),
    ]


def curves(outcome: NoiseLevelResult) -> Figure:
    """Characteristic curves at the end of each surface, with the data of the last block there."""
    experiment = outcome.experiment
    each = experiment.updates // len(experiment.surfaces)
    h, z = simulate_data(experiment, outcome.noise_std, 0, outcome.seed).samples.folded()
    ends = (*experiment.switches, len(h))
    last = np.concatenate([np.arange(end - experiment.block, end) for end in ends])
    slip = np.linspace(0.0, experiment.slip_max, 121)

    def lines(thetas: ArrayLike) -> dict[str, Array]:
        """One line with a gap after each curve."""
        parts = [np.append(adhesion(slip, *theta), np.nan) for theta in np.asarray(thetas)]
        return {"x": np.tile(np.append(slip, np.nan), len(parts)), "y": np.concatenate(parts)}

    marker = {"color": CLOUD, "size": 4, "opacity": 0.45}
    data = [scatter("markers", "data", h[last], z[last], marker=marker, hoverinfo="skip")]
    for result in in_order(outcome):
        thetas = result.values[0, each - 1 :: each, :3]
        data.append(
            {"type": "scatter", "mode": "lines", **line_style(outcome, result), **lines(thetas)}
        )
    data.append(_truth(**lines(experiment.surfaces)))
    middle = max(float(adhesion(experiment.slip_max, *theta)) for theta in experiment.surfaces)
    layout = {
        "xaxis": axis("slip ratio λ", range=[0, experiment.slip_max]),
        "yaxis": axis(
            "adhesion coefficient μ",
            range=[min(0.0, -1.5 * outcome.noise_std), middle + 0.06 + 3 * outcome.noise_std],
        ),
    }
    what = "the run" if experiment.ramp else "each surface"
    caption = (
        f"Characteristic curves in the first run: the estimates at the end of {what}, the true "
        f"curve, and the last {experiment.block} samples before."
    )
    return Figure(caption, data, layout, 430)


def over_updates(outcome: NoiseLevelResult, quantities: Sequence[str]) -> Figure:
    """Values over the blocks, or over the slip in experiment 1: mean and spread over the runs."""
    x = _abscissa(outcome)
    data: list[Trace] = []
    axes: list[Trace] = []
    for row, name in enumerate(quantities):
        q, here = QUANTITIES.index(name), place(row)
        truth = outcome.truth[:, q]
        spans = [truth]
        for result in in_order(outcome):
            values = result.values[..., q]
            mean, low, high = mean_and_interval(values)
            style = line_style(outcome, result, first=row == 0)
            if is_shown(outcome, result.name):
                spans += [low, high]
            known = np.isfinite(low)
            band = {
                **style,
                "type": "scatter",
                "mode": "lines",
                "showlegend": False,
                "x": np.concatenate([x[known], x[known][::-1]]),
                "y": np.concatenate([high[known], low[known][::-1]]),
                "fill": "toself",
                "fillcolor": faded(style["line"]["color"]),
                "line": {"width": 0},
                "hoverinfo": "skip",
            }
            line = {"type": "scatter", "mode": "lines", **style, "x": x, "y": mean}
            data += [band | here, line | here]
        data.append(_truth(x=x, y=truth, showlegend=row == 0) | here)
        axes.append(axis(NAMES[name], range=value_range(spans, truth)))
    what = "maximum adhesion" if tuple(quantities) == ("mu_max",) else "parameters"
    where = "slip reached" if outcome.experiment.ramp else "blocks"
    caption = (
        f"The {what} over the {where}: mean over the runs (line) and 5 to 95 % of them (band)."
    )
    height = 340 if len(axes) == 1 else 210 * len(axes)
    layout = panel_layout(axes, _abscissa_title(outcome), height)
    return Figure(caption, data, layout, height)


def error_over_updates(outcome: NoiseLevelResult) -> Figure:
    """Root mean square error of the maximum adhesion over the runs, and the bound."""
    x = _abscissa(outcome)
    data: list[Trace] = []
    for result in in_order(outcome):
        errors = rms(result.values[..., MU_MAX] - outcome.truth[:, MU_MAX], 0)
        line = {"type": "scatter", "mode": "lines", **line_style(outcome, result)}
        data.append(line | {"x": x, "y": np.where(errors > 0, errors, np.nan)})
    limit = outcome.bound[:, MU_MAX]
    dotted = {"color": DARK, "width": 1.4, "dash": "dot"}
    bound = scatter("lines", "Cramér-Rao bound", x, limit, line=dotted)
    ends = [np.log10(0.4 * limit[np.isfinite(limit)].min()), np.log10(0.5)]
    layout = {
        "xaxis": axis(_abscissa_title(outcome)),
        "yaxis": axis("RMSE of μ<sub>m</sub>", type="log", range=ends, dtick=1),
    }
    caption = (
        "Error of the maximum adhesion, and the Cramér-Rao bound of the samples since the last "
        "switch, for an unbiased estimator that knows when the surface changed. An estimator "
        "can be below the bound if its start is near the truth or its search range adds "
        "information."
    )
    return Figure(caption, [*data, bound], layout, 360)


def histograms(outcome: NoiseLevelResult) -> Figure:
    """Distribution of the maximum adhesion on each surface, over runs and blocks."""
    experiment = outcome.experiment
    each = experiment.updates // len(experiment.surfaces)
    data: list[Trace] = []
    layout: dict[str, Any] = {}
    count = len(experiment.surfaces)
    height = 340 if count == 1 else 220 * count
    for row, domain in enumerate(domains(count, height, gap=66)):
        part = slice(experiment.updates - 1 if experiment.ramp else row * each, (row + 1) * each)
        truth = float(outcome.truth[row * each, MU_MAX])
        estimates = {r.name: r.values[:, part, MU_MAX].ravel() for r in in_order(outcome)}
        half = _half_width([v - truth for n, v in estimates.items() if is_shown(outcome, n)])
        bins = np.clip(max((len(v) for v in estimates.values()), default=0) // 8, *BINS)
        edges = truth + half * np.linspace(-1.0, 1.0, int(bins) + 1)
        middles = 0.5 * (edges[1:] + edges[:-1])
        for result in in_order(outcome):
            values = estimates[result.name]
            values = values[np.isfinite(values)]
            counts, _ = np.histogram(np.clip(values, edges[0], edges[-1]), edges)
            style = line_style(outcome, result, first=row == 0)
            colour = style["line"]["color"]
            data.append(
                style
                | {
                    "type": "scatter",
                    "mode": "lines",
                    "x": middles,
                    "y": 100.0 * counts / max(len(values), 1),
                    "line": {"color": colour, "width": 1.4, "shape": "hvh"},
                    "fill": "tozeroy",
                    "fillcolor": faded(colour),
                }
                | place(row)
            )
        axis_suffix = suffix(row)
        where = f"on surface {row + 1}" if count > 1 else "at the end"
        title = f"μ<sub>m</sub> {where} (true {truth:.4f})"
        layout[f"xaxis{axis_suffix}"] = {
            "title": {"text": title, "standoff": 10},
            "range": [edges[0], edges[-1]],
            "anchor": f"y{axis_suffix}",
        }
        layout[f"yaxis{axis_suffix}"] = axis(
            "share, %", domain=domain, rangemode="tozero", anchor=f"x{axis_suffix}"
        )
        layout.setdefault("shapes", []).append(vertical_line(truth, row, "dash"))
    whose = "at the end of the run" if experiment.ramp else "over all blocks of each surface"
    caption = (
        f"Histograms of the maximum adhesion {whose} and all runs. The dashed line is the truth; "
        "the outermost bins contain all values beyond."
    )
    return Figure(caption, data, layout, height)


def accuracy(outcome: NoiseLevelResult) -> Figure:
    """Errors of μ_max and λ_m, and duration of an update, one below the other."""
    ranked = sorted(
        ((r, compute_figures(r, outcome)) for r in outcome.results if not r.is_late),
        key=lambda pair: -pair[1].rmse[MU_MAX],
    )
    names = [r.name for r, _ in ranked]
    panels: list[tuple[str, list[float], list[float] | None, float | None]] = [
        (
            f"RMSE of {symbol}",
            [m.rmse[q] for _, m in ranked],
            [m.rmse_steady[q] for _, m in ranked],
            float(rms(outcome.bound[:, q], 0)),
        )
        for symbol, q in (("μ<sub>m</sub>", MU_MAX), ("λ<sub>m</sub>", MU_MAX + 1))
    ]
    size = outcome.experiment.block
    panels.append(
        (f"ms for an update of {size} samples", [m.update_ms for _, m in ranked], None, None)
    )
    data: list[Trace] = []
    layout: dict[str, Any] = {"shapes": []}
    height = MARGINS + len(panels) * (84 + 22 * len(names))
    places = domains(len(panels), height, gap=68)
    for row, ((title, all_, kept, bound), domain) in enumerate(zip(panels, places, strict=True)):
        marked = [("all blocks", "all", all_, {"color": COLOURS["tracker"], "size": 9})]
        if kept is not None:
            open_ = {"color": DARK, "size": 9, "symbol": "circle-open"}
            marked.append(("without the first block after a switch", "kept", kept, open_))
        data += [
            scatter(
                "markers", name, x, names, showlegend=row == 0, legendgroup=group, marker=marker
            )
            | place(row)
            for name, group, x, marker in marked
        ]
        axis_suffix = suffix(row)
        numbers = [*all_, *(kept or ()), *(() if bound is None else (bound,))]
        layout[f"xaxis{axis_suffix}"] = {
            "title": {"text": title, "standoff": 10},
            "anchor": f"y{axis_suffix}",
            **log_axis(numbers),
        }
        layout[f"yaxis{axis_suffix}"] = {
            "domain": domain,
            "anchor": f"x{axis_suffix}",
            "type": "category",
        }
        if bound is not None:
            layout["shapes"].append(vertical_line(bound, row, "dot"))
    caption = (
        "Accuracy and cost; the dotted line is the Cramér-Rao bound. Times were measured in "
        "these runs, including other load on the machine."
    )
    return Figure(caption, data, layout, height)


def slips_needed(outcome: NoiseLevelResult) -> Figure:
    """Slip in experiment 1 from which on each value is within 10 % of the truth."""
    shown = [(r.name, compute_figures(r, outcome).slip_needed) for r in reversed(in_order(outcome))]
    data: list[Trace] = []
    for q, colour in enumerate(("#0b5fa5", "#d55e00", "#2e8b57", "#8e5aa8")):
        slip_quartiles = np.array([quartiles(slips[:, q]) for _, slips in shown])
        low, middle, high = np.where(np.isfinite(slip_quartiles), slip_quartiles, np.nan).T
        end = np.where(np.isnan(high), outcome.experiment.slip_max, high)
        data.append(
            scatter(
                "markers",
                ("c<sub>1</sub>", "c<sub>2</sub>", "c<sub>3</sub>", "μ<sub>m</sub>")[q],
                middle,
                [name for name, _ in shown],
                marker={"color": colour, "size": 9},
                error_x=whiskers(end - middle, middle - low, color=colour, thickness=1.2, width=3),
            )
        )
    layout = {
        "xaxis": axis("slip ratio λ reached", range=[0, 1.02 * outcome.experiment.slip_max]),
        "yaxis": {"type": "category"},
    }
    caption = (
        "Slip from which each value stays within 10 % of the truth: median and quartiles over "
        "the runs; no mark if fewer than half of them reach it."
    )
    return Figure(caption, data, layout, 90 + 36 * len(shown))


# ------------------------------------------------------------------------------- ingredients


def _truth(**rest: Any) -> Trace:
    line = {"color": DARK, "width": 1.6, "dash": "dash"}
    return {"type": "scatter", "mode": "lines", "name": "truth", "line": line, **rest}


def _abscissa(outcome: NoiseLevelResult) -> Array:
    experiment = outcome.experiment
    if experiment.ramp:
        return np.linspace(0.0, experiment.slip_max, experiment.updates)
    return np.arange(1.0, experiment.updates + 1)


def _abscissa_title(outcome: NoiseLevelResult) -> str:
    if outcome.experiment.ramp:
        return "slip ratio λ reached"
    return f"block k, of {outcome.experiment.block} samples"


def _half_width(errors: Sequence[Array]) -> float:
    """Half the width of a histogram: 98 % of the widest distribution visible at first fits in."""
    sizes = [np.abs(e[np.isfinite(e)]) for e in errors]
    return max((float(np.quantile(s, 0.98)) for s in sizes if len(s)), default=0.0) or 0.01
