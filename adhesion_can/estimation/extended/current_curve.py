"""The curve of an extended model, effects included, in the conditions of the latest samples."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import copysign, expm1
from typing import NamedTuple

import numpy as np

from adhesion_can.arrays import Array
from adhesion_can.estimation.extended.slip_lags import SlipLags
from adhesion_can.physics.burckhardt import adhesion
from adhesion_can.physics.effects import (
    ActiveEffect,
    Change,
    Contact,
    LagStates,
    Observability,
    Parameter,
    Requirements,
    compute_change,
)
from adhesion_can.physics.estimate import Estimate
from adhesion_can.physics.lag_states import LagRequest

POINTS = 96
"""Number of points of the slip grid, evenly spaced in its logarithm."""
_SHARES = np.linspace(0.0, 1.0, POINTS)
LOWEST = 0.05
"""Slip at which the grid starts, as a share of the base curve's λ_m."""
UNUSUAL = 2.0
"""Ratio of the usual factor to 1, either way, from which it counts."""
_SIZES = np.geomspace(1e-3, 0.5, 24)
"""Sizes of the slip ratio among which the usual factor is the largest."""
LEAST_PULL, PULL_TIME_S = 0.015, 0.1
"""Mean adhesion from which its sign says traction or braking, and time constant of that mean, s.
Below it the last sign holds: while coasting, the effort's noise would turn it again and again."""


class LatestLagStates(SlipLags):
    """Lag states that also keep the latest value of each, by lag and axle."""

    def __init__(self) -> None:
        super().__init__()
        self.states: dict[tuple[str, int], float] = {}

    def _respond(self, asked: LagRequest) -> Array:
        """Response of a lag to its targets, as `LagStates.follow` defines it."""
        x = super()._respond(asked)
        for number, state in zip(asked.axle.tolist(), x.tolist(), strict=True):
            self.states[asked.name, int(number)] = state
        return x


class SteadyLagStates(LagStates):
    """Lag states for a curve in the conditions of the latest samples.

    A lag without a start value has reached its target, as in a constant slip. A lag with a start
    value has its latest state.

    Args:
        states: Latest state of each lag, by lag and axle, as `LatestLagStates.states` holds them.

    """

    def __init__(self, states: Mapping[tuple[str, int], float]) -> None:
        super().__init__()
        self._latest = states

    def _respond(self, asked: LagRequest) -> Array:
        """Response of a lag to its targets, as `LagStates.follow` defines it."""
        if asked.start is None:
            return asked.target
        numbers, index = np.unique(asked.axle, return_inverse=True)
        names = [(asked.name, int(number)) for number in numbers]
        states = np.array([self._latest.get(name, asked.start) for name in names])
        return np.asarray(states[index])


@dataclass(frozen=True, slots=True)
class Scale:
    """Constant factor of the adhesion, for a base curve at another level than the model's."""

    factor: float
    id: str = "scale"
    form: str = ""
    title: str = "the base curve is given at another level"
    parameters: tuple[Parameter, ...] = ()
    literature: str = ""
    requires: Requirements = Requirements()
    observability: Observability = Observability()

    def change(self, contact: Contact, _values: tuple[float, ...], _lags: LagStates) -> Change:
        """Change of the contacts."""
        return Change(contact.slip, self.factor)


class CurvePeaks(NamedTuple):
    """Peaks of the curve with effects.

    Attributes:
        mu_max: Largest adhesion of the mean curve of all axles, 1.
        lambda_m: Slip ratio of the mean curve's largest adhesion.
        axles: Peak (μ_max, λ_m) of each axle's curve, by axle.

    """

    mu_max: float
    lambda_m: float
    axles: Mapping[int, tuple[float, float]]


@dataclass(frozen=True, slots=True)
class LatestConditions:
    """Conditions of the latest samples.

    Attributes:
        contact: Latest contact of each axle, one row per axle; slip and creep speed are not used.
        sign: Sign of the slip: 1 in traction, -1 in braking.
        pull: Mean adhesion of all axles over the last `PULL_TIME_S`.

    """

    contact: Contact
    sign: float
    pull: float

    @classmethod
    def update(cls, contact: Contact, before: "LatestConditions | None") -> "LatestConditions":
        """Conditions after new contacts in the order of their stamps.

        Loads, places and states differ between axles; all other conditions are common to them.
        """
        numbers, last = np.unique(contact.axle[::-1], return_index=True)
        rows = len(contact.axle) - 1 - last
        if before is not None and len(numbers) < len(before.contact.axle):
            rows_before = ~np.isin(before.contact.axle, numbers)
        else:
            rows_before = None

        def latest(name: str) -> Array:
            now = np.asarray(getattr(contact, name)[rows])
            if rows_before is None or before is None:
                return now
            return np.concatenate([now, getattr(before.contact, name)[rows_before]])

        axle = latest("axle")
        everywhere = np.ones(len(axle))
        sign, pull = 1.0, float(contact.adhesion.mean())
        if before is not None:
            passed = max(float(contact.time_s[-1] - before.contact.time_s[0]), 0.0)
            sign = before.sign
            pull = before.pull + (pull - before.pull) * -expm1(-passed / PULL_TIME_S)
        return cls(
            Contact(
                slip=everywhere,
                creep_speed=everywhere,
                speed=everywhere * contact.speed.mean(),
                load=latest("load"),
                time_s=everywhere * contact.time_s[-1],
                axle=axle,
                place=latest("place"),
                adhesion=latest("adhesion"),
                covariates={n: everywhere * np.mean(c) for n, c in contact.covariates.items()},
            ),
            copysign(1.0, pull) if abs(pull) > LEAST_PULL else sign,
            pull,
        )

    def at_slips(self, sizes: Array) -> Contact:
        """Contacts of every axle at every size of the slip, the axles one after another."""

        def wide(column: Array) -> Array:
            return np.repeat(column, len(sizes))

        now = self.contact
        slip, speed = np.tile(self.sign * sizes, len(now.axle)), wide(now.speed)
        return Contact(
            slip=slip,
            creep_speed=slip * speed,
            speed=speed,
            load=wide(now.load),
            time_s=wide(now.time_s),
            axle=wide(now.axle),
            place=wide(now.place),
            adhesion=wide(now.adhesion),
            covariates={name: wide(column) for name, column in now.covariates.items()},
        )


def usual_factor(actives: Sequence[ActiveEffect], conditions: LatestConditions) -> float:
    """Largest factor of effects over the slip, mean of all axles; 1 where it is near 1.

    An effect of the load is 1 at its reference, far from the loads that the wheels may carry. What
    it takes from all samples alike says nothing of how much noise is in them.

    Args:
        actives: Effects in the contact.
        conditions: Conditions in which the factor is the usual one.

    """
    contact = conditions.at_slips(_SIZES)
    change = compute_change(actives, contact, SteadyLagStates({}))
    factor = np.broadcast_to(change.factor, contact.slip.shape).reshape(-1, len(_SIZES))
    usual = float(factor.mean(axis=0).max())
    return usual if np.isfinite(usual) and not 1.0 / UNUSUAL < usual < UNUSUAL else 1.0


def compute_peaks(
    estimate: Estimate,
    actives: Sequence[ActiveEffect],
    conditions: LatestConditions,
    lags: LagStates,
    slip_max: float,
) -> CurvePeaks:
    """Peaks of factor · curve(slip') over the slip, in given conditions.

    Args:
        estimate: Estimate of the base curve.
        actives: Effects in the contact.
        conditions: Conditions in which the peaks are computed.
        lags: Lag states of the effects.
        slip_max: Largest slip ratio of the model.

    """
    middle = min(max(estimate.lambda_m, 1e-4), slip_max)
    lowest = LOWEST * middle
    grid = lowest * (slip_max / lowest) ** _SHARES
    contact = conditions.at_slips(grid)
    slip, axles = contact.slip, len(conditions.contact.axle)
    change = compute_change(actives, contact, lags)
    factor = np.broadcast_to(change.factor, slip.shape).reshape(axles, POINTS)
    if change.slip is slip and not np.ptp(factor, axis=1).any():
        # The factor does not depend on slip: the peak keeps its slip, and no grid is needed.
        mu_max = factor[:, 0] * estimate.mu_max
        lambda_m = np.full(axles, estimate.lambda_m)
        pooled = float(mu_max.mean()), estimate.lambda_m
    else:
        entered = conditions.sign * change.slip.reshape(axles, POINTS)
        curves = factor * adhesion(entered, *estimate.theta)
        tops = _find_maxima(grid, np.concatenate([curves, curves.mean(axis=0)[None]]))
        mu_max, lambda_m = tops[0][:-1], tops[1][:-1]
        pooled = float(tops[0][-1]), float(tops[1][-1])
    pairs = zip(mu_max.tolist(), lambda_m.tolist(), strict=True)
    numbers = conditions.contact.axle.astype(int).tolist()
    return CurvePeaks(*pooled, dict(zip(numbers, pairs, strict=True)))


def _find_maxima(grid: Array, curves: Array) -> tuple[Array, Array]:
    """Maxima and their slips of curves (k, n) over a slip grid evenly spaced in its logarithm.

    Between the points a curve is a parabola through the highest point and its neighbours.
    """
    best = np.argmax(curves, axis=1)
    inner = np.clip(best, 1, len(grid) - 2)
    rows = np.arange(len(curves))
    before, top, after = (curves[rows, inner + k] for k in (-1, 0, 1))
    second = before - 2.0 * top + after
    shift = np.divide(0.5 * (before - after), second, out=np.zeros(len(best)), where=second < 0.0)
    shift = np.where(inner == best, np.clip(shift, -0.5, 0.5), 0.0)
    height = np.where(inner == best, top - 0.25 * (before - after) * shift, curves[rows, best])
    return height, grid[best] * np.exp(shift * np.log(grid[1] / grid[0]))
