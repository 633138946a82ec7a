"""Formulas in one channel, or in two, as candidates: a small grammar of at most three constants.

Powers, exponentials, saturation, a threshold, a step between two levels, a parabola, a first-order
lag, and products with another channel. The level belongs to the curve, so that each formula means
all that differ from it by a constant factor. Powers: Box and Cox, J. R. Stat. Soc. B 26 (1964).
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np

from adhesion_can.arrays import Array
from adhesion_can.diagnosis.regression.candidate import Candidate
from adhesion_can.physics.effects.expression import channel_text
from adhesion_can.physics.effects.formula import LEAST_FACTOR, Formula
from adhesion_can.physics.parameter import Parameter

CONSTANTS = ("a", "b", "c")
"""Names of the constants."""
STRAIGHT = "a straight line"
"""Kind of the formula that is linear in the channel."""
TYPICAL = 0.1
"""Typical change of the adhesion over a standard deviation of the channel."""
MOST_GAIN = 20.0
"""Largest factor gained over the range of a channel."""
LEAST_POWER, STEEPEST = 0.02, 8.0
"""Smallest and largest exponent of a power; a smaller one is the logarithm's."""
PLACES = (0.15, 0.3, 0.45, 0.6, 0.75, 0.9)
"""Places of a bend in the range of a channel from which a fit starts."""
LAGS_S = (2.0, 20.0)
"""Typical time constants of lags, s."""


@dataclass(frozen=True, eq=False)
class FormulaChannel:
    """A channel on which a formula may depend, with its values in all rows.

    Attributes:
        name: Name of the channel in a formula.
        unit: Unit of the values; '' where none is known.
        values: Values, shape (n,).

    """

    name: str
    unit: str
    values: Array

    @property
    def text(self) -> str:
        """Name as an expression has it."""
        return channel_text(self.name, CONSTANTS)

    @property
    def low(self) -> float:
        """Smallest value."""
        return float(self.values.min())

    @property
    def span(self) -> float:
        """Difference of the largest and the smallest value."""
        return float(np.ptp(self.values))

    @property
    def middle(self) -> float:
        """Mean value, rounded to a thousandth of the span."""
        digits = 3 - int(np.floor(np.log10(self.span)))
        return round(float(self.values.mean()), digits)

    @property
    def begin(self) -> float:
        """Value a little below the smallest one, rounded to a thousandth of the span."""
        step = 10.0 ** (np.floor(np.log10(self.span)) - 2)
        return float(f"{np.floor(self.low / step) * step:.12g}")

    def above(self, value: float) -> str:
        """Text of the channel's distance above a value."""
        if value == 0.0:
            return self.text
        return f"({self.text} {'-' if value > 0.0 else '+'} {abs(value):.10g})"


def build_formulas(
    channel: FormulaChannel, others: Sequence[FormulaChannel], *, sequence: bool
) -> tuple[Candidate, ...]:
    """Formulas for the dependence on a channel; several of one kind differ in their start values.

    Args:
        channel: Channel on which the residual depends.
        others: Further channels, for products.
        sequence: Whether rows follow upon each other, so that there may be a lag.

    """
    formulas = [*_of_one_constant(channel), *_bent(channel), *_with_levels(channel)]
    if sequence:
        formulas += _lags(channel)
    for other in others:
        formulas += _products(channel, other)
    return tuple(map(Candidate, formulas))


def _size(channel: FormulaChannel, power: int = 1) -> Parameter:
    """Size of a factor that is linear, or of a higher power, in the channel."""
    unit = f"1/{channel.unit}" if channel.unit else ""
    spread = float(np.std(channel.values))
    unit = f"{unit}^{power}" if unit and power > 1 else unit
    most = MOST_GAIN / spread**power
    return Parameter("a", unit, TYPICAL / spread**power, -most, most, "change of the factor")


def _share() -> Parameter:
    """Size of a factor that changes from one level to another."""
    return Parameter("a", "1", TYPICAL, LEAST_FACTOR - 1.0, MOST_GAIN, "change of the factor")


def _place(channel: FormulaChannel, share: float) -> Parameter:
    """Place in the range of a channel, from its start."""
    span = channel.span
    return Parameter("b", channel.unit, share * span, 0.0, 1.05 * span, "place of the bend")


def _width(name: str, channel: FormulaChannel, share: float) -> Parameter:
    """Range of a channel over which the factor changes."""
    span = channel.span
    return Parameter(name, channel.unit, share * span, 0.01 * span, 10.0 * span, "range of x")


def _of_one_constant(x: FormulaChannel) -> Iterator[Formula]:
    yield Formula(f"1 + a * {x.above(x.middle)}", (_size(x),), STRAIGHT)
    yield Formula(f"exp(a * {x.above(x.middle)})", (_size(x),), "an exponential")
    if x.low > 0.0:
        spread = float(np.std(np.log(x.values)))
        exponent = Parameter("a", "1", TYPICAL / spread, -STEEPEST, STEEPEST, "exponent")
        yield Formula(f"({x.text} / {x.middle:.10g}) ** a", (exponent,), "a power")


def _bent(x: FormulaChannel) -> Iterator[Formula]:
    # Box and Cox's form: the size is the slope at the middle, whatever the exponent.
    text = f"1 + a * (({x.text} / {x.middle:.10g}) ** b - 1) / b"
    slope = Parameter("a", "1", TYPICAL, -MOST_GAIN, MOST_GAIN, "slope at the middle")
    for typical in (0.5, 2.0):
        if x.low >= 0.0:
            exponent = Parameter("b", "1", typical, LEAST_POWER, STEEPEST, "exponent")
            yield Formula(text, (slope, exponent), "a power")
        if x.low > 0.0:
            exponent = Parameter("b", "1", -typical, -STEEPEST, -LEAST_POWER, "exponent")
            yield Formula(text, (slope, exponent), "a power")
    for share in (0.1, 1.0):
        width = _width("b", x, share)
        end = x.begin + round(x.span, 6)
        above = x.above(x.begin)
        for text in (f"1 + a * (1 - exp(-{above} / b))", f"1 + a * {above} / ({above} + b)"):
            yield Formula(text, (_share(), width), "saturation")
        growth = f"1 + a * exp({x.above(float(f'{end:.6g}'))} / b)"
        yield Formula(growth, (_share(), width), "an exponential")
    for share in PLACES:
        place, bent = _place(x, share), f"{x.above(x.begin)} - b"
        yield Formula(f"1 + a * max({bent}, 0)", (_size(x), place), "a threshold")
        yield Formula(f"1 + a * min({bent}, 0)", (_size(x), place), "a threshold")
        yield Formula(f"1 + a * ({bent}) ** 2", (_size(x, 2), place), "a parabola")


def _with_levels(x: FormulaChannel) -> Iterator[Formula]:
    text = f"1 + a * tanh(({x.above(x.begin)} - b) / c)"
    for share, width in product(PLACES, (0.03, 0.15)):
        yield Formula(text, (_share(), _place(x, share), _width("c", x, width)), "a step")


def _lags(x: FormulaChannel) -> Iterator[Formula]:
    for time in LAGS_S:
        constant = Parameter("b", "s", time, 0.02, 300.0, "time constant")
        text = f"1 + a * lag({x.above(x.middle)}, b)"
        yield Formula(text, (_size(x), constant), "a lag")


def _products(x: FormulaChannel, y: FormulaChannel) -> Iterator[Formula]:
    whole = FormulaChannel("product", "", x.values * y.values)
    spread, middle = float(np.std(whole.values)), float(whole.values.mean())
    unit = f"1/({x.unit} {y.unit})" if x.unit and y.unit else ""

    def size(by: float) -> Parameter:
        return Parameter("a", unit, TYPICAL / by, -MOST_GAIN / by, MOST_GAIN / by, "change")

    if spread > 0.0:
        sign = "-" if middle > 0.0 else "+"
        text = f"1 + a * ({x.text} * {y.text} {sign} {abs(whole.middle):.10g})"
        yield Formula(text, (size(spread),), "a product")
    parts = (x.values - x.middle) * (y.values - y.middle)
    if float(np.std(parts)) > 0.0:
        text = f"1 + a * {x.above(x.middle)} * {y.above(y.middle)}"
        yield Formula(text, (size(float(np.std(parts))),), "a product")
    if x.low > 0.0 and y.low > 0.0:
        exponents = tuple(
            Parameter(n, "1", TYPICAL / float(np.std(np.log(z.values))), -STEEPEST, STEEPEST,
                      "exponent")
            for n, z in (("a", x), ("b", y))
        )  # fmt: skip
        text = f"({x.text} / {x.middle:.10g}) ** a * ({y.text} / {y.middle:.10g}) ** b"
        yield Formula(text, exponents, "a product of powers")
