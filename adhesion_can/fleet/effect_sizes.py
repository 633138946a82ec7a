"""Sizes of all effects in all units, and what effects gain in a unit."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np

from adhesion_can.arrays import Array
from adhesion_can.diagnosis.effect_grams import EffectGrams, EffectKey
from adhesion_can.diagnosis.inference.candidates import UNTESTABLE_SHARE

Sizes = Mapping[EffectKey, float]
"""Size of each effect of some."""


@dataclass(frozen=True, eq=False)
class EffectSizes:
    """Sizes of k effects in n units, each effect fitted alone beside the unit's curves.

    Attributes:
        grams: Gram matrices of each unit, the known effects taken out of its residual.
        keys: Effects.
        size: Size of each effect in each unit, NaN where the unit cannot show it; shape (n, k).
        variance: Variance of each size by the spread over the unit's blocks, shape (n, k).

    """

    grams: tuple[EffectGrams, ...]
    keys: tuple[EffectKey, ...]
    size: Array
    variance: Array

    @classmethod
    def collect(cls, grams: Sequence[EffectGrams]) -> "EffectSizes":
        """Collect the sizes of all units; effects in the order in which they are met."""
        place: dict[EffectKey, int] = {}
        for unit in grams:
            for key in unit.keys:
                place.setdefault(key, len(place))
        size = np.full((len(grams), len(place)), np.nan)
        variance = np.full_like(size, np.nan)
        columns: dict[tuple[EffectKey, ...], list[int]] = {}
        for row, unit in enumerate(grams):
            if unit.keys not in columns:
                columns[unit.keys] = [place[key] for key in unit.keys]
            known = np.where(unit.absorbed < UNTESTABLE_SHARE, unit.size, np.nan)
            size[row, columns[unit.keys]] = known
            variance[row, columns[unit.keys]] = unit.std**2
        variance[~np.isfinite(size)] = np.nan
        return cls(tuple(grams), tuple(place), size, variance)

    def without(self, known: Sequence[Sizes]) -> "EffectSizes":
        """The sizes that are left where effects of a known size are taken out of each unit."""
        return EffectSizes.collect(
            [remove_effects(unit, sizes) for unit, sizes in zip(self.grams, known, strict=True)]
        )


def place_of(unit: EffectGrams, key: EffectKey) -> int | None:
    """Place of an effect in a unit's matrices; None where the unit does not have it."""
    return _places(unit.keys).get(key)


@lru_cache(maxsize=256)
def _places(keys: tuple[EffectKey, ...]) -> dict[EffectKey, int]:
    """Place of each effect; most units have the same effects."""
    return {key: place for place, key in enumerate(keys)}


def remove_effects(unit: EffectGrams, sizes: Sizes) -> EffectGrams:
    """Gram matrices with effects of known sizes taken out of the residual."""
    vector = np.zeros(len(unit.keys))
    for key, size in sizes.items():
        place = place_of(unit, key)
        if place is not None:
            vector[place] = size
    if not vector.any():
        return unit
    return replace(
        unit,
        score=unit.score - unit.gram @ vector,
        square=max(unit.square - unit.square_change(vector), 0.0),
        fits={},
    )


def gain_of(unit: EffectGrams, place: int, size: float) -> float:
    """Fall of a unit's sum of squares by one effect of a given size, in variances of a row."""
    change = 2.0 * size * unit.score[place] - size * size * unit.gram[place, place]
    return float(change / max(unit.noise_variance, 1e-300))


def gain_share(units: Sequence[EffectGrams], key: EffectKey, size: float) -> float:
    """Share of the sum of squares that an effect of a given size takes away from some units."""
    places = [(unit, place_of(unit, key)) for unit in units]
    rows = sum(unit.rows for unit, place in places if place is not None)
    gain = sum(gain_of(unit, place, size) for unit, place in places if place is not None)
    return gain / rows if rows else 0.0


def held_out_gain(units: Sequence[EffectGrams], key: EffectKey) -> tuple[float, bool]:
    """Share of the sum of squares that an effect takes away where it was not fitted.

    With several units each one is predicted with the size of the others. One unit alone is
    predicted by itself, less twice what chance gains (Mallows, Technometrics 15 (1973) 661-675).

    Returns:
        Share of the sum of squares, and whether units were held out.

    """
    known = [(unit, place_of(unit, key)) for unit in units]
    used = [(unit, place) for unit, place in known if place is not None]
    square = sum(unit.rows for unit, _ in used)
    if not square:
        return 0.0, False
    noise = np.array([max(unit.noise_variance, 1e-300) for unit, _ in used])
    score = np.array([unit.score[place] for unit, place in used]) / noise
    gram = np.array([unit.gram[place, place] for unit, place in used]) / noise
    if len(used) == 1:
        variance = used[0][0].score_variance[used[0][1]] / noise[0] ** 2
        gain = (score[0] ** 2 - 2.0 * variance) / max(gram[0], 1e-300)
        return float(gain / square), False
    rest = gram.sum() - gram
    others = np.divide(score.sum() - score, rest, out=np.zeros_like(rest), where=rest > 0.0)
    return float(np.sum(2.0 * others * score - others**2 * gram) / square), True


def rmse_percent(share: float) -> float:
    """Fall of the RMSE, %, for a share of the sum of squares."""
    return float(100.0 * (1.0 - np.sqrt(max(1.0 - share, 0.0))))
