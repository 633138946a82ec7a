"""An evaluation as text and as a page."""

from collections.abc import Iterator, Mapping, Sequence
from math import isfinite

from adhesion_can.diagnosis.evaluate import Evaluation, PartEvaluation
from adhesion_can.diagnosis.formatting import short
from adhesion_can.diagnosis.gain_result import Comparison
from adhesion_can.diagnosis.model_worth import ModelWorth, describe_gain, judge_model
from adhesion_can.reporting.charts import BLUE, GREY, ORANGE, axis
from adhesion_can.reporting.page import Figure, Items, Page, Part, Table, Text
from adhesion_can.reporting.text import FittingTable

TITLE = "RMSE of the adhesion on all rows of each recording"
COLUMNS = ("data", "rows", "plain", "as written", "gain", "refitted", "gain ")
COLOURS = (ORANGE, GREY, BLUE)
"""Colours of the plain curve, of the model as written and of the refitted one."""
MEANING = (
    "Plain: Burckhardt's curve fitted to these data. As written: the "
    "model from its file. Refitted: the effects from the file, the curve fitted to these data. "
    "Gains over the plain curve have 95 % intervals, with spans or recordings as units."
)


def render_evaluation(evaluation: Evaluation) -> Iterator[str | FittingTable]:
    """Parts for a terminal."""
    yield FittingTable(f"{TITLE}, and gain over the plain curve", COLUMNS, _rows(evaluation))
    yield verdict(evaluation)
    yield MEANING


def verdict(evaluation: Evaluation) -> str:
    """What was compared, the gain, and what it is worth on all data together."""
    total = evaluation.total
    written, refitted = total.as_written, total.refitted
    worth = judge_model(refitted)
    text = (
        f"The model's effects with the curve refitted to these data have an RMSE of "
        f"{short(refitted.rmse)}, the plain curve {short(total.plain)}: gain "
        f"{describe_gain(refitted)}, {worth.clause}. As written, without refitting, the model has "
        f"{short(written.rmse)}: gain {describe_gain(written)}."
    )
    if worth is ModelWorth.USEFUL and written.rmse > total.plain:
        return (
            f"{text} Its effects apply here, but its curve does not: the surface or the wheel "
            "differs."
        )
    return text


def page(
    evaluation: Evaluation, model: str, notes: Sequence[str], provenance: Mapping[str, str]
) -> Page:
    """Page of an evaluation.

    Args:
        evaluation: Result of the evaluation.
        model: Name of the model's file.
        notes: Sentence for each problem of an input.
        provenance: Version, command, database and configuration by name.

    """
    sections: dict[str, list[Part]] = {
        "Figures": [Table(f"{TITLE}.", COLUMNS, _rows(evaluation), note=MEANING)],
        "Recording by recording": [_figure(evaluation)],
        "Inputs": [Items(notes) if notes else Text("Every row was used.")],
    }
    return Page(
        title="A model on these data",
        lead=f"The model {model} compared with the plain curve.",
        verdict=[verdict(evaluation)],
        sections=sections,
        provenance=provenance,
    )


def _figure(evaluation: Evaluation) -> Figure:
    together = [evaluation.total] if len(evaluation.recordings) > 1 else []
    parts = [*evaluation.recordings, *together]
    names = [part.recording or "all" for part in parts]
    bars = {
        "plain curve": [part.plain for part in parts],
        "model as written": [part.as_written.rmse for part in parts],
        "model, curve refitted": [part.refitted.rmse for part in parts],
    }
    data = [
        {"type": "bar", "name": name, "x": names, "y": values, "hovertemplate": "%{y:.4g}",
         "marker": {"color": colour}}
        for (name, values), colour in zip(bars.items(), COLOURS, strict=True)
    ]  # fmt: skip
    layout = {"barmode": "group", "yaxis": axis("RMSE of the adhesion")}
    return Figure(f"{TITLE}: lower is better.", data, layout)


def _rows(evaluation: Evaluation) -> list[tuple[str, ...]]:
    several = len(evaluation.surfaces) > len(evaluation.recordings)
    rows = []
    for recording in evaluation.recordings:
        rows.append(_row(recording.recording, recording))
        if several:
            surfaces = [
                surface
                for surface in evaluation.surfaces
                if surface.recording == recording.recording
            ]
            rows += [_row(f"  {_span(surface, recording)}", surface) for surface in surfaces]
    if len(evaluation.recordings) > 1:
        rows.append(_row("all", evaluation.total))
    return rows


def _span(part: PartEvaluation, recording: PartEvaluation) -> str:
    """Span of a surface, s since the recording began."""
    return f"{part.from_s - recording.from_s:.1f} .. {part.to_s - recording.from_s:.1f} s"


def _row(name: str, part: PartEvaluation) -> tuple[str, ...]:
    cells = [name, str(part.samples), short(part.plain)]
    for comparison in (part.as_written, part.refitted):
        cells += [short(comparison.rmse), _gain(comparison)]
    return tuple(cells)


def _gain(comparison: Comparison) -> str:
    low, high = comparison.interval
    text = f"{comparison.percent:.1f} %"
    return f"{text} ({low:.1f} to {high:.1f})" if isfinite(low) else text
