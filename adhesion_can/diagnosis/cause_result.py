"""Causes of a diagnosis as plain values: named or refuted, with sizes by environment."""

from collections.abc import Iterable
from dataclasses import asdict, dataclass
from typing import Any

from adhesion_can.physics.effects.channel_factor import PREFIX
from adhesion_can.physics.effects.formula import FORMULA

LEAST_DOUBT = 0.5
"""Share of the time from which a doubt of the plain curve decides something."""
STAYS = 0.7
"""Share of that doubt from which the one of the extended model has stayed; true causes leave at
most 0.1 (decision 068)."""


@dataclass(frozen=True, slots=True)
class ParameterValue:
    """A parameter of a named effect.

    Attributes:
        name: Name of the parameter.
        value: Estimate in `unit`; the number of the axle where the parameter is one.
        std: Standard deviation of the estimate in `unit`; None for the number of an axle.
        unit: Unit of the value.
        meaning: Meaning of the parameter, a clause.
        at_bound: Whether the estimate is at the end of the parameter's range, where it says no more
            than that the true value may lie beyond.

    """

    name: str
    value: float
    std: float | None
    unit: str
    meaning: str
    at_bound: bool = False


def _parameters_to_dict(parameters: Iterable[ParameterValue]) -> dict[str, Any]:
    """Parameters by name, as fields of `diagnosis.json`."""
    return {
        v.name: {"value": v.value, "std": v.std, "unit": v.unit}
        | ({"at_bound": True} if v.at_bound else {})
        for v in parameters
    }


@dataclass(frozen=True, slots=True)
class Cause:
    """A named effect.

    Attributes:
        effect: Effect id.
        form: Form of the mechanism; '' where there is only one.
        title: Description of the mechanism, a clause.
        literature: Reference for the mechanism.
        parameters: Parameters with their estimates.
        p_value: P-value, all effects counted.
        rivals: Ids of effects that the data cannot distinguish from the named one.
        other_formulas: Formulas that the data cannot distinguish from the named one, as text.

    """

    effect: str
    form: str
    title: str
    literature: str
    parameters: tuple[ParameterValue, ...]
    p_value: float
    rivals: tuple[str, ...]
    other_formulas: tuple[str, ...] = ()

    def to_dict(self) -> dict[str, Any]:
        """Fields of `diagnosis.json`."""
        has_form = self.effect == FORMULA or self.effect.startswith(PREFIX)
        of_formula = {"other_formulas": list(self.other_formulas)} if has_form else {}
        return {
            "effect": self.effect,
            "form": self.form,
            "title": self.title,
            "parameters": _parameters_to_dict(self.parameters),
            "p_value": self.p_value,
            "rivals": list(self.rivals),
            **of_formula,
        }


@dataclass(frozen=True, slots=True)
class ClosestExplanation:
    """An effect that helps and was refuted as a cause.

    Attributes:
        effect: Effect id.
        form: Form of the mechanism, or the family of a curve; '' where there is only one form.
        title: Description of the mechanism, a clause.
        parameters: Parameters with their estimates.
        gain_percent: Gain over the model without it on held-out data, %.
        refuted_by: Reason why it is no cause, one clause.

    """

    effect: str
    form: str
    title: str
    parameters: tuple[ParameterValue, ...]
    gain_percent: float
    refuted_by: str

    def to_dict(self) -> dict[str, Any]:
        """Fields of `diagnosis.json`."""
        return {
            "effect": self.effect,
            "form": self.form,
            "title": self.title,
            "parameters": _parameters_to_dict(self.parameters),
            "gain": self.gain_percent,
            "refuted_by": self.refuted_by,
        }


@dataclass(frozen=True, slots=True)
class SizeLevel:
    """Size of an effect in one environment.

    Attributes:
        level: Description of the environment, such as 'axle 1'.
        value: Estimate in the effect's unit.
        std: Standard deviation of the estimate in the effect's unit.

    """

    level: str
    value: float
    std: float


@dataclass(frozen=True, slots=True)
class EnvironmentSizes:
    """Sizes of an effect in the environments of one partition of the rows.

    Attributes:
        effect: Effect id.
        parameter: Name of the effect's parameter that varies most.
        partition: Quantity by which the rows are divided.
        unit: Unit of the values.
        size: Value that holds for all rows, in `unit`.
        levels: Value in each environment that shows something about it.
        p_value: P-value of the differences, all partitions counted.
        spread: Standard deviation between environments, relative to the value for all rows.
        refutes: Whether the sizes differ for certain and by much.

    """

    effect: str
    parameter: str
    partition: str
    unit: str
    size: float
    levels: tuple[SizeLevel, ...]
    p_value: float
    spread: float
    refutes: bool

    def to_dict(self) -> dict[str, Any]:
        """Fields of `diagnosis.json`."""
        return asdict(self) | {"levels": [asdict(level) for level in self.levels]}


@dataclass(frozen=True, slots=True)
class Witness:
    """The service's own doubt on the diagnosed recording, a second witness beside the regression.

    Attributes:
        recording: Name of the recording.
        doubt_before: Share of the time in which the service doubts the plain curve, 0..1.
        doubt_after: Share of the time in which it doubts the extended model, 0..1.

    """

    recording: str
    doubt_before: float
    doubt_after: float

    @property
    def stays(self) -> bool:
        """Whether there is a doubt that the extended model does not remove."""
        before, after = self.doubt_before, self.doubt_after
        return before >= LEAST_DOUBT and after >= STAYS * before

    def to_dict(self) -> dict[str, Any]:
        """Fields of `diagnosis.json`."""
        return asdict(self)
