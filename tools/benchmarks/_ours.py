"""Our ways, in a process of their own: `_ours.py WAY FILE`."""

import io
import sys
import tempfile
from contextlib import redirect_stdout
from math import fsum
from pathlib import Path

from _passes import print_result, timed


def columns_way(path):
    """All columns of the whole recording, kept; E2E checked."""
    from adhesion_can.bus.database import load_database
    from adhesion_can.bus.decoder import Decoder
    from adhesion_can.recordings.recording import Recording

    database = load_database()

    def work():
        decoder = Decoder(database)
        blocks = Recording(path).blocks()
        return decoder.report, [one for block in blocks for one in decoder.decode(block)]

    passes, (report, columns) = timed(work)
    parts = {}
    for one in columns:
        sound = one.outcome == 0
        for name, column in one.signals.items():
            held = parts.setdefault(f"{one.message.name}.{name}", [])
            held.extend(column.values[sound].tolist())
    lost = sum(count.lost for count in report.messages.values())
    decoded = sum(count.decoded for count in report.messages.values())
    sums = {name: fsum(values) for name, values in parts.items()}
    print_result(report.frames, passes, sums=sums, rejected=report.frames - decoded, lost=lost)


def streamed_way(path):
    """All columns, block after block, let go: what memory stays flat with."""
    from adhesion_can.bus.database import load_database
    from adhesion_can.bus.decoder import Decoder
    from adhesion_can.recordings.recording import Recording

    database = load_database()

    def work():
        decoder = Decoder(database)
        for block in Recording(path).blocks():
            decoder.decode(block)
        return decoder.report.frames

    passes, frames = timed(work)
    print_result(frames, passes)


def parse_way(path):
    """Text to blocks of frames alone."""
    from adhesion_can.recordings.recording import Recording

    passes, frames = timed(lambda: sum(map(len, Recording(path).blocks())))
    print_result(frames, passes)


def read_way(path):
    """The bytes of the file alone, from the system's cache."""
    buffer = bytearray(1 << 20)

    def work():
        with path.open("rb", buffering=0) as file:
            while file.readinto(buffer):
                pass

    passes, _ = timed(work)
    print_result(None, passes)


def convert_way(path):
    """`adhesion-can convert` to Parquet, with all that the command does besides."""
    from adhesion_can.cli.main import main as command

    with tempfile.TemporaryDirectory(dir=path.parent) as folder:
        words = ["convert", str(path), "--out", str(Path(folder) / "out.parquet")]

        def work():
            with redirect_stdout(io.StringIO()) as out:
                status = command(words)
            if status:
                raise RuntimeError(f"{' '.join(words)} ended with {status}: {out.getvalue()}")

        work()  # what is imported is imported before, as for the others
        passes, _ = timed(work)
    print_result(None, passes)


def write_way(path, dbc, out):
    """What `adhesion-can convert` does between loading the database and printing its report.

    Of a folder of Parquet files the sums of its columns are read back.
    """
    from adhesion_can.bus.database import load_database
    from adhesion_can.cli.conversion import Conversion
    from adhesion_can.recordings.recording import Recording
    from adhesion_can.reporting.export import open_recording
    from adhesion_can.reporting.export.target import parse_target

    database = load_database(Path(dbc))
    with tempfile.TemporaryDirectory(dir=path.parent) as folder:
        form = out.removesuffix("/") if out.endswith("/") else None
        target = parse_target(f"{folder}/{out}", "--out", form)

        def work():
            conversion = Conversion(database, None, None, by_channel=target.by_channel)
            with open_recording(target, {}) as writer:
                for block in Recording(path).blocks(target.text_at_once):
                    conversion.process(block, 0, writer)

        passes, _ = timed(work)
        files = [file for file in Path(folder).rglob("*") if file.is_file()]
        size = sum(file.stat().st_size for file in files)
        more = {"sums": _sums(files)} if out == "parquet/" else {}
    print_result(None, passes, bytes=size, **more)


def command_way(path, dbc):
    """`adhesion-can convert` to a folder, with all that the command does besides."""
    from adhesion_can.cli.main import main as command

    with tempfile.TemporaryDirectory(dir=path.parent) as folder:
        words = ["convert", str(path), "--dbc", dbc, "--out", f"{folder}/o/"]

        def work():
            with redirect_stdout(io.StringIO()) as said:
                status = command(words)
            if status:
                raise RuntimeError(f"{' '.join(words)} ended with {status}: {said.getvalue()}")

        work()  # what is imported is imported before, as for the others
        passes, _ = timed(work)
    print_result(None, passes)


def _sums(files):
    """Sum of each signal of a folder of Parquet files."""
    from pyarrow import parquet

    sums = {}
    for file in files:
        if file.suffix == ".parquet":
            table = parquet.read_table(file)
            for name in table.column_names[2:]:
                sums[f"{file.stem}.{name}"] = fsum(table[name].drop_null().to_pylist())
    return sums


def parts_way(path):
    """Where the time goes."""
    from _parts import parts_of

    passes, parts = parts_of(path)
    print_result(None, passes, parts=parts)


def replay_way(path):
    """`adhesion-can replay`, as it is called, once; `answer` is its JSON."""
    import json
    import time

    from adhesion_can.cli.main import main as command

    answer = path.with_suffix(".json")
    clock, processor = time.perf_counter(), time.process_time()
    with redirect_stdout(io.StringIO()) as out:
        status = command(["replay", str(path), "--json", str(answer)])
    if status:
        raise RuntimeError(f"replay of {path} ended with {status}: {out.getvalue()}")
    passes = [(time.perf_counter() - clock, time.process_time() - processor)]
    document = json.loads(answer.read_text())
    answer.unlink()
    print_result(document["frames"], passes, answer=document)


if __name__ == "__main__":
    ways = {
        "columns": columns_way,
        "streamed": streamed_way,
        "parse": parse_way,
        "read": read_way,
        "convert": convert_way,
        "write": write_way,
        "command": command_way,
        "parts": parts_way,
        "replay": replay_way,
    }
    ways[sys.argv[1]](Path(sys.argv[2]), *sys.argv[3:])
