"""The kernels with NumPy: additions of samples and curves; `interface` says what they compute.

What each gives is equal to that of `compiled` to the last bit.
"""

import numpy as np
from numpy.typing import NDArray

from adhesion_can.arrays import Array
from adhesion_can.estimation.tracker.kernels.interface import (
    ADHESION_MAX,
    COASTING_AGE_S,
    LANES,
)
from adhesion_can.estimation.tracker.kernels.plain_increment import increment, node_exponents
from adhesion_can.estimation.tracker.layout import (
    MEASURED,
    NEW_MEAN,
    NEW_PRECISION,
    NEW_SQUARE,
    QUANTILES,
    SUMMARY_COVARIANCE,
    SUMMARY_EFFECTIVE,
    SUMMARY_FALL,
    SUMMARY_HEIGHT,
    SUMMARY_HEIGHT_VAR,
    SUMMARY_LENGTH,
    SUMMARY_MEDIANS,
    SUMMARY_PLACE,
    SUMMARY_PLACE_VAR,
    A,
    B,
    C,
    D,
    E,
    Z,
)

__all__ = [
    "add_to_axles",
    "cost_curves",
    "count_reached",
    "find_valid",
    "increment",
    "judge_coasting",
    "judge_residuals",
    "node_exponents",
    "normalise",
    "pass_time",
    "score",
    "score_terms",
    "summarise",
    "weight_exponents",
]


def find_valid(
    slip: Array,
    adhesion: Array,
    slip_var: Array,
    common_var: Array,
    adhesion_var: Array,
    transient_var: Array,
    load_std: Array,
    slip_max: float,
) -> NDArray[np.bool_]:
    """As `Kernels.find_valid`."""
    further = slip_var + common_var + adhesion_var + transient_var + load_std
    inside = (np.abs(slip) <= slip_max) & (np.abs(adhesion) <= ADHESION_MAX)
    return np.asarray(inside & np.isfinite(further))


def pass_time(
    latest_us: NDArray[np.int64], axle: NDArray[np.int64], t_us: NDArray[np.int64]
) -> Array:
    """As `Kernels.pass_time`."""
    before_us = latest_us.copy()
    latest_us[axle] = t_us
    return np.asarray((latest_us - before_us) * 1e-6)


def judge_coasting(
    slip: Array,
    adhesion: Array,
    slip_var: Array,
    common_var: Array,
    adhesion_var: Array,
    axle: NDArray[np.int64],
    age_s: Array,
    less: Array,
    means: Array,
    far: float,
) -> NDArray[np.bool_]:
    """As `Kernels.judge_coasting`."""
    values = np.stack([slip, adhesion])
    known = (age_s >= 0.0) & (age_s <= COASTING_AGE_S)
    judged = np.where(known[axle], means[:, axle], values)
    axles = len(age_s)
    count = np.bincount(axle, minlength=axles)
    seen = count > 0
    gain = np.where(known, -less, 1.0)[seen]
    for row, value in zip(means, values, strict=True):
        mean = np.bincount(axle, value, axles)[seen] / count[seen]
        row[seen] += gain * (mean - row[seen])
    squares = judged * judged
    return np.asarray(
        (squares[0] >= far * (slip_var + common_var)) | (squares[1] > far * adhesion_var)
    )


def judge_residuals(
    slip: Array,
    adhesion: Array,
    private_var: Array,
    common_var: Array,
    transient_var: Array,
    theta: tuple[float, float, float],
    less: Array,
    decay: Array,
    noise_var: float,
) -> tuple[Array, float, float, float]:
    """As `Kernels.judge_residuals`."""
    c1, c2, c3 = theta
    rows = np.empty((4, len(slip)))
    residual, slope, explained, size = rows
    residual[:] = adhesion + c1 * less + c3 * slip
    slope[:] = c1 * c2 * decay - c3
    explained[:] = noise_var + slope * slope * (private_var + common_var) + transient_var
    size[:] = np.abs(residual) / np.sqrt(explained)
    return rows, float(size.max()), float(private_var.max()), float(common_var.max())


def add_to_axles(
    normal: Array,
    axle: NDArray[np.int64],
    level: Array,
    shifted: Array,
    residual: Array,
    weight: Array,
) -> None:
    """As `Kernels.add_to_axles`."""
    by_level, by_shift = weight * level, weight * shifted
    factors = np.array([by_level, by_level, by_shift, by_level, by_shift])
    terms = factors * np.array([level, shifted, shifted, residual, residual])
    own = axle == np.arange(1, len(normal) + 1)[:, None]
    # Zeros of the other axles change no sum.
    normal += np.add.accumulate(own[:, None, :] * terms, axis=2)[:, :, -1]


def cost_curves(
    nodal: Array, factors: Array, added: Array, scale: float, costs: Array, exponents: Array
) -> Array:
    """As `Kernels.cost_curves`."""
    a, b, c = (nodal[part::3] * factors[part] for part in range(3))
    further = added[:, D, None] * factors[3] + added[:, E, None] * factors[4] + added[:, Z, None]
    np.add(a + b + c, further, out=costs.reshape(2, -1))
    least: Array = costs.min(axis=2)
    np.subtract(costs, least[..., None], out=exponents)
    exponents *= scale
    return least


def weight_exponents(base: Array, logs: Array, halves: Array, exponents: Array) -> None:
    """As `Kernels.weight_exponents`."""
    np.multiply(halves[:, None], logs, out=exponents)
    np.subtract(base, exponents, out=exponents)
    exponents -= exponents.max(axis=1, keepdims=True)


def normalise(weights: Array, costs: Array, leader: int) -> Array:
    """As `Kernels.normalise`."""
    weights /= _sum_in_lanes(weights)[:, None]
    found = np.empty(len(weights) + 1)
    found[:-1] = 1.0 / _sum_in_lanes(weights * weights)
    found[-1:] = _sum_in_lanes((weights[leader] * np.maximum(costs[leader], 0.0))[None])
    return found


def summarise(
    weights: Array,
    order: NDArray[np.int64],
    peaks: Array,
    limited: Array,
    columns: Array,
) -> Array:
    """As `Kernels.summarise`."""
    found = np.empty(SUMMARY_LENGTH)
    in_order = weights[order]
    shares = np.add.accumulate(in_order, axis=1) - 0.5 * in_order
    found[SUMMARY_MEDIANS] = [_value_at(0.5, *rows) for rows in zip(shares, peaks, strict=True)]
    for part, row, share in zip((SUMMARY_HEIGHT, SUMMARY_PLACE), limited, shares[:2], strict=True):
        found[part] = [_value_at(probability, share, row) for probability in QUANTILES]
    mean = _sum_in_lanes(weights * columns)
    deviation = columns - mean[:, None]
    weighted = weights * deviation
    covariance = found[SUMMARY_COVARIANCE].reshape(3, 3)
    squares = _sum_in_lanes(
        weighted[[0, 0, 0, 1, 1, 2, 3, 4]] * deviation[[0, 1, 2, 1, 2, 2, 3, 4]]
    )
    covariance[0], covariance[1, 1:], covariance[2, 2] = squares[:3], squares[3:5], squares[5]
    covariance[1, 0], covariance[2, :2] = covariance[0, 1], covariance[:2, 2]
    found[SUMMARY_FALL] = mean[2]
    found[SUMMARY_HEIGHT_VAR], found[SUMMARY_PLACE_VAR] = squares[6], squares[7]
    found[SUMMARY_EFFECTIVE] = 1.0 / _sum_in_lanes((weights * weights)[None])[0]
    return found


def count_reached(histogram: Array, share: float) -> int:
    """As `Kernels.count_reached`."""
    beyond = np.add.accumulate(histogram[::-1])[::-1]
    return int(np.count_nonzero((beyond > 0.0) & (beyond >= share * beyond[0])))


def score_terms(
    sums: Array, old_cost: Array, noise_var: float, freedom: float, logs: Array, gain: Array
) -> None:
    """As `Kernels.score_terms`."""
    s = sums * (1.0 / noise_var)
    p1, p3 = NEW_PRECISION
    # Corrected scores may give a negative sum of squares where slips do not determine c2.
    a = np.maximum(s[..., A], 0.0) + p1
    b = s[..., B]
    d = np.maximum(s[..., D, None], 0.0) + p3
    r1 = s[..., C] + p1 * NEW_MEAN[0]
    r3 = s[..., E, None] + p3 * NEW_MEAN[1]
    product = a * d
    det = logs[0]
    np.maximum(product - b * b, 1e-12 * product, out=det)
    explained = (r1 * (d * r1 - (2.0 * r3) * b) + a * (r3 * r3)) / det
    # Both are counted from J of the curve so far with the slips as measured.
    old = old_cost[MEASURED, :, None] / noise_var
    apart = old - old_cost[..., None] / noise_var
    cost = np.maximum(s[..., Z, None] + (apart + NEW_SQUARE) - explained, 0.0)
    np.multiply(0.5, old - cost, out=gain)
    if freedom >= 0.0:
        np.divide(freedom + np.maximum(old, 0.0), freedom + cost, out=logs[1])


def score(logs: Array, gain: Array, log_prior: Array, halves: Array, exponents: Array) -> Array:
    """As `Kernels.score`."""
    if len(halves):
        # Noise may have risen. Where it seems to have fallen, in a span as short as this, the
        # errors of the slips have not: their variances are stated, and would shrink with it.
        gain = np.minimum(gain, halves[:, None] * logs[1])
    of_both = (log_prior - 0.5 * logs[0]) + gain
    np.minimum(of_both[0], of_both[1], out=exponents)
    top: Array = exponents.max(axis=1)
    exponents -= top[:, None]
    return top


def _sum_in_lanes(values: Array) -> Array:
    """Sums over the last axis, shape (rows,) from (rows, n), in the order that `LANES` says."""
    rows, size = values.shape
    whole = size - size % LANES
    lanes = np.zeros((rows, LANES))
    lanes += np.add.reduce(values[:, :whole].reshape(rows, -1, LANES), axis=1)
    lanes[:, : size - whole] += values[:, whole:]
    return np.add.accumulate(lanes, axis=1)[:, -1]


def _value_at(probability: float, shares: Array, values: Array) -> float:
    """Value at a probability, linear between the shares below the values, which ascend."""
    place = int(shares.searchsorted(probability, side="right")) - 1
    if place < 0 or place == len(values) - 1:
        return values.item(max(place, 0))
    begin, end = shares.item(place), shares.item(place + 1)
    low, high = values.item(place), values.item(place + 1)
    return (high - low) / (end - begin) * (probability - begin) + low
