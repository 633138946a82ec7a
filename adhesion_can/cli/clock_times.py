"""Times as people type them: 90, 1:30 and 1:01:30, with a sign where they count from now."""

from math import isfinite

from adhesion_can.errors import InputError

FIX = "give seconds or minutes:seconds, as 120, 2:00 or +10"


def typed_time(text: str, what: str) -> tuple[float, bool]:
    """Time that was typed, s, and whether it has a sign.

    Args:
        text: Seconds, minutes:seconds or hours:minutes:seconds, perhaps with + or - in front.
        what: What asks for it, for the error.

    Raises:
        InputError: It is not a time.

    """
    bare = text.strip()
    sign = bare[:1] if bare[:1] in ("+", "-") else ""
    parts = bare.removeprefix(sign).split(":")
    try:
        numbers = [float(part) for part in parts]
    except ValueError:
        numbers = []
    whole = all(number.is_integer() for number in numbers[:-1])
    below = all(number < 60 for number in numbers[1:])
    if not (
        1 <= len(numbers) <= 3
        and all(isfinite(number) and number >= 0 for number in numbers)
        and whole
        and below
    ):
        raise InputError(f"{what} {text!r}", "is not a time", FIX)
    seconds = 0.0
    for number in numbers:
        seconds = 60.0 * seconds + number
    return (-seconds if sign == "-" else seconds), bool(sign)
