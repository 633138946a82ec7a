"""Reference creep controller: the service's slip where it is trusted, a search where it is not.

    SLOW    the train hardly moves: a small slip is held, speeds are too inexact for more
    SEARCH  the slip of the peak is searched by pairs of axles, without any model
    HOLD    the service's curve is held near its peak, with excursions that keep it known
    STEADY  the creep speeds swing: one slip for all axles, which climbs slowly

From SEARCH to HOLD: the service states λ_m with a small standard deviation and without doubt, and
it agrees with what the search found. Back: it states it no longer, or excursions contradict it.
So a setpoint that is wrong with confidence is never followed alone.

Beside these, one axle after the other is relieved of its effort where the vehicle speed has to be
seen by that (`reliefs.py`; off by default).
"""

from enum import Enum

import numpy as np
from numpy.typing import NDArray

from adhesion_can.arrays import Array
from adhesion_can.control.creep_loop import CreepLoop
from adhesion_can.control.excursions import Excursions
from adhesion_can.control.gradient_search import PairedGradientSearch
from adhesion_can.control.inputs import Advice, KnownCurve, Measurement
from adhesion_can.control.reliefs import Reliefs, spread_effort
from adhesion_can.control.settings import ControlSettings
from adhesion_can.control.speed_filter import SpeedFilter
from adhesion_can.control.swing_guard import SwingGuard
from adhesion_can.physics.status import Status
from adhesion_can.physics.vehicle import Locomotive

CONVERGED = 0.25
"""Elasticity below which the search is near the peak."""
FOUND_SHARE = 0.85
"""Slip that the search finds over that of the peak, about."""
SHORT_STEP = 0.3
"""Largest step of a search that starts near the peak, logarithm."""
OTHER_CURVE = 0.2
"""Logarithm of the ratio of two peaks' slips from which they are of different curves."""
SLOW_ELASTICITY = 0.25
"""Elasticity that is assumed where nothing is searched."""
SLOW_RATE = 0.1
"""Rate at which the slip rises from rest, 1/s."""
SPINNING, SPIN_CREEP = 3.0, 0.05
"""Multiple of the setpoint and creep speed, m/s, beyond which a train at rest takes less slip."""


class Mode(Enum):
    """What the controller goes by; the value is the text about it."""

    WAITING = "the vehicle speed is not available: no effort is demanded"
    SLOW = "the train hardly moves: holding a small slip"
    SEARCH = "searching for the peak with pairs of axles"
    HOLD = "holding the service's slip"
    STEADY = "creep speeds oscillate: one slip for all axles, rising slowly"


FROM_REST = (Mode.WAITING, Mode.SLOW)
"""Modes in which no peak is searched: a search that follows starts again."""


class CreepController:
    """Efforts of all axles in traction.

    Args:
        vehicle: Vehicle, whose wheelsets have an inertia and of which there are two or more.
        settings: Settings.

    Raises:
        ValueError: The vehicle has one axle, or wheelsets without inertia.

    """

    def __init__(self, vehicle: Locomotive, settings: ControlSettings | None = None) -> None:
        if vehicle.axles < 2:
            raise ValueError("a vehicle with one driven axle has no pair to search with")
        if not vehicle.wheelset_inertia > 0.0:
            raise ValueError("the wheelsets have no inertia to control")
        self._settings = settings or ControlSettings()
        mass = vehicle.wheelset_inertia / np.array(vehicle.wheel_radius) ** 2
        s = self._settings
        self.mode = Mode.WAITING
        """What the controller goes by now."""
        self._axles = vehicle.axles
        self._speed = SpeedFilter(s.speed_timeout_s)
        self._loop = CreepLoop(s.loop, mass)
        self._search = PairedGradientSearch(s.search, mass)
        self._excursions = Excursions(s.excursions, mass)
        self._reliefs = Reliefs(s.reliefs, vehicle.axles)
        self._swing = SwingGuard(s.swing, s.loop.cycle_s)
        self._slow_slip, self._slow_top = 0.0, s.slow_slip
        self._rising = True
        self._distrusted: tuple[float, float] | None = None
        """Slip ratio of a contradicted peak, and the time until which it is not held, s."""
        self.slip: Array = np.zeros(vehicle.axles)
        """Slip ratio that each axle is to have, shape (axles,)."""

    @property
    def excursion(self) -> int | None:
        """Number of the axle on an excursion; None where none is."""
        return self._excursions.axle

    @property
    def relieved(self) -> int | None:
        """Number of the axle that is relieved; None where none is."""
        return self._reliefs.axle

    def step(self, measured: Measurement, advice: Advice) -> Array:
        """Efforts to demand, N, shape (axles,), as `EffortController.step` defines it."""
        at_own_slips = self.mode in (Mode.SEARCH, Mode.HOLD) and not self._rising
        shares = self._reliefs.step(
            measured.time_s,
            self._loop.effort,
            asked=advice.relief_wanted,
            changing=advice.status is Status.SURFACE_CHANGE,
            allowed=at_own_slips and self.excursion is None,
        )
        effort = self._pull(measured, advice, shares < 1.0)
        # Axles that hold the peak's slip have nothing to take over.
        return effort if np.all(shares == 1.0) else spread_effort(effort, shares, effort)

    def _pull(self, measured: Measurement, advice: Advice, relieved: NDArray[np.bool_]) -> Array:
        """Efforts without reliefs; that of a relieved axle is kept for its return."""
        speed = self._speed.step(measured)
        if speed is None:
            self._begin_slow(Mode.WAITING)
            return self._loop.release()
        creep = measured.rim_speed - speed
        # A relieved axle is controlled as if it kept its slip, so that it finds its effort again.
        creep = np.where(relieved, self.slip * speed, creep)
        if speed < self._settings.slow_speed:
            return self._pull_slowly(speed, creep)
        slip = creep / speed
        if self._holds_still(measured, self.slip * speed, creep):
            self.slip = np.full(self._axles, self._swing.slip)
            return self._loop.step(self.slip * speed, creep, SLOW_ELASTICITY)
        curve = advice.trusted_curve(self._settings.trusted_std)
        self._choose_mode(measured.time_s, curve)
        if self.mode is Mode.HOLD and curve is not None:
            held = curve.slips(self._settings.target_share, self._axles)
            held = held * (1.0 - self._settings.caution * curve.std)
            known = advice.status is Status.TRACKING
            self.slip = held
            if self.relieved is None:
                self.slip = self._excursions.step(
                    measured, slip, held, curve.lambda_m, curve=curve, known=known
                )
            return self._loop.step(self.slip * speed, creep, curve.elasticity(self.slip))
        if self._rising:
            self.slip = self._rise(measured.time_s)
        else:
            self.slip = self._search_on(measured, slip)
        return self._loop.step(self.slip * speed, creep, self._search.elasticity)

    def _holds_still(self, measured: Measurement, setpoint: Array, creep: Array) -> bool:
        """Whether the creep speeds swing, so that one slip is held for all."""
        guard = self._swing
        if self.mode not in FROM_REST and not self._rising:
            guard.step(measured, setpoint, creep, float(np.median(self.slip)))
        self._loop.bandwidth_share = guard.bandwidth_share
        if guard.holds:
            self.mode = Mode.STEADY
        elif self.mode is Mode.STEADY:
            self.mode = Mode.SEARCH
            self._search.begin(measured.time_s, guard.slip, SHORT_STEP)
        return guard.holds

    def _search_on(self, measured: Measurement, slip: Array) -> Array:
        """Slips of the search; near the peak one axle goes on an excursion now and then.

        So the service learns the curve and can state its peak.
        """
        if self.relieved is not None:
            return self._search.step(measured, slip, busy_axle=self.relieved)
        busy = self._excursions.axle
        wanted = self._search.step(measured, slip, busy_axle=busy)
        if busy is None and not self._search.is_near:
            self._excursions.begin(measured.time_s)
            return wanted
        peak_slip = self._search.slip / FOUND_SHARE
        return self._excursions.step(measured, slip, wanted, peak_slip, curve=None, known=True)

    def _choose_mode(self, time_s: float, curve: KnownCurve | None) -> None:
        s = self._settings
        if self.mode in FROM_REST:
            self.mode = Mode.SEARCH
            self._rising = self._slow_slip < s.first_slip
            self._search.begin(time_s, max(self._slow_slip, s.first_slip), SHORT_STEP)
        if self.mode is Mode.HOLD:
            if curve is None or self._excursions.is_contradicted:
                if curve is not None:
                    self._distrusted = curve.lambda_m, time_s + s.distrust_s
                self.mode = Mode.SEARCH
                self._search.begin(time_s, float(np.median(self.slip)), SHORT_STEP)
        elif curve is not None and not self._rising and self._search.elasticity < CONVERGED:
            ratio = np.median(curve.slips(s.target_share, self._axles)) / self._search.slip
            if abs(np.log(ratio)) < s.agreement and not self._is_distrusted(curve, time_s):
                self.mode = Mode.HOLD
                self._excursions.begin(time_s)

    def _is_distrusted(self, curve: KnownCurve, time_s: float) -> bool:
        """Whether excursions have contradicted this curve not long ago."""
        if self._distrusted is None:
            return False
        slip, until_s = self._distrusted
        return time_s < until_s and bool(abs(np.log(curve.lambda_m / slip)) < OTHER_CURVE)

    def _rise(self, time_s: float) -> Array:
        """Slips on the way to that at which the search starts."""
        s = self._settings
        self._slow_slip = min(self._slow_slip + s.first_rate * s.loop.cycle_s, s.first_slip)
        if self._slow_slip >= s.first_slip:
            self._rising = False
            self._search.begin(time_s, s.first_slip, s.search.step_max)
        spread = np.where(np.arange(self._axles) % 2 == 0, 1.0, -1.0) * s.search.spread
        return np.asarray(self._slow_slip * (1.0 + spread))

    def _pull_slowly(self, speed: float, creep: Array) -> Array:
        s = self._settings
        if self.mode is not Mode.SLOW:
            self._begin_slow(Mode.SLOW)
        scale = max(speed, s.slow_floor)
        rise = SLOW_RATE * s.loop.cycle_s
        self._slow_slip = min(self._slow_slip + rise, self._slow_top)
        if np.nanmedian(creep) > SPINNING * self._slow_top * scale + SPIN_CREEP:
            self._slow_top = max(0.8 * self._slow_top, s.search.slip_min)
            self._slow_slip = SHORT_STEP * self._slow_top
        self.slip = np.full(self._axles, self._slow_slip)
        return self._loop.step(self.slip * scale, creep, SLOW_ELASTICITY)

    def _begin_slow(self, mode: Mode) -> None:
        """Start from rest, in a mode in which no peak is searched."""
        self.mode = mode
        self._slow_slip, self._slow_top = 0.0, self._settings.slow_slip
