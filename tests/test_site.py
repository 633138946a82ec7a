"""The site of docs/: it builds without a warning, works from disk, and no link in it is dead."""

import os
import subprocess
import sys
from html.parser import HTMLParser
from pathlib import Path
from urllib.parse import unquote, urlsplit

import pytest

import adhesion_can
from tests.reporting.browser import Browser

pytest.importorskip("mkdocs", reason="the site needs the extra 'docs'")
pytest.importorskip("latex2mathml", reason="the site needs the extra 'docs'")

ROOT = Path(__file__).resolve().parent.parent
LOADED = {"img": "src", "script": "src", "link": "href", "source": "src", "iframe": "src"}
"""Attribute of each element that makes a browser load something."""


class Page(HTMLParser):
    """Links, anchors, what a browser loads, and the text of a page."""

    def __init__(self, path):
        super().__init__()
        self.links, self.loaded, self.anchors, self.equations = [], [], set(), 0
        self.text, self._skipped = [], 0
        self.feed(path.read_text())

    def handle_starttag(self, tag, attributes):
        found = dict(attributes)
        if tag == "a" and found.get("href"):
            self.links.append(found["href"])
        self.anchors |= {found.get("id"), found.get("name") if tag == "a" else None}
        address = found.get(LOADED.get(tag, ""))
        if address and found.get("rel") not in ("canonical", "next", "prev"):
            self.loaded.append(address)
        self.equations += tag == "math"
        self._skipped += tag in ("script", "style", "code")

    def handle_endtag(self, tag):
        self._skipped -= tag in ("script", "style", "code")

    def handle_data(self, data):
        if not self._skipped:
            self.text.append(data)


@pytest.fixture(scope="module")
def site(tmp_path_factory):
    """Folder with the site."""
    folder = tmp_path_factory.mktemp("site")
    words = [sys.executable, "-m", "mkdocs", "build", "--config-file", "tools/mkdocs.yml"]
    words += ["--strict", "--quiet", "--site-dir", str(folder)]
    environment = {**os.environ, "NO_MKDOCS_2_WARNING": "1"}
    done = subprocess.run(
        words, cwd=ROOT, env=environment, capture_output=True, text=True, check=False, timeout=300
    )
    assert done.returncode == 0, done.stdout + done.stderr
    assert "WARNING" not in done.stdout + done.stderr
    return folder


@pytest.fixture(scope="module")
def pages(site):
    """Parsed pages by path."""
    return {path: Page(path) for path in site.rglob("*.html") if path.name != "404.html"}


@pytest.mark.costly
def test_no_link_is_dead_and_every_anchor_exists(site, pages):
    for path, page in pages.items():
        for link in page.links:
            address = urlsplit(link)
            if address.scheme:
                assert address.scheme == "https", (path, link)
                continue
            target = path.parent / unquote(address.path) if address.path else path
            target = target / "index.html" if target.is_dir() else target.resolve()
            assert target.is_file(), (path.relative_to(site), link)
            if address.fragment and target.suffix == ".html":
                anchors = pages[target].anchors
                assert unquote(address.fragment) in anchors, (path.relative_to(site), link)


def test_nothing_is_loaded_from_elsewhere(pages):
    for path, page in pages.items():
        for address in page.loaded:
            parts = urlsplit(address)
            assert (parts.scheme, parts.netloc) == ("", ""), (path, address)
            assert (path.parent / unquote(parts.path)).is_file(), (path, address)


@pytest.mark.costly
def test_equations_are_drawn_without_a_script(site, pages):
    theory = pages[site / "theory.html"]
    assert theory.equations > 40
    for path, page in pages.items():
        text = "".join(page.text)
        assert "$$" not in text, path
        assert "\\(" not in text, path


def test_every_public_name_is_on_the_page_of_the_api(site, pages):
    anchors = pages[site / "reference" / "api.html"].anchors
    for name in set(adhesion_can.__all__) - {"__version__"}:
        assert f"adhesion_can.{name}" in anchors, name
    text = "".join(pages[site / "reference" / "api.html"].text)
    assert "Setpoints that the service would have sent while recordings were made" in text


def test_every_decision_every_example_and_the_pictures_of_the_notebook_are_there(site):
    decisions = {path.stem for path in (ROOT / "docs" / "decisions").glob("[0-9]*.md")}
    assert decisions <= {path.stem for path in (site / "decisions").glob("*.html")}
    assert len(list((site / "examples").glob("tour-*.png"))) >= 3
    scripts = {path.stem for path in (ROOT / "docs" / "examples").glob("*.py")}
    assert scripts <= {path.stem for path in (site / "examples").glob("*.html")}


SEARCH = """
(async () => {
  const input = document.querySelector('input.md-search__input');
  document.querySelector('#__search').click();
  input.focus();
  input.value = 'objection';
  input.dispatchEvent(new Event('input', {bubbles: true}));
  input.dispatchEvent(new KeyboardEvent('keyup', {bubbles: true, key: 'n'}));
  for (let turn = 0; turn < 600; turn++) {
    const found = [...document.querySelectorAll('a.md-search-result__link')].map((a) => a.href);
    if (found.length) return found;
    await new Promise((done) => setTimeout(done, 100));
  }
  return [];
})()
"""


def test_the_search_works_from_disk(site, tmp_path):
    """Browsers start no worker from file://, which the search is without docs/iframe-worker.js."""
    browser = Browser(tmp_path)
    try:
        browser.open(site / "guides" / "bench.html")
        found = browser.evaluate(SEARCH)
        assert any(address.startswith((site / "operation.html").as_uri()) for address in found)
        assert browser.complaints == []
    finally:
        browser.close()
