"""The peak that is truly there, at any moment of a drive."""

from collections.abc import Sequence
from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import NDArray

from tests.worlds.drive_profile import AXLES, LEAD, DriveProfile, Vehicle
from tests.worlds.hidden import Hidden, State, contact
from tests.worlds.plant import true_state
from tests.worlds.rail import Floats, Ints, Rail

GRID = np.geomspace(1e-3, 0.5, 240)
CHUNK = 100
"""Moments that are computed at a time."""
MEMORY = ("creep_relaxation", "adhesion_recovery")
"""Effects with a memory: a steady slip has caught up, and what was cleaned stays as it is."""


@dataclass(frozen=True)
class CurveInTime:
    """Mean curve of all axles at n moments, in the direction of the last creep.

    Attributes:
        t: s, (n,).
        mu_max: Largest adhesion, (n,).
        lambda_m: Slip ratio that it stands at, (n,).
        interior: Whether the curve falls beyond it, (n,).
        curves: Adhesion on `GRID`, (n, 240).

    """

    t: Floats
    mu_max: Floats
    lambda_m: Floats
    interior: NDArray[np.bool_]
    curves: Floats

    def reached(self, slip: Floats) -> Floats:
        """Adhesion at a slip for each moment, as a share of the largest; (n,)."""
        x = np.log(np.clip(np.abs(slip), GRID[0], GRID[-1]))
        at = [np.interp(x[k], np.log(GRID), curve) for k, curve in enumerate(self.curves)]
        return np.minimum(np.array(at) / self.mu_max, 1.0)


@dataclass(frozen=True)
class TrueContact:
    """A drive as it truly is, with what hides in it."""

    profile: DriveProfile
    vehicle: Vehicle
    rail: Rail
    effects: tuple[Hidden, ...]

    def at(self, t: Floats) -> CurveInTime:
        """Curves at moments of the recording, s."""
        rows = np.clip(np.searchsorted(self.profile.t, t - 1e-6), LEAD, len(self.profile.t) - 1)
        state = true_state(self.profile, self.vehicle)
        sign = _direction(self.profile.slip)[rows]
        cleaned = self._cleaned(state)[rows]
        parts = [
            self._curves(state, rows[k : k + CHUNK], sign[k : k + CHUNK], cleaned[k : k + CHUNK])
            for k in range(0, len(rows), CHUNK)
        ]
        curves = np.concatenate(parts) if parts else np.empty((0, len(GRID)))
        mu_max, lambda_m, interior = find_peaks(curves)
        return CurveInTime(np.asarray(t), mu_max, lambda_m, interior, curves)

    def _cleaned(self, state: State) -> Floats:
        """Factor of the adhesion by the work done before, (n, 6)."""
        curves = self.rail.curves[self.rail.surface_at(state.t)]
        without = _without(self.effects, ("adhesion_recovery",))
        if len(without) == len(self.effects):
            return np.ones_like(state.slip)
        with_it = contact(state, self.effects, curves).factor
        return np.asarray(with_it / contact(state, without, curves).factor)

    def _curves(self, state: State, rows: Ints, sign: Floats, cleaned: Floats) -> Floats:
        """Mean curve of all axles on the grid, (rows, grid)."""
        still = _spread(state, rows, sign)
        c = np.repeat(self.rail.curves[self.rail.surface_at(state.t[rows])], len(GRID), axis=0)
        height = contact(still, _without(self.effects, MEMORY), c).adhesion(c)
        shape = (len(rows), len(GRID), AXLES)
        scaled = sign[:, None, None] * height.reshape(shape) * cleaned[:, None, :]
        return np.asarray(scaled.mean(axis=2))


def find_peaks(curves: Floats) -> tuple[Floats, Floats, NDArray[np.bool_]]:
    """Largest value of each curve on `GRID`, its slip, and whether it lies inside; (n,) each.

    A parabola in ln slip goes through the highest point and its neighbours.
    """
    best = np.argmax(curves, axis=1)
    inner = np.clip(best, 1, len(GRID) - 2)
    rows = np.arange(len(curves))
    before, top, after = (curves[rows, inner + k] for k in (-1, 0, 1))
    bend = before - 2 * top + after
    shift = np.divide(0.5 * (before - after), bend, out=np.zeros(len(best)), where=bend < 0)
    shift = np.where(best == inner, np.clip(shift, -0.5, 0.5), 0.0)
    height = np.where(best == inner, top - 0.25 * (before - after) * shift, curves[rows, best])
    # A plateau is no peak: the curve must have fallen by a thousandth at its end.
    interior = (best == inner) & (curves[:, -1] < 0.999 * height)
    return height, GRID[best] * np.exp(shift * np.log(GRID[1] / GRID[0])), interior


def _without(effects: Sequence[Hidden], names: Sequence[str]) -> tuple[Hidden, ...]:
    return tuple(e for e in effects if e.effect not in names)


def _direction(slip: Floats) -> Floats:
    """1 where the last creep of the axles was traction, -1 where it was braking; (n,)."""
    mean = slip.mean(axis=1)
    creeping = np.abs(mean) > 5e-4
    last = np.maximum.accumulate(np.where(creeping, np.arange(len(mean)), 0))
    return np.where(mean[last] < 0, -1.0, 1.0)


def _spread(state: State, rows: Ints, sign: Floats) -> State:
    """Each row as many times as the grid has slips, and these slips in place of its own."""
    spread = {}
    for field in fields(State):
        values = getattr(state, field.name)
        fixed = field.name in ("order", "behind")
        spread[field.name] = values if fixed else np.repeat(values[rows], len(GRID), axis=0)
    slip = (sign[:, None] * GRID).reshape(-1, 1)
    return State(**(spread | {"slip": np.repeat(slip, AXLES, axis=1)}))
