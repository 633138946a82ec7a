"""Numbers, units and names as text for sentences and tables."""

from collections.abc import Iterable
from math import floor, isfinite, log10

import numpy as np

from adhesion_can.diagnosis.cause_result import ParameterValue
from adhesion_can.physics.effects import forms_of_effect
from adhesion_can.physics.effects.effort_gain import EFFORT_GAIN, EFFORT_GAIN_TITLE
from adhesion_can.physics.effects.shape_factor import CURVE_SHAPE, CURVE_SHAPE_TITLE

LEAST_P = 1e-3
"""Smallest p-value that is printed; a smaller one is printed as being below it."""
LEAST_PLAIN, MOST_PLAIN = 1e-3, 1e5
"""Numbers outside which an axis has a power of ten in its title."""
_RAISED = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")


def effect_name(effect: str, form: str = "", axle: int = 0) -> str:
    """Id with form and axle where there are any."""
    where = f"axle {axle}" if axle else ""
    # A form of that name is the one at an axle.
    kind = "" if axle and form == "axle" else form
    return " ".join(part for part in (effect, kind, where) if part)


def title(effect: str) -> str:
    """Title of an effect, a clause; the id of an effect that is not known."""
    if effect == CURVE_SHAPE:
        return CURVE_SHAPE_TITLE
    return next((known.title for known in forms_of_effect(effect)), effect)


def rival_title(effect: str) -> str:
    """Title of an effect whose sign is not known, a clause: a signal comes late or early."""
    if effect == EFFORT_GAIN:  # a rival is named by its id alone, whatever its form
        return EFFORT_GAIN_TITLE
    known = next(iter(forms_of_effect(effect)), None)
    below = "" if known is None else known.observability.below.partition(":")[0]
    return f"{title(effect)}, or {below}" if below else title(effect)


def unit_text(unit: str) -> str:
    """A unit as written after a number; empty for a pure number."""
    return (
        "" if unit == "1" else unit.replace("degC", "°C").replace("^2", "²").replace("kg m", "kg·m")
    )


def sizes(values: Iterable[ParameterValue]) -> str:
    """Parameters of an effect by name."""
    return ", ".join(f"{v.name} {value_text(v)}" for v in values)


def value_text(value: ParameterValue) -> str:
    """A parameter's value with its unit, and its standard deviation where it is estimated."""
    if value.at_bound:
        return value_and_unit(value.value, value.unit) + " (at its bound)"
    if value.std is None:
        return value_and_unit(value.value, value.unit)
    return measured(value.value, value.std, value.unit)


def value_and_unit(value: float, unit: str) -> str:
    """A value without a standard deviation, four digits."""
    return f"{value:.4g} {unit_text(unit)}".strip()


def measured(value: float, std: float | None, unit: str) -> str:
    """A value with standard deviation and unit, as many digits as the standard deviation allows."""
    return f"{_plus_minus(value, std)} {unit_text(unit)}".strip()


def _plus_minus(value: float, std: float | None) -> str:
    if std is None or not isfinite(std):
        return f"{value:g}" if value == round(value) else f"{short(value)} ± ?"
    size = max(abs(value), std)
    if size == 0.0 or not isfinite(size):
        return f"{value:g} ± {std:g}"
    power = floor(log10(size))
    scaled = power < -3 or power > 5
    factor = 10.0**power if scaled else 1.0
    # Two digits of the standard deviation.
    digits = 3 if std == 0.0 else max(1 - floor(log10(std / factor)), 0)
    text = f"{value / factor:.{digits}f} ± {std / factor:.{digits}f}"
    return f"({text})e{power}" if scaled else text


def short(value: float, digits: int = 3) -> str:
    """A few digits, never as a power of ten."""
    if not isfinite(value):
        return "-"
    return str(np.format_float_positional(value, digits, unique=False, fractional=False, trim="-"))


def three_digits(value: float) -> str:
    """Three digits, zeros at the end included, never as a power of ten."""
    if not isfinite(value):
        return "-"
    text = np.format_float_positional(value, 3, unique=False, fractional=False, trim="k")
    return str(text).removesuffix(".")


def axis_scale(size: float, unit: str) -> tuple[float, str]:
    """Factor of the numbers on an axis, and its unit with the power of ten that they leave out.

    Args:
        size: Typical number, in `unit`.
        unit: Unit; '' or '1' for a pure number.

    """
    text = unit_text(unit)
    if not isfinite(size) or size == 0.0 or LEAST_PLAIN <= abs(size) < MOST_PLAIN:
        return 1.0, text
    power = floor(log10(abs(size)))
    return 10.0**-power, f"× 10{str(power).translate(_RAISED)} {text}".strip()


def short_apart(low: float, high: float) -> tuple[str, str]:
    """Both in three digits, or in as many as distinguish them."""
    texts = [(short(low, digits), short(high, digits)) for digits in range(3, 17)]
    return next((pair for pair in texts if pair[0] != pair[1]), texts[-1])


def p_text(p_value: float) -> str:
    """A p-value."""
    if not isfinite(p_value):
        return "-"
    return f"< {LEAST_P:g}" if p_value < LEAST_P else f"{p_value:.3f}"


def p_equation(p_value: float) -> str:
    """A p-value in a sentence."""
    text = p_text(p_value)
    return f"p {text}" if text.startswith("<") else f"p = {text}"


def fixed(value: float, digits: int, unit: str = "") -> str:
    """A number with so many decimals and its unit, or a dash."""
    return f"{value:.{digits}f}{unit}" if isfinite(value) else "-"
