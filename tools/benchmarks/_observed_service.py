"""Setpoints of the service on trains without a radar, judged against the rail under the axles."""

import tempfile
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from _truth_figures import LEAST_ERROR, is_wrong

from adhesion_can.config import load_configuration
from adhesion_can.fmu.service import ReadingsCore
from adhesion_can.physics.objection import NEEDS_RELIEF
from adhesion_can.physics.readings import Reading, Role
from adhesion_can.physics.status import Status
from tests.gnss_configuration import write_gnss_configuration
from tests.worlds.track_without_radar import PLACES
from tests.worlds.without_radar import AXLES, STEP_S, Driving, Trains

OBSERVING = "[observed_speed]\nenabled = true\n"
MEASURING = "[sensors]\nvehicle_speed_std = 0.04\n"
"""Configurations without a radar, and with one as the trains have it."""
PAUSE_S, WAIT_S = 3.0, 1.0
"""Time between two reliefs, and from an objection to the relief that it asks for, s."""
SETPOINTS = {
    "reliefs": (OBSERVING, Driving(reliefs=True)),
    "reliefs-excursions": (OBSERVING, Driving(reliefs=True, excursions=True)),
    "gnss-reliefs-excursions": (
        None,
        Driving(reliefs=True, excursions=True, gnss_std=0.03),
    ),
    "radar": (MEASURING, Driving()),
    "radar-excursions": (MEASURING, Driving(excursions=True)),
}
"""Configuration and driving of each way in which setpoints are judged.

None is a configuration with a speed by satellites and no radar.
"""


@dataclass(frozen=True)
class Judged:
    """Setpoints of one drive; arrays of shape (setpoints,).

    Attributes:
        tracking: Whether the status is TRACKING.
        objected: Whether a relief is missing.
        wrong: Whether it is TRACKING, and wrong beyond three standard deviations and 2 % of μ_max
            or 5 % of λ_m.

    """

    tracking: np.ndarray
    objected: np.ndarray
    wrong: np.ndarray


def configured(text):
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "bench.toml"
        if text is None:
            path = write_gnss_configuration(Path(folder), 'gnss_speed = "Satellites.Speed"')
        else:
            path.write_text(text, encoding="utf-8")
        return load_configuration(path)


def serve(way, seed, speed, duration_s):
    """One drive through the service; reliefs as a controller that reads `Objection` makes them."""
    text, driving = SETPOINTS[way]
    rows = []
    trains = Trains([seed], [speed], driving)
    peaks = {}

    def note(_, outputs):
        rows.append((outputs, peaks["now"]))

    core = ReadingsCore(configured(text), on_setpoint=note)
    objected_s, relieved_s = 0.0, -PAUSE_S
    for number in range(round(duration_s / STEP_S)):
        wanted = objected_s >= WAIT_S and trains.t - relieved_s >= PAUSE_S
        seen = trains.step(np.array([wanted]))
        if trains.relieved[0] >= 0:
            relieved_s = trains.t
        if number % 10 == 0:
            peaks["now"] = true_peaks(trains)
        core.feed_readings(round(trains.t * 1e6), list(readings(seen, number)))
        objects = core.outputs.objection in NEEDS_RELIEF
        objected_s = objected_s + STEP_S if objects else 0.0
    return judged(rows)


def readings(seen, number):
    """Readings of a step: speeds and efforts each 10 ms, a radar's each 20 ms, loads each 200.

    A speed by satellites is read each second, where there is one.
    """
    t_us = round(number * STEP_S * 1e6)
    t_us += round(STEP_S * 1e6)
    if number % 20 == 0:
        for axle in range(AXLES):
            yield Reading(t_us, Role.AXLE_LOAD, axle + 1, float(seen.load[0, axle]))
    if number % 2 == 0:
        yield Reading(t_us, Role.VEHICLE_SPEED, 0, float(seen.radar[0]))
    if np.isfinite(seen.gnss[0]):
        yield Reading(t_us, Role.GNSS_SPEED, 0, float(seen.gnss[0]))
    for axle in range(AXLES):
        yield Reading(t_us, Role.WHEEL_SPEED, axle + 1, float(seen.wheel_speed[0, axle]))
        yield Reading(t_us, Role.TRACTIVE_EFFORT, axle + 1, float(seen.effort[0, axle]))


def true_peaks(trains):
    """Least and largest μ_max and λ_m under the axles now."""
    rail = trains.track.surface(trains.place[:, :1] - PLACES)
    slip = np.geomspace(5e-4, 0.5, 400)[:, None]
    mu = rail.adhesion(slip * trains.v[0], trains.v[0]) * trains.level[0]
    top = mu.argmax(axis=0)
    mu_max, lambda_m = mu.max(axis=0), slip[top, 0]
    return mu_max.min(), mu_max.max(), lambda_m.min(), lambda_m.max()


def beyond(value, low, high):
    """Relative error of a value outside of a range, 0 within."""
    return np.where(value < low, value / low - 1, np.where(value > high, value / high - 1, 0.0))


def judged(rows):
    """Setpoints against the range of the peaks under the axles: pure, for the report."""
    tracking = np.array([o.status is Status.TRACKING for o, _ in rows])
    objected = np.array([o.objection in NEEDS_RELIEF for o, _ in rows])

    def column(read):
        return np.array([np.nan if (x := read(o)) is None else x for o, _ in rows], dtype=float)

    true = np.array([peaks for _, peaks in rows])
    mu, mu_std = column(lambda o: o.setpoint.mu_max), column(lambda o: o.mu_max_std)
    slip, slip_std = column(lambda o: o.setpoint.lambda_m), column(lambda o: o.lambda_m_std)
    wrong = is_wrong(beyond(mu, true[:, 0], true[:, 1]), mu_std / mu, LEAST_ERROR["mu_max"])
    wrong |= is_wrong(
        beyond(slip, true[:, 2], true[:, 3]), slip_std / slip, LEAST_ERROR["lambda_m"]
    )
    return Judged(tracking, objected, tracking & wrong)
