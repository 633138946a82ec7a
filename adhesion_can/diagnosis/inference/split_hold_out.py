"""Step 1, split hold-out: rows that decide, and rows on which the gain alone is measured.

Whole recordings are held out where there are several; of a single drive every third pair of blocks.
Blocks are spans of time, since rows of the same moment share their errors. All independent points
decide: each of them is held out in turn later.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from adhesion_can.diagnosis.drive.drive_data import DriveData
from adhesion_can.diagnosis.inference.candidates import LEAST_ROWS
from adhesion_can.diagnosis.regression.gram_matrices import number_blocks

HELD_EVERY, HELD_BLOCKS = 3, 2
"""Of a single drive every third group of two blocks is held out; of several drives a third."""


def choose_held_out_drives(drives: Sequence[DriveData], given: Sequence[DriveData]) -> list[bool]:
    """Whether each drive is held out whole; a single drive never is.

    Args:
        drives: All drives.
        given: Drives among them that the user holds out; none: a third of them is chosen.

    """
    chosen = list(given)
    if not given and len(drives) > 1:
        # The shortest that are long enough, so that most of the data decide.
        able = sorted((drive for drive in drives if len(drive) >= LEAST_ROWS), key=len)
        count = max(len(drives) // HELD_EVERY, 1)
        chosen = able[:count] if len(able) > count else []
    return [any(drive is one for one in chosen) for drive in drives]


def split_hold_out(
    drives: Sequence[DriveData], held_out: Sequence[bool], block_length_s: float
) -> NDArray[np.int64]:
    """Number the blocks of all drives, and mark those that are held out.

    Args:
        drives: All drives.
        held_out: Whether each drive is held out whole; where none is, blocks of every drive are.
        block_length_s: Length of a block, s.

    Returns:
        Block number of each row of all drives, −1 − number in rows that are held out; shape (n,).

    """
    out, base = [], 0
    for drive, whole in zip(drives, held_out, strict=True):
        # Consecutive numbers: pauses are no blocks.
        number = np.unique(number_blocks(drive.t_s, block_length_s), return_inverse=True)[1]
        held = np.full(len(number), whole)
        if not any(held_out) and not drive.independent:
            held = (number // HELD_BLOCKS) % HELD_EVERY == 1
        number = number + base
        base = int(number.max(initial=base - 1)) + 1
        out.append(np.where(held, -1 - number, number))
    return np.concatenate(out) if out else np.empty(0, dtype=np.int64)
