"""Sizes that no vehicle has are no verdict."""

import numpy as np
import pytest

from adhesion_can import diagnose, simulate
from adhesion_can.physics.effects import effect_by_id
from adhesion_can.physics.parameter import Wheelset

LOCOMOTIVE = Wheelset(load=245e3, radius=0.625, inertia=200.0)


def verdict(tmp_path, inertia_error):
    drive = simulate("sweep", 120.0, seed=5, effects={"wheelset_inertia": inertia_error})
    return diagnose(drive.write(tmp_path / "drive.log"))


@pytest.mark.slow
def test_an_inertia_beyond_any_vehicles_is_told_and_not_named(tmp_path):
    found = verdict(tmp_path, 4600.0)
    assert found.verdict.value == "unexplained"
    assert not found.causes
    (closest,) = (one for one in found.closest if one.effect == "wheelset_inertia")
    assert "no such vehicle has more than 370" in closest.refuted_by
    # What the data ask for is reported as it is, beyond the range.
    assert closest.parameters[0].value == pytest.approx(4600.0, rel=0.05)
    assert closest.gain_percent > 10.0


@pytest.mark.slow
def test_an_inertia_that_a_locomotive_may_have_is_named(tmp_path):
    (cause,) = verdict(tmp_path, 2000.0).causes
    assert cause.effect == "wheelset_inertia"


def asymmetric(path, seed, braking):
    """A table of sweeps whose adhesion in braking has a factor."""
    rng = np.random.default_rng(seed)
    time_s = np.arange(8000) * 0.05
    slip = 0.1 * np.sin(2 * np.pi * time_s / 20) * np.abs(np.sin(2 * np.pi * time_s / 173))
    adhesion = np.sign(slip) * (0.35 * (1 - np.exp(-40 * np.abs(slip))) - 0.4 * np.abs(slip))
    adhesion = np.where(slip < 0, braking, 1.0) * adhesion + 0.004 * rng.standard_normal(8000)
    columns = np.column_stack([time_s, slip, adhesion, 12 + 4 * np.sin(time_s / 41)])
    head = "time_s,slip,adhesion,speed_mps"
    np.savetxt(path, columns, delimiter=",", header=head, comments="", fmt="%.6g")
    return path


@pytest.mark.costly
@pytest.mark.parametrize(("seed", "braking"), [(1, 2.2), (2, 3.0)])
def test_an_asymmetry_beyond_its_range_is_told_and_neither_it_nor_its_like_is_named(
    tmp_path, seed, braking
):
    found = diagnose(asymmetric(tmp_path / "table.csv", seed, braking))
    assert not found.causes
    assert not found.conclusive or found.verdict.value == "unexplained"
    (closest,) = (one for one in found.closest if one.effect == "traction_braking_asymmetry")
    assert "but no such vehicle has" in closest.refuted_by
    assert closest.parameters[0].value == pytest.approx(braking - 1.0, abs=0.05)


@pytest.mark.costly
def test_a_brake_that_takes_most_of_the_force_is_no_asymmetry_beyond_its_range(tmp_path):
    """No rail has 30 % of the adhesion in braking; a blended brake may take 70 % of the force."""
    (cause,) = diagnose(asymmetric(tmp_path / "table.csv", 3, 0.3)).causes
    assert cause.effect == "brake_blending"
    assert cause.parameters[0].value == pytest.approx(0.7, abs=0.02)


@pytest.mark.parametrize(
    ("effect", "inside", "outside"),
    [
        ("wheelset_inertia", (-150.0, 1500.0), (-250.0, 4000.0)),
        ("creep_relaxation", (0.02, 1.5), (3.5, 10.0)),
        ("effort_bias", (-20e3, 9e3), (-70e3, 70e3)),
    ],
)
def test_ranges_of_a_locomotive(effect, inside, outside):
    low, high = effect_by_id(effect).parameters[0].plausible(LOCOMOTIVE)
    assert all(low <= value <= high for value in inside)
    assert not any(low <= value <= high for value in outside)
