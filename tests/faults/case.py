"""One drive of the catalogue: its world, its fault, and when it is at work."""

from collections.abc import Callable
from dataclasses import dataclass
from math import inf

import numpy as np
from numpy.typing import NDArray

from tests.faults.locomotive import AXLES, World
from tests.faults.rail import Floats
from tests.faults.sensors import Readings
from tests.faults.wire import Queue, Sent


@dataclass(frozen=True)
class Case:
    """A fault in a drive.

    Attributes:
        world: The drive.
        onset_s: Time at which the fault begins, s.
        until_s: Time at which it ends, s; infinite: it stays.
        size: Size of the fault, in the unit of its kind.

    """

    world: World
    onset_s: float
    until_s: float = inf
    size: float = 1.0

    @property
    def rng(self) -> np.random.Generator:
        """A new generator, the same each time: one fault on other readings is the same fault."""
        return np.random.default_rng([self.world.seed, 4404])

    @property
    def axle(self) -> int:
        """The axle of a fault that has one, from 0."""
        return int(self.rng.integers(AXLES))

    def active(self, t: Floats) -> NDArray[np.bool_]:
        """Whether the fault is at work at some times, s."""
        return (t >= self.onset_s) & (t < self.until_s)


Spoil = Callable[[Readings, Case], Readings]
Change = Callable[[Floats, Floats, Case], Floats]
"""From the values while the fault is at work, (n, ..), and the time since its onset, s, (n,)."""


def spoil(name: str, change: Change) -> Spoil:
    """A fault that changes a quantity while it is at work, without a look at the past."""

    def apply(readings: Readings, case: Case) -> Readings:
        t = readings.times(name)
        values = np.array(getattr(readings, name))
        on = case.active(t)
        values[on] = change(values[on], t[on] - case.onset_s, case)
        return readings.changed(**{name: values})

    return apply


def both(first: Spoil, second: Spoil) -> Spoil:
    """Two faults at once."""
    return lambda readings, case: second(first(readings, case), case)


def of_axles(change: Change, count: int) -> Change:
    """A change of some axles alone, the first one drawn and those that follow it."""

    def apply(values: Floats, since: Floats, case: Case) -> Floats:
        axles = (case.axle + np.arange(count)) % AXLES
        out = np.array(values)
        out[:, axles] = change(values[:, axles], since, case)
        return out

    return apply


def times(values: Floats, _: Floats, case: Case) -> Floats:
    """Values with another gain: (1 + size) times."""
    return values * (1 + case.size)


def plus(values: Floats, _: Floats, case: Case) -> Floats:
    """Values with an offset, the size."""
    return values + case.size


def late(name: str) -> Spoil:
    """A quantity that comes later by the size, s."""

    def apply(readings: Readings, case: Case) -> Readings:
        t = readings.times(name)
        values = getattr(readings, name)
        by = round(case.size / (t[1] - t[0]))
        place = np.maximum(np.arange(len(t)) - by, 0)
        on = case.active(t)
        return readings.changed(
            **{name: np.where(on.reshape(-1, *[1] * (values.ndim - 1)), values[place], values)}
        )

    return apply


def held(noise: float) -> Change:
    """Values that stand still from the onset on, with noise of this size on them."""

    def change(values: Floats, _: Floats, case: Case) -> Floats:
        if not len(values):
            return values
        own = noise * case.size * case.rng.standard_normal(values.shape)
        return np.broadcast_to(values[0], values.shape) + own

    return change


Queues = dict[str, Queue]
Sents = dict[str, Sent]
