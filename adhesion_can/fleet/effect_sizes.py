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
        for one in grams:
            for key in one.keys:
                place.setdefault(key, len(place))
        size = np.full((len(grams), len(place)), np.nan)
        variance = np.full_like(size, np.nan)
        columns: dict[tuple[EffectKey, ...], list[int]] = {}
        for row, one in enumerate(grams):
            if one.keys not in columns:
                columns[one.keys] = [place[key] for key in one.keys]
            known = np.where(one.absorbed < UNTESTABLE_SHARE, one.size, np.nan)
            size[row, columns[one.keys]] = known
            variance[row, columns[one.keys]] = one.std**2
        variance[~np.isfinite(size)] = np.nan
        return cls(tuple(grams), tuple(place), size, variance)

    def without(self, known: Sequence[Sizes]) -> "EffectSizes":
        """The sizes that are left where effects of a known size are taken out of each unit."""
        return EffectSizes.collect(
            [remove_effects(one, sizes) for one, sizes in zip(self.grams, known, strict=True)]
        )


def place_of(one: EffectGrams, key: EffectKey) -> int | None:
    """Place of an effect in a unit's matrices; None where the unit does not have it."""
    return _places(one.keys).get(key)


@lru_cache(maxsize=256)
def _places(keys: tuple[EffectKey, ...]) -> dict[EffectKey, int]:
    """Place of each effect; most units have the same effects."""
    return {key: place for place, key in enumerate(keys)}


def remove_effects(one: EffectGrams, sizes: Sizes) -> EffectGrams:
    """Gram matrices with effects of known sizes taken out of the residual."""
    vector = np.zeros(len(one.keys))
    for key, size in sizes.items():
        place = place_of(one, key)
        if place is not None:
            vector[place] = size
    if not vector.any():
        return one
    return replace(
        one,
        score=one.score - one.gram @ vector,
        square=max(one.square - one.square_change(vector), 0.0),
        fits={},
    )


def gain_of(one: EffectGrams, place: int, size: float) -> float:
    """Fall of a unit's sum of squares by one effect of a given size, in variances of a row."""
    change = 2.0 * size * one.score[place] - size * size * one.gram[place, place]
    return float(change / max(one.noise_variance, 1e-300))


def gain_share(units: Sequence[EffectGrams], key: EffectKey, size: float) -> float:
    """Share of the sum of squares that an effect of a given size takes away from some units."""
    places = [(one, place_of(one, key)) for one in units]
    rows = sum(one.rows for one, place in places if place is not None)
    gain = sum(gain_of(one, place, size) for one, place in places if place is not None)
    return gain / rows if rows else 0.0


def held_out_gain(units: Sequence[EffectGrams], key: EffectKey) -> tuple[float, bool]:
    """Share of the sum of squares that an effect takes away where it was not fitted.

    With several units each one is predicted with the size of the others. One unit alone is
    predicted by itself, less twice what chance gains (Mallows, Technometrics 15 (1973) 661-675).

    Returns:
        Share of the sum of squares, and whether units were held out.

    """
    known = [(one, place_of(one, key)) for one in units]
    used = [(one, place) for one, place in known if place is not None]
    square = sum(one.rows for one, _ in used)
    if not square:
        return 0.0, False
    noise = np.array([max(one.noise_variance, 1e-300) for one, _ in used])
    score = np.array([one.score[place] for one, place in used]) / noise
    gram = np.array([one.gram[place, place] for one, place in used]) / noise
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
