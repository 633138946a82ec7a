"""What an effect is: an id, parameters, literature, and a change of the predicted adhesion."""

from dataclasses import dataclass
from typing import Protocol

from adhesion_can.physics.burckhardt import Array


@dataclass(frozen=True, slots=True)
class Parameter:
    """One number of an effect.

    Attributes:
        name: as in the literature.
        unit: SI.
        typical: size taken where none is given.
        lower: smallest value that makes sense.
        upper: largest value that makes sense.
        meaning: one line for an engineer.

    """

    name: str
    unit: str
    typical: float
    lower: float
    upper: float
    meaning: str


@dataclass(frozen=True, slots=True)
class Contact:
    """The state of contacts that an effect may depend on: arrays of one shape, SI units.

    Attributes:
        slip: slip ratio λ with its sign.
        creep_speed: r ω − v, m/s.
        speed: vehicle speed, m/s.
        load: wheelset load, N.

    """

    slip: Array
    creep_speed: Array
    speed: Array
    load: Array


class Effect(Protocol):
    """A mechanism that changes the adhesion which the plain curve predicts."""

    @property
    def id(self) -> str:
        """Fixed name, as reports and `--effect` use it."""
        ...

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        """Its numbers; the first is the size."""
        ...

    @property
    def literature(self) -> str:
        """Where it is described."""
        ...

    def apply(self, adhesion: Array, contact: Contact, values: tuple[float, ...]) -> Array:
        """Adhesion with the effect in place.

        Args:
            adhesion: μ without it, any shape.
            contact: state of the same contacts, same shape.
            values: of `parameters`, in their order.

        Returns:
            μ with it, same shape; unchanged where the first value is 0.

        """
        ...
