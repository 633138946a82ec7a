"""Columns of a MATLAB file, by SciPy: the vectors of one length, also those in a structure."""

from collections import Counter
from collections.abc import Iterator, Mapping
from functools import partial
from pathlib import Path

import numpy as np

from adhesion_can.errors import TableError
from adhesion_can.recordings.limited import LimitError, read_limited
from adhesion_can.recordings.limited_work import Limits
from adhesion_can.recordings.tables.columns import Column, Columns

MOST_DEPTH = 4
"""Structures within structures that are searched."""


def read_mat(path: Path) -> Columns:
    """Vectors of a file under the names of their variables or fields.

    Of vectors of several lengths those of the most frequent one are the columns.

    Raises:
        TableError: The file cannot be read, or holds no vectors.

    """
    try:
        limits = Limits.of_file(path.stat().st_size)
        (columns,) = read_limited(partial(_columns, path), limits, "scipy.io")
    except OSError as error:
        raise TableError(str(path), error.strerror or "cannot be read", "check the path") from error
    except LimitError as error:
        fix = "save it again in MATLAB, or write it as .csv or .parquet"
        raise TableError(str(path), str(error), fix) from error
    return columns


def _columns(path: Path) -> Iterator[Columns]:
    from scipy.io import loadmat
    from scipy.io.matlab import MatReadError

    try:
        document = loadmat(path, simplify_cells=True)
    except NotImplementedError as error:
        what = "a MATLAB file of version 7.3"
        raise TableError(str(path), what, "save it in MATLAB with save(.., '-v7')") from error
    except OSError as error:
        raise TableError(str(path), error.strerror or "cannot be read", "check the path") from error
    except (MatReadError, ValueError, TypeError, KeyError, IndexError) as error:
        reason = " ".join(str(error).split())[:150]
        what = f"not readable as a MATLAB file ({reason})"
        raise TableError(str(path), what, "check the file") from error
    vectors = list(_vectors(document, MOST_DEPTH))
    lengths = Counter(len(column) for _, column in vectors)
    if not lengths:
        raise TableError(str(path), "no vectors", "save the columns as vectors of one length")
    length, _ = lengths.most_common(1)[0]
    values: dict[str, Column] = {}
    for name, column in vectors:
        if len(column) == length:
            values.setdefault(name, column)
    others = sorted({name for name, column in vectors if len(column) != length})
    notes = [f"using the vectors of {length} values as columns"]
    if others:
        notes.append(f"not used, since their length differs: {', '.join(others)}")
    yield Columns(values, notes=tuple(notes))


def _vectors(document: Mapping[str, object], depth: int) -> Iterator[tuple[str, Column]]:
    """Name and values of every vector of numbers or texts."""
    for name, value in document.items():
        if name.startswith("__"):
            continue
        if isinstance(value, dict) and depth:
            yield from _vectors(value, depth - 1)
            continue
        array = np.asarray(value)
        if array.ndim != 1 or len(array) < 2:
            continue
        if array.dtype.kind in "fiub":
            yield name, array.astype(np.float64)
        elif array.dtype.kind == "U" or all(isinstance(item, str) for item in array):
            yield name, tuple(map(str, array))
