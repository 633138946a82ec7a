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
LEAST_BEGIN_US = 100_000
"""Smaller first stamps are 0 for people, who read tenths of a second."""


@dataclass(frozen=True, slots=True)
class TimeScale:
    """Times of a result for people: seconds from its first stamp.

    Attributes:
        zero_us: Stamp that time counts from, µs.

    """

    zero_us: int = 0

    @classmethod
    def beginning_at(cls, first_us: int) -> "TimeScale":
        """Scale of stamps of which this one is the first."""
        return cls(first_us if first_us >= LEAST_BEGIN_US else 0)

    @property
    def begin(self) -> str:
        """Time 0: date and time in UTC to a second, or on the recording's clock; '' for 0."""
        if self.zero_us < DATES_FROM_US:
            return f"{self.zero_us / 1e6:g} s on the recording's clock" if self.zero_us else ""
        return f"{datetime.fromtimestamp(self.zero_us / 1e6, UTC):%Y-%m-%d %H:%M:%S} UTC"

    @property
    def note(self) -> str:
        """Clause for a title, with a comma in front; '' where there is nothing to say."""
        return f", time since {self.begin}" if self.begin else ""

    def span(self, from_us: int, to_us: int) -> str:
        """Both ends of a span, s."""
        return f"{(from_us - self.zero_us) / 1e6:.1f} .. {(to_us - self.zero_us) / 1e6:.1f}"

    def seconds(self, t_s: float) -> float:
        """Time since time 0, s, of a time on the recording's clock, s."""
        return t_s - self.zero_us / 1e6

    def heading(self, name: str = "") -> str:
        """Sentence for the heading of a page; '' where time 0 is 0 on the recording's clock."""
        if not self.begin:
            return ""
        return f"Time 0{f' of {name}' if name else ''} is {self.begin}."


def beginnings(drives: Sequence[tuple[str, int | None]]) -> str:
    """Time 0 of recordings, a sentence each, by name and first stamp, µs; None: it has no stamp."""
    headings = (
        TimeScale.beginning_at(first_us).heading(name if len(drives) > 1 else "")
        for name, first_us in drives
        if first_us is not None
    )
    return " ".join(filter(None, headings))
