"""What the data say of each effect and channel: tested with what outcome, or why not."""

from dataclasses import asdict, dataclass
from enum import StrEnum
from math import nan
from typing import Any, NamedTuple

SIGNIFICANT_P_VALUE, LEAST_GAIN_PERCENT = 0.025, 3.0
"""P-value up to which, and gain from which, what is left is not called noise."""


class Decision(StrEnum):
    """What was decided about an effect, and by what."""

    NAMED = "named"
    RIVAL = "rival"
    OTHER_FORM = "other form"
    WORSE = "worse"
    NOT_BETTER = "not better"
    WEAKER = "weaker"
    REFUTED = "refuted"
    IMPLAUSIBLE = "implausible"
    NOT_NAMED = "not named"
    NOT_SIGNIFICANT = "not significant"
    NOT_TESTED = "not tested"


@dataclass(frozen=True, slots=True)
class EffectEvidence:
    """Evidence of the data for one effect.

    Attributes:
        effect: Effect id.
        form: Form of the mechanism; '' where there is only one.
        axle: Axle number of an effect at one axle; 0 for the others.
        statistic: Statistic of the sign-flip test.
        p_value: P-value, all effects counted.
        absorbed: Share of the signature that the curve's own parameters imitate, 0 to 1.
        most_similar: Id of the effect with the most similar signature, and the cosine between them.
        gain_percent: Share by which the effect alone would lower the RMSE of the deciding data, %.
        decision: What was decided about the effect.
        worse_p_value: P-value with which the effect predicts worse than the causes, by the test
            that decided; NaN where no such test did.
        why: Test that an effect which is not named failed, a clause; '' for other decisions.

    """

    effect: str
    form: str
    axle: int
    statistic: float
    p_value: float
    absorbed: float
    most_similar: tuple[str, float]
    gain_percent: float
    decision: Decision = Decision.NOT_SIGNIFICANT
    worse_p_value: float = nan
    why: str = ""

    @property
    def is_tested(self) -> bool:
        """Whether the data identify it beside the curve, so that its p-value says something."""
        return self.decision is not Decision.NOT_TESTED

    @property
    def is_sure(self) -> bool:
        """Whether the deciding data alone would name the effect."""
        return _is_sure(self.p_value, self.gain_percent)

    def to_dict(self) -> dict[str, Any]:
        """Fields of `diagnosis.json`, where the key of `most_similar` is 'most_alike'."""
        document = asdict(self) | {"most_similar": list(self.most_similar)}
        return {"most_alike" if key == "most_similar" else key: document[key] for key in document}


class ModelScore(NamedTuple):
    """A model that was compared, with its error on blocks that were left out.

    Attributes:
        name: Its effects, or that it has none.
        held_out_rmse: RMSE of the whitened residuals of blocks that were left out, in standard
            deviations of the noise.
        decision: What was decided about its effect; None for the plain curve.

    """

    name: str
    held_out_rmse: float
    decision: Decision | None


class Untested(NamedTuple):
    """An effect or a quantity that the data do not identify.

    Attributes:
        what: Effect id or quantity.
        why: Reason, a clause.
        rejected: Whether it was tested, and is no finding for this reason.

    """

    what: str
    why: str
    rejected: bool = False


@dataclass(frozen=True, slots=True)
class ChannelEvidence:
    """Dependence of the selected model's residual on one channel.

    Attributes:
        channel: Name of the channel.
        unit: Unit of the channel.
        p_value: P-value, all channels counted.
        gain_percent: Share by which a spline in the channel would lower the RMSE, %.

    """

    channel: str
    unit: str
    p_value: float
    gain_percent: float

    @property
    def is_sure(self) -> bool:
        """Whether the residual depends on the channel for certain."""
        return _is_sure(self.p_value, self.gain_percent)


def _is_sure(p_value: float, gain_percent: float) -> bool:
    """Whether what was found is neither chance nor too small to matter."""
    return p_value <= SIGNIFICANT_P_VALUE and gain_percent >= LEAST_GAIN_PERCENT
