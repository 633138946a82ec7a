"""Figures of the documents: where they come from, and how they are held against it."""

import re
from pathlib import Path

import pytest

from tools.claims import Claim, Figure, compare, read_claims, run

ROOT = Path(__file__).resolve().parents[1]
CLAIMS = read_claims()


def claim(**other):
    values = {
        "document": "README.md", "text": "", "command": "echo about 49.9 %", "commit": "HEAD",
        "date": "2026-01-01", "code": ("adhesion_can",),
    }  # fmt: skip
    return Claim(**{**values, **other})


@pytest.mark.parametrize("one", CLAIMS, ids=lambda one: f"{one.document}: {one.text[:40]}")
def test_each_claim_is_stated_and_names_what_is_there(one):
    assert one.is_stated
    tool = re.match(r"tools/(?:bench )?([\w-]+)", one.command)
    if tool is None:
        assert "adhesion-can " in one.command
    else:
        name = tool[1].replace("-", "_")
        places = ROOT / "tools" / name, ROOT / "tools" / "benchmarks" / f"{name}.py"
        assert any(place.exists() for place in places), one.command
    for path in one.code:
        assert (ROOT / path).exists(), path
    assert re.fullmatch(r"[0-9a-f]{7,40}", one.commit)
    for figure in one.figures:
        assert f"{figure.value:.15g}".rstrip("0") in one.text.replace(",", "")


def figures_of(text):
    """The shares and counts of a text."""
    return re.findall(r"\d[\d.]* %|\b\d+ of \d+", " ".join(text.split()))


def test_each_figure_of_the_readme_has_a_claim():
    claimed = [" ".join(one.text.split()) for one in CLAIMS if one.document == "README.md"]
    known = {figure for text in claimed for figure in figures_of(text)}
    section = (ROOT / "README.md").read_text().partition("## What is different here")[2]
    stated = set(figures_of(section.partition("## ")[0]))
    assert stated - known <= {"2 %", "16 %"}  # a limit, and the worst kind of the same table


@pytest.mark.parametrize(
    ("value", "wrong"),
    [
        (49.9, []),
        (49.85, []),
        (44.2, ["prints 49.9, the document says 44.2"]),
    ],
)
def test_what_a_command_prints_is_compared(value, wrong):
    one = claim(figures=(Figure(r"about ([\d.]+) %", value, 0.1),))
    assert compare(one, run(one)) == wrong


def test_a_figure_that_is_no_longer_printed_is_wrong():
    one = claim(figures=(Figure(r"gain ([\d.]+)", 1.0, 0.1),))
    assert compare(one, run(one)) == ["prints nothing like 'gain ([\\\\d.]+)'"]


def test_words_that_a_document_does_not_have_are_found():
    assert not claim(text="it names every cause in 100 % of all drives").is_stated
