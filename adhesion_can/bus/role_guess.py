"""What a guess of roles gives."""

from collections.abc import Mapping
from dataclasses import dataclass

from cantools.database.can import Message, Signal

from adhesion_can.physics.readings import Role, role_name


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
        share: Share of the signal's value that belongs to the axle.

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
        shared: Efforts of motors or bogies that drive several axles; `axle` is the number of the
            motor or bogie.

    """

    taken: tuple[RoleGuess, ...]
    rivals: Mapping[str, tuple[RoleGuess, ...]]
    shared: tuple[RoleGuess, ...] = ()

    @property
    def places(self) -> set[str]:
        """Signals that are taken, rivals or shared, as `Message.Signal`."""
        rivals = (rival for alike in self.rivals.values() for rival in alike)
        return {guess.place for guess in (*self.taken, *rivals, *self.shared)}
