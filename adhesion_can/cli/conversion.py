"""Frames of recordings on their way into columns, and what became of each."""

from collections import Counter
from collections.abc import Collection, Iterator, Mapping, Sequence
from typing import Any

import numpy as np
from cantools.database.can import Message

from adhesion_can.bus.block import Block
from adhesion_can.bus.database import CanDatabase
from adhesion_can.bus.decoder import Decoder, MessageColumns
from adhesion_can.bus.j1939 import parameter_group, unmarked_sentence
from adhesion_can.cli.signal_filter import SignalFilter
from adhesion_can.errors import RecordingError
from adhesion_can.recordings.problems import (
    LEAST_ACCEPTED,
    describe_problems,
    distinct_names,
    no_frame_error,
)
from adhesion_can.recordings.recording import Recording
from adhesion_can.reporting.export import Writer
from adhesion_can.reporting.export.layout import GroupRows
from adhesion_can.reporting.export.messages import MessageRows, id_text

_SHOWN = 10

_Key = tuple[str, int, bool]
"""Name, id and whether it is extended: two messages may have one name."""


class Conversion:
    """Decodes blocks, passes them to a writer, and counts what became of every frame.

    Args:
        database: Database of the messages.
        chosen: Filter of the signals that are wanted; None: all.
        channel: Name of the bus whose frames are wanted; None: all.
        by_channel: Whether the frames of each bus are kept apart.

    """

    def __init__(
        self,
        database: CanDatabase,
        chosen: SignalFilter | None,
        channel: str | None,
        *,
        by_channel: bool = False,
    ) -> None:
        self._database = database
        self._chosen = chosen
        self._decoder = Decoder(database, chosen)
        self._by_channel = by_channel
        self._rows = MessageRows(database, by_channel=by_channel)
        self._channel = channel
        self._other_channels: Counter[str] = Counter()
        self._received_on: dict[_Key, set[str]] = {}
        self._file = 0
        self._first_ns: int | None = None
        self._last_ns = 0
        self._early_files: list[int] = []

    def process(self, block: Block, file: int, writer: Writer) -> None:
        """Write the next rows of the recordings, of which they are the `file`-th."""
        if not len(block):
            return
        if self._first_ns is None:
            writer.begin(int(block.t_ns[0]))
        rows, frames = self._rows.build(*self._decode(block, file))
        writer.write(rows, frames)

    def decode(self, block: Block, file: int) -> tuple[list[Message], list[GroupRows]]:
        """Messages and rows of a block of the `file`-th recording; the block is counted."""
        decoded, wanted = self._decode(block, file)
        kept = [columns.message for columns in decoded if (columns.outcome == 0).any()]
        return kept, self._rows.build(decoded, wanted)[0]

    def _decode(self, block: Block, file: int) -> tuple[list[MessageColumns], Block]:
        """Columns of the messages of a block, and its frames of the wanted bus."""
        if not len(block):
            return [], block
        if self._first_ns is None:
            self._first_ns = int(block.t_ns[0])
        elif file != self._file and block.t_ns[0] < self._last_ns:
            self._early_files.append(file)
        self._file, self._last_ns = file, int(block.t_ns[-1])
        if self._channel is not None:
            block = self._select_channel(block, self._channel)
        decoded = self._decoder.decode(block)
        for columns in decoded:
            message = columns.message
            key = message.name, message.frame_id, message.is_extended_frame
            self._received_on.setdefault(key, set()).update(block.channels_of(columns.rows))
        return decoded, block

    def _select_channel(self, block: Block, name: str) -> Block:
        for place, other in enumerate(block.channels):
            if other != name:
                self._other_channels[other] += int(np.count_nonzero(block.channel == place))
        place = block.channels.index(name) if name in block.channels else len(block.channels)
        return block.select(block.channel == place)

    def require_decoded(self, recordings: Sequence[Recording]) -> None:
        """Raise a RecordingError where hardly any known frame of the recordings was decoded."""
        report = self._decoder.report
        decoded = sum(count.decoded for count in report.counts.values())
        frames = sum(count.frames for count in report.counts.values())
        if decoded > LEAST_ACCEPTED * frames:
            return
        messages = self._database.db.messages
        ids = [id_text(message.frame_id, message.is_extended_frame) for message in messages]
        known = ", ".join(sorted(ids)[:_SHOWN])
        database = f"{self._database.path.name} has {len(messages)}: {known}"
        if report.counts:
            reasons: Counter[str] = Counter()
            for count in report.counts.values():
                reasons.update(count.rejected)
            which = f"{frames - decoded} of {frames} frames of known ids are rejected"
            what = f"{which} ({counts_text(reasons)}); {self._unknown_ids()}{database}"
            fix = "name the database of this bus, in the right version, with --dbc"
        elif self._other_channels and not report.frames:
            what = (
                f"no frame of channel {self._channel}; it has {counts_text(self._other_channels)}"
            )
            fix = "name one of these with --channel"
        elif report.passed_over:
            what = "no frame with a selected signal that can be decoded; it has "
            what += counts_text(report.passed_over)
            why = list(self._undecodable(report.passed_over, self._chosen))
            what += "".join(f"; {line}" for line in why[:_SHOWN])
            fix = "name other signals of these messages with --signals"
        elif not report.unknown:
            raise no_frame_error(recordings, "it has no data frames")
        else:
            what = f"no frame of a known id; {self._unknown_ids()}{database}"
            fix = self._sender_hint() or "name the database of this bus with --dbc"
        raise RecordingError(", ".join(str(recording.path) for recording in recordings), what, fix)

    def _unknown_ids(self) -> str:
        """Clause on the ids that the database does not have; '' where there are none."""
        ids = {id_text(*key): count for key, count in self._decoder.report.unknown.items()}
        return f"it has {counts_text(ids)}; " if ids else ""

    def _sender_hint(self) -> str | None:
        """Sentence about a message that another sender sends; None where no group is known."""
        unknown = self._decoder.report.unknown
        heard = {parameter_group(number): number for number, extended in unknown if extended}
        for message in self._database.db.messages:
            number = message.frame_id
            if message.is_extended_frame and parameter_group(number) in heard:
                return unmarked_sentence(message.name, number, heard[parameter_group(number)])
        return None

    def to_dict(self, recordings: Sequence[Recording]) -> dict[str, Any]:
        """What became of every frame and line."""
        report = self._decoder.report
        lines: Counter[str] = Counter()
        for recording in recordings:
            lines.update(recording.report.kinds)
        unknown = sorted(report.unknown.items(), key=lambda item: (-item[1], item[0]))
        return {
            "frames": report.frames,
            "decoded": sum(count.decoded for count in report.counts.values()),
            "from_s": None if self._first_ns is None else self._first_ns / 1e9,
            "to_s": None if self._first_ns is None else self._last_ns / 1e9,
            "messages": [
                {
                    "name": name,
                    "id": number,
                    "extended": extended,
                    "frames": count.frames,
                    "decoded": count.decoded,
                    "rejected": dict(count.rejected),
                    "lost": count.lost,
                }
                for (name, number, extended), count in report.counts.items()
            ],
            "unknown": [
                {
                    "id": number,
                    "extended": extended,
                    "frames": count,
                    "name": self._decoder.name_of(number, is_extended=extended),
                }
                for (number, extended), count in unknown
            ],
            "unknown_beyond": report.unknown_beyond,
            "not_wanted": dict(report.passed_over),
            "other_channels": dict(self._other_channels),
            "remote": report.remote,
            "error": report.error,
            "marks": report.marks,
            "lines": dict(lines),
            "problems": [
                *describe_problems(recordings, "stamps kept unchanged"),
                *self._problems(distinct_names([recording.path for recording in recordings])),
            ],
        }

    def _problems(self, files: Sequence[str]) -> Iterator[str]:
        for file in self._early_files:
            begins = "starts before the previous file ends; its stamps are kept"
            yield f"{files[file]}: {begins}"
        several = {
            name: channels
            for (name, *_), channels in self._received_on.items()
            if len(channels) > 1
        }
        if several and not self._by_channel:
            names = ", ".join(list(several)[:_SHOWN])
            buses = ", ".join(sorted(set().union(*several.values())))
            yield (
                f"received on several channels ({buses}) and mixed: {names}; --channel selects one"
            )
        yield from self._undecodable({name for name, _, _ in self._received_on})

    def _undecodable(
        self, messages: Collection[str], chosen: SignalFilter | None = None
    ) -> Iterator[str]:
        """Sentences about what of these messages can never be decoded; None: chosen or not."""
        for name, reason in self._decoder.report.undecodable.items():
            message, _, signal = name.partition(".")
            if message in messages and (not (signal and chosen) or chosen(message, signal)):
                yield f"{name}: cannot be decoded: {reason}"


def counts_text(counts: Mapping[str, int]) -> str:
    """'a 12, b 3, ..', the most frequent first."""
    most = Counter(counts).most_common(_SHOWN)
    more = ["..", f"{len(counts)} in total"] if len(counts) > _SHOWN else []
    return ", ".join([*(f"{name}: {count}" for name, count in most), *more])
