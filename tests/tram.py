"""A synthetic tram: readings of four axles whose slip is swept to beyond the peak, with noise."""

from dataclasses import dataclass

import numpy as np

from adhesion_can.physics.readings import Role
from adhesion_can.physics.samples import Samples
from adhesion_can.physics.vehicle import Locomotive
from adhesion_can.sampling.column_former import ColumnFormer
from adhesion_can.sampling.equations import SampleEquations, SamplingSettings, Sensors
from adhesion_can.sampling.traces import Trace

RADIUS, LOAD, INERTIA, AXLES = 0.33, 90e3, 60.0, 4
VEHICLE = Locomotive((RADIUS,) * AXLES, (LOAD,) * AXLES, INERTIA, 4e4, None, load_std=0.0)
DRY, LOW = (0.30, 45.0, 0.25), (0.20, 30.0, 0.18)


@dataclass(frozen=True)
class Tram:
    """Drive and sensors of the tram; noise in rad/s, m/s and N."""

    cycle_ms: int = 50
    seconds: float = 60.0
    wheel_std: float = 0.02
    speed_std: float = 0.02
    effort_std: float = 900.0
    surfaces: tuple = (DRY,)
    top: float = 0.2
    period_s: float = 9.0
    speed: float = 9.0

    def readings(self, seed):
        """Stamps, µs, and values by role and axle, as a receiver gives them."""
        rng = np.random.default_rng(seed)
        n = round(self.seconds * 1000 / self.cycle_ms)
        t_us = np.arange(n) * self.cycle_ms * 1000

        def speed(t):
            return self.speed * (1.0 + 0.2 * np.sin(2 * np.pi * t / 37.0))

        late = {Role.WHEEL_SPEED: 0, Role.VEHICLE_SPEED: 250, Role.TRACTIVE_EFFORT: 500}
        stamps = {role: t_us + shift for role, shift in late.items()}
        v = speed(stamps[Role.VEHICLE_SPEED] * 1e-6)
        found = {
            (Role.VEHICLE_SPEED, 0): (
                stamps[Role.VEHICLE_SPEED],
                v + self.speed_std * rng.standard_normal(n),
            )
        }
        for axle in range(1, AXLES + 1):
            phase = axle / AXLES

            def slip(t, phase=phase):
                # All axles pull, then all brake; within that each is swept to the top and back.
                pull = np.sin(np.pi * t / (3 * self.period_s))
                sweep = 0.5 * (1 - np.cos(2 * np.pi * (t / self.period_s + phase)))
                return self.top * np.clip(3 * pull, -1, 1) * sweep

            def omega(t, slip=slip):
                return (1 + slip(t)) * speed(t) / RADIUS

            t = stamps[Role.TRACTIVE_EFFORT] * 1e-6
            acceleration = (omega(t + 1e-4) - omega(t - 1e-4)) / 2e-4
            share = np.minimum(t / self.seconds * len(self.surfaces), len(self.surfaces) - 1)
            c1, c2, c3 = np.array(self.surfaces)[share.astype(int)].T
            size = np.abs(slip(t))
            mu = np.sign(slip(t)) * (c1 * -np.expm1(-c2 * size) - c3 * size)
            effort = LOAD * mu + INERTIA * acceleration / RADIUS
            found[Role.TRACTIVE_EFFORT, axle] = (
                stamps[Role.TRACTIVE_EFFORT],
                effort + self.effort_std * rng.standard_normal(n),
            )
            wheel = omega(stamps[Role.WHEEL_SPEED] * 1e-6)
            found[Role.WHEEL_SPEED, axle] = (
                stamps[Role.WHEEL_SPEED],
                wheel + self.wheel_std * rng.standard_normal(n),
            )
        return found

    def traces(self, seed):
        """Readings as traces."""
        return {key: Trace(*columns) for key, columns in self.readings(seed).items()}

    def samples(self, seed, sensors=None, vehicle=VEHICLE) -> Samples:
        """Samples with the variances of these sensors; None: the tram's own.

        The vehicle is the configured one, which may be wrong.
        """
        own = Sensors(self.wheel_std, self.speed_std, self.effort_std)
        cycles = dict.fromkeys(
            (Role.WHEEL_SPEED, Role.VEHICLE_SPEED, Role.TRACTIVE_EFFORT), self.cycle_ms * 1000
        )
        equations = SampleEquations(vehicle, cycles, SamplingSettings(), sensors or own)
        former = ColumnFormer(equations)
        former.add(self.readings(seed))
        last_us = round(self.seconds * 1e6) + 1
        parts = list(former.collect(np.arange(20_000, last_us + 20_000, 20_000)))
        return Samples.concatenate(parts)
