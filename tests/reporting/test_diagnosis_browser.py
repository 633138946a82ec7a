"""The page of a diagnosis in a browser, from disk and without a network."""

import pytest

from adhesion_can.reporting.diagnosis_page import page
from adhesion_can.reporting.page import write_page
from tests.reporting.browser import require_drawn
from tests.reporting.test_diagnosis_report import MADE, PROVENANCE, SECTIONS, SOURCES, of_files


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
