"""An effect as a candidate for the regression: its free parameters, start values and step sizes."""

from collections.abc import Sequence
from dataclasses import dataclass
from math import inf

import numpy as np

from adhesion_can.diagnosis.formatting import effect_name
from adhesion_can.physics.effects import ActiveEffect, Effect, Parameter, acts_in_contact

CHORD_STEP, FAR_STEP = 0.3, 3.0
"""Sizes, relative to the typical one, at which the signature of an absent effect is computed: many
effects are not linear in their size."""


@dataclass(frozen=True, slots=True)
class Candidate:
    """An effect that may be at work, and the axle at which it may be.

    Attributes:
        effect: Effect of the library.
        axle: Axle number of an effect at one axle; 0 for the others.
        is_lag: Whether the size is a time or a length by which something lags.
        plausible: Smallest and largest size that the vehicle may have.
        starts: Values of the further parameters at which a search starts, where the data give
            them; () for multiples of the typical ones.

    """

    effect: Effect
    axle: int = 0
    is_lag: bool = False
    plausible: tuple[float, float] = (-inf, inf)
    starts: tuple[tuple[float, ...], ...] = ()

    @property
    def size(self) -> int:
        """Number of free parameters."""
        return len(self.free_parameters)

    @property
    def name(self) -> str:
        """Effect id with form and axle."""
        return effect_name(self.effect.id, self.effect.form, self.axle)

    def active(self, values: Sequence[float]) -> ActiveEffect:
        """The effect with given values of its free parameters."""
        free = iter(values)
        return ActiveEffect(
            self.effect,
            tuple(
                float(next(free)) if p.free else self.known_value(p) for p in self.effect.parameters
            ),
        )

    def known_value(self, parameter: Parameter) -> float:
        """Value of a parameter that is not estimated."""
        return float(self.axle) if parameter.axle else parameter.typical

    def lower_bound(self, parameter: Parameter) -> float:
        """Smallest value of a parameter that a difference quotient may use.

        The size of an error of the instruments, as a delay, may be tried on both sides of 0. A
        one-sided difference of a noisy signal follows its noise, and finds a delay of milliseconds
        where there is none.
        """
        is_size = parameter == self.free_parameters[0]
        signed = is_size and not acts_in_contact(self.effect)
        return -parameter.upper if signed else parameter.lower

    @property
    def null_values(self) -> tuple[float, ...]:
        """Values of the free parameters at which the effect changes nothing."""
        if self.starts:
            return (0.0, *self.starts[len(self.starts) // 2])
        return (0.0, *(p.typical for p in self.free_parameters[1:]))

    @property
    def free_parameters(self) -> tuple[Parameter, ...]:
        """Parameters that are estimated."""
        return tuple(p for p in self.effect.parameters if p.free)

    @property
    def chord_sizes(self) -> tuple[float, ...]:
        """Sizes, relative to the typical one, at which the signature is computed.

        A delay, and a parameter with one sign, a length or a lost share, is seldom linear.
        """
        first = self.free_parameters[0]
        bent = first.lower == 0.0 or first.unit == "s"
        return (CHORD_STEP, FAR_STEP) if bent else (CHORD_STEP,)

    @property
    def start_values(self) -> tuple[tuple[float, ...], ...]:
        """Start values of a search: size 0, the other parameters at their `starts`.

        They step through them together; one with fewer of them stays at its last.
        """
        rest = self.free_parameters[1:]
        if self.starts:
            return tuple((0.0, *start) for start in self.starts)
        return tuple(
            (0.0, *(_start(p, number) for p in rest))
            for number in range(max((len(p.starts) for p in rest), default=1))
        )


def _start(parameter: Parameter, number: int) -> float:
    """Value of a further parameter at one of the starts of a search."""
    scale = parameter.starts[min(number, len(parameter.starts) - 1)]
    return float(np.clip(scale * parameter.typical, parameter.lower, parameter.upper))
