"""The page of a diagnosis in a browser, from disk and without a network."""

from dataclasses import replace

import pytest

from adhesion_can.diagnosis.evidence import Decision, ModelScore
from adhesion_can.reporting.diagnosis_page import page
from adhesion_can.reporting.page import write_page
from tests.reporting.browser import require_drawn
from tests.reporting.test_diagnosis_report import (
    MADE,
    PROVENANCE,
    SECTIONS,
    SOURCES,
    of_files,
    sizes_of,
)


def check(kind, browser, folder, width):
    made = page(of_files(MADE[kind](), SOURCES), PROVENANCE)
    path = folder / "page.html"
    write_page(made, path)
    browser.open(path, width)
    require_drawn(browser, made)
    headings = browser.evaluate("[...document.querySelectorAll('h2')].map((h) => h.textContent)")
    assert headings == ["Result", *SECTIONS]


def test_every_section_and_figure_is_drawn_without_a_word_on_the_console(browser, tmp_path):
    check("named", browser, tmp_path, 1280)
    assert browser.violations() == []


@pytest.mark.slow
@pytest.mark.parametrize("kind", MADE)
@pytest.mark.parametrize("width", [420, 1280])
def test_so_it_is_for_every_verdict_and_on_a_narrow_window(kind, width, browser, tmp_path):
    check(kind, browser, tmp_path, width)


LONG = "rate of change of the slip 0.0526 1/s to 0.0626 1/s"
ROOM = """[...document.querySelectorAll(".plot")].map((plot) => ({
  share: plot._fullLayout._size.w / plot.clientWidth,
  above: (plot.layout.annotations || []).map((one) => one.text),
  turned: [...plot.querySelectorAll(".xtick text")].filter((text) =>
    /rotate\\((?!0)/.test(text.getAttribute("transform") || "")).length,
}))"""
"""Share of the width that a figure's axes have, names above its rows, and tilted numbers."""


@pytest.mark.parametrize("width", [420, 1280])
def test_names_of_rows_leave_room_for_the_figure(width, browser, tmp_path):
    sizes = sizes_of(LONG, "c5", "speed", 4e-12, (3.9e-12, 4.1e-12), refutes=True)
    levels = tuple(replace(one, level=f"{LONG} {k}") for k, one in enumerate(sizes.levels))
    found = replace(
        MADE["named"](),
        environments=(replace(sizes, levels=levels, unit="1/N^2"),),
        models=(ModelScore("plain curve", 1.6, None), ModelScore(LONG, 1.1, Decision.NAMED)),
    )
    path = tmp_path / "page.html"
    write_page(page(of_files(found, SOURCES), PROVENANCE), path)
    browser.open(path, width)
    seen = browser.evaluate(ROOM)
    assert min(one["share"] for one in seen) > 0.55
    assert sum(one["turned"] for one in seen) == 0
    named = [one["above"] for one in seen if any(LONG in text for text in one["above"])]
    if width == 420:
        assert named == [[f"{LONG} 0", f"{LONG} 1"], ["plain curve", f"{LONG}: named"]]
    else:
        assert named == []


def test_an_error_in_a_script_would_be_seen(browser, tmp_path):
    path = tmp_path / "page.html"
    write_page(page(of_files(MADE["named"](), SOURCES), PROVENANCE), path)
    path.write_text(path.read_text().replace("Plotly.newPlot(target", "Plotly.newPlt(target"))
    browser.open(path)
    assert any("newPlt" in said for said in browser.complaints)


def test_what_a_page_may_not_load_would_be_seen(browser, tmp_path):
    path = tmp_path / "page.html"
    write_page(page(of_files(MADE["named"](), SOURCES), PROVENANCE), path)
    path.write_text(path.read_text().replace("</main>", "<img src=http://example.org/x></main>"))
    browser.open(path)
    assert any("Content Security Policy" in said for said in browser.complaints)
