"""Times of a table's rows: seconds, dates and times of the day, and counts since 1970.

Dates are read in ISO 8601, in the European and in the American order where the numbers of a column
leave no other; without a zone they are read as UTC. Times of the day run on past midnight.
"""

import re
from collections.abc import Sequence
from dataclasses import replace
from datetime import UTC, datetime, timedelta, timezone

import numpy as np

from adhesion_can.arrays import Array
from adhesion_can.errors import TableError
from adhesion_can.recordings.tables.cells import has_no_value
from adhesion_can.recordings.tables.columns import Columns

TIME = "time_s"
TIME_LIMIT_S = 9e9
"""Limit of a time, s: beyond it, 285 years, stamps do not fit 64 bits as ns."""
FROM_S, UNTIL_S = 6.3e8, 4.1e9
"""Times since 1970 from 1990 to 2100, s: counts of another unit are recognised by being there."""
DAY_S = 86_400.0
_UNITS = {"ms": 1e-3, "us": 1e-6, "ns": 1e-9}
_CLOCK = (
    r"(?P<h>\d{1,2}):(?P<min>\d{2})(?::(?P<s>\d{2})(?:[.,](?P<f>\d{1,12}))?)?"
    r"(?:\s*(?P<half>[AaPp])\.?[Mm]\.?)?"
)
_ZONE = r"\s*(?P<zone>Z|z|UTC|GMT|[+-]\d{2}:?\d{2}(?::?\d{2})?|[+-]\d{2})?"
_DATE = (
    r"(?:(?P<year>\d{4})(?P<mark>[-/.])(?P<month>\d{1,2})(?P=mark)(?P<day>\d{1,2})"
    r"|(?P<first>\d{1,2})(?P<sign>[-/.])(?P<second>\d{1,2})(?P=sign)(?P<last>\d{4}))"
)
_STAMP = re.compile(rf"{_DATE}(?:[T ,]\s*{_CLOCK}{_ZONE})?")
_TIME_OF_DAY = re.compile(_CLOCK)
_SPAN = re.compile(
    r"(?:(?P<days>-?\d+) days?,? ?)?(?P<sign>[-+]?)(?P<h>\d+):(?P<min>\d{2}):(?P<s>\d{2})"
    r"(?:[.,](?P<f>\d{1,12}))?"
)


def with_times(columns: Columns, where: str, *, stated: bool) -> Columns:
    """Columns whose `time_s` is in seconds, also where the file has dates or counts.

    Args:
        columns: Columns under their known names.
        where: Name of the file, for errors.
        stated: Whether file or user state the unit of `time_s`.

    Raises:
        TableError: A time cannot be read, or may be read in two ways.

    """
    column = columns.values.get(TIME)
    if column is None:
        return columns
    values_and_note: tuple[Array, str]
    if isinstance(column, tuple):
        values_and_note = read_times(column, where)
    elif stated:
        return columns
    else:
        values_and_note = _of_magnitude(column, where)
    values, note = values_and_note
    if not note:
        return columns
    return replace(columns, values={**columns.values, TIME: values}, notes=(*columns.notes, note))


def read_times(cells: Sequence[str], where: str) -> tuple[Array, str]:
    """Seconds of a column of dates, times of the day or spans, and what they were read as.

    Returns:
        Seconds since 1970 for dates, of the day or of the span otherwise, NaN where a cell is
        empty, shape (n,); and a sentence.

    Raises:
        TableError: A cell is neither, or its day and month may be the other way about.

    """
    filled = [cell for cell in cells if not has_no_value(cell)]
    if filled and all(_TIME_OF_DAY.fullmatch(cell) for cell in filled):
        seconds = np.array([_of_clock(_TIME_OF_DAY.fullmatch(cell)) for cell in cells])
        return _past_midnight(seconds), "times are read as times of a day"
    if filled and all(_SPAN.fullmatch(cell) for cell in filled):
        return np.array(
            [_of_span(_SPAN.fullmatch(cell)) for cell in cells]
        ), "times are read as durations"
    stamps = [_STAMP.fullmatch(cell) for cell in cells]
    read = zip(cells, stamps, strict=True)
    odd = next((cell for cell, it in read if it is None and not has_no_value(cell)), None)
    if not filled:
        odd = next(filter(None, cells), "no values")
    if odd is not None:
        raise TableError(
            where,
            f"column {TIME!r} is not numeric: it has {odd[:40]!r}",
            "write seconds, or dates such as 2024-03-01 12:00:00.050",
        )
    day_first = _day_first([it for it in stamps if it is not None], where)
    try:
        seconds = np.array([_of_stamp(it, day_first=day_first) for it in stamps])
    except (ValueError, OverflowError) as error:
        raise TableError(where, f"column {TIME!r} has no date ({error})", "correct it") from error
    zoned = all(it is None or it["zone"] for it in stamps)
    return seconds, "times are read as dates" + ("" if zoned else "; those without a zone as UTC")


def _day_first(stamps: Sequence[re.Match[str]], where: str) -> bool:
    """Whether the day stands in front of the month, where the year comes last."""
    short = [it for it in stamps if it["first"]]
    if not short or all(it["sign"] == "." for it in short):
        return True
    first = max(int(it["first"]) for it in short)
    second = max(int(it["second"]) for it in short)
    if (first > 12) is not (second > 12):
        return first > 12
    same = all(it["first"] == it["second"] for it in short)
    if same:
        return True
    raise TableError(
        where,
        f"column {TIME!r}: {short[0].group()!r} may be day or month first",
        "write dates as 2024-03-01",
    )


def _of_stamp(it: re.Match[str] | None, *, day_first: bool) -> float:
    """Seconds since 1970."""
    if it is None:
        return np.nan
    if it["year"]:
        year, month, day = it["year"], it["month"], it["day"]
    else:
        day, month = (it["first"], it["second"]) if day_first else (it["second"], it["first"])
        year = it["last"]
    date = datetime(int(year), int(month), int(day), tzinfo=_zone(it["zone"]))
    since = date - datetime(1970, 1, 1, tzinfo=UTC)
    # The fraction apart: seconds of today have no more than seven digits behind the point.
    return since.days * DAY_S + since.seconds + (_of_clock(it) if it["h"] else 0.0)


def _zone(text: str | None) -> timezone:
    if not text or text in {"Z", "z", "UTC", "GMT"}:
        return UTC
    digits = text[1:].replace(":", "").ljust(6, "0")
    away = timedelta(hours=int(digits[:2]), minutes=int(digits[2:4]), seconds=int(digits[4:6]))
    return timezone(-away if text[0] == "-" else away)


def _of_clock(it: re.Match[str] | None) -> float:
    """Seconds since midnight."""
    if it is None:
        return np.nan
    hours = int(it["h"])
    if it["half"]:
        hours = hours % 12 + (12 if it["half"].lower() == "p" else 0)
    return hours * 3600.0 + int(it["min"]) * 60.0 + _seconds(it)


def _of_span(it: re.Match[str] | None) -> float:
    if it is None:
        return np.nan
    size = int(it["h"]) * 3600.0 + int(it["min"]) * 60.0 + _seconds(it)
    return int(it["days"] or 0) * DAY_S + (-size if it["sign"] == "-" else size)


def _seconds(it: re.Match[str]) -> float:
    return float(f"{it['s'] or 0}.{it['f'] or 0}")


def _past_midnight(seconds: Array) -> Array:
    """Times of the day that run on where the next day starts."""
    days, continued, last = 0, seconds.copy(), np.nan
    for place, second in enumerate(seconds.tolist()):
        if second - last < -DAY_S / 2:
            days += 1
        last = second if np.isfinite(second) else last
        continued[place] += days * DAY_S
    return continued


def _of_magnitude(numbers: Array, where: str) -> tuple[Array, str]:
    """Seconds of a count since 1970 whose unit its size shows; a sentence where it is no second."""
    finite = numbers[np.isfinite(numbers)]
    if not len(finite) or (size := float(np.median(np.abs(finite)))) < TIME_LIMIT_S:
        return numbers, ""
    for unit, factor in _UNITS.items():
        if FROM_S <= size * factor <= UNTIL_S:
            day = datetime.fromtimestamp(float(finite[0]) * factor, UTC).date()
            return numbers * factor, f"{TIME!r} is read as {unit} since 1970: {day}"
    raise TableError(
        where,
        f"{TIME!r} is beyond {TIME_LIMIT_S:.0e} s",
        f"state its unit: --column {TIME}={TIME},unit=ms, or us, ns",
    )
