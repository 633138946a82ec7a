"""Findings of single vehicles: worn wheels by coasting, and effects by the regression."""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import compress

import numpy as np

from adhesion_can.arrays import Array
from adhesion_can.diagnosis.effect_grams import EffectKey
from adhesion_can.fleet.compare_vehicles import VehicleComparison, compare_vehicles, discoveries
from adhesion_can.fleet.effect_sizes import EffectSizes, held_out_gain, rmse_percent
from adhesion_can.fleet.evidence import UnitEvidence
from adhesion_can.fleet.findings import FleetFinding, Scope
from adhesion_can.fleet.settings import FleetSettings
from adhesion_can.physics.effects.instrument_errors import SPEED_SCALE, WHEEL_RADIUS

RIVAL_SHARE = 0.9
"""Share of the gain of a named effect from which another one is its rival."""
SECOND_SHARE, LEAST_SECOND = 0.1, 0.03
"""Share of the first effect's gain, and of the sum of squares, that a second one must bring: the
regression is linear in the sizes, and what it leaves of a large first effect must get no name."""
ALIKE = 0.2
"""Spread of all axles' deviations, relative to their mean, below which the speed is wrong."""
RADIUS = (WHEEL_RADIUS, "error", "1")
"""Effect id, parameter and unit of a wheel radius that is not the configured one."""
COASTING = "coasting"
"""Source of a finding of a wheel radius."""


@dataclass(frozen=True, eq=False)
class VehicleStatistics:
    """Vehicles beside the fleet, by the regression and by coasting.

    Attributes:
        units: Evidence of the units with Gram matrices.
        sizes: Sizes of all effects in these units, shared effects taken out.
        effects: Comparison of the effects' sizes.
        coasting: Evidence of the units with radii from coasting.
        axles: Axle numbers of the radii.
        radii: Deviation of each radius from the configured one, as a share of it, NaN where there
            is none; shape (units with radii, axles).
        wheels: Comparison of the radii.

    """

    units: tuple[UnitEvidence, ...]
    sizes: EffectSizes
    effects: VehicleComparison
    coasting: tuple[UnitEvidence, ...]
    axles: tuple[int, ...]
    radii: Array
    wheels: VehicleComparison


def compare_units(
    units: Sequence[UnitEvidence], sizes: EffectSizes, coasting: Sequence[UnitEvidence]
) -> VehicleStatistics:
    """Compare all vehicles with the fleet.

    Args:
        units: Evidence of the units with Gram matrices.
        sizes: Sizes of all effects in these units.
        coasting: Evidence of the units with radii from coasting.

    """
    axles = sorted({radius.axle for unit in coasting for radius in unit.radii})
    radii = np.full((len(coasting), len(axles)), np.nan)
    variance = np.full_like(radii, np.nan)
    for row, unit in enumerate(coasting):
        for radius in unit.radii:
            radii[row, axles.index(radius.axle)] = radius.value
            variance[row, axles.index(radius.axle)] = radius.std**2
    return VehicleStatistics(
        tuple(units),
        sizes,
        compare_vehicles([unit.vehicle for unit in units], sizes.size, sizes.variance),
        tuple(coasting),
        tuple(axles),
        radii,
        compare_vehicles([unit.vehicle for unit in coasting], radii, variance),
    )


def find_vehicle_effects(
    statistics: VehicleStatistics, settings: FleetSettings
) -> dict[str, tuple[FleetFinding, ...]]:
    """Findings of each vehicle that differs from the fleet, by its id."""
    wheels = _by_vehicle(statistics.wheels)
    effects = _by_vehicle(statistics.effects)
    vehicles = sorted(wheels.keys() | effects.keys())
    worn = {v: _worn_axles(statistics, wheels[v], settings) for v in vehicles if v in wheels}
    gains = {v: _gains(statistics, v, effects[v], settings) for v in vehicles if v in effects}
    # Effects and wheels are two families of tests, each with half of the rate.
    rate = 0.5 * settings.false_discovery_rate
    by_wheels = _discovered(statistics.wheels, worn, rate)
    by_effects = _discovered(statistics.effects, gains, rate)
    findings = {}
    for name in vehicles:
        by_wheel: list[FleetFinding] = []
        if name in by_wheels:
            by_wheel = _wheel_findings(statistics, name, wheels[name], worn[name])
        by_effect: list[FleetFinding] = []
        # A worn wheel bends the curve of its axle: what is left beside it is no size of anything,
        # unless the effects were looked for with the radius as it is.
        places = _unit_places(statistics, name)
        if name in by_effects and (
            not by_wheel or all(statistics.units[i].radii_applied for i in places)
        ):
            by_effect = _effect_findings(statistics, name, effects[name], gains[name])
        if by_wheel or by_effect:
            findings[name] = (*by_wheel, *by_effect)
    return findings


def _discovered(
    compared: VehicleComparison, places: Mapping[str, Collection[int]], rate: float
) -> set[str]:
    """Vehicles of which some of the deviations that matter are beyond chance.

    Args:
        compared: Comparison of the vehicles.
        places: Places of the deviations that matter, by vehicle.
        rate: False discovery rate.

    """
    p_value = [
        min((float(compared.p_value[row, j]) for j in places.get(name, ())), default=1.0)
        for row, name in enumerate(compared.vehicles)
    ]
    chosen = discoveries(np.array(p_value), rate)
    return set(compress(compared.vehicles, chosen))


def _by_vehicle(compared: VehicleComparison) -> dict[str, int]:
    return {name: row for row, name in enumerate(compared.vehicles)}


def _worn_axles(statistics: VehicleStatistics, row: int, settings: FleetSettings) -> list[int]:
    """Places of the axles whose radius is off by more than matters, beyond chance."""
    wheels = statistics.wheels
    return [
        j
        for j in range(len(statistics.axles))
        if wheels.p_value[row, j] <= settings.false_discovery_rate
        and abs(wheels.size[row, j]) >= settings.least_wear
        and abs(wheels.size[row, j] - wheels.spreads[j].center) >= settings.least_wear
    ]


def _gains(
    statistics: VehicleStatistics, vehicle: str, row: int, settings: FleetSettings
) -> dict[int, tuple[float, bool]]:
    """Gain of each effect in which a vehicle differs, where it is worth naming, by its place."""
    compared, sizes = statistics.effects, statistics.sizes
    places = _unit_places(statistics, vehicle)
    gains = {}
    for j in np.flatnonzero(compared.p_value[row] <= settings.false_discovery_rate):
        small = abs(compared.size[row, j]) < settings.least_wear
        if sizes.keys[j].effect == RADIUS[0] and small:
            continue  # what is left of a radius that was applied, or too little to matter
        gain, held_out = held_out_gain([sizes.grams[i] for i in places], sizes.keys[j])
        if gain >= settings.least_gain:
            gains[int(j)] = (gain, held_out)
    return gains


def _unit_places(statistics: VehicleStatistics, vehicle: str) -> list[int]:
    return [i for i, unit in enumerate(statistics.units) if unit.vehicle == vehicle]


def _effect_findings(
    statistics: VehicleStatistics, vehicle: str, row: int, gains: dict[int, tuple[float, bool]]
) -> list[FleetFinding]:
    """The effect with the largest gain, and a second one beside it where it brings much.

    Of effects that gain alike, the one that most of the vehicle's recordings name leads: their own
    diagnosis has fitted each in full, and here they are linearised.
    """
    places = _unit_places(statistics, vehicle)
    top = max(gain for gain, _ in gains.values())
    alike = [j for j, (gain, _) in gains.items() if gain >= RIVAL_SHARE * top]
    best = max(alike, key=lambda j: (_named_by(statistics, places, j), gains[j][0]))
    gain = gains[best][0]
    keys = statistics.sizes.keys
    rivals = tuple(sorted({keys[j].effect for j in alike} - {keys[best].effect}))
    findings = [_effect_finding(statistics, vehicle, row, best, gains[best], rivals)]
    key, value = statistics.sizes.keys[best], float(statistics.effects.size[row, best])
    left = EffectSizes.collect([statistics.sizes.grams[i] for i in places]).without(
        [{key: value}] * len(places)
    )
    second: dict[int, tuple[float, bool]] = {}
    for j in gains:
        other = statistics.sizes.keys[j]
        if other.effect == key.effect:
            continue
        share, held_out = held_out_gain(left.grams, other)
        if share >= max(LEAST_SECOND, SECOND_SHARE * gain):
            second[j] = (share, held_out)
    if second:
        further = max(second, key=lambda j: second[j][0])
        findings.append(_effect_finding(statistics, vehicle, row, further, second[further], ()))
    return findings


def _named_by(statistics: VehicleStatistics, places: Sequence[int], j: int) -> int:
    """Number of units of a vehicle whose own diagnosis names an effect."""
    effect = statistics.sizes.keys[j].effect
    return sum(effect in statistics.units[i].causes for i in places)


def _effect_finding(
    statistics: VehicleStatistics,
    vehicle: str,
    row: int,
    j: int,
    gain: tuple[float, bool],
    rivals: tuple[str, ...],
) -> FleetFinding:
    compared, sizes = statistics.effects, statistics.sizes
    places, key, value = (
        _unit_places(statistics, vehicle),
        sizes.keys[j],
        float(compared.size[row, j]),
    )
    size, std = sizes.size[places, j], np.sqrt(sizes.variance[places, j])
    return FleetFinding.of(
        key,
        Scope.VEHICLE,
        vehicle,
        value=value,
        std=float(compared.std[row, j]),
        fleet_value=compared.spreads[j].center,
        p_value=float(compared.p_value[row, j]),
        gain_percent=rmse_percent(gain[0]),
        held_out=gain[1],
        units=int(np.isfinite(size).sum()),
        showing=int((np.sign(value) * size > 2.0 * std).sum()),
        rivals=rivals,
        named_by=_named_by(statistics, places, j),
    )


def _wheel_findings(
    statistics: VehicleStatistics, vehicle: str, row: int, worn: Sequence[int]
) -> list[FleetFinding]:
    """A finding for each worn axle; one of the speed where all axles deviate alike."""
    wheels = statistics.wheels
    places = [i for i, unit in enumerate(statistics.coasting) if unit.vehicle == vehicle]
    findings = []
    for j in worn:
        value = float(wheels.size[row, j])
        size = statistics.radii[places, j]
        findings.append(
            FleetFinding.of(
                _radius_key(statistics.axles[j]),
                Scope.VEHICLE,
                vehicle,
                value=value,
                std=float(wheels.std[row, j]),
                fleet_value=wheels.spreads[j].center,
                p_value=float(wheels.p_value[row, j]),
                gain_percent=_radius_gain(statistics, vehicle, statistics.axles[j]),
                held_out=True,
                units=int(np.isfinite(size).sum()),
                showing=int((np.sign(value) * size > 0.5 * abs(value)).sum()),
                source=COASTING,
                named_by=sum(RADIUS[0] in statistics.coasting[i].causes for i in places),
            )
        )
    values = np.array([finding.value for finding in findings])
    if len(findings) == len(statistics.axles) > 1 and np.ptp(values) < ALIKE * abs(values.mean()):
        # The ratio of wheel and vehicle speed is all that counts: a speed that reads high by some
        # share makes all wheels look larger by it.
        return [
            replace(
                findings[0],
                effect=SPEED_SCALE,
                axle=0,
                value=float(values.mean()),
                rivals=(RADIUS[0],),
                named_by=sum(SPEED_SCALE in statistics.coasting[i].causes for i in places),
            )
        ]
    return sorted(findings, key=lambda finding: -abs(finding.value))


def _radius_gain(statistics: VehicleStatistics, vehicle: str, axle: int) -> float | None:
    """Gain of an axle's radius in the regression, RMSE in %; None where it does not gain."""
    grams = [statistics.sizes.grams[i] for i in _unit_places(statistics, vehicle)]
    gain, held_out = held_out_gain(grams, _radius_key(axle))
    return rmse_percent(gain) if held_out and gain > 0.0 else None


def _radius_key(axle: int) -> EffectKey:
    return EffectKey(RADIUS[0], "", axle, RADIUS[1], RADIUS[2])
