"""Roles of a database's signals, guessed from names, units and message names.

A wrong guess costs more than none: two signals that fit a role about equally well are rivals, and
neither is taken.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace

from cantools.database.can import Message, Signal

from adhesion_can.bus.role_words import (
    AGAINST,
    AXLE_MESSAGES,
    OTHERS,
    PAIRS,
    SIDES,
    SINGLE,
    SPEED,
    STATES,
    VEHICLE_WHOLE,
    WHEEL,
    split_words,
)
from adhesion_can.bus.signal_columns import find_obstacle
from adhesion_can.bus.units import to_si
from adhesion_can.physics.readings import PER_AXLE, Role, role_name
from adhesion_can.physics.vehicle import MOST_AXLES

LEAST_SCORE = 3
"""Score from which a signal is a candidate: a name that fits, and nothing against it."""
CLEAR_LEAD = 1
"""Lead over the next candidate with which the better one is taken."""


@dataclass(frozen=True, slots=True)
class RoleGuess:
    """A signal that fits a role.

    Attributes:
        role: Meaning of the signal.
        axle: Number of the axle, 1.. for roles per axle, else 0.
        message: Message of the signal.
        signal: Signal.
        score: Points of its names and unit; more fits better.
        reasons: What speaks for it, a few words each.

    """

    role: Role
    axle: int
    message: Message
    signal: Signal
    score: int
    reasons: tuple[str, ...]

    @property
    def name(self) -> str:
        """Role as configurations spell it."""
        return role_name(self.role, self.axle)

    @property
    def place(self) -> str:
        """Signal as configurations spell it, `Message.Signal`."""
        return f"{self.message.name}.{self.signal.name}"


@dataclass(frozen=True, slots=True)
class GuessedRoles:
    """Roles of the signals of a database.

    Attributes:
        taken: Guesses that are clear, no signal in two of them.
        rivals: Guesses by role of which none is clearly the better one, best first.

    """

    taken: tuple[RoleGuess, ...]
    rivals: Mapping[str, tuple[RoleGuess, ...]]


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
    _leave_out_shared(taken, rivals)
    return GuessedRoles(tuple(sorted(taken, key=_order)), dict(sorted(rivals.items())))


def _counted_from_zero(found: Sequence[RoleGuess]) -> Iterable[RoleGuess]:
    """Guesses of the axles one higher, for roles of which a signal has the number 0.

    Whether 0 is the first axle or something else nobody knows: the signals become rivals.
    """
    roles = {guess.role for guess in found if guess.role in PER_AXLE and not guess.axle}
    for guess in found:
        if guess.role in roles:
            yield replace(guess, axle=guess.axle + 1)


def _leave_out_shared(taken: list[RoleGuess], rivals: dict[str, tuple[RoleGuess, ...]]) -> None:
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
    if find_obstacle(signal, message) or set(words) & AGAINST:
        return
    axle = None if set(words) & SIDES else number  # a wheel of a side is no axle
    if number is None and set(around) & AXLE_MESSAGES:
        axle = around_number
    doubtful = 2 if set(around) & AGAINST else 0
    roles = [role for role in Role if role is not Role.CHANNEL]
    if axle is None or axle > MOST_AXLES:
        roles = [role for role in roles if role not in PER_AXLE]
    for role in roles:
        named, kind = _named(role, words, around), _kind(role, signal)
        # One of several vehicle speeds is less likely the one.
        several = 1 if role is Role.VEHICLE_SPEED and number is not None else 0
        score = named + 2 - doubtful - several
        if named and kind and score >= LEAST_SCORE:
            place = axle or 0 if role in PER_AXLE else 0
            yield RoleGuess(role, place, message, signal, score, ("its name", kind))


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
