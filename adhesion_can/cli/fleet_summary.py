"""What became of the units of a run of `fleet`, in sentences."""

import argparse
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field
from time import monotonic
from typing import TYPE_CHECKING

from adhesion_can.plurals import counted

# This needs the extra, which only the command itself does, and not its help.
if TYPE_CHECKING:
    from adhesion_can.fleet.work import Outcome

FIRST = 5
"""Failed units, and names of one recording, that are reported; the data set has all of them."""


@dataclass(slots=True)
class Summary:
    """What became of the units so far.

    Attributes:
        units: Number of units in all.
        count: Number of units that are complete, failed ones too.
        kept: Number of them that the data set had before.
        recorded_s: Length of the recordings that were analysed, s.
        failed: Outcomes of the failed units, in the order in which they came.
        vehicles: Number of units by vehicle.
        contents: Paths of the units by the hash of their content.
        began_s: Start of the run on the monotonic clock, s.

    """

    units: int
    count: int = 0
    kept: int = 0
    recorded_s: float = 0.0
    failed: list["Outcome"] = field(default_factory=list)
    vehicles: Counter[str] = field(default_factory=Counter)
    contents: dict[str, list[str]] = field(default_factory=dict)
    began_s: float = field(default_factory=monotonic)

    def add(self, outcome: "Outcome") -> None:
        """Add the outcome of a unit."""
        self.count += 1
        self.kept += outcome.kept
        self.recorded_s += outcome.duration_s
        self.vehicles[outcome.vehicle] += 1
        if outcome.failed_step is not None:
            self.failed.append(outcome)
        if outcome.sha256 is not None:
            self.contents.setdefault(outcome.sha256, []).append(outcome.path)

    @property
    def progress(self) -> str:
        """How far it is, in a few words."""
        failed = f", {len(self.failed)} failed" if self.failed else ""
        return f"{self.count} of {counted(self.units, 'unit')}{failed}"

    def twice(self) -> list[list[str]]:
        """Paths of units that hold the same."""
        return sorted(sorted(paths) for paths in self.contents.values() if len(paths) > 1)


def describe(
    options: argparse.Namespace, summary: Summary, failed: "Sequence[Outcome]", took_s: float
) -> list[str]:
    """Lines on a run that has ended.

    Args:
        options: Options of the command.
        summary: What became of the units.
        failed: Units that failed, in their order.
        took_s: Time that the run took, s.

    """
    new = summary.count - summary.kept
    speed = f", {summary.recorded_s / took_s:.0f} x real time" if summary.recorded_s else ""
    said = (
        f"{counted(summary.count, 'unit')} of {counted(len(summary.vehicles), 'vehicle')}: {new} "
        f"analysed in {took_s:.0f} s ({summary.recorded_s / 3600:.1f} h of recordings{speed}), "
        f"{summary.kept} complete before"
    )
    lines = [said]
    if failed:
        fix = "" if options.retry_failed else "; --retry-failed tries them again"
        lines.append(f"{counted(len(failed), 'unit')} failed; the data set has the errors{fix}:")
        lines += [f"  {outcome.failed_step}: {outcome.error}" for outcome in failed[:FIRST]]
        if len(failed) > FIRST:
            lines.append(f"  and {len(failed) - FIRST} more: column error of the table units")
    twice = summary.twice()
    for paths in twice[:FIRST]:
        more = f" and {len(paths) - FIRST} more" if len(paths) > FIRST else ""
        named = ", ".join(paths[:FIRST])
        lines.append(f"the same recording under {len(paths)} names: {named}{more}")
    if len(twice) > FIRST:
        lines.append(f"and {len(twice) - FIRST} more recordings under several names: --json")
    return lines
