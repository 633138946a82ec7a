"""Reports as one HTML page that needs nothing but a browser: no server, no network.

A page is plain data: sections of text, tables and figures. Figures are Plotly's JSON as plain
dictionaries; Plotly's script is in the page once, compressed, and a content security policy in
its head keeps the browser from loading anything else. Each figure is followed by its numbers in
short, for readers who cannot see it.

Jinja2 and Plotly come with the extra `report`.
"""

import gzip
import json
import math
import re
from base64 import b64encode
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache
from itertools import chain, count
from pathlib import Path
from typing import Any

import numpy as np

from adhesion_can.arrays import Array
from adhesion_can.extras import needing_extra
from adhesion_can.files import whole_file


@dataclass(frozen=True, slots=True)
class Text:
    """A paragraph, plain text."""

    text: str


@dataclass(frozen=True, slots=True)
class Items:
    """A list, plain text each."""

    texts: Sequence[str]


@dataclass(frozen=True, slots=True)
class Table:
    """A table; its first column is aligned left, the others right.

    Attributes:
        caption: Content of the table, one sentence.
        columns: Headings.
        rows: Cells row by row, one for each column.
        note: Meaning of the columns, printed below the table.
        sentence_columns: Columns that hold sentences, counted from 0; aligned left, and wrapped.

    """

    caption: str
    columns: Sequence[str]
    rows: Sequence[Sequence[str]]
    note: str = ""
    sentence_columns: Collection[int] = ()

    def __post_init__(self) -> None:
        if any(len(row) != len(self.columns) for row in self.rows):
            raise ValueError("each row needs a cell for each column")


@dataclass(frozen=True, slots=True)
class Figure:
    """A figure.

    Attributes:
        caption: Content of the figure and how to read it.
        data: Traces of Plotly.
        layout: Layout of Plotly, where it differs from the page's style.
        height: Height without the legend, px.
        name: Short name, part of the name of its picture's file.
        panels: Heights of its panels, one below the other over one abscissa, px: each gets a
            heading, and a cursor reads all traces at once; () for a figure without a cursor.

    """

    caption: str
    data: Sequence[Mapping[str, Any]]
    layout: Mapping[str, Any] = field(default_factory=dict)
    height: int = 380
    name: str = "figure"
    panels: Sequence[float] = ()


@dataclass(frozen=True, slots=True)
class Grid:
    """Figures side by side where there is room, else one below the other."""

    figures: Sequence[Figure]


Part = Text | Items | Table | Figure | Grid
"""Part of a section."""


@dataclass(frozen=True, slots=True)
class Page:
    """A report.

    Attributes:
        title: Title of the page.
        lead: Work that was done, a sentence or two.
        verdict: Results, a sentence each, the most important first.
        sections: Parts of each section by its heading, in their order.
        provenance: Version, hashes and the command that repeats the work, by name.
        next_step: What was found and what to do next, one line; '' where nothing follows.
        begin: Date and time of time 0, a sentence for each recording; '' where there is none.

    """

    title: str
    lead: str
    verdict: Sequence[str]
    sections: Mapping[str, Sequence[Part]]
    provenance: Mapping[str, str]
    next_step: str = ""
    begin: str = ""

    @property
    def figures(self) -> list[Figure]:
        """All figures in their order."""
        figures: list[Figure] = []
        for part in chain.from_iterable(self.sections.values()):
            if isinstance(part, Grid):
                figures += part.figures
            elif isinstance(part, Figure):
                figures.append(part)
        return figures


def require_extra(where: str) -> tuple[Any, Any]:
    """Jinja2 and the function that gives Plotly's script; called before work that ends in a page.

    Args:
        where: Option or file that asks for the page.

    Raises:
        InputError: The extra is not installed.

    """
    with needing_extra("report", where, "an HTML page needs Jinja2 and Plotly"):
        import jinja2
        from plotly.offline import get_plotlyjs
    return jinja2, get_plotlyjs


def render(page: Page, where: str = "page") -> str:
    """The page as HTML.

    Args:
        page: Content of the page.
        where: Option or file that asks for the page, for the error.

    Raises:
        InputError: The extra is not installed.

    """
    jinja2, _ = require_extra(where)
    environment = jinja2.Environment(
        loader=jinja2.PackageLoader("adhesion_can.reporting"),
        autoescape=True,
        trim_blocks=True,
        lstrip_blocks=True,
        undefined=jinja2.StrictUndefined,
    )
    for kind in (Figure, Grid, Items, Table):
        environment.tests[kind.__name__.lower()] = lambda part, kind=kind: isinstance(part, kind)
    environment.filters["figure_json"] = _figure_json
    environment.filters["summary_rows"] = lambda figure: summary_rows(figure.data)
    template = environment.get_template("page.html")
    numbers = count(1)
    return str(
        template.render(
            page=page,
            plotly=_packed_plotly() if page.figures else "",
            new_id=lambda: f"part-{next(numbers)}",
            summary_columns=SUMMARY_COLUMNS,
        )
    )


def write_page(page: Page, path: Path, *, own_name: bool = False) -> None:
    """Write the page.

    Args:
        page: Page.
        path: Path of the file.
        own_name: Whether the name is ours rather than the user's, as of a whole file.

    Raises:
        InputError: The extra is not installed, or the file cannot be written.

    """
    text = render(page, str(path))
    with whole_file(path, own_name=own_name) as file:
        file.write(text)


@cache
def _packed_plotly() -> str:
    """Plotly's script, compressed, as base64: 2 of 4.8 MB; the page's own script unpacks it."""
    _, plotly_script = require_extra("page")
    packed = gzip.compress(plotly_script().encode(), compresslevel=9, mtime=0)
    return b64encode(packed).decode("ascii")


def _figure_json(figure: Figure) -> str:
    """A figure as JSON that may stand within a script element; null for what is not finite."""
    document = {
        "data": figure.data,
        "layout": figure.layout,
        "height": figure.height,
        "panels": figure.panels,
    }
    text = json.dumps(_plain(document), allow_nan=False, separators=(",", ":"))
    return text.replace("<", "\\u003c")


def _plain(value: Any) -> Any:
    if isinstance(value, Mapping):
        return {str(key): _plain(item) for key, item in value.items()}
    if isinstance(value, (str, bool)) or value is None:
        return value
    if hasattr(value, "tolist"):
        return _plain(value.tolist())
    if isinstance(value, Sequence):
        return [_plain(item) for item in value]
    if isinstance(value, float):
        # Six digits are more than a figure shows, and a third of the page's size.
        return float(f"{value:.6g}") if math.isfinite(value) else None
    return value


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
