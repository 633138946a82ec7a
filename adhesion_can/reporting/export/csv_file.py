"""CSV, with or without gzip: one table with a row for each frame, or for each row of a table."""

import csv
import gzip
import io
import re
from collections.abc import Iterable, Mapping, Sequence
from contextlib import ExitStack
from functools import partial
from itertools import repeat
from pathlib import Path
from typing import Any, BinaryIO, cast

import numpy as np
from numpy.typing import NDArray

from adhesion_can.files import Temporary
from adhesion_can.formula_cells import quote_formula
from adhesion_can.reporting.export.growing_table import GrowingTable
from adhesion_can.reporting.export.layout import SECOND, Field, FieldColumn, Group, GroupRows, count
from adhesion_can.reporting.export.message_folder import MessageFolder
from adhesion_can.reporting.export.number_texts import FloatTexts

_CHUNK = 1 << 22
_LEVEL = 6  # of gzip: its default of 9 takes three times as long for 2 % less


class CsvFormat:
    """How CSV writes a table.

    Args:
        compressed: Whether the file is compressed with gzip.
        by_message: Whether rows belong to messages: a column holds the message's name, and the
            columns of signals are named 'Message.Signal'.
        decimals: Number of decimals of the time stamps in s.
        keep_formulas: Whether names stand as they are even where a spreadsheet computes them.

    """

    def __init__(
        self, compressed: bool, by_message: bool, decimals: int, *, keep_formulas: bool = False
    ) -> None:
        self._keep_formulas = keep_formulas
        self.compressed = compressed
        self.by_message = by_message
        self.decimals = decimals

    def open(self, file: BinaryIO, groups: Sequence[Group]) -> "CsvPartFile":
        """Start a file with the columns of some groups."""
        return CsvPartFile(file, groups, self)

    def join(
        self, parts: Sequence[tuple[Temporary, int]], file: BinaryIO, groups: Sequence[Group]
    ) -> None:
        """Write one file of several: their lines get the commas that they lack."""
        with ExitStack() as stack:
            out = self.pack(file, stack)
            out.write(self.header(groups))
            for part, held in parts:
                missing = sum(len(group.fields) for group in groups[held:])
                end = b"," * missing + b"\n"
                with ExitStack() as reading:
                    source: Any = reading.enter_context(part.read_again())
                    if self.compressed:
                        source = reading.enter_context(gzip.open(source))
                    source.readline()
                    while chunk := source.read(_CHUNK):
                        out.write(chunk.replace(b"\n", end) if missing else chunk)

    def pack(self, file: BinaryIO, stack: ExitStack) -> BinaryIO:
        """The file, compressed where that is wanted until the stack is closed."""
        if not self.compressed:
            return file
        packed = gzip.GzipFile("", "wb", compresslevel=_LEVEL, fileobj=file, mtime=0)
        return cast(BinaryIO, stack.enter_context(packed))

    def header(self, groups: Sequence[Group]) -> bytes:
        """First line of the file, with the names of the columns."""
        names = ["time_s", *(["message"] if self.by_message else [])]
        for group in groups:
            prefix = f"{group.name}." if self.by_message else ""
            names += [prefix + field.name for field in group.fields]
        return self.line(names).encode()

    def line(self, cells: Sequence[str]) -> str:
        """Cells of text as a line."""
        text = io.StringIO()
        # A line break in a name would be one in the table to whatever counts lines.
        plain = [" ".join(cell.split()) for cell in cells]
        if not self._keep_formulas:
            plain = [quote_formula(cell) for cell in plain]
        csv.writer(text, lineterminator="\n").writerow(plain)
        return text.getvalue()


class CsvPartFile:
    """A CSV file of a fixed set of columns."""

    def __init__(self, file: BinaryIO, groups: Sequence[Group], table_format: CsvFormat) -> None:
        self._format = table_format
        self._before: dict[str, int] = {}
        self._width = 0
        for group in groups:
            self._before[group.name] = self._width
            self._width += len(group.fields)
        self._texts = FloatTexts()
        self._stack = ExitStack()
        self._file = table_format.pack(file, self._stack)
        self._file.write(table_format.header(groups))

    def write(self, rows: Sequence[GroupRows]) -> None:
        """Append rows."""
        lines = np.empty(count(rows), dtype=object)
        for part in rows:
            lines[part.position] = list(self._lines(part))
        self._file.write("".join((*lines.tolist(),)).encode())

    def close(self) -> None:
        """Write what is left; the file stays open."""
        self._stack.close()

    def _lines(self, rows: GroupRows) -> Iterable[str]:
        before = self._before[rows.group.name]
        after = self._width - before - len(rows.group.fields)
        name = self._format.line([rows.group.name])[:-1] if self._format.by_message else ""
        cells: list[Iterable[str]] = [time_texts(rows.t_ns, self._format.decimals)]
        if self._format.by_message:
            cells.append(repeat(name + "," * before))
        for field, column in zip(rows.group.fields, rows.columns, strict=True):
            cells.append(self._column(field, column))
        end = "," * after + "\n"
        return [",".join(row) + end for row in zip(*cells, strict=False)]

    def _column(self, field: Field, column: FieldColumn) -> list[str]:
        numbers = column.values
        if field.text:
            texts = [self._format.line([field.names[number]])[:-1] for number in numbers.tolist()]
        elif field.spec:
            texts = [format(number, field.spec) for number in numbers.tolist()]
        elif numbers.dtype.kind == "f":
            texts = self._texts.of(numbers)
        else:
            texts = list(map(str, numbers.tolist()))
        if column.missing is not None:
            for row in np.flatnonzero(column.missing).tolist():
                texts[row] = ""
        return texts


class CsvMessageFile:
    """A CSV file with the rows of one message.

    Args:
        file: File.
        group: Message.
        keep_formulas: Whether names stand as they are even where a spreadsheet computes them.

    """

    held = 0

    def __init__(self, file: BinaryIO, group: Group, *, keep_formulas: bool = False) -> None:
        plain = CsvFormat(
            compressed=False, by_message=False, decimals=9, keep_formulas=keep_formulas
        )
        self._file = CsvPartFile(file, (group,), plain)

    def write(self, rows: GroupRows) -> None:
        """Append rows."""
        self._file.write([rows._replace(position=np.arange(len(rows.t_ns)))])

    def flush(self) -> None:
        """Do nothing: rows are written as they come."""

    def close(self) -> None:
        """Write what is left; the file stays open."""
        self._file.close()


def time_texts(t_ns: NDArray[np.int64], decimals: int = 9) -> list[str]:
    """Stamps in s as text, exact where it has nine decimals, else cut off.

    Args:
        t_ns: Time stamps, ns, shape (n,).
        decimals: Number of decimals, 1..9.

    """
    if not len(t_ns):
        return []
    magnitude = np.abs(t_ns)
    seconds, fraction = np.divmod(magnitude, SECOND)
    width = len(str(int(seconds.max())))
    digits = np.empty((len(t_ns), width + 2 + decimals), dtype=np.uint8)
    digits[:, width] = ord(".")
    digits[:, -1] = ord("\n")
    _write_digits(digits[:, :width], seconds)
    _write_digits(digits[:, width + 1 : -1], fraction // 10 ** (9 - decimals))
    texts = digits.tobytes().decode("ascii").split("\n")[:-1]
    if len(str(int(seconds.min()))) < width:
        pattern = re.compile(r"^0+(?=\d)")
        texts = [pattern.sub("", text) for text in texts]
    for row in np.flatnonzero(t_ns < 0).tolist():
        texts[row] = "-" + texts[row]
    return texts


def _write_digits(out: NDArray[np.uint8], numbers: NDArray[np.int64]) -> None:
    """Decimal digits with leading zeros, from the last column to the first."""
    rest = numbers
    for digit in range(out.shape[1] - 1, -1, -1):
        tenth = rest // 10
        out[:, digit] = rest - 10 * tenth + ord("0")
        rest = tenth


def open_sink(
    path: Path,
    _origin: Mapping[str, str],
    groups: Sequence[Group],
    decimals: int,
    *,
    keep_formulas: bool = False,
) -> GrowingTable:
    """Start a CSV file, compressed where its name ends in .gz."""
    compressed = path.suffix.lower() == ".gz"
    form = CsvFormat(compressed, not groups, decimals, keep_formulas=keep_formulas)
    return GrowingTable(path, form, groups)


def open_folder(
    path: Path, suffix: str, origin: Mapping[str, str], *, keep_formulas: bool = False
) -> MessageFolder:
    """Start a folder of CSV files."""
    open_file = partial(CsvMessageFile, keep_formulas=keep_formulas)
    return MessageFolder(path, suffix, open_file, origin)
