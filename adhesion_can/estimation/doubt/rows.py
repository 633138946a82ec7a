"""Rows of the regression: samples as values of the slip basis and of all directions."""

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from adhesion_can.arrays import Array
from adhesion_can.estimation.doubt import slip_basis
from adhesion_can.estimation.doubt.directions import (
    BIAS_UNIT,
    CREEP_SPEED,
    EFFORT_BIAS,
    EFFORT_DELAY,
    INERTIA,
    INERTIA_UNIT,
    LEVEL,
    LOAD,
    LOAD_UNIT,
    RADIUS,
    RELAXATION,
    SPEED,
    SPEED_DELAY,
    SPEED_SCALE,
    SPEED_UNIT,
    SURROUNDINGS,
    TIME,
    TIME_UNIT,
    TRACTION,
    WORK_S,
    ResidualDirection,
)
from adhesion_can.physics.burckhardt import CurveParameters
from adhesion_can.physics.samples import Samples
from adhesion_can.values import Stateful

SMOOTH = 5
"""Number of samples of an axle over which rates are averaged."""
LATEST = 30
"""Number of the latest samples whose mean conditions are the present ones."""


class Rows(NamedTuple):
    """Samples as rows of a regression that is linear in k coefficients.

    The first coefficients are those of the slip basis, the others the sizes of the directions.

    Attributes:
        columns: Values of the basis and the directions, shape (n, k).
        slopes: Derivatives of the columns by the slip ratio, shape (n, k).
        response: Measured adhesion, corrected for the curve's bend within the slip's error, (n,).
        weight: Inverse variances of the response, shape (n,).
        slip_var: Variances of the slip ratio, shape (n,).
        level: Derivatives of the curve by its level c1, shape (n,).
        level_noise: Expected square of the weighted sum of errors along the level of the curve.
        curve_square: Weighted sum of squares of the curve.
        present: Value that multiplies the curve under the present conditions, by direction.

    """

    columns: Array
    slopes: Array
    response: Array
    weight: Array
    slip_var: Array
    level: Array
    level_noise: float
    curve_square: float
    present: Mapping[str, float]


class RowBuilder(Stateful):
    """Builds rows from the samples of a drive, block after block.

    Args:
        directions: Directions of the regression.
        axles: Number of axles of the vehicle.

    """

    def __init__(self, directions: Sequence[ResidualDirection], axles: int) -> None:
        self._names = tuple(direction.name for direction in directions)
        self._axles = axles
        self._work: dict[tuple[str, int], tuple[float, float]] = {}
        """By direction and axle: time of the latest sample, s, and slip work then."""
        self._since_s: float | None = None

    def begin_surface(self) -> None:
        """Start a new surface with the next samples."""
        self._since_s = None

    def build(self, samples: Samples, theta: CurveParameters, noise_std: float) -> Rows:
        """Rows of samples.

        Args:
            samples: Samples in the order of their stamps, at least one.
            theta: Parameters (c1, c2, c3) of the curve so far.
            noise_std: Standard deviation of the adhesion noise.

        """
        c1, c2, c3 = theta
        sign = np.where(samples.slip < 0.0, -1.0, 1.0)
        size = np.abs(samples.slip)
        decay = np.exp(-c2 * size)
        level, slope = c1 * (1.0 - decay) - c3 * size, c1 * c2 * decay - c3
        curvature = c1 * c2 * c2 * decay
        curve = _Curve(sign * level, slope, -sign * curvature)
        values, slopes = slip_basis.evaluate(size)
        factors, errors, present = self._directions(samples, curve)
        columns, derivatives = [sign[:, None] * values], [slopes]
        zero = np.zeros(len(size))
        for name in self._names:
            if name in factors:
                value, slope_of = factors[name] * curve.adhesion, factors[name] * curve.slope
            else:
                value, slope_of = errors.get(name, (zero, zero))
            columns.append(value[:, None])
            derivatives.append(slope_of[:, None])
        # The slope from the adhesion: a weight correlated with the slip's error biases the curve.
        rest = np.clip(c1 - c3 * size - np.abs(samples.adhesion), 0.0, c1)
        by_adhesion = (c2 * rest - c3) ** 2
        slip_var = samples.slip_total_var
        adhesion_var = noise_std * noise_std + samples.transient_var
        weight = 1.0 / (adhesion_var + by_adhesion * slip_var)
        # Of the level's expected square, the vehicle speed's error is common to a group.
        by_level = (1.0 - decay) * sign
        along = weight * by_level
        private = float(np.sum(along * along * (adhesion_var + by_adhesion * samples.slip_var)))
        _, member = np.unique(samples.speed_us, return_inverse=True)
        common = np.bincount(member, along * slope * np.sqrt(samples.slip_common_var))
        return Rows(
            np.hstack(columns),
            np.hstack(derivatives),
            samples.adhesion - 0.5 * sign * curvature * slip_var,
            weight,
            slip_var,
            by_level,
            private + float(common @ common),
            float(weight @ (level * level)),
            present,
        )

    def _directions(
        self, samples: Samples, curve: "_Curve"
    ) -> tuple[dict[str, Array], dict[str, tuple[Array, Array]], dict[str, float]]:
        """Factors of the curve, other columns with their slopes, and present conditions."""
        time_s = np.asarray(samples.t_us * 1e-6, dtype=np.float64)
        if self._since_s is None:
            self._since_s = float(time_s[0])
        rates = _rates(samples, time_s)
        speed, load = samples.speed, samples.load
        factors = {
            LOAD: np.log(load / LOAD_UNIT),
            SPEED: speed / SPEED_UNIT - 1.0,
            CREEP_SPEED: np.abs(samples.slip) * speed,
            TIME: (time_s - self._since_s) / TIME_UNIT,
            **self._slip_work(samples, time_s, curve),
        }
        for name, scale in SURROUNDINGS.items():
            if name in samples.covariates:
                value = (samples.covariates[name] - scale.shift) / scale.unit
                factors[name] = np.nan_to_num(np.abs(value) if scale.absolute else value)
        present = {name: float(np.mean(value[-LATEST:])) for name, value in factors.items()}
        present[CREEP_SPEED] = float(np.mean(speed[-LATEST:]))
        present[TRACTION] = float(np.sign(np.mean(samples.adhesion[-LATEST:])))
        factors[TRACTION] = np.where(samples.slip < 0.0, -1.0, 1.0)
        # A relative error of the speed or of a radius moves the slip by 1 + λ.
        scaled = curve.slope * (1.0 + samples.slip), curve.curvature
        zero = np.zeros(len(speed))
        errors = {
            SPEED_SCALE: scaled,
            EFFORT_BIAS: (BIAS_UNIT / load, zero),
            SPEED_DELAY: _times(-rates.speed / np.maximum(speed, 1.0), scaled),
            EFFORT_DELAY: _times(-rates.slip, (curve.slope, curve.curvature)),
            INERTIA: (INERTIA_UNIT * rates.rim_speed / load, zero),
            RELAXATION: _times(-rates.slip / speed, (curve.slope, curve.curvature)),
        }
        for axle in range(1, self._axles + 1):
            # Against the mean of all axles.
            against_mean = (samples.axle == axle) - 1.0 / self._axles
            errors[f"{RADIUS} {axle}"] = _times(against_mean, scaled)
            factors[f"{LEVEL} {axle}"] = against_mean
        return factors, errors, present

    def _slip_work(self, samples: Samples, time_s: Array, curve: "_Curve") -> dict[str, Array]:
        """Slip work of each axle per load, m, exponentially forgotten; by direction."""
        power = np.abs(curve.adhesion * samples.slip) * samples.speed
        work = {name: np.zeros(len(time_s)) for name in WORK_S}
        for axle in np.unique(samples.axle).tolist():
            rows = np.flatnonzero(samples.axle == axle)
            at = time_s[rows]
            for name, constant_s in WORK_S.items():
                last_s, before = self._work.get((name, axle), (float(at[0]), 0.0))
                steps = np.diff(at, prepend=last_s)
                # Long gaps are forgotten by exp(−30) at most: the product must not overflow.
                elapsed = np.minimum(np.cumsum(steps) / constant_s, 30.0)
                growth = np.exp(elapsed)
                done = (before + np.cumsum(power[rows] * steps * growth)) / growth
                work[name][rows] = done
                self._work[name, axle] = float(at[-1]), float(done[-1])
        return work


class _Curve(NamedTuple):
    """Signed adhesion of the curve at the samples, its slope, and the slope's derivative, (n,)."""

    adhesion: Array
    slope: Array
    curvature: Array


class _Rates(NamedTuple):
    """Rates of slip (1/s), vehicle speed (m/s²) and rim speed (m/s²) at the samples, (n,)."""

    slip: Array
    speed: Array
    rim_speed: Array


def _times(factor: Array, column: tuple[Array, Array]) -> tuple[Array, Array]:
    return factor * column[0], factor * column[1]


def _rates(samples: Samples, time_s: Array) -> _Rates:
    """Central differences of each axle's smoothed values; 0 for axles with few samples.

    0 also for axles whose stamps do not rise.
    """
    signals = np.stack([samples.slip, samples.speed, (1.0 + samples.slip) * samples.speed])
    order = np.argsort(samples.axle, kind="stable")
    axle, at = samples.axle[order], time_s[order]
    # First and last row of the axle of each row: windows end there.
    first, last = np.searchsorted(axle, axle), np.searchsorted(axle, axle, "right") - 1
    row = np.arange(len(axle))

    def neighbours(step: int) -> NDArray[np.int64]:
        return np.minimum(np.maximum(row + step, first), last)

    half, sorted_signals = SMOOTH // 2, signals[:, order]
    window = [sorted_signals[:, neighbours(step)] for step in range(-half, half + 1)]
    smooth = np.mean(window, axis=0)
    before, after = neighbours(-1), neighbours(1)
    elapsed = at[after] - at[before]
    falls = np.bincount(first, (at - at[before] <= 0.0) & (row > first), len(axle))[first] > 0
    good = (last - first >= SMOOTH) & ~falls
    rates = np.zeros_like(signals)
    steps = smooth[:, after] - smooth[:, before]
    rates[:, order[good]] = steps[:, good] / elapsed[good]
    return _Rates(*rates)
