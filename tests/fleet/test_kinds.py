"""Kinds of vehicles: what follows from the data, and what is no reason to part vehicles."""

from dataclasses import replace

import numpy as np
import pytest

from adhesion_can.config import load_configuration
from adhesion_can.diagnosis.effect_grams import EffectGrams
from adhesion_can.fleet.analysis import analyse
from adhesion_can.fleet.evidence import UnitEvidence, VehicleForm
from adhesion_can.fleet.findings import Scope
from adhesion_can.fleet.kinds import find_kinds
from adhesion_can.fleet.pooled_diagnosis import diagnose_fleet
from adhesion_can.fleet.work import hash_vehicle_data
from adhesion_can.input_files import file_sha256
from tests.fleet.synthetic_units import NAMES, SIZE, Fleet

LOCOMOTIVE, BUS = VehicleForm("recordings", 6, "a"), VehicleForm("TABLEs", 1, "b")


def renamed(units, prefix):
    return [
        replace(one, unit=f"{prefix}{one.unit}", vehicle=f"{prefix}{one.vehicle}") for one in units
    ]


def with_effects(one, places):
    """Evidence of a unit that can tell some effects alone."""
    g, at = one.grams, np.array(places)
    left = EffectGrams(
        tuple(g.keys[i] for i in places), g.gram[np.ix_(at, at)], g.score[at],
        g.score_variance[at], g.absorbed[at], g.square, g.rows, g.blocks, g.rmse,
    )  # fmt: skip
    return replace(one, grams=left)


def test_each_kind_has_what_its_own_vehicles_share():
    for seed in range(4):
        units = [
            *Fleet(12, form=LOCOMOTIVE, everywhere={2: SIZE}).draw(seed),
            *renamed(Fleet(12, form=BUS, everywhere={4: -SIZE}).draw(seed + 50), "B"),
        ]
        result = diagnose_fleet(units)
        everywhere = {(f.where, f.effect) for f in result.shared if f.scope is Scope.FLEET}
        assert everywhere == {
            ("recordings of 6 axles", NAMES[2]), ("TABLEs of 1 axle", NAMES[4])}  # fmt: skip
        assert len(result.named) <= 1


@pytest.mark.costly
def test_an_odd_vehicle_is_found_among_its_kind_beside_another_one():
    """Six times as many vehicles of another kind, all with that effect, do not hide it."""
    right = 0
    for seed in range(10):
        own = Fleet(12, form=BUS, by_vehicle={3: {1: SIZE}}).draw(seed)
        others = Fleet(72, 1, form=LOCOMOTIVE, everywhere={1: SIZE}).draw(seed + 50)
        result = diagnose_fleet([*renamed(own, "B"), *others])
        right += [(one.vehicle, one.findings[0].effect) for one in result.named] == [
            ("BV03", NAMES[1])
        ]
    assert right >= 8


def test_a_broken_sensor_is_no_other_kind_and_another_set_of_columns_is():
    units = Fleet(14, form=LOCOMOTIVE).draw(1)
    own = units[0].vehicle
    units = [with_effects(u, (1, 2, 3, 4, 5)) if u.vehicle == own else u for u in units]
    few = [with_effects(u, (0, 1)) for u in Fleet(6, form=LOCOMOTIVE).draw(2)]
    kinds = find_kinds([*units, *renamed(few, "F")])
    assert [(k.vehicles, len(k.units)) for k in kinds] == [(14, 28), (6, 12)]
    assert [k.name for k in kinds] == [
        "recordings of 6 axles, such as V00", "recordings of 6 axles, such as FV00"]  # fmt: skip


def test_kinds_do_not_depend_on_the_order_of_units():
    units = [with_effects(u, range(1 + n % 6)) for n, u in enumerate(Fleet(20, form=BUS).draw(3))]
    rng, seen = np.random.default_rng(1), set()
    for _ in range(5):
        kinds = find_kinds([units[i] for i in rng.permutation(len(units))])
        seen.add(tuple(frozenset(u.unit for u in k.units) for k in kinds))
    assert len(seen) == 1


def test_a_vehicle_with_radii_alone_is_compared_by_them():
    units = Fleet(12, form=LOCOMOTIVE, worn={4: -0.01}).draw(2)
    units = [replace(u, grams=None) if u.vehicle == "V04" else u for u in units]
    result = diagnose_fleet(units)
    assert len(result.kinds) == 1
    assert [one.vehicle for one in result.named] == ["V04"]


def test_a_unit_that_could_not_be_read_is_of_no_kind():
    failed = UnitEvidence("u", "V99", error="torn.log: no frame")
    kinds = find_kinds([*Fleet(6, form=LOCOMOTIVE).draw(1), failed])
    assert [(k.name, k.vehicles) for k in kinds] == [("", 6)]


def test_vehicles_with_radii_of_their_own_are_of_one_kind_and_other_vehicles_are_not():
    config = load_configuration(None, None)

    def data(**changes):
        own = replace(config, vehicle=replace(config.vehicle, **changes), where="x", sha256="y")
        return hash_vehicle_data(own, table=False)

    plain = data()
    assert data(wheel_radius=(0.61, 0.62, 0.6, 0.625, 0.6, 0.61)) == plain
    assert data(axle_load=(200e3,) * 6) != plain
    assert data(wheel_radius=(0.61,) * 4, axle_load=(245e3,) * 4, geometry=None) != plain
    other = replace(config, vehicle=replace(config.vehicle, axle_load=(1e5,) * 6))
    assert hash_vehicle_data(config, table=True) == hash_vehicle_data(other, table=True)


@pytest.mark.parametrize("axles", [None, 3])
def test_axles_are_counted_in_the_data(tmp_path, drives, axles):
    config = load_configuration(None, None)
    log = drives / "tram" / "drive3.log"
    assert analyse(log, "x", file_sha256(log), config, ("check",)).fields["axles"] == 6
    head, path = "time_s,slip,adhesion", tmp_path / "a.csv"
    rows = [f"{n},{0.001 * n},{0.01 * n}" for n in range(30)]
    if axles:
        head, rows = f"{head},axle", [f"{row},{1 + n % axles}" for n, row in enumerate(rows)]
    path.write_text("\n".join([head, *rows]))
    found = analyse(path, "x", file_sha256(path), config, ("check",)).fields
    assert found["axles"] == (axles or 1)


def test_kinds_of_the_same_vehicles_have_names_of_their_own():
    """Units before and after a change of the configured vehicle, in one data set."""
    before = Fleet(6, form=LOCOMOTIVE).draw(1)
    after = [
        replace(one, unit=f"n{one.unit}")
        for one in Fleet(6, form=LOCOMOTIVE._replace(vehicle_data="b")).draw(2)
    ]
    result = diagnose_fleet([*before, *after])
    assert [one.name for one in result.kinds] == [
        "recordings of 6 axles, such as V00",
        "recordings of 6 axles, such as V00 (2)",
    ]
    assert len(result.spreads) == 2 * len(NAMES)


def test_what_one_kind_shares_does_not_hide_what_recordings_of_another_name():
    locomotives = Fleet(12, form=LOCOMOTIVE, everywhere={2: SIZE}).draw(1)
    buses = renamed(Fleet(2, form=BUS).draw(2), "B")
    units = [replace(one, causes=(NAMES[2],)) for one in [*locomotives, *buses]]
    result = diagnose_fleet(units)
    assert [f.effect for f in result.shared] == [NAMES[2]]
    assert {one.vehicle for one, _ in result.named_alone} == {"BV00", "BV01"}
