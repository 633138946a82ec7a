"""Questions of `init`; an answer that cannot be used is explained before the question is repeated.

An empty answer, and the end of the input, leave a thing open.
"""

import sys
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import TypeVar

from adhesion_can.bus.role_guess import CHOSEN, GuessedRoles, RoleGuess
from adhesion_can.bus.shared_signals import SHARED_ROLES, distribute
from adhesion_can.config.initial_file import (
    REQUIRED,
    InitialConfiguration,
    candidate_text,
    count_axles,
    shared_sentence,
    signals_text,
)
from adhesion_can.config.vehicle_section import VEHICLE_DATA, VEHICLE_EXAMPLES, vehicle_example
from adhesion_can.physics.readings import Role
from adhesion_can.physics.vehicle import MOST_AXLES
from adhesion_can.plurals import counted
from adhesion_can.printable import say

SHOWN = 20
"""Number of candidates from which one can be chosen."""
_Answer = TypeVar("_Answer")


def meaning(key: str) -> str:
    """Meaning of a value of the vehicle as one number, with usual values."""
    return f"{VEHICLE_DATA[key].partition(':')[0]}, {vehicle_example(key)}"


def ask(initial: InitialConfiguration) -> InitialConfiguration:
    """The configuration with the answers of a person."""
    guessed, declined = _ask_open(initial.guessed)
    initial = replace(initial, guessed=guessed)
    for role in REQUIRED:
        if role in initial.absent or role in declined:
            initial = replace(initial, guessed=_ask_candidates(initial, role))
    vehicle, axles = dict(initial.vehicle), count_axles(initial.guessed)
    if axles is None:
        axles = _ask_until("axles: number of the axles, such as 4 (Enter: later): ", _whole)
    for role in SHARED_ROLES:
        guessed, agreed = _ask_shared(_share_chosen(initial.guessed, axles), axles, role)
        if agreed is False and role in REQUIRED:
            # Others, or another order: what is chosen is asked for its shares again.
            guessed = _ask_candidates(replace(initial, guessed=guessed), role)
            guessed, _ = _ask_shared(_share_chosen(guessed, axles), axles, role)
        initial = replace(initial, guessed=guessed)
    for key in VEHICLE_DATA:
        if key not in vehicle:
            number = _ask_until(f"{key}: {meaning(key)} (Enter: later): ", _positive(key))
            if number is not None:
                vehicle[key] = number
    return replace(initial, axles=axles, vehicle=vehicle)


def _ask_open(guessed: GuessedRoles) -> tuple[GuessedRoles, set[Role]]:
    """The guesses with the open ones that a person decided, and the roles of a no.

    Open guesses of signals that were taken for another role are gone.
    """
    taken, open_roles = list(guessed.taken), dict(guessed.rivals)
    asked: set[str] = set()
    declined: set[Role] = set()
    for name in guessed.rivals:
        if name in asked:
            continue
        used = {guess.place for guess in taken}
        free = [rival for rival in guessed.rivals[name] if rival.place not in used]
        if not free:
            del open_roles[name]
            continue
        if len(free) > 1:
            chosen = [one for one in [_ask_rival(name, free)] if one is not None]
        else:
            series = _series(guessed, free[0], used)
            asked |= {guess.name for guess in series}
            agreed = _ask_series(series)
            chosen = series if agreed else []
            declined |= {free[0].role} if agreed is False else set()
        for guess in chosen:
            taken.append(replace(guess, doubts=()))
            open_roles.pop(guess.name, None)
    return replace(guessed, taken=tuple(taken), rivals=open_roles), declined


def _series(guessed: GuessedRoles, first: RoleGuess, used: set[str]) -> list[RoleGuess]:
    """A guess, and those of the other axles that are open for the same reason."""
    series = [
        alike[0]
        for alike in guessed.rivals.values()
        if len(alike) == 1
        and (alike[0].role, alike[0].doubts) == (first.role, first.doubts)
        and alike[0].place not in used
    ]
    return series if first in series else [first]


def _ask_rival(name: str, rivals: Sequence[RoleGuess]) -> RoleGuess | None:
    say(f"{name} may be")
    for number, rival in enumerate(rivals, start=1):
        doubts = "".join(f"; {doubt}" for doubt in rival.doubts)
        say(f"  {number}  {signals_text([rival])}{doubts}")
    chosen = _ask_until("number, or Enter for none: ", _up_to(len(rivals)))
    return None if chosen is None else rivals[chosen - 1]


def _ask_series(series: Sequence[RoleGuess]) -> bool | None:
    """Whether the signals are those of their roles, as a person says; None: later."""
    names = ", ".join(guess.name for guess in series)
    why = "; ".join(series[0].doubts)
    say(f"{names} may be {signals_text(series)}{f': {why}' if why else ''}")
    return _yes("take them, in this order" if len(series) > 1 else "take it")


def _ask_candidates(initial: InitialConfiguration, role: Role) -> GuessedRoles:
    """The guesses with the signals that a person chose for a role that was not found."""
    guessed, found = initial.guessed, initial.candidates(role)
    if not found:
        return guessed
    say(f"{role}: these signals have its unit")
    for number, one in enumerate(found[:SHOWN], start=1):
        say(f"  {number}  {candidate_text(one)}")
    if len(found) > SHOWN:
        say(f"  {len(found) - SHOWN} more are in the file")
    count = min(len(found), SHOWN)
    question = "number, or Enter for later: "
    if role.per_axle:
        question = "numbers for axles 1, 2, .. in this order, such as 2 1, or Enter for later: "
    chosen = _ask_until(question, _several(count, MOST_AXLES if role.per_axle else 1))
    guesses = [
        RoleGuess(role, axle if role.per_axle else 0, one.message, one.signal, 0, CHOSEN)
        for axle, one in enumerate((found[k - 1] for k in chosen or ()), start=1)
    ]
    places = {guess.place for guess in guesses}
    for guess in (*guessed.taken, *guessed.shared):
        if guess.place in places and guess.role is not role:
            say(f"{guess.place} is then not taken for {guess.name}")
    rivals = {
        name: left
        for name, alike in guessed.rivals.items()
        if not (guesses and alike[0].role is role)
        and (left := tuple(one for one in alike if one.place not in places))
    }
    return GuessedRoles(
        (*(one for one in guessed.taken if one.place not in places), *guesses),
        rivals,
        tuple(
            one
            for one in guessed.shared
            if one.place not in places and not (guesses and one.role is role)
        ),
    )


def _share_chosen(guessed: GuessedRoles, axles: int | None) -> GuessedRoles:
    """The guesses with chosen efforts as shared ones, where they are fewer than the axles."""
    chosen = [
        one
        for one in guessed.taken
        if one.reasons == CHOSEN and one.role is Role.TRACTIVE_EFFORT and not one.of_axle
    ]
    if not distribute(chosen, axles) or len(chosen) == axles:
        return guessed
    kept = tuple(one for one in guessed.taken if one not in chosen)
    return replace(guessed, taken=kept, shared=(*guessed.shared, *chosen))


def _ask_shared(
    guessed: GuessedRoles, axles: int | None, role: Role
) -> tuple[GuessedRoles, bool | None]:
    """The guesses with the shared signals of a role distributed after a yes, and the answer."""
    shared = guessed.shared_of(role)
    proposed = distribute(shared, axles)
    if not proposed:
        return guessed, None
    each = counted(round(1 / proposed[0].share), "axle")
    verb = "carry" if role is Role.AXLE_LOAD else "drive"
    say(f"{shared_sentence(shared, axles)}: {signals_text(shared)}")
    agreed = _yes(f"does each {verb} {each}, in this order, with equal shares")
    if agreed:
        left = tuple(one for one in guessed.shared if one.role is not role)
        guessed = replace(guessed, taken=(*guessed.taken, *proposed), shared=left)
    return guessed, agreed


# --- answers


def _ask_until(question: str, parse: Callable[[str], _Answer]) -> _Answer | None:
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


def _yes(question: str) -> bool | None:
    """Whether a person agrees; None: later."""
    return _ask_until(f"{question}? y, n, or Enter for later: ", _yes_or_no)


def _yes_or_no(answer: str) -> bool:
    if answer.lower() in ("y", "yes"):
        return True
    if answer.lower() in ("n", "no"):
        return False
    raise ValueError("neither yes nor no; type y, n, or Enter for later")


def _whole(answer: str) -> int:
    if not answer.isdecimal() or not 1 <= int(answer) <= MOST_AXLES:
        raise ValueError(f"not a whole number from 1 to {MOST_AXLES}; type for example 4")
    return int(answer)


def _up_to(most: int) -> Callable[[str], int]:
    def parse(answer: str) -> int:
        if not answer.isdecimal() or not 1 <= int(answer) <= most:
            span = f"from 1 to {most}" if most > 1 else "1"
            raise ValueError(f"not a number of the list ({span}); type for example 1")
        return int(answer)

    return parse


def _several(most: int, count: int) -> Callable[[str], list[int]]:
    def parse(answer: str) -> list[int]:
        numbers = [_up_to(most)(word) for word in answer.replace(",", " ").split()]
        if len(set(numbers)) < len(numbers):
            raise ValueError("has a number twice; type each once, for example 1 2")
        if len(numbers) > count:
            example = "1" if count == 1 else "1 2"
            most_of = "one number is" if count == 1 else f"{count} numbers are"
            raise ValueError(f"too many numbers, at most {most_of} possible; type {example}")
        return numbers

    return parse


def _positive(key: str) -> Callable[[str], float]:
    example = VEHICLE_EXAMPLES[key][0]

    def parse(answer: str) -> float:
        try:
            number = float(answer)
        except ValueError:
            raise ValueError(_not_a_number(answer, key, example)) from None
        if not 0.0 < number < float("inf"):
            raise ValueError(f"not above 0; type for example {example}")
        return number

    return parse


def _not_a_number(answer: str, key: str, example: str) -> str:
    """What is wrong with an answer that is no number, and an example."""
    unit = VEHICLE_DATA[key].partition(":")[0].rpartition(", ")[2]
    first = answer.split(maxsplit=1)[0]
    if _is_number(answer.replace(",", ".")):
        return f"has a decimal comma; type {answer.replace(',', '.')}"
    if len(answer.replace(",", " ").split()) > 1 and all(
        map(_is_number, answer.replace(",", " ").split())
    ):
        return (
            f"several numbers; type one for all axles, for example {example}; the file takes a list"
        )
    if _is_number(first):
        return f"has more than a number; type it in {unit} without the unit, for example {example}"
    return f"not a number; type one in {unit}, for example {example}"


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True


def _answer(question: str) -> str:
    """Answer of a person; '' at the end of the input."""
    say(question, end="")
    return sys.stdin.readline().strip()
