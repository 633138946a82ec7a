"""Signals that may have a role for which none was guessed, and those without any role."""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass

from cantools.database.can import Message, Signal

from adhesion_can.bus.role_guess import GuessedRoles
from adhesion_can.bus.role_specs import ROLE_SPECS, to_si
from adhesion_can.bus.role_words import WHEEL, split_words
from adhesion_can.bus.signal_columns import find_obstacle
from adhesion_can.bus.signal_signs import Signs, signs_of
from adhesion_can.physics.readings import REQUIRED, Role


@dataclass(frozen=True, slots=True)
class RoleCandidate:
    """A signal that may have a role that was not found.

    Attributes:
        message: Message of the signal.
        signal: Signal.
        uses: Other roles that it is taken for or open for, a clause each.

    """

    message: Message
    signal: Signal
    uses: tuple[str, ...] = ()

    @property
    def place(self) -> str:
        """Signal as configurations spell it, `Message.Signal`."""
        return f"{self.message.name}.{self.signal.name}"


def unused_signals(
    messages: Iterable[Message], guessed: GuessedRoles
) -> Iterator[tuple[Message, Signal]]:
    """Signals without a guess, in the order of the database."""
    used = {guess.place for guess in guessed.guesses}
    for message in messages:
        for signal in message.signals:
            if f"{message.name}.{signal.name}" not in used:
                yield message, signal


def candidates(
    messages: Iterable[Message], guessed: GuessedRoles, role: Role
) -> list[RoleCandidate]:
    """Signals that may have a role: without a role first, of these those with fitting names.

    For a role that is required the unit suffices; for another one the names have to fit too, and
    signals with another role are none. Efforts that cannot be negative come last.

    Args:
        messages: Messages of the database.
        guessed: Guesses of its roles.
        role: Role that was not found.

    """
    spec, ranked = ROLE_SPECS[role], []
    for message in messages:
        for signal in message.signals:
            uses = guessed.uses_of(f"{message.name}.{signal.name}", role)
            candidate = RoleCandidate(message, signal, tuple(uses))
            words = {*split_words(signal.name)[0], *split_words(message.name)[0]}
            named = len(words & (spec.words or spec.of_thing[1]))
            if not _has_unit(role, signal, words) or find_obstacle(signal, message):
                continue
            if role in REQUIRED or (named and not candidate.uses):
                one_sided = role is Role.TRACTIVE_EFFORT and signs_of(signal) is Signs.POSITIVE
                rank = bool(candidate.uses), one_sided
                ranked.append((rank, -named, message.name, signal.name, candidate))
    ranked.sort(key=lambda row: row[:4])
    return [row[-1] for row in ranked]


def torques(messages: Iterable[Message]) -> list[str]:
    """Signals in units of torque, `Message.Signal`, from which an effort can be computed."""
    return [
        f"{message.name}.{signal.name}"
        for message in messages
        for signal in message.signals
        if (signal.unit or "").replace("·", "").strip().lower() in ("nm", "knm")
    ]


def _has_unit(role: Role, signal: Signal, words: set[str]) -> bool:
    """Whether a role accepts a signal's unit; the speed of a rim is that of a wheel by its name."""
    radius = 1.0 if role is Role.WHEEL_SPEED and words & WHEEL else None
    return to_si(role, signal.unit or "", radius) is not None
