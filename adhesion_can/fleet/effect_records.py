"""Gram matrices of a unit's effects as rows of the table `effects`, and back."""

from collections.abc import Iterable, Sequence
from dataclasses import asdict
from functools import lru_cache
from typing import Any

import numpy as np

from adhesion_can.diagnosis.effect_grams import EffectGrams, EffectKey, SizeEstimate
from adhesion_can.fleet.rows import Row, number

_KEY = ("effect", "form", "axle", "parameter", "unit")


def effect_rows(grams: EffectGrams) -> list[dict[str, Any]]:
    """Rows of the table `effects`, one an effect, without the columns that place a unit."""
    size, std = grams.size, grams.std
    return [
        {
            "place": place,
            **asdict(key),
            "typical": typical,
            "value": number(size[place]),
            "std": number(std[place]),
            "fitted_value": None if (fit := grams.fits.get(place)) is None else fit.value,
            "fitted_std": None if fit is None else fit.std,
            "absorbed": float(grams.absorbed[place]),
            "gram": grams.gram[place].tolist(),
            "score": float(grams.score[place]),
            "score_variance": float(grams.score_variance[place]),
            "square": grams.square,
            "rows": grams.rows,
            "blocks": grams.blocks,
            "rmse": grams.rmse,
        }
        for place, (key, typical) in enumerate(zip(grams.keys, grams.typical, strict=True))
    ]


def grams_from_rows(rows: Iterable[Row]) -> EffectGrams | None:
    """Gram matrices of a unit from its rows in any order; None where there are none.

    Raises:
        ValueError: A row is missing, or a row of the matrix has another length.

    """
    ordered = sorted(rows, key=lambda row: row["place"])
    if not ordered:
        return None
    if [row["place"] for row in ordered] != list(range(len(ordered))):
        raise ValueError("a row of the table 'effects' is missing")
    gram = np.array([row["gram"] for row in ordered], dtype=np.float64)
    if gram.shape != (len(ordered), len(ordered)):
        raise ValueError("a matrix of the table 'effects' is not square")
    first = ordered[0]
    return EffectGrams(
        keys=_keys(tuple(tuple(row[name] for name in _KEY) for row in ordered)),
        gram=gram,
        score=_column(ordered, "score"),
        score_variance=_column(ordered, "score_variance"),
        absorbed=_column(ordered, "absorbed"),
        square=float(first["square"]),
        rows=float(first["rows"]),
        blocks=int(first["blocks"]),
        rmse=float(first["rmse"]),
        fits={
            place: SizeEstimate(row["fitted_value"], row["fitted_std"])
            for place, row in enumerate(ordered)
            # Units of an earlier version of the package have no such columns.
            if row.get("fitted_value") is not None
        },
    )


@lru_cache(maxsize=256)
def _keys(cells: tuple[tuple[Any, ...], ...]) -> tuple[EffectKey, ...]:
    """Effects of a unit; most units have the same, which are kept once."""
    return tuple(EffectKey(*key_cells) for key_cells in cells)


def _column(rows: Sequence[Row], name: str) -> np.ndarray:
    return np.array([row[name] for row in rows], dtype=np.float64)
