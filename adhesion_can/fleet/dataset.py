"""The data set: a Parquet file a unit and table, in folders by vehicle and day.

`OUT/TABLE/vehicle=V/day=2026-01-31/UNIT.parquet`. A file appears whole or not at all: by a rename
on a disk, by one PUT in an object store. That of `units` comes last, and says that the unit is
complete.
"""

from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from datetime import date
from pathlib import Path
from typing import Any
from urllib.parse import quote

import pyarrow as pa
from pyarrow import parquet

from adhesion_can.errors import InputError
from adhesion_can.files import whole_file
from adhesion_can.fleet.places import Place, open_place
from adhesion_can.fleet.rows import Row
from adhesion_can.fleet.schema import SCHEMA_VERSION, TABLES, UNITS, TableSchema

NO_DAY = "__HIVE_DEFAULT_PARTITION__"
"""Name that means null in folders of partitions."""
READERS = 16
"""Files that are read at the same time: an object store answers after 10 to 100 ms."""
DONE, FAILED = "done", "failed"
"""Values of the column `status`."""


@dataclass(frozen=True, slots=True)
class Kept:
    """A unit of the data set, complete.

    Attributes:
        unit_id: Identity of the unit.
        path: Absolute path or URL.
        vehicle: Name of the vehicle.
        day: Day of the first frame.
        status: `DONE` or `FAILED`.
        failed_step: First step that failed; None where none did.
        error: What was wrong; None where nothing was.
        sha256: Hash of the file; None where it could not be read.
        fingerprint: Cheap sign of a change of the file.
        settings: Hash of what the unit was analysed with.
        key: Hash of content and settings; None where it could not be read.

    """

    unit_id: str
    path: str
    vehicle: str
    day: date | None
    status: str
    failed_step: str | None
    error: str | None
    sha256: str | None
    fingerprint: str
    settings: str
    key: str | None


class DataSet:
    """A data set in a folder or below an URL.

    Args:
        out: Path or URL of the folder.

    Raises:
        InputError: The file system is not known.

    """

    def __init__(self, out: str) -> None:
        self.out = out
        self._place: Place = open_place(out)

    def read_units(self) -> dict[str, Kept]:
        """Complete units by their paths.

        Raises:
            InputError: The folder holds another version of the tables, or cannot be read.

        """
        read = self.read_rows(UNITS, list(Kept.__slots__))
        return {row["path"]: Kept(**row) for rows in read for row in rows}

    def read_rows(
        self, table: TableSchema, columns: Sequence[str] | None = None
    ) -> Iterator[list[Row]]:
        """Rows of a table, a list for each of its files, in their order; none without files.

        A reader of whole data sets reads many files ahead: hundreds of MB for a thousand units.

        Args:
            table: Table.
            columns: Names of the columns; None: all.

        Raises:
            InputError: The folder holds another version of the tables, or cannot be read.

        """
        names = columns or [column.name for column in table.columns]
        files = self._files(table)
        with ThreadPoolExecutor(READERS) as pool:
            for first in range(0, len(files), READERS):
                some = files[first : first + READERS]
                yield from pool.map(lambda file: self._read(file, names).to_pylist(), some)

    def _files(self, table: TableSchema) -> list[str]:
        """Paths of the files of a table, in their order."""
        self._place.system.invalidate_cache()  # of listings: workers have written since
        with self._place.errors():
            paths = self._place.system.find(f"{self._place.inner.rstrip('/')}/{table.name}")
        return sorted(file for file in paths if file.endswith(".parquet"))

    def _read(self, file: str, names: Sequence[str]) -> Any:
        where = self._place.full(file)
        try:
            with self._place.system.open(file, "rb") as source:
                opened = parquet.ParquetFile(source)
                metadata = opened.schema_arrow.metadata or {}
                version = metadata.get(b"adhesion_can.schema", b"none").decode()
                if version == str(SCHEMA_VERSION):
                    return opened.read(columns=list(names))
        except (OSError, pa.ArrowException) as error:
            reason = " ".join(str(error).split())[:150]
            raise InputError(where, f"cannot be read ({reason})", "remove it") from error
        what = f"version {version} of the tables; this is version {SCHEMA_VERSION}"
        raise InputError(where, what, "use another folder for --out")

    def write(self, unit: Row, rows: Mapping[str, Sequence[Row]]) -> None:
        """Write the files of a unit, that of `units` last.

        Args:
            unit: Row of `units`.
            rows: Rows of the other tables by their names; a table that is not there has no file.

        """
        place = {name: unit.get(name) for name in ("unit_id", "vehicle", "day")}
        for table in reversed(TABLES):
            if table is UNITS:
                self._write(table, unit, [unit])
            elif table.name in rows:
                self._write(table, unit, [row | place for row in rows[table.name]])

    def _write(self, table: TableSchema, unit: Row, rows: Sequence[Row]) -> None:
        data = pa.Table.from_pylist(list(rows), schema=table.arrow())
        buffer = pa.BufferOutputStream()
        parquet.write_table(data, buffer, compression="zstd")
        path = self._file(table, unit["unit_id"], unit["vehicle"], unit.get("day"))
        put(self._place, path, buffer.getvalue().to_pybytes())

    def write_fingerprint(self, kept: Kept, fingerprint: str) -> None:
        """Write another fingerprint of a unit, all else of which is as it was."""
        path = self._file(UNITS, kept.unit_id, kept.vehicle, kept.day)
        (row,) = self._read(path, [column.name for column in UNITS.columns]).to_pylist()
        self._write(UNITS, row, [row | {"fingerprint": fingerprint}])

    def remove_incomplete(self, units: Collection[str], kept: Iterable[Kept]) -> int:
        """Remove what an interrupted run wrote of some units without completing them.

        Files of other units stay: another run may be writing them.

        Args:
            units: Ids of the units that are to be analysed.
            kept: Complete units of the data set.

        Returns:
            Number of files that were removed.

        """
        complete = {
            (unit.unit_id, unit.vehicle, unit.day) for unit in kept if unit.unit_id in units
        }
        removed = 0
        for table in (schema for schema in TABLES if schema is not UNITS):
            whole = {self._file(table, *place) for place in complete}
            for file in self._files(table):
                if Path(file).stem in units and file not in whole:
                    self._place.system.rm_file(file)
                    removed += 1
        return removed

    def remove(self, kept: Kept) -> None:
        """Remove the files of a unit, that of `units` first."""
        for table in TABLES:
            path = self._file(table, kept.unit_id, kept.vehicle, kept.day)
            if self._place.system.exists(path):
                self._place.system.rm_file(path)

    def _file(self, table: TableSchema, unit_id: str, vehicle: str, day: date | None) -> str:
        named = quote(vehicle, safe=" ")
        dated = NO_DAY if day is None else day.isoformat()
        folder = f"{self._place.inner.rstrip('/')}/{table.name}/vehicle={named}/day={dated}"
        return f"{folder}/{unit_id}.parquet"


def put(place: Place, path: str, data: bytes) -> None:
    """Write a file that appears whole or not at all.

    Args:
        place: Any place of the file system.
        path: Path within the file system.
        data: Content.

    """
    if not place.is_local:
        place.system.pipe_file(path, data)
        return
    final = Path(path)
    final.parent.mkdir(parents=True, exist_ok=True)
    with whole_file(final, "wb", own_name=True) as file:
        file.write(data)
