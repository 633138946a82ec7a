"""Gram matrices of effects: against a regression with all columns, and through the table."""

import json
from dataclasses import replace

import numpy as np
import pytest

from adhesion_can.api.configuration import as_configuration
from adhesion_can.api.diagnosis import diagnose_inputs, list_input_files, load_inputs
from adhesion_can.diagnosis.effect_grams import EffectKey, project_grams
from adhesion_can.diagnosis.regression.gram_matrices import BlockGramMatrices
from adhesion_can.fleet.dataset import DataSet
from adhesion_can.fleet.effect_records import effect_rows, grams_from_rows
from adhesion_can.fleet.effect_sizes import EffectSizes, held_out_gain, remove_effects
from adhesion_can.fleet.read_evidence import read_evidence
from tests.worlds.fleet import FleetDrive, write_drive
from tests.worlds.hidden import Hidden

KEYS = tuple(EffectKey(name, "", 0, "size", "1") for name in "abc")


def drawn(seed, size=(0.5, 0.0, -0.2), level=2.0):
    """Columns of a curve and of three effects, and Gram matrices with the curve projected out."""
    rng = np.random.default_rng(seed)
    curve = rng.standard_normal((240, 2))
    effects = rng.standard_normal((240, 3)) + curve @ rng.standard_normal((2, 3))
    y = effects @ size + curve @ [level, -1.0] + 0.3 * rng.standard_normal(240)
    block = np.repeat(np.arange(12), 20)
    grams = BlockGramMatrices.from_columns(np.column_stack([curve, effects, y]), block)
    return curve, effects, y, replace(project_grams(grams, 2, KEYS, 0.01), typical=(1.0, 1.0, 1.0))


@pytest.mark.parametrize("seed", range(5))
def test_sizes_are_those_of_a_regression_with_the_curve_beside(seed):
    curve, effects, y, found = drawn(seed)
    together = np.linalg.lstsq(np.column_stack([curve, effects]), y)[0][2:]
    assert np.linalg.solve(found.gram, found.score) == pytest.approx(together)
    for j in range(3):
        columns = np.column_stack([curve, effects[:, j]])
        size, square = np.linalg.lstsq(columns, y)[0][2], np.linalg.lstsq(columns, y)[1][0]
        assert found.size[j] == pytest.approx(size)
        alone = np.zeros(3)
        alone[j] = size
        assert found.square - found.square_change(alone) == pytest.approx(square)


def test_two_units_with_curves_of_their_own_are_one_regression():
    first, second = drawn(1, level=2.0), drawn(2, level=-7.0)
    zero = np.zeros((240, 2))
    whole = np.block([[first[0], zero, first[1]], [zero, second[0], second[1]]])
    sizes = np.linalg.lstsq(whole, np.concatenate([first[2], second[2]]))[0][4:]
    gram, score = (
        sum(getattr(one[3], name) for one in (first, second)) for name in ("gram", "score")
    )
    assert np.linalg.solve(gram, score) == pytest.approx(sizes)


def test_what_is_removed_gains_no_more():
    found = drawn(3)[3]
    sizes = dict(zip(KEYS, np.linalg.solve(found.gram, found.score), strict=True))
    left = remove_effects(found, sizes)
    assert left.score == pytest.approx(np.zeros(3), abs=1e-9)
    assert left.square < found.square


def test_standard_errors_are_those_of_the_spread_over_seeds():
    sizes = np.array([drawn(seed, size=(0.5, 0.0, 0.0))[3].size[0] for seed in range(300)])
    stds = np.array([drawn(seed, size=(0.5, 0.0, 0.0))[3].std[0] for seed in range(300)])
    # Columns differ from seed to seed: deviations in their own standard errors.
    assert np.std((sizes - 0.5) / stds) == pytest.approx(1.0, abs=0.25)


def test_a_column_that_the_curve_imitates_has_no_size():
    rng = np.random.default_rng(1)
    curve = rng.standard_normal((240, 2))
    columns = np.column_stack([curve, curve @ [1.0, 2.0], rng.standard_normal(240)])
    grams = BlockGramMatrices.from_columns(columns, np.repeat(np.arange(12), 20))
    found = project_grams(grams, 2, KEYS[:1], 0.01)
    assert np.isnan(found.size[0])
    assert np.isnan(EffectSizes.collect([found]).size).all()


def test_a_gain_is_held_out_with_two_units_and_not_with_one():
    units = [drawn(seed)[3] for seed in range(2)]
    gain, held_out = held_out_gain(units, KEYS[0])
    assert held_out
    assert gain > 0.2
    assert held_out_gain(units[:1], KEYS[0])[1] is False
    opposite = drawn(4, size=(-0.5, 0.0, 0.0))[3]
    assert held_out_gain([units[0], opposite], KEYS[0])[0] < 0.0


def test_rows_of_the_table_give_the_matrices_back():
    found = drawn(1)[3]
    rows = json.loads(json.dumps(effect_rows(found), allow_nan=False))
    again = grams_from_rows(rows[::-1])
    assert again.keys == found.keys
    for name in ("gram", "score", "score_variance", "absorbed", "square", "rows", "blocks"):
        assert getattr(again, name) == pytest.approx(getattr(found, name), rel=1e-15)
    assert grams_from_rows([]) is None
    with pytest.raises(ValueError, match="missing"):
        grams_from_rows(rows[1:])


def test_a_unit_some_of_whose_rows_are_gone_counts_as_failed_and_says_so(tmp_path):
    data, effects = DataSet(str(tmp_path)), effect_rows(drawn(1)[3])
    for name, rows in (("whole", effects), ("torn", effects[1:]), ("twice", effects * 2)):
        unit = {"unit_id": name, "path": f"/{name}", "vehicle": "007", "status": "done",
                "steps": ["diagnose"], "fingerprint": "1", "settings": "s",
                "package_version": "v"}  # fmt: skip
        data.write(unit, {"effects": rows})
    torn, twice, whole = read_evidence(data)
    assert (whole.error, whole.grams.keys) == ("", KEYS)
    assert torn.grams is twice.grams is None
    assert torn.error == (
        f"{tmp_path}: effects of torn: 2 rows instead of 3; "
        "remove its file below units/ and run the same command again"
    )
    assert "effects of twice: 6 rows instead of 3" in twice.error


@pytest.mark.costly
def test_a_drive_of_a_locomotive_has_the_effect_that_is_hidden_in_it(tmp_path):
    """The record of a real diagnosis: size within its standard errors, and one row an effect."""
    drive = FleetDrive("L", "line1", "2026-03-01", (Hidden("effort_bias", "", {"bias": 4e3}),),
                       (5, 1, 1, 0))  # fmt: skip
    path = tmp_path / drive.name
    write_drive(drive, path, duration_s=70.0)
    loaded = load_inputs(list_input_files([path]), as_configuration(None), lambda *_: None)
    found = diagnose_inputs(loaded, lambda *_: None, effect_grams=True).effect_grams
    place = next(i for i, key in enumerate(found.keys) if key.effect == "effort_bias")
    assert found.size[place] == pytest.approx(4e3, abs=max(5 * found.std[place], 100.0))
    assert found.keys[place].unit == "N"
    z = np.abs(found.score) / np.sqrt(found.score_variance)
    assert z[place] == z.max()
    assert len(effect_rows(found)) == len(found.keys)
    without = replace(found, score=0 * found.score)
    assert not without.size[place]
