"""Excursions: one axle at a time leaves the held slip, so that the curve stays known.

A drive that holds one slip learns one point of the curve (dual control; Feldbaum, Autom. Remote
Control 21, 1960). Near the peak an excursion of relative size d costs force with d² and shows the
place of the peak with d⁴: few large ones of one axle cost less than small ones of all. The lower
plateau shows the rise of the curve, the upper one, beyond the peak, its fall.

Both plateaus are also held against the curve: adhesion of the axle on one less that on the other,
less the same of the axles that hold their slip meanwhile, which takes out what the rail does.
"""

from bisect import bisect_right

import numpy as np

from adhesion_can.arrays import Array
from adhesion_can.control.inputs import KnownCurve, Measurement
from adhesion_can.control.mean_adhesion import MeanAdhesion
from adhesion_can.control.settings import ExcursionSettings
from adhesion_can.physics.burckhardt import peak

CORNERS = (0.0, 0.1, 0.3, 0.4, 0.9, 1.0)
"""Corners of an excursion, shares of its duration: down, lower plateau, up, upper plateau, back."""
MEASURED = (0.17, 0.3, 0.5, 0.9)
"""Start and end of what counts of the lower and of the upper plateau, likewise."""
LEAST_STEPS = 5
"""Least number of steps of a plateau that counts."""
SIGNIFICANCE = 4.0
"""Smallest difference that contradicts a curve, standard errors."""


class Excursions:
    """Slips of all axles while a curve is held.

    Args:
        settings: Sizes and times.
        mass: Inertia of a wheelset at its rim, J/r², kg, shape (axles,).

    """

    def __init__(self, settings: ExcursionSettings, mass: Array) -> None:
        self._settings = settings
        self._axles = len(mass)
        # Neighbours do not follow each other: a patch of the rail has both of them.
        self._order = [*range(0, self._axles, 2), *range(1, self._axles, 2)]
        self._plateaus = MeanAdhesion(mass), MeanAdhesion(mass)
        self._turn = 0
        self.begin(0.0)

    def begin(self, time_s: float) -> None:
        """Start again; the turn of the axles goes on."""
        self._next_s = time_s + self._settings.duration_s / 4
        self._since_s: float | None = None
        self._contradictions = 0

    @property
    def is_contradicted(self) -> bool:
        """Whether the latest excursions contradict the curve."""
        return self._contradictions >= self._settings.contradictions

    @property
    def axle(self) -> int | None:
        """Number of the axle on an excursion; None where none is."""
        return None if self._since_s is None else self._order[self._turn] + 1

    def step(
        self,
        measured: Measurement,
        slip: Array,
        held: Array,
        peak_slip: float,
        *,
        curve: KnownCurve | None,
        known: bool,
    ) -> Array:
        """Slip ratio that each axle is to have, shape (axles,).

        Args:
            measured: Measured state.
            slip: Measured slip ratio of each axle, shape (axles,).
            held: Slip ratio that the axles hold, shape (axles,).
            peak_slip: Slip ratio of the peak as far as it is known.
            curve: Curve that is held; None: a search goes on, and nothing is contradicted.
            known: Whether the service knows the peak.

        """
        s, now_s = self._settings, measured.time_s
        if self._since_s is None:
            if now_s < self._next_s:
                return held
            self._since_s = now_s
            for plateau in self._plateaus:
                plateau.restart()
        part = (now_s - self._since_s) / s.duration_s
        place = self._order[self._turn]
        if part >= 1.0:
            if curve is not None:
                self._compare(curve, place)
            period_s = s.period_s if known else s.busy_period_s
            self._next_s = self._since_s + max(period_s, s.duration_s)
            self._since_s, self._turn = None, (self._turn + 1) % self._axles
            return held
        phase = bisect_right(MEASURED, part)
        if phase in (1, 3):
            self._plateaus[phase // 2].add(measured, slip)
        low, high = s.low * peak_slip, s.high * peak_slip
        held_slip = held[place]
        wanted = held.copy()
        wanted[place] = np.interp(part, CORNERS, (held_slip, low, low, high, high, held_slip))
        return wanted

    def _compare(self, curve: KnownCurve, place: int) -> None:
        """Hold the contrast of the plateaus against the curve's."""
        low, high = self._plateaus
        if min(low.steps, high.steps) < LEAST_STEPS:
            return
        change = low.adhesion() - high.adhesion()
        others = np.arange(self._axles) != place
        contrast = change[place] - np.nanmedian(change[others])
        expected = curve.adhesion(low.slip()[place]) - curve.adhesion(high.slip()[place])
        top = float(peak(*curve.theta).mu_max)
        error = np.hypot(low.standard_error()[place], high.standard_error()[place])
        allowed = max(self._settings.contradiction * top, SIGNIFICANCE * float(error))
        within = not abs(float(contrast - expected)) > allowed
        self._contradictions = 0 if within else self._contradictions + 1
