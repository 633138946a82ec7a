"""Formulas for what no effect describes: found with their constants, told with their rivals."""

import json
from dataclasses import replace

import numpy as np
import pytest

from adhesion_can.cli.main import main
from adhesion_can.config.model_file import read_model
from tests.diagnosis.diagnosis_helpers import diagnosed, sweeps, write_table
from tests.worlds.mechanisms import KINDS, make_mechanism, write_mechanism

SIZE = 0.06
"""Root mean square of the hidden relative change."""
QUICK = {"threshold"}
"""Kinds of laws that are always tried; the others are slow tests."""


def found_in(folder, mechanism):
    """Diagnosis of a table: the one cause's id, its title, its cause, and the terminal's text."""
    answer = diagnosed(folder, write_mechanism(mechanism, folder / "t.csv"))
    causes = answer.document["causes"]
    assert len(causes) == 1, answer.out
    return causes[0], answer


@pytest.mark.costly
@pytest.mark.parametrize(
    "kind",
    [kind if kind in QUICK else pytest.param(kind, marks=pytest.mark.slow) for kind in KINDS],
)
def test_the_form_is_found_in_most_tables(tmp_path, kind):
    """Three tables of each kind: the form is right in two at least, and none is sure of another."""
    right = 0
    for seed in range(3):
        cause, answer = found_in(tmp_path, make_mechanism(1000 + seed, kind, size=SIZE))
        is_right = cause["effect"] == "formula" and kind in cause["title"]
        right += is_right
        if not is_right and cause["effect"] == "formula":
            assert cause["other_formulas"], answer.out
    assert right >= 2


@pytest.mark.costly
def test_constants_are_those_of_the_law(tmp_path):
    mechanism = make_mechanism(2000, "threshold", size=SIZE)
    cause, answer = found_in(tmp_path, mechanism)
    begin = float(cause["form"].split(" - ")[1].rstrip(")"))
    place = cause["parameters"]["b"]
    assert begin + place["value"] == pytest.approx(mechanism.constants[0], abs=4 * place["std"])
    assert "a threshold" in answer.out


@pytest.mark.slow
@pytest.mark.parametrize("seeds", [range(3), range(3, 9)])
def test_a_straight_line_needs_no_formula(tmp_path, seeds):
    """Tables with a linear factor: the channel is named, and no formula in its place."""
    for seed in seeds:
        mechanism = make_mechanism(3000 + seed, "product", size=SIZE)
        columns = dict(mechanism.columns)
        wind = columns["wind"]
        line = 0.02 * (wind - wind.mean())
        noise = mechanism.noise * np.random.default_rng(seed).standard_normal(len(wind))
        columns["adhesion"] = (1.0 + line) * mechanism.curve + noise
        cause, _ = found_in(tmp_path, replace(mechanism, columns=columns))
        assert cause["effect"] == "channel:wind"


@pytest.mark.costly
def test_without_a_mechanism_no_formula_is_named(tmp_path):
    """Six tables of noise: nothing is named in five at least."""
    named = 0
    for seed in range(6):
        mechanism = make_mechanism(4000 + seed, "power", size=0.0)
        answer = diagnosed(tmp_path, write_mechanism(mechanism, tmp_path / "t.csv"))
        named += bool(answer.document["causes"])
    assert named <= 1


@pytest.mark.costly
def test_the_model_with_a_formula_serves_the_other_commands(tmp_path, capsys):
    mechanism = make_mechanism(5000, "saturation", size=SIZE)
    table, model = write_mechanism(mechanism, tmp_path / "t.csv"), tmp_path / "m.toml"
    answer = diagnosed(tmp_path, table, "--extended", model)
    assert read_model(model).effects[0].effect.form == answer.document["causes"][0]["form"]
    out = tmp_path / "e.json"
    assert main(["evaluate", "--model", str(model), str(table), "--json", str(out)]) == 0
    (part,) = json.loads(out.read_text())["recordings"]
    assert part["refitted"]["rmse"] == pytest.approx(mechanism.noise, rel=0.05)
    assert main(["identify", str(table), "--model", str(model)]) == 0
    text = capsys.readouterr().out
    assert "without formula" in text


@pytest.mark.costly
def test_a_formula_of_the_users_competes(tmp_path):
    mechanism = make_mechanism(6000, "threshold", size=SIZE)
    table = write_mechanism(mechanism, tmp_path / "t.csv")
    text = "1 + size * max(wind - start, 0) where size=0.01, start=4"
    answer = diagnosed(tmp_path, table, "--formula", text)
    (cause,) = answer.document["causes"]
    assert cause["form"] == "1 + size * max(wind - start, 0)"
    start = cause["parameters"]["start"]
    assert start["value"] == pytest.approx(mechanism.constants[0], abs=4 * start["std"])
    assert "--formula" in answer.document["command"]


@pytest.mark.costly
def test_beside_a_formula_of_the_users_none_is_proposed(tmp_path):
    """A second law, in the other column, is told as what is left: a model has one formula."""
    mechanism = make_mechanism(8000, "threshold", size=SIZE)
    columns = dict(mechanism.columns)
    salt = columns["salt"] - columns["salt"].mean()
    columns["adhesion"] = columns["adhesion"] * (1.0 + 0.1 * (salt / salt.std()) ** 2)
    both = replace(mechanism, columns=columns)
    text = "1 + size * max(wind - start, 0) where size=0.01, start=4"
    answer = diagnosed(tmp_path, write_mechanism(both, tmp_path / "t.csv"), "--formula", text)
    formulas = [c["form"] for c in answer.document["causes"] if c["effect"] == "formula"]
    assert len(formulas) <= 1
    assert "salt" in answer.out


@pytest.mark.parametrize("start", ["5", "15"])
def test_a_formula_without_a_value_at_other_constants_is_searched_where_it_has_one(tmp_path, start):
    """A logarithm of wind - b has none from the least wind on: it ended in a traceback."""
    rng = np.random.default_rng(30)
    drive = sweeps(rng, 3000)
    wind = rng.uniform(16.0, 30.0, 3000)
    drive["adhesion"] *= 1.0 + 0.1 * np.log(wind - 12.0)
    path = write_table(tmp_path / "t.csv", {**drive, "wind": wind})
    text = f"1 + a * log(wind - b) where a=0.1, b={start}"
    answer = diagnosed(tmp_path, path, "--formula", text)
    assert answer.status == 0, answer.err


@pytest.mark.parametrize(
    ("text", "part"),
    [
        ("1 + a * max(sun - b, 0) where a=1, b=2", "t.csv has no sun"),
        ("1 + a * speed where a=1", "t.csv has no speed"),
        ("1 + a * load where a=1", "t.csv has no load"),
        ("1 + a * log(wind - 5) where a=1", "not a number in"),
        ("1 + (a + b) * wind where a=1, b=1", "with a = 0 the factor still varies"),
        ("1 + a * wind", "names no constants"),
    ],
)
def test_a_formula_that_cannot_be_tested_is_an_error(tmp_path, capsys, text, part):
    mechanism = make_mechanism(7000, "power", size=SIZE)
    table = write_mechanism(mechanism, tmp_path / "t.csv")
    assert main(["diagnose", str(table), "--formula", text]) == 2
    assert part in capsys.readouterr().err
