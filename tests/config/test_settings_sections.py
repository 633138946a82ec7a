"""Settings are listed once: sections and keys of the file are those of the nested dataclasses."""

from dataclasses import fields, replace

import pytest

from adhesion_can.config import load_configuration
from adhesion_can.config.load import settings_sections
from adhesion_can.config.vehicle_section import GEOMETRY, PER_AXLE, WHOLE_VEHICLE
from adhesion_can.errors import ConfigError
from adhesion_can.estimation.tracker.settings import MemorySettings, TrackerSettings
from adhesion_can.physics.vehicle import Geometry, Locomotive


def load(folder, text):
    path = folder / "my.toml"
    path.write_text(text, encoding="utf-8")
    return load_configuration(path)


def test_the_sections_are_those_of_the_files_that_users_have():
    assert tuple(settings_sections()) == (
        "service",
        "sampling",
        "sensors",
        "identifiability",
        "noise",
        "doubt",
        "instruments",
        "plausibility",
        "observed_speed",
        "tracker",
        "run_length",
        "memory",
        "prior",
        "axles",
        "evolution",
        "change",
        "limits",
    )
    assert settings_sections()["tracker"] == ("curves", "noise_std", "errors_in_variables")


def test_a_section_reaches_its_place_in_the_nested_settings(tmp_path):
    text = "[tracker]\ncurves = 128\n[memory]\ntimes_s = [60]\n[identifiability]\nreach = 0.1\n"
    settings = load(tmp_path, text).estimators
    default = load_configuration().estimators
    wanted = TrackerSettings(curves=128, memory=MemorySettings(times_s=(60.0,)))
    assert settings.tracker == wanted
    assert settings.identifiability == replace(default.identifiability, reach=0.1)
    assert settings.evolution == default.evolution


@pytest.mark.parametrize(
    ("text", "key"),
    [
        ("[estimators]\n", "estimators"),
        ("[tracker]\nknown_surfaces = []\n", "tracker.known_surfaces"),
        ("[tracker]\nrun_length = {}\n", "tracker.run_length"),
    ],
)
def test_what_only_programs_set_is_no_key_of_the_file(tmp_path, text, key):
    with pytest.raises(ConfigError, match="unknown key") as caught:
        load(tmp_path, text)
    assert key in str(caught.value)


def test_the_vehicles_defaults_are_those_of_its_class(tmp_path):
    assert load(tmp_path, "[vehicle]\n").vehicle == Locomotive()
    assert load(tmp_path, "[vehicle.geometry]\n").vehicle.geometry == Geometry()
    four = load(tmp_path, "[vehicle]\naxles = 4\n").vehicle
    assert four.wheel_radius == Locomotive().wheel_radius[:4]
    assert four.geometry is None


def test_every_value_of_the_vehicle_has_a_key():
    keys = {*PER_AXLE.values(), *WHOLE_VEHICLE.values(), "geometry"}
    assert keys == {field.name for field in fields(Locomotive)}
    assert set(GEOMETRY.values()) == {field.name for field in fields(Geometry)}
