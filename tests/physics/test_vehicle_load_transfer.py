"""Transfer of axle load: moment balances written anew from the free body of the locomotive."""

from dataclasses import FrozenInstanceError

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from adhesion_can.physics.vehicle import Geometry, Locomotive

FIXED = settings(derandomize=True, deadline=None, max_examples=60)
EFFORTS = hnp.arrays(np.float64, 6, elements=st.floats(-2e5, 2e5))
GEOMETRIES = st.builds(
    Geometry,
    pivot_distance=st.floats(6.0, 14.0),
    axle_spacing=st.floats(1.2, 2.5),
    coupler_height=st.floats(0.5, 1.2),
    traction_height=st.floats(0.1, 1.0),
)


def places(geometry: Geometry) -> np.ndarray:
    """Place of each axle ahead of the locomotive's middle, m."""
    bogies = len(geometry.axles_per_bogie)
    ahead = []
    for number, axles in enumerate(geometry.axles_per_bogie):
        pivot = ((bogies - 1) / 2 - number) * geometry.pivot_distance
        ahead += [pivot + geometry.axle_spacing * ((axles - 1) / 2 - j) for j in range(axles)]
    return np.array(ahead)


@FIXED
@given(EFFORTS, GEOMETRIES)
def test_transfer_sums_to_zero(effort, geometry):
    assert geometry.load_transfer(effort).sum() == pytest.approx(0.0, abs=1e-6)


@FIXED
@given(EFFORTS, GEOMETRIES)
def test_moments_about_the_rail_balance(effort, geometry):
    # Free body of the locomotive: the rail pushes it forward at height 0, the train pulls it back
    # at the coupler. The couple turns its nose up, the axle loads turn it back.
    change = geometry.load_transfer(effort)
    couple = effort.sum() * geometry.coupler_height
    assert change @ places(geometry) == pytest.approx(-couple, rel=1e-9, abs=1e-3)


@FIXED
@given(EFFORTS, GEOMETRIES)
def test_moments_of_each_bogie_about_its_pivot_balance(effort, geometry):
    # Free body of a bogie: pushed forward at the rail, pulled back by the link.
    change, x = geometry.load_transfer(effort), places(geometry)
    for part in (slice(0, 3), slice(3, 6)):
        arm = x[part] - x[part].mean()
        couple = effort[part].sum() * geometry.traction_height
        assert change[part] @ arm == pytest.approx(-couple, rel=1e-9, abs=1e-3)


def test_traction_unloads_the_front_axle_most_and_braking_the_rear():
    change = Geometry().load_transfer(np.full(6, 8e4))
    assert change[0] == change.min() < 0 < change[5] == change.max()
    assert (np.diff(change[:3]) > 0).all()
    assert (np.diff(change[3:]) > 0).all()
    assert np.allclose(Geometry().load_transfer(np.full(6, -8e4)), -change)
    assert np.allclose(change[::-1], -change)  # even effort on a symmetric locomotive


@FIXED
@given(EFFORTS, EFFORTS, st.floats(-2.0, 2.0), GEOMETRIES)
def test_transfer_is_linear_in_effort(a, b, factor, geometry):
    whole = geometry.load_transfer(a + factor * b)
    parts = geometry.load_transfer(a) + factor * geometry.load_transfer(b)
    assert np.allclose(whole, parts, rtol=1e-9, atol=1e-5)


def test_travel_the_other_way_mirrors_the_locomotive():
    # Reverse: turn the vehicle round and let it pull the other way; the same axle gets the same.
    effort = np.array([1.0, 2.0, 3.0, 5.0, 7.0, 11.0]) * 1e4
    geometry = Geometry()
    assert np.allclose(geometry.load_transfer(-effort[::-1])[::-1], geometry.load_transfer(effort))


def test_transfer_takes_a_time_axis():
    rng = np.random.default_rng(1)
    effort = rng.uniform(-1e5, 1e5, (4, 7, 6))
    whole = Geometry().load_transfer(effort)
    assert whole.shape == effort.shape
    assert np.allclose(whole[2, 3], Geometry().load_transfer(effort[2, 3]))


@pytest.mark.parametrize("bogies", [(2, 2), (3, 3), (2, 3), (2, 2, 2)])
def test_moments_balance_for_every_wheel_arrangement(bogies):
    geometry = Geometry(axles_per_bogie=bogies)
    effort = np.linspace(3e4, 8e4, sum(bogies))
    change = geometry.load_transfer(effort)
    assert change.sum() == pytest.approx(0.0, abs=1e-6)
    couple = effort.sum() * geometry.coupler_height
    assert change @ places(geometry) == pytest.approx(-couple, rel=1e-9)


@pytest.mark.parametrize("bogies", [(4,), (1, 1), (1, 3)])
def test_arrangement_whose_moments_cannot_balance_is_refused_or_balanced(bogies):
    # A single frame has to take the coupler's couple with its own axles; a bogie of one axle
    # cannot tilt, so its couple goes into the body.
    try:
        geometry = Geometry(axles_per_bogie=bogies)
        effort = np.full(sum(bogies), 5e4)
        change = geometry.load_transfer(effort)
    except ValueError:
        return
    couple = effort.sum() * geometry.coupler_height
    assert change @ places(geometry) == pytest.approx(-couple, rel=1e-9)


def test_loads_are_static_plus_transfer_and_keep_the_weight():
    vehicle = Locomotive(axle_load=(240e3, 241e3, 242e3, 243e3, 244e3, 245e3))
    effort = np.full((3, 6), 6e4)
    loads = vehicle.loads(effort)
    assert loads.shape == (3, 6)
    assert np.allclose(loads.sum(axis=-1), sum(vehicle.axle_load))
    assert np.allclose(loads - np.array(vehicle.axle_load), Geometry().load_transfer(effort))


@pytest.mark.parametrize(
    ("axles", "bogies"),
    [(2, (2,)), (4, (2, 2)), (5, (5,)), (6, (3, 3)), (8, (2, 2, 2, 2)), (12, (3, 3, 3, 3))],
)
def test_a_vehicle_without_geometry_shares_loads_as_a_usual_one_with_its_axles(axles, bogies):
    vehicle = Locomotive((0.625,) * axles, (245e3,) * axles, geometry=None)
    by_force = Geometry(axles_per_bogie=bogies).load_transfer(np.eye(axles)).T
    assert vehicle.transfer_shares() == pytest.approx(by_force)


def test_a_vehicle_does_not_change():
    with pytest.raises(FrozenInstanceError):
        Locomotive().train_mass = 1.0


def test_loads_without_geometry_are_static_and_free_to_change():
    vehicle = Locomotive(geometry=None)
    loads = vehicle.loads(np.full((2, 6), 6e4))
    assert loads.shape == (2, 6)
    loads[0, 0] = 1.0  # a copy: the vehicle does not feel it
    assert vehicle.loads(np.zeros(6))[0] == 245e3


@pytest.mark.parametrize(
    "wrong",
    [
        {"wheel_radius": (0.625,) * 5},
        {"wheel_radius": (), "axle_load": ()},
        {"wheel_radius": (0.625,) * 5 + (0.0,)},
        {"wheel_radius": (0.625,) * 5 + (-0.6,)},
        {"wheel_radius": (0.625,) * 5 + (float("nan"),)},
        {"axle_load": (245e3,) * 5 + (0.0,)},
        {"axle_load": (245e3,) * 5 + (float("inf"),)},
        {"train_mass": 0.0},
        {"train_mass": float("nan")},
        {"wheelset_inertia": -1.0},
        {"wheelset_inertia": float("nan")},
        {"geometry": Geometry(axles_per_bogie=(2, 2))},
        {"load_std": -0.02},
        {"load_std": float("nan")},
    ],
    ids=str,
)
def test_impossible_vehicle_is_refused(wrong):
    with pytest.raises(ValueError):
        Locomotive(**wrong)


@pytest.mark.parametrize(
    "wrong",
    [
        {"pivot_distance": 0.0},
        {"pivot_distance": float("nan")},
        {"axle_spacing": 0.0},
        {"axles_per_bogie": (0, 6)},
        {"axles_per_bogie": (-1, 7)},
        {"coupler_height": float("inf")},
    ],
    ids=str,
)
def test_impossible_geometry_is_refused(wrong):
    # Given by a user's TOML; what is not refused here is an infinite or NaN load on the road.
    with pytest.raises(ValueError):
        Locomotive(geometry=Geometry(**wrong))


def test_inertia_of_zero_is_allowed():
    assert Locomotive(wheelset_inertia=0.0).wheelset_inertia == 0.0
