"""Step 1, split hold-out: rows that decide, and rows on which the gain alone is measured.

Whole recordings are held out where there are several of like length; of a single drive every third
pair of blocks, of a long and a short one every third and every second block.
Blocks are spans of time, since rows of the same moment share their errors. All independent points
decide: each of them is held out in turn later.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from adhesion_can.diagnosis.drive.drive_data import DriveData
from adhesion_can.diagnosis.inference.insufficient_data import LEAST_ROWS
from adhesion_can.diagnosis.regression.gram_matrices import number_blocks

SHORT = 0.75
"""Driven time of a drive over that of the longest one below which it is not held out whole: it says
little of the others, and may have been made to decide between rivals."""
SHORT_EVERY = 2
"""Of such a drive every second block is held out: it has few, and a gain needs some."""
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
        long, _ = split_by_length(drives)
        able = sorted((drive for drive in long if len(drive) >= LEAST_ROWS), key=len)
        count = max(len(drives) // HELD_EVERY, 1)
        chosen = able[:count] if len(able) > count else []
    return [any(drive is held_out for held_out in chosen) for drive in drives]


def split_by_length(drives: Sequence[DriveData]) -> tuple[list[DriveData], list[DriveData]]:
    """Drives of like length, and those that are much shorter than the longest."""
    pairs = list(zip(drives, _are_short(drives), strict=True))
    long, short = (
        [drive for drive, is_short in pairs if is_short is wanted] for wanted in (False, True)
    )
    return long, short


def _are_short(drives: Sequence[DriveData]) -> list[bool]:
    """Whether each drive is much shorter than the longest, by its time.

    Points that stand alone have no time between them: where there are some, rows count.
    """
    lengths = [drive.driven_s for drive in drives]
    if not all(lengths):
        lengths = [float(len(drive)) for drive in drives]
    least = SHORT * max(lengths, default=0.0)
    return [length < least for length in lengths]


def held_blocks(drives: int) -> int:
    """Number of blocks that are held out together, where no drive is held out whole.

    Of several drives each one gives some of them, and the short ones have few.

    Args:
        drives: Number of drives.

    """
    return HELD_BLOCKS if drives == 1 else 1


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
    out = []
    numbers = number_blocks_of_drives(drives, block_length_s)
    width = held_blocks(len(drives))
    parts = zip(drives, held_out, numbers, _are_short(drives), strict=True)
    for drive, whole, number, is_short in parts:
        every = SHORT_EVERY if is_short else HELD_EVERY
        held = np.full(len(number), whole)
        if not any(held_out) and not drive.independent and len(number):
            held = ((number - number.min()) // width) % every == 1
        out.append(np.where(held, -1 - number, number))
    return np.concatenate(out) if out else np.empty(0, dtype=np.int64)


def number_blocks_of_drives(
    drives: Sequence[DriveData], block_length_s: float
) -> list[NDArray[np.int64]]:
    """Block number of each row of each drive, from 0 on over all drives; pauses are no blocks.

    Args:
        drives: All drives.
        block_length_s: Length of a block, s.

    """
    out, base = [], 0
    for drive in drives:
        number = np.unique(number_blocks(drive.t_s, block_length_s), return_inverse=True)[1] + base
        base = int(number.max(initial=base - 1)) + 1
        out.append(number)
    return out
