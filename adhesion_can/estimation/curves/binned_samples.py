"""Samples of a surface in bins of slip and speed: sums that are additive over time.

Any curve family can be fitted to the bins at any time, without the samples. A steep curve bends
within a bin: the slips' scatter there is kept, too.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from adhesion_can.arrays import Array
from adhesion_can.physics.samples import Samples
from adhesion_can.values import Value

SLIP_EDGES: Array = np.geomspace(5e-4, 0.5, 41)
"""Edges of the slip bins, 19 % apart; smaller slips are in one bin, larger ones in another."""
SPEED_STEP = 3.0
"""Width of the speed bins, m/s."""
SPEEDS = 40
"""Number of speed bins; the last one includes higher speeds."""
SLIPS = len(SLIP_EDGES) + 1
COUNT, SLIP, ADHESION, SPEED, LOAD, SLIP_VAR, ADHESION_VAR, SLIP_SQUARE = range(8)
"""Rows of the sums."""


@dataclass(frozen=True, slots=True)
class BinnedSamples(Value):
    """Sums of samples by bins.

    All samples of a bin count alike: weights that depend on their adhesion would shift its means.

    Attributes:
        place: Numbers of the bins that hold samples, ascending, shape (n,).
        sums: Number of samples, then the sums of slip, adhesion, speed, load, variance of the slip,
            variance of the adhesion at a known slip, and square of the slip; shape (8, n).

    """

    place: NDArray[np.int64]
    sums: Array

    @classmethod
    def from_samples(cls, samples: Samples, noise_std: float) -> "BinnedSamples":
        """Sums of samples, with the sign of the slip taken off slip and adhesion.

        Args:
            samples: Samples, finite.
            noise_std: Standard deviation of the adhesion noise.

        """
        size = np.abs(samples.slip)
        faster = np.clip((samples.speed / SPEED_STEP).astype(np.int64), 0, SPEEDS - 1)
        bins = (np.digitize(size, SLIP_EDGES) * SPEEDS + faster).astype(np.int64)
        place, member = np.unique(bins, return_inverse=True)
        columns = (
            np.ones(len(size)),
            size,
            np.copysign(1.0, samples.slip) * samples.adhesion,
            samples.speed,
            samples.load,
            samples.slip_total_var,
            noise_std * noise_std + samples.transient_var,
            size * size,
        )
        sums = [np.bincount(member, column, len(place)) for column in columns]
        return cls(place, np.asarray(sums, dtype=np.float64).reshape(len(columns), -1))


EMPTY = BinnedSamples(np.empty(0, dtype=np.int64), np.empty((SLIP_SQUARE + 1, 0)))
"""No samples."""


def join_binned(parts: Sequence[BinnedSamples]) -> BinnedSamples:
    """Several as one."""
    place, member = np.unique(np.concatenate([part.place for part in parts]), return_inverse=True)
    both = np.concatenate([part.sums for part in parts], axis=1)
    sums = np.stack([np.bincount(member, values, len(place)) for values in both])
    # np.bincount of nothing counts as integers.
    return BinnedSamples(place, np.asarray(sums, dtype=np.float64))
