"""The example package with an effect of one's own: installed, simulated, diagnosed, replayed."""

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
EXAMPLE = ROOT / "docs" / "examples" / "own_effect"
ID = "flange_lubrication"
LOSS = 0.25
DURATION_S = 120  # Both directions of curves, and blocks enough to be certain.


@pytest.fixture(scope="module")
def installed(tmp_path_factory):
    """Folder in which pip has installed the example, from the file system alone."""
    target = tmp_path_factory.mktemp("site")
    pip = [sys.executable, "-m", "pip", "install", "--quiet", "--no-index", "--no-deps"]
    own = ["--no-build-isolation", "--disable-pip-version-check", "--target", target, EXAMPLE]
    subprocess.run([*pip, *own], check=True, timeout=300)
    return target


ONE_BY_ONE = """
import json, sys
from adhesion_can.cli.main import main
for arguments in json.loads(sys.argv[1]):
    print("$ ", *arguments, flush=True)
    try:
        code = main(arguments)
    except SystemExit as error:  # --help
        code = error.code
    if code:
        sys.exit(code)
"""


def run_commands(installed, folder, *commands):
    """Standard output of each command; one process, which finds the installed example."""
    done = subprocess.run(
        [sys.executable, "-c", ONE_BY_ONE, json.dumps(commands)],
        cwd=folder,
        env={**os.environ, "PYTHONPATH": os.pathsep.join([str(installed), str(ROOT)])},
        capture_output=True,
        text=True,
        timeout=900,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    return done.stdout.split("$ ")[1:]


@pytest.mark.slow
@pytest.mark.long
@pytest.mark.timeout(1200)
def test_an_installed_effect_is_simulated_diagnosed_and_replayed(installed, tmp_path):
    drive = ("simulate", "--scenario", "sweep", "--duration", str(DURATION_S))
    replay = ("replay", "drive.log", "--to", "8")
    helped, _, report, *_ = run_commands(
        installed,
        tmp_path,
        ("simulate", "--help"),
        (*drive, "--effect", f"{ID}={LOSS}", "--truth", "truth.json", "--log", "drive.log"),
        ("diagnose", "drive.log", "--extended", "model.toml", "--json", "found.json"),
        (*replay, "--json", "r.json", "--frames", "extended.log", "--model", "model.toml"),
        (*replay, "--frames", "plain.log"),
    )
    assert f"{ID} " in helped
    truth = json.loads((tmp_path / "truth.json").read_text())
    assert truth["effects"] == [{"effect": ID, "form": "", "parameters": {"loss": LOSS}}]

    found = json.loads((tmp_path / "found.json").read_text())
    assert found["verdict"] == "named"
    assert [cause["effect"] for cause in found["causes"]] == [ID]
    assert found["causes"][0]["parameters"]["loss"]["value"] == pytest.approx(LOSS, abs=0.02)
    assert "grease of the wheel flanges" in report.lower()

    assert f'id = "{ID}"' in (tmp_path / "model.toml").read_text()
    assert json.loads((tmp_path / "r.json").read_text())["model"]["path"] == "model.toml"
    assert (tmp_path / "extended.log").read_bytes() != (tmp_path / "plain.log").read_bytes()


@pytest.mark.costly
def test_the_example_passes_the_suite_for_effects(installed, tmp_path):
    shutil.copy(EXAMPLE / "test_own_effect.py", tmp_path)
    path = os.pathsep.join([str(installed), str(ROOT)])
    done = subprocess.run(
        [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", "test_own_effect.py"],
        cwd=tmp_path,
        env={**os.environ, "PYTHONPATH": path, "PYTEST_DISABLE_PLUGIN_AUTOLOAD": "1"},
        capture_output=True,
        text=True,
        timeout=300,
        check=False,
    )
    assert "5 passed" in done.stdout, done.stdout


def test_without_the_package_its_effect_is_unknown(tmp_path, capsys):
    from adhesion_can.cli.main import main

    drive = ["simulate", "--scenario", "sweep", "--duration", "1", "--log", str(tmp_path / "a.log")]
    assert main([*drive, "--effect", ID]) == 2
    assert f"no effect '{ID}'" in capsys.readouterr().err
