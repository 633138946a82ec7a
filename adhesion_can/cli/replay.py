"""`replay`: the service over recordings, with its frames, its setpoints and its misfit."""

import argparse
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from functools import partial
from itertools import chain
from math import isfinite
from pathlib import Path
from typing import Any

from rich.console import RenderableType

from adhesion_can.api.replayed_models import ReplayedModels
from adhesion_can.bus.block import Block, Kind
from adhesion_can.bus.frame import Frame
from adhesion_can.cli.common import (
    MODEL_ONLINE,
    add_configuration,
    add_model,
    configuration,
    left_out_lines,
    tell_all,
)
from adhesion_can.cli.next_step import typed_words
from adhesion_can.cli.outputs import add_file, add_json, require_candump_name, require_outputs
from adhesion_can.cli.reading import reading
from adhesion_can.cli.reports import Result, add_report, is_asked_for
from adhesion_can.config import Configuration
from adhesion_can.errors import InputError
from adhesion_can.estimation.registry import known_estimators
from adhesion_can.files import whole_file
from adhesion_can.offline.fit_errors import CurveMisfit, MisfitCollector
from adhesion_can.offline.missing_samples import describe_dropped
from adhesion_can.offline.recording_fit import SeenIds, require_accepted, require_fit
from adhesion_can.offline.stamps import in_seconds
from adhesion_can.physics.samples import Samples
from adhesion_can.physics.status import Status
from adhesion_can.recordings.candump import format_frame
from adhesion_can.recordings.problems import describe_problems
from adhesion_can.recordings.sequence import blocks_in_sequence, open_recordings
from adhesion_can.reporting.drive.page import page
from adhesion_can.reporting.drive.recorder import DriveRecorder
from adhesion_can.reporting.drive.replayed import replay_texts
from adhesion_can.reporting.export.target import require_format
from adhesion_can.reporting.next_steps.after_recording import after_replay
from adhesion_can.reporting.page import Page
from adhesion_can.reporting.provenance import provenance, texts
from adhesion_can.reporting.sample_rows import sample_table
from adhesion_can.reporting.setpoint_counts import SetpointCounts
from adhesion_can.reporting.setpoints import setpoint_table
from adhesion_can.reporting.text import FittingTable
from adhesion_can.result_text import plus_minus
from adhesion_can.service.core import ServiceCore
from adhesion_can.service.outputs import Outputs
from adhesion_can.service.replay import ReplaySummary, require_frames_in_span


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the description and the options of the command to its parser."""
    parser.description = (
        "Runs the service over recordings, as it would have run live. At the end come the RMSE "
        "of the adhesion around the best-fitting curve, with the effects of --model if given, and "
        "what to do next. "
        "The share by which --model reduces it agrees with the gain that 'diagnose' reports."
    )
    parser.add_argument("log", nargs="+", type=Path, metavar="LOG")
    sent = "write the sent frames (candump)"
    add_file(parser, "--frames", "OUT.log", sent, require_candump_name)
    rows = "write one row per setpoint; in MF4, time starts at the first one"
    add_file(parser, "--table", "OUT.csv|.parquet|.mf4", rows, require_format)
    rows = "write one row per sample; 'identify' and 'diagnose' read it as a TABLE"
    add_file(parser, "--samples", "F.csv|.parquet|.mf4", rows, require_format)
    parser.add_argument(
        "--estimator", metavar="NAME", help=f"one of {', '.join(known_estimators())}"
    )
    span = parser.add_argument_group("part of the recording, in s after its first frame")
    span.add_argument("--from", dest="from_s", type=float, default=0.0, metavar="S")
    span.add_argument("--to", dest="to_s", type=float, metavar="S")
    parser.add_argument(
        "--realtime", action="store_true", help="at the original speed of the recording"
    )
    add_model(parser, MODEL_ONLINE)
    add_report(parser)
    add_json(parser)
    add_configuration(parser)


def run(options: argparse.Namespace) -> int:
    """Run the command."""
    _require_span(options)
    config = configuration(options)
    require_outputs(options, [*options.log, config.database.path])
    config.find_estimator(options.estimator)  # an unknown name is an error before the work
    recordings = open_recordings(options.log)
    models = ReplayedModels(recordings)
    origin = provenance(config, options.log)
    slip_max = config.estimators.identifiability.slip_max
    recorder, has_page = DriveRecorder(slip_max), is_asked_for(options)
    setpoints = recorder.counts
    collector, channel, seen = MisfitCollector(config), _Channel(), SeenIds()
    of_setpoints: list[Callable[[int, Outputs], None]] = [
        recorder.add if has_page else setpoints.add
    ]
    of_samples: list[Callable[[Samples], None]] = [collector.add]
    with ExitStack() as stack:
        if options.table:
            table = setpoint_table(
                options.table, texts(origin), speed_observed=config.observes_speed
            )
            of_setpoints.append(stack.enter_context(table))
        if options.samples:
            to_table = stack.enter_context(
                sample_table(options.samples, texts(origin), config.covariates(), slip_max)
            )
            of_samples.append(lambda samples: to_table(samples, core.estimate))
        if has_page:
            of_samples.append(recorder.add_samples)
        frames = stack.enter_context(whole_file(options.frames)) if options.frames else None

        def send(frame: Frame) -> None:
            if frames is not None:
                frames.write(format_frame(frame, channel.name))

        watched = stack.enter_context(reading("replaying", recordings))
        where = ", ".join(map(str, options.log))
        span = {"from_s": options.from_s, "to_s": options.to_s}
        core = models.make_core(
            config,
            options.estimator,
            on_setpoint=partial(tell_all, of_setpoints),
            on_samples=partial(tell_all, of_samples),
            on_readings=recorder.add_readings if has_page else None,
        )
        read = watched(blocks_in_sequence(recordings, config.service.restart_s))
        blocks = channel.watch(seen.watch(in_seconds(read, config.messages, where)))
        summary = models.run(blocks, core, send, **span, realtime=options.realtime)
        for recording in recordings:
            summary.kinds.update(recording.report.kinds)
        require_frames_in_span(summary, options.from_s, where)
        require_accepted(core.receiver, summary.frames, seen, config, where)
    # The setpoints that were due stay written, though none of them has a value.
    samples = core.counts.samples
    require_fit(core.receiver, summary.frames, seen, config, where, samples=samples)
    problems = describe_problems(recordings)
    changed = list(models.sentences(summary.first_us or 0))
    misfit = collector.compute()
    fit = _describe_fit(misfit, config)
    step = after_replay(
        core.estimate,
        setpoints.doubts,
        setpoints.objections,
        typed_words(options, options.log),
        None if samples else describe_dropped(core.dropped_samples, config),
    )

    def build_page(said: dict[str, str]) -> Page:
        about = replay_texts(summary, core, problems, [fit, *changed], said)
        return page(recorder.result(), about, config)

    Result(
        document=_document(summary, core, setpoints, problems, misfit) | models.to_dict(),
        origin=origin,
        parts=chain(_parts(summary, core, setpoints, problems), [fit, *changed]),
        step=step,
        page=build_page,
    ).deliver(options)
    return 0


def _require_span(options: argparse.Namespace) -> None:
    """Raise an InputError where --from and --to are no part of a recording."""
    for option, value in (("--from", options.from_s), ("--to", options.to_s)):
        if value is not None and not (isfinite(value) and value >= 0):
            raise InputError(option, f"{value} is not a time", "give seconds, 0 or more")
    if options.to_s is not None and options.to_s < options.from_s:
        raise InputError(
            f"--to {options.to_s:g}",
            f"is before --from {options.from_s:g}",
            "both count from the first frame",
        )


class _Channel:
    """Name of the recording's bus, taken from its first frame, for the frames that are sent."""

    def __init__(self) -> None:
        self.name = "can0"

    def watch(self, blocks: Iterator[Block]) -> Iterator[Block]:
        for count, block in enumerate(blocks):
            if count == 0 and block.kind[0] <= Kind.ERROR:
                self.name = block.channels[block.channel[0]] or self.name
            yield block


def _document(
    summary: ReplaySummary,
    core: ServiceCore,
    setpoints: SetpointCounts,
    problems: list[str],
    misfit: CurveMisfit | None,
) -> dict[str, Any]:
    receiver = core.receiver
    return {
        "frames": summary.frames,
        "frames_own_skipped": summary.own_skipped,
        "frames_foreign": core.counts.foreign,
        "frames_rejected": receiver.rejected,
        "frames_lost": receiver.lost,
        "readings_stuck": receiver.stuck,
        "frames_clamped": core.counts.clamped,
        "frames_sent": summary.sent,
        "lines": dict(summary.kinds),
        "problems": problems,
        "from_s": None if summary.first_us is None else summary.first_us / 1e6,
        "to_s": None if summary.last_us is None else summary.last_us / 1e6,
        "samples": core.counts.samples,
        "samples_dropped": core.dropped_samples,
        "samples_left_out": core.left_out_samples,
        "restarts": core.counts.restarts,
        "faults": core.faults,
        "setpoints_by_status": {s.name: n for s, n in setpoints.by_status.items()},
        "setpoints_by_doubt": {
            doubt.json_name: n for doubt, n in setpoints.by_doubt.items() if doubt.json_name
        },
        "setpoints_by_objection": {
            objection.json_name: n
            for objection, n in setpoints.by_objection.items()
            if objection.json_name
        },
        "last": None if core.estimate is None else core.estimate.to_dict(),
        "fit": None if misfit is None else misfit.to_dict(),
    }


def _parts(
    summary: ReplaySummary, core: ServiceCore, setpoints: SetpointCounts, problems: list[str]
) -> Iterator[RenderableType]:
    receiver = core.receiver
    span = ((summary.last_us or 0) - (summary.first_us or 0)) / 1e6
    yield (
        f"{summary.frames} frames in {span:.1f} s: {receiver.rejected} rejected, {receiver.lost} "
        f"lost, {core.counts.foreign} with other ids, {summary.own_skipped} with the service's "
        f"ids (skipped); {core.counts.samples} samples; {summary.sent} frames sent"
    )
    counts = setpoints.by_status
    rows = [(s.name, str(counts[s]), setpoints.share(counts[s])) for s in Status if s in counts]
    yield FittingTable("Setpoints by status", ("status", "setpoints", "share"), rows)
    if core.estimate is not None:
        e = core.estimate
        yield (
            f"last estimate: mu_max {plus_minus(e.mu_max, e.mu_max_std)}, "
            f"lambda_m {plus_minus(e.lambda_m, e.lambda_m_std)}, "
            f"c1 {e.c1:.4f}, c2 {e.c2:.2f}, c3 {e.c3:.4f}"
        )
    yield from setpoints.objections.sentences()
    yield from setpoints.describe_doubts()
    yield from (*problems, *receiver.stuck_sentences, *core.faults)
    yield from left_out_lines(core.left_out_samples)


def _describe_fit(misfit: CurveMisfit | None, config: Configuration) -> str:
    """Sentence on the error of the adhesion about the best-fitting curves."""
    if misfit is None:
        return "Too few samples for a misfit of the curve."
    count = misfit.segments
    curves = "one curve" if count == 1 else f"{count} curves, one per surface"
    if config.model is not None and config.model.names:
        curves += f" with {', '.join(config.model.names)}"
    return f"RMSE of the adhesion around {curves}: {misfit.rmse:.4f} ({misfit.samples} samples)"
