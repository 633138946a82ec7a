"""Finds axles that deviate from all others: the surface has changed under them, or they spin."""

import numpy as np
from numpy.typing import NDArray

from adhesion_can.arrays import Array
from adhesion_can.estimation.observed_speed.settings import ObservedSpeedSettings
from adhesion_can.values import Stateful

MEAN_GAIN, MEAN_SCORE_STD = 0.25, 0.5
"""Gain of the mean deviation of an axle over blocks, and its standard deviation.

It is 0.38 for deviations that are white; the rest is a reserve for those that are not.
"""


class SurfaceGate(Stateful):
    """Deviation of each axle in a block, and its exponential mean (Roberts 1959)."""

    def __init__(self, drives: int, axles: int, settings: ObservedSpeedSettings) -> None:
        self._settings = settings
        self._mean = np.zeros((drives, axles))
        self._settling_s = np.zeros((drives, axles))

    def settling(self, dt: float) -> NDArray[np.bool_]:
        """Axles that are left out in a block of `dt` seconds, shape (drives, axles)."""
        settling = self._settling_s > 0
        self._settling_s = np.maximum(self._settling_s - dt, 0.0)
        return settling

    def judge(
        self,
        judged: NDArray[np.bool_],
        covariance: Array,
        H: Array,
        innovation: Array,
        R: Array,
    ) -> NDArray[np.bool_]:
        """Axles that deviate from what all others imply, looked for from the worst one on.

        S⁻¹e over the root of the diagonal of S⁻¹ is the deviation of each axle from its prediction
        by the others, in standard deviations (Cook and Weisberg 1982, deletion residuals). No
        gradient and no coupler can cause it, since they move all axles.

        Args:
            judged: Axles that may deviate, shape (drives, axles).
            covariance: Covariance of the state, shape (drives, n, n).
            H: Jacobian of the wheel speeds, shape (drives, axles, n).
            innovation: Measured less predicted ln(r ω), shape (drives, axles).
            R: Variances of the measurements, shape (drives, axles).

        Returns:
            Shape (drives, axles).

        """
        change = np.zeros_like(judged)
        H, innovation, R = H.copy(), innovation.copy(), R.copy()
        axles = judged.shape[1]
        mean = self._mean
        # Half of the axles at most: the others must be right about them.
        for _ in range(max(axles // 2, 1)):
            S = H @ covariance @ H.transpose(0, 2, 1) + R[:, :, None] * np.eye(axles)
            inverse = np.linalg.inv(S)
            score = (inverse @ innovation[:, :, None])[:, :, 0]
            score = score / np.sqrt(np.diagonal(inverse, axis1=1, axis2=2))
            # A gradual change is small in each block, and has the same sign in all of them.
            mean = self._mean + MEAN_GAIN * (score - self._mean)
            size = np.maximum(np.abs(score), np.abs(mean) / MEAN_SCORE_STD)
            size = np.where(judged & ~change, size, 0.0)
            worst = size.argmax(axis=1)
            odd = size.max(axis=1) > self._settings.gate
            if not odd.any():
                break
            new = np.zeros_like(change)
            new[odd, worst[odd]] = True
            change |= new
            H[new], innovation[new], R[new] = 0.0, 0.0, 1.0
        self._mean = np.where(judged & ~change, mean, 0.0)
        self._settling_s = np.where(change, self._settings.settling_s, self._settling_s)
        return change
