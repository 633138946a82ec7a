"""Roles of a database's signals, guessed from names, units and message names.

A wrong guess costs more than none: two signals that fit a role about equally well are rivals, and
neither is taken.
"""

from collections.abc import Iterable, Sequence
from dataclasses import replace

from cantools.database.can import Message, Signal

from adhesion_can.bus.role_guess import GuessedRoles, RoleGuess
from adhesion_can.bus.role_words import (
    AGAINST,
    AXLE_MESSAGES,
    GROUPS,
    OTHERS,
    PAIRS,
    SIDES,
    SINGLE,
    SPEED,
    STATES,
    VEHICLE_WHOLE,
    WHEEL,
    counts_axles,
    split_words,
)
from adhesion_can.bus.shared_efforts import find_shared_efforts
from adhesion_can.bus.signal_columns import find_obstacle
from adhesion_can.bus.units import UNITS, find_factor, to_si
from adhesion_can.physics.readings import PER_AXLE, Role
from adhesion_can.physics.vehicle import MOST_AXLES

LEAST_SCORE = 3
"""Score from which a signal is a candidate: a name that fits, and nothing against it."""
CLEAR_LEAD = 1
"""Lead over the next candidate with which the better one is taken."""


def guess_roles(messages: Iterable[Message]) -> GuessedRoles:
    """Roles of the signals of these messages.

    Args:
        messages: Messages of a database, in cantools' form.

    """
    found = [g for m in messages for signal in m.signals for g in _guesses(m, signal)]
    by_role: dict[str, list[RoleGuess]] = {}
    for guess in (*found, *_counted_from_zero(found)):
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
    shared = find_shared_efforts(taken, rivals)
    kept = sorted((guess for guess in taken if guess not in shared), key=_order)
    return GuessedRoles(tuple(kept), dict(sorted(rivals.items())), shared)


def _counted_from_zero(found: Sequence[RoleGuess]) -> Iterable[RoleGuess]:
    """Guesses of the axles one higher, for roles of which a signal has the number 0.

    Whether 0 is the first axle or something else nobody knows: the signals become rivals.
    """
    roles = {guess.role for guess in found if guess.role in PER_AXLE and not guess.axle}
    for guess in found:
        if guess.role in roles:
            yield replace(guess, axle=guess.axle + 1)


def _leave_out_doubles(taken: list[RoleGuess], rivals: dict[str, tuple[RoleGuess, ...]]) -> None:
    """A signal that fits two roles is taken for neither."""
    places = [guess.place for guess in taken]
    places += {rival.place for alike in rivals.values() for rival in alike}
    for guess in [one for one in taken if places.count(one.place) > 1]:
        taken.remove(guess)
        rivals[guess.name] = (guess,)


def _order(guess: RoleGuess) -> tuple[int, int]:
    return list(Role).index(guess.role), guess.axle


def _guesses(message: Message, signal: Signal) -> Iterable[RoleGuess]:
    """Roles that a signal fits, each with its score."""
    words, number = split_words(signal.name)
    around, around_number = split_words(message.name)
    if find_obstacle(signal, message):
        return
    axle = None if set(words) & SIDES else number  # a wheel of a side is no axle
    if number is None and set(around) & (AXLE_MESSAGES | GROUPS.keys()):
        axle = around_number
    of_axle = counts_axles(signal.name) or (number is None and counts_axles(message.name))
    group = next((GROUPS[word] for word in (*words, *around) if word in GROUPS), "")
    roles = [role for role in Role if role is not Role.CHANNEL]
    if axle is None or axle > MOST_AXLES:
        roles = [role for role in roles if role not in PER_AXLE]
    for role in roles:
        # A motor or a bogie has an effort that counts; its speed and its load are other quantities.
        against = AGAINST - GROUPS.keys() if role is Role.TRACTIVE_EFFORT else AGAINST
        if set(words) & against:
            continue
        named, kind = _named(role, words, around), _kind(role, signal)
        if role is Role.WHEEL_SPEED and not named:
            named = _named_by_rotation(signal, words)
        doubtful = 2 if set(around) & against else 0
        if role is Role.TRACTIVE_EFFORT and group and not of_axle:
            doubtful += 1  # less likely an axle's than a signal that names axles
        # One of several vehicle speeds is less likely the one.
        several = 1 if role is Role.VEHICLE_SPEED and number is not None else 0
        score = named + 2 - doubtful - several
        if named and kind and score >= LEAST_SCORE:
            place = axle or 0 if role in PER_AXLE else 0
            reasons = ("its name", kind)
            yield RoleGuess(role, place, message, signal, score, reasons, group, of_axle)


def _kind(role: Role, signal: Signal) -> str:
    """What besides the name speaks for a role: its unit or its values; '' where nothing does."""
    if role in STATES:
        return _states(role, signal)
    known = to_si(role, signal.unit or "", 1.0 if role in PER_AXLE else None)
    return "" if known is None else "unit"


def _named(role: Role, words: Sequence[str], around: Sequence[str]) -> int:
    """Points of the names for a role; 0 where they do not fit."""
    own, both = set(words), {*words, *around}
    if own & OTHERS.get(role, frozenset()) or (role is Role.SPEED_SOURCE and not both & SPEED):
        return 0
    if role is Role.VEHICLE_SPEED and "".join(words) in VEHICLE_WHOLE:
        return 3
    if role is Role.VEHICLE_SPEED and both & WHEEL:
        return 0
    if role in SINGLE:
        return 2 if own & SINGLE[role] else 0
    return _two(own, both, *PAIRS[role])


def _named_by_rotation(signal: Signal, words: Sequence[str]) -> int:
    """Points of a wheel whose name has no word for speed and whose unit is that of a rotation."""
    own = set(words)
    turns = find_factor(UNITS[Role.WHEEL_SPEED], signal.unit or "") is not None
    return 2 if turns and own & WHEEL and not own & OTHERS[Role.WHEEL_SPEED] else 0


def _two(own: set[str], both: set[str], quantity: set[str], thing: set[str]) -> int:
    """Points of a quantity of a thing, where the message may name either."""
    if own & quantity and own & thing:
        return 3
    return 2 if own & (quantity | thing) and both & quantity and both & thing else 0


def _states(role: Role, signal: Signal) -> str:
    """What speaks for a state: a value table that agrees with the contract's values, or one bit."""
    if not signal.choices:
        return "one bit" if role is Role.SANDING and signal.length == 1 else ""
    named = {int(raw): set(split_words(str(text))[0]) for raw, text in signal.choices.items()}
    fits = all(named.get(raw, set()) & words for raw, words in STATES[role].items())
    return "value table" if fits else ""
