"""Whether the configured numbers of the vehicle are those of a vehicle, each alone and together."""

from math import ceil

from adhesion_can.config.vehicle_ranges import LEAST_MASS, find_unlikely
from adhesion_can.physics.vehicle import GRAVITY, Locomotive


def inspect_numbers(vehicle: Locomotive) -> list[str]:
    """A sentence for each number outside its usual range, with what to write.

    Where all are inside, the mass of the train is compared with the axle loads.

    Args:
        vehicle: Configured vehicle.

    """
    numbers = {
        "wheel_radius_m": vehicle.wheel_radius,
        "axle_load_N": vehicle.axle_load,
        "wheelset_inertia_kgm2": (vehicle.wheelset_inertia,),
        "train_mass_kg": (vehicle.train_mass,),
    }
    sentences = []
    for key, values in numbers.items():
        # An inertia of 0 means that it is neglected.
        judged = (find_unlikely(key, value) for value in values if value)
        first = next((unlikely for unlikely in judged if unlikely is not None), None)
        if first is not None:
            sentences.append(f"{key} in [vehicle]: {first.what}; write {first.fix}")
    return sentences or _light_train(vehicle)


def _light_train(vehicle: Locomotive) -> list[str]:
    """A sentence where the mass of a train is too small for its axle loads; else none.

    A larger mass is that of a train with trailing axles.
    """
    carried = sum(vehicle.axle_load) / GRAVITY
    if vehicle.train_mass >= LEAST_MASS * carried:
        return []
    least = 100 * ceil(carried / 100)
    what = (
        f"train_mass_kg = {vehicle.train_mass:g} in [vehicle] is less than the {carried:.0f} kg "
        f"that axle_load_N puts on {vehicle.axles} axles"
    )
    fix = (
        f"write train_mass_kg = {least} or more, or axle_load_N of one axle rather than of a bogie"
    )
    return [f"{what}; {fix}"]
