"""Ranges of settings, stated with the type of a field: `Annotated[int, Within(64, 4096)]`.

The configuration file, constructors and the reference of all keys read them, so that a range is
written once.
"""

from dataclasses import dataclass, fields
from functools import cache
from types import UnionType
from typing import Annotated, Any, get_args, get_origin, get_type_hints


@dataclass(frozen=True, slots=True)
class Within:
    """Range of a number, or of every number of a list.

    Attributes:
        lowest: Smallest value.
        highest: Largest value.

    """

    lowest: float
    highest: float

    def __contains__(self, value: float) -> bool:
        return self.lowest <= value <= self.highest

    def __str__(self) -> str:
        return f"{shown(self.lowest)} .. {shown(self.highest)}"


@dataclass(frozen=True, slots=True)
class Length:
    """Range of the number of values in a list.

    Attributes:
        least: Smallest number of values.
        most: Largest number of values.

    """

    least: int
    most: int


class OutOfRangeError(ValueError):
    """A value beyond its range.

    Args:
        sentence: Sentence that names the value and its range.
        what: What is wrong with it, without its name.
        fix: What to write instead.

    """

    def __init__(self, sentence: str, what: str, fix: str) -> None:
        super().__init__(sentence)
        self.what = what
        self.fix = fix


@dataclass(frozen=True, slots=True)
class Range:
    """Everything that is stated about the range of a field.

    Attributes:
        each: Range of each place of a list of fixed length, or one for all; () where none is
            stated.
        length: Range of the number of values; None where the type fixes it.

    """

    each: tuple[Within, ...] = ()
    length: Length | None = None

    def require(self, name: str, value: Any) -> None:
        """OutOfRangeError where a number, or a list of numbers, is beyond the range.

        Args:
            name: Name of the value, for the error.
            value: Number or tuple of numbers; None has no range.

        """
        if value is None:
            return
        values = value if isinstance(value, tuple) else (value,)
        length = self.length
        if length and not length.least <= len(values) <= length.most:
            bounds = f"{length.least} to {length.most}"
            sentence = f"{name} must have {bounds} values, not {len(values)}"
            raise OutOfRangeError(sentence, f"{len(values)} values", f"write {bounds}")
        each = self.each * len(values) if len(self.each) == 1 else self.each
        for number, within in zip(values, each, strict=bool(each)):
            if number not in within:
                sentence = f"{name} must be within {within}, not {shown(number)}"
                fix = f"write {shown(within.lowest)} to {shown(within.highest)}"
                raise OutOfRangeError(sentence, f"{shown(number)} is not within {within}", fix)

    def __str__(self) -> str:
        text = ", ".join(map(str, self.each))
        if self.length is None:
            return text
        count = f"{self.length.least} to {self.length.most} values"
        return f"{text}; {count}" if text else count


def shown(number: float) -> str:
    """A number with all its digits that matter."""
    if isinstance(number, int):
        return str(number)
    short = f"{number:g}"
    return short if float(short) == number else f"{number:.12g}"


def range_of(annotation: Any) -> Range:
    """Range that an annotation states, within 'or None' as well."""
    if get_origin(annotation) is UnionType:
        return range_of(get_args(annotation)[0])
    if get_origin(annotation) is not Annotated:
        return Range()
    stated = annotation.__metadata__
    length = next((limit for limit in stated if isinstance(limit, Length)), None)
    return Range(tuple(limit for limit in stated if isinstance(limit, Within)), length)


@cache
def ranges_of(kind: type) -> dict[str, Range]:
    """Ranges of a dataclass's fields by name, of those that have one."""
    hints = get_type_hints(kind, include_extras=True)
    ranges = {field.name: range_of(hints[field.name]) for field in fields(kind)}
    return {name: field_range for name, field_range in ranges.items() if field_range != Range()}


def require_ranges(settings: object) -> None:
    """OutOfRangeError where a field of a dataclass is beyond its range."""
    kind: type = type(settings)
    for name, field_range in ranges_of(kind).items():
        field_range.require(name, getattr(settings, name))
