"""Drives without a radar with the filter beside them, and what comes of them."""

from dataclasses import dataclass

import numpy as np

from adhesion_can.estimation.observed_speed.filter import ObservedSpeedFilter
from adhesion_can.estimation.observed_speed.settings import ObservedSpeedSettings
from adhesion_can.physics.objection import Objection
from adhesion_can.physics.vehicle import Locomotive
from tests.worlds.without_radar import AXLES, LOAD, RADIUS, STEP_S, Driving, Trains

SPEEDS = (5.0, 10.0, 20.0, 30.0)
WAYS = {
    "steady": Driving(),
    "sweeps": Driving(sweeps=True),
    "reliefs": Driving(reliefs=True),
    "sweeps-reliefs": Driving(reliefs=True, sweeps=True),
    "idle-axle": Driving(idle=True),
    "gnss-0.03": Driving(gnss_std=0.03),
    "gnss-0.1": Driving(gnss_std=0.1),
}
"""Ways of driving; 'steady' is also what a drive with a radar does."""
PULLS = 0.03 * LOAD
"""Effort above which an axle's slip is judged, N."""
EACH = 5
"""Steps between two judged moments."""


@dataclass(frozen=True)
class Record:
    """A row each 50 ms; arrays (rows, drives) or (rows, drives, axles).

    Attributes:
        speed: m/s at which each drive begins, (drives,).
        error: Error of the slip.
        std: Its stated standard deviation.
        known: Whether the filter says that the slip is known.
        pulls: Whether the axle pulls.
        speed_error: Relative error of the speed.
        force: Sum of the forces of all axles, N.
        slip: True slip.
        radar_error: Error of a slip by the radar.
        reason: Why the slip is not known, by drive, a row each 50 ms.
        trains: The trains after the last step.

    """

    speed: np.ndarray
    error: np.ndarray
    std: np.ndarray
    known: np.ndarray
    pulls: np.ndarray
    speed_error: np.ndarray
    force: np.ndarray
    slip: np.ndarray
    radar_error: np.ndarray
    reason: list[tuple[Objection, ...]]
    trains: Trains


def drive(way, seeds, duration_s, settings=None):
    """Run drives of all seeds at all speeds, the filter's wishes for a relief obeyed."""
    driving = WAYS[way]
    names = [(seed, v) for seed in seeds for v in SPEEDS]
    trains = Trains([s for s, _ in names], [v for _, v in names], driving)
    if settings is None:
        std = driving.gnss_std or 0.05
        settings = ObservedSpeedSettings(gnss_std=std)
    observer = ObservedSpeedFilter(Locomotive(), settings, len(names))
    wanted, rows, reasons, true = None, [], [], []
    for _ in range(round(duration_s / STEP_S)):
        seen = trains.step(wanted)
        gnss = seen.gnss if driving.gnss_std is not None else None
        found = observer.update(STEP_S, seen.wheel_speed, seen.effort, seen.load, gnss)
        force = np.abs(trains.force)
        by_radar = seen.wheel_speed * RADIUS / seen.radar[:, None] - 1
        true.append(np.concatenate([trains.slip, trains.v[:, None], force, by_radar], axis=1))
        if len(true) < EACH:
            continue
        wanted = found.relief_wanted
        # The filter's figures are those of a block, and so is the truth.
        mean = np.mean(true, axis=0)
        slip, speed = mean[:, :AXLES], mean[:, AXLES]
        force, by_radar = mean[:, AXLES + 1 : 2 * AXLES + 1], mean[:, 2 * AXLES + 1 :]
        true = []
        rows.append(
            (
                found.slip - slip,
                found.slip_std,
                found.known,
                force > PULLS,
                found.speed / speed - 1,
                force.sum(axis=1),
                slip,
                by_radar - slip,
            )
        )
        reasons.append(found.reasons)
    columns = [np.array(column) for column in zip(*rows, strict=True)]
    return Record(np.array([v for _, v in names]), *columns, reasons, trains)


def figures(record, chosen=slice(None)):
    """Figures of the drives that are chosen: pure, for the report."""
    known = record.known[:, chosen]
    judged = known[:, :, None] & record.pulls[:, chosen]
    error, std = record.error[:, chosen][judged], record.std[:, chosen][judged]
    if not len(error):
        return {"known": 0.0, "rms": np.nan, "stated": np.nan, "coverage": np.nan, "drives": 0.0}
    return {
        "known": float(known.mean()),
        "rms": float(np.sqrt(np.mean(error**2))),
        "stated": float(np.sqrt(np.mean(std**2))),
        "coverage": float(np.mean(np.abs(error) <= 1.96 * std)),
        "drives": float(known.any(axis=0).mean()),
    }


def force_share(record, reference):
    """Force of each drive over that of the same drive steady, (drives,)."""
    return record.force.mean(axis=0) / reference.force.mean(axis=0)


def radar_error(record):
    """Error of the slips by a radar, rms."""
    return float(np.sqrt(np.mean(record.radar_error[record.pulls] ** 2)))
