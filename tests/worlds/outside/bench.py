"""A bench: the locomotive of an outside world, which obeys the demands of a controller.

It goes on where the world's first drive ended, on the same rail and with the same mechanism, whose
law gets all rows so far and changes the row that comes next. Track, weather and sand stay as they
were at that end. Wheelsets: J dω/dt = r (T − μ(λ) N); train: M dv/dt = Σ μ N − resistance.
"""

from collections.abc import Iterator
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import Protocol

import numpy as np

from adhesion_can.bus.frame import Frame
from tests.worlds.drive_profile import AXLES, INERTIA, LEAD, RADIUS, STEP_S, DriveProfile
from tests.worlds.encoding import database, messages, packed, write_log
from tests.worlds.mechanism import UNCHANGED, Change, Scene
from tests.worlds.outside.signals import coloured
from tests.worlds.outside.world import OutsideWorld
from tests.worlds.plant import Readings, draw_noise, quantise
from tests.worlds.rail import Floats, curve

SUBSTEPS = 5
"""Steps of the wheelsets in a row of 10 ms."""
RESISTANCE = 0.015
"""Deceleration of the train without effort, m/s²."""
CYCLES = {
    "WheelSpeeds1": 1, "WheelSpeeds2": 1, "VehicleSpeed": 2, "TractiveEffort1": 1,
    "TractiveEffort2": 1, "AxleLoads1": 20, "AxleLoads2": 20,
}  # fmt: skip
"""Rows between two frames of the messages that a controller gets."""


class Controller(Protocol):
    """What obeys a plan."""

    def feed(self, frame: Frame) -> list[Frame]:
        """Demands that a frame calls for."""


@dataclass(frozen=True)
class _Row:
    """What the bus shows of a row of 10 ms, before noise and digits."""

    wheel_speed: Floats
    speed: float
    effort: Floats
    load: Floats


class OutsideBench:
    """The locomotive.

    Args:
        world: World whose first drive is over.
        speed: Speed at the begin, m/s.
        duration_s: Duration of the drive, s.
        seed: Seed of the sensors' noise.

    """

    def __init__(self, world: OutsideWorld, speed: float, duration_s: float, seed: int) -> None:
        rows = round(duration_s / STEP_S)
        self._world, self._rows, self._before = world, rows, len(world.profile.t)
        self._profile = _continued(world.profile, rows)
        empty = np.zeros((self._before + rows, AXLES))
        self._omega, self._adhesion, self._effort = empty, empty.copy(), empty.copy()
        self._curves = np.tile(world.rail.curves[-1], (len(empty), 1))
        past = world.profile
        self._omega[: self._before] = (1 + past.slip) * past.v[:, None] / RADIUS
        self._adhesion[: self._before] = curve(world.rail.curves[-1], past.slip)
        self._effort[: self._before] = self._adhesion[: self._before] * past.load
        self.speed = speed
        self._wheel = np.full(AXLES, speed / RADIUS)
        self._turned = np.zeros(AXLES)
        rng = np.random.default_rng([seed, 4])
        white = draw_noise(rng, rows, 0.0)
        colour = world.std * coloured(rng, len(white.speed), 2 * STEP_S, world.memory)
        self._noise = replace(white, speed=colour)

    def drive(self, controller: Controller, path: Path) -> None:
        """Drive as a controller demands, and write what the bus carried of the locomotive."""
        demand, shown = np.zeros(AXLES), []
        sent = (database().get_message_by_name(f"EffortDemand{n}") for n in (1, 2))
        demands = {message.frame_id: message for message in sent}
        for row in range(self._rows):
            shown.append(self._read(row, self._step(row, demand)))
            for frame in _frames(row, shown[-1]):
                for answer in controller.feed(frame):
                    values = demands[answer.arbitration_id].decode(answer.data)
                    for name, value in values.items():
                        axle = name.removeprefix("EffortDemand_Ax")
                        if axle.isdigit():
                            assert isinstance(value, float | int)
                            # The largest value of the raw signal is 'not available'.
                            demand[int(axle) - 1] = value if value < 327670 else 0.0
        write_log(_joined(shown), path)

    def _step(self, row: int, demand: Floats) -> _Row:
        """Go on by 10 ms; what the signals are at its begin."""
        at, profile, world = self._before + row, self._profile, self._world
        slip = RADIUS * self._wheel / self.speed - 1
        profile.v[at], profile.slip[at] = self.speed, slip
        profile.position[at] = profile.position[at - 1] + self.speed * STEP_S
        bare = curve(world.rail.curves[-1], slip)
        whole = float((bare * world.vehicle.static_load).sum())
        lean = world.vehicle.transfer * (1 if world.vehicle.forward else -1)
        load = profile.load[at] = world.vehicle.static_load + lean * whole
        self._omega[at], self._adhesion[at] = self._wheel, bare
        own = INERTIA * self._turned / RADIUS
        self._effort[at] = bare * load + own
        change = self._change(at + 1)
        moved = np.zeros(AXLES) if change.slip is None else _last(change.slip) - slip
        share = _last(change.factor) * _last(change.load_factor)
        wheel = self._wheel * _last(change.rotation)
        before = self._wheel
        for _ in range(SUBSTEPS):
            self._turn(demand, share * load, moved)
        self._turned = (self._wheel - before) / STEP_S
        return _Row(
            wheel if change.wheel_speed is None else _last(change.wheel_speed),
            float(profile.v[at]) if change.speed is None else float(change.speed[-1]),
            demand * _last(change.gain) + _last(change.offset),
            load if change.shown_load is None else _last(change.shown_load),
        )

    def _change(self, rows: int) -> Change:
        """What the mechanism changes in the rows so far."""
        world, profile = self._world, self._profile
        if world.mechanism is None:
            return UNCHANGED
        past = DriveProfile(*(getattr(profile, f.name)[:rows] for f in fields(profile)))
        arrays = self._curves, self._omega, self._adhesion, self._effort
        return world.mechanism(Scene(past, world.vehicle, *(a[:rows] for a in arrays)))

    def _turn(self, demand: Floats, pressed: Floats, moved: Floats) -> None:
        """A step of wheels and train, implicit in the wheels' speeds: the contact is stiff."""
        h, c, v = STEP_S / SUBSTEPS, self._world.rail.curves[-1], self.speed
        slip = RADIUS * self._wheel / v - 1 + moved
        slope = c[0] * c[1] * np.exp(-c[1] * np.abs(slip)) - c[2]
        gain = h * RADIUS / INERTIA
        stiffness = np.maximum(slope, 0.0) * pressed * RADIUS / v
        force = curve(c, slip) * pressed
        change = gain * (demand - force) / (1 + gain * stiffness)
        self._wheel = np.maximum(self._wheel + change, 0.0)
        force = demand - change / gain
        pull = float(force.sum()) / self._world.vehicle.mass - RESISTANCE
        self.speed = max(v + h * pull, 1.0)

    def _read(self, row: int, true: _Row) -> Readings:
        """One row of readings, every message in it."""
        noise, profile = self._noise, self._profile
        at = self._before + row

        def one(value: float) -> Floats:
            return np.array([value])

        return Readings(
            wheel_speed=quantise((true.wheel_speed + noise.wheel[row])[None], 0.002, 0, 65534),
            speed=quantise(one(true.speed + noise.speed[row // 2]), 0.002, 0, 65534),
            effort=quantise((true.effort + noise.effort[row])[None], 10.0, -32768, 32766),
            load=quantise((true.load + noise.load[row // 20])[None], 10.0, 0, 65534),
            curvature=quantise(one(profile.curvature[at]), 1e-6, -32768, 32766),
            gradient=one(0.0),
            humidity=quantise(one(profile.humidity[at]), 0.5, 0, 200),
            rail_temperature=quantise(one(profile.rail_temperature[at] + 40), 0.5, 0, 254) - 40,
            ambient_temperature=quantise(one(profile.ambient_temperature[at] + 40), 0.5, 0, 254)
            - 40,
            sanding=one(profile.sanding[at]),
            forward=self._world.vehicle.forward,
        )


def _continued(profile: DriveProfile, rows: int) -> DriveProfile:
    """The profile with rows to come, which are as its last one."""
    out = {}
    for field in fields(profile):
        past = getattr(profile, field.name)
        out[field.name] = np.concatenate([past, np.repeat(past[-1:], rows, axis=0)])
    out["t"] = (np.arange(len(out["t"])) - LEAD) * STEP_S
    return DriveProfile(**out)


def _last(value: Floats | float) -> Floats:
    """The last row of what broadcasts to (n, 6)."""
    whole = np.asarray(value, dtype=float)
    return np.broadcast_to(whole[-1] if whole.ndim > 1 else whole, (AXLES,))


def _frames(row: int, shown: Readings) -> Iterator[Frame]:
    """Frames that are due in a row."""
    for name, signals in messages(shown).items():
        cycle = CYCLES.get(name)
        if cycle and row % cycle == 0:
            message = database().get_message_by_name(name)
            (data,) = packed(message, signals, row // cycle)
            yield Frame(row * round(STEP_S * 1e6), message.frame_id, data.tobytes())


def _joined(shown: list[Readings]) -> Readings:
    """The rows at the cycles of their messages."""

    def column(name: str, every: int) -> Floats:
        return np.concatenate([getattr(one, name) for one in shown[::every]])

    cycles = {"wheel_speed": 1, "speed": 2, "effort": 1, "load": 20, "curvature": 20,
              "gradient": 20, "humidity": 100, "rail_temperature": 100,
              "ambient_temperature": 100, "sanding": 100}  # fmt: skip
    columns = {name: column(name, every) for name, every in cycles.items()}
    return Readings(**columns, forward=shown[0].forward)
