"""The configuration file: what it may contain, and every mistake in it as an error of one line."""

import shutil
from hashlib import sha256
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from adhesion_can.bus.frame import Frame
from adhesion_can.bus.receiver import Receiver
from adhesion_can.bus.rejection import Rejection
from adhesion_can.config import load_configuration
from adhesion_can.errors import AdhesionCanError, ConfigError, DatabaseError, InputError
from adhesion_can.physics.readings import Role

DATA = Path(__file__).parents[1] / "data"
OWN_DBC = Path(__file__).parents[2] / "dbc" / "adhesion.dbc"
SPEED = "VehicleSpeed.VehicleSpeed"


def written(folder, text, name="my.toml"):
    path = folder / name
    path.write_text(text, encoding="utf-8")
    return path


def load(folder, text, **others):
    return load_configuration(written(folder, text), **others)


def speed_role(folder, keys):
    return load(folder, f'[roles]\nvehicle_speed = {{ signal = "{SPEED}", {keys} }}\n')


def refused(folder, text, *parts, kind=ConfigError):
    """The one-line error of a file, which names the file and every part."""
    with pytest.raises(kind) as caught:
        load(folder, text)
    message = str(caught.value)
    assert_one_line(caught.value, *parts)
    if kind is ConfigError:
        assert "my.toml" in message, "names the file"
    return message


def assert_one_line(error, *parts):
    message = str(error)
    assert len(message.splitlines()) == 1
    assert isinstance(error, InputError)
    assert error.where
    assert error.what
    assert error.fix
    assert message == f"{error.where}: {error.what}; {error.fix}"
    for part in parts:
        assert part in message, message


# --- what holds without a file -------------------------------------------------------------------


def test_the_defaults_are_our_own_bus_and_a_co_co():
    configuration = load_configuration()
    assert configuration.vehicle.axles == 6
    assert configuration.sha256 == ""
    assert configuration.missing_for_identification() == []
    configuration.require_identification()
    found = {
        (choice.role, choice.axle): f"{choice.message}.{choice.signal}"
        for choice in configuration.choices
    }
    assert len(found) == len(configuration.choices) == 28
    for axle in range(1, 7):
        half = 1 if axle < 4 else 2
        assert found[Role.WHEEL_SPEED, axle] == f"WheelSpeeds{half}.WheelSpeed_Ax{axle}"
        assert found[Role.TRACTIVE_EFFORT, axle] == f"TractiveEffort{half}.TractiveEffort_Ax{axle}"
        assert found[Role.AXLE_LOAD, axle] == f"AxleLoads{half}.AxleLoad_Ax{axle}"
    assert found[Role.VEHICLE_SPEED, 0] == SPEED


def test_an_empty_file_equals_the_defaults_but_knows_its_origin(tmp_path):
    ours, empty = load_configuration(), load(tmp_path, "")
    assert empty.vehicle == ours.vehicle
    assert empty.choices == ours.choices
    assert empty.service == ours.service
    assert empty.where == "my.toml"
    assert empty.sha256 == sha256(b"").hexdigest()


def test_the_hash_is_of_the_bytes(tmp_path):
    text = "# Größe\r\n[vehicle]\r\naxles = 4\r\n"
    path = tmp_path / "my.toml"
    path.write_bytes(text.encode())
    assert load_configuration(path).sha256 == sha256(text.encode()).hexdigest()


# --- vehicle -------------------------------------------------------------------------------------


def test_vehicle_values_arrive(tmp_path):
    vehicle = load(
        tmp_path,
        """
        [vehicle]
        axles = 4
        wheel_radius_m = [0.61, 0.62, 0.63, 0.64]
        axle_load_N = 2e5
        wheelset_inertia_kgm2 = 150
        train_mass_kg = 9e5
        load_std = 0.05
        [vehicle.geometry]
        axles_per_bogie = [2, 2]
        pivot_distance_m = 9
        axle_spacing_m = 2.5
        coupler_height_m = 1.0
        traction_height_m = 0.5
        """,
    ).vehicle
    assert vehicle.wheel_radius == (0.61, 0.62, 0.63, 0.64)
    assert vehicle.axle_load == (2e5,) * 4
    assert vehicle.wheelset_inertia == 150.0
    assert vehicle.train_mass == 9e5
    assert vehicle.load_std == 0.05
    geometry = vehicle.geometry
    assert geometry.axles_per_bogie == (2, 2)
    assert geometry.pivot_distance == 9.0
    assert geometry.axle_spacing == 2.5
    assert geometry.coupler_height == 1.0
    assert geometry.traction_height == 0.5


def test_the_number_of_axles_follows_from_a_list(tmp_path):
    configuration = load(tmp_path, "[vehicle]\nwheel_radius_m = [0.6, 0.61, 0.62, 0.63]\n")
    assert configuration.vehicle.axles == 4
    assert configuration.vehicle.axle_load == (245e3,) * 4
    assert max(choice.axle for choice in configuration.choices) == 4


def test_a_vehicle_of_eight_axles_receives_the_six_of_the_message_set(tmp_path):
    configuration = load(tmp_path, "[vehicle]\naxles = 8\n")
    assert configuration.vehicle.axles == 8
    assert max(choice.axle for choice in configuration.choices) == 6


BAD_VEHICLES = {
    'wheel_radius_m = "big"': ("vehicle.wheel_radius_m", "number"),
    'wheel_radius_m = [0.6, "x", 0.6, 0.6, 0.6, 0.6]': ("vehicle.wheel_radius_m", "number"),
    "wheel_radius_m = -0.6": ("vehicle.wheel_radius_m", "-0.6 is not within"),
    "wheel_radius_m = 0": ("vehicle.wheel_radius_m", "0 is not within"),
    "wheel_radius_m = nan": ("vehicle", "finite"),
    "wheel_radius_m = inf": ("vehicle", "finite"),
    "wheel_radius_m = []": ("vehicle",),
    "axles = 4\nwheel_radius_m = [0.6, 0.6]": ("vehicle", "length"),
    "wheel_radius_m = [0.6, 0.6]\naxle_load_N = [2e5, 2e5, 2e5]": ("vehicle", "length"),
    "axles = 0": ("vehicle",),
    "axles = -2": ("vehicle",),
    "axles = 4.0": ("vehicle.axles", "whole number"),
    "axles = true": ("vehicle.axles",),
    "axles = 1000000000": ("vehicle.axles", "1 to 64"),
    f"axle_load_N = {[1e5] * 65}": ("vehicle.axle_load_N", "65 values", "1 to 64"),
    "train_mass_kg = 0": ("vehicle.train_mass_kg", "0 is not within"),
    "axle_load_N = -1": ("vehicle.axle_load_N", "-1 is not within"),
    "wheelset_inertia_kgm2 = -1": ("vehicle", "inertia"),
    "wheelset_inertia_kgm2 = 2024-01-01": ("vehicle.wheelset_inertia_kgm2", "number"),
    "load_std = -0.1": ("vehicle",),
    "load_std = nan": ("vehicle",),
    "wheel_radius = 0.6": ("vehicle.wheel_radius", "unknown key", "wheel_radius_m"),
    "geometry = 5": ("vehicle.geometry", "table"),
    "axles = 4\ngeometry.axles_per_bogie = [2, 2]": (
        "vehicle.geometry",
        "pivot_distance_m, axle_spacing_m, coupler_height_m, traction_height_m not given",
        "leave the section out",
    ),
    "axles = 2\ngeometry.axles_per_bogie = [2]": (
        "vehicle.geometry",
        "axle_spacing_m, coupler_height_m not given",
    ),
    "geometry = { axles_per_bogie = [2, 2], pivot_distance_m = 9, axle_spacing_m = 2, "
    "coupler_height_m = 1, traction_height_m = 0.5 }": ("vehicle", "6"),
    "geometry.axles_per_bogie = 3": ("vehicle.geometry.axles_per_bogie", "list"),
    "geometry.axles_per_bogie = [-3, 9]": ("vehicle",),
    "geometry.pivot_distance_m = 0": ("vehicle",),
    "geometry.axle_spacing_m = nan": ("vehicle",),
    "geometry.bogies = 2": ("vehicle.geometry.bogies", "unknown key", "axles_per_bogie"),
}


@pytest.mark.parametrize(("lines", "parts"), BAD_VEHICLES.items(), ids=lambda case: str(case)[:40])
def test_a_vehicle_that_cannot_be_is_refused(tmp_path, lines, parts):
    refused(tmp_path, f"[vehicle]\n{lines}\n", *parts)


def test_a_file_from_a_stranger_cannot_take_all_memory_nor_the_stack(tmp_path):
    refused(tmp_path, "x = " + 5000 * "[" + 5000 * "]", "nested too deeply")
    refused(tmp_path, "#" * (5 << 20), "larger than 4 MiB")


@pytest.mark.timeout(20)  # without its limit such a key takes more than a minute
@pytest.mark.parametrize(
    "key", ["a" + ".a" * 50_000, "[" + "a." * 50_000 + "a]", "a" + '.",[{"' * 50_000]
)
def test_a_key_of_many_parts_cannot_take_all_the_time(tmp_path, key):
    refused(tmp_path, f"{key} = 1", "a key of more than 32 parts")


def test_many_dots_that_are_no_key_are_read(tmp_path):
    path = tmp_path / "a.toml"
    path.write_text(f"# {'.' * 50}\n[vehicle]\naxle_load_N = 245e3 # {'.' * 50}\n")
    load_configuration(path)
    refused(tmp_path, f"a = '{'.' * 50}'", "unknown key")
    refused(tmp_path, f"a = {[0.5] * 50}", "unknown key")


@pytest.mark.parametrize("number", ["9" * 5000, "0x" + "f" * 5000, "-9223372036854775809"])
def test_an_integer_beyond_those_of_toml_is_refused(tmp_path, number):
    for text in (f"estimator = {number}", f"[service]\nhold_s = [{{a = {number}}}]"):
        refused(tmp_path, text, "integer")


def test_a_path_with_a_null_character_is_none(tmp_path):
    refused(tmp_path, '[bus]\ndatabase = "a\\u0000b"', "bus.database", "not a path")


def test_the_known_keys_of_the_vehicle_name_the_geometry_too(tmp_path):
    assert "geometry" in refused(tmp_path, "[vehicle]\ngeometri = 1\n", "vehicle.geometri")


# --- unknown keys, wrong types, wrong values -----------------------------------------------------

UNKNOWN = {
    "colour = 1": ("colour", "vehicle"),
    "[colour]\nx = 1": ("colour",),
    "[bus]\ncolour = 1": ("bus", "colour", "database"),
    "[service]\ncolour = 1": ("service.colour", "target_share"),
    "[sampling]\ncolour = 1": ("sampling.colour", "v_min"),
    "[sensors]\ncolour = 1": ("sensors.colour", "effort_std"),
    "[evolution]\ncolour = 1": ("evolution.colour", "population"),
    "[identifiability]\ncolour = 1": ("identifiability.colour", "reach"),
    "[change]\ncolour = 1": ("change.colour", "ratio"),
    f'[roles]\nvehicle_speed = {{ signal = "{SPEED}", colour = 1 }}': (
        "roles.vehicle_speed.colour",
        "protection",
    ),
    f'[roles]\ncolour = "{SPEED}"': ("roles.colour", "unknown role", "vehicle_speed"),
}


@pytest.mark.parametrize(("text", "parts"), UNKNOWN.items(), ids=UNKNOWN.keys())
def test_an_unknown_key_is_an_error_at_every_level(tmp_path, text, parts):
    refused(tmp_path, text, "unknown", *parts)


WRONG = {
    "vehicle = 5": ("vehicle", "table"),
    "roles = 5": ("roles", "table"),
    "bus = 5": ("bus", "table"),
    "service = []": ("service", "table"),
    "bus.database = 5": ("bus.database",),
    "estimator = 5": ("estimator",),
    'estimator = "kalman"': ("estimator", "kalman", "paper"),
    'service.hold_s = "long"': ("service.hold_s", "number"),
    "service.hold_s = -1": ("service",),
    "service.hold_s = nan": ("service",),
    "service.target_share = 0": ("service", "target_share"),
    "service.target_share = 1.01": ("service", "target_share"),
    "service.target_share = true": ("service.target_share",),
    "service.restart_s = 0": ("service",),
    "sampling.v_min = -1": ("sampling",),
    "sampling.v_min = nan": ("sampling",),
    "sensors.effort_std = -1": ("sensors",),
    "evolution.population = 3": ("evolution", "population"),
    "evolution.population = 30.5": ("evolution.population", "whole number"),
    'evolution.start = "somewhere"': ("evolution.start", "uniform"),
    "evolution.start = 5": ("evolution.start", "uniform"),
    "evolution.lower = [0.1, 2.0]": ("evolution.lower", "3"),
    "evolution.lower = [5, 500, 5]": ("evolution", "lower"),
    "evolution.theta0 = [1, 2]": ("evolution.theta0", "3"),
    'evolution.factor = "big"': ("evolution.factor", "number"),
}


@pytest.mark.parametrize(("text", "parts"), WRONG.items(), ids=WRONG.keys())
def test_a_wrong_type_or_value_is_an_error_that_names_the_key(tmp_path, text, parts):
    refused(tmp_path, text + "\n", *parts)


def test_settings_arrive(tmp_path):
    configuration = load(
        tmp_path,
        """
        estimator = "paper"
        service = { target_share = 1, hold_s = 0.5 }
        sampling = { v_min = 2 }
        sensors = { effort_std = 100 }
        evolution = { lower = [0, 1, 0], seed = 7, start = "uniform", factor = 0.8 }
        identifiability = { reach = 0.1 }
        change = { ratio = 2 }
        """,
    )
    assert configuration.service.target_share == 1.0
    assert configuration.service.hold_s == 0.5
    assert configuration.service.change_s == 5.0
    assert configuration.sampling.v_min == 2.0
    assert configuration.sensors.effort_std == 100.0
    assert configuration.estimators.evolution.lower == (0.0, 1.0, 0.0)
    assert configuration.estimators.evolution.seed == 7
    assert configuration.estimators.evolution.start == "uniform"
    assert configuration.estimators.evolution.factor == 0.8
    assert configuration.estimators.identifiability.reach == 0.1
    assert configuration.estimators.change.ratio == 2.0


@pytest.mark.parametrize(
    "content",
    [b"a = ", b"[vehicle", b"a = 1\na = 2\n", b"\xff\xfe", b"x = 1\x00", b"[roles]\n[roles]\n"],
)
def test_what_is_not_toml_is_an_error_of_one_line(tmp_path, content):
    path = tmp_path / "my.toml"
    path.write_bytes(content)
    with pytest.raises(ConfigError) as caught:
        load_configuration(path)
    assert_one_line(caught.value, "my.toml", "TOML")


def test_a_missing_file_is_named(tmp_path):
    with pytest.raises(ConfigError) as caught:
        load_configuration(tmp_path / "nowhere.toml")
    assert_one_line(caught.value, "nowhere.toml", "No such file")
    with pytest.raises(ConfigError) as caught:
        load_configuration(tmp_path)
    assert_one_line(caught.value, tmp_path.name)


# --- roles ---------------------------------------------------------------------------------------

BAD_ROLES = {
    'vehicle_speed = "VehicleSpeed"': ("roles.vehicle_speed", "Message.Signal"),
    "vehicle_speed = 5": ("roles.vehicle_speed",),
    'vehicle_speed = { unit = "m/s" }': ("roles.vehicle_speed", "signal"),
    "vehicle_speed = { signal = 5 }": ("roles.vehicle_speed.signal",),
    f'vehicle_speed.1 = "{SPEED}"': ("roles.vehicle_speed.1", "axle"),
    f'vehicle_speed.0s = "{SPEED}"': ("roles.vehicle_speed.0s", "has no axles"),
    f'vehicle_speed.0 = "{SPEED}"': ("roles.vehicle_speed.0", "has no axles"),
    f'"vehicle_speed." = "{SPEED}"': ("roles.vehicle_speed.", "has no axles"),
    'wheel_speed = "WheelSpeeds1.WheelSpeed_Ax1"': ("roles.wheel_speed", "wheel_speed.1"),
    'wheel_speed.0 = "WheelSpeeds1.WheelSpeed_Ax1"': ("roles.wheel_speed.0",),
    'wheel_speed.7 = "WheelSpeeds1.WheelSpeed_Ax1"': ("roles.wheel_speed.7", "6 axles"),
    '"wheel_speed.seven" = "WheelSpeeds1.WheelSpeed_Ax1"': ("roles.wheel_speed.seven",),
    '"wheel_speed.²" = "WheelSpeeds1.WheelSpeed_Ax1"': ("roles.wheel_speed.²",),
    '"wheel_speed.1" = "WheelSpeeds1.WheelSpeed_Ax1"\n'
    'wheel_speed.1 = "WheelSpeeds1.WheelSpeed_Ax2"': ("roles.wheel_speed.1",),
    '"wheel_speed.01" = "WheelSpeeds1.WheelSpeed_Ax1"\n'
    '"wheel_speed.1" = "WheelSpeeds1.WheelSpeed_Ax2"': ("wheel_speed",),
    'wheel_speed.1 = { signal = "WheelSpeeds1.WheelSpeed_Ax1", cycle_ms = 10 }\n'
    'wheel_speed.2 = { signal = "WheelSpeeds1.WheelSpeed_Ax2", cycle_ms = 20 }': (
        "roles.wheel_speed.1",
        "roles.wheel_speed.2",
        "cycle_ms",
        "WheelSpeeds1",
    ),
    'wheel_speed.1 = { signal = "WheelSpeeds1.WheelSpeed_Ax1", protection = "none" }\n'
    'wheel_speed.2 = { signal = "WheelSpeeds1.WheelSpeed_Ax2", protection = "e2e-p01" }': (
        "roles.wheel_speed.1",
        "protection",
    ),
    'wheel_speed.1 = { signal = "WheelSpeeds1.WheelSpeed_Ax1", data_id = 1 }\n'
    'wheel_speed.2 = { signal = "WheelSpeeds1.WheelSpeed_Ax2", data_id = 2 }': ("data_id",),
}


@pytest.mark.parametrize(("lines", "parts"), BAD_ROLES.items(), ids=BAD_ROLES.keys())
def test_a_role_that_cannot_be_is_refused(tmp_path, lines, parts):
    refused(tmp_path, f"[roles]\n{lines}\n", *parts)


BAD_KEYS = {
    'unit = "parsec"': ("roles.vehicle_speed", "parsec", "km/h"),
    'unit = "rad/s"': ("roles.vehicle_speed", "rad/s"),
    'unit = ""': ("roles.vehicle_speed", "m/s"),
    "unit = 5": ("roles.vehicle_speed.unit", "text"),
    "sign = 0": ("roles.vehicle_speed.sign", "1 or -1"),
    "sign = 2": ("roles.vehicle_speed.sign",),
    'factor = "one"': ("roles.vehicle_speed.factor", "number"),
    "factor = nan": ("roles.vehicle_speed",),
    "factor = inf": ("roles.vehicle_speed",),
    "factor = 0": ("roles.vehicle_speed",),
    'protection = "crc"': ("roles.vehicle_speed.protection", "e2e-p01", "none"),
    "data_id = 65536": ("roles.vehicle_speed", "data_id"),
    "data_id = -1": ("roles.vehicle_speed", "data_id"),
    "cycle_ms = -1": ("roles.vehicle_speed.cycle_ms",),
    "cycle_ms = nan": ("roles.vehicle_speed.cycle_ms",),
    "cycle_ms = 1e9": ("roles.vehicle_speed.cycle_ms",),
    "channel = 0": ("roles.vehicle_speed.channel", "text"),
    'not_available = "no"': ("roles.vehicle_speed.not_available",),
    "stuck_check = 0": ("roles.vehicle_speed.stuck_check",),
}


@pytest.mark.parametrize(("keys", "parts"), BAD_KEYS.items(), ids=BAD_KEYS.keys())
def test_a_key_of_a_role_that_cannot_be_is_refused(tmp_path, keys, parts):
    with pytest.raises(ConfigError) as caught:
        speed_role(tmp_path, keys)
    assert_one_line(caught.value, "my.toml", *parts)


@pytest.mark.parametrize(
    "text",
    [
        '[roles]\nwheel_speed.1 = "WheelSpeeds1.WheelSpeed_Ax1"\n',
        '[roles]\n"wheel_speed.1" = "WheelSpeeds1.WheelSpeed_Ax1"\n',
        '[roles]\nwheel_speed.1 = { signal = "WheelSpeeds1.WheelSpeed_Ax1" }\n',
        '[roles."wheel_speed.1"]\nsignal = "WheelSpeeds1.WheelSpeed_Ax1"\n',
        '[roles.wheel_speed.1]\nsignal = "WheelSpeeds1.WheelSpeed_Ax1"\n',
        '[roles.wheel_speed]\n1 = "WheelSpeeds1.WheelSpeed_Ax1"\n',
        'roles = { wheel_speed.1 = "WheelSpeeds1.WheelSpeed_Ax1" }\n',
    ],
)
def test_every_spelling_of_a_role_means_the_same(tmp_path, text):
    (choice,) = load(tmp_path, text).choices
    assert (choice.role, choice.axle, choice.name) == (Role.WHEEL_SPEED, 1, "wheel_speed.1")
    assert (choice.message, choice.signal) == ("WheelSpeeds1", "WheelSpeed_Ax1")
    assert (choice.channel, choice.unit, choice.factor, choice.sign) == (None, None, None, 1)
    assert choice.used_factor == 1


def test_the_keys_of_a_role_arrive(tmp_path):
    (message,) = speed_role(
        tmp_path,
        'channel = "can1", unit = "km/h", factor = 1.02, sign = -1, protection = "e2e-p01", '
        "data_id = 0, cycle_ms = 12.5, not_available = false, stuck_check = false",
    ).messages
    (signal,) = message.signals
    assert signal.stuck_check is False
    assert message.channel == "can1"
    assert message.data_id == 0
    assert message.cycle_us == 12_500
    assert signal.not_available is None
    assert signal.scale == pytest.approx(-1.02 / 3.6)


def test_protection_follows_the_database_unless_stated(tmp_path):
    (own,) = speed_role(tmp_path, "factor = 1").messages
    assert own.data_id == 0x111
    assert own.cycle_us == 20_000
    (none,) = speed_role(tmp_path, 'protection = "none"').messages
    assert none.data_id is None
    (stated,) = speed_role(tmp_path, "data_id = 7").messages
    assert stated.data_id == 7


def test_roles_may_be_missing_and_are_named(tmp_path):
    configuration = load(tmp_path, f'[roles]\nvehicle_speed = "{SPEED}"\n')
    assert configuration.roles() == {Role.VEHICLE_SPEED}
    assert configuration.missing_for_identification() == ["wheel speed", "tractive effort"]
    with pytest.raises(ConfigError) as caught:
        configuration.require_identification()
    assert_one_line(caught.value, "my.toml", "wheel speed", "tractive effort", "roles")


def test_wheel_speed_and_effort_of_different_axles_do_not_suffice(tmp_path):
    configuration = load(
        tmp_path,
        f'[roles]\nvehicle_speed = "{SPEED}"\n'
        'wheel_speed.1 = "WheelSpeeds1.WheelSpeed_Ax1"\n'
        'tractive_effort.2 = "TractiveEffort1.TractiveEffort_Ax2"\n',
    )
    (missing,) = configuration.missing_for_identification()
    assert "same axle" in missing


def test_a_role_without_cycle_cannot_serve(tmp_path):
    shutil.copy(DATA / "car.dbc", tmp_path)
    configuration = load(
        tmp_path,
        '[bus]\ndatabase = "car.dbc"\n[vehicle]\naxles = 4\n[roles]\n'
        'vehicle_speed = "SPEED.SPEED"\n'
        'wheel_speed.1 = { signal = "WHEEL_SPEEDS.WHEEL_SPEED_FL", cycle_ms = 12 }\n'
        'tractive_effort.1 = { signal = "SPEED.NO_UNIT", unit = "kN" }\n',
    )
    assert configuration.missing_for_identification() == []
    with pytest.raises(ConfigError) as caught:
        configuration.require_identification()
    assert_one_line(caught.value, "my.toml", "SPEED", "cycle_ms")


def test_an_unknown_estimator_is_refused_by_name():
    with pytest.raises(ConfigError) as caught:
        load_configuration().make_estimator("kalman")
    assert_one_line(caught.value, "kalman", "paper")


# --- database ------------------------------------------------------------------------------------


def test_the_database_is_found_beside_the_file_and_replaced_by_the_command_line(tmp_path):
    folder = tmp_path / "there"
    folder.mkdir()
    shutil.copy(OWN_DBC, folder / "mine.dbc")
    path = written(folder, '[bus]\ndatabase = "mine.dbc"\n')
    assert load_configuration(path).database.path == folder / "mine.dbc"
    path = written(folder, '[bus]\ndatabase = "gone.dbc"\n')
    assert load_configuration(path, dbc=OWN_DBC).database.path == OWN_DBC
    assert load_configuration(None, dbc=folder / "mine.dbc").database.path == folder / "mine.dbc"


def test_a_missing_database_is_named(tmp_path):
    refused(
        tmp_path, '[bus]\ndatabase = "gone.dbc"\n', "gone.dbc", "No such file", kind=DatabaseError
    )
    with pytest.raises(DatabaseError) as caught:
        load_configuration(None, dbc=tmp_path)
    assert_one_line(caught.value, tmp_path.name)


@pytest.mark.parametrize("name", ["my.dbc", "my.kcd", "my.arxml", "my.sym", "my.txt", "my"])
@pytest.mark.parametrize(
    "content",
    [b"", b"This is no database.\n" * 5, bytes(range(256)), b"<xml/>", b"{}", b"BO_ 1 A: 8"],
    ids=["empty", "prose", "bytes", "xml", "json", "half"],
)
def test_what_is_no_database_is_an_error_of_one_line(tmp_path, name, content):
    path = tmp_path / name
    path.write_bytes(content)
    with pytest.raises(DatabaseError) as caught:
        load_configuration(None, dbc=path)
    assert_one_line(caught.value, name)
    assert len(str(caught.value)) < 500


def without_message(name):
    """Our own DBC without one message."""
    kept, skipping = [], False
    number = None
    for line in OWN_DBC.read_text().splitlines():
        if line.startswith("BO_ "):
            skipping = line.split()[2] == f"{name}:"
            number = line.split()[1] if skipping else number
        if skipping and (line.startswith(("BO_ ", " SG_"))):
            continue
        if number and f" {number} " in line and not line.startswith(("BO_ ", " SG_")):
            continue
        kept.append(line)
    return "\n".join(kept) + "\n"


@pytest.mark.parametrize("name", ["WheelSpeeds1", "VehicleSpeed", "TractiveEffort2"])
def test_a_database_without_a_needed_message_is_refused(tmp_path, name):
    path = tmp_path / "less.dbc"
    path.write_text(without_message(name))
    with pytest.raises(DatabaseError) as caught:
        load_configuration(None, dbc=path)
    assert_one_line(caught.value, "less.dbc", name, "--config")


@pytest.mark.parametrize("name", ["AxleLoads1", "Environment", "TrackGeometry"])
def test_a_database_may_lack_an_optional_message(tmp_path, name):
    path = tmp_path / "less.dbc"
    path.write_text(without_message(name))
    configuration = load_configuration(None, dbc=path)
    assert name not in {choice.message for choice in configuration.choices}
    configuration.require_identification()


def test_a_database_without_a_needed_signal_names_role_and_signal(tmp_path):
    text = OWN_DBC.read_text()
    lines = [line for line in text.splitlines() if "WheelSpeed_Ax2" not in line]
    path = tmp_path / "less.dbc"
    path.write_text("\n".join(lines) + "\n")
    with pytest.raises(DatabaseError) as caught:
        load_configuration(None, dbc=path)
    assert_one_line(caught.value, "less.dbc", "WheelSpeeds1.WheelSpeed_Ax2", "wheel_speed.2")


@pytest.mark.parametrize("signal", ["Nowhere.Signal", "VehicleSpeed.Nothing"])
def test_a_role_with_a_signal_that_is_not_there_is_refused(tmp_path, signal):
    refused(
        tmp_path,
        f'[roles]\nvehicle_speed = "{signal}"\n',
        signal,
        "vehicle_speed",
        "adhesion.dbc",
        kind=DatabaseError,
    )


# --- the car -------------------------------------------------------------------------------------


def car():
    return load_configuration(DATA / "car.toml")


def car_frame(*speeds_kmh, channel="can0", t_us=0):
    """As the car sends it: big-endian u16 × 0.01 − 67.67 km/h."""
    raw = b"".join(round((speed + 67.67) / 0.01).to_bytes(2, "big") for speed in speeds_kmh)
    return Frame(t_us, 0x0AA, raw, channel)


def test_the_cars_wheel_speeds_come_as_radians_per_second():
    heard = Receiver(car().messages)
    readings = heard.accept(car_frame(36.0, 72.0, 0.0, 100.08))
    values = {reading.axle: reading.value for reading in readings}
    assert values == {
        1: pytest.approx(10 / 0.35, rel=1e-9),
        2: pytest.approx(20 / 0.35, rel=1e-9),
        3: pytest.approx(0, abs=1e-9),
        4: pytest.approx(27.8 / 0.36, rel=1e-9),
    }
    assert {reading.role for reading in readings} == {Role.WHEEL_SPEED}


def test_the_car_is_received_on_its_channel_and_without_protection():
    heard = Receiver(car().messages)
    assert heard.accept(car_frame(1, 2, 3, 4, channel="can1")) is None
    for i in range(20):
        frame = car_frame(1, 2, 3, 4, t_us=12_000 * i)
        assert len(heard.accept(frame)) == 4
    assert heard.rejected == heard.lost == 0


def test_the_cars_own_limits_hold():
    heard = Receiver(car().messages)
    # Below 0 km/h and above 250 km/h, as the database says; all ones is 'not available'.
    assert heard.accept(car_frame(-1.0, 0, 0, 0)) is Rejection.RANGE
    assert heard.accept(car_frame(250.5, 0, 0, 0)) is Rejection.RANGE
    data = b"\xff\xff" + car_frame(0, 10, 10, 10).data[2:]
    assert heard.accept(Frame(0, 0x0AA, data, "can0"))[0].value is None
    assert heard.accept(Frame(0, 0x0AA, data[:7], "can0")) is Rejection.LENGTH


def test_the_cycle_stated_at_one_role_is_the_messages():
    wheels, speed = car().messages
    assert wheels.cycle_us == 12_000
    assert speed.cycle_us is None
    assert {message.data_id for message in (wheels, speed)} == {None}
    assert len(wheels.signals) == 4


def test_speeds_at_the_rim_follow_each_axles_radius(tmp_path):
    shutil.copy(DATA / "car.dbc", tmp_path)
    text = (DATA / "car.toml").read_text().replace("[0.35, 0.35, 0.36, 0.36]", "[0.3, 0.4, 0.5, 1]")
    heard = Receiver(load(tmp_path, text).messages)
    readings = heard.accept(car_frame(36, 36, 36, 36))
    assert [r.value for r in readings] == [pytest.approx(10 / r) for r in (0.3, 0.4, 0.5, 1.0)]


@pytest.mark.parametrize(
    ("unit", "factor"),
    [
        ("rad/s", 1.0),
        ("deg/s", 3.141592653589793 / 180),
        ("rpm", 2 * 3.141592653589793 / 60),
        ("1/s", 2 * 3.141592653589793),
        ("m/s", 1 / 0.35),
        ("km/h", 1 / 3.6 / 0.35),
        ("mph", 0.44704 / 0.35),
    ],
)
def test_units_of_a_wheel_speed(tmp_path, unit, factor):
    shutil.copy(DATA / "car.dbc", tmp_path)
    (message,) = load(
        tmp_path,
        '[bus]\ndatabase = "car.dbc"\n[vehicle]\naxles = 4\nwheel_radius_m = 0.35\n[roles]\n'
        f'wheel_speed.1 = {{ signal = "WHEEL_SPEEDS.WHEEL_SPEED_FL", unit = "{unit}" }}\n',
    ).messages
    assert message.signals[0].scale == pytest.approx(factor, rel=1e-12)


def test_a_signal_without_unit_must_be_given_one(tmp_path):
    shutil.copy(DATA / "car.dbc", tmp_path)
    head = '[bus]\ndatabase = "car.dbc"\n[roles]\n'
    refused(
        tmp_path, head + 'vehicle_speed = "SPEED.NO_UNIT"\n', "roles.vehicle_speed", "SPEED.NO_UNIT"
    )
    text = head + 'vehicle_speed = { signal = "SPEED.NO_UNIT", unit = "m/s" }\n'
    assert load(tmp_path, text).messages[0].signals[0].scale == 1.0


def test_protection_without_data_id_is_refused(tmp_path):
    shutil.copy(DATA / "car.dbc", tmp_path)
    refused(
        tmp_path,
        '[bus]\ndatabase = "car.dbc"\n[roles]\n'
        'vehicle_speed = { signal = "SPEED.SPEED", protection = "e2e-p01" }\n',
        "roles.vehicle_speed",
        "data_id",
    )


def test_protection_of_a_message_without_room_for_it_is_refused(tmp_path):
    """Checksum and counter take two bytes; better now than at the first frame."""
    shutil.copy(DATA / "car.dbc", tmp_path)
    refused(
        tmp_path,
        '[bus]\ndatabase = "car.dbc"\n[roles]\n'
        'vehicle_speed = { signal = "SHORT.SHORT", protection = "e2e-p01", data_id = 5 }\n',
        "roles.vehicle_speed",
    )


def dbc_with_data_ids_of_text():
    """Our own DBC where E2EDataId says something that is no number."""
    text = OWN_DBC.read_text()
    text = text.replace('BA_DEF_ BO_ "E2EDataId" INT 0 65535;', 'BA_DEF_ BO_ "E2EDataId" STRING ;')
    text = text.replace('BA_DEF_DEF_ "E2EDataId" 0;', 'BA_DEF_DEF_ "E2EDataId" "";')
    lines = [
        f'BA_ "E2EDataId" BO_ {line.split()[3]} "see sheet";'
        if line.startswith('BA_ "E2EDataId"')
        else line
        for line in text.splitlines()
    ]
    return "\n".join(lines) + "\n"


def test_a_data_id_of_the_database_that_is_no_number_is_our_own_error(tmp_path):
    path = tmp_path / "strings.dbc"
    path.write_text(dbc_with_data_ids_of_text())
    with pytest.raises(InputError) as caught:
        load_configuration(None, dbc=path)
    assert_one_line(caught.value, "E2EDataId")


@pytest.mark.parametrize(("keys", "data_id"), [('protection = "none"', None), ("data_id = 7", 7)])
def test_the_protection_of_a_role_precedes_that_of_the_database(tmp_path, keys, data_id):
    (tmp_path / "strings.dbc").write_text(dbc_with_data_ids_of_text())
    (message,) = load(
        tmp_path,
        '[bus]\ndatabase = "strings.dbc"\n[roles]\n'
        f'vehicle_speed = {{ signal = "{SPEED}", {keys} }}\n',
    ).messages
    assert message.data_id == data_id


# --- anything at all -----------------------------------------------------------------------------

keys = st.sampled_from(
    [
        "bus", "vehicle", "roles", "service", "sampling", "sensors", "evolution", "change",
        "identifiability", "estimator", "axles", "wheel_radius_m", "axle_load_N", "geometry",
        "axles_per_bogie", "database", "target_share", "vehicle_speed", "wheel_speed",
        '"wheel_speed.1"', "1", "signal", "unit", "sign", "factor", "data_id", "protection",
        "cycle_ms", "lower", "seed", "start", "theta0", "x", '"a b"', '""',
    ]
)  # fmt: skip
values = st.sampled_from(
    [
        "1", "-1", "0", "0.5", "nan", "-inf", "true", '""', '"x"', f'"{SPEED}"', "[]", "[1, 2, 3]",
        "[0.6, 0.6]", "[[]]", "{}", "{ 1 = 2 }", "2024-01-01", '"none"', '"m/s"', '"a.b.c"', '"."',
        '"VehicleSpeed."', '"\\n"', f'{{ signal = "{SPEED}", unit = "km/h" }}', "[true]", "9999999",
    ]
)  # fmt: skip
lines = st.one_of(
    st.builds("{} = {}".format, keys, values),
    st.builds("[{}]".format, keys),
    st.builds("[{}.{}]".format, keys, keys),
    st.builds("{}.{} = {}".format, keys, keys, values),
)


@pytest.mark.costly
@settings(
    max_examples=150,
    deadline=None,
    suppress_health_check=[HealthCheck.function_scoped_fixture, HealthCheck.too_slow],
)
@given(document=st.lists(lines, max_size=4).map("\n".join))
def test_any_document_gives_a_configuration_or_one_line(tmp_path, document):
    path = written(tmp_path, document)
    try:
        configuration = load_configuration(path, dbc=OWN_DBC)
    except AdhesionCanError as error:
        assert_one_line(error)
    else:
        assert configuration.messages


@pytest.mark.parametrize("text", ['"two\\nlines" = 1', '[roles]\n"two\\nlines" = "A.B"'])
def test_a_key_of_two_lines_is_an_error_of_one(tmp_path, text):
    refused(tmp_path, text, "unknown")


def test_a_number_beyond_all_floats_is_refused(tmp_path):
    refused(tmp_path, f"[vehicle]\nwheel_radius_m = {'9' * 400}\n", "wheel_radius_m")


def test_the_resolution_of_the_signals_adds_to_their_noise():
    config = load_configuration()
    sent, noise = config.sensors_as_sent, config.sensors
    # Steps of the message set: 0.002 rad/s, 0.002 m/s, 10 N.
    assert sent.wheel_speed_std**2 == pytest.approx(noise.wheel_speed_std**2 + 0.002**2 / 12)
    assert sent.vehicle_speed_std**2 == pytest.approx(noise.vehicle_speed_std**2 + 0.002**2 / 12)
    assert sent.effort_std**2 == pytest.approx(noise.effort_std**2 + 10.0**2 / 12)
