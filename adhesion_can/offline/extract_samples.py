"""Recorded frames to samples, without a service: for a batch fit."""

from collections import Counter
from collections.abc import Callable, Iterable
from dataclasses import replace

import numpy as np

from adhesion_can.bus.block import Block, Kind, clamped
from adhesion_can.bus.receiver import Receiver
from adhesion_can.config import Configuration
from adhesion_can.errors import RecordingError
from adhesion_can.physics.samples import Samples
from adhesion_can.sampling.column_former import Readings

UPDATE_US = 20_000


class Extraction:
    """A recording taken through receiver and sample former, as the service takes a bus.

    Args:
        configuration: what is heard.
        on_readings: called with the readings of each block's accepted frames.

    """

    def __init__(
        self, configuration: Configuration, on_readings: Callable[[Readings], None] = lambda _: None
    ) -> None:
        self.receiver = Receiver(configuration.messages)
        self.counts: Counter[str] = Counter()
        """'frames' in all, 'unknown' ids, 'clamped': stamped before the one in front of them."""
        self.first_us: int | None = None
        self.last_us = 0
        self._on_readings = on_readings
        self._former = configuration.make_column_former()
        self._formed: list[Samples] = []

    def run(self, blocks: Iterable[Block]) -> Samples:
        """Samples of all frames, in the order of their stamps; marks are passed over.

        A covariate that was not available at a sample is NaN there.
        """
        for block in blocks:
            frames = block.select(block.kind <= Kind.ERROR)
            if len(frames):
                self._take(frames)
        self._formed.append(self._former.collect_all(np.array([self.last_us + 1]))[0])
        names = sorted(set().union(*(part.covariates for part in self._formed)))
        return Samples.concatenate([_with(part, names) for part in self._formed])

    @property
    def dropped(self) -> dict[str, int]:
        """Wheel-speed readings that gave no sample, by reason."""
        return dict(self._former.dropped)

    def _take(self, frames: Block) -> None:
        stated = frames.t_us
        if self.first_us is None:
            self.first_us = self.last_us = int(stated[0])
        t_us, moved = clamped(stated, self.last_us)
        self.counts["frames"] += len(frames)
        self.counts["clamped"] += int(moved.sum())
        received = self.receiver.accept_block(frames, t_us)
        self.counts["unknown"] += received.foreign
        self._on_readings(received.readings)
        self._former.take(received.readings)
        first, self.last_us = self.last_us, int(t_us[-1])
        begin = first + UPDATE_US - (first - self.first_us) % UPDATE_US
        due = np.arange(begin, self.last_us + 1, UPDATE_US)
        self._formed.append(self._former.collect_all(due)[0])


def _with(samples: Samples, names: Iterable[str]) -> Samples:
    """Samples with covariates of these names, NaN where they have none."""
    missing = np.full(len(samples), np.nan)
    covariates = {name: samples.covariates.get(name, missing) for name in names}
    return replace(samples, covariates=covariates)


def samples_of(
    blocks: Iterable[Block], configuration: Configuration, where: str
) -> tuple[Samples, Receiver]:
    """Samples of a recording, in the order of their stamps, and what was heard.

    Args:
        blocks: frames; marks are passed over.
        configuration: which must give all that adhesion needs.
        where: name of the recording, for errors.

    Raises:
        ConfigError: adhesion cannot be formed from the configured roles.
        RecordingError: no known frame.

    """
    configuration.require_identification()
    extraction = Extraction(configuration)
    samples = extraction.run(blocks)
    require_known(extraction.receiver, extraction.counts["frames"], where)
    return samples, extraction.receiver


def require_known(receiver: Receiver, frames: int, where: str) -> None:
    """Raise a RecordingError where not one frame was accepted."""
    if any(record.accepted for record in receiver.records):
        return
    if receiver.rejected:
        reasons = sum(
            (record.rejected for record in receiver.records),
            start=type(receiver.records[0].rejected)(),
        )
        words = ", ".join(f"{count} by {reason}" for reason, count in reasons.items())
        raise RecordingError(
            where,
            f"every frame of a known id was rejected ({words})",
            "check database and protection; 'adhesion-can check' tells more",
        )
    if not frames:
        raise RecordingError(where, "not one frame in it", "is it one that 'candump -L' recorded?")
    names = ", ".join(
        f"{r.message.plan.name} {r.message.plan.frame_id:#x}" for r in receiver.records[:3]
    )
    raise RecordingError(
        where,
        f"none of its {frames} frames is one that is listened for ({names}, ..)",
        "name your database with --dbc or your roles with --config",
    )
