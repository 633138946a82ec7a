"""Runs of pytest in forks: a module replaced by a text, and mutants that do not end."""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent
MODULE = "def twice(number):\n    return 2 * number\n"
TESTS = """
from module import twice

def test_zero():
    assert twice(0) == 0

def test_three():
    assert twice(3) == 6
"""
PROFILE = "from hypothesis import settings\nsettings.register_profile('mutation')\n"
SETTINGS = "[tool.pytest.ini_options]\nmarkers = ['slow']\n"
MUTANTS = {
    "same": MODULE,
    "added": MODULE.replace("2 *", "2 +"),
    "other": MODULE.replace("2 *", "3 *"),
    "endless": MODULE.replace("return", "while True: pass\n    return"),
    "no syntax": MODULE.replace(")", ""),
}
ASLEEP = "import time\n" + MODULE.replace("return", "time.sleep(600)\n    return")
DRIVER = """
import json, sys
from pathlib import Path
import forked_tests
from forked_tests import ForkedTests

forked_tests.IMPORTED = ("hypothesis",)
forked_tests.MORE_S = 1.0
mutants, asleep = json.loads(sys.stdin.read())
forked_tests.import_libraries()
tests = ForkedTests(Path.cwd() / "copy", ["test_module.py"], 2)
assert tests.run_unchanged()
runs = list(tests.run("module.py", mutants.items()))
forked_tests.WAITING = 1
runs += tests.run("module.py", [("asleep", asleep)])
print(json.dumps({run.name: [run.fate, run.test] for run in runs}))
"""


@pytest.mark.costly
@pytest.mark.skipif(not hasattr(os, "fork"), reason="needs fork")
def test_each_mutant_has_its_fate_and_no_file_is_changed(tmp_path):
    copy = tmp_path / "copy"
    copy.mkdir()
    files = {
        "module.py": MODULE,
        "test_module.py": TESTS,
        "conftest.py": PROFILE,
        "pyproject.toml": SETTINGS,
    }
    for name, text in files.items():
        (copy / name).write_text(text)

    done = subprocess.run(
        [sys.executable, "-c", DRIVER],
        input=json.dumps([MUTANTS, ASLEEP]),
        cwd=tmp_path,
        env={**os.environ, "PYTHONPATH": str(ROOT / "tools")},
        capture_output=True,
        text=True,
        check=True,
    )

    assert json.loads(done.stdout) == {
        "same": ["survived", ""],
        "added": ["killed", "test_module.py::test_zero"],
        "other": ["killed", "test_module.py::test_three"],
        "endless": ["timed out", ""],
        "asleep": ["timed out", ""],
        "no syntax": ["killed", ""],
    }
    assert {name: (copy / name).read_text() for name in files} == files
