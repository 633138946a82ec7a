"""Errors of the vehicle speed that last for some seconds and change then, block by block.

The mean over a time T of errors that are alike for τ has the variance σ² 2τ/T. So where a block is
shorter than they last, its error counts as that much more, and the sum of many blocks is right.
"""

from collections import deque

from adhesion_can.estimation.doubt.blocks import BlockError
from adhesion_can.estimation.doubt.rows import Rows
from adhesion_can.values import Stateful

LASTING_S = 5.0
"""Time τ for which errors are alike, s."""
RECENT = 40
"""Number of blocks that the inflation is taken from."""


class SpeedWander(Stateful):
    """What an error of the vehicle speed does to the blocks of a drive.

    Args:
        place: Index of the column of the speed's scale in the rows.
        std: Relative standard deviation σ of the error, 1; 0: none.

    """

    def __init__(self, place: int, std: float) -> None:
        self._place, self._variance = place, std**2
        self._squares: deque[tuple[float, float]] = deque(maxlen=RECENT)
        """Expected squares of the level's score by noise and by this error, of each block."""

    def add_block(self, rows: Rows, block_s: float) -> BlockError | None:
        """Error that all rows of the next block share; None where the speed does not wander.

        Args:
            rows: Rows of the block.
            block_s: Its duration, s.

        """
        if not self._variance > 0.0:
            return None
        longer = max(2.0 * LASTING_S / block_s, 1.0)
        error = BlockError(self._place, self._variance * longer)
        self._squares.append((rows.level_noise, error.level_square(rows)))
        return error

    @property
    def acts(self) -> bool:
        """Whether there was a block with such an error."""
        return bool(self._squares)

    @property
    def inflation(self) -> float:
        """Variance of the curve's level over that by noise alone; 1 without such an error."""
        noise = sum(noise for noise, _ in self._squares)
        # Wheels that do not slip at all tell nothing of the level, with or without the error.
        if not noise > 0.0:
            return 1.0
        return 1.0 + sum(wander for _, wander in self._squares) / noise
