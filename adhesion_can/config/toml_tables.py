"""Strict reading of TOML: every key must be known and every value of its type.

Dataclasses are the one listing of sections and keys. A field is a key of its class's section; a
field whose default is another dataclass of settings is a section of its own.
"""

import re
import tomllib
from collections.abc import Iterator, Mapping
from dataclasses import Field, fields, is_dataclass
from hashlib import sha256
from math import isfinite
from pathlib import Path
from types import UnionType
from typing import Annotated, Any, Literal, NamedTuple, get_args, get_origin, get_type_hints

from adhesion_can.errors import ConfigError
from adhesion_can.input_files import read_small_file
from adhesion_can.ranges import OutOfRangeError, range_of

LARGEST_FILE = 4 << 20
"""Size of a file that is read, bytes; a configuration of 64 axles has 50 KiB."""
MOST_KEY_PARTS = 32
"""Most dots in a key."""
LONGEST_SHOWN = 60
"""Most characters of a value in an error."""
MOST_TABLES = 10_000
"""Most tables of one name in a file."""
_QUOTED = re.compile(r"""\"(?:[^\"\\]|\\.)*\"|'[^']*'""")
_INTEGERS = "write integers from -2**63 to 2**63 - 1, or a number with a point"


class TomlFile(NamedTuple):
    """Content of a TOML file.

    Attributes:
        document: Tables and values by key.
        sha256: SHA-256 of the file's bytes, hex.

    """

    document: dict[str, Any]
    sha256: str


def load_toml(path: Path) -> TomlFile:
    """Content of a TOML file.

    Raises:
        ConfigError: The file cannot be read, or is not TOML.

    """
    content = read_small_file(path, LARGEST_FILE, kind=ConfigError)
    try:
        text = content.decode("utf-8")
        _require_short_keys(text, str(path))
        document = tomllib.loads(text)
    except RecursionError as error:
        raise ConfigError(
            str(path), "values nested too deeply", "lists may be nested two deep at most"
        ) from error
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise ConfigError(
            str(path), f"not TOML ({error})", "correct the line that is named"
        ) from error
    except ValueError as error:  # Python reads no integer of so many digits
        raise ConfigError(str(path), f"not TOML ({error})", _INTEGERS) from error
    _require_integers(document, str(path))
    return TomlFile(document, sha256(content).hexdigest())


def _require_short_keys(text: str, where: str) -> None:
    """ConfigError where a key has many parts: tomllib's time grows with their square."""
    for line in text.split("\n"):
        if line.count(".") <= MOST_KEY_PARTS:
            continue
        bare, _, _ = _QUOTED.sub("_", line).partition("#")
        # Of what stands between commas and brackets only a key has more than one dot.
        for piece in re.split(r"[,{}\[\]]", bare):
            if piece.count(".") > MOST_KEY_PARTS:
                raise ConfigError(
                    f"{where}: {piece.strip()[:20]}..",
                    f"a key of more than {MOST_KEY_PARTS} parts",
                    "no key has more than three",
                )


def _require_integers(document: dict[str, Any], where: str) -> None:
    """ConfigError where an integer has more than the 64 bits that TOML gives it."""
    waiting: list[tuple[str, Any]] = list(document.items())
    while waiting:
        key, value = waiting.pop()
        if isinstance(value, dict):
            waiting += [(f"{key}.{name}", inner) for name, inner in value.items()]
        elif isinstance(value, list):
            waiting += [(key, inner) for inner in value]
        elif isinstance(value, int) and not -(1 << 63) <= value < 1 << 63:
            raise ConfigError(f"{where}: {key}", "an integer of more than 64 bits", _INTEGERS)


def table_of(value: object, where: str) -> dict[str, Any]:
    """Copy of a TOML table; ConfigError where the value is not a table."""
    if not isinstance(value, dict):
        raise ConfigError(where, "not a table", "write it as [section] with keys below")
    return dict(value)


def reject_unknown_keys(table: Mapping[str, Any], where: str, known: tuple[str, ...]) -> None:
    """Raise an error for keys that a table must not have.

    Args:
        table: Keys and values of a table; those that were read may be gone.
        where: File and section, for errors.
        known: Known keys.

    Raises:
        ConfigError: A key is unknown.

    """
    key = next((key for key in table if key not in known), None)
    if key is not None:
        dot = "." if ": " in where else ": "
        raise ConfigError(f"{where}{dot}{key}", "unknown key", f"known: {', '.join(known)}")


# ------------------------------------------------------------------------- tables as dataclasses


def arguments_from(
    kind: type, table: Mapping[str, Any], where: str, names: Mapping[str, str]
) -> dict[str, Any]:
    """Arguments of a dataclass from a table, each value checked against the type of its field.

    Args:
        kind: Dataclass.
        table: TOML table.
        where: File and section, for errors.
        names: Field name of each key that the table may have.

    """
    hints = get_type_hints(kind, include_extras=True)
    arguments: dict[str, Any] = {}
    for key, value in table.items():
        if key not in names:
            raise ConfigError(f"{where}.{key}", "unknown key", f"known: {', '.join(names)}")
        arguments[names[key]] = typed(value, hints[names[key]], f"{where}.{key}")
    return arguments


def section(kind: type, value: object, where: str, **others: Any) -> Any:
    """Dataclass from a table whose keys are its fields.

    Args:
        kind: Dataclass.
        value: TOML table.
        where: File and section, for errors.
        others: Values of the fields that are not keys of the table.

    """
    names = {key: key for key in section_keys(kind)}
    arguments = arguments_from(kind, table_of(value, where), where, names)
    try:
        return kind(**arguments, **others)
    except ValueError as error:
        raise ConfigError(where, str(error), "correct the value") from error


def section_with(kind: type, value: object, where: str, required: tuple[str, ...]) -> Any:
    """Dataclass from a table in which some keys must stand, whatever their defaults.

    Args:
        kind: Dataclass.
        value: TOML table.
        where: File and section, for errors.
        required: Keys that the table must have.

    """
    table = table_of(value, where)
    for key in required:
        if key not in table:
            raise ConfigError(f"{where}.{key}", "missing", "write it")
    return section(kind, table, where)


def array_of_tables(value: object, where: str, key: str) -> Iterator[tuple[dict[str, Any], str]]:
    """Tables of an array of tables, each with its place for errors: `effect[2]`.

    Args:
        value: TOML value under the key.
        where: File, for errors.
        key: Name of the tables.

    """
    if not isinstance(value, list):
        raise ConfigError(f"{where}: {key}", "not a list of tables", f"write [[{key}]] for each")
    if len(value) > MOST_TABLES:
        raise ConfigError(f"{where}: {key}", f"more than {MOST_TABLES} tables", "write fewer")
    for number, table in enumerate(value, start=1):
        place = f"{where}: {key}[{number}]"
        yield table_of(table, place), place


def section_keys(kind: type) -> tuple[str, ...]:
    """Keys of the section that a dataclass describes: its fields that hold plain values."""
    return tuple(
        f.name for f in fields(kind) if not nested_class(f) and f.metadata.get("toml", True)
    )


def nested_class(field: Field[Any]) -> type | None:
    """Class of the settings that a field holds; None: the field is a value."""
    factory: Any = field.default_factory
    return factory if isinstance(factory, type) and is_dataclass(factory) else None


def nested_sections(kind: type) -> Iterator[tuple[str, type]]:
    """Section name and class of all settings within a dataclass, in the order of their fields.

    A class without keys of its own is no section: it only holds others.
    """
    for field in fields(kind):
        inner = nested_class(field)
        if inner is None:
            continue
        if section_keys(inner):
            yield field.name, inner
        yield from nested_sections(inner)


def nested_settings(kind: type, tables: Mapping[str, object], where: str) -> dict[str, Any]:
    """Values of those fields of a dataclass that hold settings, each from its section.

    Args:
        kind: Dataclass.
        tables: TOML tables by section name; a section that is missing has its defaults.
        where: File, for errors.

    """
    return {
        field.name: section(
            inner,
            tables.get(field.name, {}),
            f"{where}: {field.name}",
            **nested_settings(inner, tables, where),
        )
        for field in fields(kind)
        if (inner := nested_class(field)) is not None
    }


# ----------------------------------------------------------------------------------------- values


def typed(value: Any, wanted: Any, where: str) -> Any:
    """TOML value as the type of a field; ConfigError where it is of another type or out of range.

    Args:
        value: Value as TOML gives it.
        wanted: Type of the field, with its range where it has one.
        where: File, section and key, for errors.

    """
    origin = get_origin(wanted)
    if origin in {Annotated, UnionType}:
        result = typed(value, get_args(wanted)[0], where)
        _require_in_range(result, wanted, where)
        return result
    if origin is Literal:
        if value not in get_args(wanted):
            raise ConfigError(where, _shown(value), f"write one of {', '.join(get_args(wanted))}")
        return value
    if origin is tuple:
        kinds = get_args(wanted)
        if not isinstance(value, list):
            raise ConfigError(where, f"{_shown(value)} is not a list", "write [a, b, ..]")
        if kinds[-1] is not Ellipsis and len(value) != len(kinds):
            raise ConfigError(where, f"{len(value)} values", f"write {len(kinds)}")
        return tuple(typed(item, kinds[0], where) for item in value)
    good = isinstance(value, wanted) or (wanted is float and isinstance(value, int))
    if not good or isinstance(value, bool) is not (wanted is bool):
        raise ConfigError(where, f"{_shown(value)} is not a {_NAMES[wanted]}", "correct the value")
    result = wanted(value)
    if wanted is float and not isfinite(result):
        raise ConfigError(where, f"{result} is not a finite number", "correct the value")
    return result


def _require_in_range(value: Any, wanted: Any, where: str) -> None:
    """ConfigError where a value is beyond the range that its type states."""
    try:
        range_of(wanted).require(where, value)
    except OutOfRangeError as error:
        raise ConfigError(where, error.what, error.fix) from error


def _shown(value: object) -> str:
    """A value for an error, cut where it is long."""
    text = repr(value)
    return text if len(text) <= LONGEST_SHOWN else f"{text[:LONGEST_SHOWN]}.."


_NAMES: Mapping[type, str] = {float: "number", int: "whole number", str: "text", bool: "boolean"}
