"""Numbers of a figure in short: a row for each of its traces, for readers who cannot see it."""

import re
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np

from adhesion_can.arrays import Array

SUMMARY_COLUMNS = ("shown", "values", "from", "to", "lowest", "highest", "last")
"""Headings: name, number of values, range of the abscissa, range and last one of the ordinate."""
MOST_ROWS = 60
"""Largest number of rows."""


def summary_rows(data: Sequence[Mapping[str, Any]]) -> list[tuple[str, ...]]:
    """Cells for each trace that has a name; those of one name follow each other."""
    rows: list[tuple[str, ...]] = []
    for trace in data[:MOST_ROWS]:
        name = plain_text(str(trace.get("name", "")))
        panel = plain_text(str(trace.get("meta", "")))
        if panel and not panel.startswith(name):
            name = f"{panel}: {name}"
        if not name and trace.get("type") != "bar":
            continue
        x, y = _column(trace.get("x", ())), _column(trace.get("y", ()))
        known = y[np.isfinite(y)]
        cells = (
            str(len(known) or int(np.isfinite(x).sum())),
            *_ends(x),
            *_ends(known),
            _text(known[-1]) if len(known) else "-",
        )
        rows.append((name or "bars", *cells))
    return rows


def plain_text(text: str) -> str:
    """A text of Plotly without the markup that our figures use."""
    return re.sub("</?su[bp]>", "", text.replace("<br>", " "))


def _column(values: Iterable[Any]) -> Array:
    """Numbers; NaN for what is none, as a category or a gap."""
    numbers = [v if isinstance(v, (int, float, np.number)) else np.nan for v in values]
    return np.array(numbers, dtype=np.float64)


def _ends(values: Array) -> tuple[str, str]:
    known = values[np.isfinite(values)]
    return (_text(known.min()), _text(known.max())) if len(known) else ("-", "-")


def _text(value: float) -> str:
    return f"{value:.4g}"
