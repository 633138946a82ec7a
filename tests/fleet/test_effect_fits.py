"""Sizes of effects hidden in drives: no longer those of the first order, with honest errors."""

import numpy as np
import pytest

from adhesion_can.api.configuration import as_configuration
from adhesion_can.api.diagnosis import list_input_files, load_inputs
from adhesion_can.diagnosis.diagnose import RATE_HZ
from adhesion_can.diagnosis.drive.thinning import thin_drives
from adhesion_can.diagnosis.effect_grams import EffectKey
from adhesion_can.diagnosis.inference.candidates import build_candidates
from adhesion_can.diagnosis.inference.compute_effect_grams import compute_effect_grams
from adhesion_can.diagnosis.inference.split_hold_out import split_hold_out
from adhesion_can.diagnosis.regression.find_surface_changes import (
    build_regression_data,
    find_surface_changes,
    fit_start_curves,
)
from adhesion_can.diagnosis.regression.prepare_regression import (
    choose_block_length,
    prepare_regression,
)
from adhesion_can.fleet.effect_sizes import place_of
from adhesion_can.fleet.evidence import UnitEvidence
from adhesion_can.fleet.pooled_size import pool_sizes, size_in_unit
from tests.worlds.fleet import FleetDrive, write_drive
from tests.worlds.hidden import Hidden

HIDDEN = (
    Hidden("load_dependence", "burckhardt", {"c5": 4e-12}),
    Hidden("effort_delay", "", {"delay": 0.060}),
    Hidden("sanding", "", {"gain": 0.2}),
)
KEYS = {
    "load_dependence": EffectKey("load_dependence", "burckhardt", 0, "c5", "1/N^2"),
    "effort_delay": EffectKey("effort_delay", "", 0, "delay", "s"),
    "sanding": EffectKey("sanding", "", 0, "gain", "1"),
}


def drawn(folder, hidden, seed, drive=0):
    """Evidence of a drive of 60 s, without the selection of effects that names a cause."""
    path = folder / f"{seed}-{drive}.log"
    one = FleetDrive("L1", "line1", "2026-03-01", (hidden,), (seed, 1, drive, drive))
    write_drive(one, path, duration_s=60.0)
    (loaded,) = load_inputs(list_input_files([path]), as_configuration(None), lambda *_: None)
    candidates, _ = build_candidates([loaded.drive])
    thin = thin_drives([loaded.drive], RATE_HZ)
    length_s = choose_block_length(thin)
    block = split_hold_out(thin, [False], length_s)
    data = build_regression_data(thin, [find_surface_changes(d, candidates) for d in thin])
    prepared = prepare_regression(data, fit_start_curves(data), block, candidates, length_s)
    grams = compute_effect_grams(prepared, 0.01)
    return UnitEvidence(path.name, "L1", grams=grams, path=str(path))


def pooled_deviations(folder, hidden, seeds, drives):
    """Pooled size of each seed less the truth, in its standard errors, and relative to it.

    A fleet without a single estimate has no pooled size: sand was never strewn, for example.
    """
    (truth,), key = hidden.parameters.values(), KEYS[hidden.effect]
    deviations, errors = [], []
    for seed in seeds:
        units = [drawn(folder, hidden, seed, drive) for drive in range(drives)]
        sizes = [size_in_unit(unit, key, {}) for unit in units]
        pooled = pool_sizes(key, [one for one in sizes if one is not None], 0.0)
        if pooled is not None:
            deviations.append((pooled.value - truth) / pooled.std)
            errors.append(pooled.value / truth - 1.0)
    return np.abs(deviations), np.abs(errors)


@pytest.mark.costly
@pytest.mark.parametrize("hidden", HIDDEN, ids=lambda one: one.effect)
def test_a_size_is_not_that_of_the_first_order(tmp_path, hidden):
    """To first order these are 20 to 63 % off, 5 to 9 %, and 5 to 12 %."""
    unit = drawn(tmp_path, hidden, 0)
    (truth,), key = hidden.parameters.values(), KEYS[hidden.effect]
    place = place_of(unit.grams, key)
    found = size_in_unit(unit, key, {})
    assert found.source == "fit"
    assert abs(found.value / truth - 1.0) < 0.03
    assert abs(found.value - truth) < 0.5 * abs(unit.grams.size[place] - truth)


@pytest.mark.costly
def test_a_residual_over_a_flat_slope_is_no_error_of_the_slip(tmp_path):
    """Slips are corrected by up to 4e7 here; the size was 0 with an error of 1e-6 of the truth."""
    hidden = HIDDEN[0]
    found = size_in_unit(drawn(tmp_path, hidden, 8, 1), KEYS[hidden.effect], {})
    assert abs(found.value / 4e-12 - 1.0) < 0.03
    assert 1e-3 < found.std / 4e-12 < 0.05


@pytest.mark.slow
@pytest.mark.long
@pytest.mark.parametrize("hidden", HIDDEN, ids=lambda one: one.effect)
def test_pooled_sizes_cover_the_truth(tmp_path, hidden):
    """Of 20 fleets of two drives: 4 in 5 within 2 standard errors of the truth, 9 in 10 within 3.

    Some 18 and 19 do.
    """
    deviations, errors = pooled_deviations(tmp_path, hidden, range(20), 2)
    assert len(deviations) >= 18
    assert np.mean(deviations < 2.0) >= 0.8
    assert np.mean(deviations < 3.0) >= 0.9
    assert np.median(errors) < 0.01
