"""What a named effect may stand for, in whole drives that are worlds of others."""

import pytest

from adhesion_can.diagnosis.formatting import rival_title
from tests.diagnosis.diagnosis_helpers import diagnosed
from tests.worlds.outside.world import make_outside


def test_a_rival_of_several_forms_has_a_title_of_all_of_them():
    assert "one axle" not in rival_title("effort_gain")


@pytest.mark.slow
@pytest.mark.parametrize("seed", [23000, 24001, 26000])
def test_wheels_that_grow_warm_are_no_error_of_the_speed(seed, tmp_path):
    path = tmp_path / "drive.log"
    make_outside("outside:tread_growth", seed, path)
    answer = diagnosed(tmp_path, path)
    assert answer.verdict == "unexplained", answer.out
    (error,) = (c for c in answer.document["closest"] if c["effect"] == "speed_error")
    assert "all wheel radii growing as the wheels warm up" in error["refuted_by"]


@pytest.mark.costly
def test_what_chance_explains_once_in_twenty_drives_has_no_name(tmp_path):
    path = tmp_path / "drive.log"
    make_outside("outside:shower", 26001, path)
    answer = diagnosed(tmp_path, path)
    assert answer.document["causes"] == [], answer.out
    (closest,) = answer.document["closest"]
    assert closest["effect"] == "speed_dependence"
    assert "its p-value is 4" in closest["refuted_by"]


@pytest.mark.slow
def test_a_motor_that_saturates_is_a_rival_of_the_load(tmp_path):
    path = tmp_path / "drive.log"
    make_outside("outside:motor_saturation", 25000, path)
    answer = diagnosed(tmp_path, path)
    (cause,) = answer.document["causes"]
    assert {cause["effect"], *cause["rivals"]} == {"load_dependence", "effort_gain"}
    assert "cannot distinguish it from effort_gain" in answer.out
