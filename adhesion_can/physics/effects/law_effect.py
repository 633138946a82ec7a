"""An error of an instrument by a law: what all such effects have in common."""

from collections.abc import Callable
from dataclasses import dataclass

from adhesion_can.physics.effects.base import Observability, Requirements
from adhesion_can.physics.instrument_laws import InstrumentLaw
from adhesion_can.physics.instruments import Instruments
from adhesion_can.physics.parameter import Parameter


@dataclass(frozen=True, slots=True, kw_only=True)
class LawEffect:
    """An effect that adds one law to the instruments.

    Attributes:
        id: Fixed name in reports, model files and `--effect`.
        form: Name of the form, where a mechanism has several; else ''.
        title: Description of what happens, a clause that follows 'because'.
        parameters: Parameters of the effect, the size first.
        literature: Reference.
        requires: Data without which the effect cannot be identified.
        observability: How the effect shows in data, and what separates it from others.
        law: Class or function of a module that makes the law from the values of `parameters`.

    """

    id: str
    form: str = ""
    title: str
    parameters: tuple[Parameter, ...]
    literature: str
    requires: Requirements = Requirements()
    observability: Observability
    law: Callable[..., InstrumentLaw]

    def amend(self, instruments: Instruments, values: tuple[float, ...]) -> Instruments:
        """Instruments with this error in addition."""
        return instruments.with_law(self.law(*values), values[0])
