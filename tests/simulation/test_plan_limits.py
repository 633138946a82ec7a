"""Limits of a planned drive come from `[limits]`, the loads and the ranges of the signals."""

from dataclasses import replace

import pytest

from adhesion_can.config import load_configuration
from adhesion_can.errors import InputError
from adhesion_can.physics.driving_plan import PlanLimits
from adhesion_can.simulation.plan_limits import DEFAULT, OF_LONGEST, SECTION, limits_of
from tests.simulation.test_own_vehicle import own


def limits(path):
    config = load_configuration(path)
    return limits_of(config.vehicle, config.limits, config.messages)


def test_the_default_locomotive_keeps_the_defaults():
    found = limits(None)
    assert found.limits == PlanLimits()
    assert set(found.sources.values()) == {DEFAULT}


def test_a_light_vehicle_gets_efforts_and_speeds_that_it_has(tmp_path):
    found = limits(own(tmp_path))
    assert found.limits.effort_max == pytest.approx(0.49 * 92e3, rel=0.01)
    assert found.sources["effort_max"] == "0.49 of the mean axle load"
    assert 20.0 < found.limits.speed_max < 80 / 3.6
    assert found.sources["speed_max"] == "the range of vehicle_speed (0 to 80 in the database)"
    assert found.sources["slip_max"] == DEFAULT


def test_what_the_user_wrote_holds_where_it_is_narrower(tmp_path):
    more = "[limits]\neffort_max = 30e3\nspeed_max = 15.0\nsand = false\n"
    found = limits(own(tmp_path, more=more))
    assert (found.limits.effort_max, found.limits.speed_max) == (30e3, 15.0)
    assert [found.sources[k] for k in ("effort_max", "speed_max", "sand")] == [SECTION] * 3


def test_signals_limit_effort_and_braking(tmp_path):
    weak = limits(own(tmp_path, kN="[-20|40]"))
    assert 15e3 < weak.limits.effort_max < 20e3
    assert weak.sources["effort_max"].startswith("the range of tractive_effort.1 (-20 to 40")
    assert weak.limits.braking
    unsigned = limits(own(tmp_path, kN="[0|60]"))
    assert not unsigned.limits.braking
    assert unsigned.sources["braking"].startswith("the range of tractive_effort.1 (0 to 60")


def test_a_signal_without_room_is_an_error_that_names_it(tmp_path):
    with pytest.raises(InputError, match=r"v has no room for speeds above 10\.8 km/h"):
        limits(own(tmp_path, kmh="[0|9]"))
    with pytest.raises(InputError, match=r"Force1 has no room for traction"):
        limits(own(tmp_path, kN="[-60|0]"))


def test_a_plan_that_is_shorter_says_why():
    found = limits(None)
    assert found.sources_of(found.limits)["duration_max"] == DEFAULT
    shorter = replace(found.limits, duration_max=20.0)
    assert found.sources_of(shorter)["duration_max"] == OF_LONGEST
