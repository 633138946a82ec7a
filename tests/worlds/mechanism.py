"""What a mechanism that no library has does to a drive: from what is there to what it changes."""

from collections.abc import Callable
from dataclasses import dataclass

from tests.worlds.drive_profile import DriveProfile, Vehicle
from tests.worlds.rail import Floats


@dataclass(frozen=True)
class Scene:
    """A drive without the mechanism, row by row of its profile.

    Attributes:
        profile: Speed, creep, loads and surroundings.
        vehicle: Static loads, order and places of the axles.
        curves: c1, c2, c3 of the rail, (n, 3).
        omega: Angular speed of the wheels, rad/s, (n, 6).
        adhesion: signed, (n, 6).
        effort: Effort of the motors at the wheel rim, N, (n, 6).

    """

    profile: DriveProfile
    vehicle: Vehicle
    curves: Floats
    omega: Floats
    adhesion: Floats
    effort: Floats


@dataclass(frozen=True)
class Change:
    """What a mechanism changes; arrays broadcast to (n, 6) but for the speed, (n,).

    Attributes:
        slip: Creep that the contact feels; None: that of the wheels.
        factor: of the adhesion.
        load_factor: Load of the contact over the one that the scales show.
        rotation: of the wheel's true angular speed, where its radius differs.
        wheel_speed: Angular speed shown, rad/s; None: the true one.
        gain: of the effort shown.
        offset: added to the effort shown, N.
        speed: Vehicle speed shown, m/s; None: the true one.
        shown_load: Load shown, N; None: the true one.

    """

    slip: Floats | None = None
    factor: Floats | float = 1.0
    load_factor: Floats | float = 1.0
    rotation: Floats | float = 1.0
    wheel_speed: Floats | None = None
    gain: Floats | float = 1.0
    offset: Floats | float = 0.0
    speed: Floats | None = None
    shown_load: Floats | None = None


UNCHANGED = Change()
Law = Callable[[Scene], Change]
