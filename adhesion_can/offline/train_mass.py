"""Whether the configured mass of the train is at least what its driven axles carry."""

from math import ceil

from adhesion_can.physics.vehicle import GRAVITY, Locomotive

TOLERANCE = 0.1
"""Share by which the mass may be below the static loads: an empty train, loads of a full one."""


def find_light_train(vehicle: Locomotive) -> list[str]:
    """A sentence where the mass of a train is too small for its axle loads; else none.

    A larger mass is that of a train with trailing axles.

    Args:
        vehicle: Configured vehicle.

    """
    carried = sum(vehicle.axle_load) / GRAVITY
    if vehicle.train_mass >= (1.0 - TOLERANCE) * carried:
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
