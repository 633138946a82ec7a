"""The line that installs an extra: it is typed as it is printed, in a clone and where installed."""

import os
import shlex
import subprocess
import sys
from pathlib import Path

import pytest

from adhesion_can import extras
from adhesion_can.extras import install_extra, install_package

ROOT = Path(__file__).resolve().parents[1]


@pytest.fixture
def environment(tmp_path, monkeypatch):
    """An environment with a pip that is not on the PATH, and a package that is installed in it."""
    programs = tmp_path / "venv" / "bin"
    programs.mkdir(parents=True)
    for name in ("python", "pip"):
        (programs / name).write_text("#!/bin/sh\nprintf '%s\\n' \"$@\"\n")
        (programs / name).chmod(0o755)
    module = tmp_path / "venv" / "site-packages" / "adhesion_can" / "extras.py"
    module.parent.mkdir(parents=True)
    monkeypatch.setattr(sys, "executable", str(programs / "python"))
    monkeypatch.setattr(extras, "__file__", str(module))
    monkeypatch.setenv("PATH", os.defpath)
    monkeypatch.chdir(tmp_path)
    return programs


@pytest.mark.usefixtures("environment")
def test_an_installed_package_is_named_by_its_distribution():
    assert install_extra("report") == "venv/bin/pip install 'adhesion-can[report]'"


def test_a_clone_is_named_by_its_folder(environment, tmp_path, monkeypatch):
    clone = tmp_path / "a clone"
    (clone / "adhesion_can").mkdir(parents=True)
    (clone / "pyproject.toml").write_text((ROOT / "pyproject.toml").read_text())
    monkeypatch.setattr(extras, "__file__", str(clone / "adhesion_can" / "extras.py"))
    assert install_extra("report") == "venv/bin/pip install -e 'a clone[report]'"
    monkeypatch.chdir(clone)
    assert install_extra("report") == f"{environment}/pip install -e '.[report]'"


def test_an_active_environment_needs_no_path(environment, monkeypatch):
    monkeypatch.setenv("PATH", f"{environment}:{os.defpath}")
    assert install_package("s3fs") == "pip install s3fs"


def test_without_pip_its_module_is_named(environment):
    (environment / "pip").unlink()
    assert install_package("s3fs") == "venv/bin/python -m pip install s3fs"


@pytest.mark.usefixtures("environment")
def test_a_shell_takes_the_line_as_it_is(tmp_path):
    line = install_extra("report")
    done = subprocess.run(
        ["sh", "-c", line], cwd=tmp_path, capture_output=True, text=True, check=True, timeout=30
    )
    assert done.stdout.splitlines() == ["install", "adhesion-can[report]"]


def test_these_tests_run_in_a_clone():
    assert " install -e " in install_extra("report")
    assert shlex.split(install_extra("report"))[-1].endswith("[report]")
