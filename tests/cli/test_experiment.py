"""`experiment` as a user types it: the page, the numbers, and what is said where no page can be."""

import contextlib
import csv
import io
import json
import os
import signal
import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path

import plotly.graph_objects as go
import pytest

from adhesion_can.cli import experiment as command
from adhesion_can.cli.main import main
from adhesion_can.experiments.simulated_data import EXPERIMENTS, QUANTITIES
from adhesion_can.extras import install_extra
from tests.reporting.test_page import Elements, nothing_is_loaded

SMALL = {
    number: replace(
        e, blocks=1 if e.ramp else 4, block=40, detail_before=2, detail_after=2, detail_runs=1
    )
    for number, e in EXPERIMENTS.items()
}
OWN = {1: {"paper (sequence)"}}
OWN[2] = {"oracle", "paper (ordinary)", "paper (sequence)", "paper (all data)"}
OWN[3] = OWN[2] | {"paper (mean)", "paper (sum)"}


@pytest.fixture(autouse=True)
def _small(monkeypatch):
    monkeypatch.setattr(command, "EXPERIMENTS", SMALL)


def experiment(number, out, *more):
    chosen = ["--runs", "2", "--estimator", "paper", "--out", str(out), *map(str, more)]
    return main(["experiment", str(number), *chosen])


@pytest.fixture(scope="module")
def done(tmp_path_factory):
    """Folder and words of each experiment, in a folder that it had to make."""
    found = {}
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(command, "EXPERIMENTS", SMALL)
        for number in SMALL:
            out, said = tmp_path_factory.mktemp("out") / "new" / "folder", io.StringIO()
            with contextlib.redirect_stdout(said):
                assert experiment(number, out, "--jobs", 2 if number == 3 else 1) == 0
            found[number] = out, said.getvalue()
    return found


def rows_of(path):
    return list(csv.DictReader(path.read_text().splitlines()))


def fails(capsys, *arguments):
    try:
        code = main(list(map(str, arguments)))
    except SystemExit as error:
        code = error.code
    assert code == 2
    err = capsys.readouterr().err
    assert err.count("\n") == 1, err
    return err


def without_times(document):
    """The document but for what two runs of the same cannot share."""
    if isinstance(document, dict):
        timed = {"update_ms", "jobs"}
        return {k: without_times(v) for k, v in document.items() if k not in timed}
    return [without_times(v) for v in document] if isinstance(document, list) else document


@pytest.mark.costly
@pytest.mark.parametrize("number", [1, 2, 3])
def test_page_numbers_and_table_of_an_experiment(number, done):
    out, said = done[number]
    names = {f"experiment-{number}{ending}" for ending in (".html", ".json", ".csv")}
    assert {path.name for path in out.iterdir()} == names
    for level in ("noise sd 0.01", "noise sd 0.1"):
        assert f"Experiment {number}, {level}:" in said
    table = said[: said.index("Noise sd")]
    assert max(len(line.rstrip()) for line in table.splitlines()) <= 120
    assert "…" not in said

    document = json.loads((out / f"experiment-{number}.json").read_text())
    assert document["runs"] == 2
    assert document["command"] == (
        f"adhesion-can experiment {number} --runs 2 --seed 1 --estimator paper"
    )
    assert [level["noise_std"] for level in document["noise_levels"]] == [0.01, 0.1]
    for level in document["noise_levels"]:
        assert {e["name"] for e in level["estimators"]} == {"paper"} | OWN[number]
        for e in level["estimators"]:
            assert set(e["rmse"]) == set(QUANTITIES)
            assert len(e["rmse_by_update"]["c1"]) == (40 if number == 1 else 12)

    elements = nothing_is_loaded((out / f"experiment-{number}.html").read_text())
    figures = elements.figures()
    assert len(figures) == 12
    for figure in figures:
        go.Figure({key: figure[key] for key in ("data", "layout")})  # raises on unknown properties
        assert figure["height"] > 100
        axes = [a for name, a in figure["layout"].items() if name.startswith("xaxis")]
        assert any(axis.get("title", {}).get("text") for axis in axes)
    text = " ".join(elements.text.values())
    assert document["command"] in text
    assert document["version"] in text


def test_csv_and_json_agree(done):
    out, _ = done[3]
    document = json.loads((out / "experiment-3.json").read_text())
    rows = rows_of(out / "experiment-3.csv")
    assert list(rows[0]) == ["estimator", "noise_std", "run", "quantity", "value"]
    keys = [tuple(row[k] for k in ("estimator", "noise_std", "run", "quantity")) for row in rows]
    assert len(set(keys)) == len(keys)
    values = dict(zip(keys, (row["value"] for row in rows), strict=True))
    for level in document["noise_levels"]:
        sd = f"{level['noise_std']:g}"
        for e in level["estimators"]:
            for name in QUANTITIES:
                whole = float(values[e["name"], sd, "all", f"rmse_{name}"])
                assert whole == pytest.approx(e["rmse"][name], rel=1e-6)
                # Runs of one length: their mean squares average to that of all.
                runs = [float(values[e["name"], sd, r, f"rmse_{name}"]) for r in ("1", "2")]
                assert (sum(x * x for x in runs) / 2) ** 0.5 == pytest.approx(whole, rel=1e-6)
        bound = float(values["Cramér-Rao bound", sd, "all", "rmse_mu_max"])
        assert bound == pytest.approx(level["cramer_rao"]["rmse"]["mu_max"], rel=1e-6)


@pytest.mark.costly
def test_numbers_do_not_depend_on_the_number_of_jobs_and_json_has_stdout_alone(
    done, tmp_path, capsys
):
    assert experiment(3, tmp_path, "--jobs", 1, "--json", "-") == 0
    one, two = json.loads(capsys.readouterr().out), done[3][0] / "experiment-3.json"
    assert without_times(one) == without_times(json.loads(two.read_text()))
    assert one == json.loads((tmp_path / "experiment-3.json").read_text())


@pytest.mark.costly
def test_another_seed_gives_other_numbers(done, tmp_path):
    assert experiment(2, tmp_path, "--seed", 2, "--jobs", 1) == 0
    one, two = (
        json.loads((out / "experiment-2.json").read_text())["noise_levels"][0]["estimators"]
        for out in (done[2][0], tmp_path)
    )
    assert one[0]["rmse"] != two[0]["rmse"]


@pytest.mark.costly
def test_another_start_is_taken_and_told(done, tmp_path):
    assert experiment(3, tmp_path, "--start", "0.3,60,0.2", "--jobs", 1) == 0
    document, before = (
        json.loads((out / "experiment-3.json").read_text()) for out in (tmp_path, done[3][0])
    )
    assert document["experiment"]["theta0"] == [0.3, 60.0, 0.2]
    assert " --start 0.3,60,0.2 " in document["command"]
    rmse = [
        {e["name"]: e["rmse"]["mu_max"] for e in one["noise_levels"][0]["estimators"]}
        for one in (document, before)
    ]
    assert rmse[0]["paper (mean)"] != rmse[1]["paper (mean)"]
    # The ordinary algorithm begins anywhere in the range, wherever it is started.
    assert rmse[0]["paper (ordinary)"] == rmse[1]["paper (ordinary)"]


@pytest.mark.costly
def test_without_the_extra_the_numbers_are_written_and_it_is_said(tmp_path, capsys, monkeypatch):
    monkeypatch.setitem(sys.modules, "jinja2", None)
    assert experiment(2, tmp_path, "--jobs", 1) == 0
    said = capsys.readouterr()
    assert install_extra("report") in said.out
    assert install_extra("report") in said.err
    assert "experiment-2.html" not in said.out.split("no page")[0]
    assert {path.name for path in tmp_path.iterdir()} == {"experiment-2.json", "experiment-2.csv"}


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["4"], "4"),
        (["3", "--runs", "0"], "--runs"),
        (["3", "--jobs", "0"], "--jobs"),
        (["3", "--seed", "-1"], "--seed"),
        (["3", "--estimator", "magic"], "paper"),
        (["3", "--start", "0.3,60"], "--start"),
        (["3", "--start", "0.3,60,x"], "C1,C2,C3"),
        (["3", "--start", "9,60,0.1"], "range"),
        (["1", "--start", "0.3,60,0.1"], "experiment 1"),
        ([], "1|2|3"),
    ],
)
def test_wrong_usage_is_one_line(arguments, words, tmp_path, capsys):
    assert words in fails(capsys, "experiment", *arguments, "--out", tmp_path / "out")
    assert not (tmp_path / "out").exists()


def test_a_folder_that_cannot_be_made_is_told_before_the_runs(tmp_path, capsys):
    (tmp_path / "file").write_text("")
    assert "--out" in fails(capsys, "experiment", "3", "--out", tmp_path / "file" / "out")


def test_an_estimator_that_says_nothing_in_a_sequence_is_named(done):
    out, said = done[1]
    assert "No estimate before the end of the 40 updates: paper" in " ".join(said.split())
    elements = Elements((out / "experiment-1.html").read_text())
    drawn = {trace.get("name") for f in elements.figures() for trace in f["data"]}
    assert "paper" not in drawn


@pytest.mark.slow
@pytest.mark.timeout(300)
def test_ctrl_c_ends_it_and_its_workers_without_a_word(tmp_path):
    run = [sys.executable, "-m", "adhesion_can.cli.main", "experiment", "3", "--out", str(tmp_path)]
    # Started in the background, these tests may ignore Ctrl-C; the command must not inherit that.
    inherited = signal.signal(signal.SIGINT, signal.default_int_handler)
    process = subprocess.Popen(
        run, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, start_new_session=True
    )
    signal.signal(signal.SIGINT, inherited)
    with process:
        workers = Path(f"/proc/{process.pid}/task/{process.pid}/children")
        while not workers.read_text():
            time.sleep(0.1)
        time.sleep(3)  # somewhere in the work, which takes minutes
        os.killpg(process.pid, signal.SIGINT)
        # Ends when the last process has closed its end.
        said, complaints = process.communicate(timeout=100)
    assert process.returncode == 130
    assert said == complaints == ""
    assert not list(tmp_path.iterdir())
