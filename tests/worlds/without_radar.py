"""Trains without a radar, many side by side: what the wheels and efforts of a locomotive read.

The locomotive pulls (or brakes) wagons that are masses between springs and dampers. Gradient,
curves and the rail's surface belong to the track, so that each wagon and each axle meets them at
its own moment. Nothing here is shared with the filter that is judged: the contact is Polach's
(Wear 258 (2005) 992-1000), the running resistance Davis', that of curves Röckl's.

Arrays have one row a drive. A drive depends on its seed and speed alone, not on its neighbours.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from tests.worlds.rail import Floats
from tests.worlds.track_without_radar import (
    PLACES,
    Track,
    draw_track,
)

STEP_S = 0.01
AXLES = len(PLACES)
RADIUS, LOAD, WHEELSET = 0.625, 245e3, 512.0
"""Nominal wheel radius, m; axle load, N; inertia of a wheelset at the rim, kg."""
GRAVITY = 9.81
WAGONS, WAGON_LENGTH = 12, 38.0
"""Lumps that the train is made of, and the length of one, m."""
TRANSFER = np.array([-0.045, -0.02, 0.005, -0.005, 0.02, 0.045])
"""Load that each axle gains for the whole effort, 1."""
WHEEL_STD, EFFORT_STD = 0.003, 0.01 * LOAD
RELIEF_EACH_S, RELIEF_S, RELIEF_RAMP_S, FIRST_RELIEF_S = 20.0, 1.0, 0.15, 6.0
EXCURSION_EACH_S, EXCURSION_S, FIRST_EXCURSION_S, EXCURSION_SLIP = 4.0, 3.0, 12.0, 0.12
EXCURSION_GAIN, EXCURSION_RATE = 25e3, 100e3
"""Gains of the rim speed in an excursion, N per m/s and N/s per m/s."""
CHUNK, SUBSTEPS = 500, 3


@dataclass(frozen=True)
class Driving:
    """A way of driving, and the instruments beside wheels and efforts.

    Attributes:
        reliefs: Whether an axle is relieved each 20 s, one after the other, and when asked for.
        sweeps: Whether the effort is swept slowly.
        idle: Whether the last axle never pulls.
        gnss_std: Standard deviation of a GNSS speed each second, m/s; None: there is none.
        accelerometer: Whether there is a longitudinal acceleration.
        excursions: Whether one axle after the other turns up to 12 % faster than the others do.

    """

    reliefs: bool = False
    sweeps: bool = False
    idle: bool = False
    gnss_std: float | None = None
    accelerometer: bool = False
    excursions: bool = False


@dataclass(frozen=True)
class SensorReadings:
    """What the instruments show at a moment.

    Attributes:
        wheel_speed: rad/s, (drives, axles).
        effort: N, (drives, axles).
        load: N, as computed from static load and effort, (drives, axles).
        gnss: m/s, NaN where there is none now, (drives,).
        acceleration: m/s², NaN where there is none, (drives,).
        radar: m/s, (drives,).

    """

    wheel_speed: Floats
    effort: Floats
    load: Floats
    gnss: Floats
    acceleration: Floats
    radar: Floats


class Trains:
    """Trains that run side by side, 10 ms a step."""

    def __init__(self, seeds: Sequence[int], speeds: Sequence[float], driving: Driving) -> None:
        self.driving = driving
        self.drives = len(seeds)
        speed_keys = [round(10 * v) for v in speeds]
        self._rngs = [
            np.random.default_rng([481, s, k]) for s, k in zip(seeds, speed_keys, strict=True)
        ]
        self._noises = [
            np.random.default_rng([482, s, k]) for s, k in zip(seeds, speed_keys, strict=True)
        ]
        self.v0 = np.asarray(speeds, dtype=float)
        self.step_number = 0
        self._draw()
        self._start()

    def _draw(self) -> None:
        def each(draw):
            return np.array([draw(rng) for rng in self._rngs])

        self.radius_error = each(lambda g: g.normal(0, 0.002, AXLES))
        self.level = each(lambda g: 1 + g.normal(0, 0.05, AXLES))
        self.load_error = each(lambda g: g.normal(0, 0.02, AXLES))
        self.effort_gain = each(lambda g: 1 + g.normal(0, 0.01, AXLES))
        self.effort_bias = each(lambda g: g.normal(0, 500.0, AXLES))
        self.use = each(lambda g: g.uniform(0.6, 0.95))
        self.sign = each(lambda g: 1.0 if g.random() < 0.75 else -1.0)
        self.sweep_s = each(lambda g: g.uniform(15, 40))
        train_mass = each(lambda g: 1.5e6 * (1 + g.normal(0, 0.06)))
        self.mass = np.concatenate(
            [np.full((self.drives, 1), 150e3), np.repeat(train_mass[:, None] / WAGONS, WAGONS, 1)],
            axis=1,
        )
        self.spring = each(lambda g: g.uniform(0.8e7, 2.5e7))[:, None]
        share = each(lambda g: g.uniform(0.08, 0.3))[:, None]
        self.damper = 2 * share * np.sqrt(self.spring * self.mass[:, 1:])
        self.davis = each(lambda g: g.uniform(0.8, 1.4))[:, None]
        # A brake that drags: on one wagon, from a moment to another, N.
        self.drag_force = each(lambda g: g.choice([0.0, g.uniform(5e3, 25e3)]))
        self.drag_from = each(lambda g: g.uniform(10, 80))
        self.drag_for = each(lambda g: g.uniform(10, 40))
        self.track: Track = draw_track(self._rngs, self.v0, WAGONS * WAGON_LENGTH)

    def _start(self) -> None:
        shape = (self.drives, AXLES)
        self.place = -np.arange(WAGONS + 1) * WAGON_LENGTH + np.zeros((self.drives, 1))
        self.velocity = np.repeat(self.v0[:, None], WAGONS + 1, axis=1)
        self.rim = np.repeat(self.v0[:, None], AXLES, axis=1)
        self.peak = self._sight().peak
        self.confidence = np.ones(shape)
        self.ramp = np.ones(shape)
        self.next_axle = np.zeros(self.drives, dtype=int)
        self.relief_until = np.full(self.drives, -1.0)
        self.relieved = np.full(self.drives, -1)
        self.stretch = np.zeros((self.drives, WAGONS))
        self.coupler = np.zeros((self.drives, WAGONS))
        # The mean gradient balances the effort, so that the speed stays where it is of interest.
        pull = (self.sign * self.use * self.peak.mean(axis=1)) * LOAD * AXLES
        pull *= (AXLES - 1) / AXLES if self.driving.idle else 1.0
        whole = self.mass.sum(axis=1)
        rolling = (self._rolling(self.velocity) * self.mass).sum(axis=1)
        self.mean_grade = (pull - rolling) / whole / GRAVITY
        # Couplers begin stretched by what the wagons behind them need.
        need = (GRAVITY * self.mean_grade[:, None] + self._rolling(self.velocity)) * self.mass
        self.stretch = np.cumsum(need[:, :0:-1], axis=1)[:, ::-1] / self.spring
        self.slip = np.zeros(shape)
        self.force = np.zeros(shape)
        self.acceleration = np.zeros(self.drives)
        self.effort = np.zeros(shape)
        self.push = np.zeros(self.drives)
        self.lead = np.zeros(shape)

    @property
    def t(self) -> float:
        """Time of the next step, s."""
        return self.step_number * STEP_S

    @property
    def v(self) -> Floats:
        """Speed of the locomotive, m/s."""
        return self.velocity[:, 0]

    def _sight(self):
        return self.track.surface(self.place[:, :1] - PLACES)

    def _rolling(self, velocity: Floats) -> Floats:
        """Davis' running resistance, m/s²; 12 N/t at a crawl, 30 N/t at 30 m/s."""
        return self.davis * (0.012 + 1e-4 * velocity + 1.6e-5 * velocity**2)

    def step(self, wanted: np.ndarray | None = None) -> SensorReadings:
        """Let 10 ms pass, and read the instruments.

        Args:
            wanted: Whether a drive is asked to relieve an axle, (drives,); None: no.

        """
        at = self._sight()
        self._steer(wanted, at.peak)
        load = LOAD * (1 + self.load_error) + TRANSFER * self.effort.sum(axis=1, keepdims=True)
        self._wheels(at, load)
        self._train()
        readings = self._read()
        self.step_number += 1
        return readings

    def _steer(self, wanted, peak: Floats) -> None:
        t, v = self.t, self.v
        # The drive finds the level of a new surface in half a second, axle by axle.
        self.peak += (peak - self.peak) * (STEP_S / 0.5)
        use = self.use * (1 - np.clip(0.5 * self.sign * (v / self.v0 - 1), -0.1, 0.4))
        if self.driving.sweeps:
            use = use * (0.8 + 0.3 * np.sin(2 * np.pi * t / self.sweep_s))
        if self.driving.reliefs:
            since = t - FIRST_RELIEF_S
            due = since > -1e-9 and (since + 1e-9) % RELIEF_EACH_S < STEP_S
            asked = np.full(self.drives, due) | (False if wanted is None else wanted)
            begins = asked & (self.relieved < 0)
            self.relieved = np.where(begins, self.next_axle, self.relieved)
            self.next_axle = np.where(begins, (self.next_axle + 1) % AXLES, self.next_axle)
            self.relief_until = np.where(begins, t + RELIEF_S, self.relief_until)
            self.relieved = np.where(t >= self.relief_until, -1, self.relieved)
        goal = np.ones((self.drives, AXLES))
        held = self.relieved >= 0
        goal[held, self.relieved[held]] = 0.0
        if self.driving.idle:
            goal[:, -1] = 0.0
            self.ramp[:, -1] = 0.0
        most = STEP_S / RELIEF_RAMP_S
        self.ramp += np.clip(goal - self.ramp, -most, most)
        self.demand = np.clip(use, 0.2, 0.97)[:, None] * self.peak * LOAD * self.confidence
        self.demand = self.demand * self.ramp
        self._lead_excursion()

    def _lead_excursion(self) -> None:
        """One axle turns ever faster than the others, and back: none while one is relieved."""
        self.asked_too_much = np.zeros((self.drives, AXLES), dtype=bool)
        number, since = divmod(self.t - FIRST_EXCURSION_S, EXCURSION_EACH_S)
        if not (self.driving.excursions and number >= 0 and since < EXCURSION_S):
            self.lead = self.demand.copy()
            return
        axle = int(number) % AXLES
        self.asked_too_much[self.relieved < 0, axle] = True
        others = np.median(np.delete(self.rim, axle, axis=1), axis=1)
        share = EXCURSION_SLIP * (1.0 - abs(2.0 * since / EXCURSION_S - 1.0))
        error = share * others - self.sign * (self.rim[:, axle] - others)
        held = np.clip(self.lead[:, axle] + STEP_S * EXCURSION_RATE * error, 0.0, LOAD)
        self.lead = self.demand.copy()
        self.lead[:, axle] = held
        demand = np.clip(held + EXCURSION_GAIN * error, 0.0, LOAD)[:, None]
        self.demand = np.where(self.asked_too_much, demand, self.demand)

    def _wheels(self, at, load: Floats) -> None:
        v = self.v[:, None]
        limit = 0.10 * v + 0.3
        firm = 150e3  # N per m/s of creep beyond the limit, taken back by the slip protection
        spinning = np.zeros(self.rim.shape, dtype=bool)
        for _ in range(SUBSTEPS):
            creep = self.sign[:, None] * (self.rim - v)
            over = np.maximum(creep - limit, 0.0)
            effort = np.maximum(self.demand - firm * over, 0.0)
            taken = self.level * load * at.adhesion(creep, v)
            # Implicit by the chord, which is steeper than any tangent: stable beyond the peak too.
            chord = taken / np.where(np.abs(creep) > 1e-6, creep, 1e-6) + firm * (over > 0)
            inertia = WHEELSET * SUBSTEPS / STEP_S
            self.rim = self.rim + self.sign[:, None] * (effort - taken) / (inertia + chord)
            spinning |= over > 0
        self.effort = self.sign[:, None] * effort
        self.force = self.sign[:, None] * taken
        self.slip = self.rim / v - 1
        # An axle that spins again and again is asked for less.
        lower = self.confidence * (1 - 0.4 * STEP_S)
        higher = np.minimum(1.0, self.confidence + 0.004 * STEP_S)
        self.confidence = np.where(spinning & ~self.asked_too_much, lower, higher)

    def _train(self) -> None:
        v = self.velocity
        speeds = v[:, :-1] - v[:, 1:]
        self.stretch = self.stretch + STEP_S * speeds
        self.coupler = self.spring * self.stretch + self.damper * speeds
        net = np.zeros_like(v)
        net[:, 0] += self.force.sum(axis=1)
        net[:, :-1] -= self.coupler
        net[:, 1:] += self.coupler
        ramp = np.clip((self.t - self.drag_from) / 2.0, 0, 1)
        ramp = ramp * np.clip((self.drag_from + self.drag_for - self.t) / 2.0, 0, 1)
        net[:, 5] -= self.drag_force * ramp
        # A second locomotive at the end holds the speed, as slowly as its driver does.
        goal = np.clip(self.mass.sum(axis=1) * 0.03 * (self.v0 - v[:, -1]), -3e5, 3e5)
        self.push += np.clip(goal - self.push, -8e3 * STEP_S, 8e3 * STEP_S)
        net[:, -1] += self.push
        grade, curve = self.track.grade_and_curve(self.place)
        slowed = GRAVITY * (grade + self.mean_grade[:, None] + curve) + self._rolling(v)
        change = net / self.mass - slowed
        self.velocity = np.maximum(v + STEP_S * change, 1.0)
        self.place = self.place + STEP_S * self.velocity
        self.acceleration = change[:, 0]

    def _read(self) -> SensorReadings:
        number = self.step_number % CHUNK
        if number == 0:
            self._noise = np.stack(
                [g.standard_normal((CHUNK, 2 * AXLES + 3)) for g in self._noises], axis=1
            )
        noise = self._noise[number]
        omega = self.rim / (RADIUS * (1 + self.radius_error)) + WHEEL_STD * noise[:, :AXLES]
        effort = self.effort * self.effort_gain + self.effort_bias
        effort = effort + EFFORT_STD * noise[:, AXLES : 2 * AXLES]
        missing = np.full(self.drives, np.nan)
        std = self.driving.gnss_std
        has_gnss = std is not None and self.step_number % 100 == 0
        seen = self.acceleration + 0.03 * noise[:, -2]
        return SensorReadings(
            wheel_speed=np.rint(omega / 0.002) * 0.002,
            effort=np.rint(effort / 10.0) * 10.0,
            load=LOAD + TRANSFER * self.effort.sum(axis=1, keepdims=True),
            gnss=self.v + std * noise[:, -1] if has_gnss else missing,
            acceleration=seen if self.driving.accelerometer else missing,
            radar=self.v * 1.0 + 0.04 * noise[:, -3],
        )
