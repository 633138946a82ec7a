"""Roles of a database's signals, guessed from names, units and message names.

A wrong guess costs more than none: two signals that fit a role about equally well are rivals, and
neither is taken.
"""

from collections.abc import Collection, Iterable, Sequence
from collections.abc import Set as AbstractSet
from dataclasses import replace
from typing import NamedTuple

from cantools.database.can import Message, Signal

from adhesion_can.bus.axle_numbers import (
    LETTER_DOUBT,
    count_from_zero,
    count_through_bogies,
    find_letters,
    without_unnumbered,
)
from adhesion_can.bus.role_guess import GuessedRoles, RoleGuess
from adhesion_can.bus.role_specs import ROLE_SPECS, to_si
from adhesion_can.bus.role_words import (
    AGAINST,
    AXLE_MESSAGES,
    FORCES,
    GROUPS,
    ONE_WHEEL,
    PLAIN,
    SIDES,
    SPEED,
    VEHICLE_WHOLE,
    WHEEL,
    bogie_number,
    counts_axles,
    split_words,
)
from adhesion_can.bus.shared_signals import find_shared
from adhesion_can.bus.signal_columns import find_obstacle
from adhesion_can.bus.signal_signs import Signs, signs_of
from adhesion_can.bus.units import find_factor
from adhesion_can.physics.readings import PER_AXLE, SPEED_AIDS, Role
from adhesion_can.physics.vehicle import MOST_AXLES

LEAST_SCORE = 3
"""Score from which a signal is a candidate: a name that fits, and nothing against it."""
CLEAR_LEAD = 1
"""Lead over the next candidate with which the better one is taken."""
WHEEL_LOAD_DOUBT = "the load of one wheel by its name, taken twice for the axle"
FORCE_DOUBT = "a force that cannot be negative is an effort or a load"
_FORCES_ON_AXLES = (Role.TRACTIVE_EFFORT, Role.AXLE_LOAD)


def guess_roles(messages: Iterable[Message]) -> GuessedRoles:
    """Roles of the signals of these messages.

    Args:
        messages: Messages of a database, in cantools' form.

    """
    messages = list(messages)
    letters = find_letters(messages)
    guesses = [
        guess
        for message in messages
        for signal in message.signals
        for guess in _clearer(
            list(_guesses(message, signal, letters.get((message.name, signal.name))))
        )
    ]
    guesses = count_through_bogies(without_unnumbered(guesses))
    by_role: dict[str, list[RoleGuess]] = {}
    for guess in (*guesses, *count_from_zero(guesses)):
        if guess.axle or guess.role not in PER_AXLE:
            by_role.setdefault(guess.name, []).append(guess)
    taken: list[RoleGuess] = []
    rivals: dict[str, tuple[RoleGuess, ...]] = {}
    for name, alike in by_role.items():
        alike.sort(key=lambda guess: (-guess.score, guess.place))
        best = [g for g in alike if g.score > alike[0].score - CLEAR_LEAD]
        if len(best) == 1:
            taken.append(best[0])
        else:
            rivals[name] = tuple(best)
    _leave_out_doubles(taken, rivals)
    shared = find_shared(taken, rivals)
    for guess in taken:
        if guess.doubts and guess not in shared:
            rivals[guess.name] = (guess,)
    kept = sorted((g for g in taken if g not in shared and not g.doubts), key=_order)
    in_order = sorted(rivals.items(), key=lambda item: _order(item[1][0]))
    return GuessedRoles(tuple(kept), dict(in_order), shared)


def _clearer(guesses: list[RoleGuess]) -> list[RoleGuess]:
    """Guesses of a signal, of an effort and a load the one that its name and range fit better."""
    forces = [guess for guess in guesses if guess.role in _FORCES_ON_AXLES]
    best = max((guess.score for guess in forces), default=0)
    return [g for g in guesses if g not in forces or g.score > best - CLEAR_LEAD]


def _leave_out_doubles(taken: list[RoleGuess], rivals: dict[str, tuple[RoleGuess, ...]]) -> None:
    """A signal that fits two roles is taken for neither."""
    uses: dict[str, list[RoleGuess]] = {}
    for guess in (*taken, *(rival for alike in rivals.values() for rival in alike)):
        uses.setdefault(guess.place, []).append(guess)
    for guess in [taken_guess for taken_guess in taken if len(uses[taken_guess.place]) > 1]:
        # Another role by its name alone: the doubt is that of a series of axles.
        others = " or ".join(
            use.name if use.role is guess.role else str(use.role)
            for use in uses[guess.place]
            if use.name != guess.name
        )
        taken.remove(guess)
        rivals[guess.name] = (replace(guess, doubts=(*guess.doubts, f"also fits {others}")),)


def _order(guess: RoleGuess) -> tuple[int, int]:
    return list(Role).index(guess.role), guess.axle


class _Place(NamedTuple):
    """What the names of a signal say about the axle that it belongs to.

    Attributes:
        axle: Number of the axle; None: they have none.
        of_axle: Whether the number follows a word for an axle.
        group: Motor, bogie or inverter by its English name; '' where they name none.
        bogie: Number of the bogie; None: they have none.
        doubts: What has to be asked about the number, a clause each.

    """

    axle: int | None
    of_axle: bool
    group: str
    bogie: int | None
    doubts: tuple[str, ...]

    @property
    def is_numbered(self) -> bool:
        return self.axle is not None and self.axle <= MOST_AXLES

    def excludes(self, role: Role, words: Collection[str]) -> bool:
        """Whether a role needs a number that the names do not have."""
        if role not in PER_AXLE or self.is_numbered:
            return False
        if self.axle is not None or set(words) & (WHEEL | SIDES):
            return True
        # An effort without a number may be that of all axles, and so may the load of a bogie.
        return not (
            role is Role.TRACTIVE_EFFORT or (role is Role.AXLE_LOAD and self.group == "bogie")
        )


def _place(message: Message, signal: Signal, letter: int | None) -> _Place:
    words, number = split_words(signal.name)
    around, around_number = split_words(message.name)
    signal_words = set(words)
    doubts: tuple[str, ...] = ()
    axle = None if signal_words & SIDES else number  # a wheel of a side is no axle
    by_message = number is None and letter is None
    if by_message and set(around) & (AXLE_MESSAGES | GROUPS.keys()):
        axle = around_number
    elif number is None and letter is not None and not signal_words & SIDES:
        axle, doubts = letter, (LETTER_DOUBT,)
    group = next((GROUPS[word] for word in (*words, *around) if word in GROUPS), "")
    of_axle = (
        counts_axles(signal.name)
        or (by_message and counts_axles(message.name))
        or (number is not None and not group and bool(signal_words & (WHEEL - ONE_WHEEL)))
    )
    bogie = bogie_number(signal.name) or bogie_number(message.name)
    return _Place(axle, of_axle, group, bogie, doubts)


def _guesses(message: Message, signal: Signal, letter: int | None) -> Iterable[RoleGuess]:
    """Roles that a signal fits, each with its score."""
    words, number = split_words(signal.name)
    around = split_words(message.name)[0]
    if find_obstacle(signal, message):
        return
    place = _place(message, signal, letter)
    for role in (role for role in Role if role is not Role.CHANNEL and role not in SPEED_AIDS):
        # A motor or a bogie has an effort that counts; its speed and its load are other quantities.
        against = AGAINST - GROUPS.keys() if role is Role.TRACTIVE_EFFORT else AGAINST
        if set(words) & against or place.excludes(role, words):
            continue
        named, kind = _named(role, words, around), _kind(role, signal)
        if role is Role.WHEEL_SPEED and not named:
            named = _named_by_wheel(signal, words)
        signs = _points_of_signs(role, signal, set(words))
        doubtful = 2 if set(around) & against else 0
        if role is Role.TRACTIVE_EFFORT and place.group and not place.of_axle:
            doubtful += 1  # less likely an axle's than a signal that names axles
        # One of several vehicle speeds is less likely the one.
        several = 1 if role is Role.VEHICLE_SPEED and number is not None else 0
        score = named + 2 - doubtful - several
        if named and kind and score >= LEAST_SCORE and signs is not None:
            guess = RoleGuess(role, 0, message, signal, score - signs, ("its name", kind))
            yield _of_axle(guess, place, words) if role in PER_AXLE else guess


def _of_axle(guess: RoleGuess, place: _Place, words: Collection[str]) -> RoleGuess:
    """A guess with what the names say about its axle."""
    doubts, share = place.doubts, 1.0
    if guess.role is Role.AXLE_LOAD and set(words) & ONE_WHEEL:
        doubts, share = (*doubts, WHEEL_LOAD_DOUBT), 2.0
    if guess.role in _FORCES_ON_AXLES and _is_any_force(guess, set(words)):
        doubts = (*doubts, FORCE_DOUBT)
    return replace(
        guess,
        axle=1 if place.axle is None else place.axle,
        group=place.group,
        of_axle=place.of_axle,
        share=share,
        doubts=doubts,
        bogie=place.bogie,
        numbered=place.is_numbered,
    )


def _is_any_force(guess: RoleGuess, signal_words: set[str]) -> bool:
    """Whether neither the words nor the signs of a force show what it is."""
    return (
        signal_words & ROLE_SPECS[guess.role].words <= FORCES
        and signs_of(guess.signal) is Signs.POSITIVE
    )


def _points_of_signs(role: Role, signal: Signal, signal_words: set[str]) -> int | None:
    """Points that the signs of its values cost an effort or a load; None where they rule it out.

    A load has no negative values, and an effort has some. Words of any force, and 'Fz', leave the
    decision to the signs.
    """
    if role not in _FORCES_ON_AXLES:
        return 0
    signs = signs_of(signal)
    if role is Role.TRACTIVE_EFFORT:
        return 1 if signs is Signs.POSITIVE else 0
    if signs is Signs.BOTH:
        return None
    if signal_words & ROLE_SPECS[role].words <= FORCES:
        return 1 if signs is Signs.POSITIVE else None
    return 0


def _kind(role: Role, signal: Signal) -> str:
    """What besides the name speaks for a role: its unit or its values; '' where nothing does."""
    if ROLE_SPECS[role].states:
        return _states(role, signal)
    known = to_si(role, signal.unit or "", 1.0 if role in PER_AXLE else None)
    return "" if known is None else "unit"


def _named(role: Role, words: Sequence[str], around: Sequence[str]) -> int:
    """Points of the names for a role; 0 where they do not fit."""
    spec, signal_words, both = ROLE_SPECS[role], set(words), {*words, *around}
    if signal_words & spec.against or (role is Role.SPEED_SOURCE and not both & SPEED):
        return 0
    if role is Role.VEHICLE_SPEED and "".join(words) in VEHICLE_WHOLE:
        return 3
    if role is Role.VEHICLE_SPEED and both & WHEEL:
        return 0
    if spec.words:
        return 2 if signal_words & spec.words else 0
    return _two(signal_words, both, *spec.of_thing)


def _named_by_wheel(signal: Signal, words: Sequence[str]) -> int:
    """Points of a wheel whose name has no word for speed and whose unit is that of a rotation.

    With the unit of a speed the name may say nothing but the wheel: other things move, too.
    """
    signal_words = set(words)
    spec = ROLE_SPECS[Role.WHEEL_SPEED]
    turns = find_factor(spec.units, signal.unit or "") is not None
    bare = all(len(word) == 1 for word in signal_words - WHEEL - PLAIN)
    is_wheel = signal_words & WHEEL and not signal_words & spec.against
    return 2 if is_wheel and (turns or bare) else 0


def _two(
    signal_words: set[str], both: set[str], quantity: AbstractSet[str], thing: AbstractSet[str]
) -> int:
    """Points of a quantity of a thing, where the message may name either."""
    if signal_words & quantity and signal_words & thing:
        return 3
    return 2 if signal_words & (quantity | thing) and both & quantity and both & thing else 0


def _states(role: Role, signal: Signal) -> str:
    """What speaks for a state: a value table that agrees with the contract's values, or one bit."""
    if not signal.choices:
        return "one bit" if role is Role.SANDING and signal.length == 1 else ""
    named = {int(raw): set(split_words(str(text))[0]) for raw, text in signal.choices.items()}
    fits = all(named.get(raw, set()) & words for raw, words in ROLE_SPECS[role].states.items())
    return "value table" if fits else ""
