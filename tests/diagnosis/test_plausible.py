"""Sizes that no vehicle has are no verdict."""

import pytest

from adhesion_can import diagnose, simulate
from adhesion_can.physics.effects import effect_by_id
from adhesion_can.physics.parameter import Wheelset

LOCOMOTIVE = Wheelset(load=245e3, radius=0.625, inertia=200.0)


def verdict(tmp_path, inertia_error):
    drive = simulate("sweep", 240.0, seed=5, effects={"wheelset_inertia": inertia_error})
    return diagnose(drive.write(tmp_path / "drive.log"))


def test_an_inertia_beyond_any_vehicles_is_told_and_not_named(tmp_path):
    found = verdict(tmp_path, 4600.0)
    assert found.verdict.value == "unexplained"
    assert not found.causes
    (why,) = (u.why for u in found.untested if u.what == "wheelset_inertia")
    assert "no such vehicle has less than -200 or more than 3.7e+03 kg·m²" in why


def test_an_inertia_that_a_locomotive_may_have_is_named(tmp_path):
    (cause,) = verdict(tmp_path, 2000.0).causes
    assert cause.effect == "wheelset_inertia"


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
