"""Size of an effect in several units: each unit's own estimate, and their mean.

No estimate here is linearised: it is the size found by the diagnosis of the unit, or the nonlinear
fit of the effect alone, or too small to be bent. Their mean is DerSimonian and Laird's, by the
variances of the units and the spread between them (`random_effects`), first over the units of a
vehicle, then over vehicles. See decision 081.
"""

from collections import defaultdict
from collections.abc import Iterable, Sequence
from dataclasses import asdict, dataclass
from enum import StrEnum
from typing import Any

import numpy as np

from adhesion_can.diagnosis.effect_grams import EffectKey
from adhesion_can.diagnosis.formatting import effect_name
from adhesion_can.diagnosis.inference.compute_effect_grams import CLEAR
from adhesion_can.fleet.effect_sizes import Sizes, place_of, remove_effects
from adhesion_can.fleet.evidence import UnitEvidence
from adhesion_can.fleet.random_effects import Mean, pool


class SizeSource(StrEnum):
    """Origin of a unit's size."""

    DIAGNOSIS = "diagnosis"
    FIT = "fit"
    FIRST_ORDER = "first order"
    COASTING = "coasting"


@dataclass(frozen=True, slots=True)
class UnitSize:
    """Size of an effect in one unit.

    Attributes:
        unit_id: Id of the unit.
        vehicle: Id of the vehicle.
        recording: Path or URL of the recording.
        value: Size.
        std: Standard error of it.
        source: Origin of the size.

    """

    unit_id: str
    vehicle: str
    recording: str
    value: float
    std: float
    source: SizeSource


@dataclass(frozen=True, slots=True)
class PooledSize(EffectKey):
    """Mean size of an effect over some units.

    Attributes:
        value: Mean, in `unit`.
        std: Standard error of it, the spread between units included, in `unit`.
        spread: Standard deviation between the units of the fleet, in `unit`.
        sizes: Size in each unit that has one, in the order of vehicles.

    """

    value: float
    std: float
    spread: float
    sizes: tuple[UnitSize, ...]

    @property
    def name(self) -> str:
        """Effect id with form and axle."""
        return effect_name(self.effect, self.form, self.axle)

    @property
    def by_vehicle(self) -> dict[str, tuple[Mean, tuple[UnitSize, ...]]]:
        """Mean and sizes of each vehicle, by its id."""
        return {
            vehicle: (_mean(sizes, self.spread), tuple(sizes))
            for vehicle, sizes in _grouped(self.sizes).items()
        }

    def to_dict(self) -> dict[str, Any]:
        """The size as JSON has it."""
        return asdict(self) | {
            "sizes": [asdict(size) | {"source": str(size.source)} for size in self.sizes]
        }


def pool_sizes(key: EffectKey, sizes: Iterable[UnitSize], spread: float) -> PooledSize | None:
    """Mean size over units; None where no unit has one.

    Args:
        key: Effect.
        sizes: Size in each unit that has one.
        spread: Standard deviation between the units of the fleet, in the effect's unit; 0 where it
            is not known.

    """
    in_order = sorted(sizes, key=lambda size: (size.vehicle, size.recording, size.unit_id))
    if not in_order:
        return None
    means = [_mean(of_vehicle, spread) for of_vehicle in _grouped(in_order).values()]
    mean = means[0]
    if len(means) > 1:
        mean = pool(
            np.array([size.value for size in means]), np.array([size.std for size in means]) ** 2
        )
    return PooledSize(
        **asdict(key), value=mean.value, std=mean.std, spread=spread, sizes=tuple(in_order)
    )


def _grouped(sizes: Iterable[UnitSize]) -> dict[str, list[UnitSize]]:
    by_vehicle: dict[str, list[UnitSize]] = defaultdict(list)
    for size in sizes:
        by_vehicle[size.vehicle].append(size)
    return by_vehicle


def _mean(sizes: Sequence[UnitSize], spread: float) -> Mean:
    value, std = np.array([size.value for size in sizes]), np.array([size.std for size in sizes])
    if len(sizes) == 1:
        # What one recording shows, as it shows it: how others differ is no error of this one.
        return Mean(float(value[0]), float(std[0]), 1)
    return pool(value, std**2 + spread**2)


def size_in_unit(unit: UnitEvidence, key: EffectKey, others: Sizes) -> UnitSize | None:
    """Size of an effect in a unit; None where the unit has no estimate that is not linearised.

    Args:
        unit: Evidence of the unit.
        key: Effect.
        others: Sizes of other effects that act in the unit too. The fit of the effect alone is
            moved by what they put into it, to first order; a diagnosis has fitted its own beside.

    """
    named = next((cause for cause in unit.cause_sizes if cause.key == key), None)
    if named is not None and named.std is not None:
        return _size(unit, named.value, named.std, SizeSource.DIAGNOSIS)
    grams = unit.grams
    place = None if grams is None else place_of(grams, key)
    if grams is None or place is None or place not in grams.fits:
        return None
    estimate = grams.fits[place]
    moved = float(remove_effects(grams, others).size[place] - grams.size[place])
    clear = abs(grams.size[place]) >= CLEAR * grams.std[place]
    source = SizeSource.FIT if clear else SizeSource.FIRST_ORDER
    return _size(unit, estimate.value + moved, estimate.std, source)


def sizes_by_diagnosis(units: Sequence[UnitEvidence]) -> dict[EffectKey, list[UnitSize]]:
    """Sizes of the causes that the diagnosis of each unit names, by effect."""
    by_effect: dict[EffectKey, list[UnitSize]] = defaultdict(list)
    for unit in units:
        for cause in unit.cause_sizes:
            if cause.std is not None:
                size = _size(unit, cause.value, cause.std, SizeSource.DIAGNOSIS)
                by_effect[cause.key].append(size)
    return by_effect


def sizes_by_coasting(units: Sequence[UnitEvidence], axle: int) -> list[UnitSize]:
    """Deviation of a wheel radius in each unit; of axle 0 that of all radii of a unit alike."""
    sizes = []
    for unit in units:
        radii = [radius for radius in unit.radii if axle in {0, radius.axle}]
        if radii:
            value = float(np.mean([radius.value for radius in radii]))
            # Radii of a unit share the error of its vehicle speed: their mean is as uncertain.
            std = float(np.sqrt(np.mean([radius.std**2 for radius in radii])))
            sizes.append(_size(unit, value, std, SizeSource.COASTING))
    return sizes


def _size(unit: UnitEvidence, value: float, std: float, source: SizeSource) -> UnitSize:
    return UnitSize(unit.unit, unit.vehicle, unit.path, value, std, source)
