"""How speed, slips and radii move between two measurements, and what is known before the first."""

import numpy as np
from numpy.typing import NDArray

from adhesion_can.arrays import Array
from adhesion_can.estimation.observed_speed.axle_efforts import AxleEfforts
from adhesion_can.estimation.observed_speed.gaussian_state import GaussianState
from adhesion_can.estimation.observed_speed.hyperbola import elasticity, move
from adhesion_can.estimation.observed_speed.layout import (
    DISTURBANCE,
    LOG_HALF,
    LOWEST_SPEED,
    SPEED,
    SpeedStateLayout,
)
from adhesion_can.estimation.observed_speed.settings import ObservedSpeedSettings
from adhesion_can.physics.vehicle import GRAVITY, Locomotive
from adhesion_can.values import Stateful

SURGE_S = 0.7
"""Time constant with which a locomotive comes to rest on its coupler, s."""
WAVES_S, WAVE_S = 4.0, 1.0
"""Times for which waves run through a train, and for which one accelerates the locomotive, s."""
CALM_S = 1.5
"""Time constant with which an axle calms down after a change of the surface, s."""
TIME_SPEED = 10.0
"""Speed at which slips change as much in time as along the rail, m/s."""
MASS_S = 5.0
"""Time in which the disturbance acceleration follows what a wrong mass makes of a new force, s."""
LARGE_CHANGE = 0.05
"""Change of ln μ that no noise makes, 1."""
LARGEST_FACTOR = 2.0
"""Largest factor of the slips' standard deviation in a step along the curve, 1."""


class Motion(Stateful):
    """Prediction step of the filter."""

    def __init__(
        self, locomotive: Locomotive, settings: ObservedSpeedSettings, drives: int
    ) -> None:
        self._settings = settings
        self._layout = SpeedStateLayout(locomotive.axles)
        radius = np.asarray(locomotive.wheel_radius)
        rotating = locomotive.wheelset_inertia * float(np.sum(1.0 / radius**2))
        self.mass = locomotive.train_mass + rotating
        """Mass of the train with its rotating parts, kg."""
        self._own_mass = float(np.sum(locomotive.axle_load)) / GRAVITY
        load = float(np.mean(locomotive.axle_load))
        self._force_noise = settings.effort_std * load * np.sqrt(locomotive.axles)
        self.last_force = np.zeros(drives)
        """Force of all axles in the last block, N."""
        self._mean_force = np.zeros(drives)
        self._surge = np.zeros(drives)
        self._waves = np.zeros(drives)
        self._excitement = np.zeros((drives, locomotive.axles))
        self._pending = np.zeros((drives, locomotive.axles))
        self._beyond = np.zeros(drives)
        self.log_half = float(np.log(settings.half_slip))
        """ln a before a ramp has shown it."""

    def first_state(self, rim: Array) -> GaussianState:
        """State before any measurement, at rim speeds (m/s, shape (drives, axles))."""
        s, layout, drives = self._settings, self._layout, len(rim)
        mean = np.zeros((drives, layout.size))
        mean[:, SPEED] = np.log(np.median(rim, axis=1))
        mean[:, LOG_HALF] = self.log_half
        P = np.zeros((drives, layout.size, layout.size))
        P[:, SPEED, SPEED] = 0.05**2
        P[:, DISTURBANCE, DISTURBANCE] = s.acceleration_std**2
        P[:, LOG_HALF, LOG_HALF] = s.half_std**2
        eye = np.eye(layout.axles)
        P[:, layout.slips, layout.slips] = s.axle_slip_std**2 * eye
        P[:, layout.radii, layout.radii] = s.radius_std**2 * eye
        return GaussianState(mean, P, considered=LOG_HALF)

    def predict(self, state: GaussianState, axles: AxleEfforts, force: Array, dt: float) -> None:
        """Let a block of `dt` seconds pass under a force of all axles, N, shape (drives,)."""
        s, layout = self._settings, self._layout
        x, P = state.mean, state.covariance
        speed = np.maximum(np.exp(x[:, SPEED]), LOWEST_SPEED)
        x[:, SPEED] += dt * (force / self.mass + x[:, DISTURBANCE]) / speed
        state.add_row(SPEED, DISTURBANCE, dt / speed)
        if (axles.ratio != 1.0).any():
            self._move_along_curve(state, axles)
        if axles.starts.any():
            self._start(state, axles)
        P[:, SPEED, SPEED] += (s.speed_wander**2 * dt + self._couplers(force, dt)) / speed**2
        way = np.sqrt(speed * dt / 100.0)
        P[:, DISTURBANCE, DISTURBANCE] += (s.acceleration_wander * way) ** 2
        # The level of the rail wanders for all axles, and for each of them: along the rail, and in
        # time by effort, speed and weather.
        way = np.sqrt((speed + TIME_SPEED) * dt / 100.0)
        std = np.sqrt(np.diagonal(P, axis1=1, axis2=2)[:, layout.slips])
        size = np.hypot(x[:, layout.slips], np.minimum(std, 0.005))
        size = size * self.steepness(state, size) * way[:, None]
        self._excitement *= np.exp(-dt / CALM_S)
        excited = s.excited_wander * np.sqrt(dt) * self._excitement
        eye = np.eye(layout.axles)
        P[:, layout.slips, layout.slips] += (
            s.level_wander**2 * size[:, :, None] * size[:, None, :]
            + (s.axle_wander * size)[:, :, None] ** 2 * eye
            + excited[:, :, None] * excited[:, None, :] * (1.0 + eye)
        )
        P[:, layout.radii, layout.radii] += s.radius_wander**2 * dt * eye

    def open_slips(self, state: GaussianState, which: NDArray[np.bool_]) -> None:
        """Forget the slips of axles, which are on another surface or spin.

        Args:
            state: State, which is changed.
            which: Axles, shape (drives, axles).

        """
        slips = self._layout.slips
        state.scale(slips, (~which).astype(np.float64))
        spread = self._settings.jump_std**2 * np.eye(self._layout.axles)
        state.covariance[:, slips, slips] += which[:, :, None] * spread
        self._excitement = np.where(which, 1.0, self._excitement)

    def _couplers(self, force: Array, dt: float) -> Array:
        """Variance of the speed in a block by couplers, m²/s².

        A change of the effort makes the locomotive swing on its coupler for a second, and waves run
        through the train for several.
        """
        s = self._settings
        change = np.maximum(np.abs(force - self.last_force) - self._force_noise, 0.0)
        self.last_force = force
        self._surge = self._surge * np.exp(-dt / SURGE_S)
        self._surge += s.surge_share * change / (self._own_mass * s.coupler_frequency)
        self._waves = self._waves * np.exp(-dt / WAVES_S) + change / self.mass
        swing = (self._surge * s.coupler_frequency * dt) ** 2
        # The disturbance holds what the mass is wrong by at the mean force, and no more.
        self._mean_force = self._mean_force + (force - self._mean_force) * (dt / MASS_S)
        wrong = s.mass_std * (force - self._mean_force) / self.mass
        return np.asarray(swing + (self._waves**2 * WAVE_S + wrong**2 * MASS_S) * dt)

    def steepness(self, state: GaussianState, slip: Array) -> Array:
        """Elasticity at slips, 1, by a curve that bends as much as it may, (drives, axles)."""
        std = np.sqrt(state.covariance[:, LOG_HALF, LOG_HALF])
        return elasticity(slip, (state.mean[:, LOG_HALF] - std)[:, None])

    def _move_along_curve(self, state: GaussianState, axles: AxleEfforts) -> None:
        """Slips follow efforts along the curve.

        The covariance follows in steps that no noise makes. Were it scaled with each small change,
        wheels that do not follow would pull the slips to zero (errors in variables).
        """
        s, slips = self._settings, self._layout.slips
        x, P = state.mean, state.covariance
        ratio = np.clip(np.abs(axles.ratio), 1e-3, 1e3)
        turned = np.where(axles.ratio < 0, -1.0, 1.0)
        half = x[:, LOG_HALF, None]
        x[:, slips] = move(x[:, slips], half, ratio).slip * turned
        self._pending = self._pending + np.log(ratio)
        P[:, slips, slips] *= turned[:, :, None] * turned[:, None, :]
        way = np.median(self._pending, axis=1, keepdims=True)
        axle_way = self._pending - way
        way = np.where(np.abs(way) > LARGE_CHANGE, way, 0.0)
        axle_way = np.where(np.abs(axle_way) > LARGE_CHANGE, axle_way, 0.0)
        self._pending = self._pending - way - axle_way
        if not (way.any() or axle_way.any()):
            return
        n = self._layout.axles
        apart = np.abs(move(x[:, slips], half, np.exp(axle_way)).slip - x[:, slips])
        apart = np.minimum(apart, s.initial_slip)
        P[:, slips, slips] += apart[:, :, None] ** 2 * np.eye(n)
        # A slip that was estimated as too small would make its own change look certain.
        least = s.free_compliance * np.abs(axles.mean) * np.exp(-way)
        least = np.where(np.isfinite(least), least, 0.0)
        before = np.abs(move(x[:, slips], half, np.exp(-way)).slip)
        moved = move(np.maximum(before, least), half, np.exp(way))
        # All axles alike: were each moved by its own elasticity, differences between wheels would
        # seem to show the curve, of which the axles are not at the places that the model has.
        factor = np.minimum(moved.by_slip.mean(axis=1, keepdims=True), LARGEST_FACTOR)
        state.scale(slips, np.repeat(factor, n, axis=1))
        shown = np.sign(x[:, slips]) * moved.by_log_half.mean(axis=1, keepdims=True)
        state.add_row(slips, LOG_HALF, shown)
        change = (moved.slip - np.maximum(before, least)).mean(axis=1)[:, None, None]
        change = np.clip(change, -s.initial_slip, s.initial_slip)
        spread = s.form_std**2 + s.apart_std**2 * (np.eye(n) - 1.0 / n)
        P[:, slips, slips] += change**2 * spread
        way = way[:, 0]
        # No slip is less known than after a change of the surface.
        std = np.sqrt(np.diagonal(P, axis1=1, axis2=2)[:, slips])
        state.scale(slips, np.minimum(1.0, s.jump_std / np.maximum(std, 1e-9)))
        P[:, LOG_HALF, LOG_HALF] += s.half_wander**2 * np.abs(way)

    def go_beyond(self, state: GaussianState, beyond: Array) -> None:
        """Efforts are by `beyond` (ln μ, shape (drives,)) above what any relief has shown."""
        s, slips = self._settings, self._layout.slips
        more = np.maximum(beyond**2 - self._beyond**2, 0.0)
        self._beyond = np.where(beyond > 0, np.maximum(self._beyond, beyond), 0.0)
        if (more > 0).any():
            size = np.mean(np.abs(state.mean[:, slips]), axis=1) ** 2 * s.beyond**2 * more
            state.covariance[:, slips, slips] += size[:, None, None]

    def see_curve(self, state: GaussianState, drive: int, log_half: float, variance: float) -> None:
        """A ramp of a drive has shown ln a, with a variance."""
        H = np.zeros((len(state.mean), 1, self._layout.size))
        H[drive, 0, LOG_HALF] = 1.0
        error = np.zeros((len(state.mean), 1))
        error[drive] = log_half - state.mean[drive, LOG_HALF]
        state.update(H, error, np.where(error == 0.0, 1.0, variance), learns=True)

    def forget_curve(self, state: GaussianState, which: NDArray[np.bool_]) -> None:
        """Drives `which` are on another surface: no ramp has shown its curve."""
        state.mean[:, LOG_HALF] = np.where(which, self.log_half, state.mean[:, LOG_HALF])
        state.scale(slice(LOG_HALF, LOG_HALF + 1), (~which[:, None]).astype(np.float64))
        state.covariance[:, LOG_HALF, LOG_HALF] += which * self._settings.half_std**2

    def _start(self, state: GaussianState, axles: AxleEfforts) -> None:
        """Axles pull for the first time: their slips are those of an unknown curve."""
        s, slips, which = self._settings, self._layout.slips, axles.starts
        first = s.initial_slip * np.sign(axles.adhesion)
        state.mean[:, slips] = np.where(which, first, state.mean[:, slips])
        state.scale(slips, (~which).astype(np.float64))
        both = which[:, :, None] & which[:, None, :]
        eye = np.eye(self._layout.axles)
        spread = s.initial_slip_std**2 + s.axle_slip_std**2 * eye
        state.covariance[:, slips, slips] += both * spread
