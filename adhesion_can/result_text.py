"""Texts of results: values with standard deviations, and HTML tables as notebooks show them."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from html import escape

HELD_OUT_RMSE = "held-out score, σ"
"""Heading of the held-out score: RMSE of the whitened residuals of held-out data, in standard
deviations of the noise; smaller is better."""


def html_table(title: str, columns: Sequence[str], rows: Iterable[Sequence[object]]) -> str:
    """HTML table with a caption.

    Args:
        title: Caption of the table.
        columns: Headings, one for each cell of a row.
        rows: Cells, row by row; their text is escaped.

    """
    heading = "".join(f"<th>{escape(column)}</th>" for column in columns)
    body = "".join(
        "<tr>" + "".join(f"<td>{escape(str(cell))}</td>" for cell in row) + "</tr>" for row in rows
    )
    return (
        f"<table><caption>{escape(title)}</caption><thead><tr>{heading}</tr></thead>"
        f"<tbody>{body}</tbody></table>"
    )


def plus_minus(value: float | None, std: float | None, digits: int = 4) -> str:
    """Text of a value with its standard deviation.

    Args:
        value: Value; a dash means None, not available.
        std: Standard deviation; a question mark means None and inf, not known.
        digits: Number of decimals of both.

    """
    if value is None:
        return "-"
    if std is None or not std < float("inf"):
        return f"{value:.{digits}f} ± ?"
    return f"{value:.{digits}f} ± {std:.{digits}f}"


DATES_FROM_US = 100_000_000_000_000
"""Stamps from here on are dates, µs since 1970; smaller ones count from the start of a recording,
which lasts less than three years."""


@dataclass(frozen=True, slots=True)
class TimeScale:
    """Times of a result for people: seconds from its start where its stamps are dates.

    Attributes:
        zero_us: Stamp that time counts from, µs.

    """

    zero_us: int = 0

    @classmethod
    def beginning_at(cls, first_us: int) -> "TimeScale":
        """Scale of stamps of which this one is the first; with 0 as it is where it is no date."""
        return cls(first_us if first_us >= DATES_FROM_US else 0)

    @property
    def begin(self) -> str:
        """Date and time of the start in UTC, to a second; '' where the stamps are no dates."""
        if not self.zero_us:
            return ""
        return f"{datetime.fromtimestamp(self.zero_us / 1e6, UTC):%Y-%m-%d %H:%M:%S} UTC"

    @property
    def note(self) -> str:
        """Clause for a title, with a comma in front; '' where there is nothing to say."""
        return f", time since {self.begin}" if self.begin else ""

    def span(self, from_us: int, to_us: int) -> str:
        """Both ends of a span, s."""
        return f"{(from_us - self.zero_us) / 1e6:.1f} .. {(to_us - self.zero_us) / 1e6:.1f}"
