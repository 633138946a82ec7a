"""docs/architecture.md names files that exist; its recipes list every file to touch."""

import re
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent
TEXT = (ROOT / "docs" / "architecture.md").read_text(encoding="utf-8")

# What the files of an example have in common: its class, its role or its name on the bus.
EXAMPLES = {
    "An effect": r"id=\"humidity\"",
    "A curve family": r"class MagicFormula|curves\.magic_formula|\bmagic_formula\"",
    "A role": r"Role\.RAIN\b|\bRAIN =|\bRain\b",
    "An estimator": r"\bEkfEstimator\b",
    "A format of written files": r"class ParquetPartFile|\"parquet_file\"",
    "A column of `replay --table`": r"age_s=max|_number\(\"surface_age_s|`surface_age_s` \(s\)",
    "A command": r"cli\.check\b|^\"\"\"`check`|\"check\":",
}


def recipes():
    """Title, stated number of files and listed files of each recipe."""
    part = TEXT.split("## Recipes")[1].split("\n## ")[0]
    found = re.findall(
        r"^### (.+?) \(as .+?\): (\d+) files?\n(.*?)(?=^### |\Z)", part, re.MULTILINE | re.DOTALL
    )
    return {
        name: (int(count), set(re.findall(r"^- `([^`]+)`", body, re.MULTILINE)))
        for name, count, body in found
    }


def test_every_recipe_has_an_example_here():
    assert set(recipes()) == set(EXAMPLES)


@pytest.mark.parametrize("title", EXAMPLES)
def test_a_recipe_lists_all_files_that_its_example_stands_in(title):
    count, listed = recipes()[title]
    pattern = re.compile(EXAMPLES[title], re.MULTILINE)
    files = [*(ROOT / "adhesion_can").rglob("*.py"), *(ROOT / "dbc").glob("*.dbc")]
    holding = {
        path.relative_to(ROOT).as_posix()
        for path in files
        if pattern.search(path.read_text(encoding="utf-8"))
    }
    assert holding == listed
    assert count == len(listed)


def test_every_file_that_the_page_names_is_there():
    named = set(re.findall(r"[\w/]+/\w+\.(?:py|md|dbc)\b", TEXT))
    assert len(named) > 30
    missing = [
        name
        for name in named
        if not any((ROOT / folder / name).exists() for folder in (".", "adhesion_can", "docs"))
    ]
    assert not missing


def test_the_table_of_packages_is_complete():
    table = TEXT.split("## Packages")[1].split("\n## ")[0]
    named = set(re.findall(r"`(\w+)`", "".join(re.findall(r"^\| (.+?) \|", table, re.MULTILINE))))
    present = {
        path.stem
        for path in (ROOT / "adhesion_can").iterdir()
        if path.suffix == ".py" or (path.is_dir() and path.name != "__pycache__")
    }
    assert present - {"__init__"} <= named
