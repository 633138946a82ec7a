"""Signals that no role was guessed for: those that may have one all the same, and the others."""

from collections.abc import Iterable, Iterator

from cantools.database.can import Message, Signal

from adhesion_can.bus.role_guess import GuessedRoles
from adhesion_can.bus.role_words import PAIRS, SINGLE, WHEEL, split_words
from adhesion_can.bus.signal_columns import find_obstacle
from adhesion_can.bus.units import to_si
from adhesion_can.physics.readings import REQUIRED, Role


def unused_signals(
    messages: Iterable[Message], guessed: GuessedRoles
) -> Iterator[tuple[Message, Signal]]:
    """Signals without a guess, in the order of the database."""
    used = guessed.places
    for message in messages:
        for signal in message.signals:
            if f"{message.name}.{signal.name}" not in used:
                yield message, signal


def candidates(
    messages: Iterable[Message], guessed: GuessedRoles, role: Role
) -> list[tuple[Message, Signal]]:
    """Signals without a guess that may have a role, those with fitting names first.

    For a role that is required the unit suffices; for another one the names have to fit too.

    Args:
        messages: Messages of the database.
        guessed: Guesses of its roles.
        role: Role that was not found.

    """
    found = []
    for message, signal in unused_signals(messages, guessed):
        words = {*split_words(signal.name)[0], *split_words(message.name)[0]}
        known = SINGLE[role] if role in SINGLE else PAIRS[role][1]
        named = len(words & known)
        if not _has_unit(role, signal, words) or find_obstacle(signal, message):
            continue
        if named or role in REQUIRED:
            found.append((-named, message, signal))
    found.sort(key=lambda one: (one[0], one[1].name, one[2].name))
    return [(message, signal) for _, message, signal in found]


def _has_unit(role: Role, signal: Signal, words: set[str]) -> bool:
    """Whether a role accepts a signal's unit; the speed of a rim is that of a wheel by its name."""
    radius = 1.0 if role is Role.WHEEL_SPEED and words & WHEEL else None
    return to_si(role, signal.unit or "", radius) is not None
