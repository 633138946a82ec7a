"""The page of a diagnosis in a browser, from disk and without a network."""

import re
import shutil
import subprocess

import pytest

from adhesion_can.reporting.diagnosis_page import page
from adhesion_can.reporting.page import Figure, write_page
from tests.reporting.test_diagnosis_report import MADE, PROVENANCE, SECTIONS, SOURCES, of_files
from tests.reporting.test_page import Elements

WATCH = """<script>
"use strict";
window.addEventListener("error", (e) => { document.documentElement.dataset.error = e.message; });
document.addEventListener("securitypolicyviolation", (e) => {
  document.documentElement.dataset.error = "asks for " + e.blockedURI;
});
window.addEventListener("load", () => setTimeout(() => {
  const wide = [...document.querySelectorAll(".plot .main-svg")];
  const most = Math.max(0, ...wide.map((s) => s.getBoundingClientRect().right));
  document.documentElement.dataset.right = Math.ceil(most);
  document.documentElement.dataset.width = document.documentElement.clientWidth;
  document.documentElement.dataset.scroll = document.documentElement.scrollWidth;
}, 500));
</script></head>"""
"""Notes errors, what is asked for, and how wide everything became, where the test finds it."""


@pytest.fixture(scope="module")
def browser():
    found = shutil.which("chromium") or shutil.which("google-chrome")
    if found is None:
        pytest.skip("no Chromium here")
    return found


def opened(browser, path, folder, width):
    """The page's elements after its scripts ran, and the output of the console."""
    text = path.read_text()
    path.write_text(text.replace("</head>", WATCH, 1))
    done = subprocess.run(
        [
            browser, "--headless", "--no-sandbox", "--disable-gpu", "--enable-logging=stderr",
            f"--user-data-dir={folder / 'profile'}", "--virtual-time-budget=10000",
            "--host-resolver-rules=MAP * ~NOTFOUND", "--proxy-server=127.0.0.1:9",
            f"--window-size={width},3000", "--dump-dom", path.as_uri(),
        ],
        capture_output=True, text=True, timeout=100, check=True,
    )  # fmt: skip
    console = [line for line in done.stderr.splitlines() if "CONSOLE" in line]
    return Elements(done.stdout), console


def check(kind, browser, folder, width):
    made = page(of_files(MADE[kind](), SOURCES), PROVENANCE)
    path = folder / "page.html"
    write_page(made, path)
    elements, console = opened(browser, path, folder, width)
    assert console == []
    root = next(attrs for tag, attrs in elements.found if tag == "html")
    assert "data-error" not in root, root
    assert elements.texts("h2") == ["Result", *SECTIONS]
    plots = [a for t, a in elements.found if t == "div" and "plot" in a.get("class", "").split()]
    figures = [p for s in made.sections for p in s.parts if isinstance(p, Figure)]
    assert len(plots) == len(figures)
    assert all("js-plotly-plot" in plot["class"] for plot in plots)
    svgs = [a for t, a in elements.found if t == "svg" and "main-svg" in a.get("class", "")]
    assert len(svgs) >= len(figures)
    # Every trace that is shown became one: a line or points, or bars.
    drawn = [a for t, a in elements.found if t == "g" and re.match("trace ", a.get("class", ""))]
    assert len(drawn) >= sum(len(figure.data) for figure in figures)
    # Nothing but tables, in boxes of their own, is wider than the window.
    assert int(root["data-right"]) <= int(root["data-width"])
    assert int(root["data-scroll"]) <= int(root["data-width"])


def test_every_section_and_figure_is_drawn_without_a_word_on_the_console(browser, tmp_path):
    check("named", browser, tmp_path, 1280)


@pytest.mark.slow
@pytest.mark.parametrize("kind", MADE)
@pytest.mark.parametrize("width", [520, 1280])
def test_so_it_is_for_every_verdict_and_on_a_narrow_window(kind, width, browser, tmp_path):
    check(kind, browser, tmp_path, width)


@pytest.mark.slow
def test_an_error_in_a_script_would_be_seen(browser, tmp_path):
    path = tmp_path / "page.html"
    write_page(page(of_files(MADE["named"](), SOURCES), PROVENANCE), path)
    path.write_text(path.read_text().replace("Plotly.newPlot(target", "Plotly.newPlt(target"))
    elements, console = opened(browser, path, tmp_path, 1280)
    root = next(attrs for tag, attrs in elements.found if tag == "html")
    assert console or "data-error" in root
