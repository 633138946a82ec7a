"""Counts in sentences."""

_WORDS = (
    "no",
    "one",
    "two",
    "three",
    "four",
    "five",
    "six",
    "seven",
    "eight",
    "nine",
    "ten",
    "eleven",
    "twelve",
)


def counted(number: int, noun: str) -> str:
    """A number with its noun in singular or plural, as '1 vehicle' or '2 vehicles'.

    Args:
        number: Number, 0 or more.
        noun: Noun in singular, perhaps with words in front, whose plural ends in s.

    """
    return f"{number} {noun}{'' if number == 1 else 's'}"


def in_words(number: int) -> str:
    """A number as a sentence has it: a word up to twelve, digits beyond.

    Args:
        number: Number, 0 or more.

    """
    return _WORDS[number] if number < len(_WORDS) else str(number)
