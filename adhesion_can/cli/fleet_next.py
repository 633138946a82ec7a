"""What to run after `fleet`: for each vehicle with a cause, the command that shows it in full."""

import argparse
import re
import shlex
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from itertools import islice
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

from adhesion_can.cli.common import own_command
from adhesion_can.cli.next_step import column_words, configuration_words
from adhesion_can.reporting.next_steps.next_step import NextStep

# These need the extra, which only the command itself does, and not its help.
if TYPE_CHECKING:
    from adhesion_can.fleet.findings import FleetDiagnosis
    from adhesion_can.fleet.pooled_size import PooledSize
    from adhesion_can.fleet.units import Unit

MOST_COMMANDS, MOST_RECORDINGS = 10, 3
"""Largest number of commands, and of recordings of one."""
SHARED = "several-vehicles"
"""Name of what vehicles share, and of its page."""


class NextCommand(NamedTuple):
    """Command to run next.

    Attributes:
        who: Vehicle that it is for; `SHARED` for several.
        command: Command, after what must be fetched for it.

    """

    who: str
    command: str

    @property
    def entry(self) -> str:
        """The command after its vehicle, as a list has it."""
        return f"{self.who}: {self.command}"

    @property
    def line(self) -> str:
        """The line with which the fleet's report ends."""
        return NextStep("", self.command).line


@dataclass(frozen=True, slots=True)
class _Work:
    """A vehicle, or what vehicles share, with the recordings to look at.

    Attributes:
        who: Name of the vehicle; `SHARED` for several.
        recordings: Paths or URLs, the most telling first.
        coasting: Whether the cause is a wheel radius.

    """

    who: str
    recordings: tuple[str, ...]
    coasting: bool


def next_commands(
    diagnosis: "FleetDiagnosis", units: "Sequence[Unit]", options: argparse.Namespace
) -> list[NextCommand]:
    """Commands to run next, the worst vehicle first; none if nothing is named.

    Args:
        diagnosis: Result of the fleet-level diagnosis.
        units: Units of the run, with their configurations.
        options: Options of the command.

    """
    by_path = {unit.path: unit for unit in units}
    work = (task for task in _work(diagnosis) if any(path in by_path for path in task.recordings))
    return [_command(task, by_path, options) for task in islice(work, MOST_COMMANDS)]


def _work(diagnosis: "FleetDiagnosis") -> Iterable[_Work]:
    for vehicle in diagnosis.named:
        for coasting in (True, False):
            findings = [f for f in vehicle.findings if (f.source == "coasting") is coasting]
            sizes = [f.pooled for f in findings if f.pooled is not None]
            if sizes:
                yield _Work(vehicle.vehicle, _telling(sizes), coasting)
    for vehicle in diagnosis.vehicles:
        alone = [size for size in vehicle.cause_sizes if size.effect in vehicle.causes_alone]
        if alone and not vehicle.findings:
            yield _Work(vehicle.vehicle, _telling(alone), coasting=False)
    shared = [finding.pooled for finding in diagnosis.shared if finding.pooled is not None]
    if shared:
        yield _Work(SHARED, _telling(shared[:1]), coasting=False)


def _telling(sizes: "Iterable[PooledSize]") -> tuple[str, ...]:
    """Recordings of some sizes, those with the clearest size first."""
    clear: dict[str, float] = {}
    for unit_size in (unit_size for size in sizes for unit_size in size.sizes):
        clear[unit_size.recording] = max(
            clear.get(unit_size.recording, 0.0), abs(unit_size.value) / unit_size.std
        )
    return tuple(sorted(clear, key=lambda path: (-clear[path], path)))


def _command(
    task: _Work, by_path: "Mapping[str, Unit]", options: argparse.Namespace
) -> NextCommand:
    known = [path for path in task.recordings if path in by_path]
    config = by_path[known[0]].config
    chosen = sorted([path for path in known if by_path[path].config == config][:MOST_RECORDINGS])
    name = re.sub(r"[^A-Za-z0-9._-]+", "_", task.who)
    words = [own_command(), "calibrate" if task.coasting else "diagnose", *map(_local, chosen)]
    words += ["--out", f"{name}.toml"] if task.coasting else ["--html", f"{name}.html"]
    words += configuration_words(
        argparse.Namespace(**vars(options) | {"config": config or options.config})
    )
    words += () if task.coasting else column_words(options)
    remote = [path for path in chosen if "://" in path]
    fetch = f"fetch {', '.join(remote)}, then " if remote else ""
    return NextCommand(task.who, f"{fetch}{shlex.join(words)}")


def _local(path: str) -> str:
    """A path as it is typed here, or the name that a URL has once it is fetched."""
    if "://" in path:
        return path.partition("?")[0].rsplit("/", 1)[-1]
    here = Path.cwd()
    return str(Path(path).relative_to(here)) if Path(path).is_relative_to(here) else path
