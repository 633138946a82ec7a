"""Numbers of axles where names count otherwise: from 0, by letters, or again in each bogie.

Such a number is an assumption: its guesses carry a doubt, or become rivals, and are asked.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace

from cantools.database.can import Message

from adhesion_can.bus.role_guess import RoleGuess
from adhesion_can.bus.role_words import split_name
from adhesion_can.physics.readings import PER_AXLE, Role

LETTER_DOUBT = "letters A, B, .. counted as 1, 2, .."


def find_letters(messages: Iterable[Message]) -> Mapping[tuple[str, str], int]:
    """Numbers of the signals whose names differ in a letter alone: A, B, .. as 1, 2, ..

    Args:
        messages: Messages of a database.

    Returns:
        The number by names of message and signal; signals without such a letter are not in it.

    """
    series: dict[tuple[str, ...], dict[int, list[tuple[str, str]]]] = {}
    for message in messages:
        for signal in message.signals:
            parts = split_name(signal.name)
            if parts.letter is None:
                continue
            stem = tuple("?" if len(word) == 1 and word in "abcdefgh" else word
                         for word in parts.words)  # fmt: skip
            by_letter = series.setdefault(stem, {})
            by_letter.setdefault(parts.letter, []).append((message.name, signal.name))
    return {
        place: letter
        for by_letter in series.values()
        if len(by_letter) > 1 and sorted(by_letter) == list(range(1, len(by_letter) + 1))
        for letter, places in by_letter.items()
        for place in places
    }


def count_from_zero(guesses: Sequence[RoleGuess]) -> list[RoleGuess]:
    """Guesses of the axles one higher, for roles of which a signal has the number 0.

    Whether 0 is the first axle or something else is not known: the signals become rivals.
    """
    roles = {guess.role for guess in guesses if guess.role in PER_AXLE and not guess.axle}
    return [replace(guess, axle=guess.axle + 1) for guess in guesses if guess.role in roles]


def count_through_bogies(guesses: Sequence[RoleGuess]) -> list[RoleGuess]:
    """Guesses with the axles counted through, where every bogie counts its own from 1 on."""
    counted: list[RoleGuess] = []
    for role in (role for role in Role if role in PER_AXLE):
        role_guesses = [guess for guess in guesses if guess.role is role]
        by_bogie: dict[int, set[int]] = {}
        for guess in role_guesses:
            if guess.bogie is not None and guess.of_axle:
                by_bogie.setdefault(guess.bogie, set()).add(guess.axle)
        axles = next(iter(by_bogie.values()), set())
        each = len(axles)
        again = (
            sorted(by_bogie) == list(range(1, len(by_bogie) + 1))
            and len(by_bogie) > 1
            and axles == set(range(1, each + 1))
            and all(others == axles for others in by_bogie.values())
        )
        doubt = f"bogies counted one after the other, with {each} axles each"
        for guess in role_guesses:
            if again and guess.bogie is not None and guess.of_axle:
                axle = (guess.bogie - 1) * each + guess.axle
                counted.append(replace(guess, axle=axle, doubts=(*guess.doubts, doubt)))
            else:
                counted.append(guess)
    return counted + [guess for guess in guesses if guess.role not in PER_AXLE]


def without_unnumbered(guesses: Sequence[RoleGuess]) -> list[RoleGuess]:
    """Guesses without those that have no number, unless one is the only guess of its role."""
    of_role = {guess.role: 0 for guess in guesses}
    for guess in guesses:
        of_role[guess.role] += 1
    return [
        guess
        for guess in guesses
        if guess.numbered or guess.role not in PER_AXLE or of_role[guess.role] == 1
    ]
