"""Page of a diagnosis; every section is always there, with a sentence where it is empty."""

from collections.abc import Mapping, Sequence

from adhesion_can.diagnosis.formatting import rival_title
from adhesion_can.diagnosis.result import Diagnosis, SegmentResult
from adhesion_can.physics.estimate import Estimate
from adhesion_can.reporting.diagnosed_drives import recording_times
from adhesion_can.reporting.diagnosis import (
    closest_sentences,
    has_extension,
    needed_sentence,
    verdict_sentences,
    widest_environments,
)
from adhesion_can.reporting.diagnosis_figures import (
    curve_figure,
    environment_figure,
    family_figure,
    gain_figure,
    model_figure,
    prediction_figure,
    profile_figure,
    simulation_figure,
)
from adhesion_can.reporting.diagnosis_tables import (
    CHANNEL_COLUMNS,
    ENVIRONMENT_COLUMNS,
    EVIDENCE_COLUMNS,
    EVIDENCE_NOTE,
    FAMILY_COLUMNS,
    FAMILY_TITLE,
    SHAPE_NOTE,
    cause_rows,
    channel_rows,
    decision_note,
    environment_rows,
    evidence_rows,
    evidence_title,
    family_rows,
    is_shape_named,
    untested_outcome,
)
from adhesion_can.reporting.model_parts import model_parts
from adhesion_can.reporting.page import Items, Page, Part, Table, Text
from adhesion_can.result_text import HELD_OUT_RMSE, beginnings, plus_minus


def page(
    found: Diagnosis,
    provenance: Mapping[str, str],
    problems: Sequence[str] = (),
    drives: Sequence[Part] = (),
) -> Page:
    """Build the page of a diagnosis.

    Args:
        found: Result of the diagnosis.
        provenance: Version, command, database and configuration by name.
        problems: Sentence for each problem of an input.
        drives: list[Part] that show the recordings over time; () where there are none.

    """
    sections: dict[str, Sequence[Part]] = {
        "What the simulation gets wrong": _wrong(found),
        "Refuted explanations that help": [
            Items(closest_sentences(found))
            if found.closest
            else Text("No helpful explanation was refuted.")
        ],
        "One size everywhere?": _environments(found),
        "Gain": _gain(found),
        "Measured and simulated": _simulation_plots(found),
        **({"Drives over time": drives} if drives else {}),
        "Residual": _profile(found),
        "Curve and data": _curve(found),
        "Evidence for every effect": _evidence(found),
        "Channels": _channels(found),
        "What would distinguish the rivals": [*_rivals(found), *_drives_that_tell(found)],
        "Not tested or rejected": _untested(found),
        "Extended model": _model(found),
        "Inputs": _inputs(found, problems),
    }
    return Page(
        title="What the simulation gets wrong, and why",
        lead=_lead(found),
        verdict=verdict_sentences(found),
        sections=sections,
        provenance=provenance,
        next_step=found.next_step,
        begin=beginnings([*found.begins.items()]),
    )


def _lead(found: Diagnosis) -> str:
    held = found.held_out_files
    used = [file.name for file in found.input_files if file.name not in held]
    text = f"Diagnosis of {', '.join(used)}"
    if held:
        text += f"; held out for the gain: {', '.join(sorted(held))}"
    return (
        f"{text}. The simulation is the adhesion curve μ(λ) = c1(1 − e^(−c2 λ)) − c3 λ with the "
        "configured vehicle. Its residual is tested against the known effects, alone and in "
        "pairs, and against every measured channel."
    )


# ----------------------------------------------------------------------------------- sections


def _wrong(found: Diagnosis) -> list[Part]:
    parts: list[Part] = [
        Items(found.wrong) if found.wrong else Text("Nothing, as far as these data show.")
    ]
    if found.causes:
        columns = ("effect", "parameter", "value", "meaning")
        parts.append(
            Table("Named effects, ± standard deviation.", columns, cause_rows(found.causes),
                  sentence_columns=(3,))
        )  # fmt: skip
        about = [f"Literature on {c.effect}: {c.literature}." for c in found.causes]
        parts.append(Items(about))
    return parts


def _environments(found: Diagnosis) -> list[Part]:
    if not found.environments:
        return [
            Text(
                "No named or refuted effect has a size that can be compared between parts of the "
                "data."
            )
        ]
    parts: list[Part] = [
        Text(
            "The size of each effect is estimated again in parts of the data. A cause has one "
            "size: sizes that differ significantly and by more than 30 % refute it."
        )
    ]
    for effect in dict.fromkeys(one.effect for one in found.environments):
        environments = [one for one in found.environments if one.effect == effect]
        parts.append(environment_figure(environments))
    widest = environment_rows(widest_environments(found))
    caption = "The partition in which the sizes of each effect differ most, ± standard deviation."
    return [*parts, Table(caption, ENVIRONMENT_COLUMNS, widest)]


def _gain(found: Diagnosis) -> list[Part]:
    if found.gain is None:
        return [Text("Not measured: the data are not sufficient for a verdict.")]
    gain = found.gain
    spans: dict[str, list[str]] = {}
    for name, begin, end in gain.spans:
        times = recording_times(found, name)
        span = f"{times.seconds(begin):.1f} to {times.seconds(end):.1f} s"
        spans.setdefault(name, []).append(span)
    held = [f"Held out of {name}: {', '.join(own)}." for name, own in spans.items()]
    figure = gain_figure(gain, extended=has_extension(found))
    return [figure, Items(held)] if held else [figure]


def _simulation_plots(found: Diagnosis) -> list[Part]:
    prediction = found.plots.prediction
    if prediction is not None:
        return [prediction_figure(prediction, extended=has_extension(found))]
    if not found.plots.simulations:
        return [Text("There is no span to show.")]
    return [
        simulation_figure(one, recording_times(found, one.recording), extended=has_extension(found))
        for one in found.plots.simulations
    ]


def _profile(found: Diagnosis) -> list[Part]:
    if found.profile is None:
        return [Text("No channel was named, so there is no residual to show over one.")]
    return [profile_figure(found.profile)]


def _curve(found: Diagnosis) -> list[Part]:
    parts: list[Part] = []
    longest, curves = found.longest_segment, found.curves
    if longest is not None and curves is not None:
        times, extended = recording_times(found, longest.recording), has_extension(found)
        parts.append(curve_figure(longest, times, curves, extended=extended))
    if found.families and curves is not None:
        parts += [family_figure(found.families, curves), _family_table(found)]
    if found.surfaces:
        parts.append(_surface_table(found, extended=has_extension(found)))
    return parts or [Text("No curve could be fitted.")]


def _surface_table(found: Diagnosis, *, extended: bool) -> Table:
    def name(s: SegmentResult) -> str:
        times = recording_times(found, s.recording)
        return f"{s.recording}, {times.seconds(s.from_s):.0f} to {times.seconds(s.to_s):.0f} s"

    def cells(e: Estimate) -> tuple[str, ...]:
        known = e.identifiable
        return (
            plus_minus(e.mu_max, e.mu_max_std if known.mu_max else None),
            plus_minus(e.lambda_m, e.lambda_m_std if known.lambda_m else None),
            f"{e.c1:.4f}",
            f"{e.c2:.2f}",
            f"{e.c3:.4f}",
        )

    rows = [
        (name(s), which, *cells(estimate))
        for s in found.surfaces
        for which, estimate in (("plain", s.base), ("extended", s.extended))[: 1 + extended]
    ]
    columns = ("surface", "model", "μ_max", "λ_m", "c1", "c2", "c3")
    also = ", and the extended model's base curve" if extended else ""
    return Table(
        f"Every surface: the plain curve{also}, ± standard deviation.",
        columns,
        rows,
        "± ?: not identifiable from these data.",
    )


def _family_table(found: Diagnosis) -> Table:
    note = (
        f"{HELD_OUT_RMSE}: RMSE of the whitened residuals, each block predicted from the others, "
        "in standard deviations σ of the noise; smaller is better. RMSE: of the adhesion on the "
        "deciding data, to which the curves are fitted. Another family replaces Burckhardt's only "
        "if its gain is significant and no effect explains as much."
    )
    caption = f"{FAMILY_TITLE}; peaks at the mean speed and load."
    note = f"{note} {SHAPE_NOTE}" if is_shape_named(found) else note
    return Table(caption, FAMILY_COLUMNS, family_rows(found.families), note)


def _evidence(found: Diagnosis) -> list[Part]:
    if not evidence_rows(found.evidence):
        return [Text("No effect could be tested.")]
    note = (
        f"{EVIDENCE_NOTE} {decision_note(found.evidence)} Effects that the curve imitates are "
        "listed under 'Not tested or rejected'."
    )
    rows = evidence_rows(found.evidence)
    caption = f"{evidence_title(found.evidence)}."
    parts: list[Part] = [model_figure(found.models)] if len(found.models) > 1 else []
    return [*parts, Table(caption, EVIDENCE_COLUMNS, rows, note)]


def _channels(found: Diagnosis) -> list[Part]:
    if not found.channels:
        return [Text("No channel could be tested.")]
    note = (
        "A smooth curve in each channel is fitted to the residual. p: p-value, corrected for "
        "all channels. gain: reduction of the RMSE of the adhesion on the deciding data by this "
        "curve."
    )
    caption = "Residual on the deciding data by channel, with the named effects in the model."
    return [Table(caption, CHANNEL_COLUMNS, channel_rows(found.channels), note)]


def _drives_that_tell(found: Diagnosis) -> list[Part]:
    """What a drive left of the explanations, and the next one that would separate."""
    parts: list[Part] = []
    if found.remaining is not None:
        parts.append(Text(found.remaining.sentence))
    next_drive = found.next_drive
    if next_drive is None:
        return parts
    parts.append(Text(next_drive.sentence))
    if next_drive.plan is not None:
        rows = [
            (str(number), f"{step.duration_s:g}", step.description)
            for number, step in enumerate(next_drive.plan.steps, start=1)
        ]
        parts.append(
            Table("The drive that distinguishes the explanations.", ("step", "s", "what"), rows)
        )
        pairs = [
            (pair.explanation, pair.rival, f"{pair.discrepancy:.0f}", f"{100 * pair.power:.0f} %")
            for pair in next_drive.pairs
        ]
        columns = ("if this is true", "this is refuted", "T", "with a probability of")
        note = (
            "T: misfit of the second explanation, fitted to what the first one predicts, in "
            "variances of the noise. Explanations are the cause, its rivals and others that remain."
        )
        caption = "Power of this drive to distinguish the explanations."
        parts.append(Table(caption, columns, pairs, note))
    return parts


def _rivals(found: Diagnosis) -> list[Part]:
    rivals = dict.fromkeys(rival for cause in found.causes for rival in cause.rivals)
    needed = needed_sentence(found)
    if not rivals:
        return [Text(needed or "There are no rivals to distinguish.")]
    return [
        Text("Effects that these data cannot distinguish from the named one:"),
        Items([f"{rival}: {rival_title(rival)}" for rival in rivals]),
        Text(needed or "No known manoeuvre or signal would distinguish them."),
    ]


def _untested(found: Diagnosis) -> list[Part]:
    if not found.untested:
        return [Text("Everything was tested.")]
    rows = [
        (one.what, untested_outcome(one, found.evidence), one.why)
        for one in sorted(found.untested, key=lambda one: not one.rejected)
    ]
    note = (
        "not tested: the data do not identify it. rejected: tested, and not confirmed. refuted: "
        "tested, and ruled out as a cause."
    )
    columns = ("what", "outcome", "why")
    return [Table("What is no finding, and why.", columns, rows, note, sentence_columns=(1, 2))]


def _model(found: Diagnosis) -> list[Part]:
    if found.model is None or not has_extension(found):
        return [Text("There is no extension: the plain curve remains.")]
    return model_parts(found.model, {cause.effect for cause in found.causes})


def _inputs(found: Diagnosis, problems: Sequence[str]) -> list[Part]:
    held = found.held_out_files
    rows = [
        (
            s.name,
            "held out for the gain" if s.name in held else "diagnosed",
            str(found.samples.get(s.name, 0)),
            s.sha256,
        )
        for s in found.input_files
    ]
    parts: list[Part] = [Table("Files, and the rows used of each.", _INPUT_COLUMNS, rows)]
    lost = [f"{count}: {reason}" for reason, count in found.lost.items() if count]
    if lost:
        parts += [Text("Rows and signals not used:"), Items(lost)]
    if problems:
        parts += [Text("Notes on the files:"), Items(problems)]
    return parts


_INPUT_COLUMNS = ("file", "use", "rows", "sha256")
