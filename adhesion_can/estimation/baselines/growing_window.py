"""Least squares over a window that grows while one curve explains it, and then starts again.

The window is reset where the residuals of the latest samples exceed its own noise: a chi-square
test of the variance. Only slips within the window's range are tested, since beyond it a poorly
known curve is no evidence of another surface.
"""

from dataclasses import dataclass, replace
from math import inf

import numpy as np
import scipy

from adhesion_can.arrays import Array
from adhesion_can.estimation.baselines.block_fit import fit_from
from adhesion_can.estimation.baselines.forgetting import UNKNOWN, select_usable
from adhesion_can.estimation.baselines.settings import EvolutionSettings
from adhesion_can.estimation.identifiability import IdentifiabilitySettings
from adhesion_can.estimation.likelihood import innovation
from adhesion_can.physics.burckhardt import adhesion_slope
from adhesion_can.physics.estimate import Estimate, Identifiable
from adhesion_can.physics.samples import NO_SAMPLES, Samples


@dataclass(frozen=True, slots=True, kw_only=True)
class WindowSettings:
    """Growth and reset of the window.

    Attributes:
        latest: Number of latest samples that are tested for a reset, and that the first fit needs.
            Larger: smaller changes are detected, later.
        share: Relative growth of the window after which the curve is fitted again. Larger: less
            CPU, an older estimate.
        most: Largest number of samples of the window; beyond it the oldest are dropped.
        ratio: Least root mean square of the latest residuals, over the window's, for a reset, so
            that a small increase of the noise is no change. Larger: fewer false alarms.
        false_alarm: Probability of a reset by Gaussian noise alone, per test.
        floor: Least standard deviation of the adhesion noise in the test, 1.

    """

    latest: int = 60
    share: float = 0.05
    most: int = 20_000
    ratio: float = 1.3
    false_alarm: float = 1e-6
    floor: float = 1e-3

    def __post_init__(self) -> None:
        if not 1 <= self.latest <= self.most:
            raise ValueError("latest must be in 1..most")
        if not (self.share > 0 and self.ratio > 1 and self.floor > 0):
            raise ValueError("share and floor must be positive, ratio above 1")
        if not 0 < self.false_alarm < 1:
            raise ValueError("false_alarm must be in 0..1")


class WindowEstimator:
    """Growing-window least squares with a reset, as an estimator.

    It is fitted again when it has grown by `share`, or by a block of samples, and by `latest` at
    least. After a reset the old curve is given, as not identifiable, until the new window holds
    `latest` samples.

    Args:
        evolution: Settings with the block length and the search range.
        identifiability: Limits from which the peak counts as identifiable, and range of slip.
        settings: Settings of the window and of its reset.

    """

    def __init__(
        self,
        evolution: EvolutionSettings | None = None,
        identifiability: IdentifiabilitySettings | None = None,
        settings: WindowSettings | None = None,
    ) -> None:
        self._evolution = evolution or EvolutionSettings()
        self._identifiability = identifiability or IdentifiabilitySettings()
        self._settings = settings or WindowSettings()
        self._window = self._pending = NO_SAMPLES
        self._since_us = 0
        self._current: Estimate | None = None

    def update(self, samples: Samples, now_us: int) -> Estimate | None:
        """Process samples, as `Estimator.update` defines it."""
        del now_us  # the window is a number of samples, not a time
        new = select_usable(samples, self._identifiability.slip_max)
        changed = False
        if len(new):
            self._pending = Samples.concatenate([self._pending, new])
            changed = self._reset_where_changed()
            if not len(self._window):
                self._since_us = int(self._pending.t_us[0])
            growth = min(self._settings.share * len(self._window), self._evolution.block)
            if len(self._pending) >= max(growth, self._settings.latest):
                self._fit()
        if self._current is not None:
            self._current = replace(
                self._current,
                surface_since_us=self._since_us,
                change_probability=1.0 if changed else 0.0,
            )
        return self._current

    def _reset_where_changed(self) -> bool:
        """Whether the pending samples contradict the curve; the window then starts again."""
        if self._current is None or not len(self._window):
            return False
        h, z = self._pending.folded()
        rows = np.flatnonzero(h <= np.abs(self._window.slip).max())
        if len(rows) < self._settings.latest // 2:
            return False
        h, z, slip_var = h[rows], z[rows], self._pending.slip_total_var[rows]
        # Noise in slip counts by the slope, so most where slips are small.
        by_slip = adhesion_slope(h, *self._current.theta) ** 2 * slip_var
        explained = max(self._current.noise_std, self._settings.floor) ** 2 + by_slip
        squares = innovation(self._current.theta, h, z) ** 2 / explained
        latest = squares[-self._settings.latest :]
        if not (self._contradicts(latest) or self._contradicts(squares)):
            return False
        first = rows[
            _most_likely_change(squares, max(float(latest.mean()), self._settings.ratio**2))
        ]
        self._pending = self._pending.select(slice(int(first), None))
        self._window = NO_SAMPLES
        self._current = replace(
            self._current,
            covariance=UNKNOWN,
            mu_max_std=inf,
            lambda_m_std=inf,
            identifiable=Identifiable(mu_max=False, lambda_m=False),
        )
        return True

    def _contradicts(self, squares: Array) -> bool:
        n, settings = len(squares), self._settings
        limit = max(scipy.special.chdtri(n, settings.false_alarm) / n, settings.ratio**2)
        return bool(squares.mean() > limit)

    def _fit(self) -> None:
        last = self._current if len(self._window) else None
        joined = Samples.concatenate([self._window, self._pending])
        self._window = joined.select(slice(-self._settings.most, None))
        self._pending = NO_SAMPLES
        self._current = fit_from(last, self._window, self._evolution, self._identifiability)


def _most_likely_change(squares: Array, after: float) -> int:
    """Row before which the squared residuals have an expectation of 1, and `after` > 1 from it on.

    Maximum likelihood: the log likelihood ratio of two normal variances, summed from each row on,
    is largest there.
    """
    gain = squares * (1.0 - 1.0 / after) - np.log(after)
    return int(np.argmax(np.cumsum(gain[::-1])[::-1]))
