"""How single axles deviate from the common curve, as far as their data tell.

Axle i follows (1 + g_i) μ(λ − d_i): a level of its own (load, cleaner rail behind the first axles)
and a slip of its own (a wheel radius that is off by 1 % shifts λ by 0.01). To first order its
residual is g μ − d a with the slope a = dμ/dλ: two regressors, with normal priors that shrink an
axle with little data to the pool.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from adhesion_can.arrays import Array


@dataclass(frozen=True, slots=True)
class AxleSettings:
    """How far axles may deviate.

    Attributes:
        level_std: of an axle's level, relative.
        slip_std: of an axle's slip, absolute.
        memory_s: time after which what was seen of an axle has faded to a third.

    """

    level_std: float = 0.05
    slip_std: float = 0.004
    memory_s: float = 60.0

    def __post_init__(self) -> None:
        if not min(self.level_std, self.slip_std, self.memory_s) > 0:
            raise ValueError("level_std, slip_std and memory_s must be positive")


class AxleDeviations:
    """Deviations of each axle from the pool.

    Args:
        settings: see there.

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
        """Take samples into the normal equations of (g, d) of each axle.

        Args:
            axle: number of the axle of each sample, (n,); 0 stands for none.
            level: μ of the pool's curve, the regressor of g, (n,).
            shifted: −dμ/dλ of it, with the sign of the slip, the regressor of d, (n,): the slip
                that a radius makes has the same sign in traction and in braking.
            residual: adhesion less that of the pool's curve, (n,).
            weight: of each, noise over what is explained of the residual, (n,).

        """
        terms = weight * np.stack(
            [
                level * level,
                level * shifted,
                shifted * shifted,
                level * residual,
                shifted * residual,
            ]
        )
        top = int(axle.max())
        if top > len(self._normal):
            self._normal = np.pad(self._normal, ((0, top - len(self._normal)), (0, 0)))
        own = axle == np.arange(1, len(self._normal) + 1)[:, None]
        self._normal += own.astype(np.float64) @ terms.T

    def fade(self, seconds: float, share: float = 1.0) -> None:
        """Let what was seen fade with time, and by a further share."""
        self._normal *= share * np.exp(-seconds / self._settings.memory_s)

    def of(
        self, mu_max: float, lambda_m: float, sign: float, noise_var: float
    ) -> Mapping[int, tuple[float, float]]:
        """(μ_max, λ_m) of each axle that was seen.

        Args:
            mu_max: of the pool.
            lambda_m: of the pool, in its slip.
            sign: 1 in traction, −1 in braking.
            noise_var: σ² of the adhesion.

        """
        if not len(self._normal):
            return {}
        n = self._normal
        a = n[:, 0] + noise_var / self._settings.level_std**2
        c = n[:, 2] + noise_var / self._settings.slip_std**2
        b = n[:, 1]
        # Only rounding takes it to 0, after levels beyond all measure: they tell nothing apart.
        det = a * c - b * b
        det = np.where(det > 0.0, det, np.inf)
        g = (c * n[:, 3] - b * n[:, 4]) / det
        d = (a * n[:, 4] - b * n[:, 3]) / det
        values = zip(
            ((1.0 + g) * mu_max).tolist(),
            np.maximum(lambda_m + sign * d, 0.0).tolist(),
            strict=True,
        )
        seen = (n[:, 0] > 0).tolist()
        return {i + 1: value for i, value in enumerate(values) if seen[i]}
