"""A page is one file that needs no network, whatever is written into it."""

import json
import re
import sys
from html.parser import HTMLParser
from importlib import resources

import numpy as np
import pytest

from adhesion_can.errors import InputError
from adhesion_can.extras import install_extra
from adhesion_can.reporting.page import (
    SUMMARY_COLUMNS,
    Figure,
    Grid,
    Page,
    Table,
    Text,
    render,
    require_extra,
    write_page,
)

NASTY = "</script><script>alert(1)</script><img src=http://example.org/x.png> & \"'"


class Elements(HTMLParser):
    """Elements, their attributes and the text within."""

    def __init__(self, text):
        super().__init__()
        self.found, self.text = [], {}
        self.feed(text)
        self.close()

    def handle_starttag(self, tag, attrs):
        self.found.append((tag, dict(attrs)))
        self.text[len(self.found) - 1] = ""

    def handle_data(self, data):
        if self.found:
            self.text[len(self.found) - 1] += data

    def texts(self, tag, **attributes):
        return [
            self.text[i].strip()
            for i, (name, attrs) in enumerate(self.found)
            if name == tag and all(attrs.get(k) == v for k, v in attributes.items())
        ]

    def figures(self):
        return [json.loads(text) for text in self.texts("script", type="application/json")]


def page(*parts, **changes):
    told = {
        "title": "A title",
        "lead": "What was done.",
        "verdict": ["It came out."],
        "sections": {"A section": parts},
        "provenance": {"version": "1.2.3"},
    }
    return Page(**(told | changes))


def figure(**changes):
    trace = {"type": "scatter", "name": "a", "x": [0, 1], "y": [0.5, 1.5]}
    return Figure("How it went", [trace | changes])


def nothing_is_loaded(text):
    """No element, style or address of the page's own makes a browser fetch anything."""
    elements = Elements(text)
    for tag, attrs in elements.found:
        assert tag not in {"link", "iframe", "img", "object", "embed", "base", "audio", "video"}
        assert not {"src", "srcset", "data", "action", "poster", "background"} & attrs.keys()
        assert attrs.get("href", "#").startswith("#")
        assert "url(" not in attrs.get("style", "")
    for style in elements.texts("style"):
        assert "url(" not in style
        assert "@import" not in style
    policy = next(a["content"] for t, a in elements.found if t == "meta" and "http-equiv" in a)
    rules = dict(rule.strip().split(" ", 1) for rule in policy.split(";"))
    assert rules["default-src"] == "'none'"
    assert not re.search(r"https?:|\*", policy)
    return elements


def test_the_page_loads_nothing_and_has_plotly_once():
    elements = nothing_is_loaded(render(page(figure(), figure(), Text("words"))))
    scripts = elements.texts("script")
    assert sum(len(script) > 1_000_000 for script in scripts) == 1
    assert len(elements.figures()) == 2


def test_a_page_without_figures_carries_no_script():
    text = render(page(Text("words"), Table("A table", ["a"], [["1"]])))
    assert not nothing_is_loaded(text).texts("script")
    assert len(text) < 20_000


def test_all_that_is_told_stands_in_the_page():
    table = Table("A table", ["name", "value"], [["x", "1.5"], ["y", "-"]], "a note")
    elements = Elements(render(page(Text("some words"), table, figure())))
    flat = " ".join(" ".join(elements.text.values()).split())
    for words in (
        "A title", "What was done.", "It came out.", "A section", "some words", "A table",
        "a note", "How it went", "version", "1.2.3",
    ):  # fmt: skip
        assert words in flat
    assert elements.texts("th")[:2] == ["name", "value"]
    assert elements.texts("td")[:4] == ["x", "1.5", "y", "-"]


def test_the_numbers_of_a_figure_stand_below_it():
    trace = {"name": "μ<sub>max</sub>", "x": [1, 2, 3, 4], "y": [0.5, None, np.nan, 0.25]}
    elements = Elements(render(page(Figure("f", [trace, {"x": [9], "y": [9]}]))))
    assert elements.texts("th") == [*SUMMARY_COLUMNS]
    assert elements.texts("td") == ["μmax", "2", "1", "4", "0.25", "0.5", "0.25"]


def test_figures_of_a_grid_are_drawn_like_others():
    made = page(Grid([figure(), figure()]), figure())
    assert len(made.figures) == len(Elements(render(made)).figures()) == 3


def test_what_is_told_is_never_markup():
    parts = (
        Text(NASTY),
        Table(NASTY, [NASTY], [[NASTY]], NASTY),
        Figure(NASTY, [{"type": "scatter", "name": NASTY, "x": [0], "y": [0]}]),
    )
    told = page(*parts, title=NASTY, lead=NASTY, verdict=[NASTY], provenance={NASTY: NASTY})
    elements = nothing_is_loaded(render(told))
    assert len(elements.texts("script")) == 3  # the figure, Plotly, what draws
    assert elements.figures()[0]["data"][0]["name"] == NASTY
    assert elements.texts("td")[:2] == [NASTY, NASTY]  # of the table, and of the figure's numbers


def test_numbers_arrive_and_what_is_not_finite_is_null():
    y = np.array([1 / 3, np.nan, np.inf, -np.inf])
    found = Elements(render(page(figure(y=y, x=np.arange(4), customdata=[True, None]))))
    trace = found.figures()[0]["data"][0]
    assert trace["y"] == [pytest.approx(1 / 3, rel=1e-5), None, None, None]
    assert trace["x"] == [0, 1, 2, 3]
    assert trace["customdata"] == [True, None]


def test_a_table_with_a_cell_too_few_is_refused():
    with pytest.raises(ValueError, match="cell"):
        Table("t", ["a", "b"], [["1"]])


@pytest.mark.parametrize("module", ["jinja2", "plotly.offline"])
def test_without_the_extra_the_error_names_it(module, monkeypatch, tmp_path):
    monkeypatch.setitem(sys.modules, module, None)
    for call in (
        lambda: require_extra("report.html"),
        lambda: write_page(page(), tmp_path / "report.html"),
    ):
        with pytest.raises(InputError, match=re.escape(install_extra("report"))) as caught:
            call()
        assert "report.html" in str(caught.value)
    assert not list(tmp_path.iterdir())


def test_the_template_is_part_of_the_package():
    folder = resources.files("adhesion_can.reporting") / "templates"
    assert "<!DOCTYPE html>" in (folder / "page.html").read_text("utf-8")
