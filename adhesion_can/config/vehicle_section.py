"""Section `[vehicle]` of the configuration file: the locomotive's data, with units in the keys.

The defaults are those of `Locomotive` and `Geometry`; only the names are mapped here.
"""

from collections.abc import Mapping, Sequence
from typing import Annotated, Any, get_type_hints

from adhesion_can.config.toml_tables import arguments_from, reject_unknown_keys, table_of, typed
from adhesion_can.errors import ConfigError
from adhesion_can.physics.vehicle import MOST_AXLES, Geometry, Locomotive
from adhesion_can.ranges import Within

AXLES = Annotated[int, Within(1, MOST_AXLES)]
"""Number of axles, with its range."""
PER_AXLE: Mapping[str, str] = {"wheel_radius_m": "wheel_radius", "axle_load_N": "axle_load"}
"""Field of `Locomotive` by key, for values that are given once for all axles or once for each."""

WHOLE_VEHICLE: Mapping[str, str] = {
    "wheelset_inertia_kgm2": "wheelset_inertia",
    "train_mass_kg": "train_mass",
    "load_std": "load_std",
}
"""Field of `Locomotive` by key, for single values."""

VEHICLE_DATA: Mapping[str, str] = {
    "wheel_radius_m": "radius of the worn wheels, m: one number, or a list with one for each axle",
    "axle_load_N": "static load of an axle, N: one number, or a list with one for each axle",
    "wheelset_inertia_kgm2": "inertia of a driven wheelset with gear and motor, kg m^2",
    "train_mass_kg": "mass of the train with the vehicle, kg",
}
"""Data that only the vehicle's owner knows, and their meaning, by key."""
VEHICLE_EXAMPLES: Mapping[str, tuple[str, str]] = {
    "wheel_radius_m": ("0.33", "0.625"),
    "axle_load_N": ("90e3", "220e3"),
    "wheelset_inertia_kgm2": ("60", "200"),
    "train_mass_kg": ("40e3", "600e3"),
}
"""Usual values of a tram and of a locomotive with its train, by the keys of `VEHICLE_DATA`."""


def vehicle_example(key: str) -> str:
    """Usual values of a key of `VEHICLE_DATA`, as a clause."""
    tram, locomotive = VEHICLE_EXAMPLES[key]
    return f"such as {tram} (tram) or {locomotive} (locomotive)"


FILL_IN = "fill in"
"""Text in place of a value in a new configuration file."""

GEOMETRY: Mapping[str, str] = {
    "axles_per_bogie": "axles_per_bogie",
    "pivot_distance_m": "pivot_distance",
    "axle_spacing_m": "axle_spacing",
    "coupler_height_m": "coupler_height",
    "traction_height_m": "traction_height",
}
"""Field of `Geometry` by key of `[vehicle.geometry]`."""


def load_vehicle(value: object, where: str) -> Locomotive:
    """Locomotive from the section `[vehicle]`.

    Args:
        value: TOML table; an empty one gives the defaults.
        where: File, for errors.

    Raises:
        ConfigError: A key is unknown, a value is wrong, or lists differ in length.

    """
    place = f"{where}: vehicle"
    table = table_of(value, place)
    known = ("axles", *PER_AXLE, *WHOLE_VEHICLE)
    unknown = {key: v for key, v in table.items() if key not in (*known, "geometry")}
    reject_unknown_keys(unknown, place, (*sorted(known), "geometry"))
    for key, given in table.items():
        if given == FILL_IN:
            meaning = VEHICLE_DATA.get(key, "number of the axles")
            raise ConfigError(f"{place}.{key}", "not filled in", f"write the {meaning}")
    default = Locomotive()
    hints = get_type_hints(Locomotive, include_extras=True)
    number = typed(table["axles"], AXLES, f"{place}.axles") if "axles" in table else None
    stated = {} if number is None else {"axles": number}
    values: dict[str, tuple[float, ...] | float] = {}
    for key in PER_AXLE:
        if key not in table:
            values[key] = getattr(default, PER_AXLE[key])[0]
        elif isinstance(table[key], list):
            values[key] = each = typed(table[key], hints[PER_AXLE[key]], f"{place}.{key}")
            stated[key] = len(each)
        else:
            # One number for all axles has the range of each.
            common = typed(table[key], float, f"{place}.{key}")
            (values[key],) = typed([common], hints[PER_AXLE[key]], f"{place}.{key}")
    if len(set(stated.values())) > 1:
        raise ConfigError(place, "lists of different length", "give one value for each axle")
    axles = next(iter(stated.values()), default.axles)
    single = {key: table[key] for key in WHOLE_VEHICLE if key in table}
    geometry = _geometry(table.get("geometry"), axles, place)
    per_axle: dict[str, Any] = {
        PER_AXLE[key]: quantity if isinstance(quantity, tuple) else (quantity,) * axles
        for key, quantity in values.items()
    }
    try:
        return Locomotive(
            **per_axle,
            **arguments_from(Locomotive, single, place, WHOLE_VEHICLE),
            geometry=None if geometry is None else Geometry(**geometry),
        )
    except ValueError as error:
        raise ConfigError(place, str(error), "correct the value") from error


def _geometry(value: object, axles: int, where: str) -> dict[str, Any] | None:
    """Arguments of the geometry; without the sub-section the default if its axles match, else None.

    Without a geometry no load transfer is computed.
    """
    if value is None:
        return {} if sum(Geometry().axles_per_bogie) == axles else None
    place = f"{where}.geometry"
    table = table_of(value, place)
    given = arguments_from(Geometry, table, place, GEOMETRY)
    default = Geometry().axles_per_bogie
    bogies = given.get("axles_per_bogie", default)
    missing = [key for key in _needed(bogies) if key not in table] if bogies != default else []
    if missing:
        # The defaults are lengths and heights of another vehicle.
        raise ConfigError(
            place,
            f"{', '.join(missing)} not given, for bogies of {', '.join(map(str, bogies))} axles",
            "give them, or leave the section out: then no transfer of load is computed",
        )
    return given


def _needed(bogies: Sequence[int]) -> list[str]:
    """Keys of the lengths and heights on which the transfer of load depends."""
    several, of_axles = len(bogies) > 1, max(bogies, default=0) > 1
    needed = {
        "pivot_distance_m": several,
        "axle_spacing_m": of_axles,
        "coupler_height_m": True,
        "traction_height_m": several and of_axles,
    }
    return [key for key, is_needed in needed.items() if is_needed]
