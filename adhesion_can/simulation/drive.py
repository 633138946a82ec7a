"""The drive: a PI controller on the creep speed of each axle, and where its setpoints come from.

A curve that is never excited cannot be known. So the drive probes: it sweeps the creep of its axles
from near zero to beyond the peak, each axle at another phase, and the train hardly feels it. Left
alone it probes all the time; obeying the service it does so as long as the service says that it
does not know the rail, and holds the setpoint otherwise.
"""

from dataclasses import dataclass, field
from enum import Enum, auto

import numpy as np

from adhesion_can.arrays import Array


@dataclass(frozen=True, slots=True)
class DriveSettings:
    """Gains and limits.

    Attributes:
        gain: N per m/s of creep error.
        integral_gain: N/s per m/s of creep error.
        effort_max: of one axle, N.
        lag_s: of the motor's torque behind its command.
        slip_low: lower end of a probing sweep.
        slip_high: upper end, beyond every peak of a rail.
        period_s: of a sweep, up and down.
        probe_s: an obeying drive goes on probing for so long after the rail is known again.
        v_min: creep is controlled as slip · max(v, v_min), m/s.

    """

    gain: float = 60e3
    integral_gain: float = 2e6
    effort_max: float = 120e3
    lag_s: float = 0.005
    slip_low: float = 0.002
    slip_high: float = 0.20
    period_s: float = 4.0
    probe_s: float = 3.0
    v_min: float = 1.0


class Pattern(Enum):
    """How a drive that is left alone moves the slip."""

    STAGGERED = auto()
    """Sweeps in traction, the axles at even phases."""
    SWEEP = auto()
    """Traction, coasting, braking, coasting; all axles together."""


SWEEP_PERIOD_S = 20.0
SWEEP_PARTS = (0.0, 0.32, 0.64, 0.72, 0.80, 1.0)
SWEEP_HEIGHTS = (0.0, 1.0, 0.0, 1.0, 0.0, 0.0)
"""Of each half: a slow sweep up and down, a quick one that shows what lags behind, coasting."""


def probing_slip(time_s: float, axles: int, pattern: Pattern, settings: DriveSettings) -> Array:
    """Slip that the axles are to have, shape (axles,).

    Args:
        time_s: simulated time.
        axles: number of axles.
        pattern: see there.
        settings: see there.

    """
    low, high = settings.slip_low, settings.slip_high
    if pattern is Pattern.STAGGERED:
        phase = (time_s / settings.period_s + np.arange(axles) / axles) % 1.0
        return np.asarray(low + (high - low) * (1.0 - np.abs(2.0 * phase - 1.0)))
    phase_s = time_s % SWEEP_PERIOD_S
    half = SWEEP_PERIOD_S / 2
    sign = 1.0 if phase_s < half else -1.0
    part = (phase_s % half) / half
    size = high * np.interp(part, SWEEP_PARTS, SWEEP_HEIGHTS)
    return np.full(axles, sign * size)


@dataclass(slots=True)
class Command:
    """What the service last told the drive.

    Attributes:
        known: whether the rail is known: the status was TRACKING.
        since_s: since when it has been so.
        creep_speed: setpoint, m/s; None: not available.

    """

    known: bool = False
    since_s: float = 0.0
    creep_speed: float | None = None


@dataclass
class Drive:
    """Effort of each axle from its creep.

    Attributes:
        axles: number of axles.
        settings: see there.
        pattern: of the probing.
        obey: whether to follow the service's setpoint where it knows the rail.
        command: the service's last word.

    """

    axles: int
    settings: DriveSettings = field(default_factory=DriveSettings)
    pattern: Pattern = Pattern.STAGGERED
    obey: bool = False
    command: Command = field(default_factory=Command)

    def __post_init__(self) -> None:
        self._integral = np.zeros(self.axles)
        self.effort: Array = np.zeros(self.axles)
        """At the rim, N, shape (axles,)."""

    def setpoint(self, time_s: float, speed: float) -> Array:
        """Creep speed that each axle is to have, m/s, shape (axles,)."""
        command, settings = self.command, self.settings
        settled = command.known and time_s - command.since_s >= settings.probe_s
        if self.obey and settled and command.creep_speed is not None:
            return np.full(self.axles, command.creep_speed)
        slip = probing_slip(time_s, self.axles, self.pattern, settings)
        return np.asarray(slip * max(speed, settings.v_min))

    def step(self, time_s: float, speed: float, creep_speed: Array, dt: float) -> Array:
        """Advance by one step; returns the effort of each axle, N.

        Args:
            time_s: simulated time.
            speed: of the vehicle, m/s.
            creep_speed: of each axle, m/s, shape (axles,).
            dt: s.

        """
        s = self.settings
        error = self.setpoint(time_s, speed) - creep_speed
        wanted = s.gain * error + self._integral
        limited = np.clip(wanted, -s.effort_max, s.effort_max)
        # The integral stands still where the limit holds it (anti-windup).
        free = (wanted == limited) | (np.sign(error) != np.sign(wanted))
        self._integral = self._integral + dt * s.integral_gain * error * free
        self.effort = self.effort + (limited - self.effort) * (1.0 - np.exp(-dt / s.lag_s))
        return self.effort

    def tell(self, time_s: float, *, known: bool, creep_speed: float | None) -> None:
        """The service's word: whether it knows the rail, and its setpoint, m/s."""
        since = self.command.since_s if known is self.command.known else time_s
        self.command = Command(known, since, creep_speed)
