"""What was learned, in words: 'vehicle speed reads 1.00 ± 0.10 % low'."""

from collections.abc import Callable, Iterable, Mapping

from adhesion_can.diagnosis.cause_result import Cause, ParameterValue
from adhesion_can.diagnosis.formatting import measured, sizes


def describe_causes(causes: Iterable[Cause]) -> str:
    """Causes with their sizes, clauses joined by 'and'."""
    return " and ".join(map(describe_cause, causes))


def describe_cause(cause: Cause) -> str:
    """A cause with its size, a clause."""
    own = _OWN_WORDS.get((cause.effect, cause.form))
    if own is None or any(value.at_bound for value in cause.parameters):
        return f"{cause.title} ({sizes(cause.parameters)})"
    return own({value.name: value for value in cause.parameters})


_Values = Mapping[str, ParameterValue]


def _size(value: ParameterValue, factor: float, unit: str) -> str:
    """Magnitude of a parameter in another unit, `factor` times the value."""
    std = None if value.std is None else factor * value.std
    return measured(abs(factor * value.value), std, unit)


def _speed_scale(values: _Values) -> str:
    error = values["error"]
    return f"vehicle speed reads {_size(error, 100, '%')} {_side(error.value)}"


def _effort_bias(values: _Values) -> str:
    bias = values["bias"]
    return f"efforts read {_size(bias, 1e-3, 'kN')} {_side(bias.value)}"


def _effort_gain(values: _Values) -> str:
    gain = values["gain"]
    return f"efforts read {_size(gain, 100, '%')} {_side(gain.value)}"


def _wheel_radius(values: _Values) -> str:
    error, axle = values["error"], values["axle"]
    side = "larger" if error.value > 0.0 else "smaller"
    return f"the wheels of axle {axle.value:g} are {_size(error, 100, '%')} {side} than configured"


def _rail_cleaning(values: _Values) -> str:
    gain = values["gain"]
    side = "more" if gain.value > 0.0 else "less"
    return f"each axle finds {_size(gain, 100, '%')} {side} adhesion than the axle ahead"


def _side(value: float) -> str:
    return "high" if value > 0.0 else "low"


_OWN_WORDS: Mapping[tuple[str, str], Callable[[_Values], str]] = {
    ("speed_scale", ""): _speed_scale,
    ("effort_bias", ""): _effort_bias,
    ("effort_gain", "all"): _effort_gain,
    ("wheel_radius", ""): _wheel_radius,
    ("rail_cleaning", ""): _rail_cleaning,
}
"""Words for effects by id and form; others have their title and the names of their parameters."""
