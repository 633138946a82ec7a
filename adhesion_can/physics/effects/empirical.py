"""An effect that nobody can name: adhesion over some channel, as a spline found from data.

It is not one of `EFFECTS`: it explains nothing, it only says what was seen.
"""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
import scipy

from adhesion_can.arrays import Array
from adhesion_can.physics.effects.base import Change, Contact, Parameter
from adhesion_can.physics.effects.lag_states import LagStates

DEGREE = 3
CHANNELS = ("speed", "slip", "creep_speed", "load", "time_s", "axle")
"""Channels that every contact has; slip and creep speed by their size."""
KINDS = ("factor",)


@dataclass(frozen=True, slots=True)
class Empirical:
    """Factor 1 + s(x) with a cubic B-spline s; beyond its knots x counts as at the last of them.

    Attributes:
        channel: x: one of `CHANNELS`, or a covariate by name.
        kind: what it changes; 'factor' is all there is.
        knots: not descending, the first four alike and the last four alike.
        coefficients: of the B-splines, four fewer than the knots.

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
            raise ValueError("the first four knots must be alike, and the last four")

    @property
    def id(self) -> str:
        """Of every spline."""
        return "spline"

    @property
    def form(self) -> str:
        """Its channel."""
        return self.channel

    @property
    def title(self) -> str:
        """See `Described.title`."""
        return f"adhesion changes with {self.channel} in a way that no known effect describes"

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        """None: its coefficients are part of what it is."""
        return ()

    @property
    def literature(self) -> str:
        """See `Described.literature`."""
        return "Brynjarsdottir and O'Hagan, Inverse Problems 30 (2014) 114007"

    @property
    def needs(self) -> tuple[str, ...]:
        """The channel, where it is a covariate."""
        return () if self.channel in CHANNELS else (self.channel,)

    def change(self, contact: Contact, _values: tuple[float, ...], _lags: LagStates) -> Change:
        """See `ContactEffect.change`."""
        if self.channel in CHANNELS:
            x = np.asarray(getattr(contact, self.channel), dtype=np.float64)
            if self.channel in {"slip", "creep_speed"}:
                x = np.abs(x)
        else:
            x = contact.covariates[self.channel]
        return Change(contact.slip, 1.0 + self.at(x))

    def at(self, x: Array) -> Array:
        """S at values of the channel; shape of `x`."""
        inside = np.clip(x, self.knots[0], self.knots[-1])
        spline = _spline(self.knots, self.coefficients)
        return np.asarray(spline(inside), dtype=np.float64)


@lru_cache(maxsize=64)
def _spline(
    knots: tuple[float, ...], coefficients: tuple[float, ...]
) -> "scipy.interpolate.BSpline":
    return scipy.interpolate.BSpline(
        np.array(knots), np.array(coefficients), DEGREE, extrapolate=False
    )
