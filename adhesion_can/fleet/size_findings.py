"""Findings with their sizes by the units' own, nonlinear estimates."""

from collections import defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

from adhesion_can.diagnosis.effect_grams import EffectKey
from adhesion_can.fleet.effect_sizes import Sizes
from adhesion_can.fleet.evidence import UnitEvidence
from adhesion_can.fleet.findings import FleetFinding, Scope
from adhesion_can.fleet.pooled_size import (
    PooledSize,
    UnitSize,
    pool_sizes,
    size_in_unit,
    sizes_by_coasting,
    sizes_by_diagnosis,
)
from adhesion_can.fleet.vehicle_findings import COASTING, VehicleStatistics


@dataclass(frozen=True, eq=False)
class FindingSizes:
    """Sizes of the findings of one kind of vehicles.

    Attributes:
        units: Evidence of the units of the kind.
        known: Sizes of the effects that the fleet, a line or a day has, by unit id.
        spreads: Standard deviation of each effect between the units of the kind.
        wheel_spreads: Standard deviation of the radius of each axle between these units, relative
            to the configured one, by axle.

    """

    units: Sequence[UnitEvidence]
    known: Mapping[str, Sizes]
    spreads: Mapping[EffectKey, float]
    wheel_spreads: Mapping[int, float]

    @cached_property
    def _by_vehicle(self) -> dict[str, list[UnitEvidence]]:
        by_vehicle: dict[str, list[UnitEvidence]] = defaultdict(list)
        for unit in self.units:
            by_vehicle[unit.vehicle].append(unit)
        return by_vehicle

    def with_size(self, finding: FleetFinding, beside: Sequence[FleetFinding] = ()) -> FleetFinding:
        """The finding with its pooled size."""
        key = finding.key
        units = self._units_of(finding)
        sizes: list[UnitSize | None]
        if finding.source == COASTING:
            sizes = [*sizes_by_coasting(units, finding.axle)]
            # Axle 0 is the speed, whose error all radii show.
            spread = self.wheel_spreads.get(finding.axle) or max(
                self.wheel_spreads.values(), default=0.0
            )
        else:
            spread = self.spreads.get(key, 0.0)
            others = {
                other.key: other.value
                for other in beside
                if other.source != COASTING and other != finding
            }
            sizes = [
                size_in_unit(unit, key, _without(key, {**self.known.get(unit.unit, {}), **others}))
                for unit in units
            ]
        known = [size for size in sizes if size is not None]
        return replace(finding, pooled=pool_sizes(key, known, spread))

    def _units_of(self, finding: FleetFinding) -> Sequence[UnitEvidence]:
        """Units that a finding is about."""
        where = finding.where
        match finding.scope:
            case Scope.VEHICLE:
                return self._by_vehicle.get(where, [])
            case Scope.LINE:
                return [unit for unit in self.units if unit.line == where]
            case Scope.DAY:
                return [unit for unit in self.units if unit.day == where]
            case Scope.FLEET:
                return self.units

    def of_causes(self, vehicle: str) -> tuple[PooledSize, ...]:
        """Sizes of the causes that the units of a vehicle name, that of the most units first."""
        units = self._by_vehicle.get(vehicle, [])
        by_cause = [
            pool_sizes(key, sizes, self.spreads.get(key, 0.0))
            for key, sizes in sizes_by_diagnosis(units).items()
        ]
        pooled = [size for size in by_cause if size is not None]
        return tuple(sorted(pooled, key=lambda size: (-len(size.sizes), size.name)))


def size_findings_of(
    units: Sequence[UnitEvidence], known: Mapping[str, Sizes], statistics: VehicleStatistics
) -> FindingSizes:
    """Sizes of the findings of a kind, with the spreads in the middle of the fleet.

    Args:
        units: Evidence of the units of the kind.
        known: Sizes of the effects that the fleet, a line or a day has, by unit id.
        statistics: Comparison of the vehicles.

    """
    compared = zip(statistics.sizes.keys, statistics.effects.spreads, strict=True)
    wheels = zip(statistics.axles, statistics.wheels.spreads, strict=True)
    return FindingSizes(
        units,
        known,
        {key: spread.variance**0.5 for key, spread in compared},
        {axle: spread.variance**0.5 for axle, spread in wheels},
    )


def _without(key: EffectKey, sizes: Sizes) -> Sizes:
    return {other: size for other, size in sizes.items() if other != key}
