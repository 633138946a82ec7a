"""Adhesion, or a reading, changes by a factor that a formula gives.

It is written by hand, or proposed by a diagnosis for the adhesion. A formula is no member of
`EFFECTS`: there is one for every expression, in a model file under the key `expression`.
"""

import re
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from math import inf, isfinite
from typing import ClassVar

import numpy as np

from adhesion_can.arrays import Array
from adhesion_can.physics.channels import channel_label
from adhesion_can.physics.effects.base import Change, Contact, Observability, Requirements
from adhesion_can.physics.effects.expression import LAG, Expression, ExpressionError, Lag
from adhesion_can.physics.instrument_laws import Need, Quantity, ReadingError, Situation
from adhesion_can.physics.instruments import Instruments
from adhesion_can.physics.lag_states import LagStates
from adhesion_can.physics.parameter import Parameter

FORMULA = "formula"
"""Id of all formulas."""
CONTACT_CHANNELS: Mapping[str, str] = {
    "slip": "slip",
    "creep_speed": "creep_speed",
    "speed": "speed",
    "load": "axle_load",
}
"""Names of channels that every contact has, with those of the catalogue; `slip` and `creep_speed`
are magnitudes."""
LEAST_FACTOR = 0.05
"""Least factor of a formula: the adhesion does not vanish."""
LARGEST_FACTOR = 1e6
"""Factor beyond which a formula has no value: it divides by what is next to nothing."""
LEAST_LAG_S, LONGEST_LAG_S = 1e-6, 1e9
"""Least time constant of a lag that is one, that of the stamps, and the longest, s."""
ADHESION = "adhesion"
"""What a formula acts on, if nothing else is stated."""
READINGS: Mapping[str, Quantity] = {"speed": Quantity.SPEED, "effort": Quantity.EFFORT}
"""Readings that a formula may act on by name: it is the factor measured over true."""
SITUATION_CHANNELS: Mapping[str, str] = {
    "speed": "speed",
    "load": "axle_load",
    "effort": "tractive_effort",
    "total_effort": "tractive_effort",
    "time_s": "time",
}
"""Names of channels that every reading has, with those of the catalogue; efforts have their sign,
`total_effort` is that of all axles."""


@dataclass(frozen=True)
class _Factor:
    """Factor by an expression over channels and constants.

    Attributes:
        expression: Text of the factor, such as '1 + a * max(wind - b, 0)'.
        parameters: Constants of the expression. Of several the first is the size: where it is 0,
            the factor is 1 or another constant.
        kind: What the expression describes, such as 'a threshold'; '' for one written by hand.

    """

    expression: str
    parameters: tuple[Parameter, ...]
    kind: str = ""
    id: str = FORMULA
    catalogue: ClassVar[Mapping[str, str]]
    """Channels that are always there, by those of the catalogue; others are covariates."""

    def __post_init__(self) -> None:
        words = {name for name, is_quoted in self._parsed.names if not is_quoted}
        unused = [p.name for p in self.parameters if p.name not in words]
        if unused:
            raise ExpressionError(f"constant {unused[0]!r} does not occur in {self.expression!r}")
        if not self.parameters:
            raise ExpressionError(f"{self.expression!r} has no constant to be fitted")
        if not self.channels:
            raise ExpressionError(f"{self.expression!r} depends on no channel")
        constants = {p.name for p in self.parameters}
        times = self._parsed.names_of_lag_times
        varying = [name for name, is_quoted in times if is_quoted or name not in constants]
        if varying:
            raise ExpressionError(
                f"the time constant of a lag depends on {varying[0]!r}: only constants can be in it"
            )

    @cached_property
    def _parsed(self) -> Expression:
        return Expression(self.expression)

    @cached_property
    def channels(self) -> tuple[str, ...]:
        """Names of the channels in the expression, in its order."""
        constants = {p.name for p in self.parameters}
        names = (n for n, is_quoted in self._parsed.names if is_quoted or n not in constants)
        return tuple(dict.fromkeys(names))

    @property
    def lags(self) -> bool:
        """Whether the expression has a lag."""
        return bool(self._parsed.names_of_lag_times) or f"{LAG}(" in self.expression

    def require_lag_times(self, constants: Mapping[str, float]) -> None:
        """ExpressionError where a lag has no time constant that a lag can have.

        Args:
            constants: Values of the constants by name.

        """
        for text, time in self._parsed.lag_times(constants):
            if not 0.0 <= time <= LONGEST_LAG_S:
                bounds = f"0 to {LONGEST_LAG_S:g} s"
                raise ExpressionError(
                    f"the time constant of {text} is {time:g}; it must be {bounds}"
                )

    @property
    def observability(self) -> Observability:
        """Residuals over the first channel."""
        channel = self.catalogue.get(self.channels[0], self.channels[0])
        return Observability(channel, channel_label(channel))

    @property
    def covariates(self) -> tuple[str, ...]:
        """Names of the covariates in the expression, in its order."""
        return tuple(name for name in self.channels if name not in self.catalogue)

    @property
    def form(self) -> str:
        """The expression."""
        return self.expression

    @property
    def literature(self) -> str:
        """Reference."""
        return "the user's data"

    def evaluate(
        self, channels: Mapping[str, Array], values: tuple[float, ...], lag: Lag
    ) -> Array | float:
        """Factor for values of the channels and constants.

        Args:
            channels: Values of each channel of the expression, shape (n,).
            values: Values of `parameters`, in their order.
            lag: First-order lag.

        """
        constants = {p.name: value for p, value in zip(self.parameters, values, strict=True)}
        return self._parsed.evaluate(channels, constants, lag)


@dataclass(frozen=True)
class Formula(_Factor):
    """Factor of the adhesion by an expression over channels and constants."""

    catalogue = CONTACT_CHANNELS

    @property
    def acts_on(self) -> str:
        """What the factor changes."""
        return ADHESION

    @property
    def title(self) -> str:
        """What happens, a clause."""
        kind = f" ({self.kind})" if self.kind else ""
        return f"adhesion changes by the factor {self.expression}{kind}"

    @cached_property
    def requires(self) -> Requirements:
        """Each channel of the expression."""
        return Requirements(
            covariates=self.covariates,
            each_covariate=True,
            speed=any(name in {"speed", "creep_speed"} for name in self.channels),
            load="load" in self.channels,
        )

    def change(self, contact: Contact, values: tuple[float, ...], lags: LagStates) -> Change:
        """Change of the contacts."""
        lag = _lag(lags, contact.axle, contact.lag_time_s)
        channels = {name: _channel(contact, name) for name in self.channels}
        return Change(contact.slip, _bounded(self.evaluate(channels, values, lag)))


@dataclass(frozen=True)
class ReadingFormula(_Factor):
    """Factor measured over true of a reading, by an expression over channels and constants.

    Attributes:
        acts_on: Reading that is wrong, one of `READINGS`.

    """

    acts_on: str = "speed"
    catalogue = SITUATION_CHANNELS

    @property
    def title(self) -> str:
        """What happens, a clause."""
        reading = "vehicle speed" if self.acts_on == "speed" else "tractive effort"
        return f"the {reading} is measured with the factor {self.expression}"

    @cached_property
    def requires(self) -> Requirements:
        """Each channel of the expression."""
        return Requirements(
            covariates=self.covariates,
            each_covariate=True,
            speed=self.acts_on == "speed" or "speed" in self.channels,
            load="load" in self.channels,
            all_efforts="total_effort" in self.channels,
            one_recording="time_s" in self.channels,
        )

    def amend(self, instruments: Instruments, values: tuple[float, ...]) -> Instruments:
        """Instruments with this error in addition."""
        return replace(instruments, laws=(*instruments.laws, FormulaLaw(self, values)))


@dataclass(frozen=True)
class FormulaLaw:
    """Relative error of a reading by a formula.

    Attributes:
        formula: Formula of the factor.
        values: Values of its constants.

    """

    formula: ReadingFormula
    values: tuple[float, ...]

    @property
    def quantity(self) -> Quantity:
        """Reading that is wrong."""
        return READINGS[self.formula.acts_on]

    @property
    def needs(self) -> frozenset[Need]:
        """The efforts and the time, as far as they are channels."""
        needs = {"total_effort": Need.EFFORTS, "time_s": Need.SEQUENCE}
        needed = {need for name, need in needs.items() if name in self.formula.channels}
        return frozenset(needed | ({Need.SEQUENCE} if self.formula.lags else set()))

    @property
    def covariates(self) -> tuple[str, ...]:
        """Names of the covariates in the expression."""
        return self.formula.covariates

    def error(self, situation: Situation, lags: LagStates) -> ReadingError:
        """Error of the readings."""
        channels = {
            name: getattr(situation, name)
            if name in SITUATION_CHANNELS
            else situation.channel(name)
            for name in self.formula.channels
        }
        lag = _lag(lags, situation.axle, situation.lag_time_s)
        factor = self.formula.evaluate(channels, self.values, lag)
        return ReadingError(_bounded(factor) - 1.0)


def _bounded(factor: Array | float) -> Array:
    """Factor of at least `LEAST_FACTOR`; NaN where it has no value, or one beyond all sense."""
    value = np.maximum(factor, LEAST_FACTOR)
    return np.where(value <= LARGEST_FACTOR, value, np.nan)


def _lag(lags: LagStates, axle: Array, time_s: Array) -> Lag:
    """Lag of an expression in the lag states."""

    def lag(name: str, target: Array, time: float) -> Array:
        if not time >= LEAST_LAG_S or not target.ndim:
            return target  # a constant lags behind nothing
        name, rate = f"{FORMULA} {name}", 1.0 / time
        finite = np.isfinite(target)
        if finite.all():
            return lags.follow(name, axle, time_s, target, rate)
        # A state that followed a value which is not finite would never be finite again.
        value = np.full(len(target), np.nan)
        value[finite] = lags.follow(name, axle[finite], time_s[finite], target[finite], rate)
        return value

    return lag


def _channel(contact: Contact, name: str) -> Array:
    """Values of a channel at contacts."""
    if name not in CONTACT_CHANNELS:
        return contact.covariates[name]
    values: Array = getattr(contact, name)
    return np.abs(values) if name in {"slip", "creep_speed"} else values


AnyFormula = Formula | ReadingFormula


def formula_of(
    expression: str, constants: Mapping[str, float], acts_on: str = ADHESION
) -> AnyFormula:
    """Formula with constants of any size, as a model file or a user gives it.

    Args:
        expression: Text of the factor.
        constants: Values of the constants by name, the size first.
        acts_on: What the factor changes: 'adhesion', or one of `READINGS`.

    Raises:
        ExpressionError: The expression cannot be read, or lacks a constant or a channel; or nothing
            is known under the name that it acts on.

    """
    parameters = tuple(
        Parameter(name, "", value, -inf, inf, "constant of the formula")
        for name, value in constants.items()
    )
    if acts_on not in (ADHESION, *READINGS):
        known = ", ".join((ADHESION, *READINGS))
        raise ExpressionError(f"a formula cannot act on {acts_on!r}; known: {known}")
    formula = (
        Formula(expression, parameters)
        if acts_on == ADHESION
        else ReadingFormula(expression, parameters, acts_on=acts_on)
    )
    formula.require_lag_times(constants)
    return formula


def parse_formula(text: str) -> AnyFormula:
    """Formula as a user writes it: '[ACTS ON:] EXPRESSION where a=0.1, b=5', the size first.

    The values are where the search for the constants starts. Without what it acts on it is the
    factor of the adhesion.

    Raises:
        ExpressionError: The text cannot be read.

    """
    expression, where, rest = text.partition(" where ")
    if not where:
        raise ExpressionError(f"{text!r} names no constants")
    constants = {}
    for part in rest.split(","):
        name, _, number = (piece.strip() for piece in part.partition("="))
        try:
            value = float(number)
        except ValueError as error:
            raise ExpressionError(f"{part.strip()!r} is not a constant with a number") from error
        if not isfinite(value) or value == 0.0:
            raise ExpressionError(
                f"{name} = {value:g}: the search must start from a number other than 0"
            )
        if name in constants:
            raise ExpressionError(f"constant {name!r} has two values")
        constants[name] = value
    in_front = re.match(r"\s*(\w+)\s*:(.*)", expression, re.DOTALL)
    if in_front:
        return formula_of(in_front[2].strip(), constants, in_front[1])
    return formula_of(expression.strip(), constants)
