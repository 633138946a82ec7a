"""docs/own_data.md: from a spreadsheet's CSV to a model that is tried on other data."""

import json
import re
import shlex
from pathlib import Path

import numpy as np
import pytest

from adhesion_can.cli.main import main
from tests.diagnosis.diagnosis_helpers import burckhardt

PAGE = (Path(__file__).parents[2] / "docs" / "own_data.md").read_text()
HEAD = re.search(r"```\n(t;kappa.*?\n.*?\n)", PAGE, re.DOTALL)[1]
CONFIG = re.search(r"```toml\n(.*?)```", PAGE, re.DOTALL)[1]


def spreadsheet(path, seed):
    """A rig as the page shows it: the adhesion falls with the tyre's pressure."""
    rng = np.random.default_rng(seed)
    rows, sweeps = 2400, 24
    slip = np.concatenate([0.12 * np.sin(np.linspace(0, 2 * np.pi, rows // sweeps))] * sweeps)
    t_s = np.arange(rows) * 0.05 + np.repeat(np.arange(sweeps) * 5.0, rows // sweeps)
    pressure = np.repeat(rng.uniform(60, 110, sweeps), rows // sweeps)
    rail = np.repeat(rng.permutation(["dry", "clean"] * (sweeps // 2)), rows // sweeps)
    load = np.full(rows, 3020.0)
    adhesion = (1 - 0.004 * (pressure - 85)) * burckhardt(slip) + 0.01 * rng.standard_normal(rows)
    # The page's column counts the other way.
    columns = (t_s, -100 * slip, adhesion * load / 1e3, load / 1e3, np.full(rows, 40.1), pressure)
    lines = [
        ";".join([*(f"{x:.6f}".replace(".", ",") for x in row), text])
        for *row, text in zip(*columns, rail, strict=True)
    ]
    path.write_text(HEAD + "\n".join(lines) + "\n", encoding="utf-8")
    return path


@pytest.fixture
def folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    spreadsheet(tmp_path / "rig.csv", 1)
    spreadsheet(tmp_path / "other.csv", 2)
    more = '"normal_load_N" = "Fz"\nspeed_mps = "v"\n'
    (tmp_path / "rig.toml").write_text(CONFIG + more)
    return tmp_path


def commands():
    """The page's commands, lines continued; a signal's --column stands in the configuration."""
    for match in re.finditer(r"^    (adhesion-can (?:.*\\\n)*.*)", PAGE, re.MULTILINE):
        yield shlex.split(match[1].replace("\\\n", " "))[1:]


@pytest.mark.costly
def test_the_page_runs_as_it_stands(folder, capsys):
    ran = [words for words in commands() if "drive.log" not in words]
    assert [words[0] for words in ran] == ["check", "diagnose", "diagnose", "evaluate"]
    assert "--formula" in ran[2]
    # With slip against force, which the page's first command does not mention, check says so.
    assert main(ran[0]) == 1
    out = " ".join(capsys.readouterr().out.split())
    assert "opposite signs" in out
    assert "sign=-1" in out
    for place, words in enumerate(ran[1:], start=1):
        assert main([*words, "--json", f"{place}.json"]) == 0
    found = json.loads((folder / "1.json").read_text())
    assert [cause["effect"] for cause in found["causes"]] == ["channel:tyre pressure"]
    slope = found["causes"][0]["parameters"]["slope"]
    assert slope["value"] == pytest.approx(-0.004, abs=0.0005)
    evaluated = json.loads((folder / "3.json").read_text())
    assert evaluated["total"]["as_written"]["interval"][0] > 10.0


def test_check_says_what_it_took_for_what(folder, capsys):
    assert main(["check", "rig.csv", "--config", "rig.toml"]) == 0
    out = " ".join(capsys.readouterr().out.split())
    for words in (
        "cells separated by semicolons, decimal commas",
        "the first line below the heading is read as units",
        "slip from 'kappa' in percent with the sign changed",
        "speed_mps from 'v' in km/h",
        "rail=dry",
        "verdict: usable",
    ):
        assert words in out, words
    assert (folder / "rig.csv").exists()
