"""The currency between the rooms: Reading -> Sample -> Estimate, frozen, in SI units.

Time is integer microseconds throughout. `Samples` is the columnar twin of `Sample`.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from enum import StrEnum
from math import inf
from typing import Any

import numpy as np
from numpy.typing import NDArray

from adhesion_can.physics.burckhardt import Array


class Role(StrEnum):
    """What a signal means to the service; the SI unit of its readings stands beside it."""

    WHEEL_SPEED = "wheel_speed"  # rad/s, an axle each
    VEHICLE_SPEED = "vehicle_speed"  # m/s
    TRACTIVE_EFFORT = "tractive_effort"  # N, an axle each
    AXLE_LOAD = "axle_load"  # N, an axle each
    SPEED_SOURCE = "vehicle_speed_source"
    DIRECTION = "direction"
    AMBIENT_TEMPERATURE = "ambient_temperature"  # degC
    RAIL_TEMPERATURE = "rail_temperature"  # degC
    HUMIDITY = "relative_humidity"  # %
    SANDING = "sanding_active"
    RAIN = "rain"
    GRADIENT = "gradient"  # m/m
    CURVATURE = "curvature"  # 1/m

    @property
    def per_axle(self) -> bool:
        """Whether each axle has a signal of its own."""
        return self in PER_AXLE


PER_AXLE = frozenset({Role.WHEEL_SPEED, Role.TRACTIVE_EFFORT, Role.AXLE_LOAD})


def role_name(role: Role, axle: int) -> str:
    """Role as configurations and reports spell it: `wheel_speed.1`, `vehicle_speed`."""
    return f"{role}.{axle}" if axle else str(role)


class SpeedSource:
    """Values of `Role.SPEED_SOURCE`."""

    UNKNOWN, RADAR, GNSS, TRAILING_AXLE, DRIVEN_AXLES = range(5)


class Direction:
    """Values of `Role.DIRECTION`."""

    UNKNOWN, FORWARD, REVERSE, NOT_AVAILABLE = range(4)


@dataclass(frozen=True, slots=True)
class Reading:
    """One signal of one accepted frame.

    Attributes:
        t_us: time stamp, µs.
        role: what it is.
        axle: 1.. for roles per axle, else 0.
        value: in SI units; None where the sender says 'not available'.

    """

    t_us: int
    role: Role
    axle: int
    value: float | None


@dataclass(frozen=True, slots=True)
class Sample:
    """One point of the adhesion curve, measured at one axle.

    Attributes:
        t_us: of the wheel speed that it stands at, µs.
        axle: 1...
        slip: slip ratio λ with its sign.
        adhesion: adhesion coefficient μ with its sign.
        creep_speed: r ω − v, m/s.
        speed: vehicle speed, m/s.
        load: wheelset load, N.
        load_std: standard deviation of a load that was not measured, N; 0 where it was.
        slip_var: variance of `slip` from the resolution and noise of the wheel speed.
        adhesion_var: variance of `adhesion` from the sensors.
        slip_common_var: variance of `slip` from the vehicle speed; that error is common to all
            samples of one `speed_us`.
        speed_us: stamp of the vehicle speed that closes the bracket around the sample, µs.
        transient_var: variance of `adhesion` where effort or wheel speed moved faster than their
            readings follow; 0 where they did not.
        covariates: other channels at the time, by name.

    """

    t_us: int
    axle: int
    slip: float
    adhesion: float
    creep_speed: float
    speed: float
    load: float
    load_std: float = 0.0
    slip_var: float = 0.0
    adhesion_var: float = 0.0
    slip_common_var: float = 0.0
    speed_us: int = 0
    transient_var: float = 0.0
    covariates: Mapping[str, float] = field(default_factory=dict)


@dataclass(frozen=True, slots=True)
class Samples:
    """Columnar twin of `Sample`: arrays of one length n, same names and units."""

    t_us: NDArray[np.int64]
    axle: NDArray[np.int64]
    slip: Array
    adhesion: Array
    creep_speed: Array
    speed: Array
    load: Array
    load_std: Array
    slip_var: Array
    adhesion_var: Array
    slip_common_var: Array
    speed_us: NDArray[np.int64]
    transient_var: Array
    covariates: Mapping[str, Array] = field(default_factory=dict)

    def __len__(self) -> int:
        return len(self.slip)

    @property
    def slip_total_var(self) -> Array:
        """Variance of `slip` from wheel and vehicle speed, shape (n,)."""
        return np.asarray(self.slip_var + self.slip_common_var)

    @classmethod
    def of(cls, samples: Iterable[Sample]) -> "Samples":
        """Columns of a sequence of samples; the covariates are those that all samples carry."""
        rows = list(samples)
        names = set(rows[0].covariates) if rows else set()
        for row in rows:
            names &= row.covariates.keys()

        def floats(name: str) -> Array:
            return np.array([getattr(row, name) for row in rows], dtype=np.float64)

        return cls(
            t_us=np.array([row.t_us for row in rows], dtype=np.int64),
            axle=np.array([row.axle for row in rows], dtype=np.int64),
            speed_us=np.array([row.speed_us for row in rows], dtype=np.int64),
            **{name: floats(name) for name in _FLOATS},
            covariates={
                name: np.array([row.covariates[name] for row in rows], dtype=np.float64)
                for name in sorted(names)
            },
        )

    @classmethod
    def curve(
        cls, slip: Array, adhesion: Array, t_us: NDArray[np.int64] | None = None
    ) -> "Samples":
        """Points of a curve without a vehicle: load 1 N, speed 1 m/s, no stated noise."""
        slip = np.asarray(slip, dtype=np.float64)
        ones = np.ones_like(slip)
        stamps = np.arange(len(slip)) if t_us is None else t_us
        return cls(
            t_us=stamps,
            axle=np.zeros(len(slip), dtype=np.int64),
            slip=slip,
            adhesion=np.asarray(adhesion, dtype=np.float64),
            creep_speed=slip,
            speed=ones,
            load=ones,
            load_std=0 * ones,
            slip_var=0 * ones,
            adhesion_var=0 * ones,
            slip_common_var=0 * ones,
            speed_us=stamps,
            transient_var=0 * ones,
        )

    @classmethod
    def concatenate(cls, parts: Sequence["Samples"]) -> "Samples":
        """One after another, at least one; keeps the covariates that all of them carry."""
        full = [part for part in parts if len(part)] or list(parts[:1])
        names = set(full[0].covariates).intersection(*(part.covariates for part in full))

        def joined(name: str) -> Any:
            return np.concatenate([getattr(part, name) for part in full])

        return cls(
            t_us=joined("t_us"),
            axle=joined("axle"),
            speed_us=joined("speed_us"),
            **{name: joined(name) for name in _FLOATS},
            covariates={n: np.concatenate([p.covariates[n] for p in full]) for n in sorted(names)},
        )

    def select(self, rows: NDArray[np.bool_] | NDArray[np.int64] | slice) -> "Samples":
        """The samples that a mask, index array or slice names."""
        return Samples(
            t_us=self.t_us[rows],
            axle=self.axle[rows],
            speed_us=self.speed_us[rows],
            **{name: getattr(self, name)[rows] for name in _FLOATS},
            covariates={name: column[rows] for name, column in self.covariates.items()},
        )

    def folded(self) -> tuple[Array, Array]:
        """(|λ|, μ·sign λ): traction and braking on one curve, each of shape (n,)."""
        return np.abs(self.slip), np.copysign(1.0, self.slip) * self.adhesion


_FLOATS = (
    "slip",
    "adhesion",
    "creep_speed",
    "speed",
    "load",
    "load_std",
    "slip_var",
    "adhesion_var",
    "slip_common_var",
    "transient_var",
)


@dataclass(frozen=True, slots=True)
class Identifiable:
    """Whether the data seen so far can tell the peak's height and its place."""

    mu_max: bool
    lambda_m: bool

    @property
    def both(self) -> bool:
        """Both of them."""
        return self.mu_max and self.lambda_m


CHANGED = 0.5
"""Probability of a change of the rail from which it is declared."""


@dataclass(frozen=True, slots=True)
class Estimate:
    """What an estimator believes of the rail, with how far it can be believed.

    Attributes:
        c1: Burckhardt's parameters, eq. 5.
        c2: likewise.
        c3: likewise.
        covariance: of (c1, c2, c3), shape (3, 3), inf on the diagonal where the data say nothing.
        mu_max: peak adhesion, eq. 6.
        mu_max_std: its standard deviation; inf where unknown.
        lambda_m: optimal slip ratio, eq. 6.
        lambda_m_std: its standard deviation; inf where unknown.
        noise_std: of adhesion around the curve.
        samples: number that the estimate rests on.
        identifiable: whether the peak can be told from them.
        surface_since_us: when the present surface was first seen, µs.
        change_probability: that the surface changed within the last update, 0..1.
        per_axle: (μ_max, λ_m) of single axles where an estimator tells them apart.
        mu_max_interval: 90 % interval of μ_max; unbounded where an estimator states none.
        lambda_m_interval: likewise of λ_m.

    """

    c1: float
    c2: float
    c3: float
    covariance: Array
    mu_max: float
    mu_max_std: float
    lambda_m: float
    lambda_m_std: float
    noise_std: float
    samples: int
    identifiable: Identifiable
    surface_since_us: int
    change_probability: float = 0.0
    per_axle: Mapping[int, tuple[float, float]] = field(default_factory=dict)
    mu_max_interval: tuple[float, float] = (-inf, inf)
    lambda_m_interval: tuple[float, float] = (-inf, inf)

    @property
    def theta(self) -> tuple[float, float, float]:
        """(c1, c2, c3)."""
        return (self.c1, self.c2, self.c3)
