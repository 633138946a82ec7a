"""What the effects of a model are worth on data: by the gain of the model with its curve refitted.

The service refits the curve on every rail, so it profits from this gain and not from that of the
model as written.
"""

from enum import StrEnum
from math import isfinite

from adhesion_can.diagnosis.gain_result import Comparison

USEFUL_GAIN = 0.5
"""Gain from which a model is of practical use, %: its effects then explain a tenth of the residual
(1 - 0.995² = 0.1²)."""


class ModelWorth(StrEnum):
    """What the effects of a model are worth on some data."""

    USEFUL = "useful"
    SMALL = "small"
    UNCERTAIN = "uncertain"
    UNKNOWN = "unknown"
    HARMFUL = "harmful"

    @property
    def clause(self) -> str:
        """Clause behind the gain and its interval."""
        return _CLAUSES[self]

    @property
    def finding(self) -> str:
        """Clause in front of the gain and its interval."""
        return _FINDINGS[self]


_CLAUSES = {
    ModelWorth.USEFUL: f"of practical use ({USEFUL_GAIN:g} % or more)",
    ModelWorth.SMALL: f"too small to be of practical use (less than {USEFUL_GAIN:g} %)",
    ModelWorth.UNCERTAIN: "not certain, because the interval includes 0",
    ModelWorth.UNKNOWN: "not certain, because the data have too few spans for an interval",
    ModelWorth.HARMFUL: "a loss: the whole interval is below 0",
}
_FINDINGS = {
    ModelWorth.USEFUL: "The model's effects are of practical use on these data",
    ModelWorth.SMALL: "The model's effects hardly act on these data",
    ModelWorth.UNCERTAIN: "It is not certain that the model's effects help on these data",
    ModelWorth.UNKNOWN: "It is not known whether the model's effects help on these data",
    ModelWorth.HARMFUL: "The model's effects make the prediction worse on these data",
}


def judge_model(refitted: Comparison) -> ModelWorth:
    """What the effects of a model are worth.

    Args:
        refitted: The model with its curve refitted, compared with the plain curve.

    """
    low, high = refitted.interval
    if not (isfinite(low) and isfinite(high)):
        return ModelWorth.UNKNOWN
    if max(-low, high) < USEFUL_GAIN:
        return ModelWorth.SMALL
    if high < 0.0:
        return ModelWorth.HARMFUL
    if low <= 0.0:
        return ModelWorth.UNCERTAIN
    return ModelWorth.USEFUL if refitted.percent >= USEFUL_GAIN else ModelWorth.SMALL


def describe_gain(comparison: Comparison) -> str:
    """'43.1 % (95 % interval 36.4 to 49.0 %)', with the decimals that a small gain needs."""
    low, high = comparison.interval
    digits = 1 if abs(comparison.percent) >= 1.0 else 2
    # A loss that rounds to 0 has no sign.
    percent, low, high = (round(value, digits) + 0.0 for value in (comparison.percent, low, high))
    text = f"{percent:.{digits}f} %"
    if not (isfinite(low) and isfinite(high)):
        return text
    return f"{text} (95 % interval {low:.{digits}f} to {high:.{digits}f} %)"
