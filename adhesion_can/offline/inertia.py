"""Part of the adhesion of a recording that the configured inertia of a wheelset takes."""

import numpy as np

from adhesion_can.arrays import Array
from adhesion_can.offline.points import MeasuredPoints
from adhesion_can.physics.samples import Samples
from adhesion_can.physics.vehicle import Locomotive

HIGH = 0.99
"""Share of the rows that a size leaves below it."""


def inertial_adhesion(samples: Samples, vehicle: Locomotive) -> Array:
    """Force that accelerates a wheelset over its load, at the rim, shape (n,).

    The acceleration is the central difference of the rim speed, as that of the samples.

    Args:
        samples: Samples of one axle.
        vehicle: Configured vehicle.

    """
    if len(samples) < 3:
        return np.zeros(len(samples))
    radius = vehicle.wheel_radius[int(samples.axle[0]) - 1]
    omega = samples.speed * (1.0 + samples.slip) / radius
    span = np.maximum(samples.t_us[2:] - samples.t_us[:-2], 1) * 1e-6
    acceleration = np.zeros(len(samples))
    acceleration[1:-1] = (omega[2:] - omega[:-2]) / span
    return np.asarray(vehicle.wheelset_inertia * acceleration / radius / samples.load)


def is_inertial(points: MeasuredPoints) -> bool:
    """Whether the inertia and not the tractive effort makes the largest adhesions."""
    if points.inertial is None:
        return False
    by_inertia, by_effort = (
        float(np.quantile(np.abs(part), HIGH))
        for part in (points.inertial, points.adhesion + points.inertial)
    )
    return by_inertia > by_effort
