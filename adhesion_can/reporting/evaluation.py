"""An evaluation as text and as a page."""

from collections.abc import Iterator, Mapping, Sequence
from math import isfinite

from adhesion_can.diagnosis.evaluate import Evaluation, PartEvaluation
from adhesion_can.diagnosis.formatting import short
from adhesion_can.diagnosis.result import Comparison
from adhesion_can.reporting.charts import BLUE, GREY, ORANGE
from adhesion_can.reporting.page import Figure, Items, Page, Section, Table, Text
from adhesion_can.reporting.text import FittingTable, table

TITLE = "RMSE of the adhesion on all rows of each recording"
COLUMNS = ("data", "rows", "plain", "as written", "gain", "refitted", "gain ")
COLOURS = (ORANGE, GREY, BLUE)
"""Colours of the plain curve, of the model as written and of the refitted one."""
MEANING = (
    "Plain: Burckhardt's curve fitted to these data. As written: the "
    "model from its file. Refitted: the effects from the file, the curve fitted to these data. "
    "Gains over the plain curve have 95 % intervals, with spans or recordings as units."
)


def render_evaluation(found: Evaluation) -> Iterator[str | FittingTable]:
    """Parts for a terminal."""
    yield table(f"{TITLE}, and gain over the plain curve", COLUMNS, _rows(found))
    yield verdict(found)
    yield MEANING


def verdict(found: Evaluation) -> str:
    """What the model is worth on all data together, one sentence."""
    total = found.total
    written, refitted = total.as_written, total.refitted
    text = (
        f"The RMSE of the model as written is {short(written.rmse)}, {_change(written)} the "
        f"plain curve's {short(total.plain)}; with its curve refitted it is "
        f"{short(refitted.rmse)}, {_change(refitted)}."
    )
    if _is_sure(refitted) and written.rmse > total.plain:
        return (
            f"{text} Its effects apply here, but its curve does not: the surface or the wheel "
            "differs."
        )
    if refitted.interval[1] < 0.0:
        return f"{text} Its effects make the prediction worse here: the whole interval is below 0."
    if not _is_sure(refitted):
        return (
            f"{text} With the curve refitted, the interval of the gain includes 0: whether its "
            "effects help here is not certain."
        )
    return text


def page(
    found: Evaluation, model: str, notes: Sequence[str], provenance: Mapping[str, str]
) -> Page:
    """Page of an evaluation.

    Args:
        found: Result of the evaluation.
        model: Name of the model's file.
        notes: Sentence for each problem of an input.
        provenance: Version, command, database and configuration by name.

    """
    sections = [
        Section("Figures", [Table(f"{TITLE}.", COLUMNS, _rows(found), note=MEANING)]),
        Section("Recording by recording", [_figure(found)]),
        Section("Inputs", [Items(notes) if notes else Text("Every row was used.")]),
    ]
    return Page(
        title="A model on these data",
        lead=f"The model {model} compared with the plain curve.",
        verdict=[verdict(found)],
        sections=sections,
        provenance=provenance,
    )


def _figure(found: Evaluation) -> Figure:
    together = [found.total] if len(found.recordings) > 1 else []
    parts = [*found.recordings, *together]
    names = [one.recording or "all" for one in parts]
    bars = {
        "plain curve": [one.plain for one in parts],
        "model as written": [one.as_written.rmse for one in parts],
        "model, curve refitted": [one.refitted.rmse for one in parts],
    }
    data = [
        {"type": "bar", "name": name, "x": names, "y": values, "hovertemplate": "%{y:.4g}",
         "marker": {"color": colour}}
        for (name, values), colour in zip(bars.items(), COLOURS, strict=True)
    ]  # fmt: skip
    layout = {"barmode": "group", "yaxis": {"title": {"text": "RMSE of the adhesion"}}}
    return Figure(f"{TITLE}: lower is better.", data, layout)


def _rows(found: Evaluation) -> list[tuple[str, ...]]:
    several = len(found.surfaces) > len(found.recordings)
    rows = []
    for recording in found.recordings:
        rows.append(_row(recording.recording, recording))
        if several:
            own = [one for one in found.surfaces if one.recording == recording.recording]
            rows += [_row(f"  {_span(one, recording)}", one) for one in own]
    if len(found.recordings) > 1:
        rows.append(_row("all", found.total))
    return rows


def _span(part: PartEvaluation, recording: PartEvaluation) -> str:
    """Span of a surface, s since the recording began."""
    return f"{part.from_s - recording.from_s:.1f} .. {part.to_s - recording.from_s:.1f} s"


def _row(name: str, part: PartEvaluation) -> tuple[str, ...]:
    cells = [name, str(part.samples), short(part.plain)]
    for one in (part.as_written, part.refitted):
        cells += [short(one.rmse), _gain(one)]
    return tuple(cells)


def _gain(one: Comparison) -> str:
    low, high = one.interval
    text = f"{one.percent:.1f} %"
    return f"{text} ({low:.1f} to {high:.1f})" if isfinite(low) else text


def _change(one: Comparison) -> str:
    way = "below" if one.percent >= 0.0 else "above"
    return f"{abs(one.percent):.1f} % {way}"


def _is_sure(one: Comparison) -> bool:
    return one.percent > 0.0 and not one.interval[0] <= 0.0
