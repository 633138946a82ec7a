"""The definition of an effect: parameters, what it changes, what it requires, how it shows.

There are two kinds. An effect in the contact changes the slip with which the curve is entered, or
multiplies the adhesion of the curve: μ = factor · curve(slip). An effect of the instruments changes
what the readings mean. Simulation, estimation and diagnosis use the same definition.
"""

from collections.abc import Collection, Mapping
from dataclasses import dataclass, field
from typing import Protocol, runtime_checkable

from adhesion_can.arrays import Array
from adhesion_can.physics.instruments import Instruments
from adhesion_can.physics.lag_states import LagStates
from adhesion_can.physics.parameter import Parameter


@dataclass(frozen=True, slots=True)
class Requirements:
    """Data without which an effect cannot be identified.

    Attributes:
        covariates: Names of channels of which at least one must be recorded and vary; () for none.
        each_covariate: Whether all of `covariates` are required, not one of them.
        wheel_speed: Whether the wheel speeds are required; a sample table has slip and
            adhesion alone.
        several_axles: Whether data of more than one axle are required.
        speed: Whether the vehicle speed must be recorded.
        load: Whether the axle loads must be measured.
        all_efforts: Whether the efforts of all axles are required, which a sample table lacks.
        braking: Whether rows of braking are required.
        one_recording: Whether the values hold for one recording alone.

    """

    covariates: tuple[str, ...] = ()
    wheel_speed: bool = False
    several_axles: bool = False
    speed: bool = False
    load: bool = False
    each_covariate: bool = False
    all_efforts: bool = False
    braking: bool = False
    one_recording: bool = False

    def lacks(self, present: Collection[str]) -> str:
        """Covariates that are required and not present, in words; '' where none is."""
        missing = [name for name in self.covariates if name not in present]
        if self.each_covariate:
            return " and ".join(missing)
        return " or ".join(self.covariates) if len(missing) == len(self.covariates) else ""


@dataclass(frozen=True, slots=True)
class Separation:
    """A manoeuvre that separates an effect from a rival with a similar signature.

    Attributes:
        rival: Id of the other effect.
        manoeuvre: Drive in which the two differ, a noun phrase.
        one_speed_signs: Signs of the effect's size, -1 and 1, with which the two are alike at a
            steady speed.

    """

    rival: str
    manoeuvre: str
    one_speed_signs: tuple[int, ...] = ()


@dataclass(frozen=True, slots=True)
class Observability:
    """How an effect shows in data.

    Attributes:
        channel: Name of the channel over which residuals are plotted: one of the catalogue
            `physics.channels`, or a column of a sample table.
        excitation: What must vary for the effect to show, a noun phrase.
        separations: Manoeuvres that separate the effect from particular rivals. For other rivals
            the two excitations must vary independently of each other.
        drift: Whether the effect depends on time alone: an online estimator follows such a change
            by itself, and the diagnosis prefers a cause that was measured.
        below: What happens where the size is below 0, a clause; '' where that has no other name.

    """

    channel: str = "slip"
    excitation: str = ""
    separations: tuple[Separation, ...] = ()
    drift: bool = False
    below: str = ""


@dataclass(frozen=True, slots=True)
class Contact:
    """State of contacts on which an effect may depend; arrays of one shape (n,).

    Attributes:
        slip: Slip ratio λ with its sign.
        creep_speed: Creep speed r·ω − v, m/s.
        speed: Vehicle speed, m/s.
        load: Wheelset load, N.
        time_s: Time since the recording began, s.
        axle: Number of the axle, from 1.
        place: Place of the axle counted from the leading one in the direction of travel, from 1.
        adhesion: Force over load, as measured or as it was a step ago.
        covariates: Values of other channels by name.
        series_s: Time in which lags run, s: rows that do not follow each other stand further apart
            than `PAUSE_S`; None: the time itself.

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
    series_s: Array | None = None

    @property
    def lag_time_s(self) -> Array:
        """Time in which lags run, s; shape (n,)."""
        return self.time_s if self.series_s is None else self.series_s


@dataclass(frozen=True, slots=True)
class Change:
    """Change of contacts by effects: μ = factor · curve(slip).

    Attributes:
        slip: Slip ratio with which the curve is entered; shape (n,).
        factor: Factor of the adhesion; shape (n,), or one number.

    """

    slip: Array
    factor: Array | float = 1.0


class EffectDefinition(Protocol):
    """What both kinds of effects declare."""

    @property
    def id(self) -> str:
        """Fixed name in reports, model files and `--effect`."""

    @property
    def form(self) -> str:
        """Name of the form, where a mechanism has several; else ''."""

    @property
    def title(self) -> str:
        """What happens, a clause that follows 'because'."""

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        """The numbers of the effect. The first one is its size: nothing changes where it is 0."""

    @property
    def literature(self) -> str:
        """Reference."""

    @property
    def requires(self) -> Requirements:
        """Data without which the effect cannot be identified."""

    @property
    def observability(self) -> Observability:
        """How the effect shows in data, and what separates it from others."""


@runtime_checkable
class ContactEffect(EffectDefinition, Protocol):
    """A mechanism in the contact."""

    def change(self, contact: Contact, values: tuple[float, ...], lags: LagStates) -> Change:
        """Change of contacts.

        Args:
            contact: State of the contacts; rows of one axle in the order of time.
            values: Values of `parameters`, in their order.
            lags: Lagging states, carried from call to call; fresh for a whole drive.

        """


@runtime_checkable
class InstrumentEffect(EffectDefinition, Protocol):
    """An error of sensors or of the vehicle's data."""

    def amend(self, instruments: Instruments, values: tuple[float, ...]) -> Instruments:
        """Instruments with this error in addition.

        Args:
            instruments: Instruments with the errors of other effects.
            values: Values of `parameters`, in their order.

        """


Effect = ContactEffect | InstrumentEffect
