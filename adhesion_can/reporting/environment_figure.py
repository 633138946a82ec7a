"""Figure of an effect's size by environment: one size, or not, at a glance."""

from collections.abc import Sequence

from adhesion_can.diagnosis.cause_result import EnvironmentSizes
from adhesion_can.diagnosis.formatting import axis_scale, value_and_unit
from adhesion_can.normal_quantiles import NORMAL_95
from adhesion_can.reporting.charts import BLUE, DARK, ORANGE, Trace, axis, scatter, whiskers
from adhesion_can.reporting.page import Figure

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
    drawn, size = [one for one in drawn if one.parameter == parameter], drawn[0].size
    factor, text = axis_scale(size, unit)
    data = [
        _points([one for one in drawn if one.refutes is refutes], factor, refutes=refutes)
        for refutes in (False, True)
        if any(one.refutes is refutes for one in drawn)
    ]
    names = [level.level for one in drawn for level in one.levels]
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
    levels = [level for one in environments for level in one.levels]
    half = [factor * NORMAL_95 * level.std for level in levels]
    return scatter(
        "markers",
        "sizes that differ" if refutes else "sizes that agree",
        [factor * level.value for level in levels],
        [level.level for level in levels],
        error_x=whiskers(half, thickness=1.2, width=3),
        marker={"color": ORANGE if refutes else BLUE, "size": 6},
    )
