"""Overview of a synthetic fleet, with a map and failed units."""

import datetime as dt

import numpy as np

from adhesion_can.fleet.overview import summarise_fleet
from adhesion_can.fleet.pooled_diagnosis import diagnose_fleet
from tests.fleet.synthetic_units import SIZE, Fleet

FAILED = (
    "/drives/L{:03d}.log: holds no known frame (check the database, or the bus of the recording)"
)


def synthetic_overview(vehicles=30, *, drives=2, positions=True):
    """Overview of a fleet with faults of vehicles, of a line, and a unit in forty that failed."""
    fleet = Fleet(
        vehicles,
        drives,
        by_vehicle={3: {1: SIZE}, 11: {4: -SIZE}},
        by_line={1: {2: SIZE}},
        worn={20: -0.013, 21: 0.02},
    )
    evidence = fleet.draw(5)
    rng = np.random.default_rng(2)
    units, segments = [], []
    for number, one in enumerate(evidence):
        failed = number % 40 == 7
        if failed:
            evidence[number] = type(one)(one.unit, one.vehicle, error=FAILED.format(number))
        units.append(
            {
                "unit_id": one.unit, "vehicle": one.vehicle, "line": one.line,
                "status": "failed" if failed else "done",
                "error": FAILED.format(number) if failed else None,
                "verdict": None if failed else "nothing_found", "latitude_deg": None,
                "longitude_deg": None,
            }
        )  # fmt: skip
        for _ in range(0 if failed else 3):
            along = rng.uniform(0, 1)
            mu = 0.15 + 0.2 * along + 0.05 * int(one.day[-1]) + 0.02 * rng.standard_normal()
            segments.append(
                {
                    "unit_id": one.unit, "vehicle": one.vehicle,
                    "day": dt.date.fromisoformat(one.day), "mu_max": mu,
                    "mu_max_std": 0.01,
                    "latitude_deg": 47.3 + 0.2 * along**2 if positions else None,
                    "longitude_deg": 8.2 + 0.5 * along if positions else None,
                }
            )  # fmt: skip
    return summarise_fleet(diagnose_fleet(evidence), units, segments)
