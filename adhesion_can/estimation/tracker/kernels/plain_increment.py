"""The sums of an update with NumPy: a part of `plain`."""

import numpy as np
from numpy.typing import NDArray

from adhesion_can.arrays import Array
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
    TOO_WIDE,
    A,
    B,
    C,
    D,
    E,
    Z,
)


def sum_in_order(values: Array) -> Array:
    """Sums over the last axis, one value after the other."""
    return np.asarray(np.add.accumulate(values, axis=-1)[..., -1])


def node_exponents(slip: Array, private_var: Array, exponents: Array) -> float:
    """As `Kernels.node_exponents`."""
    np.multiply(slip[:, None], -C2_NODES, out=exponents[:-1])
    np.minimum(exponents[:-1], LARGEST_EXPONENT, out=exponents[:-1])
    # The samples' mean variance: one sensor, nearly one speed.
    private = float(sum_in_order(private_var)) / len(private_var)
    exponents[-1] = -0.5 * _corrected(private) * C2_SQUARES
    return private


def _corrected(private: float) -> Array:
    """Variance of the private errors that is corrected at each node, shape (NODES,).

    Curves that bend within the error itself are corrected less: the series diverges there, and a
    correction from few samples may exceed the sum.
    """
    return np.asarray(private / (1.0 + (private / TOO_WIDE) * C2_SQUARES))


def common_errors(
    group: NDArray[np.int64], sign: Array, share: Array, common_var: Array, weight: Array
) -> tuple[Array, Array]:
    """Errors of the slips by the vehicle speed, each with its variance.

    Args:
        group: Number of the group between two vehicle speeds, ascending, shape (n,).
        sign: Sign of the branch, shape (n,).
        share: Place between the two vehicle speeds, shape (n,), or of no length.
        common_var: Variance of the slip by the vehicle speed, shape (n,).
        weight: Weight of each sample in the mean place of its group, shape (n,).

    Returns:
        Error of each slip by one unit of each of k errors, shape (k, n): those of the groups, then
        the changes across them; and their variances, shape (k,).

    """
    first = np.ones(len(group), dtype=np.bool_)
    np.not_equal(group[1:], group[:-1], out=first[1:])
    starts, member = first.nonzero()[0], first.cumsum() - 1
    var = common_var[starts]
    inside = member == np.arange(len(starts))[:, None]
    level = inside * sign
    if not len(share) or share.max() == share.min():
        return level, var
    mean = inside * weight
    total = sum_in_order(mean)
    middle = sum_in_order(mean * share) / np.maximum(total, 1e-300)
    change = level * (share - middle[:, None])
    return np.concatenate([level, change]), np.concatenate([var, 2.0 * var])


def increment(  # noqa: PLR0915  one pass after the other
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
    both = np.empty((2, LENGTH))
    places = (reached * (BINS / slip_max)).clip(0, BINS - 1).astype(np.int64)
    both[:, HISTOGRAM] = np.bincount(places, minlength=BINS)
    both[:, COUNT] = both[MEASURED, DOF] = n
    by_own = own_slope * own_slope * private_var
    weight = 1.0 / (1.0 + (by_own + transient_var) / noise_var)
    shape, var = common_errors(group, sign, share, common_var, slope * slope * weight)
    in_group = shape * (slope * weight)
    s2 = var / noise_var
    kappa = s2 / (1.0 + s2 * sum_in_order(in_group * shape * slope))
    # Diagonal of the inverse covariance.
    own = weight - sum_in_order((kappa[:, None] * (in_group * in_group)).T)
    rows = [weight, weight * slip, weight * adhesion, own, *in_group]
    if len(bend):
        rows += [*(shape * (private_var * bend * weight))]
    weights, turning = np.array(rows), 4 + len(kappa)
    numbers = sum_in_order(weights[:, None] * np.array([np.ones(n), slip, adhesion]))
    e = decay[:-1]
    # Along the samples, one after the other: the nodes are the fast axis.
    decays = (weights[:, :, None] * e).sum(axis=1)
    squares = (weights[:4:3, :, None] * (e * e)).sum(axis=1)
    ones, slips, adhesions = numbers.T
    group_z = kappa * adhesions[4:turning]
    z = adhesions[2] - sum_in_order(group_z * adhesions[4:turning])

    def assemble(sums: Array, shrink: Array | None) -> None:
        group_decay, group_h = decays[4:turning], slips[4:turning]
        (we, whe, wze, owne), (wee, ownee) = decays[:4], squares
        bent: Array | float = 0.0
        removed = 0.0
        if shrink is not None:
            # e^(−c2 λ) has the expectation e^(−c2 λ) / shrink.
            square, removed = shrink * shrink, private
            group_decay = shrink * group_decay
            if len(ones) > turning:
                bent = decays[turning:] * (shrink * C2_NODES)
                group_h = group_h + ones[turning:]
            we, whe, wze, wee = shrink * we, shrink * whe, shrink * wze, square * wee
            wee = wee + (square * (square - 1.0)) * ownee
            whe = whe + (_corrected(private) * C2_NODES * shrink) * owne
        f1 = ones[4:turning, None] - group_decay + bent
        by_kappa = kappa[:, None] * (f1 * f1)
        group_k = kappa * group_h
        sums[A] = ones[0] - 2.0 * we + wee - by_kappa.sum(axis=0)
        sums[B] = whe - slips[0] + (group_k[:, None] * f1).sum(axis=0)
        sums[C] = adhesions[0] - wze - (group_z[:, None] * f1).sum(axis=0)
        sums[D] = slips[1] - sum_in_order(group_k * group_h) - removed * ones[3]
        sums[E] = sum_in_order(group_z * group_h) - adhesions[1]
        sums[Z] = z

    assemble(both[MEASURED], None)
    if private > 0.0:
        assemble(both[CORRECTED], decay[-1])
        both[CORRECTED, DOF] = n - float(sum_in_order(own * by_own)) / noise_var
    else:
        both[CORRECTED] = both[MEASURED]
    return both
