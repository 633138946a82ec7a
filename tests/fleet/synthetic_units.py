"""Evidence of units from a linear model of this file's own: no drive, no regression code.

Rows are y = X φ + e with columns that are correlated, differently in each unit, and noise that
lasts within a block. Sizes differ between units by Student's t with five degrees of freedom.
"""

from dataclasses import dataclass, field

import numpy as np

from adhesion_can.diagnosis.effect_grams import EffectGrams, EffectKey
from adhesion_can.fleet.evidence import AxleDeviation, UnitEvidence, VehicleForm

NAMES = ("humidity", "effort_bias", "speed_delay", "sanding", "curve_creep", "wheelset_inertia")
KEYS = tuple(EffectKey(name, "", 0, "size", "1") for name in NAMES)
BLOCKS, ROWS = 16, 20
SIZE = 0.6
"""Size of a hidden effect: a quarter of the sum of squares, ten deviations between units."""
SPREAD = 0.03
"""Scale of the differences between units."""


@dataclass
class Fleet:
    """A fleet whose vehicles go to lines in turn.

    Attributes:
        vehicles: Number of vehicles.
        drives: Units of each vehicle.
        lines: Number of lines.
        days: Number of days.
        everywhere: Sizes on all vehicles, by the effect's number.
        by_vehicle: Sizes by vehicle, then by the effect's number.
        by_line: Sizes by line.
        by_day: Sizes by day.
        worn: Deviation of axle 2 by vehicle.
        form: Form of the vehicles.

    """

    vehicles: int = 30
    drives: int = 2
    lines: int = 4
    days: int = 5
    everywhere: dict[int, float] = field(default_factory=dict)
    by_vehicle: dict[int, dict[int, float]] = field(default_factory=dict)
    by_line: dict[int, dict[int, float]] = field(default_factory=dict)
    by_day: dict[int, dict[int, float]] = field(default_factory=dict)
    worn: dict[int, float] = field(default_factory=dict)
    form: VehicleForm = field(default_factory=VehicleForm)

    def draw(self, seed):
        """Evidence of all units."""
        rng = np.random.default_rng([seed, 3])
        units = []
        for vehicle in range(self.vehicles):
            for drive in range(self.drives):
                line, day = rng.integers(self.lines), rng.integers(self.days)
                size = SPREAD * rng.standard_t(5, len(KEYS))
                for hidden in (
                    self.everywhere,
                    self.by_vehicle.get(vehicle, {}),
                    self.by_line.get(int(line), {}),
                    self.by_day.get(int(day), {}),
                ):
                    for number, value in hidden.items():
                        size[number] += value
                std = 2e-4 * rng.uniform(0.5, 2.0)
                radii = tuple(
                    AxleDeviation(
                        axle,
                        (self.worn.get(vehicle, 0.0) if axle == 2 else 0.0)
                        + std * rng.standard_normal(),
                        std,
                    )
                    for axle in (1, 2, 3)
                )
                units.append(
                    UnitEvidence(
                        f"u{vehicle}-{drive}", f"V{vehicle:02d}", self.form, f"line{line}",
                        f"2026-01-{day + 1:02d}", draw_grams(rng, size), radii,
                    )
                )  # fmt: skip
        return units


def draw_grams(rng, size):
    """Gram matrices of a unit with given sizes, shape (k,)."""
    k = len(size)
    mixing = np.eye(k) + 0.4 * rng.standard_normal((k, k))
    columns = rng.standard_normal((BLOCKS, ROWS, k)) @ mixing
    columns /= np.sqrt(np.mean(columns**2, axis=(0, 1)))
    noise = rng.standard_normal((BLOCKS, ROWS)) + 0.3 * rng.standard_normal((BLOCKS, 1))
    y = columns @ size + noise
    gram = np.einsum("bri,brj->ij", columns, columns)
    by_block = np.einsum("bri,br->bi", columns, y)
    score = by_block.sum(axis=0)
    alone = score / gram.diagonal()
    left = y[..., None] - columns * alone
    variance = np.sum(np.einsum("bri,bri->bi", columns, left) ** 2, axis=0)
    return EffectGrams(
        KEYS, gram, score, variance, np.zeros(k), float(np.sum(y**2)), float(y.size), BLOCKS, 0.01
    )
