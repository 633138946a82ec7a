"""Cubic B-splines (de Boor, A Practical Guide to Splines, 1978) in every measured channel.

They model what a residual depends on when no mechanism is known. The spline of a channel multiplies
the predicted adhesion, as a change of the surface does; those of slip rate and effort are added to
it, as a signal error is.
"""

from dataclasses import dataclass
from enum import Enum

import numpy as np
import scipy

from adhesion_can.arrays import Array
from adhesion_can.diagnosis.regression.model import EvaluatedModel, RegressionData
from adhesion_can.physics.channels import channel_unit

COLUMNS, DRIVE_COLUMNS = 6, 14
"""Columns of a channel's spline; more along time and position, where more may happen."""
MOST_LEVELS = 3
"""A channel with no more values than these gets a column for each value."""
SEQUENCE_CHANNELS = ("slip_rate", "time", "position")
"""Channels that mean nothing where rows are independent points."""
CONSTANT = 1e-9
"""Range of a channel, relative to its largest value, that counts as constant."""


class ChannelKind(Enum):
    """How a channel acts on the adhesion; s(x) is its spline."""

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
        name: Name in reports, as in the catalogue `physics.channels`, or a column of a sample
            table.
        kind: How the channel acts on the adhesion.
        values: Values in every row, shape (n,).
        columns: Number of columns of the channel's spline.
        period: Length of a wave in the channel, in the channel's unit; 0 for none.

    """

    name: str
    kind: ChannelKind
    values: Array
    columns: int = COLUMNS
    period: float = 0.0

    @property
    def unit(self) -> str:
        """Unit of the values in reports; '' for a column of a sample table without a known unit."""
        return channel_unit(self.name)

    @property
    def constant(self) -> bool:
        """Whether the channel hardly varies, so that no dependence on it can be estimated."""
        spread = float(np.ptp(self.values)) if len(self.values) else 0.0
        return spread <= CONSTANT * max(float(np.abs(self.values).max(initial=0.0)), 1e-12)

    @property
    def knots(self) -> Array:
        """Knots of a cubic spline: quantiles of the values, the ends fourfold; shape (knots,)."""
        inner = np.quantile(self.values, np.linspace(0.0, 1.0, max(self.columns - 2, 2)))
        inner = np.unique(inner)
        return np.concatenate([np.repeat(inner[0], 3), inner, np.repeat(inner[-1], 3)])

    @property
    def levels(self) -> Array | None:
        """Values of a channel that has only a few, shape (levels,); None where it has many."""
        if self.name != "axle" and len(np.unique(self.values[::7])) > MOST_LEVELS:
            return None
        return np.unique(self.values)

    def build_basis(self, evaluation: EvaluatedModel) -> Array:
        """Changes of the prediction by each spline coefficient, adhesion; shape (n, columns)."""
        levels = self.levels
        if levels is not None:
            columns = (self.values[:, None] == levels).astype(np.float64)
        else:
            knots = self.knots
            inside = np.clip(self.values, knots[0], knots[-1])
            columns = scipy.interpolate.BSpline.design_matrix(inside, knots, 3).toarray()
        return np.asarray(columns * self.multiplier(evaluation)[:, None])

    def multiplier(self, evaluation: EvaluatedModel) -> Array:
        """Multiplier of s(x) in the prediction, adhesion; shape (n,)."""
        if self.kind is ChannelKind.FACTOR:
            return evaluation.predicted
        if self.kind is ChannelKind.CURVE:
            return np.copysign(1.0, evaluation.slip)
        return np.ones_like(evaluation.slip)


def build_channels(data: RegressionData, evaluation: EvaluatedModel) -> list[Channel]:
    """Every channel that all recordings have and that varies.

    Args:
        data: Rows of all drives.
        evaluation: Model evaluated at the estimated true slips.

    """
    speed, load = data.observed("speed"), data.observed("load")
    curve = ChannelKind.CURVE
    channels = [
        Channel("slip", ChannelKind.FACTOR, np.abs(evaluation.slip)),
        Channel("tractive_effort", curve, np.abs(evaluation.predicted) * load),
        Channel("slip_rate", ChannelKind.OFFSET, _compute_slip_rate(data, evaluation.slip)),
        Channel("speed", ChannelKind.FACTOR, speed),
        Channel("axle_load", ChannelKind.FACTOR, load),
        Channel("axle", ChannelKind.FACTOR, data.column("axle").astype(np.float64)),
        Channel("time", ChannelKind.FACTOR, data.column("time_s"), DRIVE_COLUMNS),
        Channel("position", ChannelKind.FACTOR, data.column("position"), DRIVE_COLUMNS),
    ]
    if any(drive.independent for drive in data.drives):
        channels = [channel for channel in channels if channel.name not in SEQUENCE_CHANNELS]
    names = set.intersection(*(set(drive.covariates) for drive in data.drives))
    for name in sorted(names):
        values = np.concatenate([drive.covariates[name] for drive in data.drives])
        channels.append(Channel(name, ChannelKind.FACTOR, values))
    return [channel for channel in channels if not channel.constant]


def _compute_slip_rate(data: RegressionData, slip: Array) -> Array:
    """Rate of change of the slip along each axle's rows, 1/s."""
    t_s = data.column("t_s")
    if len(t_s) < 2:
        return np.zeros(len(t_s))
    rate = np.gradient(slip) / np.where(np.gradient(t_s) > 0, np.gradient(t_s), np.inf)
    limit = np.quantile(np.abs(rate), 0.999) if len(rate) else 0.0
    return np.clip(rate, -limit, limit)
