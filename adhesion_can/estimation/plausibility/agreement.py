"""Whether samples agree with a curve again, after an objection to them."""

from collections import deque
from math import sqrt

import numpy as np

from adhesion_can.arrays import Array
from adhesion_can.estimation.plausibility.steps import CurveBefore
from adhesion_can.physics.burckhardt import adhesion, adhesion_slope
from adhesion_can.physics.samples import Samples
from adhesion_can.values import Stateful

UPDATES = 40
"""Number of latest updates that have to agree."""
SLIP_SHARE, LEVEL_SHARE = 0.08, 0.03
"""Offset of the slips as a share of λ_m, and of the adhesion below and above half of it as a
share of μ_max, up to which samples agree; the former with two of its standard deviations."""
LOW, LEAST_LOW = 0.5, 0.1
"""Slip below which samples show an offset, as a share of λ_m, and share of samples that must."""
COASTING = 0.02
"""Adhesion below which wheels run as the vehicle does on every rail."""
COASTING_SLIP = 0.002
"""Mean slip up to which they do."""


class Agreement(Stateful):
    """Compares samples with the curve from before an objection, and with none in coasting."""

    def __init__(self) -> None:
        self._curve: CurveBefore | None = None
        self._sums: deque[Array] = deque(maxlen=UPDATES)
        self._coasted: deque[float] = deque(maxlen=UPDATES)

    def begin(self, curve: CurveBefore | None) -> None:
        """Start again with the curve from before the objection; None where none was known."""
        self._curve = curve
        self._sums.clear()
        self._coasted.clear()

    def add(self, samples: Samples) -> bool:
        """Whether the samples of the latest updates agree, with these.

        Args:
            samples: Samples of an update, at least one.

        """
        slip, mu = samples.slip, samples.adhesion
        usable = np.isfinite(slip) & np.isfinite(mu) & (np.abs(slip) < 1.0)
        if not usable.any():
            self._sums.clear()
            self._coasted.clear()
            return False
        slip, mu = slip[usable], mu[usable]
        if float(np.abs(mu).max()) < COASTING:
            self._coasted.append(float(slip.mean()))
        else:
            self._coasted.clear()
        if len(self._coasted) == UPDATES:
            return abs(sum(self._coasted)) < COASTING_SLIP * UPDATES
        return self._curve is not None and self._agrees(slip, mu, self._curve)

    def _agrees(self, slip: Array, mu: Array, curve: CurveBefore) -> bool:
        residual = mu - adhesion(slip, *curve.theta)
        slope = adhesion_slope(slip, *curve.theta)
        low = np.abs(slip) < LOW * curve.lambda_m
        along = residual * np.copysign(1.0, slip)
        self._sums.append(
            np.array(
                [
                    len(slip),
                    slope @ slope,
                    slope @ residual,
                    residual @ residual,
                    np.count_nonzero(low),
                    along[low].sum(),
                    along[~low].sum(),
                ]
            )
        )
        if len(self._sums) < UPDATES:
            return False
        count, square, product, rest, lower, level, upper_level = np.sum(
            self._sums, axis=0
        ).tolist()
        if lower < LEAST_LOW * count or not square > 0.0:
            return False  # near the top another rail and another error look alike
        # The scatter within the window, whatever its mean; errors that last are part of it.
        offset = abs(product / square) + 2.0 * sqrt(rest / count / square)
        limit = LEVEL_SHARE * curve.mu_max
        return bool(
            offset < SLIP_SHARE * curve.lambda_m
            and abs(level) < limit * lower
            and abs(upper_level) <= limit * (count - lower)
        )
