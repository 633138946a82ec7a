"""Measured loads between their readings: what the efforts have transferred since."""

from bisect import bisect_right
from math import inf

import numpy as np
from numpy.typing import NDArray

from adhesion_can.arrays import Array
from adhesion_can.physics.readings import Role
from adhesion_can.sampling.column_history import ColumnHistory, Stamps
from adhesion_can.sampling.equations import SampleEquations
from adhesion_can.sampling.load_gain import Changes, LoadGain
from adhesion_can.sampling.signal_history import SignalHistory
from adhesion_can.values import Stateful

NO_READING = -1
"""Stamp in place of that of a load's reading, where the load was not measured."""


class LoadTransfer:
    """Carries measured loads on from their readings, as far as they follow the efforts.

    The transfer goes by the last reading of each effort: all of them are here, whatever a sample
    waits for. What is learnt at a stamp depends on the readings up to it alone.

    Args:
        equations: Settings and equations of the samples.
        effort: Efforts by axle, shared with the owner, who adds to them and forgets.
        load: Measured loads by axle, likewise.
        direction: Direction of travel, 1 or −1, likewise.

    """

    def __init__(
        self,
        equations: SampleEquations,
        effort: dict[int, ColumnHistory],
        load: dict[int, ColumnHistory],
        direction: ColumnHistory,
    ) -> None:
        self._effort, self._load, self._direction = effort, load, direction
        # Without a geometry nothing is transferred.
        self._known = equations.transfer is not None
        axles = equations.vehicle.axles
        self._shares = np.array(equations.transfer) if self._known else np.zeros((axles, axles))
        self._lag_us = max(equations.effort_lag_us, 0)
        self._longest_us = equations.gap_us(Role.AXLE_LOAD)
        self._gain = LoadGain(float(np.mean(equations.vehicle.axle_load)))
        self._learnt_us = np.iinfo(np.int64).min

    def learn(self, now_us: int) -> None:
        """Learn from the loads whose efforts are known.

        Args:
            now_us: Current time, µs; no reading stamped before it is still to come.

        """
        limit = now_us - self._lag_us - 1
        if not self._known or limit <= self._learnt_us:
            return
        parts = [self._changes(axle, history, limit) for axle, history in self._load.items()]
        self._learnt_us = limit
        before, t_us, axle, change = (np.concatenate(c) for c in zip(*parts, strict=True))
        if not len(t_us):
            return
        order = np.lexsort((axle, t_us))
        before, t_us, axle, change = before[order], t_us[order], axle[order], change[order]
        transfer, known = self._transfer(axle, before, t_us)
        self._gain.learn(Changes(t_us[known], transfer[known], change[known]))

    def _changes(
        self, axle: int, history: ColumnHistory, limit: int
    ) -> tuple[Stamps, Stamps, Stamps, Array]:
        """Stamps of two readings each, axle, and change of the load between them."""
        t, value = history.t_us, history.value
        last = np.flatnonzero((t[1:] > self._learnt_us) & (t[1:] <= limit)) + 1
        change = value[last] - value[last - 1]
        good = np.isfinite(change) & (t[last] - t[last - 1] <= self._longest_us)
        last = last[good]
        return t[last - 1], t[last], np.full(len(last), axle), change[good]

    def follow(
        self, axle: Stamps, t_us: Stamps, load: Array, read_us: Stamps
    ) -> tuple[Array, Array]:
        """Loads at stamps, N, and standard deviations of what was transferred since their readings.

        Args:
            axle: Axle numbers from 1, shape (n,).
            t_us: Stamps, µs, shape (n,).
            load: Loads as they were read, or taken for unmeasured ones, N, shape (n,).
            read_us: Stamps of the readings, µs; `NO_READING` for unmeasured loads; shape (n,).

        """
        if not self._known:
            return load, np.zeros(len(load))
        since_us = np.where(read_us == NO_READING, t_us, read_us)
        transfer, _ = self._transfer(axle, since_us, t_us)
        gain, std = self._gain.at(t_us)
        return load + gain * transfer, np.abs(transfer) * std

    def forget_before(self, t_us: int) -> None:
        """Drop what no sample at or after a stamp needs."""
        self._gain.forget_before(t_us)

    def _transfer(
        self, axle: Stamps, before: Stamps, t_us: Stamps
    ) -> tuple[Array, NDArray[np.bool_]]:
        """Load that the efforts known at two stamps move to an axle between them, N.

        Returns:
            Transfer, and whether all efforts are known, shape (n,) each.

        """
        moved, known = np.zeros(len(t_us)), np.ones(len(t_us), dtype=np.bool_)
        for column, history in enumerate(self._effort.values()):
            change = history.held_at(t_us)[1] - history.held_at(before)[1]
            there = np.isfinite(change)
            moved += np.where(there, self._shares[axle - 1, column] * change, 0.0)
            known &= there
        return moved * self.travel(t_us), known

    def efforts(self, t_us: Stamps) -> Array:
        """Last efforts of all axles at stamps, N, shape (n, axles); NaN where not known."""
        held = [history.held_at(t_us)[1] for history in self._effort.values()]
        return np.stack(held, axis=1)

    def travel(self, t_us: Stamps) -> Array:
        """Direction of travel at stamps: 1 forwards or unknown, −1 in reverse."""
        place = np.searchsorted(self._direction.t_us, t_us, side="right") - 1
        if not len(self._direction.t_us):
            return np.ones(len(t_us))
        return np.where(place >= 0, self._direction.value[place], 1.0)


class ReadingTransfer(Stateful):
    """`LoadTransfer` of readings that come one by one, equal to the last bit.

    Args:
        equations: Settings and equations of the samples.
        effort: Efforts by axle, shared with the owner, who adds to them.
        load: Measured loads by axle, likewise.

    """

    def __init__(
        self,
        equations: SampleEquations,
        effort: dict[int, SignalHistory],
        load: dict[int, SignalHistory],
    ) -> None:
        self._effort, self._load = effort, load
        self._direction = SignalHistory(inf)
        self._shares = equations.transfer
        self._lag_us = max(equations.effort_lag_us, 0)
        self._longest_us = equations.gap_us(Role.AXLE_LOAD)
        self._age_us = equations.load_age_us
        self.gain = LoadGain(float(np.mean(equations.vehicle.axle_load)))
        self._learnt_us = np.iinfo(np.int64).min
        self._efforts_by_stamp: dict[int, list[float | None]] = {}

    def turn(self, t_us: int, travel: float) -> None:
        """Add a direction of travel, 1 or −1."""
        self._direction.add(t_us, travel)

    def learn(self, now_us: int) -> None:
        """Learn from the loads whose efforts are known.

        Args:
            now_us: Current time, µs; no reading stamped before it is still to come.

        """
        limit = now_us - self._lag_us - 1
        if self._shares is None or limit <= self._learnt_us:
            return
        changes = []
        for axle, history in self._load.items():
            first = max(bisect_right(history.times, self._learnt_us), 1)
            for last in range(first, bisect_right(history.times, limit)):
                before, t_us = history.times[last - 1 : last + 1]
                old, new = history.values[last - 1 : last + 1]
                if old is None or new is None or t_us - before > self._longest_us:
                    continue
                transfer, known = self._transfer(axle, before, t_us)
                if known:
                    changes.append((t_us, axle, transfer, new - old))
        self._learnt_us = limit
        if changes:
            t, _, transfers, loads = zip(*sorted(changes), strict=True)
            self.gain.learn(Changes(np.array(t), np.array(transfers), np.array(loads)))

    def since(self, axle: int, read_us: int, t_us: int) -> float:
        """Load that the efforts have moved to an axle since its load was read, N."""
        return self._transfer(axle, read_us, t_us)[0]

    def efforts(self, t_us: list[int]) -> Array:
        """Last efforts of all axles at stamps, N, shape (n, axles); NaN where not known."""
        return np.array([self._held_efforts(stamp) for stamp in t_us], dtype=np.float64)

    def travel(self, t_us: list[int]) -> Array:
        """Direction of travel at stamps: 1 forwards or unknown, −1 in reverse."""
        held = (self._direction.held_at(stamp) for stamp in t_us)
        return np.array([1.0 if reading is None else reading[1] for reading in held])

    def forget_before(self, t_us: int) -> None:
        """Drop what no sample at or after a stamp needs."""
        for history in (self._direction, *self._load.values(), *self._effort.values()):
            history.forget_before(t_us - self._age_us)
        self.gain.forget_before(t_us)
        self._efforts_by_stamp.clear()

    def _transfer(self, axle: int, before: int, t_us: int) -> tuple[float, bool]:
        """Load that the efforts known at two stamps move, N, and whether all are known."""
        if self._shares is None:
            return 0.0, True
        moved, known = 0.0, True
        both = zip(self._held_efforts(before), self._held_efforts(t_us), strict=True)
        for share, (old, new) in zip(self._shares[axle - 1], both, strict=True):
            if old is None or new is None:
                known = False
            else:
                moved += share * (new - old)
        direction = self._direction.held_at(t_us)
        return (moved if direction is None else moved * direction[1]), known

    def _held_efforts(self, t_us: int) -> list[float | None]:
        """Last efforts of all axles at a stamp, N; None where there is none."""
        if t_us not in self._efforts_by_stamp:
            held = [history.held_at(t_us) for history in self._effort.values()]
            self._efforts_by_stamp[t_us] = [reading and reading[1] for reading in held]
        return self._efforts_by_stamp[t_us]
