"""A Gaussian state of many drives side by side: linear prediction and update (Kalman 1960).

The update uses Joseph's form, which keeps the covariance positive under rounding (Bierman 1977).
"""

import numpy as np
from numpy.typing import NDArray

from adhesion_can.arrays import Array
from adhesion_can.values import Stateful


class GaussianState(Stateful):
    """Means (drives, n) and covariances (drives, n, n).

    One state is only considered (Schmidt 1966): its uncertainty counts, and no measurement changes
    it but in drives that are to learn it.
    """

    def __init__(self, mean: Array, covariance: Array, considered: int) -> None:
        self.mean = mean
        self.covariance = covariance
        self._considered = considered

    def add_row(self, to: int | slice, source: int, factor: Array) -> None:
        """Add factor · state[source] to state[to]; factor of shape (drives,) or (drives, k)."""
        P = self.covariance
        rows = factor[:, None] if factor.ndim == 1 else factor
        target = slice(to, to + 1) if isinstance(to, int) else to
        P[:, target, :] += rows[:, :, None] * P[:, source, None, :]
        P[:, :, target] += P[:, :, source, None] * rows[:, None, :]

    def scale(self, part: slice, factor: Array) -> None:
        """Multiply a part of the covariance's rows and columns by factors, (drives, k)."""
        self.covariance[:, part, :] *= factor[:, :, None]
        self.covariance[:, :, part] *= factor[:, None, :]

    def update(
        self, H: Array, innovation: Array, R: Array, learns: NDArray[np.bool_] | bool = False
    ) -> None:
        """Take measurements in.

        Args:
            H: Jacobian, shape (drives, m, n).
            innovation: Measurements less their predictions, shape (drives, m).
            R: Variances of the measurements, shape (drives, m), or covariances, (drives, m, m).
            learns: Whether a drive's considered state is changed too, shape (drives,).

        """
        noise = R if R.ndim == 3 else R[:, :, None] * np.eye(R.shape[1])
        P = self.covariance
        PH = P @ H.transpose(0, 2, 1)
        S = H @ PH + noise
        gain = np.linalg.solve(S, PH.transpose(0, 2, 1)).transpose(0, 2, 1)
        gain[:, self._considered, :] *= np.reshape(learns, (-1, 1))
        self.mean = self.mean + (gain @ innovation[:, :, None])[:, :, 0]
        rest = np.eye(P.shape[1]) - gain @ H
        P = rest @ P @ rest.transpose(0, 2, 1) + gain @ noise @ gain.transpose(0, 2, 1)
        self.covariance = 0.5 * (P + P.transpose(0, 2, 1))
