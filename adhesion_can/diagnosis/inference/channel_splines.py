"""What a residual may depend on without a mechanism being known: splines in every channel.

A channel's spline multiplies the predicted adhesion, as a change of the rail would; those of slip
rate and effort are added to it, as a wrong signal would be.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from enum import Enum

import numpy as np
import scipy

from adhesion_can.arrays import Array
from adhesion_can.diagnosis.regression.model import Evaluation, Study

FEW, MANY = 6, 14
"""Columns of a channel's spline; of time and position, along which more may happen."""
FEWEST = 3
"""A channel with no more values than these is taken value by value."""
CONSTANT = 1e-9


class Kind(Enum):
    """How a channel acts."""

    FACTOR = "factor"
    """μ · (1 + s(x))"""
    CURVE = "curve"
    """μ + sign(λ) s(x)"""
    OFFSET = "offset"
    """μ + s(x)"""


@dataclass(frozen=True, eq=False)
class Channel:
    """A quantity that is known in every row.

    Attributes:
        name: as reports have it.
        unit: likewise.
        kind: how it would act.
        values: shape (n,).
        columns: of its spline.
        period: of a wave in it; 0 for none.

    """

    name: str
    unit: str
    kind: Kind
    values: Array
    columns: int = FEW
    period: float = 0.0

    @property
    def constant(self) -> bool:
        """Whether it hardly moves: nothing can be said of it then."""
        spread = float(np.ptp(self.values)) if len(self.values) else 0.0
        return spread <= CONSTANT * max(float(np.abs(self.values).max(initial=0.0)), 1e-12)

    @property
    def knots(self) -> Array:
        """Of a cubic spline with even shares of the rows between them, ends fourfold."""
        inner = np.quantile(self.values, np.linspace(0.0, 1.0, max(self.columns - 2, 2)))
        inner = np.unique(inner)
        return np.concatenate([np.repeat(inner[0], 3), inner, np.repeat(inner[-1], 3)])

    @property
    def levels(self) -> Array | None:
        """The values of a channel that has but a few; None where it has many."""
        if self.name != "axle" and len(np.unique(self.values[::7])) > FEWEST:
            return None
        return np.unique(self.values)

    def basis(self, at: Evaluation) -> Array:
        """Columns by which its spline changes the prediction, shape (n, columns)."""
        levels = self.levels
        if levels is not None:
            columns = (self.values[:, None] == levels).astype(np.float64)
        else:
            knots = self.knots
            inside = np.clip(self.values, knots[0], knots[-1])
            columns = scipy.interpolate.BSpline.design_matrix(inside, knots, 3).toarray()
        return np.asarray(columns * self.weight(at)[:, None])

    def weight(self, at: Evaluation) -> Array:
        """By what s(x) is multiplied, shape (n,)."""
        if self.kind is Kind.FACTOR:
            return at.predicted
        if self.kind is Kind.CURVE:
            return np.copysign(1.0, at.slip)
        return np.ones_like(at.slip)


_UNITS: Mapping[str, str] = {
    "ambient_temperature_degC": "degC",
    "rail_temperature_degC": "degC",
    "relative_humidity_percent": "%",
    "sanding_active": "",
    "rain": "",
    "gradient": "m/m",
    "curvature_per_m": "1/m",
}


def channels_of(study: Study, at: Evaluation) -> list[Channel]:
    """Every channel that the recordings have and that moves.

    Args:
        study: see there.
        at: the model's evaluation at the likely slips.

    """
    seen = [course.observe() for course in study.courses]
    speed, load = (
        np.concatenate([getattr(one, name) for one in seen]) for name in ("speed", "load")
    )
    curve = Kind.CURVE
    found = [
        Channel("slip", "1", Kind.FACTOR, np.abs(at.slip)),
        Channel("tractive_effort", "N", curve, np.abs(at.predicted) * load),
        Channel("slip_rate", "1/s", Kind.OFFSET, _rates(study, at.slip)),
        Channel("speed", "m/s", Kind.FACTOR, speed),
        Channel("axle_load", "N", Kind.FACTOR, load),
        Channel("axle", "1", Kind.FACTOR, study.column("axle").astype(np.float64)),
        Channel("time", "s", Kind.FACTOR, study.column("time_s"), MANY),
        Channel("position", "m", Kind.FACTOR, study.column("position"), MANY),
    ]
    names = set.intersection(*(set(course.covariates) for course in study.courses))
    for name in sorted(names):
        values = np.concatenate([course.covariates[name] for course in study.courses])
        found.append(Channel(name, _UNITS.get(name, ""), Kind.FACTOR, values))
    return [channel for channel in found if not channel.constant]


def _rates(study: Study, slip: Array) -> Array:
    """Rate of change of the slip along each axle's rows, 1/s."""
    t_s = study.column("t_s")
    rate = np.gradient(slip) / np.where(np.gradient(t_s) > 0, np.gradient(t_s), np.inf)
    limit = np.quantile(np.abs(rate), 0.999) if len(rate) else 0.0
    return np.clip(rate, -limit, limit)
