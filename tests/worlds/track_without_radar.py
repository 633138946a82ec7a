"""The track of `without_radar`: gradients by steps and ramps, curves, and surfaces of the rail."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from tests.worlds.rail import Floats

PLACES = np.array([0.0, 1.9, 3.8, 10.3, 12.2, 14.1])
"""Distance of each axle behind the first one, m."""
CELL = 0.5
"""Length of a piece of rail with one surface, m."""
GROUND = 5.0
"""Length of a piece of track with one gradient, m."""
DURATION_S = 125.0
KALKER = 115.0
"""Slope of a clean contact at zero creep in Polach's formula, for kA + kS = 1."""
SURFACES = {
    "dry": {"kA": 1.0, "kS": 0.4, "mu0": 0.42, "A": 0.4, "B": 0.6},
    "wet": {"kA": 0.3, "kS": 0.1, "mu0": 0.26, "A": 0.4, "B": 0.2},
    "greasy": {"kA": 0.22, "kS": 0.08, "mu0": 0.13, "A": 0.5, "B": 0.15},
}
"""Polach 2005, dry and wet; greasy by the same rule with a lower friction. B in s/m."""
NAMES = tuple(SURFACES)


@dataclass(frozen=True)
class RailUnderAxles:
    """Polach's parameters where the axles are, each (drives, axles), and the level there."""

    kA: Floats  # noqa: N815  Polach's name
    kS: Floats  # noqa: N815
    mu0: Floats
    A: Floats
    B: Floats
    level: Floats
    peak: Floats

    def adhesion(self, creep: Floats, v: Floats) -> Floats:
        """Adhesion at a creep speed (m/s, of either sign) and a vehicle speed (m/s)."""
        mu = self.mu0 * ((1 - self.A) * np.exp(-self.B * np.abs(creep)) + self.A)
        e = np.pi / 2 * KALKER * creep / v / mu
        full = 2 / np.pi * (self.kA * e / (1 + (self.kA * e) ** 2) + np.arctan(self.kS * e))
        return self.level * mu * full


@dataclass(frozen=True)
class Track:
    """What lies along the track of each drive; the first axle begins at 0 m.

    Attributes:
        rail: Polach's parameters by cell, (7, drives, cells), in the order of `RailUnderAxles`.
        grade: Gradient by piece of track, 1, (drives, pieces), from `behind` m before 0.
        curve: Resistance of curves over weight by piece of track, likewise.
        behind: Length of the train, m.
        changes_m: Places at which a surface changes, by drive.

    """

    rail: Floats
    grade: Floats
    curve: Floats
    behind: float
    changes_m: list[list[float]]

    def surface(self, places: Floats) -> RailUnderAxles:
        """The rail at places (m, shape (drives, axles))."""
        # 20 m of rail lie before 0 m for the axles that have not come there yet.
        cell = np.clip(((places + 20.0) / CELL).astype(int), 0, self.rail.shape[2] - 1)
        rows = np.arange(len(places))[:, None]
        return RailUnderAxles(*self.rail[:, rows, cell])

    def grade_and_curve(self, places: Floats) -> tuple[Floats, Floats]:
        """Gradient and resistance of curves over weight at places, m, (drives, vehicles)."""
        at = (places + self.behind) / GROUND
        cell = np.clip(at.astype(int), 0, self.grade.shape[1] - 1)
        rows = np.arange(len(places))[:, None]
        return self.grade[rows, cell], self.curve[rows, cell]


def draw_track(rngs: Sequence[np.random.Generator], speeds: Floats, train_m: float) -> Track:
    """Tracks of drives that begin at `speeds`, m/s, with trains of a length, m."""
    cells = int((DURATION_S * 1.5 * speeds.max() + 40) / CELL)
    pieces = int((DURATION_S * 1.5 * speeds.max() + train_m + 100) / GROUND)
    rails, grades, curves, changes = [], [], [], []
    for rng, speed in zip(rngs, speeds, strict=True):
        # In its own child generators, so that the length of the longest track changes no draw.
        rail, ground, bends = rng.spawn(3)
        one, places = _draw_rail(rail, float(speed), cells)
        rails.append(one)
        changes.append(places)
        grade, curve = _draw_ground(ground, bends, pieces)
        grades.append(grade)
        curves.append(curve)
    return Track(np.stack(rails, axis=1), np.array(grades), np.array(curves), train_m, changes)


def _draw_rail(rng: np.random.Generator, speed: float, cells: int) -> tuple[Floats, list[float]]:
    count = int(rng.choice([0, 1, 2, 3], p=[0.25, 0.35, 0.25, 0.15]))
    places = sorted(rng.uniform(10, 115, count) * speed)
    kinds = [NAMES[rng.integers(3)]]
    while len(kinds) <= count:
        kinds.append(str(rng.choice([name for name in NAMES if name != kinds[-1]])))
    rows = []
    for kind in kinds:
        p = {name: value * (1 + rng.normal(0, 0.1)) for name, value in SURFACES[kind].items()}
        p["A"] = min(p["A"], 0.8)
        rows.append([p["kA"], p["kS"], p["mu0"], p["A"], p["B"], 1.0, 0.0])
        rail = RailUnderAxles(*(np.array(value) for value in rows[-1]))
        creep = np.geomspace(1e-4, 0.3, 400) * speed
        rows[-1][6] = float(rail.adhesion(creep, np.array(speed)).max())
    x = np.arange(cells) * CELL - 20.0
    out = np.repeat(np.array(rows[0])[:, None], cells, axis=1)
    for place, row in zip(places, rows[1:], strict=True):
        blend = np.clip((x - place) / rng.uniform(1.0, 10.0), 0, 1)
        out = out + blend * (np.array(row)[:, None] - out)
    # The level of the rail wanders: 1.5 % over 60 m.
    keep = np.exp(-CELL / 60.0)
    white = rng.standard_normal(cells)
    wander, level = np.empty(cells), 0.0
    for i in range(cells):
        level = keep * level + np.sqrt(1 - keep * keep) * white[i]
        wander[i] = level
    out[5] = 1 + 0.015 * wander
    return out, [float(place) for place in places]


def _draw_ground(
    rng: np.random.Generator, bends: np.random.Generator, pieces: int
) -> tuple[Floats, Floats]:
    grade, curve = np.zeros(pieces), np.zeros(pieces)
    at, level = 0, 0.0
    while at < pieces:
        length = int(rng.uniform(100, 600) / GROUND)
        new = 0.5 * level + rng.normal(0, 0.004)
        ramp = int(rng.choice([1.0, rng.uniform(50, 250)]) / GROUND) + 1
        rise = level + (new - level) * np.clip(np.arange(1, length + 1) / ramp, 0, 1)
        stop = min(pieces, at + length)
        grade[at:stop] = rise[: stop - at]
        level, at = float(rise[-1]), at + length
    at = 0
    while at < pieces:
        at += int(bends.uniform(100, 800) / GROUND)
        length = int(bends.uniform(80, 300) / GROUND)
        curve[at : at + length] = 0.65 / (bends.uniform(300, 1500) - 55)
        at += length
    return grade, curve
