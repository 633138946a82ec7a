"""Stamps in another unit than seconds: all cycles are too long by the same power of ten."""

from collections.abc import Iterable, Iterator, Mapping, Sequence

import numpy as np

from adhesion_can.bus.block import EXTENDED, Block
from adhesion_can.bus.roles import BoundMessage
from adhesion_can.errors import RecordingError

LEAST_FRAMES = 20
"""Frames of a message without which its cycle says nothing."""
TOLERANCE = 0.3
"""Relative distance to a power of ten within which the cycles of all messages must be."""
_UNITS: Mapping[float, str] = {
    1e3: "in ms",
    1e6: "in us",
    1e9: "in ns",
    1e-3: "a thousandth of the time in seconds",
    1e-6: "a millionth of the time in seconds",
}


def in_seconds(
    blocks: Iterable[Block], messages: Sequence[BoundMessage], where: str
) -> Iterator[Block]:
    """The blocks of a recording, whose first one is looked at before any work is done on it.

    Args:
        blocks: Frames of a recording.
        messages: Messages that are listened for.
        where: Name of the recording, for errors.

    Raises:
        RecordingError: Every message comes the same power of ten too slow or too fast.

    """
    is_first = True
    for block in blocks:
        if is_first:
            _require_seconds(block, messages, where)
        is_first = False
        yield block


def _require_seconds(block: Block, messages: Sequence[BoundMessage], where: str) -> None:
    ratios, example = [], ""
    for message in messages:
        plan = message.plan
        key = plan.frame_id | EXTENDED if plan.is_extended else plan.frame_id
        t_us = block.t_us[block.is_data & (block.key == key)]
        if not message.cycle_us or len(t_us) < LEAST_FRAMES:
            continue
        cycle_us = float(np.median(np.diff(t_us)))
        ratios.append(cycle_us / message.cycle_us)
        example = example or (
            f"{plan.name} arrives every {cycle_us / 1e3:.10g} ms; its cycle is "
            f"{message.cycle_us / 1e3:g} ms"
        )
    for factor, unit in _UNITS.items():
        if ratios and np.all(np.abs(np.array(ratios) / factor - 1.0) < TOLERANCE):
            raise RecordingError(
                where,
                f"its stamps seem to be {unit} ({example})",
                "write them in seconds, or correct cycle_ms in the file of --config",
            )
