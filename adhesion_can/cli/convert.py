"""`convert`: any recording with any database to columns."""

import argparse
from collections import Counter
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from fnmatch import fnmatchcase
from pathlib import Path
from typing import Any

import numpy as np
from cantools.database.can import Message
from rich import filesize

from adhesion_can.bus.block import Block
from adhesion_can.bus.database import CanDatabase, load_database
from adhesion_can.bus.decoder import Decoder
from adhesion_can.bus.j1939 import parameter_group, unmarked_sentence
from adhesion_can.cli.common import (
    add_json,
    add_lenient,
    require_outputs,
    talk,
    tell_left_out,
    write_json,
)
from adhesion_can.cli.reading import reading
from adhesion_can.config import Configuration
from adhesion_can.errors import InputError, RecordingError, suggest
from adhesion_can.physics.vehicle import Locomotive
from adhesion_can.recordings.problems import describe_problems, distinct_names
from adhesion_can.recordings.recording import Recording
from adhesion_can.recordings.sequence import open_recordings
from adhesion_can.reporting.export import (
    SUFFIXES,
    Rows,
    Writer,
    open_recording,
    open_table,
    require_format,
)
from adhesion_can.reporting.export.messages import MessageRows, id_text
from adhesion_can.reporting.export.raster import Raster, parse_raster
from adhesion_can.reporting.provenance import provenance, texts
from adhesion_can.reporting.text import console, table

_SHOWN = 10

_Key = tuple[str, int, bool]
"""Name, id and whether it is extended: two messages may have one name."""

_NOT_RISING = (
    "MF4 wants rising times: frames stamped before others in front of them were put in their place "
    "among those written at once, but no further; CSV and Parquet keep the order of the recording"
)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the description and the options of the command to its parser."""
    parser.description = (
        "Decodes recordings with a CAN database and writes the signals as columns for "
        "the tools that people plot with. CSV and Parquet get a row a frame, in the order of the "
        "recording; MF4 gets a channel group a message, and its time begins at the recording's "
        "first frame. Frames whose checksum, counter, length or "
        "multiplexer is wrong are left out and counted. Values that a database names 'not "
        "available' and the like stand in the columns as their numbers."
    )
    parser.add_argument("log", nargs="+", type=Path, metavar="LOG", help="one after the other")
    parser.add_argument(
        "--dbc",
        type=Path,
        metavar="F",
        help="CAN database: .dbc, .kcd, .arxml or .sym (default: our own)",
    )
    add_lenient(parser)
    parser.add_argument(
        "--out", type=Path, required=True, metavar="F", help=f"written: {', '.join(SUFFIXES)}"
    )
    parser.add_argument(
        "--signals",
        nargs="+",
        default=[],
        metavar="GLOB",
        help="only what matches: 'Message.Signal', 'Signal' or 'Message'; * and ? stand for any "
        "letters (put them in quotes); takes all that follow it, so that LOG stands in front of "
        "it, or behind a '--'",
    )
    parser.add_argument(
        "--channel",
        metavar="NAME",
        help="only the frames of this bus (default: all); formats that number their buses have "
        "can0, can1, ..",
    )
    parser.add_argument(
        "--raster",
        metavar="TIME",
        help="one row each so often, such as 10ms, with every signal as it was last: a plain table "
        "(default: a row a frame)",
    )
    add_json(parser)


def run(options: argparse.Namespace) -> int:
    """Run the command."""
    require_outputs(options, {"--out": options.out, "--json": options.json}, options.log)
    require_format(options.out, "--out")
    database = load_database(options.dbc, lenient=options.lenient)
    tell_left_out(database)
    chosen = _SignalFilter(database, options.signals)
    recordings = open_recordings(options.log)
    origin = provenance(
        Configuration(vehicle=Locomotive(), database=database, choices=()), options.log
    )
    given = database, chosen if options.signals else None, options.channel
    if options.raster is None:
        conversion = _Conversion(*given)
        with (
            reading("converting", recordings) as watched,
            open_recording(options.out, texts(origin)) as writer,
        ):
            for file, recording in enumerate(recordings):
                for block in watched(recording.blocks()):
                    conversion.process(block, file, writer)
            conversion.require_decoded(", ".join(map(str, options.log)))
    else:
        conversion = _convert_to_raster(options, given, recordings, texts(origin))
    document = conversion.as_json(recordings)
    if options.out.suffix.lower() == ".mf4" and conversion.runs_back(recordings):
        document["problems"].append(_NOT_RISING)
    document["output"] = {"path": str(options.out), "bytes": options.out.stat().st_size}
    write_json(options.json, {**document, **origin})
    if talk(options):
        _print(document)
    return 0


def _convert_to_raster(
    options: argparse.Namespace,
    given: tuple[CanDatabase, "_SignalFilter | None", str | None],
    recordings: Sequence[Recording],
    origin: Mapping[str, str],
) -> "_Conversion":
    """Write a table of even times; the recordings are read twice, first for its columns."""
    raster, first = Raster(parse_raster(options.raster)), _Conversion(*given)
    with reading("looking for signals", recordings) as watched:
        for file, recording in enumerate(recordings):
            for block in watched(recording.blocks()):
                raster.expect(*first.decode(block, file))
    first.require_decoded(", ".join(map(str, options.log)))
    second = _Conversion(*given)
    again = open_recordings(options.log)
    with (
        reading("converting", again) as watched,
        open_table(options.out, raster.fields, origin, name="raster") as table,
    ):
        for file, recording in enumerate(again):
            for block in watched(recording.blocks()):
                _, rows = second.decode(block, file)
                table.write(*raster.add(rows))
    return first


class _SignalFilter:
    """Filter of the signals that --signals names.

    Args:
        database: Database of the signals.
        globs: Patterns of --signals.

    Raises:
        InputError: A pattern matches no message or signal.

    """

    def __init__(self, database: CanDatabase, globs: Sequence[str]) -> None:
        self._globs = globs
        names = [(m.name, s.name) for m in database.db.messages for s in m.signals]
        for glob in globs:
            if not any(_matches(glob, *name) for name in names):
                raise InputError(
                    f"--signals {glob}",
                    f"matches no message or signal of {database.path.name}",
                    _suggest_names(glob, names),
                )

    def __call__(self, message: str, signal: str) -> bool:
        return any(_matches(glob, message, signal) for glob in self._globs)


def _matches(glob: str, message: str, signal: str) -> bool:
    return any(fnmatchcase(name, glob) for name in (f"{message}.{signal}", signal, message))


def _suggest_names(glob: str, names: Iterable[tuple[str, str]]) -> str:
    forms = [form for message, signal in names for form in (message, signal, f"{message}.{signal}")]
    return suggest(glob, forms) or "'cantools dump' lists what there is"


class _Conversion:
    """Decodes blocks, passes them to a writer, and counts what became of every frame."""

    def __init__(
        self, database: CanDatabase, chosen: _SignalFilter | None, channel: str | None
    ) -> None:
        self._database = database
        self._chosen = chosen
        self._decoder = Decoder(database, chosen)
        self._rows = MessageRows(database)
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
        _, rows = self.decode(block, file)
        writer.write(rows)

    def decode(self, block: Block, file: int) -> tuple[list[Message], list[Rows]]:
        """Messages and rows of a block of the `file`-th recording; the block is counted."""
        if not len(block):
            return [], []
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
            buses = np.bincount(block.channel[columns.rows])
            key = message.name, message.frame_id, message.is_extended_frame
            channels = self._received_on.setdefault(key, set())
            channels.update(block.channels[place] for place in np.flatnonzero(buses).tolist())
        kept = [columns for columns in decoded if (columns.outcome == 0).any()]
        return [columns.message for columns in kept], self._rows.build(decoded)

    def _select_channel(self, block: Block, name: str) -> Block:
        for place, other in enumerate(block.channels):
            if other != name:
                self._other_channels[other] += int(np.count_nonzero(block.channel == place))
        place = block.channels.index(name) if name in block.channels else len(block.channels)
        return block.select(block.channel == place)

    def require_decoded(self, logs: str) -> None:
        """Raise a RecordingError where no frame at all was decoded."""
        report = self._decoder.report
        if any(count.decoded for count in report.counts.values()):
            return
        known = ", ".join(sorted(_id(message) for message in self._database.db.messages)[:_SHOWN])
        database = f"{self._database.path.name} knows {len(self._database.db.messages)}: {known}"
        if report.counts:
            reasons: Counter[str] = Counter()
            for count in report.counts.values():
                reasons.update(count.rejected)
            what = f"every known frame is rejected ({_counts(reasons)}); {database}"
            mend = "check that the database is of this bus, and of its version"
        elif self._other_channels and not report.frames:
            what = f"no frame of channel {self._channel}; it has {_counts(self._other_channels)}"
            mend = "name one of these with --channel"
        elif report.passed_over:
            what = "no frame with a signal that is wanted and can be decoded; it has "
            what += _counts(report.passed_over)
            why = list(self._undecodable(report.passed_over, self._chosen))
            what += "".join(f"; {line}" for line in why[:_SHOWN])
            mend = "name other signals of these messages with --signals"
        elif not report.unknown:
            what, mend = "no data frame in it", "is it one that 'candump -L' recorded?"
        else:
            ids = {id_text(*key): count for key, count in report.unknown.items()}
            what = f"no frame of a known id; it has {_counts(ids)}; {database}"
            mend = self._sender_hint() or "name the database of this bus with --dbc"
        raise RecordingError(logs, what, mend)

    def _sender_hint(self) -> str | None:
        """Sentence about a message that another sender sends; None where no group is known."""
        unknown = self._decoder.report.unknown
        heard = {parameter_group(number): number for number, extended in unknown if extended}
        for message in self._database.db.messages:
            number = message.frame_id
            if message.is_extended_frame and parameter_group(number) in heard:
                return unmarked_sentence(message.name, number, heard[parameter_group(number)])
        return None

    def as_json(self, recordings: Sequence[Recording]) -> dict[str, Any]:
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
                *describe_problems(recordings, "keep their stamps"),
                *self._problems(distinct_names([recording.path for recording in recordings])),
            ],
        }

    def runs_back(self, recordings: Sequence[Recording]) -> bool:
        """Whether some stamp is before the one in front of it."""
        return bool(self._early_files) or any(
            recording.report.backwards for recording in recordings
        )

    def _problems(self, files: Sequence[str]) -> Iterator[str]:
        for file in self._early_files:
            begins = "begins before the end of the file in front of it; its stamps are kept"
            yield f"{files[file]}: {begins}"
        several = {
            name: channels
            for (name, *_), channels in self._received_on.items()
            if len(channels) > 1
        }
        if several:
            names = ", ".join(list(several)[:_SHOWN])
            buses = ", ".join(sorted(set().union(*several.values())))
            yield f"received on several channels ({buses}), and mixed: {names}; --channel takes one"
        yield from self._undecodable({name for name, _, _ in self._received_on})

    def _undecodable(
        self, messages: Collection[str], chosen: _SignalFilter | None = None
    ) -> Iterator[str]:
        """Sentences about what of these messages can never be decoded; None: chosen or not."""
        for name, reason in self._decoder.report.undecodable.items():
            message, _, signal = name.partition(".")
            if message in messages and (not (signal and chosen) or chosen(message, signal)):
                yield f"{name}: cannot be decoded: {reason}"


def _id(message: Message) -> str:
    return id_text(message.frame_id, message.is_extended_frame)


def _counts(counts: Mapping[str, int]) -> str:
    """'a 12, b 3, ..', the most frequent first."""
    most = Counter(counts).most_common(_SHOWN)
    more = ["..", f"{len(counts)} in all"] if len(counts) > _SHOWN else []
    return ", ".join([*(f"{name}: {count}" for name, count in most), *more])


def _print(document: Mapping[str, Any]) -> None:
    out = console()
    seconds = (document["to_s"] or 0.0) - (document["from_s"] or 0.0)
    out.print(f"{document['frames']} frames in {seconds:.1f} s, {document['decoded']} decoded")
    rows = [
        (
            f"{message['name']} {id_text(message['id'], message['extended'])}",
            str(message["frames"]),
            str(message["decoded"]),
            _counts(message["rejected"]) or "0",
            str(message["lost"]),
        )
        for message in sorted(document["messages"], key=lambda message: message["id"])
    ]
    columns = ("message", "frames", "decoded", "rejected", "lost")
    out.print(table("Messages", columns, rows))
    unknown = Counter(
        {
            f"{id_text(one['id'], one['extended'])} {one['name']}".strip(): one["frames"]
            for one in document["unknown"]
        }
    )
    unknown["further ids"] = document["unknown_beyond"]
    for head, counts in (
        ("unknown ids", unknown),
        ("without a wanted signal", document["not_wanted"]),
        ("of other channels", document["other_channels"]),
        ("besides", {name: document[name] for name in ("remote", "error", "marks")}),
    ):
        total = sum(counts.values())
        if total:
            held = {name: count for name, count in counts.items() if count}
            out.print(f"{head}: {total} frames ({_counts(held)})", markup=False)
    for line in document["problems"]:
        out.print(line, markup=False)
    written = document["output"]
    out.print(f"{written['path']}: {filesize.decimal(written['bytes'])}", markup=False)
