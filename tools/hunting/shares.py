"""Shares and figures beside their targets, and tables, as Markdown."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from scipy.stats import beta


@dataclass(frozen=True)
class Target:
    """A target beside its figure.

    Attributes:
        what: it is about.
        figure: as text.
        wanted: as text.
        verdict: 'met', 'not met' (missed, but the bound does not exclude it), 'FAILED', 'no data'.

    """

    what: str
    figure: str
    wanted: str
    verdict: str


def bounds(hits: int, of: int) -> tuple[float, float]:
    """One-sided 95 % bounds of a share, the lower one and the upper one (Clopper and Pearson)."""
    low = float(beta.ppf(0.05, hits, of - hits + 1)) if hits else 0.0
    high = float(beta.ppf(0.95, hits + 1, of - hits)) if hits < of else 1.0
    return low, high


def share(what: str, hits: Iterable[bool], least: float, most: float = 1.0) -> Target:
    """A share of rounds beside the least, and the most, that it may be."""
    all_hits = list(hits)
    of, n = len(all_hits), sum(all_hits)
    wanted = f"at least {least:.0%}" if most == 1 else f"{least:.0%} to {most:.0%}"
    if least == 0:
        wanted = f"at most {most:.0%}"
    if not of:
        return Target(what, "-", wanted, "no data")
    low, high = bounds(n, of)
    if least == 0 and most == 1:
        return Target(what, f"{n / of:.1%} ({n} of {of}; {low:.0%}..{high:.0%})", "-", "-")
    figure = f"{n / of:.1%} ({n} of {of}; {low:.0%}..{high:.0%})"
    if high < least or low > most:
        return Target(what, figure, wanted, "FAILED")
    return Target(what, figure, wanted, "met" if least <= n / of <= most else "not met")


def at_most(what: str, value: float | None, most: float, unit: str, also: str = "") -> Target:
    """A figure that may be so large."""
    wanted = f"at most {most:g} {unit}"
    if value is None:
        return Target(what, "-", wanted, "no data")
    return Target(what, f"{value:.3g} {unit}{also}", wanted, "met" if value <= most else "FAILED")


def markdown_table(head: Sequence[str], lines: Sequence[Sequence[str]]) -> str:
    """A table as Markdown, its columns aligned."""
    widths = [max(len(row[k]) for row in (head, *lines)) for k in range(len(head))]

    def text(row: Sequence[str]) -> str:
        cells = (cell.ljust(width) for cell, width in zip(row, widths, strict=True))
        return f"| {' | '.join(cells)} |"

    rule = f"|{'|'.join('-' * (width + 2) for width in widths)}|"
    return "\n".join([text(head), rule, *(text(line) for line in lines)])
