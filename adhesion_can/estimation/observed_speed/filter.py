"""Vehicle speed and slips from wheel speeds and efforts: an extended Kalman filter.

With y_i = ln(r_i ω_i) for the nominal radius r_i, every axle reads

    y_i = ln v + ln(1 + λ_i) − ρ_i,

where ρ_i is the logarithm of true over nominal radius. An axle whose effort is near zero has
λ_i ≈ 0 and gives ln v − ρ_i; one that pulls keeps its slip and carries the speed from one relief to
the next. The state is

    ln v, disturbance acceleration d, ln a of the curve, ln(1 + λ_i), ρ_i,

with dv/dt = ΣF/M + d, and slips that follow the efforts along the hyperbola of `hyperbola.py`,
whose a the ramps of each relief show. A change of the surface passes
under the axles one after the other, so that differences between axles show it, which no gradient
and no coupler can move: an axle that deviates from all others by more than `gate` standard
deviations is on another surface, and its slip is open again.

Reference axles: US patent 6758087. Filters of the slip without speed sensors: Pichlík and Zděnek,
IEEE Transactions on Vehicular Technology 67 (2018).
"""

import numpy as np
from numpy.typing import NDArray

from adhesion_can.arrays import Array
from adhesion_can.estimation.observed_speed.axle_efforts import AxleEfforts, EffortWatch
from adhesion_can.estimation.observed_speed.gaussian_state import GaussianState
from adhesion_can.estimation.observed_speed.hyperbola import elasticity
from adhesion_can.estimation.observed_speed.layout import (
    DISTURBANCE,
    FIRST_SLIP,
    LOG_HALF,
    LOWEST_SPEED,
    REPEATED_BLOCKS,
    SPEED,
    SpeedStateLayout,
)
from adhesion_can.estimation.observed_speed.motion import Motion
from adhesion_can.estimation.observed_speed.ramp_fit import fit_ramps
from adhesion_can.estimation.observed_speed.ramp_watch import RampWatch
from adhesion_can.estimation.observed_speed.relief_watch import ReliefWatch
from adhesion_can.estimation.observed_speed.result import ObservedSpeed
from adhesion_can.estimation.observed_speed.settings import ObservedSpeedSettings
from adhesion_can.estimation.observed_speed.surface_gate import SurfaceGate
from adhesion_can.estimation.observed_speed.surface_passage import SurfacePassage
from adhesion_can.physics.vehicle import Locomotive
from adhesion_can.values import Stateful

GNSS_STDS, GNSS_SHARE = 5.0, 0.02
"""Largest distance of a GNSS speed that is used: standard deviations, and further a share of it."""


class ObservedSpeedFilter(Stateful):
    """Filter of `drives` that run side by side; a service has one.

    Args:
        locomotive: Vehicle and its train.
        settings: Uncertainties that are assumed; None: the defaults.
        drives: Number of drives.
        net_efforts: Whether efforts are given without what accelerates the wheelsets.

    """

    def __init__(
        self,
        locomotive: Locomotive,
        settings: ObservedSpeedSettings | None = None,
        drives: int = 1,
        *,
        net_efforts: bool = False,
    ) -> None:
        self.settings = settings or ObservedSpeedSettings()
        self.axles = locomotive.axles
        self.drives = drives
        self._layout = SpeedStateLayout(locomotive.axles)
        self._radius = np.asarray(locomotive.wheel_radius)
        self._own_inertia = 0.0 if net_efforts else locomotive.wheelset_inertia
        self._efforts = EffortWatch(drives, self.axles, self.settings)
        self._motion = Motion(locomotive, self.settings, drives)
        self._gate = SurfaceGate(drives, self.axles, self.settings)
        geometry = locomotive.geometry
        length = float(geometry.axle_places[-1]) if geometry else 0.0
        self._passage = SurfacePassage(drives, self.axles, length)
        self._reliefs = ReliefWatch(drives, self.axles, length, self.settings)
        self._ramps = RampWatch(drives, self.axles)
        self.state: GaussianState | None = None
        """State after the last block; None before the first one."""
        self.result: ObservedSpeed | None = None
        """What was stated after the last block; None before the first one."""
        self._sum = np.zeros((3, drives, self.axles))
        self._count = 0
        self._gnss = np.full(drives, np.nan)
        self._acceleration = np.zeros((2, drives))
        self._last_rim: Array | None = None
        self._alike = np.zeros(drives, dtype=bool)

    def update(
        self,
        dt: float,
        wheel_speed: Array,
        effort: Array,
        load: Array,
        gnss: Array | None = None,
        acceleration: Array | None = None,
    ) -> ObservedSpeed | None:
        """Take the readings of one sample in.

        Args:
            dt: Time since the last sample, s.
            wheel_speed: Angular speed of each wheel, rad/s, shape (drives, axles).
            effort: Effort at the rim of each axle, N, along the direction of travel; without what
                accelerates the wheelset where `net_efforts`.
            load: Load of each axle, N.
            gnss: Speed by satellites, m/s, shape (drives,); NaN where there is none now.
            acceleration: Longitudinal acceleration, m/s², without gravity's part, shape (drives,);
                NaN where there is none now.

        Returns:
            State after the last block; None before the first one is full.

        """
        self._sum += np.stack([self._radius * wheel_speed, effort, load])
        self._ramps.add(dt, self._radius * wheel_speed, effort / load)
        self._count += 1
        if gnss is not None:
            self._gnss = np.where(np.isfinite(gnss), gnss, self._gnss)
        if acceleration is not None:
            there = np.isfinite(acceleration)
            self._acceleration += np.stack([np.where(there, acceleration, 0.0), there])
        if self._count * dt >= self.settings.block_s - 1e-9:
            self._end_block(self._count * dt)
        return self.result

    def _end_block(self, dt: float) -> None:
        rim, effort, load = self._sum / self._count
        samples, settings = self._count, self.settings
        self._sum = np.zeros_like(self._sum)
        self._count = 0
        rim = np.maximum(rim, 1e-3)
        last = rim if self._last_rim is None else self._last_rim
        self._last_rim = rim
        # An effort as it is measured still contains what accelerates the wheelset itself.
        inertial = self._own_inertia / self._radius**2 * (rim - last) / dt
        force = effort - inertial
        noise = settings.effort_std / float(np.sqrt(samples))
        axles = self._efforts.update(force / load, dt, noise)
        if self.state is None:
            self.state = self._motion.first_state(rim)
        state = self.state
        self._motion.predict(state, axles, force.sum(axis=1), dt)
        self._motion.go_beyond(state, self._reliefs.beyond(axles.mean))
        deviates = self._measure_wheels(state, axles, np.log(rim), samples, dt)
        self._measure_gnss(state)
        self._measure_acceleration(state, dt)
        speed = np.exp(state.mean[:, SPEED])
        change = self._passage.update(deviates, speed, dt)
        if change.any():
            self._motion.forget_curve(state, np.asarray(change.any(axis=1)))
        self._reliefs.update(axles, change, speed, dt)
        self._see_ramps(state, axles, change)
        self._share_curve(state, axles)
        self.result = self._stated(state, axles, np.log(rim), samples)

    def _measure_wheels(
        self, state: GaussianState, axles: AxleEfforts, y: Array, samples: int, dt: float
    ) -> NDArray[np.bool_]:
        """Take the wheel speeds in; returns which axles deviate from all others."""
        s, layout, x = self.settings, self._layout, state.mean
        settling = self._gate.settling(dt)
        used = (axles.pulls & ~settling) | axles.free
        slip = x[:, layout.slips]
        H = np.zeros((self.drives, self.axles, layout.size))
        H[:, :, SPEED] = used
        rows = np.arange(self.axles)
        H[:, rows, FIRST_SLIP + rows] = used & axles.pulls
        H[:, rows, FIRST_SLIP + self.axles + rows] = -1.0 * used
        shown = np.where(axles.free, axles.adhesion * s.free_compliance, slip)
        predicted = x[:, SPEED, None] + shown - x[:, layout.radii]
        innovation = np.where(used, y - predicted, 0.0)
        wheel = self._wheel_variance(np.exp(x[:, SPEED]), samples)
        # Small changes of the effort that the thresholds hide, and the contact's own unrest.
        unrest = (1e-4 + 0.01 * np.abs(slip)) ** 2
        lasting = (np.abs(axles.adhesion) * s.free_compliance_std) ** 2 + (
            s.adhesion_bias * s.free_compliance
        ) ** 2
        once = wheel + np.where(axles.free, lasting, unrest)
        repeated = wheel + np.where(axles.free, REPEATED_BLOCKS * lasting, unrest)
        judged = axles.pulls & ~settling
        change = self._gate.judge(
            judged, state.covariance, H, innovation, np.where(used, once, 1.0)
        )
        if change.any():
            self._motion.open_slips(state, change)
        used &= ~change
        H *= used[:, :, None]
        # A free axle shows the slips at this effort, and with those at another one the curve.
        learns = np.asarray(axles.free.any(axis=1))
        state.update(H, np.where(used, innovation, 0.0), np.where(used, repeated, 1.0), learns)
        return change

    def _measure_gnss(self, state: GaussianState) -> None:
        # A receiver without a fix may send 0 or any speed as a valid one. The filter is the less
        # certain of its own the longer none is used, so a right one is not refused for ever.
        there = self._gnss >= LOWEST_SPEED
        shown = np.where(there, self._gnss, 1.0)
        R = np.where(there, (self.settings.gnss_std / shown) ** 2, 1.0)
        error = np.log(shown) - state.mean[:, SPEED]
        std = np.sqrt(state.covariance[:, SPEED, SPEED] + R)
        there &= np.abs(error) <= GNSS_STDS * std + GNSS_SHARE
        if there.any():
            H = np.zeros((self.drives, 1, self._layout.size))
            H[:, 0, SPEED] = there
            error, R = np.where(there, error, 0.0), np.where(there, R, 1.0)
            state.update(H, error[:, None], R[:, None])
            self._reliefs.see_speed(there)
        self._gnss = np.full(self.drives, np.nan)

    def _measure_acceleration(self, state: GaussianState, dt: float) -> None:
        """The acceleration less that by the efforts is the disturbance."""
        total, count = self._acceleration
        there = count > 0
        if there.any():
            H = np.zeros((self.drives, 1, self._layout.size))
            H[:, 0, DISTURBANCE] = there
            shown = total / np.maximum(count, 1.0) - self._motion.last_force / self._motion.mass
            error = np.where(there, shown - state.mean[:, DISTURBANCE], 0.0)
            R = np.where(there, self.settings.accelerometer_std**2 / dt, 1.0)
            state.update(H, error[:, None], R[:, None])
        self._acceleration = np.zeros((2, self.drives))

    def _see_ramps(
        self, state: GaussianState, axles: AxleEfforts, change: NDArray[np.bool_]
    ) -> None:
        """Learn the curve from the reliefs that have ended with this block."""
        s = self.settings
        ended = self._ramps.update(axles, change, state.mean[:, self._layout.slips])
        for drive, axle, samples in ended:
            curve = fit_ramps(samples, axle, s.effort_std)
            if curve is not None:
                variance = curve.variance + s.ramp_std**2
                self._motion.see_curve(state, drive, curve.log_half, variance)

    def _share_curve(self, state: GaussianState, axles: AxleEfforts) -> None:
        """Once after the first relief: all axles share one curve, but for their levels.

        Not again: the levels are the same after a change, and would be counted twice.
        """
        s, layout = self.settings, self._layout
        now = self._reliefs.first_ended & ~self._alike
        if not now.any():
            return
        self._alike |= now
        x = state.mean
        reference = axles.mean
        p = elasticity(x[:, layout.slips], x[:, LOG_HALF, None])
        pulled = np.isfinite(reference) & now[:, None]
        size = np.where(pulled, np.abs(reference), 1.0)
        count = np.maximum(pulled.sum(axis=1), 1)
        mean = np.exp((np.log(size) * pulled).sum(axis=1) / count)
        scale = np.where(pulled, (mean[:, None] / size) ** p, 0.0)
        part = scale[:, None, :] * np.eye(self.axles)
        part -= pulled[:, :, None] * scale[:, None, :] / count[:, None, None]
        H = np.zeros((self.drives, self.axles, x.shape[1]))
        H[:, :, layout.slips] = part
        slip = np.abs((x[:, layout.slips] * scale).sum(axis=1) / count)
        # The common slip may be larger than it seems by now.
        P = state.covariance[:, layout.slips, layout.slips]
        slip = slip + np.sqrt(np.mean(np.diagonal(P, axis1=1, axis2=2), axis=1))
        # An axle with a larger slip than the others is nearer to its peak, on a steeper curve.
        relative_slip = np.abs(x[:, layout.slips]) / np.maximum(slip, 1e-4)[:, None]
        relative_slip = np.maximum(relative_slip, 1.0) ** 2
        steep = self._motion.steepness(state, slip[:, None])
        R = (s.level_std * steep * slip[:, None] * relative_slip + 1e-4) ** 2
        error = -(H @ x[:, :, None])[:, :, 0]
        noise = np.where(pulled, R, 1.0)
        state.update(H, np.where(pulled, error, 0.0), noise)

    def _stated(
        self, state: GaussianState, axles: AxleEfforts, y: Array, samples: int
    ) -> ObservedSpeed:
        layout, x, P = self._layout, state.mean, state.covariance
        speed = np.exp(x[:, SPEED])
        variances = np.diagonal(P, axis1=1, axis2=2)
        # From speed and radii, so that it holds for an axle that spins or is on a ramp, too.
        slip = np.expm1(y + x[:, layout.radii] - x[:, SPEED, None])
        spread = variances[:, SPEED, None] + variances[:, layout.radii]
        spread = np.maximum(spread - 2.0 * P[:, SPEED, layout.radii], 0.0)
        wheel = self._wheel_variance(speed, samples)
        slip_std = np.sqrt(spread + wheel)
        counted = ~axles.free
        n = np.maximum(counted.sum(axis=1), 1)
        overall = np.sqrt((np.where(counted, slip_std, 0.0) ** 2).sum(axis=1) / n)
        verdict = self._reliefs.judge(overall)
        return ObservedSpeed(
            speed=speed,
            white_variance=wheel.mean(axis=1) / self.axles * speed**2,
            slow_variance=variances[:, SPEED] * speed**2,
            slip=slip,
            slip_std=slip_std,
            overall_std=overall,
            radius_factor=np.exp(x[:, layout.radii]),
            since_relief_s=self._reliefs.since_relief_s.copy(),
            known=verdict.known,
            relief_wanted=verdict.wanted,
            reasons=verdict.reasons,
        )

    def _wheel_variance(self, speed: Array, samples: int) -> Array:
        """Variance of ln(r ω) by the noise of the wheel speeds, shape (drives, axles)."""
        speed = np.maximum(speed, LOWEST_SPEED)[:, None]
        return np.asarray((self.settings.wheel_std * self._radius / speed) ** 2 / samples)
