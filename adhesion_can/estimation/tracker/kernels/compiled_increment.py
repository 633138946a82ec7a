"""The sums of an update compiled by numba: a part of `compiled`."""

import numpy as np
from numpy.typing import NDArray

from adhesion_can.arrays import Array
from adhesion_can.estimation.tracker.kernels.jit import F8, IN, INTS, ROWS, compiled, inlined
from adhesion_can.estimation.tracker.layout import (
    BINS,
    C2_NODES,
    C2_SQUARES,
    CORRECTED,
    COUNT,
    DOF,
    HISTOGRAM,
    LARGEST_EXPONENT,
    LENGTH,
    MEASURED,
    NODES,
    TOO_WIDE,
    D,
    E,
    Z,
)

FIRST_BIN = HISTOGRAM.start


@inlined
def _corrected(private: float, node: int) -> float:
    """Variance of the private errors that is corrected at a node, as in `plain_increment`."""
    return private / (1.0 + (private / TOO_WIDE) * C2_SQUARES[node])


@compiled(F8, IN, IN, ROWS)
def node_exponents(slip: Array, private_var: Array, exponents: Array) -> float:
    """As `Kernels.node_exponents`."""
    n = len(slip)
    private = 0.0
    for j in range(n):
        private += private_var[j]
        for node in range(NODES):
            exponents[j, node] = min(slip[j] * -C2_NODES[node], LARGEST_EXPONENT)
    private /= n
    for node in range(NODES):
        exponents[n, node] = -0.5 * _corrected(private, node) * C2_SQUARES[node]
    return private


@inlined
def _common_errors(
    group: NDArray[np.int64], sign: Array, share: Array, common_var: Array, weight: Array
) -> tuple[NDArray[np.int64], Array, Array]:
    """Group of each sample from 0 on, error of each slip, and variances.

    Of the errors, shape (2, n), the first row is by that of the sample's group, the second by the
    change across it; of the variances, shape (2, groups), the second row is 0 throughout where
    there is no such change.
    """
    n = len(group)
    member = np.zeros(n, dtype=np.int64)
    for j in range(1, n):
        member[j] = member[j - 1] + (1 if group[j] != group[j - 1] else 0)
    count = member[n - 1] + 1
    errors, var = np.zeros((2, n)), np.zeros((2, count))
    apart = False
    for j in range(len(share)):
        apart = apart or share[j] != share[0]
    total, middle = np.zeros(count), np.zeros(count)
    for j in range(n):
        g = member[j]
        errors[0, j] = sign[j]
        if j == 0 or member[j - 1] != g:
            var[0, g] = common_var[j]
        if apart:
            total[g] += weight[j]
            middle[g] += weight[j] * share[j]
    if apart:
        for j in range(n):
            g = member[j]
            errors[1, j] = sign[j] * (share[j] - middle[g] / max(total[g], 1e-300))
            var[1, g] = 2.0 * var[0, g]
    return member, errors, var


@inlined
def _add(
    row: float, slip: float, adhesion: float, decay: Array, numbers: Array, decays: Array
) -> None:
    """Add a sample to a row of the moments."""
    numbers[0] += row
    numbers[1] += row * slip
    numbers[2] += row * adhesion
    for node in range(NODES):
        decays[node] += row * decay[node]


@inlined
def _assemble(
    sums: Array,
    numbers: Array,
    decays: Array,
    squares: Array,
    kappa: Array,
    group_numbers: Array,
    group_decays: Array,
    bent_ones: Array,
    bent_decays: Array,
    private: float,
    shrink: Array,
) -> None:
    """Write A, B, C, D, E and Z of samples into a vector of sums, as in `plain_increment`.

    Args:
        sums: Vector of sums to write to, shape (LENGTH,).
        numbers: Sums of the first four rows, and of these times slip and adhesion, shape (4, 3).
        decays: Sums of the first four rows times e^(−c2 λ), shape (4, NODES).
        squares: Sums of the first and the fourth row times e^(−2 c2 λ), shape (2, NODES).
        kappa: What a common error takes away from the square of its row, shape (2, groups).
        group_numbers: Sums of the rows of the groups, shape (2, groups, 3).
        group_decays: The same times e^(−c2 λ), shape (2, groups, NODES).
        bent_ones: Sums of the rows with the bend, shape (2, groups).
        bent_decays: The same times e^(−c2 λ), shape (2, groups, NODES).
        private: Variance of the private errors that corrected scores remove; 0: none.
        shrink: Expectation of e^(−c2 λ) by these errors, inverse, shape (NODES,).

    """
    corrects = private > 0.0
    for node in range(NODES):
        s = shrink[node]
        square = s * s
        whe = s * decays[1, node]
        wee = square * squares[0, node]
        if corrects:
            wee = wee + (square * (square - 1.0)) * squares[1, node]
            whe = whe + (_corrected(private, node) * C2_NODES[node] * s) * decays[3, node]
        sums[node] = numbers[0, 0] - 2.0 * (s * decays[0, node]) + wee
        sums[NODES + node] = whe - numbers[0, 1]
        sums[2 * NODES + node] = numbers[0, 2] - s * decays[2, node]
    by_a, by_b, by_c = np.zeros(NODES), np.zeros(NODES), np.zeros(NODES)
    by_d = by_e = by_z = 0.0
    for part in range(2):
        for g in range(kappa.shape[1]):
            k = kappa[part, g]
            one, h = group_numbers[part, g, 0], group_numbers[part, g, 1]
            z = group_numbers[part, g, 2]
            if corrects:
                h = h + bent_ones[part, g]
            k_h, k_z = k * h, k * z
            for node in range(NODES):
                f1 = one - shrink[node] * group_decays[part, g, node]
                if corrects:
                    f1 = f1 + bent_decays[part, g, node] * (shrink[node] * C2_NODES[node])
                by_a[node] += k * (f1 * f1)
                by_b[node] += k_h * f1
                by_c[node] += k_z * f1
            by_d += k_h * h
            by_e += k_z * h
            by_z += k_z * z
    for node in range(NODES):
        sums[node] -= by_a[node]
        sums[NODES + node] += by_b[node]
        sums[2 * NODES + node] -= by_c[node]
    sums[D] = numbers[1, 1] - by_d - private * numbers[3, 0]
    sums[E] = by_e - numbers[1, 2]
    sums[Z] = numbers[2, 2] - by_z


@compiled(
    ROWS,
    IN,
    IN,
    IN,
    IN,
    IN,
    INTS,
    IN,
    IN,
    IN,
    IN,
    IN,
    IN,
    ROWS,
    F8,
    F8,
    F8,
)
def increment(  # noqa: C901, PLR0912  loops, which numba compiles
    slip: Array,
    adhesion: Array,
    private_var: Array,
    common_var: Array,
    transient_var: Array,
    group: NDArray[np.int64],
    sign: Array,
    share: Array,
    slope: Array,
    own_slope: Array,
    bend: Array,
    reached: Array,
    decay: Array,
    private: float,
    noise_var: float,
    slip_max: float,
) -> Array:
    """As `Kernels.increment`."""
    n = len(slip)
    both = np.zeros((2, LENGTH))
    per_slip = BINS / slip_max
    for j in range(n):
        place = int(min(max(reached[j] * per_slip, 0.0), BINS - 1.0))
        both[CORRECTED, FIRST_BIN + place] += 1.0
        both[MEASURED, FIRST_BIN + place] += 1.0
    both[CORRECTED, COUNT] = both[MEASURED, COUNT] = both[MEASURED, DOF] = n
    by_own, weight, mean = np.empty(n), np.empty(n), np.empty(n)
    for j in range(n):
        by_own[j] = own_slope[j] * own_slope[j] * private_var[j]
        weight[j] = 1.0 / (1.0 + (by_own[j] + transient_var[j]) / noise_var)
        mean[j] = slope[j] * slope[j] * weight[j]
    member, errors, var = _common_errors(group, sign, share, common_var, mean)
    groups = var.shape[1]
    # Rows of the moments: weight, its products with slip and adhesion, the diagonal of the inverse
    # covariance, then by group its error and the change across it, then both with the bend.
    kappa, in_group = np.zeros((2, groups)), np.empty((2, n))
    for part in range(2):
        for j in range(n):
            in_group[part, j] = errors[part, j] * (slope[j] * weight[j])
            kappa[part, member[j]] += in_group[part, j] * errors[part, j] * slope[j]
        for g in range(groups):
            s2 = var[part, g] / noise_var
            kappa[part, g] = s2 / (1.0 + s2 * kappa[part, g])
    own = np.empty(n)
    for j in range(n):
        level = kappa[0, member[j]] * (in_group[0, j] * in_group[0, j])
        own[j] = weight[j] - (level + kappa[1, member[j]] * (in_group[1, j] * in_group[1, j]))
    numbers, decays, squares = np.zeros((4, 3)), np.zeros((4, NODES)), np.zeros((2, NODES))
    group_numbers, group_decays = np.zeros((2, groups, 3)), np.zeros((2, groups, NODES))
    bent_ones, bent_decays = np.zeros((2, groups)), np.zeros((2, groups, NODES))
    for j in range(n):
        g = member[j]
        factors = (weight[j], weight[j] * slip[j], weight[j] * adhesion[j], own[j])
        for row in range(4):
            _add(factors[row], slip[j], adhesion[j], decay[j], numbers[row], decays[row])
        for node in range(NODES):
            e2 = decay[j, node] * decay[j, node]
            squares[0, node] += weight[j] * e2
            squares[1, node] += own[j] * e2
        for part in range(2):
            error = in_group[part, j]
            _add(
                error, slip[j], adhesion[j], decay[j], group_numbers[part, g], group_decays[part, g]
            )
            if len(bend):
                bent = errors[part, j] * (private_var[j] * bend[j] * weight[j])
                bent_ones[part, g] += bent
                for node in range(NODES):
                    bent_decays[part, g, node] += bent * decay[j, node]
    # With the slips as measured there is nothing to correct: an expectation of 1.
    _assemble(
        both[MEASURED], numbers, decays, squares, kappa, group_numbers, group_decays,
        bent_ones, bent_decays, 0.0, np.ones(NODES),
    )  # fmt: skip
    if private > 0.0:
        _assemble(
            both[CORRECTED], numbers, decays, squares, kappa, group_numbers, group_decays,
            bent_ones, bent_decays, private, decay[n],
        )  # fmt: skip
        taken = 0.0
        for j in range(n):
            taken += own[j] * by_own[j]
        both[CORRECTED, DOF] = n - taken / noise_var
    else:
        both[CORRECTED] = both[MEASURED]
    return both
