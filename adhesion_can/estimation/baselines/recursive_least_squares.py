"""Recursive least squares with a forgetting factor on the linearised curve.

Near a nominal c̄2 the curve is linear in β = (c1, c3, d) with d = c1 (c2 − c̄2), to first order:

    μ(λ) ≈ c1 (1 − e^(−c̄2 λ)) − c3 λ + d λ e^(−c̄2 λ)

Exponentially weighted least squares on it is kept in information form, Λ = Σ w φφᵀ and
b = Σ w φ z, many samples at once. It equals the recursion of gain and covariance (Ljung, "System
Identification: Theory for the User", 1999, section 11.2), as a test verifies.
"""

from dataclasses import dataclass
from math import sqrt

import numpy as np

from adhesion_can.arrays import Array
from adhesion_can.estimation.baselines.forgetting import (
    ForgettingWindow,
    decay_weights,
    peak_errors,
    select_usable,
)
from adhesion_can.estimation.baselines.settings import EvolutionSettings
from adhesion_can.estimation.identifiability import IdentifiabilitySettings
from adhesion_can.physics.burckhardt import CurveParameters
from adhesion_can.physics.estimate import Estimate
from adhesion_can.physics.samples import Samples


@dataclass(frozen=True, slots=True, kw_only=True)
class RlsSettings:
    """Forgetting and prior of the recursive least squares.

    Attributes:
        forgetting: Forgetting factor per sample, in 0..1; the window has about 1/(1 − forgetting)
            samples. Larger: less noise, slower.
        nominal: Prior mean (c1, c2, c3), that of a wet rail; the estimate where data carry no
            information.
        prior_std: Standard deviations of the prior of (c1, c2, c3). Larger: less bias, more
            wind-up.
        noise_std: Standard deviation of the adhesion noise, 1, for the weight of the prior.
        chunk: Number of samples after which c̄2 is set to the estimate of c2.

    """

    forgetting: float = 0.996
    nominal: CurveParameters = (0.27, 45.0, 0.22)
    prior_std: tuple[float, float, float] = (0.5, 37.0, 1.0)
    noise_std: float = 0.01
    chunk: int = 50

    def __post_init__(self) -> None:
        if not 0 < self.forgetting < 1 or self.chunk < 1:
            raise ValueError("forgetting must be in 0..1, chunk at least 1")
        if not min(*self.nominal, *self.prior_std, self.noise_std) > 0:
            raise ValueError("nominal and standard deviations must be positive")


class RlsEstimator:
    """Recursive least squares as an estimator.

    c̄2 follows the estimate of c2 (recursive Gauss-Newton): with c̄2 held at 45 a surface of
    c2 = 20 came out 14 % low in μ_max on data without noise. Wind-up, the growth of the
    covariance without excitation, is bounded by a prior that is not forgotten (stabilised
    forgetting). Its information is `noise_std`²/`prior_std`² of a sample, negligible beside data.

    Args:
        evolution: Settings with the range of (c1, c2, c3).
        identifiability: Limits from which the peak counts as identifiable, and range of slip.
        settings: Forgetting and prior.

    """

    def __init__(
        self,
        evolution: EvolutionSettings | None = None,
        identifiability: IdentifiabilitySettings | None = None,
        settings: RlsSettings | None = None,
    ) -> None:
        self._settings = settings = settings or RlsSettings()
        self._range = evolution or EvolutionSettings()
        limits = identifiability or IdentifiabilitySettings()
        self._slip_max = limits.slip_max
        self._window = ForgettingWindow(settings.forgetting, limits)
        c1, self._c2, _ = settings.nominal
        spread = np.array(settings.prior_std)[[0, 2, 1]] * [1.0, 1.0, c1]
        self._prior = np.diag((settings.noise_std / spread) ** 2)
        self._c1 = c1
        self._information = np.zeros((3, 3))
        self._squared = np.zeros((3, 3))  # the information with squared weights
        self._vector = np.zeros(3)
        self._zz = 0.0
        self._current: Estimate | None = None

    def update(self, samples: Samples, now_us: int) -> Estimate | None:
        """Process samples, as `Estimator.update` defines it."""
        del now_us  # forgetting goes by samples, not by time
        new = select_usable(samples, self._slip_max)
        if len(new):
            self._window.add(new)
            h, z = new.folded()
            for k in range(0, len(h), self._settings.chunk):
                rows = slice(k, k + self._settings.chunk)
                self._add(h[rows], z[rows])
                self._relinearise()
            self._current = self._estimate()
        return self._current

    def _add(self, h: Array, z: Array) -> None:
        weights = decay_weights(self._settings.forgetting, len(h))
        kept = self._settings.forgetting ** len(h)
        phi = regressors(h, self._c2)
        weighted = phi.T * weights
        self._information = kept * self._information + weighted @ phi
        self._squared = kept**2 * self._squared + (weighted * weights) @ phi
        self._vector = kept * self._vector + weighted @ z
        self._zz = kept * self._zz + float(weights @ (z * z))

    def _solve(self) -> Array:
        """β̂ within the range of (c1, c2, c3), shape (3,)."""
        (low1, low2, low3), (up1, up2, up3) = self._range.lower, self._range.upper
        c1, c2, c3 = self._settings.nominal
        prior_mean = np.array([c1, c3, c1 * (c2 - self._c2)])
        # c2 moves by half at most in one step: beyond, the linearisation is not the curve.
        fall, rise = max(low2 - self._c2, -self._c2 / 2), min(up2 - self._c2, self._c2 / 2)
        return bounded_minimum(
            self._information + self._prior,
            self._vector + self._prior @ prior_mean,
            np.array([low1, low3, self._c1 * fall]),
            np.array([up1, up3, self._c1 * rise]),
        )

    def _relinearise(self) -> None:
        """Carry the sums over to c̄2 = ĉ2: old d = new d + c1 (ĉ2 − c̄2), linear in β."""
        c1, _, d = self._solve()
        self._c1 = max(float(c1), 1e-6)
        low, up = self._range.lower[1], self._range.upper[1]
        moved = min(max(self._c2 + float(d) / self._c1, low, 1e-3), up)
        carry = np.eye(3)
        carry[2, 0] = moved - self._c2
        self._c2 = moved
        self._information = carry.T @ self._information @ carry
        self._squared = carry.T @ self._squared @ carry
        self._vector = carry.T @ self._vector

    def _estimate(self) -> Estimate:
        beta, settings = self._solve(), self._settings
        squares = self._zz - 2 * beta @ self._vector + beta @ self._information @ beta
        noise = sqrt(max(float(squares), 0.0) / max(self._window.samples - 3.0, 1.0))
        # Sandwich covariance: weights that forget are not the reciprocal variances of the noise.
        inverse = np.linalg.inv(self._information + self._prior)
        meat = noise**2 * self._squared + settings.noise_std**2 * self._prior
        c1, c3, d = beta
        c1 = max(c1, 1e-6)
        to_theta = np.array([[1.0, 0.0, 0.0], [-d / c1**2, 0.0, 1.0 / c1], [0.0, 1.0, 0.0]])
        carried = to_theta @ inverse
        covariance = carried @ meat @ carried.T
        theta = np.clip([c1, self._c2 + d / c1, c3], self._range.lower, self._range.upper)
        errors = peak_errors(theta, covariance, self._slip_max)
        return self._window.estimate(theta, covariance, errors, noise)


def regressors(h: Array, c2: float) -> Array:
    """∂μ/∂(c1, c3, d) at the slips h for c̄2, shape (n, 3)."""
    e = np.exp(-c2 * h)
    return np.column_stack([1.0 - e, -h, h * e])


def bounded_minimum(matrix: Array, vector: Array, lower: Array, upper: Array) -> Array:
    """Minimum of xᵀAx/2 − xᵀb in a box, by a simple active-set method.

    The component farthest outside is fixed to its bound for good, and the rest is solved again (for
    the general method: Nocedal and Wright, "Numerical Optimization", 2006, section 16.5).

    Args:
        matrix: Matrix A, positive definite, shape (m, m).
        vector: Vector b, shape (m,).
        lower: Lower bounds of x, shape (m,).
        upper: Upper bounds of x, shape (m,).

    """
    free = np.ones(len(vector), dtype=bool)
    x = np.zeros(len(vector))
    while free.any():
        rest = vector[free] - matrix[np.ix_(free, ~free)] @ x[~free]
        x[free] = np.linalg.solve(matrix[np.ix_(free, free)], rest)
        out = np.where(free, np.maximum(lower - x, x - upper) / (upper - lower), 0.0)
        worst = int(out.argmax())
        if out[worst] <= 0.0:
            break
        x[worst] = min(max(x[worst], lower[worst]), upper[worst])
        free[worst] = False
    return x
