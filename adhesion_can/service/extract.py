"""Recorded frames to samples, without a service: for a batch fit."""

from collections.abc import Iterable

from adhesion_can.bus.e2e import Rejection
from adhesion_can.bus.frame import Frame, Mark
from adhesion_can.bus.receiver import Receiver
from adhesion_can.bus.roles import cycles_of
from adhesion_can.config import Configuration
from adhesion_can.errors import RecordingError
from adhesion_can.identification.samples import SampleFormer
from adhesion_can.physics.data import Sample, Samples

UPDATE_US = 20_000


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
    receiver = Receiver(configuration.messages)
    former = SampleFormer(
        configuration.vehicle,
        cycles_of(configuration.messages),
        configuration.sampling,
        configuration.sensors,
    )
    formed: list[Sample] = []
    now = collected = total = 0
    for frame in items:
        if isinstance(frame, Mark):
            continue
        total += 1
        now = max(now, frame.t_us)
        outcome = receiver.accept(frame._replace(t_us=now))
        if outcome is None or isinstance(outcome, Rejection):
            continue
        for reading in outcome:
            former.add(reading)
        if now - collected >= UPDATE_US:
            formed += former.collect(now)
            collected = now
    formed += former.collect(now)
    require_known(receiver, total, where)
    return Samples.of(formed), receiver


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
