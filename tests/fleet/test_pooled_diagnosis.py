"""Fleets of synthetic evidence: rates of false findings, power, and what belongs to whom."""

import json
from collections import Counter
from dataclasses import replace

import numpy as np
import pytest

from adhesion_can.fleet.evidence import UnitEvidence, VehicleForm
from adhesion_can.fleet.findings import Scope
from adhesion_can.fleet.pooled_diagnosis import diagnose_fleet
from tests.fleet.synthetic_units import NAMES, SIZE, Fleet

FLEETS = 20


def found_in(fleet, seeds):
    """All findings of each fleet."""
    return [diagnose_fleet(fleet.draw(seed)) for seed in seeds]


@pytest.mark.costly
def test_a_fleet_with_nothing_gets_no_name():
    results = found_in(Fleet(), range(2 * FLEETS))
    # Findings of lines, days and the fleet at 1 % each, of any vehicle at 5 %: 8 % of the fleets;
    # nine of forty or more happen by chance once in 500 such runs.
    assert sum(bool(result.findings) for result in results) <= 8
    # The share of vehicles with a name is far below what the bench allows.
    assert sum(len(result.named) for result in results) <= 0.01 * 30 * len(results)


@pytest.mark.costly
def test_single_drives_with_nothing_get_no_name():
    results = found_in(Fleet(vehicles=40, drives=1), range(100, 100 + FLEETS))
    assert sum(bool(result.findings) for result in results) <= 5


@pytest.mark.costly
def test_an_effect_of_a_vehicle_is_named_on_it_alone():
    fleet = Fleet(by_vehicle={3: {1: SIZE}, 11: {4: -SIZE}}, worn={20: -0.01})
    right, wrong = 0, 0
    for result in found_in(fleet, range(FLEETS)):
        expected = {("V03", NAMES[1]), ("V11", NAMES[4]), ("V20", "wheel_radius")}
        named = {(f.where, f.effect) for f in result.findings if f.scope is Scope.VEHICLE}
        right += len(named & expected)
        wrong += len(named - expected) + len(result.shared)
        best = {summary.vehicle for summary in result.vehicles[: len(named)]}
        assert best == {where for where, _ in named}
    assert right >= 0.95 * 3 * FLEETS
    assert wrong <= 0.05 * 3 * FLEETS + 3


@pytest.mark.costly
def test_sizes_are_within_their_standard_errors():
    fleet = Fleet(by_vehicle={3: {1: SIZE}})
    own = [
        (finding.value - SIZE) / finding.std
        for result in found_in(fleet, range(FLEETS))
        for finding in result.findings
        if (finding.where, finding.effect) == ("V03", NAMES[1])
    ]
    assert np.sqrt(np.mean(np.square(own))) < 1.6


@pytest.mark.costly
@pytest.mark.parametrize(
    ("fleet", "scope", "where"),
    [
        (Fleet(everywhere={2: SIZE}), Scope.FLEET, ""),
        (Fleet(by_line={1: {2: SIZE}}), Scope.LINE, "line1"),
        (Fleet(by_day={4: {2: SIZE}}), Scope.DAY, "2026-01-05"),
    ],
    ids=("fleet", "line", "day"),
)
def test_a_shared_effect_is_no_vehicles(fleet, scope, where):
    counts = Counter()
    for result in found_in(fleet, range(FLEETS)):
        for finding in result.findings:
            right = (finding.scope, finding.where, finding.effect) == (scope, where, NAMES[2])
            counts["right" if right else "wrong"] += 1
    assert counts["right"] >= 0.9 * FLEETS
    assert counts["wrong"] <= 0.15 * FLEETS


def test_an_effect_on_all_vehicles_and_more_of_it_on_one():
    fleet = Fleet(everywhere={2: SIZE}, by_vehicle={7: {2: 2 * SIZE}})
    for result in found_in(fleet, range(5)):
        assert {(f.scope, f.where, f.effect) for f in result.findings} == {
            (Scope.FLEET, "", NAMES[2]),
            (Scope.VEHICLE, "V07", NAMES[2]),
        }


@pytest.mark.costly
def test_a_size_that_differs_from_drive_to_drive_is_no_vehicles():
    """One drive of a vehicle shows what its other drives do not."""
    named = 0
    for seed in range(FLEETS):
        units = Fleet(drives=4).draw(seed)
        odd = Fleet(drives=4, by_vehicle={5: {1: SIZE}}).draw(seed)
        units[20] = odd[20]  # the first drive of the sixth vehicle
        named += any(f.where == "V05" for f in diagnose_fleet(units).findings)
    assert named <= 0.1 * FLEETS


def test_a_speed_that_reads_high_is_not_six_worn_wheels():
    units = Fleet().draw(1)
    for place in (8, 9):
        radii = tuple(replace(one, value=one.value + 0.012) for one in units[place].radii)
        own = ("wheel_radius", "speed_scale") if place == 8 else ("wheel_radius",)
        units[place] = replace(units[place], radii=radii, causes=own)
    result = diagnose_fleet(units)
    (finding,) = result.named[0].findings
    assert (finding.effect, finding.axle, finding.rivals) == ("speed_scale", 0, ("wheel_radius",))
    assert finding.value == pytest.approx(0.012, abs=1e-3)
    assert finding.named_by == 1
    assert result.named_alone == ()  # the radius is what the finding cannot be told from


@pytest.mark.parametrize("vehicles", [0, 1, 2])
def test_too_few_vehicles_are_not_compared(vehicles):
    result = diagnose_fleet(Fleet(vehicles=vehicles, worn={0: -0.02}).draw(1))
    assert not result.named
    assert "Vehicles are compared with each other if there are at least 5" in result.notes[0]


@pytest.mark.costly
def test_vehicles_of_another_kind_are_not_compared_with_the_others():
    bus = VehicleForm("TABLEs", 1, "b")
    buses = Fleet(vehicles=2, drives=6, everywhere={1: 2 * SIZE}, form=bus).draw(8)
    buses = [replace(one, unit=f"b{one.unit}", vehicle=f"B{one.vehicle}") for one in buses]
    locomotives = Fleet(form=VehicleForm("recordings", 6, "a"))
    for seed in range(5):
        alone = diagnose_fleet(locomotives.draw(seed))
        result = diagnose_fleet([*locomotives.draw(seed), *buses])
        assert [f.effect for f in result.findings] == [f.effect for f in alone.findings]
        assert [(one.name, one.vehicles, one.compared) for one in result.kinds] == [
            ("recordings of 6 axles", 30, True),
            ("TABLEs of 1 axle", 2, False),
        ]
        assert any(note.startswith("TABLEs of 1 axle: Vehicles are") for note in result.notes)


def test_a_fleet_of_failed_units_has_vehicles_and_their_reasons():
    units = [UnitEvidence("u1", "V1", error="a: b"), UnitEvidence("u2", "V2", error="c: d")]
    result = diagnose_fleet(units)
    assert [one.reasons for one in result.vehicles] == [("a: b",), ("c: d",)]
    assert not result.findings


def test_the_json_is_json():
    fleet = Fleet(by_vehicle={3: {1: SIZE}}, by_line={1: {2: SIZE}}, worn={20: -0.01})
    document = diagnose_fleet(fleet.draw(1)).to_dict()
    again = json.loads(json.dumps(document, allow_nan=False))
    assert again == document
    assert again["vehicles"][0]["findings"][0]["scope"] == "vehicle"


def test_a_fleet_too_small_to_compare_still_tells_what_its_recordings_name():
    units = [
        replace(one, causes=("load_dependence",) if one.vehicle == "V02" else ())
        for one in Fleet(vehicles=3, drives=2).draw(1)
    ]
    result = diagnose_fleet(units)
    assert not result.findings
    worst = result.vehicles[0]
    assert (worst.vehicle, dict(worst.causes)) == ("V02", {"load_dependence": 2})
    assert result.named_alone == ((worst, "load_dependence"),)
    assert result.to_dict()["vehicles"][0]["causes"] == {"load_dependence": 2}


def test_what_a_comparison_confirms_is_not_told_twice():
    fleet = Fleet(by_vehicle={3: {1: SIZE}})
    units = [
        replace(one, causes=(NAMES[1],) if one.vehicle == "V03" else ()) for one in fleet.draw(0)
    ]
    result = diagnose_fleet(units)
    assert result.named[0].vehicle == "V03"
    assert result.named_alone == ()


def test_units_that_failed_at_a_step_do_not_hide_units_without_evidence():
    units = Fleet(vehicles=6).draw(3)
    units[0] = replace(units[0], grams=None)  # worked through, its radii alone are known
    units[1] = replace(units[1], error="no coasting")  # failed at a step, its effects are known
    notes = diagnose_fleet(units).notes
    assert any(note.startswith("No effects from 1 unit: ") for note in notes)
