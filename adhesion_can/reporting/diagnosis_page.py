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
    diagnosis: Diagnosis,
    provenance: Mapping[str, str],
    problems: Sequence[str] = (),
    drives: Sequence[Part] = (),
) -> Page:
    """Build the page of a diagnosis.

    Args:
        diagnosis: Result of the diagnosis.
        provenance: Version, command, database and configuration by name.
        problems: Sentence for each problem of an input.
        drives: Parts that show the recordings over time; () where there are none.

    """
    sections: dict[str, Sequence[Part]] = {
        "What the simulation gets wrong": _wrong(diagnosis),
        "Refuted explanations that help": [
            Items(closest_sentences(diagnosis))
            if diagnosis.closest
            else Text("No helpful explanation was refuted.")
        ],
        "One size everywhere?": _environments(diagnosis),
        "Gain": _gain(diagnosis),
        "Measured and simulated": _simulation_plots(diagnosis),
        **({"Drives over time": drives} if drives else {}),
        "Residual": _profile(diagnosis),
        "Curve and data": _curve(diagnosis),
        "Evidence for every effect": _evidence(diagnosis),
        "Channels": _channels(diagnosis),
        "What would distinguish the rivals": [*_rivals(diagnosis), *_drives_that_tell(diagnosis)],
        "Not tested or rejected": _untested(diagnosis),
        "Extended model": _model(diagnosis),
        "Inputs": _inputs(diagnosis, problems),
    }
    return Page(
        title="What the simulation gets wrong, and why",
        lead=_lead(diagnosis),
        verdict=verdict_sentences(diagnosis),
        sections=sections,
        provenance=provenance,
        next_step=diagnosis.next_step,
        begin=beginnings([*diagnosis.begins.items()]),
    )


def _lead(diagnosis: Diagnosis) -> str:
    held = diagnosis.held_out_files
    used = [file.name for file in diagnosis.input_files if file.name not in held]
    text = f"Diagnosis of {', '.join(used)}"
    if held:
        text += f"; held out for the gain: {', '.join(sorted(held))}"
    return (
        f"{text}. The simulation is the adhesion curve μ(λ) = c1(1 − e^(−c2 λ)) − c3 λ with the "
        "configured vehicle. Its residual is tested against the known effects, alone and in "
        "pairs, and against every measured channel."
    )


# ----------------------------------------------------------------------------------- sections


def _wrong(diagnosis: Diagnosis) -> list[Part]:
    parts: list[Part] = [
        Items(diagnosis.wrong) if diagnosis.wrong else Text("Nothing, as far as these data show.")
    ]
    if diagnosis.causes:
        columns = ("effect", "parameter", "value", "meaning")
        parts.append(
            Table("Named effects, ± standard deviation.", columns, cause_rows(diagnosis.causes),
                  sentence_columns=(3,))
        )  # fmt: skip
        about = [f"Literature on {c.effect}: {c.literature}." for c in diagnosis.causes]
        parts.append(Items(about))
    return parts


def _environments(diagnosis: Diagnosis) -> list[Part]:
    if not diagnosis.environments:
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
    for effect in dict.fromkeys(partition.effect for partition in diagnosis.environments):
        environments = [
            partition for partition in diagnosis.environments if partition.effect == effect
        ]
        parts.append(environment_figure(environments))
    widest = environment_rows(widest_environments(diagnosis))
    caption = "The partition in which the sizes of each effect differ most, ± standard deviation."
    return [*parts, Table(caption, ENVIRONMENT_COLUMNS, widest)]


def _gain(diagnosis: Diagnosis) -> list[Part]:
    if diagnosis.gain is None:
        return [Text("Not measured: the data are not sufficient for a verdict.")]
    gain = diagnosis.gain
    spans: dict[str, list[str]] = {}
    for name, begin, end in gain.spans:
        times = recording_times(diagnosis, name)
        span = f"{times.seconds(begin):.1f} to {times.seconds(end):.1f} s"
        spans.setdefault(name, []).append(span)
    held = [f"Held out of {name}: {', '.join(span_texts)}." for name, span_texts in spans.items()]
    figure = gain_figure(gain, extended=has_extension(diagnosis))
    return [figure, Items(held)] if held else [figure]


def _simulation_plots(diagnosis: Diagnosis) -> list[Part]:
    prediction = diagnosis.plots.prediction
    if prediction is not None:
        return [prediction_figure(prediction, extended=has_extension(diagnosis))]
    if not diagnosis.plots.simulations:
        return [Text("There is no span to show.")]
    return [
        simulation_figure(
            plot, recording_times(diagnosis, plot.recording), extended=has_extension(diagnosis)
        )
        for plot in diagnosis.plots.simulations
    ]


def _profile(diagnosis: Diagnosis) -> list[Part]:
    if diagnosis.profile is None:
        return [Text("No channel was named, so there is no residual to show over one.")]
    return [profile_figure(diagnosis.profile)]


def _curve(diagnosis: Diagnosis) -> list[Part]:
    parts: list[Part] = []
    longest, curves = diagnosis.longest_segment, diagnosis.curves
    if longest is not None and curves is not None:
        times, extended = recording_times(diagnosis, longest.recording), has_extension(diagnosis)
        parts.append(curve_figure(longest, times, curves, extended=extended))
    if diagnosis.families and curves is not None:
        parts += [family_figure(diagnosis.families, curves), _family_table(diagnosis)]
    if diagnosis.surfaces:
        parts.append(_surface_table(diagnosis, extended=has_extension(diagnosis)))
    return parts or [Text("No curve could be fitted.")]


def _surface_table(diagnosis: Diagnosis, *, extended: bool) -> Table:
    def name(s: SegmentResult) -> str:
        times = recording_times(diagnosis, s.recording)
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
        for s in diagnosis.surfaces
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


def _family_table(diagnosis: Diagnosis) -> Table:
    note = (
        f"{HELD_OUT_RMSE}: RMSE of the whitened residuals, each block predicted from the others, "
        "in standard deviations σ of the noise; smaller is better. RMSE: of the adhesion on the "
        "deciding data, to which the curves are fitted. Another family replaces Burckhardt's only "
        "if its gain is significant and no effect explains as much."
    )
    caption = f"{FAMILY_TITLE}; peaks at the mean speed and load."
    note = f"{note} {SHAPE_NOTE}" if is_shape_named(diagnosis) else note
    return Table(caption, FAMILY_COLUMNS, family_rows(diagnosis.families), note)


def _evidence(diagnosis: Diagnosis) -> list[Part]:
    if not evidence_rows(diagnosis.evidence):
        return [Text("No effect could be tested.")]
    note = (
        f"{EVIDENCE_NOTE} {decision_note(diagnosis.evidence)} Effects that the curve imitates are "
        "listed under 'Not tested or rejected'."
    )
    rows = evidence_rows(diagnosis.evidence)
    caption = f"{evidence_title(diagnosis.evidence)}."
    parts: list[Part] = [model_figure(diagnosis.models)] if len(diagnosis.models) > 1 else []
    return [*parts, Table(caption, EVIDENCE_COLUMNS, rows, note)]


def _channels(diagnosis: Diagnosis) -> list[Part]:
    if not diagnosis.channels:
        return [Text("No channel could be tested.")]
    note = (
        "A smooth curve in each channel is fitted to the residual. p: p-value, corrected for "
        "all channels. gain: reduction of the RMSE of the adhesion on the deciding data by this "
        "curve."
    )
    caption = "Residual on the deciding data by channel, with the named effects in the model."
    return [Table(caption, CHANNEL_COLUMNS, channel_rows(diagnosis.channels), note)]


def _drives_that_tell(diagnosis: Diagnosis) -> list[Part]:
    """What a drive left of the explanations, and the next one that would separate."""
    parts: list[Part] = []
    if diagnosis.remaining is not None:
        parts.append(Text(diagnosis.remaining.sentence))
    next_drive = diagnosis.next_drive
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


def _rivals(diagnosis: Diagnosis) -> list[Part]:
    rivals = dict.fromkeys(rival for cause in diagnosis.causes for rival in cause.rivals)
    needed = needed_sentence(diagnosis)
    if not rivals:
        return [Text(needed or "There are no rivals to distinguish.")]
    return [
        Text("Effects that these data cannot distinguish from the named one:"),
        Items([f"{rival}: {rival_title(rival)}" for rival in rivals]),
        Text(needed or "No known manoeuvre or signal would distinguish them."),
    ]


def _untested(diagnosis: Diagnosis) -> list[Part]:
    if not diagnosis.untested:
        return [Text("Everything was tested.")]
    rows = [
        (untested.what, untested_outcome(untested, diagnosis.evidence), untested.why)
        for untested in sorted(diagnosis.untested, key=lambda effect: not effect.rejected)
    ]
    note = (
        "not tested: the data do not identify it. rejected: tested, and not confirmed. refuted: "
        "tested, and ruled out as a cause."
    )
    columns = ("what", "outcome", "why")
    return [Table("What is no finding, and why.", columns, rows, note, sentence_columns=(1, 2))]


def _model(diagnosis: Diagnosis) -> list[Part]:
    if diagnosis.model is None or not has_extension(diagnosis):
        return [Text("There is no extension: the plain curve remains.")]
    return model_parts(diagnosis.model, {cause.effect for cause in diagnosis.causes})


def _inputs(diagnosis: Diagnosis, problems: Sequence[str]) -> list[Part]:
    held = diagnosis.held_out_files
    rows = [
        (
            s.name,
            "held out for the gain" if s.name in held else "diagnosed",
            str(diagnosis.samples.get(s.name, 0)),
            s.sha256,
        )
        for s in diagnosis.input_files
    ]
    parts: list[Part] = [Table("Files, and the rows used of each.", _INPUT_COLUMNS, rows)]
    lost = [f"{count}: {reason}" for reason, count in diagnosis.lost.items() if count]
    if lost:
        parts += [Text("Rows and signals not used:"), Items(lost)]
    if problems:
        parts += [Text("Notes on the files:"), Items(problems)]
    return parts


_INPUT_COLUMNS = ("file", "use", "rows", "sha256")
