"""Names, colours and order of the estimators in the figures of an experiment."""

from collections.abc import Mapping

from adhesion_can.experiments.figures_of_merit import EstimatorResult, NoiseLevelResult
from adhesion_can.experiments.simulated_data import QUANTITIES
from adhesion_can.reporting.charts import Trace

PAPERS_OWN: Mapping[int, str] = {1: "paper (sequence)", 2: "paper (ordinary)", 3: "paper (mean)"}
"""Name of the paper's own algorithm in each experiment."""

SHOWN = ("oracle", "tracker", "paper", "de")
"""Estimators visible at first, with the paper's own; the others on a click in the legend."""

NAMES = dict(
    zip(
        QUANTITIES,
        (
            "c<sub>1</sub>",
            "c<sub>2</sub>",
            "c<sub>3</sub>",
            "maximum adhesion μ<sub>m</sub>",
            "optimal slip λ<sub>m</sub>",
        ),
        strict=True,
    )
)
"""Name of each quantity in titles of axes."""

COLOURS = {
    "tracker": "#0b5fa5",
    "oracle": "#2e8b57",
    "paper": "#d55e00",
    "de": "#8e5aa8",
    "paper (sequence)": "#e0a100",
    "paper (mean)": "#e0a100",
    "paper (ordinary)": "#b03a5b",
}
"""Colour of the estimators that every page has."""

MORE = ("#4aa8d8", "#7d8794", "#10a5a0", "#9aa31a", "#d86fb0", "#8c564b", "#5b6ee1", "#3d7a3d")
"""Colours of the other estimators."""


def in_order(outcome: NoiseLevelResult) -> list[EstimatorResult]:
    """Results with estimates before the end: the visible ones first, then by name."""
    first = (PAPERS_OWN[outcome.experiment.number], *SHOWN)
    return sorted(
        (r for r in outcome.results if not r.is_late),
        key=lambda r: (first.index(r.name) if r.name in first else len(first), r.name),
    )


def is_shown(outcome: NoiseLevelResult, name: str) -> bool:
    """Whether an estimator is visible at first."""
    return name in SHOWN or name == PAPERS_OWN[outcome.experiment.number]


def line_style(outcome: NoiseLevelResult, result: EstimatorResult, *, first: bool = True) -> Trace:
    """Common part of the traces of one estimator."""
    rest = sorted(r.name for r in outcome.results if r.name not in COLOURS)
    colour = COLOURS.get(result.name) or MORE[rest.index(result.name) % len(MORE)]
    return {
        "name": result.name,
        "legendgroup": result.name,
        "showlegend": first,
        "visible": True if is_shown(outcome, result.name) else "legendonly",
        "line": {"color": colour, "width": 1.6},
    }
