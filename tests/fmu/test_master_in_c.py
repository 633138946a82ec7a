"""A master in C, without Python in its process."""

import shutil
import subprocess
import sys
from pathlib import Path
from xml.etree import ElementTree as ET

import pytest

from adhesion_can.config import load_configuration
from adhesion_can.fmu import library
from adhesion_can.fmu.locomotive import LocomotiveSlave
from tests.fmu.drives import stepped

MASTER = Path(__file__).parent / "master.c"
OUTPUT = "true_adhesion_used"
STEPS = 50


@pytest.fixture(scope="module")
def master(tmp_path_factory):
    """Path of the compiled master."""
    if sys.platform == "win32":
        pytest.skip("the master loads libraries as POSIX does")
    compiler = ["cc"]
    if not shutil.which("cc"):
        pytest.importorskip("ziglang", reason="needs a C compiler")
        compiler = [sys.executable, "-m", "ziglang", "cc"]
    out = tmp_path_factory.mktemp("master") / "master"
    words = [*compiler, "-std=gnu99", "-Wall", "-Werror", MASTER, "-o", out, "-ldl"]
    subprocess.run(words, check=True, timeout=300)
    return out


def run_master(master, folder, **changes):
    root = ET.parse(folder / "modelDescription.xml").getroot()  # noqa: S314  our own
    (variable,) = root.findall(f"ModelVariables/ScalarVariable[@name='{OUTPUT}']")
    platform = library.own_platform()
    suffix = library.PLATFORMS[platform].suffix
    given = {
        "library": folder / "binaries" / platform / f"adhesion_can_locomotive{suffix}",
        "guid": root.get("guid"),
        "resources": (folder / "resources").as_uri(),
        "reference": variable.get("valueReference"),
        "steps": str(STEPS),
        "step": "0.002",
    } | changes
    words = [master, *given.values()]
    return subprocess.run(words, capture_output=True, text=True, check=False, timeout=300)


def test_it_gets_what_the_slave_gives_to_the_last_digit(master, unpacked):
    done = run_master(master, unpacked["locomotive"])
    assert done.returncode == 0, done.stderr
    slave = LocomotiveSlave(load_configuration())
    expected = stepped(slave, {}, STEPS * 2000, 2000)
    assert [float(line) for line in done.stdout.split()] == [
        expected[2000 * n][OUTPUT] for n in range(1, STEPS + 1)
    ]
    assert done.stderr == ""


@pytest.mark.parametrize("form", ["file://localhost{}/", "file:{}", "{}"])
def test_the_resources_are_found_by_any_spelling(master, unpacked, form):
    path = (unpacked["locomotive"] / "resources").as_uri().removeprefix("file://")
    where = form.format(path)
    done = run_master(master, unpacked["locomotive"], resources=where, steps="1")
    assert done.returncode == 0, done.stderr


def test_a_message_is_a_format_without_arguments(master, unpacked):
    done = run_master(master, unpacked["locomotive"], guid="%s%n {7}")
    assert done.returncode == 4
    assert done.stderr.startswith("100 %s: the GUID is {")
    assert "not %s%n {7}: the description is of another FMU" in done.stderr


def test_resources_that_are_nowhere(master, unpacked):
    done = run_master(master, unpacked["locomotive"], resources="file:///nowhere/at%20all")
    assert done.returncode == 4
    assert "/nowhere/at all" in done.stderr or "fmu.toml" in done.stderr
