"""Factors on the stated variances of samples, from blocks of them and the configured noise.

The ratio of a sensor is a low quantile of the ratios of the latest blocks: slip that is swept,
jumps or sticks is in some blocks, noise is in all. Its logarithm weighs as many seconds as there
are blocks, that of the configuration (0) weighs `prior_s`.
"""

from collections import deque
from collections.abc import Callable, Iterable
from itertools import pairwise
from math import exp, isfinite, log
from typing import NamedTuple

import numpy as np

from adhesion_can.estimation.noise.block_noise import BlockNoise, Ratio, measure_noise
from adhesion_can.estimation.noise.settings import NoiseSettings
from adhesion_can.physics.samples import Samples
from adhesion_can.sampling.differences import low_quantile
from adhesion_can.values import Stateful

BLOCK_US = 1_000_000
"""Least duration of a block, µs."""
BLOCK_FRAMES = 32
"""Least number of vehicle speeds in a block, up to `LONGEST_US`."""
LONGEST_US = 2_000_000
"""Duration from which a block is complete with fewer, µs."""
MOST_BLOCKS = 600
"""Number of blocks of a recording from which only a part of them is used."""
LONGEST_PAUSE_US = 200_000
"""Pause between samples that ends a block, µs."""


class NoiseFactors(NamedTuple):
    """Factors on the stated variances of samples.

    Attributes:
        private: Factor on `slip_var`.
        common: Factor on `slip_common_var`.
        adhesion: Factor on `adhesion_var`.

    """

    private: float = 1.0
    common: float = 1.0
    adhesion: float = 1.0

    def scale(self, samples: Samples) -> Samples:
        """Samples with their variances times the factors."""
        if self == STATED:
            return samples
        return samples.with_variances(
            self.private * samples.slip_var,
            self.common * samples.slip_common_var,
            self.adhesion * samples.adhesion_var,
        )


STATED = NoiseFactors()
"""Factors that leave the stated variances as they are."""


def combine_blocks(blocks: Iterable[BlockNoise], settings: NoiseSettings) -> NoiseFactors:
    """Factors from blocks of samples.

    Args:
        blocks: Noise of the blocks.
        settings: Weight of the configuration, and limits of the factors.

    """
    all_blocks = list(blocks)

    def factor(part: Callable[[BlockNoise], Ratio]) -> float:
        ratios = np.array([ratio for block in all_blocks if isfinite((ratio := part(block)).value)])
        if not len(ratios):
            return 1.0
        value, freedom = ratios.T
        shown = low_quantile(value, float(freedom.mean())).var
        # A block that lasts longer, where the speed is sent seldom, has no more frames to show.
        seconds = len(ratios) * BLOCK_US * 1e-6
        weight = seconds / (seconds + settings.prior_s)
        believed = exp(weight * log(max(shown, 1e-12)))
        return min(max(believed, settings.smallest**2), settings.largest**2)

    common = factor(lambda block: block.common)
    # Errors that last show less between neighbours than they are: none is taken for small
    # whose changes over a longer time are not.
    slow = min(factor(lambda block: block.common_long), 1.0)
    return NoiseFactors(
        factor(lambda block: block.private), max(common, slow), factor(lambda block: block.adhesion)
    )


class RunningNoise(Stateful):
    """Noise of samples as they come.

    Args:
        settings: Weight of the configuration, memory, and limits of the factors.

    """

    def __init__(self, settings: NoiseSettings) -> None:
        self._settings = settings
        self._blocks: deque[BlockNoise] = deque(maxlen=round(settings.memory_s * 1e6 / BLOCK_US))
        self._pending: list[Samples] = []
        self._begin_us, self._latest_us = 0, 0
        self._frames, self._frame_us = 0, -1
        self.factors = NoiseFactors()
        """Factors by all complete blocks."""

    def add(self, samples: Samples) -> None:
        """Add the samples of an update, in the order of their stamps; may be empty."""
        if not len(samples):
            return
        first_us, last_us = int(samples.t_us[0]), int(samples.t_us[-1])
        if self._pending and not 0 <= first_us - self._latest_us <= LONGEST_PAUSE_US:
            self._pending.clear()
        if not self._pending:
            self._begin_us, self._frames = first_us, 0
        self._pending.append(samples)
        self._latest_us = last_us
        frame_us = int(samples.speed_us[-1])
        self._frames += frame_us != self._frame_us
        self._frame_us = frame_us
        span_us = last_us - self._begin_us
        if span_us >= LONGEST_US or (span_us >= BLOCK_US and self._frames >= BLOCK_FRAMES):
            self._blocks.append(measure_noise(Samples.concatenate(self._pending)))
            self._pending.clear()
            self.factors = combine_blocks(self._blocks, self._settings)


def batch_factors(samples: Samples, settings: NoiseSettings) -> NoiseFactors:
    """Factors from all samples of a recording together.

    Args:
        samples: Samples in the order of their stamps, finite.
        settings: Weight of the configuration, and limits of the factors.

    """
    frame_us = np.diff(np.unique(samples.speed_us))
    frames_us = BLOCK_FRAMES * float(np.median(frame_us)) if len(frame_us) else 0.0
    block_us = min(max(frames_us, BLOCK_US), LONGEST_US)
    number = (samples.t_us - int(samples.t_us[0])) // round(block_us)
    edges = [0, *(np.flatnonzero(np.diff(number)) + 1).tolist(), len(samples)]
    bounds = list(pairwise(edges))
    spread = bounds[:: -(-len(bounds) // MOST_BLOCKS)]
    return combine_blocks(
        (measure_noise(samples.select(slice(a, b))) for a, b in spread if b > a), settings
    )
