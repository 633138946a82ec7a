"""Share of a drive in which the service would doubt a model, computed without its tracker.

Blocks, pooled curve and score tests are those of `DoubtMonitor`. Changes of the surface are given
instead of detected, and nothing is said about the peak: a drive of minutes takes tenths of a second
where the service takes ten.
"""

from bisect import bisect_right
from collections.abc import Iterator, Sequence
from itertools import pairwise

import numpy as np

from adhesion_can.estimation.doubt.blocks import BlockSeries, BlockSums, fit_blocks
from adhesion_can.estimation.doubt.directions import TIME, build_directions
from adhesion_can.estimation.doubt.monitor import FEWEST_SAMPLES
from adhesion_can.estimation.doubt.pooled_curve import PooledCurve
from adhesion_can.estimation.doubt.rows import RowBuilder
from adhesion_can.estimation.doubt.score_tests import FEWEST_BLOCKS, select_directions
from adhesion_can.estimation.doubt.settings import DoubtSettings
from adhesion_can.estimation.noise.noise_factors import RunningNoise
from adhesion_can.estimation.noise.settings import NoiseSettings
from adhesion_can.estimation.tracker.points import is_valid
from adhesion_can.physics.burckhardt import CurveParameters
from adhesion_can.physics.doubt import Doubt
from adhesion_can.physics.samples import Samples

BLOCK_US = 2_000_000
"""Duration of a block, µs."""
LEAST_FALL = 1e-3
"""Least c3 of the start, as a share of c1 c2: a curve without a fall has no peak."""
EVERY = 4
"""Number of blocks from one test to the next."""


def compute_doubt_share(
    samples: Samples,
    start: CurveParameters,
    axles: int,
    slip_max: float,
    *,
    changes_us: Sequence[int] = (),
    doubt: DoubtSettings | None = None,
    noise: NoiseSettings | None = None,
) -> float | None:
    """Share of the tests in which the residual depends on a condition; None without a test.

    Args:
        samples: Samples of a drive in the order of their stamps, without the model's effects.
        start: Parameters (c1, c2, c3) of the curve at which the first block is linearised.
        axles: Number of axles of the vehicle.
        slip_max: Largest slip ratio of a usable sample.
        changes_us: Stamps from which on the surface is another one, µs, ascending.
        doubt: Significance of the tests; None: the defaults.
        noise: Settings of the noise of the samples; None: the defaults.

    """
    settings, directions = doubt or DoubtSettings(), build_directions(axles)
    doubts = list[bool]()
    pooled = pool_blocks(samples, start, axles, slip_max, changes_us=changes_us, noise=noise)
    for number, (series, curve) in enumerate(pooled, start=1):
        if number % EVERY == 0 and len(series) >= FEWEST_BLOCKS:
            selection = select_directions(series.reduced(curve), directions, settings)
            doubts.append(selection.doubt is not Doubt.NONE)
    return sum(doubts) / len(doubts) if doubts else None


def pool_blocks(
    samples: Samples,
    start: CurveParameters,
    axles: int,
    slip_max: float,
    *,
    changes_us: Sequence[int] = (),
    noise: NoiseSettings | None = None,
) -> Iterator[tuple[BlockSeries, PooledCurve]]:
    """Blocks of a drive so far and the curve of its current surface, block by block.

    Args:
        samples: Samples of a drive in the order of their stamps.
        start: Parameters (c1, c2, c3) of the curve at which the first block is linearised.
        axles: Number of axles of the vehicle.
        slip_max: Largest slip ratio of a usable sample.
        changes_us: Stamps from which on the surface is another one, µs, ascending.
        noise: Settings of the noise of the samples; None: the defaults.

    """
    directions = build_directions(axles)
    names = [direction.name for direction in directions]
    rows, series = RowBuilder(directions, axles), BlockSeries(len(names), [names.index(TIME)])
    series.block_s = BLOCK_US * 1e-6
    c1, c2, c3 = start
    theta, noise_std, changes = (c1, c2, max(c3, LEAST_FALL * c1 * c2)), 0.0, 0
    for part in _split_into_blocks(samples, slip_max, noise or NoiseSettings()):
        before, changes = changes, bisect_right(changes_us, int(part.t_us[-1]))
        if changes > before and series.blocks:
            series.end_surface(len(series.blocks), PooledCurve(theta))
            rows.begin_surface()
        noise_std = noise_std or float(np.sqrt(np.median(part.adhesion_var)))
        series.append(BlockSums.from_rows(rows.build(part, theta, noise_std)))
        theta = fit_blocks(series.blocks, theta).theta
        yield series, PooledCurve(theta)


def _split_into_blocks(
    samples: Samples, slip_max: float, settings: NoiseSettings
) -> Iterator[Samples]:
    """Usable samples block by block, with the noise that they have shown so far."""
    if not len(samples):
        return
    noise = RunningNoise(settings)
    block = (samples.t_us - samples.t_us[0]) // BLOCK_US
    edges = [0, *(np.flatnonzero(np.diff(block)) + 1).tolist(), len(samples)]
    for first, end in pairwise(edges):
        part = samples.select(slice(first, end))
        noise.add(part)
        part = noise.factors.scale(part)
        part = part.select(is_valid(part, slip_max))
        if len(part) >= FEWEST_SAMPLES:
            yield part
