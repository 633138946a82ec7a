"""How far the samples of a recording lie from the curve: what an extended model is worth there.

The figure is the RMSE of the measured adhesion about factor · curve(slip'), with the factor and
slip' of the model's effects, or 1 and the slip where there is no model. The curve is the one that
fits the stretch of constant rail best. It is not the curve that the estimator held: that follows a
slow effect as it follows the rail, and takes a fast one for another rail, so that its own error
tells little of the effect (0.2 % for a humidity that a diagnosis finds to be worth 37 %).

100 (1 − with/without) is what the model gains. Of 16 effects on a drive of 240 s it came within 5
percentage points of the diagnosis, but for a late vehicle speed (66 % against 74 %).
"""

from dataclasses import replace
from itertools import pairwise
from typing import NamedTuple

import numpy as np
import scipy
from numpy.typing import NDArray

from adhesion_can.arrays import Array
from adhesion_can.config import Configuration
from adhesion_can.estimation.batch_fit import (
    LOWER,
    UPPER,
    SegmentationSettings,
    change_points,
    fit,
)
from adhesion_can.estimation.extended.correction import without_effects
from adhesion_can.estimation.likelihood import innovation, sensitivity
from adhesion_can.physics.effects import LagStates
from adhesion_can.physics.samples import Samples

SMOOTH_US = 50_000
"""To either side: the noise of the vehicle speed fades, a sweep of the slip stays as it is."""
AROUND_US = 2_000_000
"""Samples so close to a change of the rail are left out: each axle finds it at its own time."""
OTHER = 0.25
"""Rails differ where one curve for both misses the shorter one's adhesion by such a share of its
root mean square in both. Effects do less: an effort that reads a tenth of the load wrong, say."""
MOST_ROWS = 6_000
"""Of a stretch, to judge that by."""
CHUNK = 4096
"""Samples that the effects are taken out of at a time."""
FEWEST = 200


class Misfit(NamedTuple):
    """How far measured adhesion lies from the curve.

    Attributes:
        rmse: of the measured adhesion.
        samples: that it is of.
        stretches: of constant rail, each with a curve of its own.

    """

    rmse: float
    samples: int
    stretches: int


class _Rows(NamedTuple):
    """Columns that are kept of the samples: time since the first one, slip', measured adhesion."""

    since_us: Array
    axle: Array
    slip: Array
    adhesion: Array
    factor: Array

    def at(self, rows: slice | NDArray[np.int64]) -> "_Rows":
        """Some of them."""
        return _Rows(*(column[rows] for column in self))

    @property
    def base(self) -> Samples:
        """As points of the base curve."""
        return Samples.curve(self.slip, self.adhesion / self.factor, self.since_us.astype(np.int64))


class CurveFit:
    """Gathers the samples of a replay and tells their misfit; see the module.

    Args:
        configuration: with the extended model, where there is one.
        most: samples that are kept; a longer recording is told by a part of its seconds.

    """

    def __init__(self, configuration: Configuration, most: int = 500_000) -> None:
        model = configuration.model
        self._actives = () if model is None else model.in_contact
        self._axles = configuration.vehicle.axles
        self._slip_max = configuration.estimators.identifiability.slip_max
        self._memory = LagStates()
        self._waiting: list[Samples] = []
        self._count = 0
        self._origin_us: int | None = None
        self._most, self._stride = most, 1
        self._kept: list[Array] = []
        self._size = 0

    def take(self, samples: Samples) -> None:
        """Samples of an update, as the service formed them."""
        if not len(samples):
            return
        if self._origin_us is None:
            self._origin_us = int(samples.t_us[0])
        # Columns come and go with their signals; only like ones can be put together.
        if self._waiting and self._waiting[-1].covariates.keys() != samples.covariates.keys():
            self._correct()
        self._waiting.append(samples)
        self._count += len(samples)
        if self._count >= CHUNK:
            self._correct()

    def result(self) -> Misfit | None:
        """The misfit; None where there are too few samples to speak of one."""
        self._correct()
        if self._size < FEWEST:
            return None
        table = np.concatenate(self._kept)
        rows = _Rows(*table[np.argsort(table[:, 0], kind="stable")].T)
        rows = rows._replace(slip=_smooth(rows))
        edges = _rails(rows)
        left, steady = [], np.ones(len(rows.slip), dtype=np.bool_)
        for first, last in pairwise([0, *edges, len(rows.slip)]):
            left.append(_left(rows.at(slice(first, last))))
        for edge in edges:
            steady &= np.abs(rows.since_us - rows.since_us[edge]) > AROUND_US
        used = np.concatenate(left)[steady]
        if len(used) < FEWEST:
            return None
        return Misfit(float(np.sqrt(np.mean(used * used))), len(used), len(edges) + 1)

    def _correct(self) -> None:
        """Take the effects out of what waits, and keep it."""
        if not self._waiting or self._origin_us is None:
            return
        samples = Samples.concatenate(self._waiting)
        self._waiting, self._count = [], 0
        factor = np.ones(len(samples))
        if self._actives:
            # A variance of 1 comes back as 1/factor².
            unit = replace(samples, adhesion_var=factor)
            samples = without_effects(
                unit, self._actives, self._origin_us, self._axles, self._memory
            ).samples
            factor = 1.0 / np.sqrt(samples.adhesion_var)
        usable = np.isfinite(samples.adhesion) & (np.abs(samples.slip) <= self._slip_max)
        rows = _Rows(
            (samples.t_us - self._origin_us).astype(np.float64),
            samples.axle.astype(np.float64),
            samples.slip,
            samples.adhesion * factor,
            factor,
        )
        self._keep(np.column_stack(rows)[usable])

    def _keep(self, table: Array) -> None:
        """Keep rows of every second, or of one in two, four, .. where they become too many."""
        self._kept.append(table[table[:, 0] // 1e6 % self._stride == 0])
        self._size += len(self._kept[-1])
        while self._size > self._most:
            self._stride *= 2
            whole = np.concatenate(self._kept)
            self._kept = [whole[whole[:, 0] // 1e6 % self._stride == 0]]
            self._size = len(self._kept[0])


def _smooth(rows: _Rows) -> Array:
    """Means of the slip over ±SMOOTH_US, axle by axle, as many to either side; shape (n,)."""
    out = rows.slip.copy()
    for number in np.unique(rows.axle):
        own = np.flatnonzero(rows.axle == number)
        at, place = rows.since_us[own], np.arange(len(own))
        before = place - np.searchsorted(at, at - SMOOTH_US, side="left")
        after = np.searchsorted(at, at + SMOOTH_US, side="right") - 1 - place
        reach = np.minimum(before, after)
        sums = np.concatenate([[0.0], np.cumsum(rows.slip[own])])
        out[own] = (sums[place + reach + 1] - sums[place - reach]) / (2 * reach + 1)
    return out


def _left(rows: _Rows) -> Array:
    """Measured adhesion less that of the curve that fits it best, in the branch of traction."""
    base, factor = rows.base, rows.factor
    h, z = base.folded()
    # To the base curve's points without weights, which is near; then as they were measured.
    start = np.clip(np.array(fit(base).theta), 1.001 * LOWER + 1e-6, 0.999 * UPPER)
    found = scipy.optimize.least_squares(
        lambda theta: factor * innovation(theta, h, z),
        start,
        jac=lambda theta: -factor[:, None] * sensitivity(theta, h),
        bounds=(LOWER, UPPER),
        x_scale=np.maximum(start, 1e-3),
    )
    return np.asarray(found.fun)


def _rails(rows: _Rows) -> list[int]:
    """Rows at which the rail changed, ascending.

    Of the changes that `identify` would see, those that make a difference which no effect makes.
    """
    edges = change_points(rows.base, SegmentationSettings())

    def square(first: int, last: int) -> float:
        """Mean square that one curve leaves of these rows, times their number."""
        part = rows.at(slice(first, last, max((last - first) // MOST_ROWS, 1)))
        return float(np.mean(_left(part) ** 2)) * (last - first)

    level = np.concatenate([[0.0], np.cumsum(rows.adhesion**2)])

    def miss(place: int) -> float:
        """Mean square that one curve misses of the shorter stretch, over that of the adhesion."""
        first, middle, last = bounds[place : place + 3]
        missed = (both[place] - own[place] - own[place + 1]) / min(middle - first, last - middle)
        return float(missed / max((level[last] - level[first]) / (last - first), 1e-300))

    bounds = [0, *edges, len(rows.slip)]
    own = [square(a, b) for a, b in pairwise(bounds)]
    both = [square(a, c) for a, c in zip(bounds[:-2], bounds[2:], strict=True)]
    while both:
        misses = [miss(place) for place in range(len(both))]
        least = int(np.argmin(misses))
        if misses[least] >= OTHER**2:
            break
        del bounds[least + 1]
        own[least : least + 2] = [both.pop(least)]
        for place in (least - 1, least):
            if 0 <= place < len(both):
                both[place] = square(bounds[place], bounds[place + 2])
    return bounds[1:-1]
