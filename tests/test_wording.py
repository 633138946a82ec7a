"""No text that a user reads has a wording that sounds translated (docs/style.md)."""

import pytest

from tests.wording import (
    EVERYWHERE,
    EXCEPTIONS,
    ROOT,
    SHOWN,
    Text,
    documents,
    odd_wordings,
    public_docstrings,
    strings,
    templates,
)


@pytest.mark.parametrize(
    ("texts", "patterns"),
    [
        pytest.param(documents, EVERYWHERE, id="documents"),
        pytest.param(templates, SHOWN, id="templates"),
        pytest.param(strings, SHOWN, id="terminal, pages and help"),
        pytest.param(public_docstrings, EVERYWHERE, id="docstrings"),
    ],
)
def test_no_text_sounds_translated(texts, patterns):
    found = odd_wordings(texts(), patterns)
    assert not found, "\n".join(found)


@pytest.mark.parametrize(
    "text",
    [
        "3 surfaces told apart",
        "no such data tell the peak",
        "the residual goes with speed",
        "how to mend it",
        "faults since the begin",
        "it begins anew",
        "a log for who reads it",
        "the fix stands in the table",
        "2 of these",
        "no drive is such a one",
        "all that was tested counted",
        "planned in vain",
        "the slip lets itself be measured",
        "text is what is written",
        "Chance alone looks as strong",
    ],
)
def test_an_odd_wording_is_found(text):
    assert odd_wordings(iter([Text("a.md", 1, text)]), EVERYWHERE)


@pytest.mark.parametrize(
    "text",
    [
        "2 of these drives",
        "None stands for 'not available'",
        "the signal stands still",
        "recommended, amended",
        "it starts again",
    ],
)
def test_plain_english_passes(text):
    assert not odd_wordings(iter([Text("a.md", 1, text)]), EVERYWHERE)


def test_texts_are_found_where_users_meet_them():
    shown = {one.text for one in strings()}
    assert "the bus is gone ({}); reopening it" in shown
    assert "adhesion depends on speed" in shown
    assert any(one.path == "README.md" and one.text for one in documents())
    assert any("Numbers of this figure" in one.text for one in templates())
    assert any(one.path == "adhesion_can/errors.py" for one in public_docstrings())


def test_the_style_guide_names_what_the_test_looks_for():
    guide = (ROOT / "docs" / "style.md").read_text()
    for pattern, instead in SHOWN.items():
        assert f"| {instead} |" in guide, (pattern, instead)


def test_each_exception_is_needed():
    for part in EXCEPTIONS:
        assert (ROOT / part).exists() or any(part in one.text for one in strings()), part
