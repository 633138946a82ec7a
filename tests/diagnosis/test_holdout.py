"""Whole drives kept back: another drive in the same world gives the gain."""

import json

import pytest

from adhesion_can.cli.main import main
from tests.worlds import make_world


@pytest.fixture(scope="module")
def world(tmp_path_factory):
    folder = tmp_path_factory.mktemp("holdout")
    truth = make_world("sanding", 7, folder / "a.log", duration_s=110.0, fresh=True)
    return truth, folder


def diagnosed(folder, *arguments):
    assert main(["diagnose", *arguments, "--json", str(folder / "d.json")]) == 0
    return json.loads((folder / "d.json").read_text())


@pytest.mark.slow
def test_a_drive_held_out_gives_the_gain_of_what_another_one_named(world):
    truth, folder = world
    first, second = str(folder / "a.log"), str(folder / "a_fresh.log")
    found = diagnosed(folder, first, "--holdout", second)
    assert found["verdict"] == "named"
    assert [cause["effect"] for cause in found["causes"]] == ["sanding"]
    assert "a_fresh.log" in found["gain"]["held_out"]
    low, high = found["gain"]["interval"]
    assert 5 < low < truth.fresh_gain_percent() + 3
    assert low < found["gain"]["percent"] < high


@pytest.mark.costly
def test_of_two_drives_one_is_held_out_and_its_name_is_given(world):
    _, folder = world
    found = diagnosed(folder, str(folder / "a.log"), str(folder / "a_fresh.log"))
    assert found["verdict"] == "named"
    assert "1 of 2 recordings" in found["gain"]["held_out"]
    assert sum(one.get("held_out", False) for one in found["inputs"]) == 1


@pytest.mark.slow
def test_a_held_out_drive_keeps_its_surfaces_as_evaluate_has_them(tmp_path):
    """The drive that decides has one surface; without changes it is explained as well."""
    simulated = {"a": ("sweep", "60"), "b": ("dry-wet-dry", "60")}
    for name, (scenario, seconds) in simulated.items():
        words = ["simulate", "--scenario", scenario, "--duration", seconds, "--seed", "3"]
        words += ["--effect", "load_dependence=4e-12", "--log", str(tmp_path / f"{name}.log")]
        assert main(words) == 0
    first, second = (str(tmp_path / f"{name}.log") for name in simulated)
    model = str(tmp_path / "m.toml")
    found = diagnosed(tmp_path, first, "--holdout", second, "--extended", model)
    assert main(["evaluate", second, "--model", model, "--json", str(tmp_path / "e.json")]) == 0
    evaluated = json.loads((tmp_path / "e.json").read_text())
    assert found["gain"]["rmse_before"] == pytest.approx(
        evaluated["total"]["plain"]["rmse"], rel=5e-3
    )
