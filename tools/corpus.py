"""Databases and recordings of others, read beside cantools and python-can."""

import argparse
import json
import math
import random
import sys
import warnings
from collections import Counter, defaultdict
from collections.abc import Callable, Iterator
from enum import StrEnum
from pathlib import Path
from typing import NamedTuple, TypeVar

import can
import cantools
from cantools.database.can import Database, Message

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

from adhesion_can.bus.block import Block
from adhesion_can.bus.database import CanDatabase, load_database
from adhesion_can.bus.decoder import Decoder
from adhesion_can.bus.frame import Frame
from adhesion_can.errors import AdhesionCanError
from adhesion_can.recordings.python_can_messages import from_message
from adhesion_can.recordings.recording import Recording

DATABASES = frozenset({".dbc", ".kcd", ".sym", ".arxml"})
RECORDINGS = frozenset({".asc", ".blf", ".trc", ".log", ".csv", ".db", ".mf4", ".mdf", ".txt"})
T = TypeVar("T")
PAYLOADS = 20
"""Random payloads of each message."""
NEAR_US = 1
"""Largest difference of stamps: python-can's are floats of seconds, µs."""
LARGEST = 64 << 20
"""Size of a file that is looked at, bytes."""


class Outcome(StrEnum):
    """What became of a file."""

    EQUAL = "read and equal"
    ALONE = "read by us alone"
    BOTH_REFUSE = "refused by both"
    REFUSED = "REFUSED by us alone"
    DIFFERS = "DIFFERS"


class Result(NamedTuple):
    """Outcome of a file.

    Attributes:
        path: The file.
        outcome: What became of it.
        reason: Error, or first difference.

    """

    path: Path
    outcome: Outcome
    reason: str = ""


def look_at_database(path: Path) -> Result:
    """A database by both, and its messages with random payloads."""
    theirs = _attempt(lambda: cantools.database.load_file(path, strict=False))
    ours = _attempt(lambda: load_database(path))
    lenient = _attempt(lambda: load_database(path, lenient=True))
    if isinstance(theirs, str) or not isinstance(theirs, Database):
        if isinstance(ours, CanDatabase):
            return Result(path, Outcome.ALONE, str(theirs))
        how = " (read with --lenient)" if isinstance(lenient, CanDatabase) else ""
        return Result(path, Outcome.BOTH_REFUSE, str(ours) + how)
    if not isinstance(ours, CanDatabase):
        return Result(path, Outcome.REFUSED, str(ours))
    difference = next(_differences(ours, theirs), "")
    return Result(path, Outcome.DIFFERS if difference else Outcome.EQUAL, difference)


def _differences(ours: CanDatabase, theirs: Database) -> Iterator[str]:
    """What differs between the two, a sentence each."""
    numbers = random.Random(7)
    by_id = {(m.frame_id, m.is_extended_frame): m for m in theirs.messages}
    for (number, is_extended), message in by_id.items():
        payloads = [numbers.randbytes(min(message.length, 64)) for _ in range(PAYLOADS)]
        frames = [
            Frame(n, number, data, "", is_extended, is_fd=len(data) > 8)
            for n, data in enumerate(payloads)
        ]
        for columns in Decoder(ours).decode(Block.from_frames(frames)):
            for place, data in enumerate(payloads):
                wanted = _decoded(message, data)
                if wanted is None:
                    continue  # a signal leaves the frame, and cantools gives up the others
                if columns.outcome[place]:
                    yield f"{message.name} {data.hex()}: rejected"
                    continue
                for name, value in wanted.items():
                    if name not in columns.signals or not _is_text_or_same(
                        value, columns.signals[name].values[place]
                    ):
                        yield f"{message.name}.{name} {data.hex()}: {value}"


def _decoded(message: Message, data: bytes) -> dict[str, object] | None:
    try:
        return dict(message.decode(data, decode_choices=False))  # type: ignore[arg-type]
    except Exception:  # noqa: BLE001  cantools raises whatever its conversions meet
        return None


def _is_text_or_same(wanted: object, found: object) -> bool:
    if not isinstance(wanted, int | float):
        return True
    a, b = float(wanted), float(found)  # type: ignore[arg-type]
    return a == b or (math.isnan(a) and math.isnan(b))


def look_at_recording(path: Path) -> Result | None:
    """A recording by both; None where neither takes it for one."""
    ours = _attempt(lambda: list(_frames(path)))
    theirs = _attempt(lambda: [from_message(m) for m in can.LogReader(path)])
    error, frames = (ours, []) if isinstance(ours, str) else ("no frame", ours)
    their_error, their_frames = (theirs, []) if isinstance(theirs, str) else ("no frame", theirs)
    if not frames and not their_frames:
        is_table = path.suffix.lower() == ".csv"  # of whatever, mostly
        return None if is_table else Result(path, Outcome.BOTH_REFUSE, error)
    if not frames:
        return Result(path, Outcome.REFUSED, error)
    if not their_frames:
        return Result(path, Outcome.ALONE, their_error)
    if len(frames) != len(their_frames):
        what = f"{len(frames)} frames, python-can {len(their_frames)}"
        return Result(path, Outcome.DIFFERS, what)
    for n, (a, b) in enumerate(zip(frames, their_frames, strict=True)):
        if abs(a.t_us - b.t_us) > NEAR_US or _content(a) != _content(b):
            return Result(path, Outcome.DIFFERS, f"frame {n + 1}: {a}; python-can {b}")
    return Result(path, Outcome.EQUAL)


def _content(frame: Frame) -> Frame:
    """What must be equal: names of buses are everybody's own, and without data nothing is FD."""
    has_no_data = frame.is_remote or frame.is_error
    return frame._replace(t_us=0, channel="", is_fd=frame.is_fd and not has_no_data)


def _frames(path: Path) -> Iterator[Frame]:
    for block in Recording(path).blocks():
        yield from (item for item in block.items() if isinstance(item, Frame))


def _attempt(work: Callable[[], T]) -> T | str:
    """What some work gives, or its error in a line; one that is no error of ours is marked."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        try:
            return work()
        except AdhesionCanError as error:
            return " ".join(str(error).split())[:300]
        except Exception as error:  # noqa: BLE001  readers of others raise whatever they meet
            return f"{type(error).__name__}: {' '.join(str(error).split())[:200]}"


def look(folders: list[Path]) -> Iterator[Result]:
    """Results of all files below some folders."""
    paths = (path for folder in folders for path in sorted(folder.rglob("*")) if path.is_file())
    for path in paths:
        if path.stat().st_size > LARGEST:
            continue
        suffix = path.suffix.lower()
        if suffix in DATABASES:
            yield look_at_database(path)
        elif suffix in RECORDINGS and (found := look_at_recording(path)) is not None:
            yield found


def main() -> int:
    """Run the command; 1 where a file is refused wrongly, or differs."""
    parser = argparse.ArgumentParser(prog="tools/corpus", description=__doc__)
    parser.add_argument("folders", nargs="+", type=Path, metavar="DIR")
    parser.add_argument("--json", type=Path, metavar="F")
    options = parser.parse_args()
    results = list(look(options.folders))
    kinds: dict[str, Counter[Outcome]] = defaultdict(Counter)
    for result in results:
        is_database = result.path.suffix.lower() in DATABASES
        kinds["databases" if is_database else "recordings"][result.outcome] += 1
        if result.outcome is not Outcome.EQUAL:
            print(f"{result.outcome}: {result.path}: {result.reason}")
    for kind, counts in kinds.items():
        said = ", ".join(f"{counts[outcome]} {outcome}" for outcome in Outcome if counts[outcome])
        print(f"{kind}: {sum(counts.values())}: {said}")
    if options.json is not None:
        document = [[str(r.path), r.outcome, r.reason] for r in results]
        options.json.write_text(json.dumps(document, indent=1))
    wrong = {Outcome.REFUSED, Outcome.DIFFERS}
    return 1 if any(result.outcome in wrong for result in results) else 0


if __name__ == "__main__":
    sys.exit(main())
