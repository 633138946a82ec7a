"""Typed answers: read, and repeated with what is wrong until one can be used."""

import sys
from collections.abc import Callable
from typing import TypeVar

from adhesion_can.physics.vehicle import MOST_AXLES
from adhesion_can.printable import say

_Answer = TypeVar("_Answer")


def ask_until(question: str, parse: Callable[[str], _Answer]) -> _Answer | None:
    """An answer that can be used; None where it is empty. Each other one is explained.

    Args:
        question: Text in front of the answer.
        parse: Value of an answer; raises ValueError with what is wrong and an example.

    """
    while answer := _answer(question):
        try:
            return parse(answer)
        except ValueError as error:
            say(f"{answer[:40]!r}: {error}")
    return None


def ask_yes(question: str) -> bool | None:
    """Whether a person agrees; None: later."""
    return ask_until(f"{question}? y, n, or Enter for later: ", _yes_or_no)


def _yes_or_no(answer: str) -> bool:
    if answer.lower() in ("y", "yes"):
        return True
    if answer.lower() in ("n", "no"):
        return False
    raise ValueError("neither yes nor no; type y, n, or Enter for later")


def whole(answer: str) -> int:
    """Number of axles; ValueError where it is none."""
    if not answer.isdecimal() or not 1 <= int(answer) <= MOST_AXLES:
        raise ValueError(f"not a whole number from 1 to {MOST_AXLES}; type for example 4")
    return int(answer)


def up_to(most: int) -> Callable[[str], int]:
    """Parser of a number of a list of that length, from 1."""

    def parse(answer: str) -> int:
        if not answer.isdecimal() or not 1 <= int(answer) <= most:
            span = f"from 1 to {most}" if most > 1 else "1"
            raise ValueError(f"not a number of the list ({span}); type for example 1")
        return int(answer)

    return parse


def several(most: int, count: int) -> Callable[[str], list[int]]:
    """Parser of at most `count` different numbers of a list of the length `most`."""

    def parse(answer: str) -> list[int]:
        numbers = [up_to(most)(word) for word in answer.replace(",", " ").split()]
        if len(set(numbers)) < len(numbers):
            raise ValueError("has a number twice; type each once, for example 1 2")
        if len(numbers) > count:
            example = "1" if count == 1 else "1 2"
            most_of = "one number is" if count == 1 else f"{count} numbers are"
            raise ValueError(f"too many numbers, at most {most_of} possible; type {example}")
        return numbers

    return parse


def _answer(question: str) -> str:
    """Answer of a person; '' at the end of the input."""
    say(question, end="")
    return sys.stdin.readline().strip()
