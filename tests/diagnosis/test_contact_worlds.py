"""Contacts that are not Burckhardt's, and the peak that is truly there."""

from dataclasses import replace

import numpy as np
import pytest

from tests.worlds import CONTACT_EFFECTS, CONTACTS, KINDS, POINTS, make_world
from tests.worlds.contact_laws import (
    FILE_LOAD,
    MODELS,
    NAMES,
    POLACH,
    draw_parameters,
    file_curve,
    make_law,
    nearest_burckhardt,
)
from tests.worlds.hidden import Hidden
from tests.worlds.rail import curve, peak
from tests.worlds.true_contact import GRID, find_peaks
from tests.worlds.world import World

AS_FILED = {"level": 1.0, "stiffness": 1.0}


@pytest.mark.parametrize("name", MODELS)
def test_a_curve_of_the_file_is_met_at_its_speed_and_load(name):
    slip, adhesion = file_curve(MODELS[name])
    law = make_law(name, AS_FILED)
    assert len(slip) == 30
    found = law.adhesion(slip, np.array(10.0), np.array(FILE_LOAD))
    assert np.allclose(found, adhesion, atol=1e-12)
    assert law.falls == (name in ("extended", "fastsim"))
    if law.falls:
        mu_max, lambda_m = law.peak(10.0, FILE_LOAD)
        wanted = {"extended": (0.3117, 0.016), "fastsim": (0.3042, 0.022)}[name]
        assert mu_max == pytest.approx(wanted[0], abs=2e-4)
        assert lambda_m == pytest.approx(wanted[1], abs=5e-4)


@pytest.mark.parametrize("name", NAMES)
def test_friction_falls_with_speed_and_the_slope_with_load(name):
    parameters = AS_FILED if name in MODELS else POLACH[name] | {"stiffness": 1.0}
    law = make_law(name, parameters)
    slip = np.geomspace(1e-4, 0.6, 200)
    slow, fast = (law.adhesion(slip, np.array(v), np.array(FILE_LOAD)) for v in (5.0, 20.0))
    assert np.all(fast <= slow + 1e-12)
    assert np.all(slow >= 0)
    assert np.all(np.abs(np.diff(slow)) < 0.05)  # no step, also beyond the end of the file
    small = np.array(1e-6)
    light, heavy = (law.adhesion(small, np.array(10.0), np.array(q)) for q in (1e5, 8e5))
    # Kalker's slope over the load goes with the contact area over the load, Q^(-1/3).
    assert light / heavy == pytest.approx(2.0, rel=0.01)
    if law.falls:
        assert law.peak(20.0, FILE_LOAD)[1] < law.peak(5.0, FILE_LOAD)[1]


def test_polach_is_his_formula():
    law = make_law("polach-wet", POLACH["polach-wet"] | {"stiffness": 1.0})
    slip, speed = 0.03, 12.0
    mu = 0.30 * (0.6 * np.exp(-0.2 * slip * speed) + 0.4)
    gradient = np.pi / 4 * 231.0 * slip / mu
    wanted = 2 * mu / np.pi
    wanted *= 0.3 * gradient / (1 + (0.3 * gradient) ** 2) + np.arctan(0.1 * gradient)
    found = law.adhesion(np.array(slip), np.array(speed), np.array(FILE_LOAD))
    assert found == pytest.approx(wanted)


def test_drawn_laws_stay_near_the_literature_and_have_a_burckhardt_curve_near_them():
    rng = np.random.default_rng(3)
    for name in NAMES:
        for _ in range(5):
            parameters = draw_parameters(rng, name)
            law = make_law(name, parameters)
            c = nearest_burckhardt(law, 12.0, FILE_LOAD)
            slip = np.linspace(0.001, 0.25, 300)
            misfit = curve(c, slip) - law.adhesion(slip, np.array(12.0), np.array(FILE_LOAD))
            assert np.sqrt(np.mean(misfit**2)) < 0.03
            assert parameters.get("kS", 0) <= parameters.get("kA", 1) <= 1


def test_kinds_of_contacts():
    assert len(CONTACTS) == len(POINTS) == len(NAMES) == 6
    assert len(CONTACT_EFFECTS) == 6 * 17
    assert {*CONTACTS, *CONTACT_EFFECTS, *POINTS} <= set(KINDS)


@pytest.mark.parametrize("kind", ["contact:extended", "contact:polach-dry+humidity"])
def test_a_contact_hides_its_shape_and_an_effect_besides(kind, tmp_path):
    truth = make_world(kind, 4, tmp_path / "a.log", duration_s=60.0)
    effect = kind.partition("+")[2]
    assert truth.names == (("curve_shape", effect) if effect else ("curve_shape",))
    assert truth.effects[0].form == kind.partition(":")[2].partition("+")[0]
    assert len(truth.excess) == len(truth.names)
    # The true model explains what c1..c3 cannot; its noise is that of the effort alone.
    before, after = truth.judge.errors(np.ones(len(truth.judge.t), dtype=bool))
    assert after < 0.8 * before
    assert after == pytest.approx(0.01, rel=0.2)
    assert truth.to_dict()["peak"]["mu_max"] == pytest.approx(truth.peak.mu_max)
    assert "true_contact" not in truth.to_dict()


@pytest.mark.parametrize("name", NAMES)
def test_the_train_moves_by_the_force_of_its_law(name):
    """Newton: force over mass less gradient and resistance, with loads that change by a few %."""
    world = World(f"contact:{name}", 3, 0, 60.0)
    law = make_law(name, world.shape[0].parameters)
    p, vehicle = world.profile, world.vehicle
    mu = np.sign(p.slip) * law.adhesion(np.abs(p.slip), p.v[:, None], vehicle.static_load)
    force = (mu * vehicle.static_load).sum(axis=1)
    pull = force / vehicle.mass - 0.015 - 9.81 * p.gradient
    assert np.ptp(force / vehicle.mass) > 0.3
    assert np.diff(p.v) / 0.01 == pytest.approx(pull[1:], abs=0.01)


def test_points_are_those_of_the_law(tmp_path):
    truth = make_world("points:extended", 2, tmp_path / "a.csv")
    slip, adhesion, speed, load = np.loadtxt(tmp_path / "a.csv", delimiter=",", skiprows=1).T
    law = make_law("extended", truth.effects[0].parameters)
    left = adhesion - law.adhesion(slip, speed, load)
    assert np.sqrt(np.mean(left**2)) == pytest.approx(truth.noise_floor, rel=1e-3)
    assert len(slip) in (60, 140, 400)
    again = make_world("points:extended", 2, tmp_path / "b.csv")
    assert again.effects == truth.effects
    assert (tmp_path / "a.csv").read_bytes() == (tmp_path / "b.csv").read_bytes()


# --- the peak in time ----------------------------------------------------------------------------


def _true_contact(kind, *effects):
    world = World(kind, 3, 0, 60.0)
    from tests.worlds.true_contact import TrueContact

    hidden = (*world.shape, *effects)
    return world, TrueContact(world.profile, world.vehicle, world.rail, hidden)


def test_without_effects_the_peak_is_that_of_the_rail_all_the_time():
    world, there = _true_contact("null:0")
    found = there.at(np.arange(5.0, 55.0, 2.5))
    mu_max, lambda_m = peak(world.rail.curves[0])
    assert np.allclose(found.mu_max, mu_max, rtol=1e-5)
    assert np.allclose(found.lambda_m, lambda_m, rtol=1e-3)
    assert found.interior.all()
    assert np.allclose(found.reached(found.lambda_m), 1.0, atol=2e-4)
    far = curve(world.rail.curves[0], np.array(2 * lambda_m)) / mu_max
    assert np.allclose(found.reached(np.full(20, 2 * lambda_m)), far, atol=1e-3)


def test_the_peak_follows_what_it_depends_on():
    t = np.arange(5.0, 55.0, 2.5)
    world, plain = _true_contact("null:0")
    bare = plain.at(t)
    rows = np.searchsorted(world.profile.t, t - 1e-6)
    _, drifting = _true_contact("null:0", Hidden("slow_drift", "", {"rate": 0.01}))
    assert np.allclose(drifting.at(t).mu_max / bare.mu_max, 1 + 0.01 * t, rtol=1e-6)
    _, cleaned = _true_contact("null:0", Hidden("rail_cleaning", "", {"gain": 0.1}))
    assert np.allclose(cleaned.at(t).mu_max / bare.mu_max, 1.25, rtol=1e-6)  # mean of six axles
    _, biased = _true_contact("null:0", Hidden("effort_bias", "", {"bias": 9e3}))
    assert np.allclose(biased.at(t).mu_max, bare.mu_max)
    _, both = _true_contact("null:0", Hidden("traction_braking_asymmetry", "", {"gain": 0.2}))
    braking = world.profile.slip[rows].mean(axis=1) < -1e-3
    pulling = world.profile.slip[rows].mean(axis=1) > 1e-3
    assert braking.any()
    assert pulling.any()
    assert np.allclose((both.at(t).mu_max / bare.mu_max)[braking], 1.2, rtol=1e-6)
    assert np.allclose((both.at(t).mu_max / bare.mu_max)[pulling], 1.0, rtol=1e-6)
    _, curved = _true_contact("null:0", Hidden("curve_creep", "", {"lever": 20.0}))
    lateral = 20 * np.abs(world.profile.curvature[rows])
    bent = curved.at(t)
    # At λ_c = λ_m the share along the rail is λ/λ_c, so the peak lies beyond it.
    assert np.all(bent.lambda_m[lateral > 0.01] > bare.lambda_m[lateral > 0.01])
    assert np.allclose(bent.mu_max[lateral < 1e-6], bare.mu_max[lateral < 1e-6])


def test_what_was_cleaned_stays_as_it_is_for_the_peak():
    recovery = Hidden("adhesion_recovery", "", {"gain": 2e-7, "time": 5.0})
    world, there = _true_contact("null:0", recovery)
    found = there.at(np.arange(5.0, 55.0, 2.5))
    assert np.all(found.mu_max >= peak(world.rail.curves[0])[0] * (1 - 1e-5))
    assert np.ptp(found.mu_max) > 1e-4
    assert np.allclose(found.lambda_m, peak(world.rail.curves[0])[1], rtol=1e-3)


def test_a_law_peaks_where_its_speed_says():
    world, there = _true_contact("contact:polach-dry")
    t = np.arange(5.0, 55.0, 2.5)
    found = there.at(t)
    law = make_law("polach-dry", world.shape[0].parameters)
    rows = np.searchsorted(world.profile.t, t - 1e-6)
    for k, row in enumerate(rows):
        mu_max, lambda_m = law.peak(world.profile.v[row], world.profile.load[row].mean())
        assert found.mu_max[k] == pytest.approx(mu_max, rel=2e-3)
        assert found.lambda_m[k] == pytest.approx(lambda_m, rel=0.02)
    assert np.ptp(found.lambda_m) > 0.002


def test_a_plateau_is_no_peak():
    law = make_law("coulomb", AS_FILED)
    curves = law.adhesion(GRID, np.array(10.0), np.array(FILE_LOAD))[None]
    *_, interior = find_peaks(curves)
    assert not interior[0]
    # A parabola in ln slip is found exactly.
    x = np.log(GRID)
    height, at, interior = find_peaks((0.3 - 0.1 * (x - np.log(0.0321)) ** 2)[None])
    assert height[0] == pytest.approx(0.3, abs=1e-9)
    assert at[0] == pytest.approx(0.0321, rel=1e-6)
    assert interior[0]


def test_a_change_of_one_axle_moves_the_mean_curve():
    world, there = _true_contact("contact:extended")
    t = np.array([10.0, 20.0])
    light = replace(there, profile=replace(world.profile, load=0.8 * world.profile.load))
    # Hertz: a lighter wheel has the steeper curve.
    assert np.all(light.at(t).lambda_m < there.at(t).lambda_m)
