"""`evaluate`: a model on data that it has not seen, as written and with its curve refitted."""

import json

import numpy as np
import pytest

import adhesion_can
from adhesion_can.cli.main import main
from adhesion_can.config.model_file import write_model
from adhesion_can.estimation.extended.model import ExtendedModel
from adhesion_can.physics.effects import ActiveEffect, effect_by_id
from tests.diagnosis.diagnosis_helpers import burckhardt, diagnosed, write_table
from tests.worlds import make_world

NOISE = 0.012


def table(path, seed, *, slope=0.1, level=1.0):
    """Sweeps of a rig whose adhesion goes with the column x1, at some level of the rail."""
    rng = np.random.default_rng(seed)
    rows, sweeps = 2400, 24
    slip = np.concatenate([0.12 * np.sin(np.linspace(0, 2 * np.pi, rows // sweeps))] * sweeps)
    t_s = np.arange(rows) * 0.05 + np.repeat(np.arange(sweeps) * 5.0, rows // sweeps)
    x1 = np.repeat(rng.normal(size=sweeps), rows // sweeps)
    adhesion = level * (1.0 + slope * x1) * burckhardt(slip) + NOISE * rng.standard_normal(rows)
    return write_table(path, {"time_s": t_s, "slip": slip, "adhesion": adhesion, "x1": x1})


@pytest.fixture(scope="module")
def named(tmp_path_factory):
    """Folder with a model, and the diagnosis that it came from, another table held out."""
    folder = tmp_path_factory.mktemp("evaluate")
    first, other = table(folder / "a.csv", 1), table(folder / "b.csv", 2, level=0.7)
    model = folder / "m.toml"
    answer = diagnosed(folder, first, "--holdout", other, "--extended", model)
    assert answer.named == {"channel:x1"}
    return folder, answer


def evaluated(folder, *arguments):
    out = folder / "evaluation.json"
    status = main(["evaluate", *map(str, arguments), "--json", str(out)])
    return status, json.loads(out.read_text())


@pytest.mark.costly
def test_it_gives_the_figures_of_the_diagnosis(named):
    folder, answer = named
    status, found = evaluated(folder, folder / "b.csv", "--model", folder / "m.toml")
    assert status == 0
    gain, total = answer.document["gain"], found["total"]
    assert total["plain"]["rmse"] == pytest.approx(gain["rmse_before"], rel=5e-4)
    for key, theirs in (("refitted", gain), ("as_written", gain["as_written"])):
        assert total[key]["rmse"] == pytest.approx(theirs["rmse_after"], rel=5e-4)
        assert total[key]["percent"] == pytest.approx(theirs["percent"], abs=0.05)
        assert total[key]["interval"] == pytest.approx(theirs["interval"], abs=0.1)


def test_a_rail_of_another_level_shows_in_the_model_as_written(named, capsys):
    """The effect holds at 0.7 of the adhesion, the curve does not."""
    folder, answer = named
    status, found = evaluated(folder, folder / "b.csv", "--model", folder / "m.toml")
    total = found["total"]
    assert total["refitted"]["rmse"] == pytest.approx(NOISE, rel=0.1)
    assert total["as_written"]["rmse"] > 2.0 * total["plain"]["rmse"]
    out = " ".join(capsys.readouterr().out.split())
    assert status == 0
    assert "Its effects apply here, but its curve does not" in out
    assert "with the curve refitted to the held-out data; the model as written" in answer.out


def test_recordings_stand_beside_each_other(named):
    folder, _ = named
    third = table(folder / "c.csv", 3)
    inputs = (folder / "a.csv", folder / "b.csv", third)
    _, found = evaluated(folder, *inputs, "--model", folder / "m.toml")
    assert [one["recording"] for one in found["recordings"]] == ["a.csv", "b.csv", "c.csv"]
    assert found["total"]["samples"] == sum(one["samples"] for one in found["recordings"])
    squares = sum(one["samples"] * one["plain"]["rmse"] ** 2 for one in found["recordings"])
    together = found["total"]["plain"]["rmse"] ** 2 * found["total"]["samples"]
    assert squares == pytest.approx(together)
    assert found["recordings"][2]["as_written"]["rmse"] == pytest.approx(NOISE, rel=0.1)


def test_effects_that_are_not_there_do_not_gain(named, capsys):
    folder, _ = named
    still = table(folder / "d.csv", 4, slope=0.0)
    _, found = evaluated(folder, still, "--model", folder / "m.toml")
    assert found["total"]["refitted"]["percent"] < 0.0
    assert found["total"]["refitted"]["interval"][1] < 0.0
    assert "a loss: the whole interval is below 0" in capsys.readouterr().out


def test_a_table_has_no_efforts_of_all_axles_for_a_load_transfer(tmp_path, capsys):
    """It ended in a traceback of the eigenvalues."""
    transfer = ActiveEffect(effect_by_id("load_transfer", "geometry"), (1.0,))
    model = tmp_path / "m.toml"
    write_model(ExtendedModel((0.4, 60.0, 0.3), effects=(transfer,)), model)
    assert main(["evaluate", str(table(tmp_path / "e.csv", 4)), "--model", str(model)]) == 2
    err = capsys.readouterr().err
    assert "load_transfer of the model needs the efforts of all axles" in err
    assert len(err.splitlines()) == 1


def test_a_missing_channel_is_an_error_with_its_name(named, tmp_path, capsys):
    folder, _ = named
    path = write_table(tmp_path / "t.csv", {"time_s": [0.0, 1.0], "slip": [0.1, 0.2],
                                            "adhesion": [0.2, 0.3]})  # fmt: skip
    assert main(["evaluate", str(path), "--model", str(folder / "m.toml")]) == 2
    err = capsys.readouterr().err
    assert "channel:x1 of the model needs x1" in err
    assert len(err.splitlines()) == 1


def test_the_page_has_every_recording(named):
    pytest.importorskip("jinja2")
    folder, _ = named
    page = folder / "e.html"
    inputs = [str(folder / name) for name in ("a.csv", "b.csv")]
    assert main(["evaluate", *inputs, "--model", str(folder / "m.toml"), "--html", str(page)]) == 0
    text = page.read_text()
    for words in ("a.csv", "b.csv", "model as written", "A model on these data"):
        assert words in text


def test_python_has_it_too(named):
    folder, _ = named
    found = adhesion_can.evaluate(folder / "b.csv", folder / "m.toml")
    assert isinstance(found, adhesion_can.Evaluation)
    assert "as written" in found._repr_html_()


@pytest.mark.slow
def test_a_recording_of_frames_gives_the_figures_of_its_diagnosis(tmp_path):
    make_world("sanding", 7, tmp_path / "a.log", duration_s=110.0, fresh=True)
    model = tmp_path / "m.toml"
    first, other = tmp_path / "a.log", tmp_path / "a_fresh.log"
    answer = diagnosed(tmp_path, first, "--holdout", other, "--extended", model)
    _, found = evaluated(tmp_path, other, "--model", model)
    gain, total = answer.document["gain"], found["total"]
    assert total["plain"]["rmse"] == pytest.approx(gain["rmse_before"], rel=5e-4)
    assert total["refitted"]["rmse"] == pytest.approx(gain["rmse_after"], rel=5e-4)
    assert total["as_written"]["rmse"] == pytest.approx(gain["as_written"]["rmse_after"], rel=5e-4)
