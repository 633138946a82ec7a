"""Counts in sentences."""


def counted(number: int, noun: str) -> str:
    """A number with its noun in singular or plural, as '1 vehicle' or '2 vehicles'.

    Args:
        number: Number, 0 or more.
        noun: Noun in singular, perhaps with words in front, whose plural ends in s.

    """
    return f"{number} {noun}{'' if number == 1 else 's'}"
