"""An effect without a known mechanism: adhesion over some channel, as a spline found from data.

It is not one of `EFFECTS`: it describes what was observed and explains nothing.
"""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
import scipy

from adhesion_can.arrays import Array
from adhesion_can.physics.channels import CHANNELS
from adhesion_can.physics.effects.base import (
    Change,
    Contact,
    Observability,
    Requirements,
)
from adhesion_can.physics.lag_states import LagStates
from adhesion_can.physics.parameter import Parameter

DEGREE = 3
"""Degree of the splines."""
CONTACT_CHANNELS = tuple(channel.contact for channel in CHANNELS if channel.contact)
"""Channels of every contact, by their attribute of `Contact`; slip and creep speed as magnitude."""
KINDS = ("factor",)
"""Quantities that a spline may change: 'factor', the factor of the adhesion."""


@dataclass(frozen=True, slots=True)
class Empirical:
    """Factor 1 + s(x) with a cubic B-spline s, constant beyond its first and its last knot.

    Attributes:
        channel: Name of x: one of `CONTACT_CHANNELS`, or a covariate.
        kind: Quantity that the spline changes, one of `KINDS`.
        knots: Knots in ascending order, the first four alike and the last four alike.
        coefficients: Coefficients of the B-splines, four fewer than the knots.

    """

    channel: str
    kind: str
    knots: tuple[float, ...]
    coefficients: tuple[float, ...]

    def __post_init__(self) -> None:
        if not self.channel:
            raise ValueError("a spline needs the name of its channel")
        if self.kind not in KINDS:
            raise ValueError(f"kind {self.kind!r}: write {' or '.join(KINDS)}")
        knots, order = self.knots, DEGREE + 1
        if len(self.coefficients) < order or len(knots) != len(self.coefficients) + order:
            raise ValueError(
                f"{len(knots)} knots and {len(self.coefficients)} coefficients: a cubic spline has "
                "at least 4 coefficients, and 4 knots more"
            )
        if not np.isfinite((*knots, *self.coefficients)).all():
            raise ValueError("knots and coefficients must be finite")
        if np.any(np.diff(knots) < 0) or not knots[0] < knots[-1]:
            raise ValueError("knots must not descend, and must span a range")
        if knots[0] != knots[DEGREE] or knots[-1] != knots[-order]:
            raise ValueError("the first four knots must be equal, and the last four too")

    @property
    def id(self) -> str:
        """Fixed name of all splines."""
        return "spline"

    @property
    def form(self) -> str:
        """Name of the channel."""
        return self.channel

    @property
    def title(self) -> str:
        """What happens, a clause."""
        return f"adhesion changes with {self.channel} in a way that no known effect describes"

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        """No parameters: the coefficients are fields of the spline."""
        return ()

    @property
    def literature(self) -> str:
        """Reference."""
        return "Brynjarsdottir and O'Hagan, Inverse Problems 30 (2014) 114007"

    @property
    def requires(self) -> Requirements:
        """The channel, where it is a covariate."""
        return _requirements(self.channel)

    @property
    def observability(self) -> Observability:
        """Residuals over the channel; a spline over time is a drift."""
        return Observability(self.channel, self.channel, drift=self.channel == "time_s")

    def change(self, contact: Contact, _values: tuple[float, ...], _lags: LagStates) -> Change:
        """Change of the contacts."""
        if self.channel in CONTACT_CHANNELS:
            x = np.asarray(getattr(contact, self.channel), dtype=np.float64)
            if self.channel in {"slip", "creep_speed"}:
                x = np.abs(x)
        else:
            x = contact.covariates[self.channel]
        return Change(contact.slip, 1.0 + self.at(x))

    def at(self, x: Array) -> Array:
        """Value s(x) of the spline at values of the channel; shape of `x`."""
        inside = np.clip(x, self.knots[0], self.knots[-1])
        spline = _spline(self.knots, self.coefficients)
        return np.asarray(spline(inside), dtype=np.float64)


@lru_cache(maxsize=64)
def _requirements(channel: str) -> Requirements:
    return Requirements(covariates=() if channel in CONTACT_CHANNELS else (channel,))


@lru_cache(maxsize=64)
def _spline(
    knots: tuple[float, ...], coefficients: tuple[float, ...]
) -> "scipy.interpolate.BSpline":
    return scipy.interpolate.BSpline(
        np.array(knots), np.array(coefficients), DEGREE, extrapolate=False
    )
