"""Data of the default vehicle that another vehicle was not given, and signals with two roles."""

from dataclasses import replace

import pytest

from adhesion_can.bus.block import Block
from adhesion_can.config import load_configuration
from adhesion_can.errors import ConfigError
from adhesion_can.offline.check import check
from adhesion_can.physics.vehicle import Locomotive

CONFIG = load_configuration()


def warnings_for(vehicle):
    return check([Block.from_frames([])], replace(CONFIG, vehicle=vehicle)).warnings


def test_what_was_not_given_of_another_vehicle_is_told():
    (warning,) = warnings_for(Locomotive(wheel_radius=(0.33,) * 6))
    assert warning.startswith("axle_load_N = 245000, wheelset_inertia_kgm2 = 200: ")
    assert "[vehicle]" in warning


def test_the_default_vehicle_and_one_that_is_given_are_no_matter():
    assert warnings_for(Locomotive()) == []
    given = Locomotive(wheel_radius=(0.33,) * 6, axle_load=(9e4,) * 6, wheelset_inertia=60.0)
    assert warnings_for(given) == []


def test_what_a_file_states_is_given_though_it_is_the_defaults(tmp_path):
    path = tmp_path / "own.toml"
    path.write_text("[vehicle]\nwheel_radius_m = 0.33\naxle_load_N = 245000.0\n")
    (warning,) = check([Block.from_frames([])], load_configuration(path)).warnings
    assert warning.startswith("wheelset_inertia_kgm2 = 200: ")


def test_a_mass_below_the_axle_loads_is_reported_with_the_line():
    given = Locomotive((0.33,) * 6, (9e4,) * 6, 60.0, train_mass=27e3)
    (warning,) = warnings_for(given)
    assert warning == (
        "train_mass_kg = 27000 in [vehicle] is less than the 55065 kg that axle_load_N puts on 6 "
        "axles; write train_mass_kg = 55100 or more, or axle_load_N of one axle rather than of a "
        "bogie"
    )


@pytest.mark.parametrize(
    ("change", "says"),
    [
        ({"wheel_radius": (3.3, *(0.33,) * 5)}, "wheel_radius_m in [vehicle]: 3.3 m is above any"),
        ({"axle_load": (92.0,) * 6}, "(1 to 500 kN); write 92e3 for 92 kN"),
        (
            {"wheelset_inertia": 92e3},
            "wheelset_inertia_kgm2 in [vehicle]: 92000 kg m^2 is above any",
        ),
        ({"train_mass": 60.0}, "(0.3 t to 200 000 t); write 60e3 for 60 t"),
    ],
)
def test_a_number_that_no_vehicle_has_is_reported_once(change, says):
    tram = Locomotive((0.33,) * 6, (9e4,) * 6, 60.0, train_mass=6e4)
    (warning,) = warnings_for(replace(tram, **change))
    assert says in warning


def test_an_inertia_of_0_is_one_that_is_neglected():
    assert warnings_for(Locomotive((0.33,) * 6, (9e4,) * 6, 0.0, train_mass=6e4)) == []


@pytest.mark.parametrize("mass", [50e3, 55.1e3, 60e3, 2e6])
def test_a_mass_of_the_loads_or_of_a_train_with_trailers_is_no_matter(mass):
    given = Locomotive((0.33,) * 6, (9e4,) * 6, 60.0, train_mass=mass)
    assert warnings_for(given) == []


def test_a_message_without_a_cycle_is_told():
    free = replace(CONFIG, database=CONFIG.database, choices=CONFIG.choices)
    message = free.messages[0]
    object.__setattr__(message, "cycle_us", None)
    (warning,) = check([Block.from_frames([])], free).warnings
    assert warning.startswith(f"{message.plan.name}: its cycle is unknown")
    assert "cycle_ms" in warning


def with_signal(name, signal, **change):
    """The default configuration with the signal of one role replaced by that of another."""
    source = next(c for c in CONFIG.choices if c.name == signal)
    return replace(
        CONFIG,
        choices=tuple(
            replace(c, message=source.message, signal=source.signal, **change)
            if c.name == name
            else c
            for c in CONFIG.choices
        ),
    )


def test_one_signal_for_two_axles_is_refused_by_every_command():
    twice = with_signal("wheel_speed.2", "wheel_speed.1")
    with pytest.raises(ConfigError, match=r"wheel_speed\.1 and wheel_speed\.2 are the same signal"):
        twice.require_identification()
    assert any("are the same signal" in one for one in check([], twice).failures)


def test_a_force_of_two_axles_may_be_shared_where_its_factor_is_stated():
    for factor in (0.5, 1.0):
        with_signal(
            "tractive_effort.2", "tractive_effort.1", factor=factor
        ).require_identification()
    with pytest.raises(ConfigError, match=r"same signal, .*; write a factor for each axle: 1 if"):
        with_signal("tractive_effort.2", "tractive_effort.1").require_identification()
