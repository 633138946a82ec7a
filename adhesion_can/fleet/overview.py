"""A fleet at a glance: adhesion by line and day, where it was measured, and what failed."""

from collections import Counter, defaultdict
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from adhesion_can.arrays import Array
from adhesion_can.fleet.findings import FleetDiagnosis

MOST_RELATIVE_STD = 0.1
"""Relative standard deviation of μ_max up to which a segment counts."""
MOST_POINTS = 4000
"""Largest number of points of the map; of more, those at even distances in their order are kept."""
MOST_FAILURES = 200
"""Largest number of failed units that are listed."""


@dataclass(frozen=True, slots=True)
class PlaceEstimate:
    """Adhesion on one line on one day.

    Attributes:
        line: Name of the line; '' where it is not known.
        day: Date, ISO 8601; '' where it is not known.
        median: Median of μ_max over the segments.
        low: First quartile of it.
        high: Third quartile of it.
        segments: Number of segments.
        vehicles: Number of vehicles.

    """

    line: str
    day: str
    median: float
    low: float
    high: float
    segments: int
    vehicles: int


@dataclass(frozen=True, slots=True)
class Failure:
    """A unit that failed.

    Attributes:
        unit: Id of the unit.
        vehicle: Id of the vehicle.
        reason: Error in one line.

    """

    unit: str
    vehicle: str
    reason: str


@dataclass(frozen=True, eq=False)
class FleetOverview:
    """What a report shows of a fleet.

    Attributes:
        diagnosis: Result of the fleet-level diagnosis.
        estimates: Adhesion by line and day, in the order of lines, then days.
        positions: Longitude and latitude, °, and μ_max of segments; shape (points, 3).
        located: Number of segments with a position.
        failures: Failed units, the first of them.
        failed: Number of failed units.
        verdicts: Number of units by the verdict of their own diagnosis.

    """

    diagnosis: FleetDiagnosis
    estimates: tuple[PlaceEstimate, ...] = ()
    positions: Array = field(default_factory=lambda: np.empty((0, 3)))
    located: int = 0
    failures: tuple[Failure, ...] = ()
    failed: int = 0
    verdicts: Mapping[str, int] = field(default_factory=dict)


def summarise_fleet(
    diagnosis: FleetDiagnosis,
    units: Iterable[Mapping[str, Any]],
    segments: Iterable[Mapping[str, Any]],
) -> FleetOverview:
    """Overview of a fleet.

    Args:
        diagnosis: Result of the fleet-level diagnosis.
        units: Rows of the table `units`, in any order.
        segments: Rows of the table `segments`.

    """
    lines: dict[str, str] = {}
    where: dict[str, tuple[float, float]] = {}
    failures: list[Failure] = []
    verdicts: Counter[str] = Counter()
    # One by one: there may be more of them than should be held.
    for row in units:
        unit = row["unit_id"]
        lines[unit] = row.get("line") or ""
        if row["longitude_deg"] is not None and row["latitude_deg"] is not None:
            # A list of units may say where a recording was made; a TABLE says it row by row.
            where[unit] = row["longitude_deg"], row["latitude_deg"]
        if row["status"] == "failed":
            failures.append(Failure(unit, row["vehicle"], row["error"] or "no reason given"))
        if row.get("verdict"):
            verdicts[row["verdict"]] += 1
    values: dict[tuple[str, str], list[float]] = defaultdict(list)
    vehicles: dict[tuple[str, str], set[str]] = defaultdict(set)
    points: list[tuple[float, float, float]] = []
    for row in segments:
        mu, std = row["mu_max"], row["mu_max_std"]
        if row["unit_id"] not in lines or mu is None or std is None or std > MOST_RELATIVE_STD * mu:
            continue
        day = "" if row["day"] is None else str(row["day"])
        place = lines[row["unit_id"]], day
        values[place].append(mu)
        vehicles[place].add(row["vehicle"])
        at = row["longitude_deg"], row["latitude_deg"]
        longitude, latitude = where.get(row["unit_id"], (None, None)) if None in at else at
        if longitude is not None and latitude is not None:
            points.append((longitude, latitude, mu))
    estimates = []
    for place in sorted(values):
        low, median, high = map(float, np.quantile(values[place], (0.25, 0.5, 0.75)))
        estimates.append(
            PlaceEstimate(*place, median, low, high, len(values[place]), len(vehicles[place]))
        )
    failures.sort(key=lambda failure: failure.unit)
    kept = np.unique(np.linspace(0, len(points) - 1, min(len(points), MOST_POINTS)).astype(int))
    return FleetOverview(
        diagnosis,
        tuple(estimates),
        np.array([points[i] for i in kept]).reshape(-1, 3),
        len(points),
        tuple(failures[:MOST_FAILURES]),
        len(failures),
        verdicts,
    )
