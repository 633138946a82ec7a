"""Adhesion changes by a factor that a formula gives: written by hand, or proposed by a diagnosis.

It is no member of `EFFECTS`: there is one for every expression, in a model file under the key
`expression`.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from math import inf, isfinite

import numpy as np

from adhesion_can.arrays import Array
from adhesion_can.physics.channels import channel_label
from adhesion_can.physics.effects.base import Change, Contact, Observability, Requirements
from adhesion_can.physics.effects.expression import Expression, ExpressionError
from adhesion_can.physics.effects.lag_states import LagStates
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


@dataclass(frozen=True)
class Formula:
    """Factor of the adhesion by an expression over channels and constants.

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
    def form(self) -> str:
        """The expression."""
        return self.expression

    @property
    def title(self) -> str:
        """What happens, a clause."""
        kind = f" ({self.kind})" if self.kind else ""
        return f"adhesion changes by the factor {self.expression}{kind}"

    @property
    def literature(self) -> str:
        """Reference."""
        return "the user's data"

    @cached_property
    def requires(self) -> Requirements:
        """Each channel of the expression."""
        return Requirements(
            covariates=tuple(name for name in self.channels if name not in CONTACT_CHANNELS),
            each_covariate=True,
            speed=any(name in {"speed", "creep_speed"} for name in self.channels),
            load="load" in self.channels,
        )

    @property
    def observability(self) -> Observability:
        """Residuals over the first channel."""
        channel = CONTACT_CHANNELS.get(self.channels[0], self.channels[0])
        return Observability(channel, channel_label(channel))

    def change(self, contact: Contact, values: tuple[float, ...], lags: LagStates) -> Change:
        """Change of the contacts."""

        def lag(name: str, target: Array, time: float) -> Array:
            if not time > 0.0 or not target.ndim:
                return target  # a constant lags behind nothing
            key = f"{FORMULA} {name}"
            return lags.follow(key, contact.axle, contact.lag_time_s, target, 1.0 / time)

        channels = {name: _channel(contact, name) for name in self.channels}
        constants = {p.name: value for p, value in zip(self.parameters, values, strict=True)}
        factor = self._parsed.evaluate(channels, constants, lag)
        return Change(contact.slip, np.maximum(factor, LEAST_FACTOR))


def _channel(contact: Contact, name: str) -> Array:
    """Values of a channel at contacts."""
    if name not in CONTACT_CHANNELS:
        return contact.covariates[name]
    values: Array = getattr(contact, name)
    return np.abs(values) if name in {"slip", "creep_speed"} else values


def formula_of(expression: str, constants: Mapping[str, float]) -> Formula:
    """Formula with constants of any size, as a model file or a user gives it.

    Args:
        expression: Text of the factor.
        constants: Values of the constants by name, the size first.

    Raises:
        ExpressionError: The expression cannot be read, or lacks a constant or a channel.

    """
    parameters = tuple(
        Parameter(name, "", value, -inf, inf, "constant of the formula")
        for name, value in constants.items()
    )
    return Formula(expression, parameters)


def parse_formula(text: str) -> Formula:
    """Formula as a user writes it: 'EXPRESSION where a=0.1, b=5', the size first.

    The values are where the search for the constants begins.

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
            raise ExpressionError(f"{part.strip()!r} is no constant with a number") from error
        if not isfinite(value) or value == 0.0:
            raise ExpressionError(f"{name} = {value:g}: a search begins at a number other than 0")
        if name in constants:
            raise ExpressionError(f"constant {name!r} has two values")
        constants[name] = value
    return formula_of(expression.strip(), constants)
