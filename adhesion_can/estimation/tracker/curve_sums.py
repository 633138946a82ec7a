"""Sufficient statistics of a curve: a vector of sums of constant length for any number of samples.

For a given c2 the curve is linear in c1 and c3, with the regressors f1 = 1 − e^(−c2 λ) and f2 = −λ:

    J(θ) = Z − 2 c1 C(c2) − 2 c3 E + c1² A(c2) + 2 c1 c3 B(c2) + c3² D

A = Σ f1², B = Σ f1 f2, C = Σ f1 z are entire functions of x = ln c2. Interpolation between their
values at 40 Chebyshev nodes gives them for every c2 between 2 and 500 to 9 digits. D = Σ f2²,
E = Σ f2 z, Z = Σ z² are numbers. The sums are additive: samples and segments are added, forgetting
is a multiplication, and J of any θ is linear in them. Bins of λ would be either coarse or many.

Errors in variables (Fuller, "Measurement Error Models", 1987). Each wheel speed adds an error of
its own to the slip (private). The vehicle speed adds one that all axles and all samples between two
of its frames share (common): between two frames it runs straight from the error of one to that of
the other, s being the place between them. So a group has an error of its mean, of variance q, and a
change across it, of variance 2q. With the slope a = dμ/dλ of the current curve the adhesion has the
covariance σ² I + diag(a² p) + q a aᵀ + 2q b bᵀ with b = a (s − s̄), and the sums are those of
generalised least squares. With s̄ weighted so that both directions are orthogonal they are exact by
the Sherman-Morrison formula for each. A mean over a group scatters by less than q, but neighbouring
groups share a frame; q is right for the sum over many groups, on which changes of the surface and
standard deviations rest. The private error would still flatten the
slope (regression dilution); it is removed by corrected scores (Nakamura, Biometrika 77, 1990):
e^(−c2 λ − c2² p/2) has the expectation of e^(−c2 λ) at the true slip, and likewise the products.
The common one is removed by `common_shift`, the error that fits the group best.

Both kinds of sums, with corrected scores and with the slips as measured, come from the same
exponentials: at a node they differ by a factor alone.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from adhesion_can.arrays import Array
from adhesion_can.estimation.tracker.settings import C2_RANGE
from adhesion_can.physics.burckhardt import CurveParameters

NODES = 40
X_RANGE = (float(np.log(C2_RANGE[0])), float(np.log(C2_RANGE[1])))

_T = np.cos(np.pi * (2 * np.arange(NODES) + 1) / (2 * NODES))
X_NODES: Array = X_RANGE[0] + (X_RANGE[1] - X_RANGE[0]) * (_T + 1) / 2
"""ln c2 of the nodes, descending."""
C2_NODES: Array = np.exp(X_NODES)

_C2_SQUARES = C2_NODES * C2_NODES
_BARYCENTRIC = np.where(np.arange(NODES) % 2, -1.0, 1.0) * np.sin(np.arccos(_T))

A, B, C = slice(0, NODES), slice(NODES, 2 * NODES), slice(2 * NODES, 3 * NODES)
D, E, Z, DOF, COUNT = range(3 * NODES, 3 * NODES + 5)
"""Indices in a vector of sums. DOF is the number of degrees of freedom of J, a little less than
COUNT where slips are not exact."""
SURE = 4.0
"""Standard deviations beyond which the sign of a measured slip is its true one."""
LARGEST_EXPONENT = 8.0
"""Largest exponent of e^(−c2 λ): a slip below zero is an error, which must not become 1e20."""
WIDE_ERROR, TOO_WIDE = 0.02, 0.1
"""c2² p from which the private error is as wide as the bend of the curve: the correction of the
slope is limited there, and that of the sums."""
BINS = 64
HISTOGRAM = slice(COUNT + 1, COUNT + 1 + BINS)
"""Number of samples by the slip that they surely reached, from 0 to the model's largest slip."""
LENGTH = COUNT + 1 + BINS
CORRECTED, MEASURED = 0, 1
"""Rows of an increment: sums with corrected scores, and with the slips as measured."""


class Points(NamedTuple):
    """Samples on one branch of the curve, with the variances of their errors.

    Attributes:
        slip: Slip ratio λ, negative only within its own error, shape (n,).
        adhesion: Adhesion coefficient μ, shape (n,).
        private_var: Variance of λ by the wheel speed, shape (n,).
        common_var: Variance of λ by the vehicle speed, shape (n,).
        transient_var: Variance of μ beyond the noise of all samples, shape (n,).
        group: Number of the group between two vehicle speeds, from one sample to the next the same
            or one more, shape (n,).
        sign: 1 for samples in traction, −1 for samples in braking, shape (n,); an error of the
            vehicle speed moves both against each other.
        share: Place of each sample between the two vehicle speeds, 0..1, shape (n,); None: the
            error of the vehicle speed is the same in all samples of a group.

    """

    slip: Array
    adhesion: Array
    private_var: Array
    common_var: Array
    transient_var: Array
    group: NDArray[np.int64]
    sign: Array
    share: Array | None = None

    @property
    def exact(self) -> bool:
        """Whether no slip has an error, and all samples have the same noise."""
        return not (self.common_var.any() or self.private_var.any() or self.transient_var.any())

    @property
    def surely_reached(self) -> Array:
        """Slip that was reached whatever its error: λ less `SURE` standard deviations, (n,)."""
        return np.asarray(self.slip - SURE * np.sqrt(self.private_var + self.common_var))

    def select(self, rows: NDArray[np.bool_]) -> "Points":
        """Points selected by a mask."""
        return Points(
            self.slip[rows],
            self.adhesion[rows],
            self.private_var[rows],
            self.common_var[rows],
            self.transient_var[rows],
            self.group[rows],
            self.sign[rows],
            None if self.share is None else self.share[rows],
        )

    def groups(self) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """First sample of each group, shape (groups,), and the group of each sample, (n,)."""
        first = np.ones(len(self.group), dtype=np.bool_)
        np.not_equal(self.group[1:], self.group[:-1], out=first[1:])
        return first.nonzero()[0], first.cumsum() - 1


def interpolation(x: ArrayLike) -> Array:
    """Matrix from values at the Chebyshev nodes to values at x = ln c2; shape (n, NODES).

    By the barycentric formula (Berrut & Trefethen, SIAM Review 46, 2004).
    """
    low, high = X_RANGE
    distance = np.clip(np.asarray(x, dtype=np.float64), low, high)[:, None] - X_NODES
    # On a node itself: so near that the others do not count.
    terms = _BARYCENTRIC / np.where(distance == 0.0, 1e-200, distance)
    return np.asarray(terms / terms.sum(axis=1, keepdims=True))


def coefficients(theta: Array) -> Array:
    """Coefficients of A, B, C, D and E in J: c1², 2 c1 c3, −2 c1, c3², −2 c3; shape (5, n).

    Args:
        theta: Curve parameters (c1, c2, c3), shape (n, 3).

    """
    c1, _, c3 = theta.T
    return np.stack([c1 * c1, 2 * c1 * c3, -2 * c1, c3 * c3, -2 * c3])


def costs(sums: Array, at_x: Array, factors: Array) -> Array:
    """Sums of squares J of curves, linear in the sums; shape (.., n).

    Args:
        sums: Vectors of sums, shape (.., LENGTH).
        at_x: Interpolation matrix at the curves' ln c2, shape (n, NODES).
        factors: Coefficients of the curves, shape (5, n).

    """
    abc = sums[..., : 3 * NODES].reshape(-1, NODES) @ at_x.T
    abc = abc.reshape(*sums.shape[:-1], 3, -1) * factors[:3]
    further = sums[..., D : E + 1] @ factors[3:] + sums[..., Z, None]
    return np.asarray(abc.sum(axis=-2) + further)


def increment(
    points: Points,
    slope: Array,
    noise_var: float,
    slip_max: float,
    own_slope: Array | None = None,
    bend: Array | None = None,
) -> Array:
    """Sums of samples with corrected scores, and with the slips as measured; shape (2, LENGTH).

    Corrected scores remove the private errors. Without them these dilute the slope, and J is a sum
    of squares. Where slips have no private error, both are the same.

    Args:
        points: Samples on one branch.
        slope: Slope dμ/dλ of the current curve at the samples, shape (n,).
        noise_var: Variance σ² of the adhesion noise; J/DOF of the sums estimates it.
        slip_max: Upper end of the histogram of slip.
        own_slope: Slope for the weight of the private error, from another source than the slip
            with the error, shape (n,): a weight correlated with the error biases the curve. None:
            `slope`.
        bend: Curvature −d²μ/dλ² of the current curve at the samples, shape (n,), for the
            correlation of slope and private error; None: it is not corrected.

    """
    h, z, p, _, further, *_ = points
    both = np.empty((2, LENGTH))
    both[:, HISTOGRAM] = histogram(points, slip_max)
    both[:, COUNT] = len(h)
    if points.exact:
        f1 = -np.expm1(-np.multiply.outer(h, C2_NODES))
        both[:, A] = np.einsum("ij,ij->j", f1, f1)
        both[:, B], both[:, C] = -(h @ f1), z @ f1
        both[:, D], both[:, E], both[:, Z], both[:, DOF] = h @ h, -(h @ z), z @ z, len(h)
        return both
    by_own = (slope if own_slope is None else own_slope) ** 2 * p
    weight = 1.0 / (1.0 + (by_own + further) / noise_var)
    shape, var = _common_errors(points, slope * slope * weight)
    in_group = shape * (slope * weight)
    s2 = var / noise_var
    kappa = s2 / (1.0 + s2 * ((in_group * shape) @ slope))
    # Diagonal of the inverse covariance.
    own = weight - kappa @ (in_group * in_group)
    rows = [weight, weight * h, weight * z, own, *in_group]
    if bend is not None:
        rows += [*(shape * (p * bend * weight))]
    weights = np.array(rows)
    decay = np.exp(np.minimum(h[:, None] * -C2_NODES, LARGEST_EXPONENT))
    moments = _Moments(
        by_one=weights.sum(axis=1),
        by_slip=weights @ h,
        by_adhesion=weights @ z,
        by_decay=weights @ decay,
        by_square=weights[:4:3] @ (decay * decay),
        kappa=kappa,
    )
    # The samples' mean variance: one sensor, nearly one speed.
    private = float(p.sum()) / len(p)
    _assemble(moments, 0.0, both[MEASURED])
    both[MEASURED, DOF] = len(h)
    if private > 0.0:
        _assemble(moments, private, both[CORRECTED])
        both[CORRECTED, DOF] = len(h) - own @ by_own / noise_var
    else:
        both[CORRECTED] = both[MEASURED]
    return both


class _Moments(NamedTuple):
    """Weighted sums over samples, from which the vector of sums is assembled.

    The rows are: weight, weight times slip, weight times adhesion, diagonal of the inverse
    covariance, then one for each common error; where the bend is corrected, one more for each.

    Attributes:
        by_one: Sums of the rows, shape (r,).
        by_slip: Sums of the rows times the slip λ, shape (r,).
        by_adhesion: Sums of the rows times the adhesion, shape (r,).
        by_decay: Sums of the rows times e^(−c2 λ) at each node, shape (r, NODES).
        by_square: Sums of the first and the fourth row times e^(−2 c2 λ), shape (2, NODES).
        kappa: What a common error takes away from the square of its row, shape (groups,).

    """

    by_one: Array
    by_slip: Array
    by_adhesion: Array
    by_decay: Array
    by_square: Array
    kappa: Array


def _assemble(moments: _Moments, private: float, sums: Array) -> None:
    """Write A, B, C, D, E and Z of samples into a vector of sums.

    Args:
        moments: Weighted sums over the samples.
        private: Variance of the private errors that corrected scores remove; 0: none.
        sums: Vector of sums to write to, shape (LENGTH,).

    """
    ones, slips, adhesions, decays, squares, kappa = moments
    group, turning = slice(4, 4 + len(kappa)), slice(4 + len(kappa), None)
    group_decay, group_h, group_z = decays[group], slips[group], kappa * adhesions[group]
    bent: Array | float = 0.0
    (we, whe, wze, owne), (wee, ownee) = decays[:4], squares
    if private > 0.0:
        # e^(−c2 λ) has the expectation e^(−c2 λ) / shrink. Curves that bend within the error itself
        # are corrected less: the series diverges there, and a correction from few samples may
        # exceed the sum.
        corrected = private / (1.0 + (private / TOO_WIDE) * _C2_SQUARES)
        shrink = np.exp(-0.5 * corrected * _C2_SQUARES)
        square = shrink * shrink
        group_decay = shrink * group_decay
        if len(ones) > turning.start:
            bent = decays[turning] * (shrink * C2_NODES)
            group_h = group_h + ones[turning]
        we, whe, wze, wee = shrink * we, shrink * whe, shrink * wze, square * wee
        wee = wee + (square * (square - 1.0)) * ownee
        whe = whe + (corrected * C2_NODES * shrink) * owne
    group_f1 = ones[group, None] - group_decay + bent
    sums[A] = ones[0] - 2.0 * we + wee - kappa @ (group_f1 * group_f1)
    sums[B] = whe - slips[0] + (kappa * group_h) @ group_f1
    sums[C] = adhesions[0] - wze - group_z @ group_f1
    sums[D] = slips[1] - (kappa * group_h) @ group_h - private * ones[3]
    sums[E] = group_z @ group_h - adhesions[1]
    sums[Z] = adhesions[2] - group_z @ adhesions[group]


def histogram(points: Points, slip_max: float) -> Array:
    """Number of samples by the slip that they surely reached, shape (BINS,)."""
    places = (points.surely_reached * (BINS / slip_max)).clip(0, BINS - 1).astype(np.int64)
    return np.bincount(places, minlength=BINS).astype(np.float64)


def _common_errors(points: Points, weight: Array) -> tuple[Array, Array]:
    """Errors of the slips by the vehicle speed, each with its variance.

    Args:
        points: Samples on one branch.
        weight: Weight of each sample in the mean place of its group, shape (n,).

    Returns:
        Error of each slip by one unit of each of k errors, shape (k, n): those of the groups, then
        the changes across them; and their variances, shape (k,).

    """
    starts, member = points.groups()
    var = points.common_var[starts]
    inside = member == np.arange(len(starts))[:, None] if len(starts) > 1 else np.ones((1, 1))
    level = inside * points.sign
    share = points.share
    if share is None or share.max() == share.min():
        return level, var
    mean = inside * weight
    total = mean.sum(axis=1, keepdims=True)
    middle = (mean @ share)[:, None] / np.maximum(total, 1e-300)
    return np.concatenate([level, level * (share - middle)]), np.concatenate([var, 2.0 * var])


def slope_at(points: Points, theta: CurveParameters) -> Array:
    """dμ/dλ of a curve at the samples, continued below zero slip; shape (n,)."""
    c1, c2, c3 = theta
    return np.asarray(c1 * c2 * np.exp(-c2 * points.slip) - c3)


def bend_at(points: Points, slope: Array, theta: CurveParameters) -> Array:
    """−d²μ/dλ² of a curve where it has the slopes; shape (n,).

    Limited where the private errors are as wide as the curve bends (c2² p large): there the
    series in them diverges.
    """
    _, c2, c3 = theta
    return np.asarray(
        c2 * (slope + c3) / np.maximum(c2 * c2 * points.private_var / WIDE_ERROR, 1.0)
    )


def slope_by_adhesion(points: Points, theta: CurveParameters) -> Array:
    """dμ/dλ of a curve where it has the samples' adhesion, whatever their slips; shape (n,)."""
    c1, c2, c3 = theta
    rest = c1 - c3 * points.slip - points.adhesion
    return np.asarray(c2 * np.minimum(np.maximum(rest, 0.0), c1) - c3)


def residual_at(points: Points, theta: CurveParameters) -> Array:
    """Adhesion less that of a curve continued below zero slip; shape (n,)."""
    c1, c2, c3 = theta
    return np.asarray(points.adhesion + c1 * np.expm1(-c2 * points.slip) + c3 * points.slip)


def common_shift(points: Points, theta: CurveParameters, noise_var: float) -> Points:
    """Samples without the error of each vehicle speed, estimated from the current curve.

    A group's error e minimises Σ (z − μ(λ − e))²/(σ² + a² p) + e²/q (Gauss-Newton), and so does the
    change across the group. They only move the point of linearisation: with the slope a there and
    z − a e in place of z, `increment` counts e as unknown all the same.

    Args:
        points: Samples on one branch.
        theta: Parameters (c1, c2, c3) of the current curve.
        noise_var: Variance σ² of the adhesion noise.

    Returns:
        Samples with λ − e in place of λ.

    """
    h, _, p, _, further, *_ = points
    b = slope_by_adhesion(points, theta)
    weight = 1.0 / (noise_var + b * b * p + further)
    a = slope_at(points, theta)
    shape, var = _common_errors(points, a * a * weight)
    var = np.maximum(var, 1e-30)
    error = np.zeros(len(var))
    moved = points
    for _ in range(2):
        a = slope_at(moved, theta)
        drift = 1.5 * a * bend_at(points, a, theta) * p * weight
        pull = shape @ (a * weight * residual_at(moved, theta) - drift) + error / var
        error = error - pull / ((shape * shape) @ (a * a * weight) + 1.0 / var)
        error = np.clip(error, -3.0 * np.sqrt(var), 3.0 * np.sqrt(var))
        moved = points._replace(slip=h - error @ shape)
    return moved
