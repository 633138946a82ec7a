"""`identify`: one batch fit, its standard errors, and whether the peak is identifiable."""

import argparse
from collections.abc import Iterator, Sequence
from itertools import chain
from pathlib import Path
from typing import Any

from rich.console import RenderableType

from adhesion_can.api.identification import ALL_CURVES, families_by_option
from adhesion_can.api.samples import (
    LoadedSamples,
    are_tables,
    load_recording_samples,
    load_table_samples,
)
from adhesion_can.cli.common import (
    add_columns,
    add_configuration,
    add_model,
    configuration,
    left_out_lines,
)
from adhesion_can.cli.next_step import typed_words
from adhesion_can.cli.outputs import add_json, require_outputs
from adhesion_can.cli.reading import reading
from adhesion_can.cli.reports import Result
from adhesion_can.config import Configuration
from adhesion_can.errors import InputError
from adhesion_can.estimation.batch_fit import identify
from adhesion_can.estimation.batch_result import BatchResult, peak_cells
from adhesion_can.estimation.extended.model import ExtendedModel
from adhesion_can.physics.curves import FAMILIES
from adhesion_can.physics.estimate import Estimate
from adhesion_can.recordings.sequence import open_recordings
from adhesion_can.reporting.curves import family_lines, render_curves
from adhesion_can.reporting.next_steps.after_recording import after_identification
from adhesion_can.reporting.provenance import provenance
from adhesion_can.reporting.text import FittingTable

WORTH_TELLING = 0.02
"""Deviation from 1 from which a mean factor of the adhesion is reported."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the description and the options of the command to its parser."""
    parser.description = (
        "Fits the adhesion curve to recordings or tables of samples, one curve for each "
        "surface, and reports what is identifiable. The peak is pooled over the "
        "curve families that fit; c1, c2 and c3 are Burckhardt's."
    )
    parser.add_argument("inputs", nargs="+", type=Path, metavar="LOG|TABLE")
    add_model(parser, "its effects are removed, and its base curve is fitted")
    parser.add_argument(
        "--curve",
        choices=(*FAMILIES, ALL_CURVES),
        help="also fit a curve of this family, or compare all families by held-out score",
    )
    add_columns(parser)
    add_json(parser)
    add_configuration(parser)


def run(options: argparse.Namespace) -> int:
    """Run the command."""
    config = configuration(options)
    require_outputs(options, [*options.inputs, config.database.path])
    loaded = _load(options.inputs, config)
    problems, left_out = loaded.problems, loaded.left_out
    settings, noise = config.estimators.identifiability, config.estimators.noise
    families = families_by_option(options.curve)
    result = identify(
        loaded.samples,
        settings,
        labels=loaded.labels,
        families=families,
        noise=noise,
        judge_family=True,
    )
    if result is None:
        raise InputError(
            ", ".join(map(str, options.inputs)),
            "no usable sample (a moving vehicle, slip within the curve's range)",
            "; ".join(left_out_lines(left_out)) or "see the result of 'adhesion-can check'",
        )
    extension = {} if config.model is None else _extension_json(config.model, loaded)
    tables = are_tables(options.inputs, config)
    notes = [*problems, *left_out_lines(left_out)]
    Result(
        document={**result.to_dict(), **extension, "problems": problems},
        origin=provenance(config, options.inputs),
        parts=chain(_parts(result, notes, config.model, loaded.factor), render_curves(result)),
        step=after_identification(result, typed_words(options, options.inputs, tables=tables)),
    ).deliver(options)
    return 0


def _load(paths: Sequence[Path], config: Configuration) -> LoadedSamples:
    if are_tables(paths, config):
        return load_table_samples(paths, config)
    recordings = open_recordings(paths)
    with reading("reading", recordings) as watched:
        return load_recording_samples(recordings, config, watched)


def _extension_json(model: ExtendedModel, loaded: LoadedSamples) -> dict[str, Any]:
    """Curve that was fitted, and the effects that were removed before."""
    document = model.to_dict()
    return {
        "curve": "base curve of the extended model",
        "effects": document["effects"],
        "splines": document["splines"],
        "mean_factor": loaded.factor,
        "left_out_by_model": dict(loaded.left_out),
    }


def _parts(
    result: BatchResult, notes: list[str], model: ExtendedModel | None, factor: float
) -> Iterator[RenderableType]:
    yield from family_lines(result)
    rows = [(result.times.span(s.from_us, s.to_us), *_cells(s.estimate)) for s in result.segments]
    if len(result.segments) > 1:
        identifiable, _, _, *others = _cells(result.whole)
        rows.append(("all together", identifiable, "-", "-", *others))
    columns = ("time s", "identifiable", "mu_max", "lambda_m", "samples", "c1", "c2", "c3", "noise")
    yield FittingTable(f"Batch fit, ± standard deviation{result.times.note}", columns, rows)
    if model is not None:
        effects = ", ".join(model.names) or "no effects"
        yield f"Base curve of the extended model {model.where}: without {effects}."
        if abs(factor - 1.0) > WORTH_TELLING:
            yield (
                f"In these data its effects multiply the adhesion by {factor:.3g} on average: "
                f"mu_max is {factor * result.whole.mu_max:.4f} there."
            )
    if len(result.segments) > 1:
        yield (
            f"The curve changed {len(result.segments) - 1} times: a single curve does not "
            "describe the data; see the surfaces."
        )
    yield from filter(None, (segment.sentence(result.times) for segment in result.segments))
    yield from notes


def _cells(e: Estimate) -> tuple[str, ...]:
    known = e.identifiable
    peak = {(True, True): "yes", (True, False): "height only", (False, True): "place only"}
    return (
        peak.get((known.mu_max, known.lambda_m), "no"),
        *peak_cells(e),
        str(e.samples),
        f"{e.c1:.4f}",
        f"{e.c2:.2f}",
        f"{e.c3:.4f}",
        f"{e.noise_std:.4f}",
    )
