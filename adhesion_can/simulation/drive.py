"""The drive: a PI controller on the creep speed of each axle, and its setpoints.

A curve that is not excited cannot be identified. So the drive probes: it sweeps the slip of its
axles from near zero to beyond the peak, each axle at another phase, so that the train's effort
hardly changes. A drive that is left alone probes all the time. A drive that obeys the service
probes while the service does not know the surface, and holds the service's setpoint otherwise.
Where a creep controller outside demands efforts, the motors follow these.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import Enum, auto
from math import isfinite

import numpy as np

from adhesion_can.arrays import Array
from adhesion_can.simulation.surroundings import interpolate


@dataclass(frozen=True, slots=True)
class DriveSettings:
    """Gains and limits.

    Attributes:
        gain: Proportional gain, N per m/s of creep speed error.
        integral_gain: Integral gain, N/s per m/s of creep speed error.
        effort_max: Largest effort of one axle, N.
        braking_max: Largest effort of one axle in braking, N, as a positive number; None: that of
            traction.
        lag_s: Time constant of the motor's torque, s.
        slip_low: Lower end of a probing sweep, slip ratio.
        slip_high: Upper end of a probing sweep, slip ratio, beyond the peak of every surface.
        period_s: Duration of a probing sweep up and down, s.
        probe_s: Time for which an obeying drive goes on probing after the surface is known, s.
        v_min: Smallest speed in the creep setpoint slip · max(v, v_min), m/s.
        demand_timeout_s: Age of the latest effort demand from which on the motors give no effort,
            s: three cycles.

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
    demand_timeout_s: float = 0.03
    braking_max: float | None = None

    @property
    def lowest_effort(self) -> float:
        """Effort of the strongest braking, N, 0 or less."""
        return -(self.effort_max if self.braking_max is None else self.braking_max)


class Pattern(Enum):
    """How a drive that is left alone varies the slip."""

    STAGGERED = auto()
    """Sweeps in traction, the axles at even phases."""
    SWEEP = auto()
    """Traction, coasting, braking, coasting; all axles together."""


SWEEP_PERIOD_S = 20.0
SWEEP_PARTS = (0.0, 0.32, 0.64, 0.72, 0.80, 1.0)
SWEEP_HEIGHTS = (0.0, 1.0, 0.0, 1.0, 0.0, 0.0)
"""Corners of each half period, as shares of its duration and of `slip_high`: a slow sweep up and
down, a quick one that excites lags, coasting."""


def probing_slip(time_s: float, axles: int, pattern: Pattern, settings: DriveSettings) -> Array:
    """Slip ratio that the axles are to have, shape (axles,).

    Args:
        time_s: Simulated time, s.
        axles: Number of axles.
        pattern: Pattern of the probing sweeps.
        settings: Range and duration of the sweeps.

    """
    low, high = settings.slip_low, settings.slip_high
    if pattern is Pattern.STAGGERED:
        phase = (time_s / settings.period_s + np.arange(axles) / axles) % 1.0
        return np.asarray(low + (high - low) * (1.0 - np.abs(2.0 * phase - 1.0)))
    phase_s = time_s % SWEEP_PERIOD_S
    half = SWEEP_PERIOD_S / 2
    sign = 1.0 if phase_s < half else -1.0
    part = (phase_s % half) / half
    size = high * interpolate(part, SWEEP_PARTS, SWEEP_HEIGHTS)
    return np.full(axles, sign * size)


@dataclass(slots=True)
class ReceivedSetpoint:
    """Content of the latest `AdhesionSetpoint`.

    Attributes:
        known: Whether the service knows the surface: its status is TRACKING.
        since_s: Time from which on `known` has had this value, s.
        creep_speed: Creep speed setpoint, m/s; None: not available.

    """

    known: bool = False
    since_s: float = 0.0
    creep_speed: float | None = None


@dataclass
class Drive:
    """Effort of each axle from its creep speed.

    Attributes:
        axles: Number of axles.
        settings: Gains and limits.
        pattern: Pattern of the probing sweeps.
        obey: Whether the drive follows the service's setpoint while the surface is known.
        command: Content of the latest `AdhesionSetpoint`.

    """

    axles: int
    settings: DriveSettings = field(default_factory=DriveSettings)
    pattern: Pattern = Pattern.STAGGERED
    obey: bool = False
    command: ReceivedSetpoint = field(default_factory=ReceivedSetpoint)

    def __post_init__(self) -> None:
        self._integral = np.zeros(self.axles)
        self._demand = np.zeros(self.axles)
        self._demanded_s = np.full(self.axles, -np.inf)
        self._has_demand = False
        self.effort: Array = np.zeros(self.axles)
        """Effort at the rim of each axle, N, shape (axles,)."""

    def holds(self, time_s: float) -> bool:
        """Whether the drive holds the service's setpoint, and does not probe."""
        command = self.command
        settled = command.known and time_s - command.since_s >= self.settings.probe_s
        return self.obey and settled and command.creep_speed is not None

    def setpoint(self, time_s: float, speed: float) -> Array:
        """Creep speed that each axle is to have, m/s, shape (axles,)."""
        command, settings = self.command, self.settings
        if self.holds(time_s) and command.creep_speed is not None:
            return np.full(self.axles, command.creep_speed)
        slip = probing_slip(time_s, self.axles, self.pattern, settings)
        return np.asarray(slip * max(speed, settings.v_min))

    def step(self, time_s: float, speed: float, creep_speed: Array, dt: float) -> Array:
        """Advance by one step; returns the effort of each axle, N.

        Args:
            time_s: Simulated time, s.
            speed: Vehicle speed, m/s.
            creep_speed: Creep speed of each axle, m/s, shape (axles,).
            dt: Duration of the step, s.

        """
        wanted = (
            self._follow_demand(time_s)
            if self._has_demand
            else self._control_creep(self.setpoint(time_s, speed) - creep_speed, dt)
        )
        share = 1.0 - np.exp(-dt / self.settings.lag_s)
        self.effort = self.effort + (wanted - self.effort) * share
        return self.effort

    def _control_creep(self, error: Array, dt: float) -> Array:
        s = self.settings
        wanted = s.gain * error + self._integral
        limited = np.minimum(np.maximum(wanted, s.lowest_effort), s.effort_max)
        # Anti-windup by conditional integration: at the limit the integral stands still.
        free = (wanted == limited) | (np.sign(error) != np.sign(wanted))
        self._integral = self._integral + dt * s.integral_gain * error * free
        return np.asarray(limited)

    def _follow_demand(self, time_s: float) -> Array:
        s = self.settings
        fresh = time_s - self._demanded_s <= s.demand_timeout_s
        return np.where(fresh, np.clip(self._demand, s.lowest_effort, s.effort_max), 0.0)

    def demand_efforts(self, time_s: float, efforts: Mapping[int, float]) -> None:
        """Give the motors over to a creep controller outside: from now on they follow its demands.

        Args:
            time_s: Simulated time, s.
            efforts: Efforts at the rim by axle number, N; NaN: none is demanded.

        """
        for axle, effort in efforts.items():
            known = isfinite(effort)
            self._demand[axle - 1] = effort if known else 0.0
            self._demanded_s[axle - 1] = time_s if known else -np.inf
        self._has_demand = True

    def update_command(self, time_s: float, *, known: bool, creep_speed: float | None) -> None:
        """Note the content of an `AdhesionSetpoint`.

        Args:
            time_s: Simulated time, s.
            known: Whether the service knows the surface.
            creep_speed: Creep speed setpoint, m/s; None: not available.

        """
        since = self.command.since_s if known is self.command.known else time_s
        self.command = ReceivedSetpoint(known, since, creep_speed)
