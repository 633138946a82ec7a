"""Whether a recording is one of the configured bus: the ids that are needed and those it has."""

from collections.abc import Collection, Iterable, Iterator, Sequence
from typing import NamedTuple

from adhesion_can.bus.block import EXTENDED, Block
from adhesion_can.bus.message_record import MessageRecord
from adhesion_can.bus.receiver import Receiver
from adhesion_can.config import Configuration
from adhesion_can.errors import RecordingError
from adhesion_can.physics.readings import REQUIRED, Role
from adhesion_can.recordings.problems import LEAST_ACCEPTED, NO_FRAME_FIX

LOOKED_AT = 200_000
"""Number of frames whose ids are collected; every cyclic message comes sooner."""
_SHOWN = 8


class SeenIds:
    """Ids of the first frames of a recording."""

    def __init__(self) -> None:
        self.keys: set[int] = set()
        """Ids as `Block.key` has them."""
        self._left = LOOKED_AT

    def watch(self, blocks: Iterable[Block]) -> Iterator[Block]:
        """Pass blocks on, and collect their ids."""
        for block in blocks:
            self.add(block)
            yield block

    def add(self, block: Block) -> None:
        """Collect the ids of a block."""
        if self._left > 0:
            self.keys.update(block.key[block.is_data][: self._left].tolist())
            self._left -= len(block)

    def has(self, record: MessageRecord) -> bool:
        """Whether a frame of a message was among them, on any channel."""
        return _key(record) in self.keys

    def describe(self) -> str:
        """'0x101, 0x102, ..', those of 11 bits first."""
        return _listed([_id(key) for key in sorted(self.keys)])


class BusMisfit(NamedTuple):
    """What a recording lacks of the configured bus.

    Attributes:
        what: Messages that are missing, and the ids that the recording has instead; a clause.
        fix: What to do; a clause.
        of_other_bus: Whether more than half of the needed messages are missing and there are
            others: the database is that of another bus.

    """

    what: str
    fix: str
    of_other_bus: bool


def find_misfit(
    receiver: Receiver,
    seen: SeenIds,
    configuration: Configuration,
    *,
    samples: int | None = None,
    needed: Collection[Role] = REQUIRED,
) -> BusMisfit | None:
    """What a recording lacks of the configured bus; None where it does not lack anything needed.

    Args:
        receiver: Receiver of the frames, after the last one.
        seen: Ids of the recording.
        configuration: Roles and database of the receiver.
        samples: Number of samples that were formed; None where none were asked for. With a sample
            nothing is missing; without one every needed message is.
        needed: Roles that are needed where no samples were asked for.

    """
    if samples:
        return None
    records = [r for r in receiver.records if r.message.roles & set(needed)]
    missing = [r for r in records if not _is_heard(r)]
    if samples is None:
        heard = {role for r in records if _is_heard(r) for role in r.message.roles}
        missing = [r for r in missing if r.message.roles & set(needed) - heard]
    else:
        # A replayed part may be too short for a message that the recording has.
        missing = [r for r in missing if r.frames or r.wrong_channel or not seen.has(r)]
    if not missing:
        return None
    configured = {_key(record) for record in receiver.records}
    of_other_bus = 2 * len(missing) > len(records) and bool(seen.keys - configured)
    absent = [r for r in missing if not r.frames and r.wrong_channel is None]
    parts = [_failure(r) for r in missing if r not in absent]
    if absent:
        be = "is" if len(absent) == 1 else "are"
        names = _listed([_name(record) for record in absent])
        parts.insert(0, f"{len(absent)} of {len(records)} needed messages {be} missing ({names})")
    bus = configuration.database.path.name
    head = f"the recording does not fit {bus}: " if of_other_bus else ""
    what = f"{head}{', '.join(parts)}; the recording has {seen.describe()}"
    return BusMisfit(what, _fix(configuration, missing, of_other_bus=of_other_bus), of_other_bus)


def require_fit(
    receiver: Receiver,
    frames: int,
    seen: SeenIds,
    configuration: Configuration,
    where: str,
    *,
    samples: int | None = None,
    needed: Collection[Role] = REQUIRED,
    partly: bool = False,
) -> None:
    """Raise a RecordingError where a recording is not one of the configured bus.

    Args:
        receiver: Receiver of the frames, after the last one.
        frames: Number of frames of the recording.
        seen: Ids of the recording.
        configuration: Roles and database of the receiver.
        where: Name of the recording, for the error.
        samples: As for `find_misfit`.
        needed: As for `find_misfit`.
        partly: Whether a recording of this bus may lack some of the needed messages.

    """
    require_accepted(receiver, frames, seen, configuration, where)
    misfit = find_misfit(receiver, seen, configuration, samples=samples, needed=needed)
    if misfit is not None and not (partly and not misfit.of_other_bus):
        raise RecordingError(where, misfit.what, misfit.fix)


def require_accepted(
    receiver: Receiver, frames: int, seen: SeenIds, configuration: Configuration, where: str
) -> None:
    """Raise a RecordingError where no frame was accepted; arguments as for `require_fit`."""
    if any(record.accepted for record in receiver.records):
        return
    _require_frames(receiver, frames, where)
    misfit = find_misfit(receiver, seen, configuration, samples=0)
    if misfit is not None:
        raise RecordingError(where, misfit.what, misfit.fix)
    names = _listed([_name(record) for record in receiver.records])
    raise RecordingError(
        where,
        f"no frame of a configured id ({names}) is accepted; the recording has {seen.describe()}",
        _fix(configuration, receiver.records, of_other_bus=True),
    )


def _require_frames(receiver: Receiver, frames: int, where: str) -> None:
    """Raise a RecordingError where the reason is not the database."""
    if not frames:
        raise RecordingError(where, "it has no frames", NO_FRAME_FIX)
    if receiver.rejected:
        return
    if receiver.unmarked:
        what, _, fix = receiver.unmarked[0].partition("; ")
        raise RecordingError(where, f"no frame of a known id; {what}", fix)
    for record in receiver.records:
        if record.wrong_channel is not None:
            what, fix = record.wrong_channel
            raise RecordingError(where, f"{_name(record)}: {what}", fix)


def _is_heard(record: MessageRecord) -> bool:
    return record.accepted > LEAST_ACCEPTED * record.frames


def _failure(record: MessageRecord) -> str:
    """Clause on a message whose frames fail their checks, or are on another channel."""
    if record.wrong_channel is not None:
        return f"{_name(record)}: {record.wrong_channel[0]}"
    count = sum(record.rejected.values())
    reasons = ", ".join(str(reason) for reason in record.rejected)
    return f"{_name(record)} fails its checks ({count} of {record.frames} frames: {reasons})"


def _fix(
    configuration: Configuration, missing: Sequence[MessageRecord], *, of_other_bus: bool
) -> str:
    for record in missing:
        if record.wrong_channel is not None:
            return record.wrong_channel[1]
    is_own = configuration.where != "defaults"
    if of_other_bus and is_own:
        return f"check database and [roles] in {configuration.where}, or name another with --config"
    if of_other_bus:
        return (
            "pass this vehicle's configuration with --config F ('adhesion-can init --dbc YOUR.dbc "
            "--out F' writes it)"
        )
    if is_own:
        return f"record these messages, or correct [roles] in {configuration.where}"
    return "record these messages, or pass this vehicle's roles with --config F"


def _key(record: MessageRecord) -> int:
    plan = record.message.plan
    return plan.frame_id | EXTENDED if plan.is_extended else plan.frame_id


def _name(record: MessageRecord) -> str:
    return f"{record.message.plan.name} {_id(_key(record))}"


def _id(key: int) -> str:
    """An id as candump writes it, with 0x."""
    return f"0x{key & ~EXTENDED:08X}" if key & EXTENDED else f"0x{key:03X}"


def _listed(names: Sequence[str]) -> str:
    """'a, b, ..': the first of many names, and how many more there are."""
    further = len(names) - _SHOWN
    shown = ", ".join(names[:_SHOWN])
    return f"{shown} and {further} more" if further > 0 else shown or "none"
