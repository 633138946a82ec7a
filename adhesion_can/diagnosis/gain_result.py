"""Gain of a model over the plain curve, as plain values."""

from dataclasses import dataclass
from enum import Flag, auto
from typing import Any

MUCH_LEFT = 1.5
"""RMSE over the noise floor from which what the plain curve leaves is not called noise."""


@dataclass(frozen=True, slots=True)
class Comparison:
    """RMSE of the adhesion of a model beside that of the plain curve.

    Attributes:
        rmse: RMSE of the model.
        percent: Gain over the plain curve, %.
        interval: 95 % interval of the gain, %; infinite where there are too few spans.
        plain: RMSE of the plain curve.

    """

    rmse: float
    percent: float
    interval: tuple[float, float]
    plain: float

    def to_dict(self) -> dict[str, Any]:
        """As JSON has it."""
        return {"rmse": self.rmse, "percent": self.percent, "interval": list(self.interval)}


class GainMethod(Flag):
    """How a gain and its interval were computed, where not plainly over the units."""

    PLAIN = 0
    WITHOUT_SPEED_ERRORS = auto()
    WHERE_IT_ACTS = auto()

    @property
    def note(self) -> str:
        """What is said of it behind what was held out; '' for the plain gain."""
        return "".join(_METHOD_NOTES[method] for method in self)

    @property
    def names(self) -> list[str]:
        """As JSON has it."""
        return [str(method.name).lower() for method in self]


_METHOD_NOTES = {
    GainMethod.WITHOUT_SPEED_ERRORS: ("; vehicle-speed errors that all axles share are removed"),
    GainMethod.WHERE_IT_ACTS: (
        "; the interval is that of the gain on these data, where the models differ"
    ),
}


@dataclass(frozen=True, slots=True)
class Gain:
    """Gain of the extended model on held-out data.

    Attributes:
        rmse_before: RMSE of the plain model's adhesion on the held-out data.
        rmse_after: RMSE of the extended model's adhesion on the held-out data.
        noise_floor: RMSE on the deciding data with the effects and a spline in every channel.
        percent: Gain 100 (1 − after/before), %.
        interval: 95 % confidence interval of the gain, %.
        units: Description of the data that were held out, a clause.
        spans: Recording, start and end of each held-out span, s on the recording's clock.
        as_written: The model as written, where whole recordings were held out; there
            `rmse_after` is that with the curve refitted. None elsewhere.
        method: How gain and interval were computed.
        whole: Whether whole recordings were held out.

    """

    rmse_before: float
    rmse_after: float
    noise_floor: float
    percent: float
    interval: tuple[float, float]
    units: str
    spans: tuple[tuple[str, float, float], ...]
    as_written: Comparison | None = None
    method: GainMethod = GainMethod.PLAIN
    whole: bool = False

    @property
    def held_out(self) -> str:
        """Description of the data that were held out and of how they were used, a clause."""
        return self.units + self.method.note

    @property
    def leaves_much(self) -> bool:
        """Whether the plain model leaves far more than noise."""
        return self.rmse_before > MUCH_LEFT * self.noise_floor

    def to_dict(self) -> dict[str, Any]:
        """Fields of `diagnosis.json`."""
        document: dict[str, Any] = {
            "rmse_before": self.rmse_before,
            "rmse_after": self.rmse_after,
            "noise_floor": self.noise_floor,
            "percent": self.percent,
            "interval": list(self.interval),
            "held_out": self.held_out,
            "method": self.method.names,
            "spans": [[begin, end] for _, begin, end in self.spans],
            "recordings": [recording for recording, _, _ in self.spans],
        }
        written = self.as_written
        if written is not None:
            document["as_written"] = {
                "rmse_before": written.plain,
                "rmse_after": written.rmse,
                "noise_floor": self.noise_floor,
                "percent": written.percent,
                "interval": list(written.interval),
            }
        return document
