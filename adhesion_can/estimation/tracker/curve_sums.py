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
from adhesion_can.estimation.tracker.layout import (
    CERTAIN_STDS,
    CHEBYSHEV,
    NODES,
    X_NODES,
    X_RANGE,
    D,
    E,
    Z,
)
from adhesion_can.physics.burckhardt import CurveParameters

WIDE_ERROR = 0.02
"""c2² p from which the private error is as wide as the bend of the curve: the correction of the
slope is limited there."""
_BARYCENTRIC = np.where(np.arange(NODES) % 2, -1.0, 1.0) * np.sin(np.arccos(CHEBYSHEV))


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
        errors = (self.common_var, self.private_var, self.transient_var)
        return not any(map(np.count_nonzero, errors))

    @property
    def surely_reached(self) -> Array:
        """Slip that was reached whatever its error: λ less `CERTAIN_STDS` of its errors, (n,)."""
        return np.asarray(self.slip - CERTAIN_STDS * np.sqrt(self.private_var + self.common_var))

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


def slope_at(points: Points, theta: CurveParameters) -> Array:
    """dμ/dλ of a curve at the samples, continued below zero slip; shape (n,)."""
    c1, c2, c3 = theta
    return np.asarray(c1 * c2 * np.exp(-c2 * points.slip) - c3)


def curvature_at(points: Points, slope: Array, theta: CurveParameters) -> Array:
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
