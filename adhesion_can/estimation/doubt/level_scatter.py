"""Scatter of the rail's level about the estimate, over half seconds whatever the drive's length.

The blocks of the regression grow with the drive, until each holds several joints or patches of the
rail, and their means scatter no more. An estimate of the mean level is then sure, but the level
under the wheels is another one. So the samples of each half second are compared with the estimate
that was there when it began: the error of a forecast, without a fit (Dawid, "Prequential Analysis",
JRSS-A 147, 1984).
"""

from collections import deque
from math import sqrt
from typing import NamedTuple

import numpy as np

from adhesion_can.arrays import Array
from adhesion_can.estimation.doubt.lasting_errors import LASTING
from adhesion_can.estimation.tracker.points import is_valid
from adhesion_can.physics.estimate import Estimate
from adhesion_can.physics.samples import Samples
from adhesion_can.values import Stateful

WINDOW_S = 0.5
"""Duration of the samples of one level, s: with 25 m from joint to joint, a rail's level is seen up
to 25 m/s."""
KEPT = 40
"""Number of the latest levels that are kept."""
FEWEST = 12
"""Number of levels below which their scatter is not used."""
TRIMMED = 2
"""Number of the largest errors that are left out: a single change of the surface has no more."""
FEWEST_SAMPLES = 20
"""Number of samples below which a window has no level."""
FLAT_SLOPE = 0.3
"""Logarithmic slope up to which a curve counts as flat: its level is that of the peak."""


class _Level(NamedTuple):
    """Level of the samples of a window against the estimate before them.

    Attributes:
        square: Square of the error, as a share of the adhesion.
        noise: Variance of that error by independent errors.
        estimate_var: Variance of the level of the estimate itself.

    """

    square: float
    noise: float
    estimate_var: float


class LevelScatter(Stateful):
    """Standard deviation of the level by which estimates missed the samples that came next.

    Args:
        slip_max: Largest slip ratio of a usable sample.

    """

    def __init__(self, slip_max: float) -> None:
        self._slip_max = slip_max
        self._levels: deque[_Level] = deque(maxlen=KEPT)
        self._waiting: list[Samples] = []
        self._before: Estimate | None = None
        self.std = 0.0
        """Standard deviation of the level, as a share of the adhesion; 0 by chance alone."""

    def add(self, samples: Samples, estimate: Estimate) -> None:
        """Add the samples of an update, at least one, and the estimate after them."""
        before = self._before
        if before is None:
            self._before = estimate
            return
        self._waiting.append(samples)
        lasted_us = int(samples.t_us[-1]) - int(self._waiting[0].t_us[0])
        if lasted_us < WINDOW_S * 1e6 and before.surface_since_us == estimate.surface_since_us:
            return
        level = self._compare(Samples.concatenate(self._waiting), before)
        self._waiting, self._before = [], estimate
        if level is not None:
            self._levels.append(level)
            self.std = _scatter(self._levels)

    def _compare(self, samples: Samples, estimate: Estimate) -> _Level | None:
        """Level of samples against an estimate; None where it is not known or hardly sampled."""
        if not estimate.identifiable.mu_max:
            return None
        samples = samples.select(is_valid(samples, self._slip_max))
        c1, c2, c3 = estimate.theta
        size, sign = np.abs(samples.slip), np.where(samples.slip < 0.0, -1.0, 1.0)
        decay = np.exp(-c2 * size)
        curve, slope = c1 * (1.0 - decay) - c3 * size, c1 * c2 * decay - c3
        flat = (np.abs(slope) * size <= FLAT_SLOPE * curve) & (curve > 0.0)
        if np.count_nonzero(flat) < FEWEST_SAMPLES:
            return None
        var = estimate.noise_std**2 + samples.transient_var + slope**2 * samples.slip_total_var
        weighted: Array = flat * curve / var
        information = float(weighted @ curve)
        share = float(weighted @ (sign * samples.adhesion - curve)) / information
        relative_std = estimate.mu_max_std / estimate.mu_max
        return _Level(share * share, 1.0 / information, relative_std * relative_std)


def _scatter(levels: deque[_Level]) -> float:
    """Standard deviation of levels beyond chance; 0 where there are too few or it is none."""
    if len(levels) < FEWEST:
        return 0.0
    kept = np.array(sorted(levels)[: len(levels) - TRIMMED])
    square, noise, estimate_var = kept.mean(axis=0).tolist()
    return sqrt(square - noise - estimate_var) if square > LASTING * (noise + estimate_var) else 0.0
