"""The gallery says what the commands say."""

import re
import shutil
from pathlib import Path

import pytest

from adhesion_can.cli.main import main

ROOT = Path(__file__).resolve().parents[2]
PAGE = (ROOT / "docs" / "gallery.md").read_text()


NUMBER = r"\d+(?:\.\d+)?"


def numbers_of(text):
    """The numbers of a text, each with one unit of its last digit."""
    found = re.findall(NUMBER, text)
    return [(float(one), 10.0 ** -len(one.partition(".")[2])) for one in found]


def is_printed(shown, printed):
    """Whether a text has a line with these words, and with these numbers but for last digits.

    The last digits are a machine's: two units of them may differ, and 1 %.
    """
    return any(
        all(abs(one - other) <= 2 * unit + 0.01 * abs(one) for (one, unit), (other, _) in pairs)
        for pairs in _numbers_of_the_same_words(shown, printed)
    )


def _numbers_of_the_same_words(shown, printed):
    """Numbers of a text in pairs with those of each place of another that has its words."""
    flat = re.sub(r"\s+", "", printed)
    parts = [re.escape(one) for one in re.split(NUMBER, re.sub(r"\s+", "", shown))]
    for place in re.finditer(f"(?={NUMBER.join(parts)})", flat):
        text = re.match(NUMBER.join(parts), flat[place.start() :])[0]
        yield list(zip(numbers_of(re.sub(r"\s+", "", shown)), numbers_of(text), strict=True))


@pytest.mark.parametrize("command", ["identify", "diagnose"])
def test_the_first_case_is_what_the_commands_print(command, tmp_path, monkeypatch, capsys):
    shutil.copy(ROOT / "docs" / "gallery" / "eurosprinter_points.csv", tmp_path)
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("COLUMNS", "110")
    (block,) = re.findall(
        rf"```\n\$ adhesion-can ({command} eurosprinter.*?)\n```", PAGE, re.DOTALL
    )
    line, *shown = block.splitlines()
    assert main(line.split()) == 0
    printed = capsys.readouterr().out
    assert shown
    for one in shown:
        assert is_printed(one, printed), one


@pytest.mark.parametrize(
    ("shown", "is_there"),
    [
        ("gain 44.2 %", False),
        ("gain 49.9 %", True),
        ("a gain 50.0 %", False),
        ("50.0 % of 7", True),
    ],
)
def test_another_number_is_not_what_is_printed(shown, is_there):
    assert is_printed(shown, "the gain\n  50.0 % of 7 rows") is is_there


def test_every_picture_and_link_is_there():
    links = re.findall(r"\]\((\S+?)\)", PAGE)
    assert len([link for link in links if link.endswith(".png")]) == 4
    for link in links:
        assert (ROOT / "docs" / link).exists(), link
