"""Estimates of an effect's parameters as values of the result."""

import numpy as np

from adhesion_can.diagnosis.cause_result import ParameterValue
from adhesion_can.diagnosis.regression.whitened_regression import FittedModel
from adhesion_can.physics.effects import Effect
from adhesion_can.physics.parameter import Parameter


def parameter_values(
    fitted: FittedModel, place: int, *, has_load: bool
) -> tuple[ParameterValue, ...]:
    """Parameters of one effect of a fitted model.

    Args:
        fitted: Fitted model.
        place: Place of the effect among the model's.
        has_load: Whether the axle loads are known.

    """
    candidate = fitted.model.candidates[place]
    first = fitted.model.first_parameter(place)
    std = iter(np.sqrt(fitted.covariance.diagonal())[first : first + candidate.size])
    numbers = iter(fitted.model.values[place])
    return tuple(
        _parameter_value(p, next(numbers), float(next(std)), has_load=has_load)
        if p.free
        else ParameterValue(p.name, candidate.known_value(p), None, p.unit, p.meaning)
        for p in candidate.effect.parameters
    )


def _parameter_value(
    parameter: Parameter, value: float, std: float, *, has_load: bool
) -> ParameterValue:
    """An estimate, which at the end of its range has no standard deviation."""
    at_bound = parameter.is_at_bound(value)
    known = None if at_bound else std
    unit, meaning = parameter.unit, parameter.meaning
    if unit == "N" and not has_load:
        # Adhesion times a load of 1 is the force of a table without loads.
        unit, meaning = "1", f"{meaning}, as a share of the load"
    return ParameterValue(parameter.name, value, known, unit, meaning, at_bound=at_bound)


def effect_title(effect: Effect, size: ParameterValue) -> str:
    """What happens, by the sign of the effect's size."""
    return (size.value < 0.0 and effect.observability.below) or effect.title
