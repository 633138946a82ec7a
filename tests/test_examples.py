"""Every example of docs/examples runs as it is printed, and the notebook shows pictures."""

import re
import subprocess
import sys
from pathlib import Path

import pytest

from tests.cli.test_multicast import NETWORK, own_network

ROOT = Path(__file__).resolve().parent.parent
EXAMPLES = ROOT / "docs" / "examples"
NOTEBOOK = EXAMPLES / "tour.ipynb"
SOME_BUS = Path("/sys/class/net/vcan0").exists()


def run_example(name, duration_s, folder, before=()):
    """Standard output of an example, run in an empty folder."""
    words = [*before, sys.executable, EXAMPLES / name, str(duration_s)]
    done = subprocess.run(
        words, cwd=folder, capture_output=True, text=True, timeout=300, check=False
    )
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


def test_every_script_is_run_here_and_listed():
    scripts = {path.name for path in EXAMPLES.glob("*.py")}
    tested = set(re.findall(r'run_example\(\s*"(\w+\.py)"', Path(__file__).read_text()))
    assert scripts == tested
    listed = (EXAMPLES / "README.md").read_text()
    for name in (*scripts, NOTEBOOK.name):
        assert f"({name})" in listed, name


@pytest.mark.costly
def test_replay(tmp_path):
    out = run_example("replay.py", 15, tmp_path)
    assert "verdict: usable" in out
    rows = re.findall(r"^(dry|wet) +([\d.]+), ([\d.]+) +([\d.]+), ([\d.]+)$", out, re.MULTILINE)
    assert [row[0] for row in rows] == ["dry", "wet", "dry"]
    for _, mu_true, mu, slip_true, slip in rows:
        assert float(mu) == pytest.approx(float(mu_true), rel=0.03)
        assert float(slip) == pytest.approx(float(slip_true), rel=0.15)


@pytest.mark.costly
def test_controller(tmp_path):
    out = run_example("controller.py", 12, tmp_path)
    assert "the rail changed: hold a small slip and probe" in out
    assert "the peak is known: hold the service's creep speed" in out
    assert float(re.search(r"used (\d+) % of the force", out)[1]) > 60.0


@pytest.mark.slow
@pytest.mark.long
def test_diagnose(tmp_path):
    out = run_example("diagnose.py", 60, tmp_path)
    assert "named:   load_dependence" in out
    before, after = map(float, re.search(r"RMSE ([\d.]+) -> ([\d.]+)", out).groups())
    assert after < 0.8 * before


@pytest.mark.slow
def test_fmu(tmp_path):
    pytest.importorskip("fmpy", reason="the example needs the extra 'test'")
    out = run_example("fmu.py", 3, tmp_path)
    assert "service.fmu: service for " in out
    assert 0.05 < float(re.search(r"mean adhesion used ([\d.]+)", out)[1]) < 0.4
    assert 0.0 < float(re.search(r"TRACKING ([\d.]+) %", out)[1]) < 100.0


@pytest.mark.costly
def test_own_database(tmp_path):
    out = run_example("own_database.py", 12, tmp_path)
    assert "verdict: usable" in out
    assert re.search(r"last estimate: mu_max 0\.2[345]", out)
    rows = (tmp_path / "setpoints.csv").read_text().splitlines()
    assert sum(",TRACKING," in row for row in rows) > 0.9 * len(rows)


@pytest.mark.costly
@pytest.mark.skipif(
    not (SOME_BUS or own_network()), reason="needs vcan0, or root, unshare and ip for multicast"
)
def test_bench(tmp_path):
    before = () if SOME_BUS else ("unshare", "-n", "sh", "-c", NETWORK + '"$0" "$@"')
    for seconds in (4, 12, 30):  # in live time: a busy machine is late, and datagrams are lost
        out = run_example("bench.py", seconds, tmp_path, before)
        if "TRACKING" in out:
            break
    assert "TRACKING" in out or "STALE_INPUT" in out  # where all inputs come late
    assert int(re.search(r"(\d+) setpoints received", out)[1]) > 50


@pytest.mark.slow
def test_the_notebook_opens_with_pictures_and_runs(tmp_path, monkeypatch):
    nbformat = pytest.importorskip("nbformat", reason="the notebook needs the extra 'test'")
    pytest.importorskip("nbclient", reason="the notebook needs the extra 'test'")
    notebook = nbformat.read(NOTEBOOK, as_version=4)
    nbformat.validate(notebook)
    assert NOTEBOOK.stat().st_size < 500_000
    assert len(pictures(notebook)) >= 3
    for name in ("JUPYTER_RUNTIME_DIR", "IPYTHONDIR", "MPLCONFIGDIR"):
        monkeypatch.setenv(name, str(tmp_path / name.lower()))
    # In a process of its own: its event loop and its warnings are not ours.
    copy = tmp_path / NOTEBOOK.name
    nbformat.write(notebook, copy)
    words = [sys.executable, ROOT / "tools" / "tour.py", copy]
    done = subprocess.run(words, capture_output=True, text=True, timeout=300, check=False)
    assert done.returncode == 0, done.stderr
    again = nbformat.read(copy, as_version=4)
    assert len(pictures(again)) == len(pictures(notebook))
    assert texts(again) == texts(notebook), "the notebook says something else now: run tools/tour"


def pictures(notebook):
    """Pictures that the cells show."""
    outputs = [o for cell in notebook.cells for o in cell.get("outputs", [])]
    return [o for o in outputs if "image/png" in o.get("data", {})]


def texts(notebook):
    """What the cells print, without the figures."""
    outputs = [o for cell in notebook.cells for o in cell.get("outputs", [])]
    printed = [o["text"] for o in outputs if o.output_type == "stream" and o.name == "stdout"]
    return [re.sub(r"\d[\d.e-]*", "#", text) for text in printed]
