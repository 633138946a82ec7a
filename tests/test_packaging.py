"""The wheel and the recipe of the image."""

import hashlib
import os
import re
import shutil
import subprocess
from pathlib import Path
from zipfile import ZipFile

import pytest

from adhesion_can.cli.main import main

ROOT = Path(__file__).resolve().parents[1]
RECIPE = ROOT / "tools" / "oci" / "Containerfile"
SOURCES = ("adhesion_can", "dbc", "pyproject.toml", "README.md", "LICENSE")


def copy_sources(folder):
    """What a wheel is built of."""
    for name in SOURCES:
        if (ROOT / name).is_dir():
            ignore = shutil.ignore_patterns("__pycache__")
            shutil.copytree(ROOT / name, folder / name, ignore=ignore)
        else:
            shutil.copy(ROOT / name, folder)


def test_a_wheel_that_is_built_twice_is_the_same(tmp_path, monkeypatch):
    """From copies elsewhere, with other times and another umask."""
    hatchling = pytest.importorskip("hatchling.build", reason="hatchling is not installed")
    hashes = set()
    for number, umask in enumerate((0o022, 0o077)):
        folder = tmp_path / f"copy-{number}"
        folder.mkdir()
        before = os.umask(umask)
        try:
            copy_sources(folder)
            for path in folder.rglob("*"):
                os.utime(path, (10**9 + number, 10**9 + 1000 * number))
            monkeypatch.chdir(folder)
            wheel = hatchling.build_wheel(str(tmp_path))
        finally:
            os.umask(before)
        hashes.add(hashlib.sha256((tmp_path / wheel).read_bytes()).hexdigest())
    assert len(hashes) == 1
    with ZipFile(tmp_path / wheel) as archive:  # `export` compiles the library of FMUs
        sources = {path.name for path in (ROOT / "adhesion_can" / "fmu" / "source").iterdir()}
        assert {f"adhesion_can/fmu/source/{name}" for name in sources} <= set(archive.namelist())


@pytest.mark.skipif(shutil.which("hadolint") is None, reason="hadolint is not here")
def test_the_recipe_of_the_image_passes_its_lint():
    done = subprocess.run(
        ["hadolint", str(RECIPE)], capture_output=True, text=True, check=False, timeout=60
    )
    assert (done.returncode, done.stdout) == (0, "")


def test_the_recipe_copies_what_a_wheel_is_built_of():
    copied = re.findall(r"^COPY (?!--)(.*) \S+$", RECIPE.read_text(), re.MULTILINE)
    assert set(" ".join(copied).split()) == set(SOURCES)


def test_the_command_of_the_image_is_one_of_ours(capsys):
    command = re.search(r"^CMD \[(.*)\]$", RECIPE.read_text(), re.MULTILINE)[1]
    words = re.findall(r'"([^"]*)"', command)
    words[words.index("/etc/adhesion-can.toml")] = "no-such-file.toml"
    assert main(words) == 2
    assert "no-such-file.toml" in capsys.readouterr().err
