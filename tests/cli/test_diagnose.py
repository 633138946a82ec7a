"""`diagnose` as a user types it: what goes into the engine, what is written, how it fails."""

import json
import shlex
import sys
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from adhesion_can.cli.diagnose import build_command_line
from adhesion_can.cli.main import build_parser, main
from adhesion_can.config.model_file import read_model
from adhesion_can.diagnosis.result import Verdict
from adhesion_can.extras import install_extra
from adhesion_can.input_files import file_sha256
from tests.reporting.test_diagnosis_report import (
    SECTIONS,
    empty,
    estimate,
    named,
    nothing,
    unexplained,
)
from tests.reporting.test_page import nothing_is_loaded

ENGINE = "adhesion_can.api.diagnosis._diagnose"


@pytest.fixture(scope="module")
def logs(tmp_path_factory):
    """Two drives of 8 s."""
    folder = tmp_path_factory.mktemp("logs")
    paths = [folder / "one.log", folder / "it's two.log"]
    for seed, path in enumerate(paths, start=1):
        arguments = ["simulate", "--scenario", "wet", "--duration", "8", "--seed", str(seed)]
        assert main([*arguments, "--log", str(path)]) == 0
    return paths


def write_table(path, seed, rows=400):
    rng = np.random.default_rng(seed)
    slip = 0.08 + 0.07 * np.sin(np.arange(rows) / 30)
    mu = 0.3 * (1 - np.exp(-25 * slip)) - 0.4 * slip + 0.01 * rng.standard_normal(rows)
    lines = [
        f"{k / 20},{a:.6f},{b:.6f},{k / rows}"
        for k, (a, b) in enumerate(zip(slip, mu, strict=True))
    ]
    path.write_text("\n".join(["time_s,slip,adhesion,oil_film_um", *lines, "7,,0.1,0"]) + "\n")
    return path


@pytest.fixture
def tables(tmp_path):
    return [write_table(tmp_path / f"t{k}.csv", k) for k in (1, 2)]


@pytest.fixture
def engine(monkeypatch):
    """Stands for the engine: says what it is told to, and keeps what it was asked."""
    asked = SimpleNamespace(answer=named(), drives=None, holdout=None, stages=[])

    def diagnose(drives, holdout, settings, show, ask_witness):
        asked.ask_witness = ask_witness
        asked.drives, asked.holdout, asked.settings = list(drives), list(holdout), settings
        show("effects", 0.5)
        counts = {drive.name: len(drive) for drive in (*drives, *holdout)}
        return replace(asked.answer, samples=counts)

    monkeypatch.setattr(ENGINE, diagnose)
    return asked


def diagnose(*arguments):
    return main(["diagnose", *map(str, arguments)])


def fails(capsys, *arguments):
    """Runs the command, which must end with 2 and one line; returns the line."""
    try:
        code = diagnose(*arguments)
    except SystemExit as error:
        code = error.code
    assert code == 2
    err = capsys.readouterr().err
    assert err.count("\n") == 1, err
    assert err.startswith("adhesion-can diagnose: ")
    return err


# --- what goes in, what comes out


@pytest.mark.costly
def test_logs_go_in_as_drives_and_page_json_and_model_come_out(logs, engine, tmp_path, capsys):
    html, model, result = tmp_path / "r.html", tmp_path / "m.toml", tmp_path / "r.json"
    options = ["--html", html, "--extended", model, "--json", result]
    assert diagnose(logs[0], "--holdout", logs[1], *options) == 0
    (drive,), (held,) = engine.drives, engine.holdout
    assert (drive.name, held.name) == ("one.log", "it's two.log")
    assert min(len(drive), len(held)) > 3000
    assert set(drive.axle) == set(range(1, 7))

    said = capsys.readouterr()
    assert "Named: adhesion at the same slip falls with vehicle speed" in said.out
    for path in (html, model, result):
        assert f"written: {path}" in said.out
    assert said.err == ""

    document = json.loads(result.read_text())
    assert document["verdict"] == "named"
    assert [(Path(one["path"]).name, one["held_out"]) for one in document["inputs"]] == [
        ("one.log", False),
        ("it's two.log", True),
    ]
    for one, path, rows in zip(document["inputs"], logs, (drive, held), strict=True):
        assert one["sha256"] == file_sha256(path)
        assert one["samples"] == len(rows)
    assert document["version"]
    assert document["dbc"]["sha256"]
    assert document["problems"] == []

    elements = nothing_is_loaded(html.read_text())
    # Logs have their signals over time beside what a table has.
    at = SECTIONS.index("Residual")
    headings = [*SECTIONS[:at], "Drives over time", *SECTIONS[at:]]
    assert elements.texts("h2") == ["Result", *headings]
    text = " ".join(elements.text.values())
    assert document["command"] in text
    assert file_sha256(logs[1]) in text

    written = read_model(model)
    assert written.effects == named().model.effects
    assert written.provenance["verdict"] == "named"
    assert written.provenance["command"] == document["command"]
    assert file_sha256(logs[0]) in written.provenance["input 1"]
    assert "held out" in written.provenance["input 2"]


@pytest.mark.usefixtures("engine")
def test_the_command_that_is_told_repeats_it(logs, tmp_path):
    result = tmp_path / "r.json"
    assert diagnose(*logs, "--json", result) == 0
    command = json.loads(result.read_text())["command"]
    words = shlex.split(command)
    assert words[:2] == ["adhesion-can", "diagnose"]
    first = build_parser().parse_args(words[1:])
    assert first.inputs == logs
    assert first.json == str(result)
    assert build_command_line(first) == command


def test_the_service_is_asked_only_with_the_option(logs, engine):
    assert diagnose(*logs) == 0
    assert engine.ask_witness is None
    assert diagnose(*logs, "--witness") == 0
    assert engine.ask_witness is not None


@pytest.mark.parametrize("name", ["-x.log", "a b.log", "it's.log", "$(x).log", "ä.log"])
def test_the_command_survives_names_of_files(name):
    arguments = ["diagnose", f"./{name}", "o.log", "--holdout", f"./h{name}", "--json", "-"]
    arguments += ["--html", f"./{name}.html", "--png", f"./{name}.png", "--svg", f"./{name}.svg"]
    first = build_parser().parse_args([*arguments, "--open", "--lenient", "--witness"])
    again = build_parser().parse_args(shlex.split(build_command_line(first))[1:])
    assert vars(again) == vars(first)


def test_tables_go_in_with_their_covariates_and_lost_rows_are_told(tables, engine, capsys):
    assert diagnose(tables[0], "--holdout", tables[1]) == 0
    (drive,), (held,) = engine.drives, engine.holdout
    assert (drive.name, len(drive), len(held)) == ("t1.csv", 400, 400)
    assert "oil_film_um" in drive.covariates
    assert "t1.csv: dropped 1 of 401 rows without a finite time" in capsys.readouterr().out


def test_files_of_one_name_are_told_apart(engine, tmp_path):
    paths = []
    for seed, folder in enumerate("ab"):
        (tmp_path / folder).mkdir()
        paths.append(write_table(tmp_path / folder / "t.csv", seed))
    assert diagnose(*paths) == 0
    assert [drive.name for drive in engine.drives] == [str(path) for path in paths]


@pytest.mark.parametrize("answer", [named, nothing, unexplained, empty])
def test_the_exit_status_is_0_whatever_the_verdict(answer, tables, engine, tmp_path, capsys):
    engine.answer = answer()
    assert diagnose(tables[0], "--html", tmp_path / "r.html", "--json", "-") == 0
    said = capsys.readouterr()
    document = json.loads(said.out)  # stdout carries the JSON alone
    assert document["verdict"] in list(Verdict)
    assert nothing_is_loaded((tmp_path / "r.html").read_text()).texts("h2")[1:] == list(SECTIONS)


def test_without_an_extension_the_plain_curve_is_written_and_it_is_said(
    tables, engine, tmp_path, capsys
):
    engine.answer, model = nothing(), tmp_path / "m.toml"
    assert diagnose(tables[0], "--extended", model) == 0
    assert "contains the plain curve, because there is no extension" in capsys.readouterr().out
    written = read_model(model)
    assert written.effects == written.splines == ()
    assert written.base == estimate(0.31, 26.0, 0.4).theta
    assert written.base_covariance is not None
    assert written.provenance["verdict"] == "nothing_found"


def test_a_curve_without_a_covariance_is_written_without_one(tables, engine, tmp_path):
    found = nothing()
    engine.answer = replace(found, model=replace(found.model, base_covariance=None))
    assert diagnose(tables[0], "--extended", tmp_path / "m.toml") == 0
    assert read_model(tmp_path / "m.toml").base_covariance is None


def test_without_any_curve_no_model_is_written_and_it_is_said(tables, engine, tmp_path, capsys):
    engine.answer, model = empty(), tmp_path / "m.toml"
    assert diagnose(tables[0], "--extended", model) == 0
    said = capsys.readouterr().out
    assert "not written, because no curve could be fitted" in said
    assert f"written: {model}" not in said
    assert not model.exists()


@pytest.mark.usefixtures("engine")
def test_one_file_without_a_usable_row_is_left_out_and_told(tables, tmp_path, capsys):
    still = tmp_path / "still.csv"
    still.write_text("time_s,slip,adhesion\n0,7,0.1\n1,8,0.1\n")
    assert diagnose(tables[0], still) == 0
    assert "still.csv: no usable row: 2 slip, speed or load out of range" in (
        capsys.readouterr().out
    )
    assert "no usable row" in fails(capsys, still)
    assert "still.csv" in fails(capsys, tables[0], "--holdout", still)


# --- how it fails


def test_bad_inputs_are_one_line(logs, tables, engine, tmp_path, capsys):
    assert "No such file" in fails(capsys, tmp_path / "none.log")
    assert "No such file" in fails(capsys, tmp_path / "none.csv")
    assert "is a folder" in fails(capsys, tmp_path)
    assert "recordings and tables together" in fails(capsys, logs[0], tables[0])
    assert "recordings and tables together" in fails(capsys, logs[0], "--holdout", tables[0])
    assert engine.drives is None


def test_the_same_drive_is_not_held_out(logs, engine, tmp_path, capsys):
    assert "hold out another drive" in fails(capsys, logs[0], "--holdout", logs[0])
    copy = tmp_path / "copy.log"
    copy.write_bytes(logs[0].read_bytes())
    assert "hold out another drive" in fails(capsys, logs[0], "--holdout", copy)
    assert "give it once" in fails(capsys, logs[0], copy)
    assert engine.drives is None


@pytest.mark.parametrize("option", ["--html", "--extended", "--json"])
def test_outputs_that_cannot_be_written_are_told_before_the_work(
    option, tables, engine, tmp_path, capsys
):
    assert option in fails(capsys, tables[0], option, tmp_path / "no" / "f")
    assert "is a folder" in fails(capsys, tables[0], option, tmp_path)
    before = tables[0].read_bytes()
    assert "one of the inputs" in fails(capsys, tables[0], option, tables[0])
    assert tables[0].read_bytes() == before
    assert engine.drives is None


def test_two_outputs_need_two_files(tables, engine, tmp_path, capsys):
    both = tmp_path / "f"
    assert "--html" in fails(capsys, tables[0], "--html", both, "--json", both)
    assert engine.drives is None


def test_without_the_extra_the_page_is_refused_before_the_work(
    tables, engine, tmp_path, capsys, monkeypatch
):
    monkeypatch.setitem(sys.modules, "jinja2", None)
    told = fails(capsys, tables[0], "--html", tmp_path / "r.html")
    assert install_extra("report") in told
    assert engine.drives is None


def test_without_effort_the_configuration_is_named(logs, engine, tmp_path, capsys):
    (tmp_path / "c.toml").write_text(
        '[roles]\n"wheel_speed.1" = "WheelSpeeds1.WheelSpeed_Ax1"\n'
        'vehicle_speed = "VehicleSpeed.VehicleSpeed"\n'
    )
    told = fails(capsys, logs[0], "--config", tmp_path / "c.toml")
    assert "tractive effort" in told
    assert engine.drives is None


# --- the whole of it


@pytest.mark.slow
@pytest.mark.timeout(300)
def test_the_engine_itself_answers(tmp_path, capsys):
    log, model, result = tmp_path / "a.log", tmp_path / "m.toml", tmp_path / "r.json"
    simulate = ["simulate", "--scenario", "sweep", "--duration", "120", "--seed", "3"]
    assert main([*simulate, "--effect", "wheel_radius=0.015", "--log", str(log)]) == 0
    options = ["--html", tmp_path / "r.html", "--extended", model, "--json", result]
    assert diagnose(log, *options) == 0
    document = json.loads(result.read_text())
    assert document["verdict"] == "named"
    assert "wheel_radius" in {cause["effect"] for cause in document["causes"]}
    assert "wheel_radius" in read_model(model).names[0]
    elements = nothing_is_loaded((tmp_path / "r.html").read_text())
    # Logs have their signals over time beside what a table has.
    at = SECTIONS.index("Residual")
    headings = [*SECTIONS[:at], "Drives over time", *SECTIONS[at:]]
    assert elements.texts("h2") == ["Result", *headings]
    capsys.readouterr()
    # The model that was written is one that the others read.
    assert main(["identify", str(log), "--model", str(model), "--json", "-"]) == 0
    assert json.loads(capsys.readouterr().out)["effects"][0]["effect"] == "wheel_radius"
