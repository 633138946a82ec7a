"""Texts of results: values with standard deviations, and HTML tables as notebooks show them."""

from collections.abc import Iterable, Sequence
from html import escape


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
        value: Value; a dash stands for None, not available.
        std: Standard deviation; a question mark stands for None and inf, not known.
        digits: Number of decimals of both.

    """
    if value is None:
        return "-"
    if std is None or not std < float("inf"):
        return f"{value:.{digits}f} ± ?"
    return f"{value:.{digits}f} ± {std:.{digits}f}"
