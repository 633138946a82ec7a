"""Usual ranges of a vehicle's numbers, and what a number outside them probably is.

They are far wider than the vehicles that they are for, so that a number outside is in another unit
or is another quantity. `init` asks again, and `check` warns; nothing is refused for them where a
configuration is loaded.
"""

from collections.abc import Mapping
from math import ceil
from typing import NamedTuple

from adhesion_can.config.vehicle_section import VEHICLE_EXAMPLES
from adhesion_can.physics.vehicle import GRAVITY

MOST_LOAD_N = 500e3
"""Load that no wheelset has; the heaviest carry 42 t."""
LEAST_MASS = 0.9
"""Least mass of a train as a share of what its static loads carry: an empty train, loads of a full
one."""
MOST_MASS = 100.0
"""Mass of the heaviest train as a multiple of what its driven axles carry."""


class VehicleRange(NamedTuple):
    """Usual range of one number of the vehicle.

    Attributes:
        name: Quantity in words, without an article.
        unit: SI unit of the number.
        low: Lowest usual value, SI.
        high: Highest usual value, SI.
        shown: Both in the unit of data sheets.
        others: SI units in each other unit in which the number is written, by the unit.
        source: Vehicles with the smallest and the largest value.

    """

    name: str
    unit: str
    low: float
    high: float
    shown: str
    others: Mapping[str, float]
    source: str


VEHICLE_RANGES: Mapping[str, VehicleRange] = {
    "wheel_radius_m": VehicleRange(
        "wheel radius", "m", 0.1, 1.3, "0.1 to 1.3 m", {"mm": 1e-3, "cm": 1e-2},
        "wheels of a scaled roller rig and of a wagon for lorries (0.17 m); drivers of a steam "
        "locomotive (1.15 m)",
    ),
    "axle_load_N": VehicleRange(
        "axle load", "N", 1e3, MOST_LOAD_N, "1 to 500 kN", {"kN": 1e3, "t": 1e3 * GRAVITY},
        "one wheel of a small car (2 kN); a wheelset of a wagon for ore (42 t)",
    ),
    "wheelset_inertia_kgm2": VehicleRange(
        "inertia of a wheelset", "kg m^2", 0.1, 5e3, "0.1 to 5000 kg m^2", {},
        "one wheel of a small car (0.5 kg m^2); coupled drivers of a steam locomotive (some "
        "1000 kg m^2)",
    ),
    "train_mass_kg": VehicleRange(
        "mass of a train", "kg", 300.0, 2e8, "0.3 t to 200 000 t", {"t": 1e3},
        "a light car (0.6 t); the heaviest train for ore (100 000 t)",
    ),
}  # fmt: skip
"""Usual ranges of rail and road vehicles by key of `[vehicle]`, with room on both sides."""


class Unlikely(NamedTuple):
    """A number of the vehicle outside its usual range.

    Attributes:
        what: The number and the range.
        fix: What to write instead, without a verb: '92e3 for 92 kN'.

    """

    what: str
    fix: str


def find_unlikely(key: str, value: float) -> Unlikely | None:
    """What is wrong with a number of the vehicle outside its usual range; None inside it.

    Args:
        key: Key of `[vehicle]`.
        value: Number, SI.

    """
    usual = VEHICLE_RANGES[key]
    if usual.low <= value <= usual.high:
        return None
    side = "below" if value < usual.low else "above"
    what = f"{value:g} {usual.unit} is {side} any {usual.name} ({usual.shown})"
    meant = [
        f"{short(value * factor)} for {value:g} {unit}"
        for unit, factor in usual.others.items()
        if usual.low <= value * factor <= usual.high
    ]
    if meant:
        return Unlikely(what, " or ".join(meant))
    others = [
        f"the {other.name} in {other.unit}"
        for name, other in VEHICLE_RANGES.items()
        if name not in (key, "wheel_radius_m") and other.low <= value <= other.high
    ]
    example = f"for example {VEHICLE_EXAMPLES[key][0]}"
    if key == "axle_load_N" and value > usual.high:
        return Unlikely(what, f"the load of one axle, not of the vehicle, {example}")
    if others:
        what += f", and may be {' or '.join(others)}"
    return Unlikely(what, example)


def find_light(mass_kg: float, carried_kg: float) -> Unlikely | None:
    """What is wrong with a mass of the train below the static loads of the axles; else None.

    A larger mass is that of a train with trailing axles.

    Args:
        mass_kg: Mass of the train, kg.
        carried_kg: Mass that the driven axles carry at rest, kg.

    """
    if mass_kg >= LEAST_MASS * carried_kg:
        return None
    what = f"{mass_kg:g} kg is less than the {carried_kg:.0f} kg that the axles carry"
    if LEAST_MASS * carried_kg <= 1e3 * mass_kg <= MOST_MASS * carried_kg:
        return Unlikely(what, f"{short(1e3 * mass_kg)} for {mass_kg:g} t")
    return Unlikely(what, f"{short(100 * ceil(carried_kg / 100))} or more")


def short(value: float) -> str:
    """A number as people write it in a configuration: 0.33, 60, 92e3."""
    rounded = float(f"{value:.4g}")
    return f"{rounded:g}" if abs(value) < 1e3 else f"{rounded / 1e3:.10g}e3"
