"""A strict reader of TOML tables: every key is known, every value of its type, or an error."""

from collections.abc import Mapping
from dataclasses import fields
from math import isfinite
from types import UnionType
from typing import Any, Literal, get_args, get_origin, get_type_hints

from adhesion_can.errors import ConfigError


def table_of(value: object, where: str) -> dict[str, Any]:
    """A copy of a TOML table; ConfigError where the value is none."""
    if not isinstance(value, dict):
        raise ConfigError(where, "not a table", "write it as [section] with keys below")
    return dict(value)


def no_more(rest: Mapping[str, Any], where: str, known: tuple[str, ...]) -> None:
    """ConfigError where keys are left that nobody took."""
    if rest:
        key = next(iter(rest))
        dot = "." if ": " in where else ": "
        raise ConfigError(f"{where}{dot}{key}", "unknown key", f"known: {', '.join(known)}")


def section(kind: type, value: object, where: str) -> Any:
    """A frozen dataclass from a table whose keys are its fields."""
    table = table_of(value, where)
    hints = get_type_hints(kind)
    names = tuple(f.name for f in fields(kind))
    arguments: dict[str, Any] = {}
    for key, given in table.items():
        if key not in names:
            raise ConfigError(f"{where}.{key}", "unknown key", f"known: {', '.join(names)}")
        arguments[key] = typed(given, hints[key], f"{where}.{key}")
    try:
        return kind(**arguments)
    except ValueError as error:
        raise ConfigError(where, str(error), "mend the value") from error


def typed(value: Any, wanted: Any, where: str) -> Any:
    """A TOML value as the type of a field."""
    origin = get_origin(wanted)
    if origin is UnionType:
        return typed(value, get_args(wanted)[0], where)
    if origin is Literal:
        if value not in get_args(wanted):
            raise ConfigError(where, f"{value!r}", f"write one of {', '.join(get_args(wanted))}")
        return value
    if origin is tuple:
        kinds = get_args(wanted)
        if not isinstance(value, list):
            raise ConfigError(where, f"{value!r} is not a list", "write [a, b, ..]")
        if kinds[-1] is not Ellipsis and len(value) != len(kinds):
            raise ConfigError(where, f"{len(value)} values", f"write {len(kinds)}")
        return tuple(typed(item, kinds[0], where) for item in value)
    good = isinstance(value, wanted) or (wanted is float and isinstance(value, int))
    if not good or isinstance(value, bool) is not (wanted is bool):
        raise ConfigError(where, f"{value!r} is not a {_NAMES[wanted]}", "mend the value")
    try:
        result = wanted(value)
    except OverflowError as error:
        raise ConfigError(where, "beyond all numbers", "mend the value") from error
    if wanted is float and not isfinite(result):
        raise ConfigError(where, f"{result} is not a finite number", "mend the value")
    return result


_NAMES: Mapping[type, str] = {float: "number", int: "whole number", str: "text", bool: "boolean"}
