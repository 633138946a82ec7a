"""`convert`: any recording with any database to columns."""

import argparse
import sys
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, TextIO

from rich import filesize

from adhesion_can.bus.block import Block
from adhesion_can.bus.database import CanDatabase, load_database
from adhesion_can.cli.common import add_lenient, require_database, tell_left_out
from adhesion_can.cli.conversion import Conversion, counts_text
from adhesion_can.cli.outputs import add_json, require_outputs, talk, write_json
from adhesion_can.cli.reading import Watched, reading
from adhesion_can.cli.signal_filter import SignalFilter
from adhesion_can.errors import InputError
from adhesion_can.recordings.drive_time import USUAL_RESTART_S, DriveTime
from adhesion_can.recordings.recording import Recording
from adhesion_can.recordings.sequence import open_recordings
from adhesion_can.reporting.export import open_recording, open_table
from adhesion_can.reporting.export.message_folder import LIST
from adhesion_can.reporting.export.messages import id_text
from adhesion_can.reporting.export.raster import Raster, parse_raster
from adhesion_can.reporting.export.target import (
    FOLDER_FORMATS,
    SUFFIXES,
    TABLE_SUFFIXES,
    Target,
    file_target,
    parse_target,
)
from adhesion_can.reporting.provenance import provenance_of_database, texts
from adhesion_can.reporting.text import FittingTable, console


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the description and the options of the command to its parser."""
    parser.description = (
        "Decodes recordings with a CAN database and writes the signals as columns for plotting "
        "tools. A folder gets one file per message, with its own time. CSV and Parquet files "
        "have a row per frame in the order of the recording; Arrow has a row per value; MF4 has "
        "a channel group per message, and its time starts at the first frame; MCAP has a topic "
        "per message, and the frames. Frames with a wrong checksum, counter, length or "
        "multiplexer are dropped and counted. Values that a database names, such as 'not "
        "available', are written as numbers."
    )
    parser.add_argument(
        "log", nargs="+", type=Path, metavar="LOG", help="decoded one after the other"
    )
    parser.add_argument(
        "--dbc",
        type=Path,
        metavar="F",
        help="CAN database: .dbc, .kcd, .arxml or .sym (default: the packaged one)",
    )
    add_lenient(parser)
    parser.add_argument(
        "--out",
        required=True,
        metavar="F",
        help=(
            f"output file: {', '.join(SUFFIXES)}; FOLDER/ for one file per message; - for an "
            "Arrow stream to stdout"
        ),
    )
    parser.add_argument(
        "--format",
        choices=FOLDER_FORMATS,
        help=f"format of the files in a folder (default: {FOLDER_FORMATS[0]})",
    )
    parser.add_argument(
        "--signals",
        nargs="+",
        default=[],
        metavar="GLOB",
        help=(
            "only what matches 'Message.Signal', 'Signal' or 'Message'; * and ? match any "
            "letters (put them in quotes); takes all words that follow, so put LOG before it or "
            "after '--'"
        ),
    )
    parser.add_argument(
        "--channel",
        metavar="NAME",
        help=(
            "only the frames of this bus (default: all); in formats that number their buses: "
            "can0, can1, .."
        ),
    )
    parser.add_argument(
        "--raster",
        metavar="TIME",
        help=(
            "one row per interval, such as 10ms, with the last value of every signal: a plain "
            "table (default: a row per frame)"
        ),
    )
    parser.add_argument(
        "--csv-formulas",
        choices=("quote", "keep"),
        default="quote",
        help=(
            "names and texts in CSV that a spreadsheet would compute, such as '=A1': quote puts "
            "an apostrophe in front, which adhesion-can removes when it reads them; keep leaves "
            "them unchanged (default: quote)"
        ),
    )
    add_json(parser)


def run(options: argparse.Namespace) -> int:
    """Run the command."""
    target = replace(
        parse_target(options.out, "--out", options.format),
        keep_formulas=options.csv_formulas == "keep",
    )
    if target.is_stdout and options.json == "-":
        raise InputError("--json -", "stdout has the Arrow stream", "name a file")
    out = target.path / LIST if target.is_folder and target.path.exists() else target.path
    require_outputs(options, options.log, own={} if target.is_stdout else {"--out": out})
    require_database(options.dbc)
    database = load_database(options.dbc, lenient=options.lenient)
    tell_left_out(database)
    chosen = SignalFilter(database, options.signals)
    given = database, chosen if options.signals else None, options.channel
    recordings = open_recordings(options.log)
    origin = provenance_of_database(database, options.log)
    convert = _convert if options.raster is None else _convert_to_raster
    document = convert(options, target, given, recordings, texts(origin))
    document["output"] = {"path": options.out, "bytes": target.size}
    if target.is_folder:
        document["output"]["files"] = target.files
    write_json(options.json, {**document, **origin})
    if talk(options):
        _print(document, sys.stderr if target.is_stdout else sys.stdout)
    return 0


_Given = tuple[CanDatabase, SignalFilter | None, str | None]
"""Database, signals that are wanted (None: all), and bus (None: all)."""


def _convert(
    _options: argparse.Namespace,
    target: Target,
    given: _Given,
    recordings: Sequence[Recording],
    origin: Mapping[str, str],
) -> dict[str, Any]:
    """Write all frames; what became of them."""
    conversion = Conversion(*given, by_channel=target.by_channel)
    with (
        reading("converting", recordings) as watched,
        open_recording(target, origin) as writer,
    ):
        is_even = target.path.suffix == ".mf4"  # its viewers search by time
        for file, block in _blocks(recordings, watched, target.text_at_once, is_even=is_even):
            conversion.process(block, file, writer)
        conversion.require_decoded(recordings)
    document = conversion.to_dict(recordings)
    document["problems"] += writer.problems()
    return document


def _convert_to_raster(
    options: argparse.Namespace,
    target: Target,
    given: _Given,
    recordings: Sequence[Recording],
    origin: Mapping[str, str],
) -> dict[str, Any]:
    """Write a table of even times; the recordings are read twice, first for its columns."""
    raster = Raster(parse_raster(options.raster))
    if target.is_folder or target.is_stdout:
        known = ", ".join(TABLE_SUFFIXES)
        raise InputError(f"--out {options.out}", "--raster writes one table", f"name a {known}")
    file_target(target.path, "--out", TABLE_SUFFIXES)
    first = Conversion(*given)
    with reading("looking for signals", recordings) as watched:
        for file, block in _blocks(recordings, watched, is_even=True):
            raster.expect(*first.decode(block, file))
    first.require_decoded(recordings)
    second = Conversion(*given)
    again = open_recordings(options.log)
    with (
        reading("converting", again) as watched,
        open_table(
            target.path,
            raster.fields,
            origin,
            name="raster",
            keep_formulas=target.keep_formulas,
        ) as write,
    ):
        for file, block in _blocks(again, watched, is_even=True):
            _, rows = second.decode(block, file)
            for even, columns in raster.add(rows):
                write(even, columns)
    document = first.to_dict(recordings)
    document["problems"] += raster.problems()
    return document


def _blocks(
    recordings: Sequence[Recording],
    watched: Watched,
    size: int | None = None,
    *,
    is_even: bool,
) -> Iterator[tuple[int, Block]]:
    """Blocks of all recordings with the number of their file, in whose order they stand.

    Args:
        recordings: The recordings.
        watched: Passes blocks on, and shows the progress.
        size: Bytes of text in a block; None: the usual ones.
        is_even: Whether the output needs a time that runs forward.

    """
    time = DriveTime(USUAL_RESTART_S)
    for file, recording in enumerate(recordings):
        read = watched(recording.blocks() if size is None else recording.blocks(size))
        for block in (time.blocks if is_even else time.by_head)(recording, read):
            yield file, block


def _print(document: Mapping[str, Any], file: TextIO) -> None:
    out = console(file)
    seconds = (document["to_s"] or 0.0) - (document["from_s"] or 0.0)
    out.print(f"{document['frames']} frames in {seconds:.1f} s, {document['decoded']} decoded")
    rows = [
        (
            f"{message['name']} {id_text(message['id'], message['extended'])}",
            str(message["frames"]),
            str(message["decoded"]),
            counts_text(message["rejected"]) or "0",
            str(message["lost"]),
        )
        for message in sorted(document["messages"], key=lambda message: message["id"])
    ]
    columns = ("message", "frames", "decoded", "rejected", "lost")
    out.print(FittingTable("Messages", columns, rows))
    unknown = Counter(
        {
            f"{id_text(entry['id'], entry['extended'])} {entry['name']}".strip(): entry["frames"]
            for entry in document["unknown"]
        }
    )
    unknown["further ids"] = document["unknown_beyond"]
    for head, counts in (
        ("unknown ids", unknown),
        ("without a selected signal", document["not_wanted"]),
        ("of other channels", document["other_channels"]),
        ("besides", {name: document[name] for name in ("remote", "error", "marks")}),
    ):
        total = sum(counts.values())
        if total:
            held = {name: count for name, count in counts.items() if count}
            out.print(f"{head}: {total} frames ({counts_text(held)})")
    for line in document["problems"]:
        out.print(line)
    written = document["output"]
    if written["bytes"] is not None:
        files = f"{written['files']} files, " if "files" in written else ""
        size = filesize.decimal(written["bytes"])
        out.print(f"{written['path']}: {files}{size}")
