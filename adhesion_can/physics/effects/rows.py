"""Effects that are data and one formula: what the rows of the tables have in common.

`FactorEffect` has the formula of a factor of the adhesion, `ErrorEffect` that of an error of the
instruments, and `LawEffect` has the class of a law of the instruments.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Self

from adhesion_can.arrays import Array
from adhesion_can.physics.effects.base import Change, Contact, Observability, Requirements
from adhesion_can.physics.instrument_laws import InstrumentLaw
from adhesion_can.physics.instruments import Instruments
from adhesion_can.physics.lag_states import LagStates
from adhesion_can.physics.parameter import Parameter
from adhesion_can.values import Value


@dataclass(frozen=True, slots=True, kw_only=True)
class EffectRow(Value):
    """What all rows have.

    Attributes:
        id: Fixed name in reports, model files and `--effect`.
        form: Name of the form, where a mechanism has several; else ''.
        title: Description of what happens, a clause that follows 'because'.
        parameters: Parameters of the effect, the size first.
        literature: Reference.
        requires: Data without which the effect cannot be identified.
        observability: How the effect shows in data, and what separates it from others.

    """

    id: str
    form: str = ""
    title: str
    parameters: tuple[Parameter, ...]
    literature: str
    requires: Requirements = Requirements()
    observability: Observability

    def __copy__(self) -> Self:
        # Not by way of pickling, which gives the row of the table itself.
        return replace(self)


@dataclass(frozen=True, slots=True, kw_only=True)
class FactorEffect(EffectRow):
    """An effect that multiplies the adhesion and leaves the slip alone.

    Attributes:
        factor: Factor of the adhesion, shape (n,) or one number, by the contact, the lagging states
            and the values of `parameters`.

    """

    factor: Callable[..., Array | float]

    def change(self, contact: Contact, values: tuple[float, ...], lags: LagStates) -> Change:
        """Change of the contacts."""
        return Change(contact.slip, self.factor(contact, lags, *values))


@dataclass(frozen=True, slots=True, kw_only=True)
class ErrorEffect(EffectRow):
    """An effect that adds to an error of the instruments.

    Attributes:
        add: Instruments with the error in addition, by those without it and the values of
            `parameters`.

    """

    add: Callable[..., Instruments]

    def amend(self, instruments: Instruments, values: tuple[float, ...]) -> Instruments:
        """Instruments with this error in addition."""
        return self.add(instruments, *values)


@dataclass(frozen=True, slots=True, kw_only=True)
class LawEffect(EffectRow):
    """An effect that adds one law to the instruments.

    Attributes:
        law: Class or function that makes the law from the values of `parameters`.

    """

    law: Callable[..., InstrumentLaw]

    def amend(self, instruments: Instruments, values: tuple[float, ...]) -> Instruments:
        """Instruments with this error in addition."""
        return instruments.with_law(self.law(*values), values[0])
