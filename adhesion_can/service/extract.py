"""Recorded frames to samples, without a service: for a batch fit."""

from collections import Counter
from collections.abc import Callable, Iterable

from adhesion_can.bus.e2e import Rejection
from adhesion_can.bus.frame import Frame, Mark
from adhesion_can.bus.receiver import Receiver
from adhesion_can.config import Configuration
from adhesion_can.errors import RecordingError
from adhesion_can.identification.samples import columns_of
from adhesion_can.physics.data import Reading, Sample, Samples

UPDATE_US = 20_000


class Extraction:
    """A recording taken through receiver and sample former, as the service takes a bus.

    Args:
        configuration: what is heard.
        on_reading: called with each reading of an accepted frame.

    """

    def __init__(
        self, configuration: Configuration, on_reading: Callable[[Reading], None] = lambda _: None
    ) -> None:
        self.receiver = Receiver(configuration.messages)
        self.counts: Counter[str] = Counter()
        """'frames' in all, 'unknown' ids, 'clamped': stamped before the one in front of them."""
        self.first_us: int | None = None
        self.last_us = 0
        self._on_reading = on_reading
        self._former = configuration.make_former()
        self._formed: list[Sample] = []
        self._collected_us = 0

    def run(self, items: Iterable[Frame | Mark]) -> Samples:
        """Samples of all frames, in the order of their stamps; marks are passed over.

        A covariate that was not available at a sample is NaN there.
        """
        for item in items:
            if isinstance(item, Frame):
                self._take(item)
        self._formed += self._former.collect(self.last_us)
        return columns_of(self._formed)

    @property
    def dropped(self) -> dict[str, int]:
        """Wheel-speed readings that gave no sample, by reason."""
        return dict(self._former.dropped)

    def _take(self, frame: Frame) -> None:
        self.counts["frames"] += 1
        if self.first_us is None:
            self.first_us = self.last_us = frame.t_us
        self.counts["clamped"] += frame.t_us < self.last_us
        self.last_us = max(self.last_us, frame.t_us)
        outcome = self.receiver.accept(frame._replace(t_us=self.last_us))
        if outcome is None:
            self.counts["unknown"] += 1
        elif not isinstance(outcome, Rejection):
            for reading in outcome:
                self._on_reading(reading)
                self._former.add(reading)
        if self.last_us - self._collected_us >= UPDATE_US:
            self._formed += self._former.collect(self.last_us)
            self._collected_us = self.last_us


def samples_of(
    items: Iterable[Frame | Mark], configuration: Configuration, where: str
) -> tuple[Samples, Receiver]:
    """Samples of a recording, in the order of their stamps, and what was heard.

    Args:
        items: frames; marks are passed over.
        configuration: which must give all that adhesion needs.
        where: name of the recording, for errors.

    Raises:
        ConfigError: adhesion cannot be formed from the configured roles.
        RecordingError: no known frame.

    """
    configuration.require_identification()
    extraction = Extraction(configuration)
    samples = extraction.run(items)
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
    names = ", ".join(
        f"{r.message.plan.name} {r.message.plan.frame_id:#x}" for r in receiver.records[:3]
    )
    raise RecordingError(
        where,
        f"none of its {frames} frames is one that is listened for ({names}, ..)",
        "name your database with --dbc or your roles with --config",
    )
