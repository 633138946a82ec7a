"""Drive of a simulated locomotive without a radar: steady efforts, reliefs and excursions.

Below the peak the effort of an axle gives its slip, an axle without effort shows the vehicle speed
(`reliefs.py`), and one axle at a time is brought over the peak, beside the others that stay below
it. So observer and estimator see what they need. What a real drive finds by its slip protection,
the adhesion of the rail, is given.
"""

from dataclasses import dataclass, field, replace

import numpy as np

from adhesion_can.arrays import Array
from adhesion_can.control.reliefs import Reliefs
from adhesion_can.control.settings import ReliefSettings

OTHER_RAIL = 0.05
"""Change of the logarithm of the largest adhesion from which the surface changes."""


@dataclass(frozen=True, slots=True)
class RelievingSettings:
    """Settings of the drive.

    Attributes:
        share: Effort of an axle over the largest one on this rail, 1.
        rise_s: Time in which the efforts rise at first, s.
        excursion_each_s: Time from the start of an excursion to that of the next one, s.
        excursion_s: Duration of an excursion, s.
        excursion_slip: Largest slip of an excursion over that of the peak, 1.
        reliefs: Times of the reliefs.

    """

    share: float = 0.65
    rise_s: float = 2.0
    excursion_each_s: float = 4.0
    excursion_s: float = 2.0
    excursion_slip: float = 2.5
    reliefs: ReliefSettings = field(
        default_factory=lambda: replace(ReliefSettings(), enabled=True, period_s=8.0)
    )


@dataclass(frozen=True, slots=True)
class DriveState:
    """What the drive knows at a step; arrays of shape (axles,).

    Attributes:
        time_s: Time, s.
        speed: Vehicle speed, m/s.
        creep_speed: Creep speed of each axle, m/s.
        effort: Effort of each axle now, N.
        largest: Largest effort of each axle on this rail, N.
        peak_slip: Slip ratio at which each axle has it.

    """

    time_s: float
    speed: float
    creep_speed: Array
    effort: Array
    largest: Array
    peak_slip: Array


class RelievingDrive:
    """Efforts of all axles in traction.

    Args:
        axles: Number of axles.
        gain: Proportional gain of the creep speed control in an excursion, N per m/s.
        integral_gain: Integral gain of it, N/s per m/s.

    """

    def __init__(self, axles: int, gain: float, integral_gain: float) -> None:
        self._settings = RelievingSettings()
        self._axles = axles
        self._gain, self._integral_gain = gain, integral_gain
        self._reliefs = Reliefs(self._settings.reliefs, axles)
        self._relieved: set[int] = set()
        self._largest: Array | None = None
        self._excursion: int | None = None
        """Place of the axle on an excursion; None where none is."""
        self._next, self._began_s = 0, 0.0
        self._integral = 0.0

    def step(self, state: DriveState, dt: float) -> Array:
        """Efforts to demand, N, shape (axles,), until the next step in `dt` seconds."""
        s = self._settings
        steady = s.share * state.largest * min(state.time_s / s.rise_s, 1.0)
        before, self._largest = self._largest, state.largest
        ratio = 1.0 if before is None else state.largest / before
        changes = bool(np.any(np.abs(np.log(ratio)) > OTHER_RAIL))
        shares = self._reliefs.step(
            state.time_s,
            steady,
            asked=len(self._relieved) < self._axles,
            changing=changes,
            allowed=state.time_s > s.rise_s and self._excursion is None,
        )
        if self._reliefs.axle is not None:
            self._relieved.add(self._reliefs.axle)
        self._choose_excursion(state)
        effort = steady * shares
        if self._excursion is not None:
            effort[self._excursion] = self._lead(state, self._excursion, dt)
        return np.asarray(effort)

    def _choose_excursion(self, state: DriveState) -> None:
        s = self._settings
        if self._excursion is not None:
            if state.time_s >= self._began_s + s.excursion_s:
                self._excursion = None
        elif (
            self._reliefs.axle is None
            and self._relieved
            and state.time_s >= self._began_s + s.excursion_each_s
        ):
            self._excursion, self._began_s = self._next, state.time_s
            self._next = (self._next + 1) % self._axles
            self._integral = float(state.effort[self._excursion])

    def _lead(self, state: DriveState, axle: int, dt: float) -> float:
        """Effort that leads an axle over the peak and back, N."""
        s = self._settings
        place = 1.0 - abs(2.0 * (state.time_s - self._began_s) / s.excursion_s - 1.0)
        low = 0.5
        slip = (low + (s.excursion_slip - low) * place) * state.peak_slip[axle]
        error = float(slip * state.speed - state.creep_speed[axle])
        most = 1.1 * float(state.largest[axle])
        self._integral = min(max(self._integral + dt * self._integral_gain * error, 0.0), most)
        return min(max(self._integral + self._gain * error, 0.0), most)
