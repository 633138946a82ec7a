"""Words of a check that its page and the terminal share: kinds of sentences, and the verdict."""

import re
from collections.abc import Sequence
from typing import NamedTuple

from adhesion_can.offline.check import CheckResult
from adhesion_can.offline.check_table import TableCheck

Checked = CheckResult | TableCheck
"""Result of the check of a recording or of a table."""


class SentenceKind(NamedTuple):
    """Kind of sentences of a check.

    Attributes:
        tag: Word in front of a sentence.
        field: Field of the result that holds the sentences.
        meaning: Meaning of the tag.

    """

    tag: str
    field: str
    meaning: str

    def lines(self, results: Sequence[Checked]) -> list[str]:
        """Sentences of this kind, the same of several axles as one."""
        return group_axles([line for result in results for line in getattr(result, self.field)])


WRONG = SentenceKind("WRONG", "failures", "a fault that fails the check")
KINDS = (
    WRONG,
    SentenceKind("WARNING", "warnings", "odd, or a setting to correct; the check passes"),
    SentenceKind("NOT KNOWABLE", "limits", "cannot be estimated from these data"),
    SentenceKind("FOUND", "findings", "what the data show"),
)
"""Kinds of sentences, in the order in which they are shown."""
NOISE_NOTE = (
    "correlation time: how long an error of the sensor lasts. 0: neighbouring readings have "
    "independent errors, looked at up to the time in brackets. not known: the readings do not "
    "show it"
)
"""Meaning of the column of the table of noise."""


_OF_AXLE = re.compile(r"axle (\d+): (.*)", re.DOTALL)
_NUMBER = re.compile(r"(?<![\w.])-?\d+(?:\.\d+)?(?:e[+-]?\d+)?")


def group_axles(lines: Sequence[str]) -> list[str]:
    """Sentences with those that several axles share as one, at the place of the first.

    They may differ in figures: if in one, its range is given, otherwise the first axle's figures.

    Args:
        lines: Sentences; those of an axle start with 'axle N: '.

    """
    groups: dict[str, list[re.Match[str]]] = {}
    for line in lines:
        match = _OF_AXLE.fullmatch(line)
        if match is not None:
            groups.setdefault(_NUMBER.sub("#", match[2]), []).append(match)
    grouped = {group[0][0]: _of_axles(group) for group in groups.values()}
    merged = {match[0] for group in groups.values() for match in group[1:]} - set(grouped)
    return [grouped.get(line, line) for line in lines if line not in merged]


def _of_axles(matches: Sequence[re.Match[str]]) -> str:
    """One sentence for what is said of each axle of a group."""
    first = matches[0]
    axles = sorted({int(match[1]) for match in matches})
    if len(axles) == 1:
        return first[0]
    has_gap = axles[-1] - axles[0] >= len(axles)
    numbers = ", ".join(map(str, axles)) if has_gap else f"{axles[0]} to {axles[-1]}"
    figures = list(zip(*(_NUMBER.findall(match[2]) for match in matches), strict=True))
    differing = [place for place, values in enumerate(figures) if len(set(values)) > 1]
    if not differing:
        return f"axles {numbers}: {first[2]}"
    if len(differing) > 1:
        return f"axles {numbers} (figures of axle {first[1]}): {first[2]}"
    values = sorted(figures[differing[0]], key=float)
    place = list(_NUMBER.finditer(first[2]))[differing[0]]
    text = f"{first[2][: place.start()]}{values[0]} to {values[-1]}{first[2][place.end() :]}"
    return f"axles {numbers}: {text}"


def legend(results: Sequence[Checked]) -> str:
    """Meaning of the tags that a check shows."""
    return "; ".join(f"{kind.tag}: {kind.meaning}" for kind in KINDS if kind.lines(results))


def verdict(results: Sequence[Checked]) -> str:
    """What recordings or tables are good for."""
    if any(result.failures for result in results):
        return "not usable as it is"
    if any(result.shows_peak for result in results):
        return "usable"
    return "usable signals, but they show no peak: mu_max and lambda_m cannot be identified"
