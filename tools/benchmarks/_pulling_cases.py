"""Rails and trains on which creep controllers are compared."""

from dataclasses import dataclass, replace

import numpy as np

from adhesion_can.physics.vehicle import Locomotive
from adhesion_can.simulation.effect_option import parse_effects
from adhesion_can.simulation.run import RunSettings
from adhesion_can.simulation.scenarios import scenario_by_name

DRY, WET, GREASY = (0.40, 60.0, 0.30), (0.27, 45.0, 0.22), (0.15, 40.0, 0.12)
STEEP, FLAT = (0.40, 200.0, 0.30), (0.10, 15.0, 0.02)
SANDED = (0.25, 50.0, 0.20)
AXLES = Locomotive().axles
BEHIND_M = np.array([0.0, 2.0, 4.0, 11.0, 13.0, 15.0])
"""Distance of each axle behind the first, m, about that of a Co-Co."""


class Rails:
    """Burckhardt curves under the axles as a function of time and of each axle's place."""

    def __init__(self, curves):
        self._curves = curves

    def under(self, time_s, position):
        rows = self._curves(time_s, position - BEHIND_M)
        return tuple(np.broadcast_to(np.asarray(rows, dtype=float), (AXLES, 3)).T)


def steady(theta):
    return Rails(lambda _time_s, _places: theta)


def sections(seconds, thetas):
    """One curve after another, each for so many seconds, under all axles at once."""
    last = len(thetas) - 1
    return Rails(lambda time_s, _: thetas[min(int(time_s / seconds), last)])


def patches(length_m, one, other):
    """Two curves in turn along the track."""
    return Rails(lambda _, places: np.where((places // length_m % 2 == 0)[:, None], one, other))


def drift(seconds, one, other):
    """From one curve to another, evenly in the logarithms of its parameters."""

    def curves(time_s, _):
        share = min(time_s / seconds, 1.0)
        return np.exp((1.0 - share) * np.log(one) + share * np.log(other))

    return Rails(curves)


def one_axle(axle, theta, others):
    rows = np.array([theta if number == axle else others for number in range(1, AXLES + 1)])
    return Rails(lambda *_: rows)


@dataclass(frozen=True)
class Case:
    """A rail and a train.

    Attributes:
        name: Name in the table.
        kind: 'steady', 'changing', or 'instrument' for an error of a sensor.
        rails: Curves; None: those of the scenario.
        scenario: Scenario of the simulation.
        seconds: Duration, s.
        speed: Speed at the start, m/s.
        effects: Errors of the instruments, as `--effect` takes them.
        gradient: Constant gradient, m/m; None: the track keeps the train near its speed.

    """

    name: str
    kind: str
    rails: Rails | None = None
    scenario: str = "dry"
    seconds: float = 60.0
    speed: float = 10.0
    effects: tuple[str, ...] = ()
    gradient: float | None = None

    def run_settings(self, seed):
        scenario = replace(
            scenario_by_name(self.scenario), speed=self.speed, gradient=self.gradient
        )
        return RunSettings(
            scenario,
            self.seconds,
            seed=seed,
            effects=parse_effects(self.effects, Locomotive()),
            obey=True,
            load_transfer=self.gradient is not None,
        )


STEADY = {"dry": DRY, "wet": WET, "greasy": GREASY, "0.40, 200, 0.30": STEEP,
          "0.10, 15, 0.02": FLAT}  # fmt: skip
INSTRUMENTS = ("speed_scale", "wheel_radius", "effort_bias", "speed_delay", "effort_delay",
               "wheel_speed_delay")  # fmt: skip
CASES = (
    *(Case(name, "steady", steady(theta)) for name, theta in STEADY.items()),
    *(Case(name, "steady", None, name) for name in ("polach-dry", "polach-wet", "polach-low")),
    *(
        Case(f"dry to greasy, {speed} m/s", "changing", sections(20.0, (DRY, GREASY)),
             seconds=40.0, speed=float(speed))
        for speed in (5, 10, 20)
    ),
    Case("patches of 20 m", "changing", patches(20.0, DRY, GREASY)),
    Case("5 changes a minute", "changing", sections(12.0, (DRY, WET, STEEP, GREASY, FLAT))),
    Case("humidity, peak 30 % in 2 min", "changing", drift(120.0, DRY, (0.32, 40.0, 0.24)),
         seconds=120.0),
    Case("sanding", "changing", sections(10.0, (GREASY, SANDED) * 3)),
    Case("start on 8 permille, wet", "changing", steady(WET), speed=0.3, gradient=0.008),
    Case("one axle on oil", "steady", one_axle(3, GREASY, DRY)),
    *(Case(name, "instrument", steady(DRY), effects=(name,)) for name in INSTRUMENTS),
)  # fmt: skip
