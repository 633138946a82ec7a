"""Samples of the adhesion curve on one time base, from readings of different rates.

A sample is at each wheel-speed stamp. Vehicle speed and effort are interpolated between the
two readings that bracket it, never extrapolated; dω/dt is the central difference of the wheel
speeds before and after. So a sample is ready a cycle after its stamp, and a gap costs the samples
in it and no others.
"""

from bisect import bisect_right
from collections import Counter
from collections.abc import Mapping
from copy import deepcopy
from math import hypot, inf, nan
from typing import NamedTuple

import numpy as np

from adhesion_can.arrays import Array
from adhesion_can.physics.instrument_laws import Need
from adhesion_can.physics.instruments import PERFECT, Instruments
from adhesion_can.physics.readings import Reading, Role
from adhesion_can.physics.samples import NO_SAMPLES, Samples
from adhesion_can.physics.vehicle import Locomotive
from adhesion_can.sampling.equations import (
    TRAVEL_BY_DIRECTION,
    TRAVEL_DIRECTION,
    Measured,
    SampleEquations,
    SamplingSettings,
    Sensors,
)
from adhesion_can.sampling.instrument_errors import (
    NOT_CORRECTED,
    RowCorrection,
    Stamps,
    WheelAngles,
    is_whole,
)
from adhesion_can.sampling.load_transfer import ReadingTransfer
from adhesion_can.sampling.signal_history import WAITING, SignalHistory, Waiting
from adhesion_can.values import Stateful


class _Row(NamedTuple):
    """Measured values at one wheel-speed stamp, SI; sorts by stamp and axle.

    `acceleration_change` is the difference of dω/dt after and before the stamp, rad/s²;
    `effort_step_std` the standard deviation of an effort that stepped somewhere between its two
    readings, N; `speed_share` the place between the two vehicle speeds around the stamp, 0..1;
    `transferred` the load that the efforts have moved to the axle since its load was read, N.
    """

    t_us: int
    axle: int
    wheel_speed: float
    wheel_accel: float
    span: float
    speed: float
    effort: float
    load: float
    load_std: float
    speed_us: int
    acceleration_change: float
    effort_step_std: float
    speed_share: float
    transferred: float


class SampleFormer(Stateful):
    """Forms samples from readings as they come; keeps a fraction of a second of them.

    Args:
        vehicle: Vehicle with its radii, loads and inertia.
        cycles_us: Cycle time of each role's message, µs; a gap is a multiple of it.
        settings: Conditions under which a sample is formed; None: the defaults.
        sensors: Standard deviations of the measurements; None: the defaults.
        instruments: Errors of the sensors and of the vehicle's data, corrected in the readings.
        with_travel: Whether samples carry the covariate `TRAVEL_DIRECTION`.
        channels: Names of the covariates from the user's channels, by their numbers from 1.
        with_aids: Whether samples carry the aids of the observed speed.

    """

    def __init__(
        self,
        vehicle: Locomotive,
        cycles_us: Mapping[Role, int],
        settings: SamplingSettings | None = None,
        sensors: Sensors | None = None,
        instruments: Instruments = PERFECT,
        *,
        with_travel: bool = False,
        channels: tuple[str, ...] = (),
        with_aids: bool = False,
    ) -> None:
        self.equations = equations = SampleEquations(
            vehicle,
            cycles_us,
            settings or SamplingSettings(),
            sensors or Sensors(),
            instruments,
            with_travel,
            channels,
            with_aids,
        )
        axles = range(1, vehicle.axles + 1)
        self._wheel = {i: SignalHistory(equations.gap_us(Role.WHEEL_SPEED)) for i in axles}
        self._effort = {i: SignalHistory(equations.gap_us(Role.TRACTIVE_EFFORT)) for i in axles}
        self._load = {i: SignalHistory(equations.gap_us(Role.AXLE_LOAD)) for i in axles}
        self._speed = SignalHistory(equations.gap_us(Role.VEHICLE_SPEED))
        self._next = dict.fromkeys(axles, 1)
        self._travel = 1.0
        self._transfer = ReadingTransfer(equations, self._effort, self._load)
        self._correction = RowCorrection(instruments, vehicle) if instruments.laws else None
        self._angles = WheelAngles()
        turning = axles if instruments.needs(Need.WHEEL_ANGLE) else ()
        self._angle = {i: SignalHistory(inf) for i in turning}
        self._covariates: dict[str, float] = {}
        self._history: list[tuple[int, dict[str, float]]] = []
        self.dropped: Counter[str] = Counter()
        """Wheel-speed readings that gave no sample, by reason."""
        self.gave_up = False
        """Whether a wheel speed was given up at the latest collection, for want of a bracket."""

    def copy(self) -> "SampleFormer":
        """A former with the same readings, which goes its own way from here."""
        return deepcopy(self, {id(self.equations): self.equations})

    def is_continued_by(self, reading: Reading) -> bool:
        """Whether a reading may complete samples, but changes none that was collected already.

        So does a speed that is newer than all before. Efforts and loads teach how loads are
        transferred, and channels are those of all samples of a collection.
        """
        role, axle = reading.role, reading.axle
        if role is Role.WHEEL_SPEED and axle in self._wheel:
            history, t_us = self._wheel[axle], reading.t_us
        elif role is Role.VEHICLE_SPEED:
            history, t_us = self._speed, reading.t_us - self.equations.speed_lag_us
        else:
            return False
        return not history.times or t_us > history.times[-1]

    def add(self, reading: Reading) -> None:
        """Add one reading; stamps must not run backwards.

        A late stamp is moved back to the time of the measurement; samples wait for such readings.
        """
        role, axle = reading.role, reading.axle
        instrument_errors = self.equations.instruments
        if role is Role.WHEEL_SPEED and axle in self._wheel:
            self._wheel[axle].add(reading.t_us, reading.value)
            if self._correction is not None:
                self._turn(self._correction, reading)
        elif role is Role.TRACTIVE_EFFORT and axle in self._effort:
            effort = (
                None if reading.value is None else reading.value - instrument_errors.effort_bias
            )
            self._effort[axle].add(reading.t_us - self.equations.effort_lag_us, effort)
        elif role is Role.VEHICLE_SPEED:
            speed = (
                None
                if reading.value is None
                else reading.value / (1.0 + instrument_errors.speed_error)
            )
            self._speed.add(reading.t_us - self.equations.speed_lag_us, speed)
        elif role is Role.AXLE_LOAD and axle in self._load:
            self._load[axle].add(reading.t_us, reading.value)
        elif role is Role.DIRECTION and reading.value is not None:
            self._travel = TRAVEL_BY_DIRECTION.get(int(reading.value), self._travel)
            self._transfer.turn(reading.t_us, self._travel)
            if (
                self.equations.with_travel
                and self._covariates.get(TRAVEL_DIRECTION) != self._travel
            ):
                self._set_covariate(TRAVEL_DIRECTION, self._travel, reading.t_us)
        elif aid := self.equations.aids.get(role):
            stamp = None if reading.value is None else float(reading.t_us)
            self._set_covariate(aid.value, reading.value, reading.t_us)
            self._set_covariate(aid.stamp, stamp, reading.t_us)
        elif name := self.equations.covariate(role, axle):
            self._set_covariate(name, reading.value, reading.t_us)

    def _turn(self, correction: RowCorrection, reading: Reading) -> None:
        """Turn a wheel on to its reading, where errors depend on its angle."""
        correction.begin(reading.t_us)
        if correction.needs_angle and reading.value is not None:
            stamps, speed = np.array([reading.t_us]), np.array([reading.value])
            (angle,) = self._angles.turn(reading.axle, stamps, speed).tolist()
            self._angle[reading.axle].add(reading.t_us, angle)

    def _set_covariate(self, name: str, value: float | None, t_us: int) -> None:
        # A new mapping, since the samples formed so far share the old one.
        rest = {key: old for key, old in self._covariates.items() if key != name}
        self._covariates = rest if value is None else {**rest, name: value}
        if self.equations.lag_us:
            self._history.append((t_us, self._covariates))

    def _covariates_at(self, t_us: int) -> dict[str, float]:
        """Covariates of a sample: the latest ones, unless it had to wait for late readings."""
        if not self.equations.lag_us:
            return self._covariates
        before = bisect_right(self._history, t_us, key=lambda entry: entry[0]) - 1
        return self._history[before][1] if before >= 0 else {}

    def waits(self, now_us: int) -> bool:
        """Whether `collect` at a time, µs, has nothing to form: every wheel speed waits.

        The next of each axle is the latest, or newer than the latest vehicle speed.
        """
        latest_us = self._speed.times[-1] if self._speed.times else -1
        for axle, wheel in self._wheel.items():
            k = self._next[axle]
            if k < len(wheel.times) - 1:
                t_us = wheel.times[k]
                if t_us <= latest_us or now_us - t_us > self.equations.give_up_us:
                    return False
        return True

    def collect(self, now_us: int) -> Samples:
        """Samples that became complete, by stamp and axle.

        Args:
            now_us: Current time, µs; a wheel speed that has waited for its bracket longer than the
                gap allowed is given up.

        """
        formed: list[_Row] = []
        self.gave_up = False
        for axle, wheel in self._wheel.items():
            k = self._next[axle]
            while k < len(wheel.times) - 1:
                outcome = self._form(axle, k)
                if outcome is WAITING:
                    if now_us - wheel.times[k] <= self.equations.give_up_us:
                        break
                    outcome, self.gave_up = "no bracket", True
                if isinstance(outcome, _Row):
                    formed.append(outcome)
                else:
                    self.dropped[str(outcome)] += 1
                k += 1
            self._next[axle] = k - wheel.forget_before(wheel.times[k - 1]) if wheel.times else k
        self._transfer.learn(now_us)
        samples = self._samples(sorted(formed))
        self._forget(now_us)
        return samples

    def _forget(self, now_us: int) -> None:
        """Drop readings that no wheel speed needs which waits or may still be bracketed."""
        waiting = [
            wheel.times[self._next[axle] - 1]
            for axle, wheel in self._wheel.items()
            if len(wheel.times) >= self._next[axle]
        ]
        oldest = self.equations.oldest_needed_us(waiting, now_us)
        self._speed.forget_before(oldest)
        for angle in self._angle.values():
            angle.forget_before(oldest)
        # With the efforts and the loads.
        self._transfer.forget_before(oldest)
        gone = bisect_right(self._history, oldest, key=lambda entry: entry[0]) - 1
        del self._history[: max(gone, 0)]

    def _form(self, axle: int, k: int) -> _Row | str | Waiting:  # noqa: PLR0911  a reason each
        """Measured values at the k-th wheel speed of an axle, or the reason why there are none."""
        wheel = self._wheel[axle]
        t = wheel.times[k]
        before, omega, after = wheel.values[k - 1 : k + 2]
        if before is None or omega is None or after is None:
            return "wheel speed not available"
        span = wheel.times[k + 1] - wheel.times[k - 1]
        if max(t - wheel.times[k - 1], wheel.times[k + 1] - t) > wheel.max_gap_us:
            return "gap in wheel speed"
        v = self._speed.at(t)
        effort = self._effort[axle].at(t)
        if isinstance(v, Waiting) or isinstance(effort, Waiting):
            return WAITING
        if v is None:
            return "vehicle speed not available"
        if effort is None:
            return "tractive effort not available"
        if v < self.equations.settings.v_min:
            return "below v_min"
        loaded = self._load_at(axle, t, effort)
        if isinstance(loaded, Waiting):
            return WAITING
        load, load_std, transferred = loaded
        if (
            load
            < self.equations.settings.min_load_share * self.equations.vehicle.axle_load[axle - 1]
        ):
            return "axle load implausibly low"
        later = (after - omega) / ((wheel.times[k + 1] - t) * 1e-6)
        earlier = (omega - before) / ((t - wheel.times[k - 1]) * 1e-6)
        return _Row(
            t,
            axle,
            omega,
            (after - before) / (span * 1e-6),
            span * 1e-6,
            v,
            effort,
            load,
            load_std,
            self._speed.bracket_end_us(t),
            later - earlier,
            self._effort[axle].step_std(t),
            self._speed.share_at(t),
            transferred,
        )

    def _samples(self, rows: list[_Row]) -> Samples:
        """The rows of one update as samples."""
        if not rows:
            return NO_SAMPLES
        # Contiguous, as from columns: products of matrices round by the layout.
        columns = np.array(rows, dtype=np.float64).T.copy()
        t_us = np.array([row.t_us for row in rows])
        axle = columns[1].astype(np.int64)
        _, _, omega, accel, span, speed, effort, load, load_std, _ = columns[:10]
        change, step_std, share, transferred = columns[10:14]
        gain, missed = self._transfer.gain.at(t_us)
        load = load + gain * transferred
        transfer_std = np.abs(transferred) * missed
        measured = Measured(
            axle, omega, accel, span, speed, effort, load, change, step_std, transfer_std
        )
        if self._correction is not None:
            measured = self._correct(self._correction, rows, t_us, measured)
            whole = is_whole(measured, self.equations.settings.v_min)
            if not whole.all():
                self.dropped[NOT_CORRECTED] += int((~whole).sum())
                rows = [row for row, good in zip(rows, whole, strict=True) if good]
                measured = measured.select(whole)
                t_us, load_std, share = t_us[whole], load_std[whole], share[whole]
        if not rows:
            return NO_SAMPLES
        return Samples(
            t_us=t_us,
            axle=measured.axle,
            speed=measured.speed,
            load=measured.load,
            load_std=load_std,
            speed_us=np.array([row.speed_us for row in rows]),
            speed_share=share,
            covariates=self._covariates_of(rows),
            **self.equations.derive(measured)._asdict(),
        )

    def _correct(
        self, correction: RowCorrection, rows: list[_Row], t_us: Stamps, measured: Measured
    ) -> Measured:
        """Measured values without the errors that depend on the situation."""
        stamps = t_us.tolist()
        angle = None
        if correction.needs_angle:
            angle = np.array([self._angle[row.axle].at(row.t_us) for row in rows], dtype=float)
        given = [self._covariates_at(stamp) for stamp in stamps]
        return correction.correct(
            t_us,
            measured,
            self._transfer.travel(stamps),
            self._transfer.efforts(stamps) if correction.needs_efforts else None,
            angle,
            {
                name: np.array([covariates.get(name, nan) for covariates in given])
                for name in correction.covariates
            },
        )

    def _covariates_of(self, rows: list[_Row]) -> dict[str, Array]:
        """Columns of the covariates that all of the rows have."""
        by_row = [self._covariates_at(row.t_us) for row in rows]
        names = set(by_row[0]).intersection(*by_row)
        return {
            name: np.array([covariates[name] for covariates in by_row]) for name in sorted(names)
        }

    def _load_at(self, axle: int, t_us: int, effort: float) -> tuple[float, float, float] | Waiting:
        """Load, standard deviation of what was not measured, and transfer since it was, N."""
        measured = self._load[axle].held_at(t_us)
        if measured is not None:
            stamp, load = measured
            return load, 0.0, self._transfer.since(axle, stamp, t_us)
        static = self.equations.vehicle.axle_load[axle - 1]
        load_std = self.equations.vehicle.load_std * static
        if self.equations.transfer is None:
            return static, load_std, 0.0
        row = self.equations.transfer[axle - 1]
        shift = 0.0
        for j, share in enumerate(row, start=1):
            history = self._effort[j]
            other = history.at(t_us)
            if isinstance(other, Waiting) and history.times:
                return WAITING
            if other is None or isinstance(other, Waiting):
                # Another axle's effort is unknown: no transfer, but its whole size as doubt.
                return static, hypot(load_std, effort * sum(row)), 0.0
            shift += share * other
        return static + self._travel * shift, load_std, 0.0
