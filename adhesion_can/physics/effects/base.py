"""What an effect is: an id, parameters, literature, and what it changes.

There are two kinds. An effect in the contact changes the slip with which the curve is entered, or
multiplies the adhesion that the curve gives: μ = factor · curve(slip). An effect of the instruments
changes what the readings mean. Simulation, identification and criticism use the same definitions.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Protocol, runtime_checkable

from adhesion_can.arrays import Array
from adhesion_can.physics.effects.lag_states import LagStates
from adhesion_can.physics.instruments import Instruments


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
        axle: whether it is the number of an axle, found by trying each.

    """

    name: str
    unit: str
    typical: float
    lower: float
    upper: float
    meaning: str
    axle: bool = False


@dataclass(frozen=True, slots=True)
class Contact:
    """The state of contacts that an effect may depend on: arrays of one shape, SI units.

    Attributes:
        slip: slip ratio λ with its sign.
        creep_speed: r ω − v, m/s.
        speed: vehicle speed, m/s.
        load: wheelset load, N.
        time_s: time since the recording began, s.
        axle: number of the axle, 1...
        place: of the axle, counted from the leading one in the direction of travel, 1...
        adhesion: force over load in the contact, as measured or as it was a step ago.
        covariates: other channels, by name.

    """

    slip: Array
    creep_speed: Array
    speed: Array
    load: Array
    time_s: Array
    axle: Array
    place: Array
    adhesion: Array
    covariates: Mapping[str, Array] = field(default_factory=dict)


@dataclass(frozen=True, slots=True)
class Change:
    """What effects change in contacts: μ = factor · curve(slip).

    Attributes:
        slip: with which the curve is entered; shape of the contact's.
        factor: of the adhesion; shape of the contact's, or a number.

    """

    slip: Array
    factor: Array | float = 1.0


class Described(Protocol):
    """What every effect says of itself."""

    @property
    def id(self) -> str:
        """Fixed name, as reports and `--effect` use it."""
        ...

    @property
    def form(self) -> str:
        """Which of several forms of one mechanism; '' where there is one."""
        ...

    @property
    def title(self) -> str:
        """What happens, a clause that follows 'because'."""
        ...

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        """Its numbers; the first is the size: nothing changes where it is 0."""
        ...

    @property
    def literature(self) -> str:
        """Where it is described."""
        ...

    @property
    def needs(self) -> tuple[str, ...]:
        """Covariates of which one must be known for the effect to be told; (): none."""
        ...


@runtime_checkable
class ContactEffect(Described, Protocol):
    """A mechanism in the contact."""

    def change(self, contact: Contact, values: tuple[float, ...], lags: LagStates) -> Change:
        """What it changes.

        Args:
            contact: state of the contacts; rows of one axle in the order of time.
            values: of `parameters`, in their order.
            memory: what lags behind, carried from call to call; fresh for a whole drive.

        """
        ...


@runtime_checkable
class InstrumentEffect(Described, Protocol):
    """An error of sensors or of the vehicle's data."""

    def amend(self, instruments: Instruments, values: tuple[float, ...]) -> Instruments:
        """Instruments with this error in addition."""
        ...


Effect = ContactEffect | InstrumentEffect
