"""Deviation of a recording's samples from the curve: the worth of an extended model there.

The figure is the RMSE of the measured adhesion about factor · curve(slip'), with the factor and
slip' of the model's effects, or 1 and the slip where there is no model. The curve is the one that
fits the segment of constant surface best. It is not the curve that the estimator held: that one
follows a slow effect as it follows the surface, and mistakes a fast one for another surface, so its
own error shows little of the effect (0.2 % for a humidity that a diagnosis finds to be worth 37 %).

100 (1 − with/without) is the gain of the model. Of 16 effects on a drive of 240 s it came within 5
percentage points of the diagnosis, but for a late vehicle speed (66 % against 74 %).
"""

from dataclasses import replace
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from adhesion_can.arrays import Array
from adhesion_can.config import Configuration
from adhesion_can.estimation.batch_fit import SegmentationSettings, change_points, fit
from adhesion_can.estimation.curves.gauss_newton import NormalEquations, minimise, normal_equations
from adhesion_can.estimation.extended.correction import remove_effects, scale_to_usual
from adhesion_can.estimation.likelihood import innovation, sensitivity
from adhesion_can.estimation.variable_projection import LOWER, UPPER
from adhesion_can.physics.effects import LagStates
from adhesion_can.physics.samples import Samples

SMOOTH_US = 50_000
"""Half width of the mean over the slip, µs: it removes the noise of the vehicle speed and leaves a
sweep of the slip as it is."""
AROUND_US = 2_000_000
"""Time around a change of the surface, µs, whose samples are left out: each axle reaches the new
surface at its own time."""
SURFACES_DIFFER = 0.25
"""Smallest relative error by which two surfaces differ: that of one curve for both in the shorter
segment, over the root mean square of the adhesion in both. Effects cause less, for example an
effort that is wrong by a tenth of the load."""
MOST_ROWS = 6_000
"""Largest number of rows of a segment that are used to compare surfaces."""
CHUNK = 4096
"""Number of samples from which the effects are removed at once."""
FEWEST = 200
"""Smallest number of samples that give a misfit."""


class CurveMisfit(NamedTuple):
    """Deviation of the measured adhesion from the best-fitting curves.

    Attributes:
        rmse: Root mean square error of the adhesion coefficient.
        samples: Number of samples used.
        segments: Number of segments of constant surface, each with a curve of its own.

    """

    rmse: float
    samples: int
    segments: int

    def to_dict(self) -> dict[str, float | int]:
        """Entry for `--json`; `stretches` is an earlier name of `segments`."""
        segments = {"segments": self.segments, "stretches": self.segments}
        return {"rmse": self.rmse, "samples": self.samples, **segments}


class _Rows(NamedTuple):
    """Columns of the samples that are kept; shape (n,) each.

    Attributes:
        since_us: Time since the first sample, µs.
        axle: Number of the axle.
        slip: Slip ratio with the effects removed, slip'.
        adhesion: Measured adhesion coefficient.
        factor: Factor of the effects on the curve.

    """

    since_us: Array
    axle: Array
    slip: Array
    adhesion: Array
    factor: Array

    def select(self, rows: slice | NDArray[np.int64]) -> "_Rows":
        """The rows that a slice or an index array selects."""
        return _Rows(*(column[rows] for column in self))

    @property
    def base(self) -> Samples:
        """Samples of the base curve: the effects are removed from slip and adhesion."""
        return Samples.curve(self.slip, self.adhesion / self.factor, self.since_us.astype(np.int64))


class MisfitCollector:
    """Collects the samples of a replay, and computes their misfit.

    Args:
        configuration: Configuration, with the extended model where there is one.
        most: Largest number of samples that are kept; of a longer recording every second, fourth,
            ... second is used.

    """

    def __init__(self, configuration: Configuration, most: int = 500_000) -> None:
        model = configuration.model
        self._actives = () if model is None else model.in_contact
        self._axles = configuration.vehicle.axles
        self._slip_max = configuration.estimators.identifiability.slip_max
        self._memory = LagStates()
        self._scaled = False
        self._waiting: list[Samples] = []
        self._count = 0
        self._origin_us: int | None = None
        self._most, self._stride = most, 1
        self._kept: list[Array] = []
        self._size = 0

    def add(self, samples: Samples) -> None:
        """Add the samples of a due time."""
        if not len(samples):
            return
        if self._origin_us is None:
            self._origin_us = int(samples.t_us[0])
        # Columns come and go with their signals; only like ones can be put together.
        if self._waiting and self._waiting[-1].covariates.keys() != samples.covariates.keys():
            self._remove_effects()
        self._waiting.append(samples)
        self._count += len(samples)
        if self._count >= CHUNK:
            self._remove_effects()

    def compute(self) -> CurveMisfit | None:
        """Misfit of all samples; None where there are too few."""
        self._remove_effects()
        if self._size < FEWEST:
            return None
        table = np.concatenate(self._kept)
        rows = _Rows(*table[np.argsort(table[:, 0], kind="stable")].T)
        rows = rows._replace(slip=_smooth(rows))
        edges = _find_surface_changes(rows)
        residuals, steady = [], np.ones(len(rows.slip), dtype=np.bool_)
        for first, last in pairwise([0, *edges, len(rows.slip)]):
            residuals.append(_compute_residuals(rows.select(slice(first, last))))
        for edge in edges:
            steady &= np.abs(rows.since_us - rows.since_us[edge]) > AROUND_US
        used = np.concatenate(residuals)[steady]
        if len(used) < FEWEST:
            return None
        return CurveMisfit(float(np.sqrt(np.mean(used * used))), len(used), len(edges) + 1)

    def _remove_effects(self) -> None:
        """Remove the effects from the samples that wait, and keep what is left."""
        if not self._waiting or self._origin_us is None:
            return
        samples = Samples.concatenate(self._waiting)
        self._waiting, self._count = [], 0
        factor = np.ones(len(samples))
        if self._actives:
            # A variance of 1 comes back as 1/factor².
            unit = replace(samples, adhesion_var=factor)
            origin, axles = self._origin_us, self._axles
            if not self._scaled:
                scaled = scale_to_usual(unit, self._actives, origin, axles)
                self._scaled, self._actives = scaled is not None, scaled or self._actives
            samples = remove_effects(unit, self._actives, origin, axles, self._memory).samples
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
        """Keep the rows of every second, or of one in two, four, ... where there are too many."""
        self._kept.append(table[table[:, 0] // 1e6 % self._stride == 0])
        self._size += len(self._kept[-1])
        while self._size > self._most:
            self._stride *= 2
            whole = np.concatenate(self._kept)
            self._kept = [whole[whole[:, 0] // 1e6 % self._stride == 0]]
            self._size = len(self._kept[0])


def _smooth(rows: _Rows) -> Array:
    """Centred moving average of the slip over ±SMOOTH_US, axle by axle; shape (n,)."""
    out = rows.slip.copy()
    for number in np.unique(rows.axle):
        axle_rows = np.flatnonzero(rows.axle == number)
        at, place = rows.since_us[axle_rows], np.arange(len(axle_rows))
        before = place - np.searchsorted(at, at - SMOOTH_US, side="left")
        after = np.searchsorted(at, at + SMOOTH_US, side="right") - 1 - place
        reach = np.minimum(before, after)
        sums = np.concatenate([[0.0], np.cumsum(rows.slip[axle_rows])])
        out[axle_rows] = (sums[place + reach + 1] - sums[place - reach]) / (2 * reach + 1)
    return out


def _compute_residuals(rows: _Rows) -> Array:
    """Measured adhesion less that of the best-fitting curve, with traction's sign; shape (n,)."""
    base, factor = rows.base, rows.factor
    h, z = base.folded()
    # To the base curve's points without weights, which is near; then as they were measured.
    weight = factor * factor

    def evaluate(theta: Array) -> NormalEquations:
        return normal_equations(innovation(theta, h, z), sensitivity(theta, h).T, weight)

    start = np.array(fit(base).theta)
    theta, _ = minimise(evaluate, start, (LOWER, UPPER), steps=100, converged=1e-8)
    return np.asarray(factor * innovation(theta, h, z))


def _find_surface_changes(rows: _Rows) -> list[int]:
    """Rows at which the surface changed, ascending.

    They are the changes that `identify` would find, less those that an effect could cause.
    """
    edges = change_points(rows.base, SegmentationSettings())

    def sum_of_squares(first: int, last: int) -> float:
        """Sum of the squared residuals of one curve for the rows, scaled up from a part of them."""
        part = rows.select(slice(first, last, max((last - first) // MOST_ROWS, 1)))
        return float(np.mean(_compute_residuals(part) ** 2)) * (last - first)

    level = np.concatenate([[0.0], np.cumsum(rows.adhesion**2)])

    def relative_error(place: int) -> float:
        """Mean square error of one curve for both in the shorter segment, relative to adhesion²."""
        first, middle, last = bounds[place : place + 3]
        error = (both[place] - per_segment[place] - per_segment[place + 1]) / min(
            middle - first, last - middle
        )
        return float(error / max((level[last] - level[first]) / (last - first), 1e-300))

    bounds = [0, *edges, len(rows.slip)]
    per_segment = [sum_of_squares(a, b) for a, b in pairwise(bounds)]
    both = [sum_of_squares(a, c) for a, c in zip(bounds[:-2], bounds[2:], strict=True)]
    while both:
        errors = [relative_error(place) for place in range(len(both))]
        least = int(np.argmin(errors))
        if errors[least] >= SURFACES_DIFFER**2:
            break
        del bounds[least + 1]
        per_segment[least : least + 2] = [both.pop(least)]
        for place in (least - 1, least):
            if 0 <= place < len(both):
                both[place] = sum_of_squares(bounds[place], bounds[place + 2])
    return bounds[1:-1]
