"""`identify`: one batch fit, its standard errors, and whether the peak is identifiable."""

import argparse
from collections import Counter
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from adhesion_can.cli.common import (
    add_configuration,
    add_json,
    add_model,
    configuration,
    left_out_lines,
    require_outputs,
    talk,
    write_json,
)
from adhesion_can.cli.reading import reading
from adhesion_can.config import Configuration
from adhesion_can.errors import InputError
from adhesion_can.estimation.batch_fit import BatchResult, identify
from adhesion_can.estimation.extended.correction import (
    correct_samples,
    remove_instrument_errors,
    require_columns,
)
from adhesion_can.estimation.extended.estimator import ExtendedModel
from adhesion_can.offline.extract_samples import extract_samples
from adhesion_can.physics.estimate import Estimate
from adhesion_can.physics.samples import Samples
from adhesion_can.recordings.problems import describe_problems, distinct_names
from adhesion_can.recordings.sample_table import Table, is_table, read_table
from adhesion_can.recordings.sequence import blocks_in_sequence, open_recordings
from adhesion_can.reporting.provenance import provenance
from adhesion_can.reporting.text import console, table
from adhesion_can.result_text import plus_minus


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the description and the options of the command to its parser."""
    parser.description = (
        "Fits the adhesion curve to recordings or tables of samples, a curve for each "
        "segment of constant surface, and reports what is identifiable."
    )
    parser.add_argument("inputs", nargs="+", type=Path, metavar="LOG|TABLE")
    add_model(parser, "its effects are removed, and its base curve is fitted")
    add_json(parser)
    add_configuration(parser)
    parser.set_defaults(run=run)


def run(options: argparse.Namespace) -> int:
    """Run the command."""
    config = configuration(options)
    require_outputs(options, {"--json": options.json}, [*options.inputs, config.database.path])
    tables = [path for path in options.inputs if _exists(path) and is_table(path)]
    if tables and len(tables) < len(options.inputs):
        raise InputError("identify", "recordings and tables together", "give one kind at a time")
    if tables:
        samples, labels, problems, left_out = _from_tables(tables, config)
    else:
        samples, problems, left_out = _from_logs(options.inputs, config)
        labels = None
    result = identify(samples, config.estimators.identifiability, labels=labels)
    if result is None:
        raise InputError(
            ", ".join(map(str, options.inputs)),
            "not one usable sample (a moving vehicle, slip within the curve's range)",
            "; ".join(left_out_lines(left_out)) or "see the result of 'adhesion-can check'",
        )
    extension = {} if config.model is None else _extension_json(config.model, left_out)
    write_json(
        options.json,
        {
            **result.to_dict(),
            **extension,
            "problems": problems,
            **provenance(config, options.inputs),
        },
    )
    if talk(options):
        _print(result, [*problems, *left_out_lines(left_out)], config.model)
    return 0


def _extension_json(model: ExtendedModel, left_out: Mapping[str, int]) -> dict[str, Any]:
    """Curve that was fitted, and the effects that were removed before."""
    return {
        "curve": "base curve of the extended model",
        "effects": [
            {
                "effect": active.effect.id,
                "form": active.effect.form,
                "parameters": {
                    p.name: value
                    for p, value in zip(active.effect.parameters, active.values, strict=True)
                },
            }
            for active in model.effects
        ],
        "splines": [{"channel": spline.channel, "kind": spline.kind} for spline in model.splines],
        "left_out_by_model": dict(left_out),
    }


def _exists(path: Path) -> bool:
    if not path.exists():
        raise InputError(str(path), "No such file or directory", "check the path")
    return True


def _from_tables(
    paths: list[Path], config: Configuration
) -> tuple[Samples, Any, list[str], Counter[str]]:
    tables = [read_table(path) for path in paths]
    left_out: Counter[str] = Counter()
    if config.model is not None:
        model = config.model
        tables = [
            _without_effects(t, model, str(path), left_out)
            for path, t in zip(paths, tables, strict=True)
        ]
    problems = [
        f"{name}: {t.left_out} of {t.rows} rows without a finite time, slip and adhesion"
        for name, t in zip(distinct_names(paths), tables, strict=True)
        if t.left_out
    ]
    samples = Samples.concatenate([t.samples for t in tables])
    if len(tables) == 1 and tables[0].segment is None:
        return samples, None, problems, left_out
    # Each table, and each segment of one, is a segment of its own.
    labels, base = [], 0
    for t in tables:
        own = t.segment if t.segment is not None else np.zeros(len(t.samples), dtype=np.int64)
        labels.append(own + base)
        base += int(own.max(initial=0)) + 1
    return samples, np.concatenate(labels), problems, left_out


def _without_effects(
    table: Table, model: ExtendedModel, where: str, left_out: Counter[str]
) -> Table:
    """Rows of a table with the model's effects removed; a table is a drive of its own."""
    require_columns(model, table.samples, where)
    samples = remove_instrument_errors(table.samples, model.instruments, where)
    result = correct_samples(samples, model, int(samples.axle.max(initial=1)))
    left_out.update(result.left_out)
    segment = None if table.segment is None else table.segment[result.kept]
    return replace(table, samples=result.samples, segment=segment)


def _from_logs(paths: list[Path], config: Configuration) -> tuple[Samples, list[str], Counter[str]]:
    recordings = open_recordings(paths)
    with reading("reading", recordings) as watched:
        blocks = watched(blocks_in_sequence(recordings))
        samples, _ = extract_samples(blocks, config, ", ".join(map(str, paths)))
    left_out: Counter[str] = Counter()
    if config.model is not None:
        result = correct_samples(samples, config.model, config.vehicle.axles)
        samples, left_out = result.samples, result.left_out
    return samples, describe_problems(recordings), left_out


def _print(result: BatchResult, problems: list[str], model: ExtendedModel | None) -> None:
    out = console()
    rows = [
        (f"{s.from_us / 1e6:.1f} .. {s.to_us / 1e6:.1f}", *_cells(s.estimate))
        for s in result.segments
    ]
    if len(result.segments) > 1:
        rows.append(("all together", *_cells(result.whole)))
    columns = ("time s", "samples", "mu_max", "lambda_m", "c1", "c2", "c3", "noise", "identifiable")
    out.print(table("Batch fit, ± standard deviation", columns, rows))
    if model is not None:
        effects = ", ".join(model.names) or "no effects"
        where = model.where
        out.print(f"Base curve of the extended model {where}: without {effects}.", markup=False)
    if len(result.segments) > 1:
        out.print(
            f"The curve changed {len(result.segments) - 1} times: one for all does not "
            "describe the data, see the segments."
        )
    vague = [s for s in result.segments if not s.estimate.identifiable.both]
    if vague:
        out.print(
            f"{len(vague)} of {len(result.segments)} segments have no identifiable peak: "
            "their slip stays too small, or the noise is too large."
        )
    for line in problems:
        out.print(line, markup=False)


def _cells(e: Estimate) -> tuple[str, ...]:
    known = e.identifiable
    peak = {(True, True): "yes", (True, False): "height only", (False, True): "place only"}
    return (
        str(e.samples),
        plus_minus(e.mu_max, e.mu_max_std if known.mu_max else None),
        plus_minus(e.lambda_m, e.lambda_m_std if known.lambda_m else None),
        f"{e.c1:.4f}",
        f"{e.c2:.2f}",
        f"{e.c3:.4f}",
        f"{e.noise_std:.4f}",
        peak.get((known.mu_max, known.lambda_m), "no"),
    )
