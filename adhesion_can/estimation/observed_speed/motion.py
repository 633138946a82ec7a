"""How speed, slips and radii move between two measurements, and what is known before the first."""

import numpy as np
from numpy.typing import NDArray

from adhesion_can.arrays import Array
from adhesion_can.estimation.observed_speed.axle_efforts import AxleEfforts
from adhesion_can.estimation.observed_speed.gaussian_state import GaussianState
from adhesion_can.estimation.observed_speed.layout import (
    DISTURBANCE,
    ELASTICITY,
    LOWEST_SPEED,
    REPEATED_BLOCKS,
    SPEED,
    SpeedStateLayout,
)
from adhesion_can.estimation.observed_speed.settings import ObservedSpeedSettings
from adhesion_can.physics.vehicle import GRAVITY, Locomotive

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
LARGE_CHANGE = 0.1
"""Change of ln μ in a block that no noise makes, 1."""


class Motion:
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

    def first_state(self, rim: Array) -> GaussianState:
        """State before any measurement, at rim speeds (m/s, shape (drives, axles))."""
        s, layout, drives = self._settings, self._layout, len(rim)
        mean = np.zeros((drives, layout.size))
        mean[:, SPEED] = np.log(np.median(rim, axis=1))
        mean[:, ELASTICITY] = s.elasticity
        P = np.zeros((drives, layout.size, layout.size))
        P[:, SPEED, SPEED] = 0.05**2
        P[:, DISTURBANCE, DISTURBANCE] = s.acceleration_std**2
        P[:, ELASTICITY, ELASTICITY] = s.elasticity_std**2
        eye = np.eye(layout.axles)
        P[:, layout.slips, layout.slips] = s.axle_slip_std**2 * eye
        P[:, layout.radii, layout.radii] = s.radius_std**2 * eye
        return GaussianState(mean, P, considered=ELASTICITY)

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
        steep = x[:, ELASTICITY] + np.sqrt(P[:, ELASTICITY, ELASTICITY])
        std = np.sqrt(np.diagonal(P, axis1=1, axis2=2)[:, layout.slips])
        size = np.hypot(x[:, layout.slips], np.minimum(std, 0.005))
        size = size * np.maximum(steep, 1.0)[:, None] * way[:, None]
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

    def _move_along_curve(self, state: GaussianState, axles: AxleEfforts) -> None:
        """Slips follow efforts, dλ = p λ d ln μ; the elasticity p differs further on."""
        s, slips = self._settings, self._layout.slips
        x, P = state.mean, state.covariance
        ratio = np.log(np.clip(np.abs(axles.ratio), 1e-3, 1e3))
        factor = np.exp(np.maximum(x[:, ELASTICITY, None], 0.5) * ratio)
        factor = np.clip(factor, 0.05, 20.0) * np.where(axles.ratio < 0, -1.0, 1.0)
        slip = x[:, slips] * factor
        x[:, slips] = slip
        # A small change may be noise of the effort. Were the covariance scaled with it, wheels that
        # do not follow would pull the slip to zero (errors in variables).
        large = np.abs(ratio) > LARGE_CHANGE
        variance = np.diagonal(P, axis1=1, axis2=2)[:, slips]
        noise = np.where(large, 0.0, variance * (factor - 1.0) ** 2)
        # A slip that was estimated as too small would make its own change look certain.
        least = s.free_compliance * np.abs(axles.mean)
        size = np.maximum(np.abs(slip), np.where(np.isfinite(least), least, 0.0))
        state.scale(slips, np.where(large, factor, 1.0))
        state.add_row(slips, ELASTICITY, np.copysign(size, slip) * ratio)
        # The axles are at different places of the curve, and stay there for many blocks.
        noise += REPEATED_BLOCKS * (s.elasticity_std * size * ratio) ** 2
        P[:, slips, slips] += noise[:, :, None] * np.eye(self._layout.axles)
        # An Ornstein-Uhlenbeck process in ln μ.
        keep = np.exp(-np.median(np.abs(ratio), axis=1))
        x[:, ELASTICITY] = s.elasticity + keep * (x[:, ELASTICITY] - s.elasticity)
        state.scale(slice(ELASTICITY, ELASTICITY + 1), keep[:, None])
        P[:, ELASTICITY, ELASTICITY] += (1.0 - keep**2) * s.elasticity_std**2

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
