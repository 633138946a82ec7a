"""The shell tools: what they install, and that help installs nothing."""

import shutil
import subprocess
import sys
from collections import Counter
from pathlib import Path

import pytest

from tests.conftest import DRAWN, draw

ROOT = Path(__file__).resolve().parents[1]

FAKE_PYTHON = """#!/bin/bash
echo "$*" >>"$(dirname "$0")/calls"
"""


@pytest.fixture
def clone(tmp_path):
    """A clone with the tools, and no environment."""
    (tmp_path / "tools").mkdir()
    for name in ("bench", "demo", "env.sh"):
        shutil.copy(ROOT / "tools" / name, tmp_path / "tools")
    shutil.copytree(ROOT / "tools" / "benchmarks", tmp_path / "tools" / "benchmarks")
    shutil.copy(ROOT / "pyproject.toml", tmp_path)
    return tmp_path


def run(clone, tool, *words):
    return subprocess.run(
        [clone / "tools" / tool, *words], capture_output=True, text=True, check=False, timeout=60
    )


@pytest.mark.parametrize("word", ["--help", "-h"])
def test_help_of_the_benches_installs_nothing(clone, word):
    done = run(clone, "bench", word)
    assert done.returncode == 0
    assert done.stdout.startswith("Benchmarks: ")
    assert "tools/bench closed-loop " in done.stdout
    assert "#" not in done.stdout
    assert done.stderr == ""
    assert not (clone / ".venv").exists()


def test_an_unknown_bench_is_named_before_anything_is_installed(clone):
    done = run(clone, "bench", "nothing")
    assert done.returncode == 1
    assert "there are: buses closed_loop " in done.stderr
    assert not (clone / ".venv").exists()


def test_the_demo_installs_the_extra_of_its_report_and_says_how_long_that_takes(clone):
    programs = clone / ".venv" / "bin"
    programs.mkdir(parents=True)
    for name in ("python", "adhesion-can"):
        (programs / name).write_text(FAKE_PYTHON)
        (programs / name).chmod(0o755)
    done = run(clone, "demo", "--headless")
    calls = (programs / "calls").read_text().splitlines()
    assert any(line.endswith(f"-e {clone}[report]") for line in calls)
    assert calls[-1] == "demo --headless"
    assert "with its extra 'report' (once; one to three minutes)" in done.stderr


def collected(*words):
    """Names of the tests of a file, some of which are slow."""
    file = "tests/estimation/test_compare_directions.py"
    words = ["-m", "pytest", "-q", "--collect-only", *words, file]
    done = subprocess.run(
        [sys.executable, *words], cwd=ROOT, capture_output=True, text=True, check=True, timeout=120
    )
    return {line for line in done.stdout.splitlines() if "::" in line}


@pytest.mark.costly
def test_of_the_tests_that_take_time_some_are_drawn_and_all_others_stay():
    slow, costly = collected("-m", "slow"), collected("-m", "costly and not slow")
    others = collected("-m", "not slow and not costly")
    drawn = collected("--drawn", "a")
    assert slow
    assert costly
    assert others
    assert drawn == others | draw("a", slow, DRAWN["slow"]) | draw("a", costly, DRAWN["costly"])


OF = DRAWN["slow"]
SLOW = [f"tests/{file}.py::test_b[{number}]" for file in "abc" for number in range(20)] + [
    f"tests/{file}.py::test_b" for file in "defghi"
]


def test_each_slow_test_is_drawn_by_one_commit_in_eight():
    commits = [f"{number:x}" for number in range(4000)]
    counts = Counter(name for commit in commits for name in draw(commit, SLOW, OF))
    for name in SLOW:
        assert counts[name] / len(commits) == pytest.approx(1 / OF, rel=0.25)  # 5 deviations


@pytest.mark.parametrize("commit", ["8c39c147", "15c0bacb", "a"])
def test_what_is_drawn_is_an_eighth_of_each_file(commit):
    drawn = draw(commit, SLOW, OF)
    assert drawn == draw(commit, SLOW[::-1], OF)
    assert len(drawn) in (len(SLOW) // OF, len(SLOW) // OF + 1)
    of_file = Counter(name.partition("::")[0] for name in drawn)
    assert all(of_file[f"tests/{file}.py"] in (2, 3) for file in "abc")
