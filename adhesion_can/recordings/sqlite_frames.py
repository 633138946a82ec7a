"""Frames of python-can's SQLite files, whatever else such a file may hold.

A database is a program too: a view named as the table may be endless, a column may be computed,
and damaged pages may lead in circles. What is read here is a plain table of seven stored columns,
in no more steps than its file has room for.
"""

import sqlite3
from collections.abc import Generator
from contextlib import closing
from pathlib import Path
from typing import Any

from adhesion_can.bus.frame import Frame, to_us

TABLE = "messages"
COLUMNS = 7
_LONGEST = 1 << 20  # text or payload of a cell, bytes; a payload has 64
_STEPS = 10_000  # of SQLite's machine, between two looks
_WAL = 2  # version of the format in the head of a file that is written with a log beside it


def read_sqlite(path: Path) -> Generator[Frame, None, None]:
    """Frames in the order of the table's rows.

    Args:
        path: Path of the file, which is not packed.

    Raises:
        ValueError: It has no such table, or a row holds no frame.
        sqlite3.Error: It cannot be read.

    """
    with closing(_opened(path)) as connection:
        # A row takes about ten steps, and more than eight bytes of the file.
        left = 1_000_000 + 4 * path.stat().st_size

        def is_too_long() -> bool:
            nonlocal left
            left -= _STEPS
            return left < 0

        connection.set_progress_handler(is_too_long, _STEPS)
        try:
            _require_table(connection)
            for row in connection.execute(f"SELECT * FROM {TABLE}"):  # noqa: S608  a constant
                yield _frame(row)
        except sqlite3.OperationalError as error:
            if left < 0:
                raise ValueError("its table has more rows than the file has room for") from error
            raise


def _opened(path: Path) -> sqlite3.Connection:
    with path.open("rb") as file:
        head = file.read(20)
    # Without its log, such a file can only be read where nothing may be written if it is said
    # that nobody writes to it.
    is_still = head[19:] == bytes([_WAL]) and not path.with_name(f"{path.name}-wal").exists()
    way = "mode=ro&immutable=1" if is_still else "mode=ro"
    connection = sqlite3.connect(
        f"{path.resolve().as_uri()}?{way}", uri=True, check_same_thread=False
    )
    connection.setlimit(sqlite3.SQLITE_LIMIT_LENGTH, _LONGEST)
    connection.execute("PRAGMA trusted_schema = OFF")
    return connection


def _require_table(connection: sqlite3.Connection) -> None:
    """Raise a ValueError where there is no plain table of the name and the columns."""
    named = "SELECT type, rootpage FROM sqlite_master WHERE lower(name) = ?"
    kinds = [kind if page else "view" for kind, page in connection.execute(named, (TABLE,))]
    if not kinds:
        raise ValueError(f"no such table: {TABLE}")
    if kinds != ["table"]:
        raise ValueError(f"its {TABLE} is a view, not a table")
    hidden = [
        kind for (kind,) in connection.execute("SELECT hidden FROM pragma_table_xinfo(?)", (TABLE,))
    ]
    if any(hidden):
        raise ValueError(f"its table {TABLE} has computed columns")
    if len(hidden) != COLUMNS:
        raise ValueError(f"its table {TABLE} has {len(hidden)} columns, not {COLUMNS}")


def _frame(row: tuple[Any, ...]) -> Frame:
    """A row as a frame; a ValueError where a cell is none of it."""
    stamp, number, extended, remote, error, _, data = row
    if not isinstance(stamp, int | float):
        raise ValueError(f"a frame stamped {stamp!r}")  # noqa: TRY004  a value of the file
    if not isinstance(number, int):
        raise ValueError(f"a frame of the id {number!r}")  # noqa: TRY004
    if not isinstance(data, bytes | None):
        raise ValueError(f"a frame with the payload {data!r}")  # noqa: TRY004
    return Frame(
        t_us=to_us(stamp),
        arbitration_id=number,
        data=b"" if error or remote else data or b"",
        channel="",
        is_extended=bool(extended) and not error,
        is_remote=bool(remote),
        is_error=bool(error),
    )
