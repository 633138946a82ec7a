"""Maximum likelihood on the Burckhardt curve: eq. 7-13, Fisher information, standard errors.

The model is z(k) = c1 − c1 e^(−c2 h(k)) − c3 h(k) + n(k), n ~ N(0, σ²), eq. 7, with the slip
ratio h ≥ 0 and the adhesion z folded onto one branch (`Samples.folded`).
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from adhesion_can.arrays import Array
from adhesion_can.physics.burckhardt import SLIP_MAX, adhesion, peak, peak_gradient


def innovation(theta: ArrayLike, h: Array, z: Array) -> Array:
    """Innovation z̃(k) = z(k) − ẑ(k) of the prediction by θ (eq. 8), shape (n,)."""
    return np.asarray(z - adhesion(h, *np.asarray(theta, dtype=np.float64)))


def sum_of_squares(theta: ArrayLike, h: Array, z: Array) -> float:
    """J(θ) = Σ (z_k − c1 + c1 e^(−c2 h_k) + c3 h_k)², eq. 13.

    The paper prints (14) as arg max J; arg min is meant, as (10)-(13) derive.
    """
    e = innovation(theta, h, z)
    return float(e @ e)


def log_likelihood(theta: ArrayLike, h: Array, z: Array, noise_std: float) -> float:
    """Ln L of eq. 9 with its constant: −(n/2) ln(2πσ²) − J/(2σ²)."""
    n = len(h)
    squares = sum_of_squares(theta, h, z)
    return float(-0.5 * n * np.log(2 * np.pi * noise_std**2) - squares / (2 * noise_std**2))


def sensitivity(theta: ArrayLike, h: Array) -> Array:
    """∂μ/∂(c1, c2, c3) at the slips h, shape (n, 3)."""
    c1, c2, _ = np.asarray(theta, dtype=np.float64)
    e = np.exp(-c2 * h)
    return np.column_stack([1.0 - e, c1 * h * e, -h])


def fisher_information(theta: ArrayLike, h: Array, noise_std: float) -> Array:
    """Fisher information of (c1, c2, c3) in the slips h, shape (3, 3)."""
    g = sensitivity(theta, h)
    return np.asarray(g.T @ g / noise_std**2)


class StandardErrors(NamedTuple):
    """Standard errors of the curve parameters and of the peak.

    Attributes:
        covariance: Covariance of (c1, c2, c3), shape (3, 3); diagonal inf where the slips do not
            determine them.
        mu_max: Standard deviation of μ_m, 1.
        lambda_m: Standard deviation of λ_m, 1; inf where the curve has no interior peak.

    """

    covariance: Array
    mu_max: float
    lambda_m: float


UNDETERMINED = StandardErrors(np.diag([np.inf] * 3), np.inf, np.inf)
"""Standard errors where the samples determine nothing."""


def standard_errors(
    theta: ArrayLike, h: Array, noise_std: float, slip_max: float = SLIP_MAX
) -> StandardErrors:
    """Cramér-Rao bound: inverse Fisher information, propagated to the peak by its gradient.

    Args:
        theta: Curve parameters (c1, c2, c3), true or estimated.
        h: Slip ratios, ≥ 0, shape (n,).
        noise_std: Standard deviation σ of the adhesion noise, eq. 7.
        slip_max: Largest slip ratio of the model.

    """
    theta = np.asarray(theta, dtype=np.float64)
    if len(h) < 3:
        return UNDETERMINED
    g = sensitivity(theta, h)
    # Columns of one length: the parameters' magnitudes (1, 100, 0.1) do not spoil the inverse.
    norms = np.linalg.norm(g, axis=0)
    if not norms.min() > 0.0:
        return UNDETERMINED
    scale = 1.0 / norms
    values, vectors = np.linalg.eigh((g * scale).T @ (g * scale))
    if values[0] <= max(values[-1] * 1e-14, 0.0):
        return UNDETERMINED
    covariance = (vectors / values) @ vectors.T * np.outer(scale, scale) * noise_std**2
    c1, c2, c3 = map(float, theta)
    rows = peak_gradient(c1, c2, c3, slip_max)
    variance = np.einsum("ij,jk,ik->i", rows, covariance, rows)
    mu_std, lambda_std = np.sqrt(variance)
    interior = bool(peak(c1, c2, c3, slip_max).interior)
    return StandardErrors(covariance, float(mu_std), float(lambda_std) if interior else np.inf)
