"""Samples of a recording, formed as the service forms them: for a batch fit."""

from collections import Counter
from collections.abc import Callable, Iterable
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from adhesion_can.bus.block import Block, Kind, clamped
from adhesion_can.bus.receiver import Receiver
from adhesion_can.bus.receiver_columns import ReceivedBlock
from adhesion_can.config import Configuration
from adhesion_can.offline.recording_fit import SeenIds, require_fit
from adhesion_can.offline.stamps import in_seconds
from adhesion_can.physics.samples import Samples
from adhesion_can.sampling.column_former import Readings

UPDATE_US = 20_000
"""Time between two collections of samples, µs: the cycle of the setpoints."""


class Hole(NamedTuple):
    """Time in which a recording has no frame.

    Attributes:
        from_us: Stamp of the last frame before it, µs.
        length_us: Time to the next frame, µs.

    """

    from_us: int
    length_us: int


class SampleExtractor:
    """Passes a recording through receiver and sample former, as the service does with a bus.

    Args:
        configuration: Messages, roles, vehicle and settings of the sampling.
        on_readings: Callback with the readings of each block's accepted frames.
        on_received: Callback with the stamps of each block's frames, µs, and what became of them.

    """

    def __init__(
        self,
        configuration: Configuration,
        on_readings: Callable[[Readings], None] = lambda _: None,
        on_received: Callable[[NDArray[np.int64], ReceivedBlock], None] = lambda _, __: None,
    ) -> None:
        self.receiver = Receiver(configuration.messages)
        self.seen = SeenIds()
        self.counts: Counter[str] = Counter()
        """Numbers of frames: 'frames' in all, 'unknown' ids, 'clamped' to the stamp before."""
        self.first_us: int | None = None
        self.last_us = 0
        self.hole = Hole(0, 0)
        """Longest time without any frame."""
        self.holes = 0
        """Number of times without any frame beyond which the service starts again."""
        self._restart_us = configuration.service.restart_s * 1e6
        self._on_readings = on_readings
        self._on_received = on_received
        self._former = configuration.make_column_former()
        self._patience_us = self._former.give_up_us + 2 * UPDATE_US
        self._formed: list[Samples] = []

    def run(self, blocks: Iterable[Block]) -> Samples:
        """Samples of all frames, in the order of their stamps; marks are ignored.

        A covariate that was not available at a sample is NaN there.
        """
        for block in blocks:
            frames = block.select(block.kind <= Kind.ERROR)
            if len(frames):
                self._add(frames)
        self._formed.append(self._former.collect_all(np.array([self.last_us + 1]))[0])
        names = sorted(set().union(*(part.covariates for part in self._formed)))
        return Samples.concatenate([_with_covariates(part, names) for part in self._formed])

    @property
    def dropped(self) -> dict[str, int]:
        """Number of wheel-speed readings that gave no sample, by reason."""
        return dict(self._former.dropped)

    def _add(self, frames: Block) -> None:
        recorded_us = frames.t_us
        if self.first_us is None:
            self.first_us = self.last_us = int(recorded_us[0])
        t_us, moved = clamped(recorded_us, self.last_us)
        self.seen.add(frames)
        self.counts["frames"] += len(frames)
        self.counts["clamped"] += int(moved.sum())
        received = self.receiver.accept_block(frames, t_us)
        self.counts["unknown"] += received.foreign
        self._on_readings(received.readings)
        self._on_received(t_us, received)
        self._former.add(received.readings)
        due = self._due_times(t_us, self.first_us)
        self.last_us = int(t_us[-1])
        self._formed.append(self._former.collect_all(due)[0])

    def _due_times(self, t_us: NDArray[np.int64], origin_us: int) -> NDArray[np.int64]:
        """Times of collecting up to the last frame of a block, µs.

        In a hole of the recording none is needed once every wheel speed before it is given up: the
        times take as much memory as the frames do, however long nothing was sent.

        Args:
            t_us: Stamps of the frames, not descending, shape (n,).
            origin_us: Stamp of the recording's first frame, µs.

        """
        at_us = np.concatenate([[self.last_us], t_us])
        length_us = np.diff(at_us)
        after = np.flatnonzero(length_us > self._patience_us)
        begins, ends = np.append(at_us[0], at_us[after + 1]), np.append(at_us[after], at_us[-1])
        self.holes += int(np.count_nonzero(length_us > self._restart_us))
        hole = int(np.argmax(length_us))
        if length_us[hole] > self.hole.length_us:
            self.hole = Hole(int(at_us[hole]), int(length_us[hole]))
        ends[:-1] += self._patience_us
        return np.concatenate(
            [
                np.arange(begin + UPDATE_US - (begin - origin_us) % UPDATE_US, end + 1, UPDATE_US)
                for begin, end in zip(begins.tolist(), ends.tolist(), strict=True)
            ]
        )


def _with_covariates(samples: Samples, names: Iterable[str]) -> Samples:
    """Samples with covariates of exactly these names; missing ones are NaN."""
    missing = np.full(len(samples), np.nan)
    covariates = {name: samples.covariates.get(name, missing) for name in names}
    return replace(samples, covariates=covariates)


def extract_samples(
    blocks: Iterable[Block], configuration: Configuration, where: str
) -> tuple[Samples, Receiver]:
    """Samples of a recording, in the order of their stamps, and the receiver of its frames.

    Args:
        blocks: Frames of the recording; marks are ignored.
        configuration: Messages, roles, vehicle and settings of the sampling.
        where: Name of the recording, for errors.

    Raises:
        ConfigError: The configured roles do not suffice to compute adhesion.
        RecordingError: The recording is not one of the configured bus.

    """
    configuration.require_identification()
    extractor = SampleExtractor(configuration)
    samples = extractor.run(in_seconds(blocks, configuration.messages, where))
    receiver, frames = extractor.receiver, extractor.counts["frames"]
    require_fit(receiver, frames, extractor.seen, configuration, where, samples=len(samples))
    return samples, receiver
