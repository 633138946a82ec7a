"""A bench that an emulated machine can follow: our own messages ten times as slow, two axles.

It estimates by recursive least squares, in half the time of the tracker, and in a tenth where an
estimate begins. What is tested is the kernel's interface; the tracker runs live on other buses.
"""

import math
import random
import re

from adhesion_can.recordings.candump import format_frame
from tests.wire import DBC, Bench

CONFIG = """\
estimator = "rls"

[bus]
database = "slow.dbc"

[vehicle]
axles = 2
"""
SLOWER = 10
CYCLES_US = {"WheelSpeeds1": 100_000, "TractiveEffort1": 100_000, "VehicleSpeed": 200_000}
SETPOINTS_PER_S = 5
SPEED, RADIUS, LOAD = 10.0, 0.625, 245e3


def write_configuration(folder, stretch=1):
    """slow.dbc and slow.toml, with cycles that are longer again by a factor."""
    text, messages = re.subn(
        r'^(BA_ "GenMsgCycleTime" BO_ \d+) (\d+);$',
        lambda match: f"{match[1]} {int(match[2]) * SLOWER * stretch};",
        DBC.read_text(),
        flags=re.MULTILINE,
    )
    assert messages, "the database states no cycles"
    (folder / "slow.dbc").write_text(text)
    (folder / "slow.toml").write_text(CONFIG)


def write_drive(path, theta, duration_s, stretch=1):
    """A candump log of a drive whose slip goes to and fro over the peak of a Burckhardt curve.

    Its stamps are as far apart as the configuration of the same factor has the cycles.
    """
    c1, c2, c3 = theta
    bench, noise = Bench(), random.Random(1)
    with path.open("w") as file:
        for t_us in range(0, round(duration_s * 1e6), 100_000):
            slip = 0.08 - 0.075 * math.cos(2 * math.pi * t_us / 3e6)
            adhesion = c1 * (1 - math.exp(-c2 * slip)) - c3 * slip
            effort = [(adhesion + noise.gauss(0, 0.005)) * LOAD for _ in range(2)]
            signals = {
                "WheelSpeeds1": wheels("WheelSpeed", [SPEED * (1 + slip) / RADIUS] * 2),
                "TractiveEffort1": wheels("TractiveEffort", effort),
                "VehicleSpeed": {
                    "VehicleSpeed": SPEED,
                    "VehicleSpeedSource": 1,
                    "Direction": 1,
                },
            }
            for name, cycle_us in CYCLES_US.items():
                if t_us % cycle_us == 0:
                    file.write(format_frame(bench.frame(name, t_us * stretch, **signals[name])))


def wheels(name, values):
    """Signals of the axles, counted from 1."""
    return {f"{name}_Ax{axle}": value for axle, value in enumerate(values, 1)}
