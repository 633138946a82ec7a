"""Questions of `init`; an answer that cannot be used is explained before the question is repeated.

An empty answer, and the end of the input, leave a thing open.
"""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from adhesion_can.bus.role_guess import CHOSEN, GuessedRoles, RoleGuess
from adhesion_can.bus.shared_signals import SHARED_ROLES, distribute
from adhesion_can.cli.init_answers import ask_until, ask_yes, several, up_to, whole
from adhesion_can.cli.init_numbers import ask_cycles, ask_vehicle
from adhesion_can.config.initial_file import (
    InitialConfiguration,
    candidate_text,
    count_axles,
    shared_sentence,
    signals_text,
)
from adhesion_can.physics.readings import REQUIRED, Role
from adhesion_can.physics.vehicle import MOST_AXLES
from adhesion_can.plurals import counted
from adhesion_can.printable import say

SHOWN = 20
"""Number of candidates from which one can be chosen."""


def ask(initial: InitialConfiguration) -> InitialConfiguration:
    """The configuration with the answers of a person."""
    guessed, declined = _ask_open(initial.guessed)
    initial = replace(initial, guessed=guessed)
    for role in (role for role in Role if role in REQUIRED):
        if role in initial.absent or role in declined:
            initial = replace(initial, guessed=_ask_candidates(initial, role))
    axles = count_axles(initial.guessed)
    if axles is None:
        axles = ask_until("axles: number of the axles, such as 4 (Enter: later): ", whole)
    for role in SHARED_ROLES:
        guessed, agreed = _ask_shared(_share_chosen(initial.guessed, axles), axles, role)
        if agreed is False and role in REQUIRED:
            # Others, or another order: what is chosen is asked for its shares again.
            guessed = _ask_candidates(replace(initial, guessed=guessed), role)
            guessed, _ = _ask_shared(_share_chosen(guessed, axles), axles, role)
        initial = replace(initial, guessed=guessed)
    initial = replace(initial, axles=axles, vehicle=ask_vehicle(initial.vehicle, axles))
    return replace(initial, cycles=ask_cycles(initial))


def ask_second_file(path: Path) -> bool:
    """Whether the file for `simulate` is to be written, too."""
    say("'simulate' moves every axle separately, so it needs one axle of each motor")
    return ask_yes(f"write {path} for it, with the first axle of each") is True


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
            rival = _ask_rival(name, free)
            chosen = [] if rival is None else [rival]
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
    chosen = ask_until("number, or Enter for none: ", up_to(len(rivals)))
    return None if chosen is None else rivals[chosen - 1]


def _ask_series(series: Sequence[RoleGuess]) -> bool | None:
    """Whether the signals are those of their roles, as a person says; None: later."""
    names = ", ".join(guess.name for guess in series)
    why = "; ".join(series[0].doubts)
    say(f"{names} may be {signals_text(series)}{f': {why}' if why else ''}")
    return ask_yes("take them, in this order" if len(series) > 1 else "take it")


def _ask_candidates(initial: InitialConfiguration, role: Role) -> GuessedRoles:
    """The guesses with the signals that a person chose for a role that was not found."""
    guessed, candidates = initial.guessed, initial.candidates(role)
    if not candidates:
        return guessed
    say(f"{role}: these signals have its unit")
    for number, candidate in enumerate(candidates[:SHOWN], start=1):
        say(f"  {number}  {candidate_text(candidate)}")
    if len(candidates) > SHOWN:
        say(f"  {len(candidates) - SHOWN} more are in the file")
    count = min(len(candidates), SHOWN)
    question = "number, or Enter for later: "
    if role.per_axle:
        question = "numbers for axles 1, 2, .. in this order, such as 2 1, or Enter for later: "
    chosen = ask_until(question, several(count, MOST_AXLES if role.per_axle else 1))
    guesses = [
        RoleGuess(role, axle if role.per_axle else 0, taken.message, taken.signal, 0, CHOSEN)
        for axle, taken in enumerate((candidates[k - 1] for k in chosen or ()), start=1)
    ]
    places = {guess.place for guess in guesses}
    for guess in (*guessed.taken, *guessed.shared):
        if guess.place in places and guess.role is not role:
            say(f"{guess.place} is then not taken for {guess.name}")
    rivals = {
        name: left
        for name, alike in guessed.rivals.items()
        if not (guesses and alike[0].role is role)
        and (left := tuple(guess for guess in alike if guess.place not in places))
    }
    return GuessedRoles(
        (*(guess for guess in guessed.taken if guess.place not in places), *guesses),
        rivals,
        tuple(
            guess
            for guess in guessed.shared
            if guess.place not in places and not (guesses and guess.role is role)
        ),
    )


def _share_chosen(guessed: GuessedRoles, axles: int | None) -> GuessedRoles:
    """The guesses with chosen efforts as shared ones, where they are fewer than the axles."""
    chosen = [
        guess
        for guess in guessed.taken
        if guess.reasons == CHOSEN and guess.role is Role.TRACTIVE_EFFORT and not guess.of_axle
    ]
    if not distribute(chosen, axles) or len(chosen) == axles:
        return guessed
    kept = tuple(guess for guess in guessed.taken if guess not in chosen)
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
    agreed = ask_yes(f"does each {verb} {each}, in this order, with equal shares")
    if agreed:
        left = tuple(guess for guess in guessed.shared if guess.role is not role)
        guessed = replace(guessed, taken=(*guessed.taken, *proposed), shared=left)
    return guessed, agreed
