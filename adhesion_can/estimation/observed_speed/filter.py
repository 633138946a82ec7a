"""Vehicle speed and slips from wheel speeds and efforts: an extended Kalman filter.

With y_i = ln(r_i ω_i) for the nominal radius r_i, every axle reads

    y_i = ln v + ln(1 + λ_i) − ρ_i,

where ρ_i is the logarithm of true over nominal radius. An axle whose effort is near zero has
λ_i ≈ 0 and gives ln v − ρ_i; one that pulls keeps its slip and carries the speed from one relief to
the next. The state is

    ln v, disturbance acceleration d, elasticity p = d ln λ/d ln μ, ln(1 + λ_i), ρ_i,

with dv/dt = ΣF/M + d, and dλ_i = p λ_i d ln μ_i along the curve. A change of the surface passes
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
from adhesion_can.estimation.observed_speed.relief_watch import ReliefWatch
from adhesion_can.estimation.observed_speed.result import ObservedSpeed
from adhesion_can.estimation.observed_speed.settings import ObservedSpeedSettings
from adhesion_can.estimation.observed_speed.slip_unrest import SlipUnrest
from adhesion_can.physics.vehicle import GRAVITY, Locomotive

SPEED, DISTURBANCE, ELASTICITY, FIRST_SLIP = 0, 1, 2, 3
LOWEST_SPEED = 1.0
"""Speed below which no slip ratio is formed, m/s."""
SURGE_S = 0.7
"""Time constant with which a locomotive comes to rest on its coupler, s."""
WAVES_S, WAVE_S = 4.0, 1.0
"""Times for which waves run through a train, and for which one accelerates the locomotive, s."""
LARGE_CHANGE = 0.1
"""Change of ln μ in a block that no noise makes, 1."""
MEAN_GAIN, MEAN_SCORE_STD = 0.25, 0.5
"""Gain of the mean deviation of an axle over blocks, and its standard deviation with some reserve."""
RELIEF_BLOCKS = 20.0
"""Blocks of a relief in which the same error of a free axle's slip repeats itself."""


class ObservedSpeedFilter:
    """Filter of `drives` that run side by side; a service has one."""

    def __init__(
        self,
        locomotive: Locomotive,
        settings: ObservedSpeedSettings | None = None,
        drives: int = 1,
    ) -> None:
        self.settings = settings or ObservedSpeedSettings()
        self._locomotive = locomotive
        self.axles = locomotive.axles
        self.drives = drives
        self._radius = np.asarray(locomotive.wheel_radius)
        self._efforts = EffortWatch(drives, self.axles, self.settings)
        geometry = locomotive.geometry
        length = float(geometry.axle_places[-1]) if geometry else 0.0
        self._reliefs = ReliefWatch(drives, length, self.settings)
        self._slips = slice(FIRST_SLIP, FIRST_SLIP + self.axles)
        self._radii = slice(FIRST_SLIP + self.axles, FIRST_SLIP + 2 * self.axles)
        self.state: GaussianState | None = None
        self._sum = np.zeros((3, drives, self.axles))
        self._count = 0
        self._gnss = np.full(drives, np.nan)
        self._acceleration = np.zeros((2, drives))
        self._last_force = np.zeros(drives)
        self._surge = np.zeros(drives)
        self._waves = np.zeros(drives)
        self._last_rim: Array | None = None
        self._settling_s = np.zeros((drives, self.axles))
        self._unrest = SlipUnrest(drives, self.axles)
        self._axle_variance = np.zeros((drives, self.axles))
        self._mean_score = np.zeros((drives, self.axles))
        self._alike = np.zeros(drives, dtype=bool)
        self.result: ObservedSpeed | None = None

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
            effort: Effort at the rim of each axle, N, along the direction of travel.
            load: Load of each axle, N.
            gnss: Speed by satellites, m/s, shape (drives,); NaN where there is none now.
            acceleration: Longitudinal acceleration, m/s², without gravity's part, shape (drives,);
                NaN where there is none now.

        Returns:
            State after the last block; None before the first one is full.

        """
        self._sum += np.stack([self._radius * wheel_speed, effort, load])
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
        settings = self.settings
        samples = self._count
        self._sum = np.zeros_like(self._sum)
        self._count = 0
        rim = np.maximum(rim, 1e-3)
        last = rim if self._last_rim is None else self._last_rim
        self._last_rim = rim
        # The effort still contains what accelerates the wheelset itself.
        own = self._locomotive.wheelset_inertia / self._radius**2 * (rim - last) / dt
        force = effort - own
        noise = settings.effort_std / np.sqrt(samples)
        axles = self._efforts.update(force / load, dt, noise)
        if self.state is None:
            self.state = self._initial(rim)
        self._predict(axles, force.sum(axis=1), dt)
        change = self._measure(axles, np.log(rim), samples)
        self._measure_others(dt)
        speed = np.exp(self.state.mean[:, SPEED])
        self._reliefs.update(self._efforts.free_s, axles.free, change, speed, dt)
        self._share_curve(axles)
        white = settings.wheel_std * self._radius.mean() / np.sqrt(samples * self.axles)
        self._gnss = np.full(self.drives, np.nan)
        self._acceleration = np.zeros((2, self.drives))
        self.result = self._stated(axles, np.log(rim), speed, white, samples)

    def _initial(self, rim: Array) -> GaussianState:
        s, n = self.settings, 3 + 2 * self.axles
        mean = np.zeros((self.drives, n))
        mean[:, SPEED] = np.log(np.median(rim, axis=1))
        mean[:, ELASTICITY] = s.elasticity
        P = np.zeros((self.drives, n, n))
        P[:, SPEED, SPEED] = 0.05**2
        P[:, DISTURBANCE, DISTURBANCE] = s.acceleration_std**2
        P[:, ELASTICITY, ELASTICITY] = s.elasticity_std**2
        eye = np.eye(self.axles)
        P[:, self._slips, self._slips] = s.axle_slip_std**2 * eye
        P[:, self._radii, self._radii] = s.radius_std**2 * eye
        return GaussianState(mean, P, considered=ELASTICITY)

    def _predict(self, axles: AxleEfforts, force: Array, dt: float) -> None:
        state, s = self._state, self.settings
        x, P = state.mean, state.covariance
        speed = np.maximum(np.exp(x[:, SPEED]), LOWEST_SPEED)
        rotating = self._locomotive.wheelset_inertia * float(np.sum(1.0 / self._radius**2))
        mass = self._locomotive.train_mass + rotating
        x[:, SPEED] += dt * (force / mass + x[:, DISTURBANCE]) / speed
        state.add_row(SPEED, DISTURBANCE, dt / speed)
        self._move_along_curve(axles)
        slip = x[:, self._slips]
        way = np.sqrt(speed * dt / 100.0)
        # A change of the effort makes the locomotive swing on its coupler for a second, and waves
        # run through the train for several.
        own_mass = float(np.sum(self._locomotive.axle_load)) / GRAVITY
        noise = s.effort_std * float(np.mean(self._locomotive.axle_load)) * np.sqrt(self.axles)
        change = np.maximum(np.abs(force - self._last_force) - noise, 0.0)
        self._last_force = force
        self._surge = self._surge * np.exp(-dt / SURGE_S)
        self._surge += s.surge_share * change / (own_mass * s.coupler_frequency)
        self._waves = self._waves * np.exp(-dt / WAVES_S) + change / mass
        surge = (self._surge * s.coupler_frequency * dt) ** 2 + self._waves**2 * WAVE_S * dt
        P[:, SPEED, SPEED] += (s.speed_wander**2 * dt + surge) / speed**2
        P[:, DISTURBANCE, DISTURBANCE] += (s.acceleration_wander * way) ** 2
        # Slips: the rail's level wanders for all axles, and for each of them.
        steep = x[:, ELASTICITY] + np.sqrt(P[:, ELASTICITY, ELASTICITY])
        variance = np.diagonal(P, axis1=1, axis2=2)[:, self._slips]
        size = np.hypot(slip, np.minimum(np.sqrt(variance), 0.005))
        size = size * np.maximum(steep, 1.0)[:, None] * way[:, None]
        self._axle_variance = (s.axle_wander * size) ** 2
        size = size * self._unrest.scale
        excited = s.excited_wander * np.sqrt(dt) * self._unrest.excitement
        eye = np.eye(self.axles)
        P[:, self._slips, self._slips] += (
            s.level_wander**2 * size[:, :, None] * size[:, None, :]
            + (s.axle_wander * size)[:, :, None] ** 2 * eye
            + excited[:, :, None] * excited[:, None, :] * (1.0 + eye)
        )
        P[:, self._radii, self._radii] += s.radius_wander**2 * dt * np.eye(self.axles)

    def _move_along_curve(self, axles: AxleEfforts) -> None:
        """Slips move with their references, dλ = p λ d ln μ; the elasticity differs further on."""
        state, s = self._state, self.settings
        x, P = state.mean, state.covariance
        if (axles.ratio != 1.0).any():
            ratio = np.log(np.clip(np.abs(axles.ratio), 1e-3, 1e3))
            p = np.maximum(x[:, ELASTICITY, None], 0.5)
            factor = np.clip(np.exp(p * ratio), 0.05, 20.0)
            factor = factor * np.where(axles.ratio < 0, -1.0, 1.0)
            slip = x[:, self._slips] * factor
            x[:, self._slips] = slip
            # A small change may be noise of the effort. Were the covariance scaled with it, wheels
            # that do not follow would pull the slip to zero (errors in variables).
            large = np.abs(ratio) > LARGE_CHANGE
            variance = np.diagonal(P, axis1=1, axis2=2)[:, self._slips]
            noise = np.where(large, 0.0, variance * (factor - 1.0) ** 2)
            state.scale(self._slips, np.where(large, factor, 1.0))
            P[:, self._slips, self._slips] += noise[:, :, None] * np.eye(self.axles)
            state.add_row(self._slips, ELASTICITY, slip * ratio)
            # An Ornstein-Uhlenbeck process in ln μ.
            keep = np.exp(-1.0 * np.median(np.abs(ratio), axis=1))
            x[:, ELASTICITY] = s.elasticity + keep * (x[:, ELASTICITY] - s.elasticity)
            state.scale(slice(ELASTICITY, ELASTICITY + 1), keep[:, None])
            P[:, ELASTICITY, ELASTICITY] += (1.0 - keep**2) * s.elasticity_std**2
            # The axles are at different places of the curve, and stay there for many blocks.
            own = RELIEF_BLOCKS * (s.elasticity_std * slip * ratio) ** 2
            P[:, self._slips, self._slips] += own[:, :, None] * np.eye(self.axles)
        if axles.starts.any():
            self._start(axles.starts, np.sign(axles.adhesion))

    def _start(self, which: NDArray[np.bool_], sign: Array) -> None:
        """Axles pull for the first time: what is known before any measurement."""
        s, state = self.settings, self._state
        x, P = state.mean, state.covariance
        x[:, self._slips] = np.where(which, s.initial_slip * sign, x[:, self._slips])
        state.scale(self._slips, (~which).astype(np.float64))
        both = which[:, :, None] & which[:, None, :]
        P[:, self._slips, self._slips] += both * (
            s.initial_slip_std**2 + s.axle_slip_std**2 * np.eye(self.axles)
        )

    def _open(self, which: NDArray[np.bool_]) -> None:
        """Forget the slips of axles: they are on another surface, or spin."""
        state = self._state
        state.scale(self._slips, (~which).astype(np.float64))
        P = state.covariance
        spread = self.settings.jump_std**2 * np.eye(self.axles)
        P[:, self._slips, self._slips] += which[:, :, None] * spread

    def _measure(self, axles: AxleEfforts, y: Array, samples: int) -> NDArray[np.bool_]:
        """Take the wheel speeds in; returns under which axles the surface has changed."""
        s, state = self.settings, self._state
        settling = self._settling_s > 0
        self._settling_s = np.maximum(self._settling_s - s.block_s, 0.0)
        used = (axles.pulls & ~settling) | axles.free
        x = state.mean
        slip = x[:, self._slips]
        H = np.zeros((self.drives, self.axles, x.shape[1]))
        H[:, :, SPEED] = used
        rows = np.arange(self.axles)
        H[:, rows, FIRST_SLIP + rows] = used & axles.pulls
        H[:, rows, FIRST_SLIP + self.axles + rows] = -1.0 * used
        shown = np.where(axles.free, axles.adhesion * s.free_compliance, slip)
        predicted = x[:, SPEED, None] + shown - x[:, self._radii]
        innovation = np.where(used, y - predicted, 0.0)
        wheel = (s.wheel_std * self._radius / np.exp(x[:, SPEED, None])) ** 2 / samples
        # Small changes of the effort that the thresholds hide, and the contact's own unrest.
        unrest = (1e-4 + 0.01 * np.abs(slip)) ** 2
        lasting = (np.abs(axles.adhesion) * s.free_compliance_std) ** 2 + (
            s.adhesion_bias * s.free_compliance
        ) ** 2
        repeated = np.where(axles.free, RELIEF_BLOCKS * lasting, unrest)
        once = np.where(axles.free, lasting, unrest)
        gated = np.where(used, wheel + once, 1.0)
        change = self._gate(axles.pulls & ~settling, H, innovation, gated)
        used &= ~change
        H *= used[:, :, None]
        innovation = np.where(used, innovation, 0.0)
        state.update(H, innovation, np.where(used, wheel + repeated, 1.0))
        apparent = state.mean[:, self._slips] - state.mean[:, self._radii]
        steady = used & axles.pulls & (np.abs(axles.ratio - 1.0) < 1e-9)
        self._unrest.update(
            apparent, steady, change, self._axle_variance, wheel + unrest / 4, s.block_s
        )
        return change

    def _gate(
        self, judged: NDArray[np.bool_], H: Array, innovation: Array, R: Array
    ) -> NDArray[np.bool_]:
        """Open the slips of axles that deviate from what all others imply, the worst one first.

        S⁻¹e over the root of its diagonal is the deviation of each axle from its prediction by the
        others, in standard deviations (Cook and Weisberg 1982, deletion residuals). The axle is
        left out until it has settled.
        """
        state = self._state
        change = np.zeros((self.drives, self.axles), dtype=bool)
        H, innovation, R = H.copy(), innovation.copy(), R.copy()
        for _ in range(self.axles // 2):
            S = H @ state.covariance @ H.transpose(0, 2, 1) + R[:, :, None] * np.eye(self.axles)
            inverse = np.linalg.inv(S)
            signed = (inverse @ innovation[:, :, None])[:, :, 0]
            signed = signed / np.sqrt(np.diagonal(inverse, axis1=1, axis2=2))
            # A gradual change is small in each block, and has the same sign in all of them.
            mean = self._mean_score + MEAN_GAIN * (signed - self._mean_score)
            score = np.maximum(np.abs(signed), np.abs(mean) / MEAN_SCORE_STD)
            score = np.where(judged & ~change, score, 0.0)
            worst = score.argmax(axis=1)
            odd = score.max(axis=1) > self.settings.gate
            if not odd.any():
                break  # `mean` holds without the axles that deviate
            new = np.zeros_like(change)
            new[odd, worst[odd]] = True
            change |= new
            H[new], innovation[new], R[new] = 0.0, 0.0, 1.0
        self._mean_score = np.where(judged & ~change, mean, 0.0)
        if change.any():
            self._open(change)
            self._settling_s = np.where(change, self.settings.settling_s, self._settling_s)
        return change

    def _measure_others(self, dt: float) -> None:
        s, state = self.settings, self._state
        there = np.isfinite(self._gnss)
        if there.any():
            H = np.zeros((self.drives, 1, state.mean.shape[1]))
            H[:, 0, SPEED] = there
            shown = np.where(there, np.maximum(self._gnss, LOWEST_SPEED), 1.0)
            error = np.where(there, np.log(shown) - state.mean[:, SPEED], 0.0)
            R = np.where(there, (s.gnss_std / shown) ** 2, 1.0)
            state.update(H, error[:, None], R[:, None])
            self._reliefs.see_speed(there)
        total, count = self._acceleration
        there = count > 0
        if there.any():
            # The acceleration less that by forces is the disturbance.
            mass = self._locomotive.train_mass
            H = np.zeros((self.drives, 1, state.mean.shape[1]))
            H[:, 0, DISTURBANCE] = there
            shown = total / np.maximum(count, 1.0) - self._last_force / mass
            error = np.where(there, shown - state.mean[:, DISTURBANCE], 0.0)
            R = np.where(there, s.accelerometer_std**2 / dt, 1.0)
            state.update(H, error[:, None], R[:, None])

    def _share_curve(self, axles: AxleEfforts) -> None:
        """Once after the first relief: all axles share one curve, but for their levels.

        Not again: the levels are the same after a change, and would be counted twice.
        """
        s, state = self.settings, self._state
        now = self._reliefs.first_ended & ~self._alike
        if not now.any():
            return
        self._alike |= now
        x = state.mean
        reference = axles.mean
        p = x[:, ELASTICITY]
        pulled = np.isfinite(reference) & now[:, None]
        size = np.where(pulled, np.abs(reference), 1.0)
        count = np.maximum(pulled.sum(axis=1), 1)
        mean = np.exp((np.log(size) * pulled).sum(axis=1) / count)
        scale = np.where(pulled, (mean[:, None] / size) ** p[:, None], 0.0)
        part = scale[:, None, :] * np.eye(self.axles)
        part -= pulled[:, :, None] * scale[:, None, :] / count[:, None, None]
        H = np.zeros((self.drives, self.axles, x.shape[1]))
        H[:, :, self._slips] = part
        slip = np.abs((x[:, self._slips] * scale).sum(axis=1) / count)
        steep = p + np.sqrt(state.covariance[:, ELASTICITY, ELASTICITY])
        # The common slip may be larger than it seems by now.
        P = state.covariance[:, self._slips, self._slips]
        slip = slip + np.sqrt(np.mean(np.diagonal(P, axis1=1, axis2=2), axis=1))
        # An axle with a larger slip than the others is nearer to its peak, on a steeper curve.
        own = np.abs(x[:, self._slips]) / np.maximum(slip, 1e-4)[:, None]
        own = np.maximum(own, 1.0) ** 2
        R = (s.level_std * (steep * slip)[:, None] * own + 1e-4) ** 2
        error = -(H @ x[:, :, None])[:, :, 0]
        noise = np.where(pulled, R, 1.0)
        state.update(H, np.where(pulled, error, 0.0), noise)

    def _stated(
        self, axles: AxleEfforts, y: Array, speed: Array, white: float, samples: int
    ) -> ObservedSpeed:
        state, s = self._state, self.settings
        P = state.covariance
        variances = np.diagonal(P, axis1=1, axis2=2)
        # From speed and radii, so that it holds for an axle that spins or is on a ramp, too.
        x = state.mean
        slip = np.expm1(y + x[:, self._radii] - x[:, SPEED, None])
        cross = P[:, SPEED, self._radii]
        spread = variances[:, SPEED, None] - 2.0 * cross + variances[:, self._radii]
        wheel = s.wheel_std * self._radius / speed[:, None]
        slip_std = np.sqrt(np.maximum(spread, 0.0) + wheel**2 / samples)
        counted = ~axles.free
        n = np.maximum(counted.sum(axis=1), 1)
        overall = np.sqrt((np.where(counted, slip_std, 0.0) ** 2).sum(axis=1) / n)
        verdict = self._reliefs.judge(overall)
        return ObservedSpeed(
            speed=speed,
            white_variance=np.full(self.drives, white**2),
            slow_variance=variances[:, SPEED] * speed**2,
            slip=slip,
            slip_std=slip_std,
            radius_factor=np.exp(state.mean[:, self._radii]),
            since_relief_s=self._reliefs.since_relief_s.copy(),
            known=verdict.known,
            relief_wanted=verdict.wanted,
            reasons=verdict.reasons,
        )

    @property
    def _state(self) -> GaussianState:
        if self.state is None:
            raise RuntimeError("no block has ended yet")
        return self.state
