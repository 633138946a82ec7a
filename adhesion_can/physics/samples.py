"""Samples of the adhesion curve, one by one and in columns, in SI units.

Time is integer microseconds throughout. `Samples` has the fields of `Sample` as columns.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from adhesion_can.arrays import Array
from adhesion_can.values import Value


@dataclass(frozen=True, slots=True)
class Sample:
    """One point of the adhesion curve, measured at one axle.

    Attributes:
        t_us: Stamp of the wheel speed, µs.
        axle: Number of the axle, from 1.
        slip: Slip ratio λ with its sign.
        adhesion: Adhesion coefficient μ with its sign.
        creep_speed: Creep speed r·ω − v, m/s.
        speed: Vehicle speed, m/s.
        load: Wheelset load, N.
        load_std: Standard deviation of a load that was not measured, N; 0 for a measured one.
        slip_var: Variance of `slip` from the resolution and noise of the wheel speed.
        adhesion_var: Variance of `adhesion` from the sensors.
        slip_common_var: Variance of `slip` from the vehicle speed; that error is common to all
            samples of one `speed_us`.
        speed_us: Stamp of the vehicle speed that closes the bracket around the sample, µs.
        transient_var: Variance of `adhesion` where effort or wheel speed moved faster than their
            readings follow; 0 elsewhere.
        speed_share: Place of the stamp between the two vehicle speeds around it: 0 at the earlier,
            1 at the later one. The error of an interpolated speed runs between theirs.
        covariates: Values of other channels at the time, by name.

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
    speed_share: float = 1.0
    covariates: Mapping[str, float] = field(default_factory=dict)


@dataclass(frozen=True, slots=True)
class Samples(Value):
    """Samples in columns: the fields of `Sample`, arrays of shape (n,), in the same units."""

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
    speed_share: Array
    covariates: Mapping[str, Array] = field(default_factory=dict)

    def __len__(self) -> int:
        return len(self.slip)

    @property
    def slip_total_var(self) -> Array:
        """Variance of `slip` from wheel and vehicle speed, shape (n,)."""
        return np.asarray(self.slip_var + self.slip_common_var)

    @property
    def load_common_std(self) -> float:
        """Relative standard deviation that unmeasured loads put on every adhesion value alike.

        An axle's load error is the same in all its samples, so it does not average out with them:
        it adds to the standard deviation of the curve's level as a whole.
        """
        return float(np.sqrt(np.mean((self.load_std / self.load) ** 2))) if len(self) else 0.0

    @classmethod
    def from_rows(cls, samples: Iterable[Sample]) -> "Samples":
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

    def to_rows(self) -> list[Sample]:
        """The samples one by one."""
        names = (*_STAMPS, *_FLOATS)
        columns = [getattr(self, name).tolist() for name in names]
        further = {name: column.tolist() for name, column in self.covariates.items()}
        return [
            Sample(
                **dict(zip(names, values, strict=True)),
                covariates={name: column[k] for name, column in further.items()},
            )
            for k, values in enumerate(zip(*columns, strict=True))
        ]

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
            speed_share=ones,
        )

    @classmethod
    def concatenate(cls, parts: Sequence["Samples"]) -> "Samples":
        """Samples of all parts in their order.

        Args:
            parts: Samples to join, at least one part; covariates that a part lacks are left out.

        """
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

    def equals(self, other: "Samples") -> bool:
        """Whether all columns have the same values, and both have the same covariates."""
        if len(self) != len(other) or self.covariates.keys() != other.covariates.keys():
            return False
        pairs = [(getattr(self, name), getattr(other, name)) for name in (*_STAMPS, *_FLOATS)]
        pairs += [(column, other.covariates[name]) for name, column in self.covariates.items()]
        return all(column.tobytes() == another.tobytes() for column, another in pairs)

    def select(self, rows: NDArray[np.bool_] | NDArray[np.int64] | slice) -> "Samples":
        """The samples that a mask, index array or slice names."""
        if not isinstance(rows, slice) and rows.dtype == np.bool_:
            # Places, found once for all columns.
            rows = rows.nonzero()[0]
        return Samples(
            self.t_us[rows],
            self.axle[rows],
            self.slip[rows],
            self.adhesion[rows],
            self.creep_speed[rows],
            self.speed[rows],
            self.load[rows],
            self.load_std[rows],
            self.slip_var[rows],
            self.adhesion_var[rows],
            self.slip_common_var[rows],
            self.speed_us[rows],
            self.transient_var[rows],
            self.speed_share[rows],
            {name: column[rows] for name, column in self.covariates.items()},
        )

    def with_variances(
        self, slip_var: Array, slip_common_var: Array, adhesion_var: Array
    ) -> "Samples":
        """The samples with other variances of the noise, each of shape (n,)."""
        return Samples(
            self.t_us,
            self.axle,
            self.slip,
            self.adhesion,
            self.creep_speed,
            self.speed,
            self.load,
            self.load_std,
            slip_var,
            adhesion_var,
            slip_common_var,
            self.speed_us,
            self.transient_var,
            self.speed_share,
            self.covariates,
        )

    def folded(self) -> tuple[Array, Array]:
        """(|λ|, μ·sign λ): traction and braking on one curve, each of shape (n,)."""
        return np.abs(self.slip), np.copysign(1.0, self.slip) * self.adhesion


_STAMPS = ("t_us", "axle", "speed_us")
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
    "speed_share",
)

NO_SAMPLES = Samples.from_rows([])
"""No samples."""
