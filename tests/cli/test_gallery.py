"""The gallery says what the commands say."""

import re
import shutil
from pathlib import Path

import pytest

from adhesion_can.cli.main import main

ROOT = Path(__file__).resolve().parents[2]
PAGE = (ROOT / "docs" / "gallery.md").read_text()


def words_of(line):
    """A line without its numbers, whose last digits are a machine's, and without its spaces."""
    return re.sub(r"[\d.]+|\s+", "", line)


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
    printed = words_of(capsys.readouterr().out)
    assert shown
    for one in shown:
        assert words_of(one) in printed


def test_every_picture_and_link_is_there():
    links = re.findall(r"\]\((\S+?)\)", PAGE)
    assert len([link for link in links if link.endswith(".png")]) == 4
    for link in links:
        assert (ROOT / "docs" / link).exists(), link
