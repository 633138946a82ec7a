"""What a guess of roles gives."""

from collections.abc import Mapping
from dataclasses import dataclass

from cantools.database.can import Message, Signal

from adhesion_can.physics.readings import Role, role_name

CHOSEN = ("chosen",)
"""Reasons of a signal that the user chose."""


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
        group: What it belongs to by its names: 'motor', 'bogie', 'inverter', or '' for an axle.
        of_axle: Whether its number follows a word for an axle.
        share: Factor on the signal's value that gives the axle's.
        doubts: What has to be asked before it is taken, a clause each.
        bogie: Number of the bogie that its names state; None: they state none.
        numbered: Whether its names have a number or letter for `axle`.

    """

    role: Role
    axle: int
    message: Message
    signal: Signal
    score: int
    reasons: tuple[str, ...]
    group: str = ""
    of_axle: bool = False
    share: float = 1.0
    doubts: tuple[str, ...] = ()
    bogie: int | None = None
    numbered: bool = True

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
        rivals: Guesses by role of which none is clearly the better one, best first; one guess
            where it has to be asked.
        shared: Efforts of motors, and efforts and loads of bogies, that have several axles; `axle`
            is the number of the motor or bogie.

    """

    taken: tuple[RoleGuess, ...]
    rivals: Mapping[str, tuple[RoleGuess, ...]]
    shared: tuple[RoleGuess, ...] = ()

    @property
    def unclear(self) -> tuple[RoleGuess, ...]:
        """All rivals."""
        return tuple(rival for alike in self.rivals.values() for rival in alike)

    @property
    def guesses(self) -> tuple[RoleGuess, ...]:
        """All guesses: taken, rivals or shared."""
        return (*self.taken, *self.unclear, *self.shared)

    def shared_of(self, role: Role) -> tuple[RoleGuess, ...]:
        """Shared signals of a role, by the number of the motor or bogie."""
        return tuple(guess for guess in self.shared if guess.role is role)

    def uses_of(self, place: str, role: Role) -> list[str]:
        """Uses of a signal for other roles: 'taken for axle_load.1', 'open for ..'; a clause each.

        Args:
            place: Signal as `Message.Signal`.
            role: Role whose own use does not count.

        """
        rows = [
            *((guess, f"taken for {guess.name}") for guess in self.taken),
            *((guess, f"open for {guess.name}") for guess in self.unclear),
            *((guess, f"open for {guess.role}") for guess in self.shared),
        ]
        uses = [use for guess, use in rows if guess.place == place and guess.role is not role]
        return list(dict.fromkeys(uses))
