"""`fleet`: many recordings to one Parquet data set, on the workers of a cluster."""

import argparse
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from time import monotonic
from typing import TYPE_CHECKING, Any

from adhesion_can.cli.bars import bar
from adhesion_can.cli.common import (
    add_columns,
    add_configuration,
    add_model,
    configuration,
)
from adhesion_can.cli.fleet_next import NextCommand, next_commands
from adhesion_can.cli.fleet_summary import Summary, describe
from adhesion_can.cli.outputs import add_json, require_outputs, talk, write_json
from adhesion_can.cli.reports import missing_report, page_provenance
from adhesion_can.errors import InputError
from adhesion_can.extras import needing_extra
from adhesion_can.fleet.page.build_page import fleet_page
from adhesion_can.fleet.schema import STEPS
from adhesion_can.plurals import counted
from adhesion_can.printable import say
from adhesion_can.reporting.page import render
from adhesion_can.reporting.provenance import provenance
from adhesion_can.reporting.text import console

# These need the extra, which only the command itself does, and not its help.
if TYPE_CHECKING:
    from adhesion_can.fleet.plan import Plan
    from adhesion_can.fleet.units import Unit
    from adhesion_can.fleet.work import Task


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the description and the options of the command to its parser."""
    parser.description = (
        "Checks, calibrates, replays, identifies and diagnoses each of many recordings, and "
        "writes the results to one Parquet data set by vehicle and day, for SQL and data "
        "frames. The same command again processes only new or changed recordings."
    )
    parser.add_argument(
        "inputs",
        nargs="*",
        metavar="LOG|TABLE|FOLDER|URL",
        help="files, folders, patterns, or URLs such as s3://BUCKET/2026/*.log.gz",
    )
    parser.add_argument(
        "--out", required=True, metavar="FOLDER|URL", help="the data set, new or existing"
    )
    names = parser.add_argument_group("names of the vehicles (default: the folder of the file)")
    names.add_argument(
        "--vehicle",
        metavar="REGEX",
        help="regular expression on the whole path; its first group is the name",
    )
    names.add_argument(
        "--units",
        type=Path,
        metavar="F.csv",
        help=(
            "instead of LOG: columns path, vehicle, and optionally config, line, latitude, "
            "longitude"
        ),
    )
    parser.add_argument(
        "--steps", default=",".join(STEPS), metavar="LIST", help="default: %(default)s"
    )
    parser.add_argument(
        "--retry-failed", action="store_true", help="also process unchanged units that failed"
    )
    cluster = parser.add_argument_group("workers (dask.distributed)")
    cluster.add_argument(
        "--scheduler",
        metavar="ADDRESS",
        help="scheduler of a cluster, as tcp://HOST:8786 (default: this machine)",
    )
    cluster.add_argument(
        "--workers", type=int, metavar="N", help="processes on this machine (default: one per core)"
    )
    cluster.add_argument(
        "--memory", metavar="GB", help="memory limit of each process (default: its share)"
    )
    add_model(parser, "its effects are removed, as in 'replay' and 'identify'")
    add_columns(parser)
    add_json(parser)
    add_configuration(parser)


def run(options: argparse.Namespace) -> int:
    """Run the command."""
    with needing_extra("fleet", "fleet", "needs dask.distributed, fsspec and pyarrow"):
        import distributed  # noqa: F401, PLC0415
        import fsspec  # noqa: F401, PLC0415
        import pyarrow as pa  # noqa: F401, PLC0415
    # The modules below need the extra.
    from adhesion_can.fleet.dataset import DataSet  # noqa: PLC0415
    from adhesion_can.fleet.plan import make_plan, read_steps  # noqa: PLC0415
    from adhesion_can.fleet.work import describe_kept, is_current  # noqa: PLC0415

    _require_options(options)
    steps = read_steps(options.steps)
    units = _units(options)
    local = [Path(unit.path) for unit in units if "://" not in unit.path]
    require_outputs(options, local)
    plan = make_plan(units, options.out, steps, lambda path: _configuration(options, path))
    data = DataSet(options.out)
    kept = data.read_units()
    summary = Summary(len(units))
    tasks = []
    for task in plan.tasks(kept, again=options.retry_failed):
        if task.kept is not None and is_current(task):
            summary.add(describe_kept(task.kept))
        else:
            tasks.append(task)
    # A long recording that comes last keeps one worker busy while the others wait.
    tasks.sort(key=lambda task: task.unit.size or 0, reverse=True)
    try:
        if tasks:
            data.remove_incomplete({task.unit.unit_id for task in tasks}, kept.values())
            _work(options, tasks, summary)
    except (KeyboardInterrupt, SystemExit):
        said = f"{summary.count} of {counted(len(units), 'unit')}"
        say(f"stopped: {said} complete; the same command continues from here")
        raise
    _finish(options, plan, summary)
    return 0


def _work(options: argparse.Namespace, tasks: "Sequence[Task]", summary: "Summary") -> None:
    """Pass units through the workers."""
    from adhesion_can.fleet.cluster import open_cluster, require_workers  # noqa: PLC0415
    from adhesion_can.fleet.run import run_fleet  # noqa: PLC0415

    sizes = {task.unit.path: task.unit.size or 1 for task in tasks}
    done, total = 0, sum(sizes.values())
    with (
        bar("starting workers") as shown,
        open_cluster(options.scheduler, options.workers, _memory(options.memory)) as client,
    ):
        require_workers(client, options.scheduler, options.out, tasks[0].unit.path)
        for outcome in run_fleet(client, tasks):
            summary.add(outcome)
            done += sizes[outcome.path]
            shown.update(done / total, summary.progress, what="fleet")


def _require_options(options: argparse.Namespace) -> None:
    """Raise an InputError for options that do not go together."""
    if bool(options.inputs) == (options.units is not None):
        what = "recordings and --units together" if options.inputs else "nothing to read"
        raise InputError("fleet", what, "give LOG .. or --units F.csv")
    if options.units is not None and options.vehicle is not None:
        raise InputError("--vehicle", "the manifest of --units names them", "remove one of them")
    for name in ("workers", "memory"):
        if options.scheduler is not None and getattr(options, name) is not None:
            what = "the workers of --scheduler have their own number and memory"
            raise InputError(f"--{name}", what, "remove it, or set it where they are started")
    if options.workers is not None and options.workers < 1:
        raise InputError(f"--workers {options.workers}", "no worker", "give 1 or more")
    if "://" not in options.out and Path(options.out).is_file():
        raise InputError(f"--out {options.out}", "is a file", "name a folder")


def _memory(text: str | None) -> int | None:
    from adhesion_can.fleet.cluster import gigabytes  # noqa: PLC0415  needs the extra

    if text is None:
        return None
    try:
        return gigabytes(text)
    except ValueError as error:
        raise InputError(f"--memory {text}", "not a number of GB", "write 2 or 3.5") from error


def _units(options: argparse.Namespace) -> "list[Unit]":
    from adhesion_can.fleet.units import find_units, read_manifest  # noqa: PLC0415  needs the extra

    if options.units is not None:
        return read_manifest(options.units)
    return find_units(options.inputs, options.vehicle, options.out)


def _configuration(options: argparse.Namespace, path: Path | None) -> Any:
    """Configuration of a unit: its own file, or that of the command."""
    named = vars(options) | ({} if path is None else {"config": path})
    return configuration(argparse.Namespace(**named))


def _finish(options: argparse.Namespace, plan: "Plan", summary: Summary) -> None:
    config = next(iter(plan.configurations.values()))
    origin = provenance(config)
    del origin["inputs"]  # the table `units` has them, with their hashes
    verdict, written, commands = _diagnose(options, origin, plan.units)
    took_s = monotonic() - summary.began_s
    failed = sorted(summary.failed)
    document = {
        "out": options.out,
        "steps": list(plan.steps),
        "units": summary.count,
        "done": summary.count - len(failed),
        "kept": summary.kept,
        "failed": [
            {"path": outcome.path, "step": outcome.failed_step, "error": outcome.error}
            for outcome in failed
        ],
        "same_content": summary.twice(),
        "vehicles": dict(sorted(summary.vehicles.items())),
        "recorded_s": summary.recorded_s,
        "seconds": took_s,
        **_next_entries(commands),
        **origin,
    }
    write_json(options.json, document)
    if talk(options):
        out = console()
        for line in (
            *describe(options, summary, failed, took_s),
            *verdict,
            f"written: {options.out} (docs/fleet.md: tables and first queries)",
            *written,
        ):
            out.print(line)
        for command in commands[:1]:
            # A command on one line can be copied, however narrow the terminal.
            out.print(command.line, soft_wrap=True)


def _next_entries(commands: Sequence[NextCommand]) -> dict[str, Any]:
    """Commands to run next as JSON has them: the first as a line, and all."""
    return {
        "next": commands[0].line if commands else None,
        "next_commands": [
            {"vehicle": command.who, "command": command.command} for command in commands
        ],
    }


def _diagnose(
    options: argparse.Namespace, origin: dict[str, Any], units: "Sequence[Unit]"
) -> tuple[Sequence[str], list[str], list[NextCommand]]:
    """Diagnose the whole fleet, and write its files and its page.

    Returns:
        Sentences of the verdict, a line for each file, and the commands to run next.

    """
    from adhesion_can.fleet.dataset import DataSet  # noqa: PLC0415  needs the extra
    from adhesion_can.fleet.results import (  # noqa: PLC0415  needs the extra
        PAGE,
        diagnose_data_set,
        write_beside,
        write_results,
    )

    data = DataSet(options.out)
    overview = diagnose_data_set(data)
    commands = next_commands(overview.diagnosis, units, options)
    files = write_results(data, overview, {**_next_entries(commands), **origin})
    lines = [f"written: {file}" for file in files]
    entries = [command.entry for command in commands]
    made = fleet_page(overview, page_provenance(origin, options), entries)
    made = replace(made, next_step=commands[0].line if commands else "")
    missing = missing_report(Path(PAGE))
    if missing:
        lines.append(f"no report: {missing}")
    else:
        lines.append(f"written: {write_beside(data, PAGE, render(made).encode())}")
    return made.verdict, lines, commands
