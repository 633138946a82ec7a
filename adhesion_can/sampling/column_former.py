"""Samples from columns of readings: `SampleFormer` for a whole block, equal to the last bit.

The values of a sample depend on the readings alone; the times of collecting decide in which update
it comes. A sample is ready when the readings that close its brackets have come, which
is known for all samples of a block at once. So the frame-by-frame former's waiting is a comparison
of stamps here: it comes with the first collection after its last closing reading, never before
the sample in front of it, and is given up with the first one after its patience has ended.
"""

from collections import Counter
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import replace
from itertools import pairwise
from math import ceil, hypot, inf
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from adhesion_can.arrays import Array
from adhesion_can.physics.readings import Reading, Role
from adhesion_can.physics.samples import NO_SAMPLES, Samples
from adhesion_can.sampling.column_history import NEVER, ColumnHistory, Stamps
from adhesion_can.sampling.covariate_columns import CovariateColumns
from adhesion_can.sampling.equations import (
    TRAVEL_BY_DIRECTION,
    Measured,
    SampleEquations,
)
from adhesion_can.sampling.instrument_errors import (
    NOT_CORRECTED,
    RowCorrection,
    WheelAngles,
    is_whole,
)
from adhesion_can.sampling.load_transfer import NO_READING, LoadTransfer

Signal = tuple[Role, int]
"""A role and its axle, 0 where it has none."""
Readings = Mapping[Signal, tuple[Stamps, Array]]
"""Stamps and SI values (NaN: not available) of each signal of a block."""


def in_columns(readings: Iterable[Reading]) -> Readings:
    """Readings of one frame as columns of one row."""
    return {
        (reading.role, reading.axle): (
            np.array([reading.t_us], dtype=np.int64),
            np.array([np.nan if reading.value is None else reading.value]),
        )
        for reading in readings
    }


class _Formed(NamedTuple):
    """Columns of the samples of one axle, and the number of the collection of each."""

    collection: NDArray[np.int64]
    t_us: Stamps
    measured: Measured
    load_std: Array
    load_us: Stamps
    speed_us: Stamps
    speed_share: Array


class _Due(NamedTuple):
    """Times of collecting, ascending."""

    t_us: Stamps

    def after(self, t_us: Stamps | Array) -> NDArray[np.int64]:
        """Number of the first one after each stamp; the length where there is none."""
        return np.searchsorted(self.t_us, t_us, side="right")


class ColumnFormer:
    """Forms samples from columns of readings; keeps what the next block may still need.

    Args:
        equations: Settings and equations of the samples.

    """

    def __init__(self, equations: SampleEquations) -> None:
        self._equations = equations
        axles = range(1, equations.vehicle.axles + 1)
        self._wheel = {i: ColumnHistory(equations.gap_us(Role.WHEEL_SPEED)) for i in axles}
        effort_gap = equations.gap_us(Role.TRACTIVE_EFFORT)
        self._effort = {i: ColumnHistory(effort_gap, equations.effort_lag_us) for i in axles}
        self._load = {i: ColumnHistory(equations.gap_us(Role.AXLE_LOAD)) for i in axles}
        self._speed = ColumnHistory(equations.gap_us(Role.VEHICLE_SPEED), equations.speed_lag_us)
        self._direction = ColumnHistory(0.0)
        self._transfer = LoadTransfer(equations, self._effort, self._load, self._direction)
        instruments = equations.instruments
        self._correction = (
            RowCorrection(instruments, equations.configured) if instruments.laws else None
        )
        self._angles = WheelAngles()
        self._angle = {i: ColumnHistory(inf) for i in axles}
        self._covariates = CovariateColumns(equations)
        self.dropped: Counter[str] = Counter()
        """Wheel-speed readings that gave no sample, by reason."""

    @property
    def give_up_us(self) -> int:
        """Longest time that a wheel speed waits for its bracket, µs."""
        return ceil(self._equations.give_up_us)

    def add(self, readings: Readings) -> None:
        """Add the readings of the next block; stamps of a signal do not run backwards."""
        if self._correction is not None:
            _begin(self._correction, readings)
        instrument_errors = self._equations.instruments
        for (role, axle), (stamps, values) in readings.items():
            if role is Role.WHEEL_SPEED and axle in self._wheel:
                self._wheel[axle].extend(stamps, values)
                if self._correction is not None:
                    self._turn(self._correction, axle, stamps, values)
            elif role is Role.TRACTIVE_EFFORT and axle in self._effort:
                self._effort[axle].extend(stamps, values - instrument_errors.effort_bias)
            elif role is Role.VEHICLE_SPEED:
                self._speed.extend(stamps, values / (1.0 + instrument_errors.speed_error))
            elif role is Role.AXLE_LOAD and axle in self._load:
                self._load[axle].extend(stamps, values)
            elif role is Role.DIRECTION:
                self._add_direction(stamps, values)
            else:
                self._covariates.add(role, axle, stamps, values)

    def _turn(self, correction: RowCorrection, axle: int, stamps: Stamps, values: Array) -> None:
        """Turn a wheel on to its readings, where errors depend on its angle."""
        good = np.isfinite(values)
        if correction.needs_angle and good.any():
            angles = self._angles.turn(axle, stamps[good], values[good])
            self._angle[axle].extend(stamps[good], angles)

    def _add_direction(self, stamps: Stamps, values: Array) -> None:
        available = np.isfinite(values)
        stamps, values = stamps[available], np.trunc(values[available])
        travel = np.full(len(values), np.nan)
        for direction, sign in TRAVEL_BY_DIRECTION.items():
            travel[values == direction] = sign
        # Any other direction leaves the travel as it was, forwards at first.
        last = np.maximum.accumulate(np.where(np.isfinite(travel), np.arange(len(travel)), -1))
        was = self._direction.value[-1] if len(self._direction.value) else 1.0
        travel = np.where(last >= 0, travel[last], was)
        self._direction.extend(stamps, travel)
        self._covariates.add_travel(stamps, travel)

    def collect(self, due_us: Stamps) -> Iterator[Samples]:
        """Samples of each time of collecting, as `SampleFormer.collect` gives them.

        Args:
            due_us: Times of collecting, µs, ascending, shape (n,); no reading stamped before the
                last of them is still to come.

        """
        formed, bounds = self.collect_all(due_us)
        always = {n: c for n, c in formed.covariates.items() if np.isfinite(c).all()}
        at_times = {n: c for n, c in formed.covariates.items() if n not in always}
        plain = replace(formed, covariates=always)
        for first, last in pairwise(bounds.tolist()):
            rows = slice(first, last)
            samples = plain.select(rows) if first < last else NO_SAMPLES
            # An update carries the covariates that all its samples have.
            more = {n: c[rows] for n, c in at_times.items() if np.isfinite(c[rows]).all()}
            yield (
                replace(samples, covariates={**samples.covariates, **more})
                if more and len(samples)
                else samples
            )

    def collect_all(self, due_us: Stamps) -> tuple[Samples, NDArray[np.int64]]:
        """Samples of all times of collecting in one, and where those of each start.

        A covariate that was not available at a sample is NaN there.

        Args:
            due_us: Times of collecting, µs, ascending, shape (n,); no reading stamped before the
                last of them is still to come.

        Returns:
            Samples, and the row at which those of each time start, shape (n + 1,).

        """
        due = _Due(due_us)
        parts = [self._form(axle, due) for axle in self._wheel]
        collection = np.concatenate([part.collection for part in parts])
        t_us = np.concatenate([part.t_us for part in parts])
        axle = np.concatenate([part.measured.axle for part in parts])
        order = np.lexsort((axle, t_us, collection))
        collection, t_us = collection[order], t_us[order]
        columns = (np.concatenate(c)[order] for c in zip(*(p.measured for p in parts), strict=True))
        measured = Measured(*columns)
        if len(due_us):
            self._transfer.learn(int(due_us[-1]))
        load_us = np.concatenate([part.load_us for part in parts])[order]
        load, transfer_std = self._transfer.follow(measured.axle, t_us, measured.load, load_us)
        measured = measured._replace(load=load, transfer_std=transfer_std)
        covariates = self._covariates.at(t_us, due_us[collection])
        whole = np.ones(len(t_us), dtype=np.bool_)
        if self._correction is not None and len(t_us):
            measured = self._correct(self._correction, t_us, measured, covariates)
            whole = is_whole(measured, self._equations.settings.v_min)
        samples = Samples(
            t_us=t_us,
            axle=measured.axle,
            speed=measured.speed,
            load=measured.load,
            load_std=np.concatenate([part.load_std for part in parts])[order],
            speed_us=np.concatenate([part.speed_us for part in parts])[order],
            speed_share=np.concatenate([part.speed_share for part in parts])[order],
            **self._equations.derive(measured)._asdict(),
            covariates=covariates,
        )
        if not whole.all():
            self.dropped[NOT_CORRECTED] += int((~whole).sum())
            samples, collection = samples.select(whole), collection[whole]
        if len(due_us):
            self._forget(int(due_us[-1]))
        return samples, np.searchsorted(collection, np.arange(len(due_us) + 1))

    def _correct(
        self,
        correction: RowCorrection,
        t_us: Stamps,
        measured: Measured,
        covariates: Mapping[str, Array],
    ) -> Measured:
        """Measured values without the errors that depend on the situation."""
        angle = None
        if correction.needs_angle:
            angle = np.empty(len(t_us))
            for axle, history in self._angle.items():
                rows = measured.axle == axle
                angle[rows] = history.at(t_us[rows]).value
        return correction.correct(
            t_us,
            measured,
            self._transfer.travel(t_us),
            self._transfer.efforts(t_us) if correction.needs_efforts else None,
            angle,
            covariates,
        )

    def _forget(self, now_us: int) -> None:
        equations = self._equations
        waiting = [int(wheel.t_us[0]) for wheel in self._wheel.values() if len(wheel.t_us)]
        oldest = equations.oldest_needed_us(waiting, now_us)
        given = self._covariates.histories.values()
        for history in (self._speed, *given, *self._angle.values()):
            history.forget_before(oldest)
        for history in (self._direction, *self._load.values(), *self._effort.values()):
            history.forget_before(oldest - equations.load_age_us)
        self._transfer.forget_before(oldest)

    # ------------------------------------------------------------------------------- an axle

    def _form(self, axle: int, due: _Due) -> _Formed:
        """Samples of an axle that come in these collections; drops the wheel speeds they settle."""
        wheel, equations = self._wheel[axle], self._equations
        t = wheel.t_us[1:-1]
        omega, before, after = wheel.value[1:-1], wheel.value[:-2], wheel.value[2:]
        since, until = t - wheel.t_us[:-2], wheel.t_us[2:] - t
        v, effort = self._speed.at(t), self._effort[axle].at(t)
        lost = ~np.isfinite(before + omega + after)
        gap = np.maximum(since, until) > wheel.max_gap_us
        ready = due.after(wheel.t_us[2:])
        bracketed = np.maximum(np.maximum(v.known_us, effort.known_us), wheel.t_us[2:])
        needed = np.where(lost | gap, ready, due.after(bracketed))
        slow = v.value < equations.settings.v_min
        whole = ~(lost | gap) & np.isfinite(v.value) & np.isfinite(effort.value) & ~slow
        load_us, load = self._load[axle].held_at(t)
        load_std = np.zeros(len(t))
        load_us = np.where(np.isfinite(load), load_us, NO_READING)
        unmeasured = np.flatnonzero(whole & (load_us == NO_READING))
        if len(unmeasured):
            estimate = self._estimate_load(
                axle, t[unmeasured], effort.value[unmeasured], bracketed[unmeasured], due
            )
            load[unmeasured], load_std[unmeasured], needed[unmeasured] = estimate
        given_up = due.after((t + equations.give_up_us).astype(np.float64))
        settled = (
            np.maximum.accumulate(np.where(lost | gap, needed, np.minimum(needed, given_up)))
            if len(t)
            else needed
        )
        done = int(np.searchsorted(settled, len(due.t_us)))
        light = load < equations.settings.min_load_share * equations.vehicle.axle_load[axle - 1]
        reasons = (
            (lost, "wheel speed not available"),
            (gap, "gap in wheel speed"),
            (needed > settled, "no bracket"),
            (~np.isfinite(v.value), "vehicle speed not available"),
            (~np.isfinite(effort.value), "tractive effort not available"),
            (slow, "below v_min"),
            (light, "axle load implausibly low"),
        )
        kept = np.ones(done, dtype=np.bool_)
        for mask, reason in reasons:
            hit = kept & mask[:done]
            if hit.any():
                self.dropped[reason] += int(hit.sum())
                kept &= ~hit
        k = np.flatnonzero(kept)
        span = (until + since)[k] * 1e-6
        later = (after - omega)[k] / (until[k] * 1e-6)
        earlier = (omega - before)[k] / (since[k] * 1e-6)
        formed = _Formed(
            collection=settled[k],
            t_us=t[k],
            measured=Measured(
                axle=np.full(len(k), axle),
                wheel_speed=omega[k],
                wheel_accel=(after - before)[k] / span,
                span=span,
                speed=v.value[k],
                effort=effort.value[k],
                load=load[k],
                acceleration_change=later - earlier,
                effort_step_std=effort.step_std[k],
                transfer_std=np.zeros(len(k)),
            ),
            load_std=load_std[k],
            load_us=load_us[k],
            speed_us=v.bracket_end_us[k],
            speed_share=v.share[k],
        )
        wheel.t_us, wheel.value = wheel.t_us[done:].copy(), wheel.value[done:].copy()
        return formed

    def _estimate_load(
        self, axle: int, t: Stamps, effort: Array, bracketed: Stamps, due: _Due
    ) -> tuple[Array, Array, NDArray[np.int64]]:
        """Loads that were not measured, their standard deviation, and the collection they need.

        The transfer goes axle by axle and waits for the bracket of each one's effort. An axle
        without any reading by then, or without a value there, leaves the static load with the
        whole transfer as its standard deviation.
        """
        equations = self._equations
        static = equations.vehicle.axle_load[axle - 1]
        static_std = equations.vehicle.load_std * static
        size = len(t)
        load, std = np.full(size, static), np.full(size, static_std)
        needed = due.after(bracketed)
        if equations.transfer is None:
            return load, std, needed
        row = equations.transfer[axle - 1]
        transfer_std = np.array(
            [hypot(static_std, own_effort * sum(row)) for own_effort in effort.tolist()]
        )
        pending = np.ones(size, dtype=np.bool_)
        shift, latest = np.zeros(size), bracketed
        for j, share in enumerate(row, start=1):
            history = self._effort[j]
            unknown = pending & (needed < len(due.t_us))
            # Collected at or before the first message of that axle: no reading of it was known.
            stamp = due.t_us[np.minimum(needed, len(due.t_us) - 1)] if len(due.t_us) else needed
            unknown &= stamp <= history.first_us
            std[unknown] = transfer_std[unknown]
            pending &= ~unknown
            other = history.at(t)
            latest = np.where(pending, np.maximum(latest, other.known_us), latest)
            needed = np.where(pending, due.after(latest), needed)
            missing = pending & (other.known_us < NEVER) & ~np.isfinite(other.value)
            std[missing] = transfer_std[missing]
            pending &= ~missing
            shift += np.where(pending, share * other.value, 0.0)
        travel = self._travel(needed, due)
        load[pending] = static + travel[pending] * shift[pending]
        return load, std, needed

    def _travel(self, collection: NDArray[np.int64], due: _Due) -> Array:
        """Direction of travel known at collections by number: 1 forwards or unknown, -1 else."""
        if not (len(self._direction.t_us) and len(due.t_us)):
            return np.ones(len(collection))
        place = self._direction.before(due.t_us[np.minimum(collection, len(due.t_us) - 1)])
        return np.where(place >= 0, self._direction.value[place], 1.0)


def _begin(correction: RowCorrection, readings: Readings) -> None:
    """Let the recording start with the first wheel speed."""
    wheels = (stamps for (role, _), (stamps, _) in readings.items() if role is Role.WHEEL_SPEED)
    begins = [int(stamps[0]) for stamps in wheels if len(stamps)]
    if begins:
        correction.begin(min(begins))
