"""The kernels compiled by numba: loops; `interface` says what they compute, and how they add.

What each gives is equal to that of `plain` to the last bit.
"""

from math import isfinite, sqrt

import numpy as np
from numba import types
from numpy.typing import NDArray

from adhesion_can.arrays import Array
from adhesion_can.estimation.tracker.kernels.compiled_increment import increment, node_exponents
from adhesion_can.estimation.tracker.kernels.interface import (
    ADHESION_MAX,
    COASTING_AGE_S,
    LANES,
)
from adhesion_can.estimation.tracker.kernels.jit import (
    BLOCK,
    BLOCKS,
    F8,
    IN,
    INTS,
    MASK,
    PLACES,
    ROW,
    ROWS,
    STAMPS,
    STRIDED_BLOCK,
    STRIDED_ROWS,
    compiled,
    inlined,
)
from adhesion_can.estimation.tracker.layout import (
    CORRECTED,
    MEASURED,
    NEW_MEAN,
    NEW_PRECISION,
    NEW_SQUARE,
    NODES,
    QUANTILES,
    SUMMARY_EFFECTIVE,
    SUMMARY_FALL,
    SUMMARY_HEIGHT_VAR,
    SUMMARY_LENGTH,
    SUMMARY_PLACE_VAR,
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


@inlined
def _least(values: Array) -> float:
    """Least value."""
    found = values[0]
    for k in range(1, len(values)):
        found = min(found, values[k])
    return found


@inlined
def _largest(values: Array) -> float:
    """Largest value."""
    found = values[0]
    for k in range(1, len(values)):
        found = max(found, values[k])
    return found


@inlined
def _dot(one: Array, other: Array) -> float:
    """Sum of products, in the order that `LANES` says."""
    lanes = np.zeros(LANES)
    whole = len(one) - len(one) % LANES
    for begin in range(0, whole, LANES):
        for k in range(LANES):
            lanes[k] += one[begin + k] * other[begin + k]
    for k in range(whole, len(one)):
        lanes[k - whole] += one[k] * other[k]
    total = 0.0
    for k in range(LANES):
        total += lanes[k]
    return total


@inlined
def _value_at(probability: float, shares: Array, values: Array) -> float:
    """Value at a probability, linear between the shares below the values, which ascend."""
    place = np.searchsorted(shares, probability, side="right") - 1
    if place < 0:
        return values[0]
    if place == len(values) - 1:
        return values[place]
    slope = (values[place + 1] - values[place]) / (shares[place + 1] - shares[place])
    return slope * (probability - shares[place]) + values[place]


@compiled(MASK, IN, IN, IN, IN, IN, IN, IN, F8)
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
    good = np.empty(len(slip), dtype=np.bool_)
    for j in range(len(slip)):
        further = slip_var[j] + common_var[j] + adhesion_var[j] + transient_var[j] + load_std[j]
        good[j] = (
            abs(slip[j]) <= slip_max and abs(adhesion[j]) <= ADHESION_MAX and isfinite(further)
        )
    return good


@compiled(ROW, STAMPS, INTS, INTS)
def pass_time(
    latest_us: NDArray[np.int64], axle: NDArray[np.int64], t_us: NDArray[np.int64]
) -> Array:
    """As `Kernels.pass_time`."""
    before_us = latest_us.copy()
    for j in range(len(axle)):
        latest_us[axle[j]] = t_us[j]
    age_s = np.empty(len(latest_us))
    for i in range(len(latest_us)):
        age_s[i] = (latest_us[i] - before_us[i]) * 1e-6
    return age_s


@compiled(MASK, IN, IN, IN, IN, IN, INTS, ROW, ROW, ROWS, F8)
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
    passes = np.empty(len(slip), dtype=np.bool_)
    sums, count = np.zeros((2, len(age_s))), np.zeros(len(age_s))
    for j in range(len(slip)):
        i = axle[j]
        by_slip, by_adhesion = slip[j], adhesion[j]
        if 0.0 <= age_s[i] <= COASTING_AGE_S:
            by_slip, by_adhesion = means[0, i], means[1, i]
        slip_is_far = by_slip * by_slip >= far * (slip_var[j] + common_var[j])
        passes[j] = slip_is_far or by_adhesion * by_adhesion > far * adhesion_var[j]
        sums[0, i] += slip[j]
        sums[1, i] += adhesion[j]
        count[i] += 1.0
    for i in range(len(age_s)):
        if count[i] > 0.0:
            gain = -less[i] if 0.0 <= age_s[i] <= COASTING_AGE_S else 1.0
            for row in range(2):
                means[row, i] += gain * (sums[row, i] / count[i] - means[row, i])
    return passes


@compiled(types.Tuple((ROWS, F8, F8, F8)), IN, IN, IN, IN, IN, types.UniTuple(F8, 3), IN, IN, F8)
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
    largest, private, common = 0.0, 0.0, 0.0
    for j in range(len(slip)):
        residual = adhesion[j] + c1 * less[j] + c3 * slip[j]
        slope = c1 * c2 * decay[j] - c3
        explained = noise_var + slope * slope * (private_var[j] + common_var[j])
        explained += transient_var[j]
        size = abs(residual) / sqrt(explained)
        rows[0, j], rows[1, j], rows[2, j], rows[3, j] = residual, slope, explained, size
        largest = max(largest, size)
        private, common = max(private, private_var[j]), max(common, common_var[j])
    return rows, largest, private, common


@compiled(types.void, ROWS, INTS, IN, IN, IN, IN)
def add_to_axles(
    normal: Array,
    axle: NDArray[np.int64],
    level: Array,
    shifted: Array,
    residual: Array,
    weight: Array,
) -> None:
    """As `Kernels.add_to_axles`."""
    sums = np.zeros(normal.shape)
    for j in range(len(axle)):
        if axle[j] > 0:
            row = sums[axle[j] - 1]
            by_level, by_shift = weight[j] * level[j], weight[j] * shifted[j]
            row[0] += by_level * level[j]
            row[1] += by_level * shifted[j]
            row[2] += by_shift * shifted[j]
            row[3] += by_level * residual[j]
            row[4] += by_shift * residual[j]
    for i in range(normal.shape[0]):
        for k in range(normal.shape[1]):
            normal[i, k] += sums[i, k]


@compiled(ROWS, ROWS, ROWS, ROWS, F8, BLOCK, BLOCK)
def cost_curves(
    nodal: Array, factors: Array, added: Array, scale: float, costs: Array, exponents: Array
) -> Array:
    """As `Kernels.cost_curves`."""
    kinds, memories, size = costs.shape
    least = np.empty((kinds, memories))
    for kind in range(kinds):
        d, e, z = added[kind, D], added[kind, E], added[kind, Z]
        for memory in range(memories):
            own = costs[kind, memory]
            first = memory * size
            for k in range(size):
                j = first + k
                linear = nodal[3 * kind, j] * factors[0, j] + nodal[3 * kind + 1, j] * factors[1, j]
                linear += nodal[3 * kind + 2, j] * factors[2, j]
                own[k] = linear + (d * factors[3, j] + e * factors[4, j] + z)
            best = _least(own)
            least[kind, memory] = best
            for k in range(size):
                exponents[kind, memory, k] = scale * (own[k] - best)
    return least


@compiled(types.void, ROWS, ROWS, ROW, ROWS)
def weight_exponents(base: Array, logs: Array, halves: Array, exponents: Array) -> None:
    """As `Kernels.weight_exponents`."""
    for memory in range(base.shape[0]):
        own, half = exponents[memory], halves[memory]
        for k in range(base.shape[1]):
            own[k] = base[memory, k] - half * logs[memory, k]
        top = _largest(own)
        for k in range(base.shape[1]):
            own[k] -= top


@compiled(ROW, ROWS, ROWS, types.int64)
def normalise(weights: Array, costs: Array, leader: int) -> Array:
    """As `Kernels.normalise`."""
    memories, size = weights.shape
    found = np.empty(memories + 1)
    ones = np.ones(size)
    for memory in range(memories):
        own = weights[memory]
        total = _dot(own, ones)
        for k in range(size):
            own[k] /= total
        found[memory] = 1.0 / _dot(own, own)
    bounded = np.maximum(costs[leader], 0.0)
    found[memories] = _dot(weights[leader], bounded)
    return found


@compiled(ROW, ROW, PLACES, ROWS, ROWS, ROWS)
def summarise(
    weights: Array,
    order: NDArray[np.int64],
    peaks: Array,
    limited: Array,
    columns: Array,
) -> Array:
    """As `Kernels.summarise`."""
    found = np.empty(SUMMARY_LENGTH)
    size = len(weights)
    shares = np.empty((3, size))
    below0 = below1 = below2 = 0.0
    # Three chains of additions at once: each one waits for itself alone.
    for k in range(size):
        w0, w1, w2 = weights[order[0, k]], weights[order[1, k]], weights[order[2, k]]
        below0 = below0 + w0
        below1 = below1 + w1
        below2 = below2 + w2
        shares[0, k] = below0 - 0.5 * w0
        shares[1, k] = below1 - 0.5 * w1
        shares[2, k] = below2 - 0.5 * w2
    for row in range(3):
        found[row] = _value_at(0.5, shares[row], peaks[row])
    for row in range(2):
        for k in range(3):
            found[3 + 3 * row + k] = _value_at(QUANTILES[k], shares[row], limited[row])
    deviation, weighted = np.empty((5, size)), np.empty((5, size))
    for row in range(5):
        mean = _dot(weights, columns[row])
        for k in range(size):
            deviation[row, k] = columns[row, k] - mean
            weighted[row, k] = weights[k] * deviation[row, k]
        if row == 2:
            found[SUMMARY_FALL] = mean
    for i in range(3):
        for k in range(i, 3):
            square = _dot(weighted[i], deviation[k])
            found[9 + 3 * i + k] = found[9 + 3 * k + i] = square
    found[SUMMARY_HEIGHT_VAR] = _dot(weighted[3], deviation[3])
    found[SUMMARY_PLACE_VAR] = _dot(weighted[4], deviation[4])
    found[SUMMARY_EFFECTIVE] = 1.0 / _dot(weights, weights)
    return found


@compiled(types.int64, IN, F8)
def count_reached(histogram: Array, share: float) -> int:
    """As `Kernels.count_reached`."""
    whole = 0.0
    for k in range(len(histogram) - 1, -1, -1):
        whole += histogram[k]
    count, beyond = 0, 0.0
    for k in range(len(histogram) - 1, -1, -1):
        beyond += histogram[k]
        if beyond > 0.0 and beyond >= share * whole:
            count += 1
    return count


@compiled(
    types.void,
    STRIDED_BLOCK,
    STRIDED_ROWS,
    F8,
    F8,
    BLOCKS,
    BLOCK,
)
def score_terms(
    sums: Array, old_cost: Array, noise_var: float, freedom: float, logs: Array, gain: Array
) -> None:
    """As `Kernels.score_terms`."""
    inverse = 1.0 / noise_var
    p1, p3 = NEW_PRECISION
    r1_prior, r3_prior = p1 * NEW_MEAN[0], p3 * NEW_MEAN[1]
    for k in range(sums.shape[1]):
        old = old_cost[MEASURED, k] / noise_var
        bounded = max(old, 0.0)
        for kind in range(2):
            row = sums[kind, k]
            d = max(row[D] * inverse, 0.0) + p3
            r3 = row[E] * inverse + r3_prior
            apart = old - old_cost[kind, k] / noise_var
            left = row[Z] * inverse + (apart + NEW_SQUARE)
            for node in range(NODES):
                a = max(row[node] * inverse, 0.0) + p1
                b = row[NODES + node] * inverse
                r1 = row[2 * NODES + node] * inverse + r1_prior
                product = a * d
                det = max(product - b * b, 1e-12 * product)
                explained = (r1 * (d * r1 - (2.0 * r3) * b) + a * (r3 * r3)) / det
                cost = max(left - explained, 0.0)
                logs[0, kind, k, node] = det
                if freedom >= 0.0:
                    logs[1, kind, k, node] = (freedom + bounded) / (freedom + cost)
                gain[kind, k, node] = 0.5 * (old - cost)


@compiled(ROW, BLOCKS, BLOCK, IN, IN, ROWS)
def score(logs: Array, gain: Array, log_prior: Array, halves: Array, exponents: Array) -> Array:
    """As `Kernels.score`."""
    top = np.empty(len(exponents))
    for k in range(len(exponents)):
        own = exponents[k]
        for node in range(NODES):
            first, second = gain[CORRECTED, k, node], gain[MEASURED, k, node]
            if len(halves):
                first = min(first, halves[k] * logs[1, CORRECTED, k, node])
                second = min(second, halves[k] * logs[1, MEASURED, k, node])
            first = (log_prior[node] - 0.5 * logs[0, CORRECTED, k, node]) + first
            second = (log_prior[node] - 0.5 * logs[0, MEASURED, k, node]) + second
            own[node] = min(first, second)
        top[k] = _largest(own)
        for node in range(NODES):
            own[node] -= top[k]
    return top
