"""Findings that several vehicles share: of the whole fleet, of a line, of a day."""

from collections.abc import Callable, Sequence

import numpy as np
import scipy

from adhesion_can.diagnosis.effect_grams import EffectKey
from adhesion_can.fleet.compare_places import compare_places
from adhesion_can.fleet.compare_vehicles import vehicle_means
from adhesion_can.fleet.effect_sizes import EffectSizes, gain_share, rmse_percent
from adhesion_can.fleet.evidence import UnitEvidence
from adhesion_can.fleet.findings import FleetFinding, Scope
from adhesion_can.fleet.random_effects import Mean, pool
from adhesion_can.fleet.settings import FleetSettings

MOST_SHARED = 3
"""Largest number of effects that are named for the whole fleet."""
MOST_PLACES = 20
"""Largest number of lines and of days that are named."""
SHOWING = 0.6
"""Share of the vehicles on which an effect of the fleet must have its sign beyond two standard
errors."""

Known = list[dict[EffectKey, float]]
"""Sizes of the effects that are taken out of each unit."""


def find_fleet_effects(
    sizes: EffectSizes, units: Sequence[UnitEvidence], known: Known, settings: FleetSettings
) -> list[FleetFinding]:
    """Effects that are there on most vehicles, the largest gain first; noted in `known`."""
    findings: list[FleetFinding] = []
    vehicles = [unit.vehicle for unit in units]
    while len(findings) < MOST_SHARED:
        left = sizes.without(known)
        means, deviations = vehicle_means(vehicles, left.size, left.variance)
        best: tuple[float, int, Mean, float] | None = None
        for j, key in enumerate(left.keys):
            seen = np.isfinite(means[:, j])
            mean = pool(means[:, j], deviations[:, j] ** 2)
            if mean.units < 2 or any(key in known_sizes for known_sizes in known):
                continue
            t = mean.value / mean.std
            p = float(min(1.0, 2 * scipy.stats.t.sf(abs(t), mean.units - 1) * len(left.keys)))
            shows = np.sign(mean.value) * means[seen, j] > 2.0 * deviations[seen, j]
            if p > settings.alpha or shows.mean() < SHOWING:
                continue
            share = gain_share(left.grams, key, mean.value)
            if share >= settings.least_gain and (best is None or share > best[0]):
                best = share, j, mean, p
        if best is None:
            break
        share, j, mean, p = best
        key = left.keys[j]
        for unit_sizes in known:
            unit_sizes[key] = mean.value
        findings.append(
            FleetFinding.of(
                key,
                Scope.FLEET,
                "",
                value=mean.value,
                std=mean.std,
                fleet_value=0.0,
                p_value=p,
                gain_percent=rmse_percent(share),
                held_out=False,
                units=int(np.isfinite(left.size[:, j]).sum()),
                showing=_showing(left, j, np.arange(len(units)), mean.value),
                named_by=_named_by(units, key),
            )
        )
    return findings


def find_place_effects(
    scope: Scope,
    sizes: EffectSizes,
    units: Sequence[UnitEvidence],
    known: Known,
    settings: FleetSettings,
) -> list[FleetFinding]:
    """Effects that differ on a line, or on a day, whatever the vehicle; noted in `known`."""
    of: Callable[[UnitEvidence], str] = (
        (lambda unit: unit.line) if scope is Scope.LINE else lambda unit: unit.day
    )
    places = [of(unit) for unit in units]
    rng = np.random.default_rng(settings.seed)
    left = sizes.without(known)
    compared = compare_places(
        places, [unit.vehicle for unit in units], left.size, left.variance, rng
    )
    findings: list[FleetFinding] = []
    for row, name in enumerate(compared.names):
        rows = np.array([i for i, place in enumerate(places) if place == name])
        place_grams = [left.grams[i] for i in rows]
        best: tuple[float, int] | None = None
        for j in map(int, np.flatnonzero(compared.p_value[row] <= settings.alpha)):
            share = gain_share(place_grams, left.keys[j], float(compared.size[row, j]))
            if share >= settings.least_gain and (best is None or share > best[0]):
                best = share, j
        if best is None or len(findings) >= MOST_PLACES:
            continue
        share, j = best
        key, value = left.keys[j], float(compared.size[row, j])
        for i in rows:
            known[i][key] = known[i].get(key, 0.0) + value
        findings.append(
            FleetFinding.of(
                key,
                scope,
                name,
                value=value,
                std=float(compared.std[row, j]),
                fleet_value=0.0,
                p_value=float(compared.p_value[row, j]),
                gain_percent=rmse_percent(share),
                held_out=False,
                units=int(np.isfinite(left.size[rows, j]).sum()),
                showing=_showing(left, j, rows, value),
                named_by=_named_by([units[i] for i in rows], key),
            )
        )
    return findings


def _showing(sizes: EffectSizes, j: int, rows: np.ndarray, value: float) -> int:
    """Number of units whose own size has the sign of a value and exceeds two standard errors."""
    shows = np.sign(value) * sizes.size[rows, j] > 2.0 * np.sqrt(sizes.variance[rows, j])
    return int(shows.sum())


def _named_by(units: Sequence[UnitEvidence], key: EffectKey) -> int:
    return sum(key.effect in unit.causes for unit in units)
