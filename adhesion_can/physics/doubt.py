"""Doubt: the condition that the residual depends on, where the model in use cannot explain it."""

from collections.abc import Mapping
from enum import IntEnum


class Doubt(IntEnum):
    """Condition that the residual depends on, as `AdhesionQuality.Doubt` carries it."""

    NONE = 0
    SHAPE = 1
    SPEED = 2
    AXLE_LOAD = 3
    DIRECTION = 4
    AXLE = 5
    TIME = 6
    RATE_OF_SLIP = 7
    SURROUNDINGS = 8
    NOT_AVAILABLE = 15

    @property
    def json_name(self) -> str | None:
        """Name as JSON has it; None where not available."""
        return None if self is Doubt.NOT_AVAILABLE else self.name.lower()


DESCRIPTIONS: Mapping[Doubt, str] = {
    Doubt.SHAPE: "the curve has another shape",
    Doubt.SPEED: "adhesion depends on speed",
    Doubt.AXLE_LOAD: "adhesion depends on axle load",
    Doubt.DIRECTION: "adhesion differs between traction and braking",
    Doubt.AXLE: "axles differ",
    Doubt.TIME: "adhesion depends on time and work since the surface changed",
    Doubt.RATE_OF_SLIP: "adhesion depends on the rate of slip",
    Doubt.SURROUNDINGS: "adhesion depends on the surroundings",
}
"""Sentence for each condition, without a full stop."""


def doubt_sentence(doubt: Doubt) -> str:
    """What is doubted and what to do about it; '' where nothing is."""
    what = DESCRIPTIONS.get(doubt)
    return "" if what is None else f"doubt: {what}: run `diagnose`"
