"""Fit of the Burckhardt curve to samples whose slips have errors of stated variances.

Least squares take slips as exact: errors of the slip flatten the curve where it is steep and move
its peak (regression dilution; Fuller, "Measurement Error Models", 1987). Here each product in the
sum of squares is replaced by one that has its expectation at the true slip (corrected scores;
Nakamura, Biometrika 77 (1990) 127). For exponentials and normal errors that is exact:

    e^(−c λ) at the true slip is the mean of e^(−c h − c² p/2) at the measured slip h of variance p.

It holds whatever samples share an error, so the error of the vehicle speed counts like that of the
wheel speed. What is shared, and what lasts, enters the standard errors: they are those of a
sandwich, with the scatter of the scores over blocks of time in its middle (Liang & Zeger,
Biometrika 73 (1986) 13).

Weights must not know a sample's own errors. They come from the slips of the same axle a little
before and after, and so do the branch of a slip near zero, and whether an axle coasts.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from adhesion_can.arrays import Array
from adhesion_can.estimation.likelihood import UNDETERMINED, StandardErrors
from adhesion_can.estimation.variable_projection import (
    LOWER,
    UPPER,
    fit_least_squares,
    solve_two_by_two,
)
from adhesion_can.physics.burckhardt import peak, peak_gradient
from adhesion_can.physics.samples import Samples

CERTAIN_STDS = 4.0
"""Standard deviations beyond which a slip or an adhesion is not zero."""
WIDEST = 0.25
"""c2² var(λ) beyond which a sample is left out: its error is as wide as the bend of the curve."""
REWEIGHTINGS, SETTLED = 6, 1e-4
"""Largest number of fits with weights from the one before, and the relative change of c2 at which
no more follow."""
LEAST_NOISE = 0.05
"""Least share of the residual variance that counts as noise of the adhesion."""
BLOCK_US = 1_000_000
"""Duration of a block of the sandwich, µs; errors that last longer are not in it."""
LEAST_BLOCKS = 8
"""Number of blocks below which blocks are shorter."""
STEPS, TOLERANCE = 60, 1e-9
"""Largest number of steps of the search for ln c2, and the change at which it ends."""
FEWEST_BLOCKS = 4
"""Number of blocks below which nothing is known of the errors."""
LEAST_CURVATURE, LEAST_REST = 1e-14, 1e-3
"""Least ratio of the eigenvalues of the curvature, and least share of it without a block."""
STEP = 1e-4
"""Relative step of the differences for the curvature of the sum of squares."""


class CurveFit(NamedTuple):
    """Fit of a curve.

    Attributes:
        theta: Parameters (c1, c2, c3), shape (3,).
        noise_std: Standard deviation of the adhesion about the curve, errors of the slip excluded.
        errors: Standard errors of parameters and peak.
        reached: Slips that were reached whatever their error, shape (n,).

    """

    theta: Array
    noise_std: float
    errors: StandardErrors
    reached: Array


class _Rows(NamedTuple):
    """Samples on one branch, shape (n,) each.

    Attributes:
        slip: Slip ratio, negative only within its error.
        adhesion: Adhesion coefficient, with the sign that it has beside the slip.
        slip_var: Variance of the slip's error.
        further: Variance of the adhesion beyond the noise of all samples.
        place: Slip by the samples before and after, whose errors are others.
        block: Number of the block of time.

    """

    slip: Array
    adhesion: Array
    slip_var: Array
    further: Array
    place: Array
    block: NDArray[np.int64]

    def select(self, rows: NDArray[np.bool_]) -> "_Rows":
        """Rows that a mask names."""
        return _Rows(
            self.slip[rows],
            self.adhesion[rows],
            self.slip_var[rows],
            self.further[rows],
            self.place[rows],
            self.block[rows],
        )


def fit_with_errors(samples: Samples, slip_max: float) -> CurveFit | None:
    """Fit of a curve to samples with errors of their slips.

    Args:
        samples: Samples in the order of their stamps, finite.
        slip_max: Largest slip ratio of the model.

    Returns:
        Fit; None where too few samples carry information.

    """
    rows = _rows_of(samples)
    if len(rows.slip) < 3:
        return None
    theta = fit_least_squares(np.abs(rows.slip), np.copysign(1.0, rows.slip) * rows.adhesion)
    noise_var = max(_plain_variance(rows, theta), 1e-18)
    for _ in range(REWEIGHTINGS):
        narrow = theta[1] ** 2 * rows.slip_var <= WIDEST
        kept = rows.select(narrow) if not narrow.all() else rows
        if len(kept.slip) < 3:
            return None
        weight, before = _weights(kept, theta, noise_var), float(theta[1])
        theta, cost = _minimise(kept, weight, before)
        least = LEAST_NOISE * _plain_variance(kept, theta)
        noise_var = max(cost / float(weight.sum()), least, 1e-18)
        if abs(float(theta[1]) / before - 1.0) < SETTLED:
            break
    errors = _standard_errors(kept, weight, theta, slip_max)
    reached = kept.slip - CERTAIN_STDS * np.sqrt(kept.slip_var)
    return CurveFit(theta, float(np.sqrt(noise_var)), errors, reached)


def _rows_of(samples: Samples) -> _Rows:
    """Samples on the branch that their neighbours are on, without axles that coast."""
    order = np.lexsort((samples.t_us, samples.axle))
    s = samples.select(order)
    var = s.slip_total_var
    slip, adhesion = _neighbours(s, s.slip), _neighbours(s, s.adhesion)
    # Means of two on either side: half the variance or less.
    sure = np.abs(slip) >= CERTAIN_STDS * np.sqrt(var)
    carried = sure | (np.abs(adhesion) >= CERTAIN_STDS * np.sqrt(s.adhesion_var))
    sign = np.copysign(1.0, np.where(sure, slip, adhesion))
    since = s.t_us - int(samples.t_us.min())
    length = min(BLOCK_US, max(int(since.max()) // LEAST_BLOCKS, 1))
    rows = _Rows(
        sign * s.slip, sign * s.adhesion, var, s.transient_var, sign * slip, since // length
    )
    return rows.select(carried)


def _neighbours(samples: Samples, value: Array) -> Array:
    """Means of the values of the same axle a little before and after, without shared readings.

    Args:
        samples: Samples by axle, then stamp.
        value: Values, shape (n,).

    """
    frame_us = np.diff(np.unique(samples.speed_us))
    same = samples.axle[1:] == samples.axle[:-1]
    cycle_us = np.diff(samples.t_us)[same]
    if not len(frame_us) or not len(cycle_us):
        return value
    # Two frames of the vehicle speed away no reading is shared, nor is one two wheel speeds away.
    ratio = float(np.median(frame_us)) / max(float(np.median(cycle_us)), 1.0)
    first = int(np.ceil(2.0 * max(ratio, 1.0))) + 1
    total, count = np.zeros(len(value)), np.zeros(len(value))
    limit_us = 2.0 * (first + 1) * float(np.median(cycle_us))
    for step in (first, first + 1):
        if step >= len(value):
            continue
        near = samples.axle[step:] == samples.axle[:-step]
        near &= samples.t_us[step:] - samples.t_us[:-step] <= limit_us
        total[step:] += np.where(near, value[:-step], 0.0)
        total[:-step] += np.where(near, value[step:], 0.0)
        count[step:] += near
        count[:-step] += near
    return np.where(count > 0, total / np.maximum(count, 1.0), value)


def _plain_variance(rows: _Rows, theta: Array) -> float:
    """Mean square of the residuals with the slips as measured."""
    c1, c2, c3 = theta
    curve = -c1 * np.expm1(np.minimum(-c2 * rows.slip, 8.0)) - c3 * rows.slip
    return float(np.mean((rows.adhesion - curve) ** 2))


def _weights(rows: _Rows, theta: Array, noise_var: float) -> Array:
    """Weights σ²/(σ² + a² p + ..) with the slope a at the place of the neighbours."""
    c1, c2, c3 = theta
    slope = c1 * c2 * np.exp(-c2 * np.maximum(rows.place, 0.0)) - c3
    return np.asarray(noise_var / (noise_var + slope * slope * rows.slip_var + rows.further))


class _Products(NamedTuple):
    """Products of each sample with the expectation that they have at its true slip, shape (n,).

    Attributes:
        one: 1 − e^(−c2 λ).
        square: (1 − e^(−c2 λ))².
        mixed: −λ (1 − e^(−c2 λ)).
        slip_square: λ².
        by_one: λ e^(−c2 λ), the derivative of `one` by c2.
        by_square: Derivative of `square` by c2.
        by_mixed: Derivative of `mixed` by c2.

    """

    one: Array
    square: Array
    mixed: Array
    slip_square: Array
    by_one: Array
    by_square: Array
    by_mixed: Array


def _products(rows: _Rows, c2: float) -> _Products:
    h, p = rows.slip, rows.slip_var
    shifted, twice = h + c2 * p, h + 2.0 * c2 * p
    e1 = np.exp(-c2 * (h + 0.5 * c2 * p))
    e2 = np.exp(-2.0 * c2 * shifted)
    by_one = shifted * e1
    return _Products(
        one=1.0 - e1,
        square=1.0 - 2.0 * e1 + e2,
        mixed=by_one - h,
        slip_square=h * h - p,
        by_one=by_one,
        by_square=2.0 * (by_one - twice * e2),
        by_mixed=(p - shifted * shifted) * e1,
    )


def _profile(rows: _Rows, weight: Array, c2: float) -> tuple[float, Array, float]:
    """Derivative of the least sum of squares at c2 by c2, its parameters, and the sum itself."""
    f, wz = _products(rows, c2), weight * rows.adhesion
    aa, ab, bb = (float(weight @ column) for column in (f.square, f.mixed, f.slip_square))
    az, bz, zz = float(wz @ f.one), -float(wz @ rows.slip), float(wz @ rows.adhesion)
    solved = solve_two_by_two(*(np.asarray(value) for value in (aa, ab, bb, az, bz)))
    c1, c3 = (float(value) for value in solved)
    cost = zz - 2.0 * (c1 * az + c3 * bz)
    cost += c1 * c1 * aa + 2.0 * c1 * c3 * ab + c3 * c3 * bb
    change = -2.0 * c1 * float(wz @ f.by_one)
    change += c1 * c1 * float(weight @ f.by_square) + 2.0 * c1 * c3 * float(weight @ f.by_mixed)
    return change, np.array([max(c1, float(LOWER[0])), c2, c3]), cost


def _minimise(rows: _Rows, weight: Array, start: float) -> tuple[Array, float]:
    """Parameters of least corrected sum of squares, and that sum: the zero of its slope in ln c2.

    Args:
        rows: Samples.
        weight: Weights of the samples, shape (n,).
        start: c2 from which to search.

    """
    low = high = float(np.clip(np.log(start), np.log(LOWER[1]), np.log(UPPER[1])))
    below = above = at_start = _profile(rows, weight, float(np.exp(low)))
    step = 0.05
    # The valley lies where the slope turns from falling to rising.
    while below[0] > 0.0 and low > np.log(LOWER[1]):
        high, above = low, below
        low = max(low - step, float(np.log(LOWER[1])))
        below, step = _profile(rows, weight, float(np.exp(low))), 1.6 * step
    while above[0] < 0.0 and high < np.log(UPPER[1]):
        low, below = high, above
        high = min(high + step, float(np.log(UPPER[1])))
        above, step = _profile(rows, weight, float(np.exp(high))), 1.6 * step
    if not (below[0] < 0.0 < above[0]):
        best = min((below, above, at_start), key=lambda profile: profile[2])
        return best[1], best[2]
    return _zero(rows, weight, (low, below), (high, above))


def _zero(
    rows: _Rows,
    weight: Array,
    left: tuple[float, tuple[float, Array, float]],
    right: tuple[float, tuple[float, Array, float]],
) -> tuple[Array, float]:
    """Zero of the slope between two values of ln c2, by the Illinois method."""
    (low, below), (high, above) = left, right
    g_low, g_high = below[0], above[0]
    profile, side = below, 0
    for _ in range(STEPS):
        if high - low <= TOLERANCE:
            break
        x = (low * g_high - high * g_low) / (g_high - g_low)
        profile = _profile(rows, weight, float(np.exp(x)))
        if profile[0] == 0.0:
            break
        if profile[0] < 0.0:
            moved, low, g_low = x - low, x, profile[0]
            g_high *= 0.5 if side == -1 else 1.0
            side = -1
        else:
            moved, high, g_high = high - x, x, profile[0]
            g_low *= 0.5 if side == 1 else 1.0
            side = 1
        if moved <= TOLERANCE:
            break
    return profile[1], profile[2]


def _scores(rows: _Rows, weight: Array, theta: Array) -> Array:
    """Derivatives of half the sum of squares by (c1, c2, c3), sample by sample, shape (3, n)."""
    c1, c2, c3 = theta
    f, z = _products(rows, float(c2)), rows.adhesion
    return np.asarray(
        weight
        * np.stack(
            [
                c1 * f.square + c3 * f.mixed - z * f.one,
                c1 * (0.5 * c1 * f.by_square + c3 * f.by_mixed - z * f.by_one),
                c1 * f.mixed + c3 * f.slip_square + z * rows.slip,
            ]
        )
    )


def _standard_errors(rows: _Rows, weight: Array, theta: Array, slip_max: float) -> StandardErrors:
    """Standard errors by the sandwich over blocks of time, in the jackknife's form.

    Each block's score counts as if the fit had been made without that block (Bell & McCaffrey,
    Survey Methodology 28 (2002) 169): few blocks may hold most of what is known of c2.
    """
    numbers, block = np.unique(rows.block, return_inverse=True)
    count = len(numbers)
    if count < FEWEST_BLOCKS:
        return UNDETERMINED
    # Parameters in units of their size.
    scale = np.maximum(np.abs(theta), np.array([1e-3, 1.0, 1e-2]))

    def block_scores(at: Array) -> Array:
        scores = _scores(rows, weight, at)
        by_block = np.stack([np.bincount(block, row, count) for row in scores], axis=1)
        return np.asarray(by_block * scale)

    change = np.diag(STEP * scale)
    curvature = np.stack(
        [(block_scores(theta + d) - block_scores(theta - d)) / (2.0 * STEP) for d in change], axis=2
    )
    total = curvature.sum(axis=0)
    total = 0.5 * (total + total.T)
    if not np.isfinite(total).all():
        return UNDETERMINED
    values = np.linalg.eigvalsh(total)
    if not values[0] > LEAST_CURVATURE * values[-1]:
        return UNDETERMINED
    inverse = np.linalg.inv(total)
    without = np.eye(3) - curvature @ inverse
    # A block without which the curve is unknown leaves an error that is as large.
    singular = np.abs(np.linalg.det(without)) < LEAST_REST
    without[singular] = np.eye(3) * LEAST_REST ** (1 / 3)
    sums = np.linalg.solve(without, block_scores(theta)[:, :, None])[:, :, 0]
    covariance = inverse @ (sums.T @ sums) @ inverse * np.outer(scale, scale)
    c1, c2, c3 = map(float, theta)
    gradients = peak_gradient(c1, c2, c3, slip_max)
    mu_std, lambda_std = np.sqrt(np.einsum("ij,jk,ik->i", gradients, covariance, gradients))
    interior = bool(peak(c1, c2, c3, slip_max).interior)
    return StandardErrors(covariance, float(mu_std), float(lambda_std) if interior else np.inf)
