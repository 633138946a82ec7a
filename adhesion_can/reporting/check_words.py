"""Words of a check that its page and the terminal share: kinds of sentences, and the verdict."""

from collections.abc import Sequence
from typing import NamedTuple

from adhesion_can.offline.check import CheckResult
from adhesion_can.offline.check_table import TableCheck

Checked = CheckResult | TableCheck
"""Result of the check of a recording or of a table."""


class Kind(NamedTuple):
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
        """Sentences of this kind."""
        return [line for result in results for line in getattr(result, self.field)]


WRONG = Kind("WRONG", "failures", "a fault that fails the check")
KINDS = (
    WRONG,
    Kind("WARNING", "warnings", "odd, or a setting to correct; the check passes"),
    Kind("NOT KNOWABLE", "limits", "cannot be estimated from these data"),
    Kind("FOUND", "findings", "what the data show"),
)
"""Kinds of sentences, in the order in which they are shown."""
NOISE_NOTE = (
    "correlation time: how long an error of the sensor persists; 0 where errors of neighbouring "
    "readings are independent, with the longest time that was looked at"
)
"""Meaning of the column of the table of noise."""


def legend(results: Sequence[Checked]) -> str:
    """Meaning of the tags that a check shows."""
    return "; ".join(f"{one.tag}: {one.meaning}" for one in KINDS if one.lines(results))


def verdict(results: Sequence[Checked]) -> str:
    """What recordings or tables are good for."""
    if any(result.failures for result in results):
        return "not usable as it is"
    if any(result.shows_peak for result in results):
        return "usable"
    return "usable signals, but they show no peak: mu_max and lambda_m cannot be identified"
