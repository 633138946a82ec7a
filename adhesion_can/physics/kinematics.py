"""Creep, slip ratio and adhesion coefficient from speeds and effort (eq. 1-3).

Speeds are magnitudes, so both directions of travel read the same; the sign of creep, slip and
effort is that of traction (+) and braking (−). Every function broadcasts.
"""

import numpy as np
from numpy.typing import ArrayLike

from adhesion_can.arrays import Array

V_MIN = 1.0
"""Default speed below which no slip ratio is formed, m/s: λ = v_s/v blows up as v → 0."""


def creep_speed(wheel_speed: ArrayLike, speed: ArrayLike, radius: ArrayLike) -> Array:
    """Creep speed v_s = r ω − v in m/s (eq. 1).

    Args:
        wheel_speed: Wheel speed ω, rad/s.
        speed: Vehicle speed v, m/s.
        radius: Wheel radius r, m.

    """
    return np.asarray(np.asarray(radius) * np.asarray(wheel_speed) - np.asarray(speed))


def slip_ratio(
    wheel_speed: ArrayLike, speed: ArrayLike, radius: ArrayLike, v_min: float = V_MIN
) -> Array:
    """Slip ratio λ = (r ω − v)/v (eq. 2); NaN below `v_min`.

    Args:
        wheel_speed: Wheel speed ω, rad/s.
        speed: Vehicle speed v, m/s.
        radius: Wheel radius r, m.
        v_min: Smallest vehicle speed with a slip ratio, m/s.

    """
    v = np.asarray(speed, dtype=np.float64)
    creep = creep_speed(wheel_speed, v, radius)
    fast = np.broadcast_to(v >= v_min, creep.shape)
    return np.asarray(np.divide(creep, v, out=np.full(creep.shape, np.nan), where=fast))


def wheelset_effort(wheel_accel: ArrayLike, inertia: ArrayLike, radius: ArrayLike) -> Array:
    """Effort at the rim that accelerates the wheelset itself, J·(dω/dt)/r, in N.

    Args:
        wheel_accel: Angular acceleration dω/dt, rad/s².
        inertia: Inertia J of the wheelset with its motor, kg·m².
        radius: Wheel radius r, m.

    """
    return np.asarray(np.asarray(inertia) * np.asarray(wheel_accel) / np.asarray(radius))


def adhesion_coefficient(
    effort: ArrayLike,
    load: ArrayLike,
    wheel_accel: ArrayLike = 0.0,
    inertia: ArrayLike = 0.0,
    radius: ArrayLike = 1.0,
) -> Array:
    """Adhesion coefficient μ = (F − J·(dω/dt)/r)/N (eq. 3); NaN where the load is not positive.

    Args:
        effort: Tractive effort F at the rim from motor torque, N; negative in braking.
        load: Wheelset load N, N.
        wheel_accel: Angular acceleration dω/dt, rad/s².
        inertia: Inertia J of the wheelset with its motor, kg·m².
        radius: Wheel radius r, m.

    """
    force = np.asarray(effort, dtype=np.float64) - wheelset_effort(wheel_accel, inertia, radius)
    n = np.broadcast_to(np.asarray(load, dtype=np.float64), np.broadcast(force, load).shape)
    return np.asarray(np.divide(force, n, out=np.full(n.shape, np.nan), where=n > 0.0))
