"""A fleet of locomotives on several lines and days, few of them with something hidden.

Each vehicle keeps its loads, its train and what is hidden in it; each line on each day has a rail
of its own; each drive has its own profile, weather and noise.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from datetime import UTC, date, datetime, time
from pathlib import Path

import numpy as np

from tests.worlds.drive_profile import LEAD, draw_profile, draw_vehicle
from tests.worlds.encoding import write_log
from tests.worlds.hidden import Hidden
from tests.worlds.plant import draw_noise, drive
from tests.worlds.rail import one_surface

HIDDEN = (
    Hidden("humidity", "", {"slope": -0.004}),
    Hidden("effort_bias", "", {"bias": 4000.0}),
    Hidden("speed_delay", "", {"delay": 0.15}),
    Hidden("traction_braking_asymmetry", "", {"gain": -0.12}),
    Hidden("wheelset_inertia", "", {"error": 400.0}),
    Hidden("sanding", "", {"gain": 0.15}),
    Hidden("creep_relaxation", "", {"length": 0.5}),
    Hidden("rail_temperature", "", {"slope": 0.006}),
)
"""Effects of the size that a workshop meets."""
WEAR = (0.01, 0.03)
"""Least and largest share by which a worn wheel is smaller."""


@dataclass(frozen=True)
class FleetDrive:
    """One drive of one vehicle.

    Attributes:
        vehicle: Name of the vehicle.
        line: Name of the line.
        day: Date, ISO 8601.
        effects: What is hidden in the vehicle.
        seed: Seeds of fleet, vehicle, line and day, and drive.

    """

    vehicle: str
    line: str
    day: str
    effects: tuple[Hidden, ...]
    seed: tuple[int, int, int, int]

    @property
    def name(self) -> str:
        """Name of the file without its folder."""
        return f"{self.vehicle}_{self.line}_{self.day}.log"


def draw_fleet(
    seed: int,
    vehicles: int,
    hidden: Sequence[Hidden],
    worn: int,
    *,
    drives: int = 2,
    lines: int = 5,
    days: int = 6,
) -> list[FleetDrive]:
    """Drives of a fleet; a vehicle goes to different lines on different days.

    Args:
        seed: Seed of the fleet.
        vehicles: Number of vehicles.
        hidden: Effects, each hidden in a vehicle of its own.
        worn: Number of further vehicles with one to three worn axles.
        drives: Number of drives of each vehicle.
        lines: Number of lines.
        days: Number of days.

    """
    rng = np.random.default_rng([seed, 7])
    faulty = rng.choice(vehicles, len(hidden) + worn, replace=False)
    effects: dict[int, tuple[Hidden, ...]] = {
        int(v): (e,) for v, e in zip(faulty[: len(hidden)], hidden, strict=True)
    }
    for vehicle in faulty[len(hidden) :]:
        axles = rng.choice(6, int(rng.integers(1, 4)), replace=False) + 1
        effects[int(vehicle)] = tuple(
            Hidden("wheel_radius", "", {"error": -rng.uniform(*WEAR), "axle": int(axle)})
            for axle in sorted(axles)
        )
    found = []
    for vehicle in range(vehicles):
        dates = np.sort(rng.choice(days, drives, replace=False))
        for number, day in enumerate(dates):
            line = int(rng.integers(lines))
            found.append(
                FleetDrive(
                    f"L{vehicle + 1:03d}",
                    f"line{line + 1}",
                    f"2026-03-{int(day) + 1:02d}",
                    effects.get(vehicle, ()),
                    (seed, vehicle, 1000 * line + int(day), number),
                )
            )
    return found


def write_drive(one: FleetDrive, path: Path, *, duration_s: float = 120.0) -> None:
    """Write a drive as a candump log."""
    seed, vehicle, place, number = one.seed
    rail = one_surface(np.random.default_rng([seed, 1, place]))
    # The train differs from drive to drive, since a heavier one is needed where the rail is good.
    own = np.random.default_rng([seed, 2, vehicle])
    locomotive = draw_vehicle(own, rail)
    rng = np.random.default_rng([seed, 3, vehicle, number])
    locomotive = replace(locomotive, forward=bool(rng.random() < 0.5))
    profile = draw_profile(rng, duration_s, locomotive, rail)
    noise = draw_noise(rng, len(profile.t) - LEAD, 0.0)
    begin = datetime.combine(date.fromisoformat(one.day), time(6 + 3 * number), UTC)
    readings = drive(profile, locomotive, rail, one.effects, noise)
    write_log(readings, path, int(begin.timestamp()))
