"""Pooled sizes: which estimate of a unit counts, and how well their mean covers the truth."""

import json
from dataclasses import replace

import numpy as np
import pytest

from adhesion_can.diagnosis.effect_grams import SizeEstimate
from adhesion_can.fleet.evidence import AxleDeviation, CauseSize, UnitEvidence
from adhesion_can.fleet.pooled_diagnosis import diagnose_fleet
from adhesion_can.fleet.pooled_size import (
    SizeSource,
    UnitSize,
    pool_sizes,
    size_in_unit,
    sizes_by_coasting,
)
from adhesion_can.fleet.read_evidence import cause_size
from tests.fleet.synthetic_units import KEYS, NAMES, SIZE, Fleet

KEY = KEYS[1]


def sizes(values, std, vehicle="V1"):
    return [
        UnitSize(f"u{i}", vehicle, f"/{vehicle}/{i}.log", float(value), std, SizeSource.FIT)
        for i, value in enumerate(values)
    ]


def unit(seed=1, fits=None, causes=()):
    one = Fleet(vehicles=1, drives=1, everywhere={1: SIZE}).draw(seed)[0]
    return replace(one, grams=replace(one.grams, fits=fits or {}), cause_sizes=tuple(causes))


def named(value, std, form=""):
    return CauseSize(KEY.effect, form, 0, KEY.parameter, KEY.unit, value, std)


def test_what_a_recording_itself_names_comes_before_the_fit_of_the_effect_alone():
    fits = {1: SizeEstimate(0.5, 0.01)}
    own = size_in_unit(unit(fits=fits, causes=[named(0.6, 0.02)]), KEY, {})
    assert (own.value, own.std, own.source) == (0.6, 0.02, SizeSource.DIAGNOSIS)
    for other in (named(0.6, None), named(0.6, 0.02, form="another")):
        own = size_in_unit(unit(fits=fits, causes=[other]), KEY, {})
        assert (own.value, own.std, own.source) == (0.5, 0.01, SizeSource.FIT)


def test_a_unit_without_a_fit_has_no_size_and_one_below_two_errors_says_so():
    assert size_in_unit(unit(), KEY, {}) is None
    nothing = unit(fits={1: SizeEstimate(0.01, 0.01)})
    nothing = replace(nothing, grams=replace(nothing.grams, score=0 * nothing.grams.score))
    own = size_in_unit(nothing, KEY, {})
    assert (own.value, own.source) == (0.01, SizeSource.FIRST_ORDER)


def test_a_fit_is_moved_by_what_acts_beside():
    one = unit(fits={1: SizeEstimate(0.5, 0.01)})
    moved = size_in_unit(one, KEY, {KEYS[0]: 0.3})
    gram = one.grams.gram
    assert moved.value == pytest.approx(0.5 - 0.3 * gram[1, 0] / gram[1, 1])


def test_means_cover_the_truth():
    """Three recordings with a spread between them as large as their errors; 1000 draws."""
    rng, within = np.random.default_rng(3), 0
    for _ in range(1000):
        drawn = 1.0 + np.hypot(0.1, 0.1) * rng.standard_normal(3)
        found = pool_sizes(KEY, sizes(drawn, 0.1), 0.1)
        within += abs(found.value - 1.0) < 2.0 * found.std
    assert 0.94 <= within / 1000 <= 0.985


def test_a_spread_between_recordings_is_in_the_error_and_vehicles_count_alike():
    alike = pool_sizes(KEY, sizes([1.0, 1.0], 0.1), 0.0)
    apart = pool_sizes(KEY, sizes([0.5, 1.5], 0.1), 0.0)
    assert alike.std == pytest.approx(0.1 / np.sqrt(2))
    assert apart.std == pytest.approx(0.5)
    fleet = pool_sizes(KEY, [*sizes([1.0] * 9, 0.1), *sizes([2.0], 0.1, "V2")], 0.3)
    assert set(fleet.by_vehicle) == {"V1", "V2"}
    assert 1.3 < fleet.value < 1.6  # by recordings it were 1.1
    assert pool_sizes(KEY, [], 0.1) is None


def test_coasting_gives_the_radius_of_an_axle_or_of_all():
    radii = (AxleDeviation(1, -0.01, 1e-4), AxleDeviation(2, -0.02, 1e-4))
    own = [UnitEvidence("u", "V1", radii=radii), UnitEvidence("v", "V1")]
    assert [one.value for one in sizes_by_coasting(own, 2)] == [-0.02]
    assert [one.value for one in sizes_by_coasting(own, 0)] == [pytest.approx(-0.015)]
    assert sizes_by_coasting(own, 3) == []


def test_the_size_of_a_cause_is_its_first_parameter_that_is_no_axle():
    row = {"effect": "sanding", "form": "axles", "axle": None, "parameters": ["axle", "gain"],
           "values": [4.0, 0.2], "stds": [None, 0.01], "parameter_units": ["1", "1"]}  # fmt: skip
    assert cause_size(row) == CauseSize("sanding", "axles", 0, "gain", "1", 0.2, 0.01)


def with_own(fleet, seed, effect, value, std):
    """Units of a fleet, those of V03 with a cause of their own."""
    own = CauseSize(effect, "", 0, "size", "1", value, std)
    return [
        replace(one, causes=(effect,), cause_sizes=(own,)) if one.vehicle == "V03" else one
        for one in fleet.draw(seed)
    ]


def test_a_finding_has_the_size_that_its_recordings_name_and_json_lists_them():
    units = with_own(Fleet(by_vehicle={3: {1: SIZE}}), 0, NAMES[1], 0.55, 0.01)
    result = diagnose_fleet(units)
    (finding,) = result.named[0].findings
    assert finding.pooled.value == pytest.approx(0.55)
    assert finding.pooled.std >= 0.01 / np.sqrt(2)
    document = json.loads(json.dumps(result.to_dict(), allow_nan=False))["vehicles"][0]
    listed = document["findings"][0]["pooled"]["sizes"]
    assert [one["unit_id"] for one in listed] == ["u3-0", "u3-1"]
    assert {one["source"] for one in listed} == {"diagnosis"}
    assert document["cause_sizes"][0]["value"] == pytest.approx(0.55)


@pytest.mark.costly
def test_of_effects_that_gain_alike_the_one_that_the_recordings_name_leads():
    """Two effects of the same size in a vehicle: to first order either may lead."""
    fleet, led = Fleet(by_vehicle={3: {1: SIZE, 4: SIZE}}), 0
    for seed in range(25):
        plain = {one.vehicle: one.findings[0] for one in diagnose_fleet(fleet.draw(seed)).named}
        first = plain.get("V03")
        for rival in first.rivals[:1] if first else ():
            result = diagnose_fleet(with_own(fleet, seed, rival, 0.5, 0.01))
            found = next(one.findings[0] for one in result.named if one.vehicle == "V03")
            assert found.effect == rival
            assert first.effect in found.rivals
            assert found.named_by == 2
            led += 1
    assert led >= 2
