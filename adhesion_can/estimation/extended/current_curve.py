"""The whole curve of an extended model in the condition that the latest samples saw."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import copysign
from typing import NamedTuple

import numpy as np

from adhesion_can.arrays import Array
from adhesion_can.physics.burckhardt import adhesion
from adhesion_can.physics.effects import ActiveEffect, Contact, LagStates, compute_change
from adhesion_can.physics.estimate import Estimate

POINTS = 96
"""Of the slip grid, evenly in its logarithm."""
_SHARES = np.linspace(0.0, 1.0, POINTS)
LOWEST = 0.05
"""Slip at which the grid begins, as a share of the base curve's λ_m."""
PULLING = 0.01
"""Mean adhesion from which axles pull or brake; below it they do as before."""


class Latest(LagStates):
    """A memory that also tells its latest states, by lag and axle."""

    def __init__(self) -> None:
        super().__init__()
        self.states: dict[tuple[str, int], float] = {}

    def follow(
        self,
        name: str,
        axle: Array,
        time_s: Array,
        target: Array,
        rate: Array | float,
        start: float | None = None,
    ) -> Array:
        """See `LagStates.follow`."""
        x = super().follow(name, axle, time_s, target, rate, start)
        for number, state in zip(axle.tolist(), x.tolist(), strict=True):
            self.states[name, int(number)] = state
        return x


class Held(LagStates):
    """A memory for a curve at the present moment.

    What follows its target has come up to it, as it does in a slip that is kept; what gathers from
    a start of its own stands as it stands now.

    Args:
        states: of `Latest`.

    """

    def __init__(self, states: Mapping[tuple[str, int], float]) -> None:
        super().__init__()
        self._now = states

    def follow(
        self,
        name: str,
        axle: Array,
        time_s: Array,
        target: Array,
        rate: Array | float,
        start: float | None = None,
    ) -> Array:
        """See `LagStates.follow`."""
        del time_s, rate
        if start is None:
            return target
        numbers, index = np.unique(axle, return_inverse=True)
        states = np.array([self._now.get((name, int(number)), start) for number in numbers])
        return np.asarray(states[index])


class Peaks(NamedTuple):
    """Peaks of the whole curve now: pooled, and of each axle."""

    mu_max: float
    lambda_m: float
    axles: Mapping[int, tuple[float, float]]


@dataclass(frozen=True, slots=True)
class Present:
    """The condition that the latest samples saw.

    Attributes:
        contact: a row an axle: its latest one; its slip and creep are not looked at.
        sign: 1 in traction, -1 in braking.

    """

    contact: Contact
    sign: float

    @classmethod
    def after(cls, contact: Contact, before: "Present | None") -> "Present":
        """Condition after contacts in the order of their stamps.

        Axles have loads, places and states of their own; all else they have in common.
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
        pull = float(contact.adhesion.mean())
        sign = 1.0 if before is None else before.sign
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
            copysign(1.0, pull) if abs(pull) > PULLING else sign,
        )


def peaks_of(
    estimate: Estimate,
    actives: Sequence[ActiveEffect],
    present: Present,
    held: LagStates,
    slip_max: float,
) -> Peaks:
    """Peaks of factor · curve(slip') over the slip, in the present condition.

    Args:
        estimate: of the base curve.
        actives: effects in the contact.
        present: see there.
        held: states of what lags behind.
        slip_max: end of the valid range of slip.

    """
    middle = min(max(estimate.lambda_m, 1e-4), slip_max)
    lowest = LOWEST * middle
    grid = lowest * (slip_max / lowest) ** _SHARES
    contact, axles = present.contact, len(present.contact.axle)

    def wide(column: Array) -> Array:
        return np.repeat(column, POINTS)

    slip = np.tile(present.sign * grid, axles)
    speed = wide(contact.speed)
    change = compute_change(
        actives,
        Contact(
            slip=slip,
            creep_speed=slip * speed,
            speed=speed,
            load=wide(contact.load),
            time_s=wide(contact.time_s),
            axle=wide(contact.axle),
            place=wide(contact.place),
            adhesion=wide(contact.adhesion),
            covariates={name: wide(column) for name, column in contact.covariates.items()},
        ),
        held,
    )
    factor = np.broadcast_to(change.factor, slip.shape).reshape(axles, POINTS)
    if change.slip is slip and not np.ptp(factor, axis=1).any():
        # No slip is favoured: the peak stays in its place, and no grid need find it.
        mu_max = factor[:, 0] * estimate.mu_max
        lambda_m = np.full(axles, estimate.lambda_m)
        pooled = float(mu_max.mean()), estimate.lambda_m
    else:
        entered = present.sign * change.slip.reshape(axles, POINTS)
        curves = factor * adhesion(entered, *estimate.theta)
        tops = _tops(grid, np.concatenate([curves, curves.mean(axis=0)[None]]))
        mu_max, lambda_m = tops[0][:-1], tops[1][:-1]
        pooled = float(tops[0][-1]), float(tops[1][-1])
    pairs = zip(mu_max.tolist(), lambda_m.tolist(), strict=True)
    return Peaks(*pooled, dict(zip(contact.axle.astype(int).tolist(), pairs, strict=True)))


def _tops(grid: Array, curves: Array) -> tuple[Array, Array]:
    """Heights and places of the highest points of curves (k, n) over a grid even in its logarithm.

    Between the points a curve is a parabola through the highest one and its neighbours.
    """
    best = np.argmax(curves, axis=1)
    inner = np.clip(best, 1, len(grid) - 2)
    rows = np.arange(len(curves))
    before, top, after = (curves[rows, inner + k] for k in (-1, 0, 1))
    bend = before - 2.0 * top + after
    shift = np.divide(0.5 * (before - after), bend, out=np.zeros(len(best)), where=bend < 0.0)
    shift = np.where(inner == best, np.clip(shift, -0.5, 0.5), 0.0)
    height = np.where(inner == best, top - 0.25 * (before - after) * shift, curves[rows, best])
    return height, grid[best] * np.exp(shift * np.log(grid[1] / grid[0]))
