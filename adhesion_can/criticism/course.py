"""One recording as columns on which every equation can be written down, with any instruments.

A row stands at each reading of an axle's effort, which is the noisy one: the smooth kinematics are
brought to its stamp, never the other way round, since interpolation would change the noise with
the delay that is looked for. Rows of one axle stand together, in the order of their stamps.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.signal import savgol_coeffs, savgol_filter

from adhesion_can.identification.traces import Trace
from adhesion_can.physics.burckhardt import Array
from adhesion_can.physics.instruments import PERFECT, Instruments
from adhesion_can.physics.vehicle import Locomotive

SPEED_WINDOWS_S = (0.3, 0.6, 1.0, 1.5, 2.2, 3.0)
"""Over one of these a parabola smooths what the efforts leave of the vehicle speed."""
WHEEL_WINDOWS_S = (0.05, 0.09)
EFFORT_WINDOWS_S = (0.15,)
DELAY_MAX = {"speed": 1.0, "effort": 0.5}
"""s; rows need kinematics so far around them."""
ROUGH_S = 0.4
GAP_CYCLES = 3.0


class Kinematics(NamedTuple):
    """Of each row: rad/s, rad/s², m/s, N, and the wheel speed's doubt, m/s; shape (n,)."""

    wheel_speed: Array
    wheel_accel: Array
    speed: Array
    load: Array
    wheel_std: Array


class Observed(NamedTuple):
    """What the equations see in each row with given instruments: shape (n,) each."""

    slip: Array
    creep_speed: Array
    speed: Array
    load: Array
    adhesion: Array


class Smooth(NamedTuple):
    """A signal smoothed: stamps, s, value, rate of change, std of the value, gaps, window, s."""

    t_s: Array
    value: Array
    rate: Array
    std: float
    breaks: Array
    window_s: float = 0.0


@dataclass(frozen=True, eq=False)
class Course:
    """Rows of one recording, axle after axle.

    Attributes:
        name: of the recording.
        t_s: stamps since its first row, s.
        axle: numbers, 1...
        place: of the axle, counted from the leading one.
        effort: as read, N.
        covariates: other channels by name.
        radius: configured, by axle, m.
        inertia: configured, kg·m².
        position: way travelled, m.
        source: gives kinematics with delays.
        first_us: stamp of time 0.
        clock_s: time of each row where `t_s` is not it: a TABLE's stretches are set well apart.
        lost: rows that were not formed, by reason.
        table: whether it is a TABLE, with slip and adhesion as they stand there.
        has_speed: whether the speed is known.
        has_load: whether the load is known.

    """

    name: str
    t_s: Array
    axle: NDArray[np.int64]
    place: Array
    effort: Array
    covariates: Mapping[str, Array]
    radius: Array
    inertia: float
    position: Array
    source: "Source"
    first_us: int = 0
    clock_s: Array | None = None
    lost: Mapping[str, int] = field(default_factory=dict)
    table: bool = False
    has_speed: bool = True
    has_load: bool = True

    def __len__(self) -> int:
        return len(self.t_s)

    @property
    def time_s(self) -> Array:
        """Time of each row since the first one, s; shape (n,)."""
        return self.t_s if self.clock_s is None else self.clock_s

    def observe(self, instruments: Instruments = PERFECT) -> Observed:
        """Eq. 1-3 in every row."""
        k = self.source(instruments.speed_delay, instruments.effort_delay)
        factor = instruments.radius_factor(len(self.radius))
        radius = (self.radius * factor)[self.axle - 1]
        speed = k.speed / (1.0 + instruments.speed_error)
        creep = radius * k.wheel_speed - speed
        inertia = self.inertia + instruments.inertia_error
        force = self.effort - instruments.effort_bias - inertia * k.wheel_accel / radius
        return Observed(creep / speed, creep, speed, k.load, force / k.load)

    def rows(self, kept: NDArray[np.bool_] | slice) -> "Course":
        """The same recording with some of its rows."""
        axle, t_s = self.axle[kept], self.t_s[kept]
        return replace(
            self,
            t_s=t_s,
            axle=axle,
            place=self.place[kept],
            effort=self.effort[kept],
            covariates={name: column[kept] for name, column in self.covariates.items()},
            position=self.position[kept],
            clock_s=None if self.clock_s is None else self.clock_s[kept],
            source=self.source.at_rows(axle, t_s),
        )

    @property
    def wheel_slip_std(self) -> Array:
        """Standard deviation of the slip from the wheel speed, an axle's own; shape (n,)."""
        k = self.source(0.0, 0.0)
        return k.wheel_std / np.maximum(k.speed, 1e-3)

    @property
    def speed_doubt(self) -> tuple[float, float]:
        """Standard deviation of the vehicle speed, m/s, and the time over which it lasts, s."""
        return self.source.speed_doubt


class Source:
    """Kinematics at the rows for any delays; the last few are kept.

    Attributes:
        rough: by axle, stamps and what smoothing takes off the wheel speed's fast part, rad/s.

    """

    def __init__(self, axles: NDArray[np.int64], t_s: Array, signals: "Signals") -> None:
        self._axles, self._t_s, self._signals = axles, t_s, signals
        self.rough = signals.rough
        self._cached = lru_cache(maxsize=6)(self._at)

    @property
    def speed_doubt(self) -> tuple[float, float]:
        """See `Course.speed_doubt`."""
        return self._signals.speed.std, self._signals.speed.window_s

    def at_rows(self, axles: NDArray[np.int64], t_s: Array) -> "Source":
        """Kinematics at other rows."""
        return Source(axles, t_s, self._signals)

    def __call__(self, speed_delay: float, effort_delay: float) -> Kinematics:
        """Kinematics at the moment at which the effort was measured.

        Args:
            speed_delay: of the vehicle speed, s.
            effort_delay: of the effort, s.

        """
        return self._cached(float(speed_delay), float(effort_delay))

    def _at(self, speed_delay: float, effort_delay: float) -> Kinematics:
        t, s = self._t_s - effort_delay, self._signals
        columns = np.empty((4, len(t)))
        wheel_std = np.empty(len(t))
        for axle, wheel in s.wheels.items():
            rows = self._axles == axle
            at = t[rows]
            columns[0, rows] = np.interp(at, wheel.t_s, wheel.value)
            columns[1, rows] = np.interp(at, wheel.t_s, wheel.rate)
            columns[2, rows] = np.interp(at + speed_delay, s.speed.t_s, s.speed.value)
            columns[3, rows] = s.load(axle, at)
            wheel_std[rows] = s.radius[axle - 1] * wheel.std
        return Kinematics(columns[0], columns[1], columns[2], columns[3], wheel_std)


@dataclass(frozen=True, eq=False)
class Signals:
    """The smooth signals of one recording.

    Attributes:
        wheels: by axle.
        speed: of the vehicle.
        loads: measured ones by axle, stamps in s and N.
        effort: smoothed, by axle, for the transfer of load where it is not measured.
        vehicle: configured.
        rough: see `Source`.

    """

    wheels: Mapping[int, Smooth]
    speed: Smooth
    loads: Mapping[int, tuple[Array, Array]]
    effort: Mapping[int, Smooth]
    vehicle: Locomotive
    rough: Mapping[int, tuple[Array, Array]] = field(default_factory=dict)

    @property
    def radius(self) -> Array:
        """Configured, by axle, m."""
        return np.array(self.vehicle.wheel_radius)

    def load(self, axle: int, t_s: Array) -> Array:
        """Load of an axle: measured, or static with the transfer of load."""
        if axle in self.loads:
            return np.interp(t_s, *self.loads[axle])
        static = self.vehicle.axle_load[axle - 1]
        geometry = self.vehicle.geometry
        if geometry is None or len(self.effort) < self.vehicle.axles:
            return np.full(len(t_s), static)
        share = geometry.load_transfer(np.eye(self.vehicle.axles))[:, axle - 1]
        moved = np.zeros(len(t_s))
        for other, smooth in self.effort.items():
            moved += share[other - 1] * np.interp(t_s, smooth.t_s, smooth.value)
        return static + moved


def smoothed(
    trace: Trace, origin_us: int, windows_s: Sequence[float], known: Array | None = None
) -> Smooth | None:
    """A trace smoothed by local parabolas, stretch by stretch; None where too little is there.

    Of several windows the one is taken that predicts best what it has not seen: each reading from
    its neighbours.

    Args:
        trace: readings; those not available are left out.
        origin_us: stamp of time 0.
        windows_s: widths to choose from, s; at least five readings are taken.
        known: a part of the signal that needs no smoothing, at the readings that are available.

    """
    good = np.isfinite(trace.value)
    t = (trace.t_us[good] - origin_us) / 1e6
    part_known = np.zeros(len(t)) if known is None else known
    raw = trace.value[good] - part_known
    if len(t) < 8:
        return None
    cycle = float(np.median(np.diff(t)))
    parts = np.split(np.arange(len(t)), np.flatnonzero(np.diff(t) > GAP_CYCLES * cycle) + 1)
    longest = max(len(part) for part in parts)
    counts = sorted({max(round(window / cycle / 2) * 2 + 1, 5) for window in windows_s})
    best: tuple[float, Array, Array, float, float] | None = None
    for points in counts:
        if points > longest:
            continue
        value, rate = np.full(len(raw), np.nan), np.full(len(raw), np.nan)
        for part in parts:
            if len(part) >= points:
                value[part] = savgol_filter(raw[part], points, 2)
                rate[part] = savgol_filter(raw[part], points, 2, deriv=1, delta=cycle)
        centre = float(savgol_coeffs(points, 2)[points // 2])
        error = float(np.nanmean((raw - value) ** 2))
        unseen = error / (1.0 - centre) ** 2
        if best is None or unseen < best[0]:
            std = float(np.sqrt(error * centre / (1.0 - centre)))
            best = unseen, value, rate, std, points * cycle
    if best is None:
        return None
    _, value, rate, std, window_s = best
    there = np.isfinite(rate)
    kept, rise = t[there], np.gradient(part_known, t)[there]
    after = np.flatnonzero(np.diff(kept) > GAP_CYCLES * cycle) + 1
    breaks = np.stack([kept[after - 1], kept[after]], axis=1)
    whole = value[there] + part_known[there]
    return Smooth(kept, whole, rate[there] + rise, std, breaks, window_s)


def rough(trace: Trace, origin_us: int) -> tuple[Array, Array]:
    """Stamps, s, and the fast part of a signal: what is left of it beside its mean over 0.4 s."""
    good = np.isfinite(trace.value)
    t, value = (trace.t_us[good] - origin_us) / 1e6, trace.value[good]
    if len(t) < 8:
        return t, value
    points = max(round(ROUGH_S / float(np.median(np.diff(t))) / 2) * 2 + 1, 5)
    if len(t) < points:
        return t, 0.0 * value
    return t, value - savgol_filter(value, points, 2)


def pulled(trace: Trace, origin_us: int, efforts: Sequence[Smooth]) -> Array | None:
    """What the efforts explain of a vehicle speed: their impulse over the train's mass.

    A train is heavy: its speed is what pulled it, and something slower. So the smoothing is left
    with the slow part. The mass comes from the data, by differences over a second.

    Args:
        trace: vehicle speed.
        origin_us: stamp of time 0.
        efforts: of every axle, smoothed.

    """
    good = np.isfinite(trace.value)
    t, v = (trace.t_us[good] - origin_us) / 1e6, trace.value[good]
    if len(t) < 8 or not efforts:
        return None
    whole = np.sum([np.interp(t, effort.t_s, effort.value) for effort in efforts], axis=0)
    impulse = np.concatenate([[0.0], np.cumsum(np.diff(t) * (whole[1:] + whole[:-1]) / 2)])
    lag = max(round(1.0 / float(np.median(np.diff(t)))), 1)
    if len(t) <= 2 * lag:
        return None
    # Second differences take the slow part, a constant pull, out of both.
    dv, di = (x[2 * lag :] - 2 * x[lag:-lag] + x[: -2 * lag] for x in (v, impulse))
    square = float(di @ di)
    per_mass = max(float(di @ dv) / square, 0.0) if square > 0.0 else 0.0
    return per_mass * impulse


def covers(smooth: Smooth, from_s: Array, to_s: Array) -> NDArray[np.bool_]:
    """Whether a signal is there without a gap from one time to another, for each pair."""
    if not len(smooth.t_s):
        return np.zeros(len(from_s), dtype=np.bool_)
    inside = (from_s >= smooth.t_s[0]) & (to_s <= smooth.t_s[-1])
    if len(smooth.breaks):
        # A break between the two ends: its begin lies before the end, its end after the begin.
        first = np.searchsorted(smooth.breaks[:, 1], from_s, side="right")
        last = np.searchsorted(smooth.breaks[:, 0], to_s, side="left")
        inside &= first >= last
    return np.asarray(inside)
