"""Deviations of single axles from the common curve.

Axle i follows (1 + g_i) μ(λ − d_i): a level of its own (load, cleaner rail behind the first axles)
and a slip of its own (a wheel radius that is off by 1 % shifts λ by 0.01). To first order its
residual is g μ − d a with the slope a = dμ/dλ: a linear regression on two regressors, with normal
priors that shrink an axle with little data to the common curve (ridge regression).
"""

from collections.abc import Mapping
from math import exp, inf

import numpy as np
from numpy.typing import NDArray

from adhesion_can.arrays import Array
from adhesion_can.estimation.tracker.settings import AxleSettings
from adhesion_can.values import Stateful


class AxleDeviations(Stateful):
    """Deviations of each axle from the common curve.

    Args:
        settings: Prior and forgetting.

    """

    def __init__(self, settings: AxleSettings) -> None:
        self._settings = settings
        self._normal: Array = np.empty((0, 5))
        self._axles: list[int] = []

    def add(
        self,
        axle: NDArray[np.int64],
        level: Array,
        shifted: Array,
        residual: Array,
        weight: Array,
    ) -> None:
        """Add samples to the normal equations of (g, d) of each axle.

        Args:
            axle: Number of each sample's axle, shape (n,); 0 for none.
            level: Adhesion μ of the common curve, the regressor of g, shape (n,).
            shifted: Slope −dμ/dλ of the common curve with the sign of the slip, the regressor of d,
                shape (n,); an error of the radius shifts the slip by the same sign in traction and
                in braking.
            residual: Adhesion less that of the common curve, shape (n,).
            weight: Weight of each sample, noise variance over residual variance, shape (n,).

        """
        missing = max(axle.tolist()) - len(self._normal)
        if missing > 0:
            self._normal = np.pad(self._normal, ((0, missing), (0, 0)))
        by_level, by_shift = weight * level, weight * shifted
        terms = np.array(
            [
                by_level * level,
                by_level * shifted,
                by_shift * shifted,
                by_level * residual,
                by_shift * residual,
            ]
        )
        # One sample after the other, each into the row of its axle.
        place = axle * 5 + np.arange(5)[:, None]
        rows = np.bincount(place.ravel(), terms.ravel(), 5 * (len(self._normal) + 1))
        self._normal += rows[5:].reshape(-1, 5)

    def fade(self, seconds: float, share: float = 1.0) -> None:
        """Forget exponentially with time, and by a further factor."""
        self._normal *= share * exp(-seconds / self._settings.memory_s)

    def estimate(
        self, mu_max: float, lambda_m: float, sign: float, noise_var: float
    ) -> Mapping[int, tuple[float, float]]:
        """(μ_max, λ_m) by axle, for the axles with samples.

        Args:
            mu_max: Largest adhesion of the common curve, 1.
            lambda_m: Slip ratio of the common curve's peak.
            sign: 1 in traction, −1 in braking.
            noise_var: Variance σ² of the adhesion noise.

        """
        level_prior = noise_var / self._settings.level_std**2
        slip_prior = noise_var / self._settings.slip_std**2
        peaks = {}
        # Numbers: for a handful of axles faster than arrays of them.
        for axle, (levels, b, slips, r_level, r_slip) in enumerate(self._normal.tolist(), start=1):
            if levels <= 0.0:
                continue
            a, c = levels + level_prior, slips + slip_prior
            # It is 0 only by rounding, after absurdly large levels: nothing can be separated then.
            det = a * c - b * b
            det = det if det > 0.0 else inf
            g, d = (c * r_level - b * r_slip) / det, (a * r_slip - b * r_level) / det
            peaks[axle] = (1.0 + g) * mu_max, max(lambda_m + sign * d, 0.0)
        return peaks
