"""What was learned, in words: 'vehicle speed reads 1.00 ± 0.10 % low'."""

from collections.abc import Callable, Iterable, Mapping

from adhesion_can.diagnosis.cause_result import Cause, ParameterValue
from adhesion_can.diagnosis.formatting import measured, sizes


def describe_causes(causes: Iterable[Cause]) -> str:
    """Causes with their sizes, clauses joined by 'and'."""
    return " and ".join(map(describe_cause, causes))


def describe_cause(cause: Cause) -> str:
    """A cause with its size, a clause."""
    own_words = _OWN_WORDS.get((cause.effect, cause.form))
    if own_words is None or any(value.at_bound for value in cause.parameters):
        return f"{cause.title} ({sizes(cause.parameters)})"
    return own_words({value.name: value for value in cause.parameters})


_Values = Mapping[str, ParameterValue]


def _size(value: ParameterValue, factor: float, unit: str) -> str:
    """Magnitude of a parameter in another unit, `factor` times the value."""
    std = None if value.std is None else factor * value.std
    return measured(abs(factor * value.value), std, unit)


def _reading(what: str, name: str, factor: float, unit: str) -> Callable[[_Values], str]:
    """Clause on a reading that is high or low by a parameter, `factor` times its value."""

    def describe(values: _Values) -> str:
        side = "high" if values[name].value > 0.0 else "low"
        return f"{what} {_size(values[name], factor, unit)} {side}"

    return describe


def _wheel_radius(values: _Values) -> str:
    error, axle = values["error"], values["axle"]
    side = "larger" if error.value > 0.0 else "smaller"
    return f"the wheels of axle {axle.value:g} are {_size(error, 100, '%')} {side} than configured"


def _rail_cleaning(values: _Values) -> str:
    gain = values["gain"]
    side = "more" if gain.value > 0.0 else "less"
    return f"each axle finds {_size(gain, 100, '%')} {side} adhesion than the axle ahead"


_OWN_WORDS: Mapping[tuple[str, str], Callable[[_Values], str]] = {
    ("speed_scale", ""): _reading("vehicle speed reads", "error", 100, "%"),
    ("effort_bias", ""): _reading("efforts read", "bias", 1e-3, "kN"),
    ("effort_gain", "all"): _reading("efforts read", "gain", 100, "%"),
    ("wheel_radius", ""): _wheel_radius,
    ("rail_cleaning", ""): _rail_cleaning,
}
"""Words for effects by id and form; others have their title and the names of their parameters."""
