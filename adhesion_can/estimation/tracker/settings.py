"""Settings of the tracker and of its parts, apart from them: a configuration needs these alone."""

from dataclasses import dataclass, field
from typing import Annotated

from adhesion_can.physics.burckhardt import PUBLISHED, RAIL, CurveParameters, Surface
from adhesion_can.ranges import Length, Within, require_ranges
from adhesion_can.values import Value

C1_MAX = 2.0
"""Largest level c1 of a curve, beyond any adhesion of a wheel."""
C2_RANGE = (2.0, 500.0)
"""Range of the steepness c2 of a curve."""


@dataclass(frozen=True, slots=True, kw_only=True)
class RunLengthSettings(Value):
    """Run-length detection of surface changes.

    Attributes:
        false_alarm: Prior probability of a change per update; it bounds the rate of false
            alarms. Larger: changes are detected earlier, with more false alarms.
        hypotheses: Number of hypotheses of a change that are kept. Larger: finer dating of changes,
            more CPU.
        dense: Number of the latest hypotheses that are all kept, fewer than `hypotheses`.
        noise_freedom: Largest weight of the noise estimate in a comparison, samples. Larger: the
            noise is trusted more, so that its increase may look like a change.
        settling_samples: Number of samples after a change within which its time may be revised.

    """

    false_alarm: Annotated[float, Within(1e-100, 0.5)] = 1e-9
    hypotheses: Annotated[int, Within(2, 1000)] = 9
    dense: Annotated[int, Within(1, 999)] = 3
    noise_freedom: Annotated[float, Within(1e-3, 1e9)] = 100.0
    settling_samples: Annotated[int, Within(0, 100000)] = 240

    def __post_init__(self) -> None:
        require_ranges(self)
        if not self.dense < self.hypotheses:
            raise ValueError("dense must be below hypotheses")


@dataclass(frozen=True, slots=True, kw_only=True)
class MemorySettings(Value):
    """Exponential forgetting on a surface that changes slowly.

    Attributes:
        times_s: Time constants of the forgetting, s, longest first: the first is for a constant
            surface, the others follow a drift. Longer: less noise, slower.
        drift: Prior probability of a drifting surface. Larger: drifts are followed
            earlier, with more noise on a constant surface.
        switch_s: Mean time after which a drifting memory returns to the prior probabilities, s.

    """

    times_s: Annotated[tuple[float, ...], Within(0.01, 1e12), Length(1, 16)] = (3600.0, 15.0, 3.0)
    drift: Annotated[float, Within(0, 0.999)] = 0.01
    switch_s: Annotated[float, Within(0.01, 1e7)] = 10.0

    def __post_init__(self) -> None:
        require_ranges(self)
        if list(self.times_s) != sorted(self.times_s, reverse=True):
            raise ValueError("times_s must fall: longest first")


@dataclass(frozen=True, slots=True, kw_only=True)
class PriorSettings(Value):
    """Prior of a new surface, in (ln c1, ln c2, ln s) with the shape s = ln(c1 c2/c3).

    Attributes:
        wide_weight: Probability that the surface is like none of the library. Larger: less use
            of known surfaces, slower convergence on them.
        wide_theta: Centre (c1, c2, s) of the wide component, 1.
        wide_std: Scales of the wide component in (ln c1, ln c2, ln s), 1. Larger: less informative.
        narrow_std: Scales of the component around each known surface in (ln c1, ln c2, ln s), 1.
        library: Whether the published surfaces and our rail surfaces are known surfaces.
        learned: Largest number of identified surfaces that are kept as known surfaces.

    """

    wide_weight: Annotated[float, Within(1e-6, 1)] = 0.5
    wide_theta: Annotated[
        tuple[float, float, float],
        Within(0.01, 0.995 * C1_MAX),
        Within(*C2_RANGE),
        Within(0.1, 100),
    ] = (0.35, 45.0, 4.1)
    wide_std: Annotated[tuple[float, float, float], Within(0.001, 10)] = (0.6, 0.7, 0.25)
    narrow_std: Annotated[tuple[float, float, float], Within(0.001, 10)] = (0.15, 0.25, 0.08)
    library: bool = True
    learned: Annotated[int, Within(0, 100)] = 6

    def __post_init__(self) -> None:
        require_ranges(self)

    def surfaces(self) -> tuple[Surface, ...]:
        """Surfaces of the library: our own rail surfaces and the published ones with a peak."""
        return tuple(s for s in (*RAIL, *PUBLISHED) if s.c3 > 0) if self.library else ()


@dataclass(frozen=True, slots=True, kw_only=True)
class AxleSettings(Value):
    """Prior of the deviations of single axles, and their forgetting.

    Attributes:
        level_std: Standard deviation of an axle's adhesion level, relative to the common curve, 1.
            Larger: axles may differ more, and little data moves them farther.
        slip_std: Standard deviation of an axle's slip error, as a slip ratio, 1. Larger: likewise
            for the slip at the peak.
        memory_s: Time constant of the exponential forgetting, s. Larger: less noise, and slower
            changes of an axle.

    """

    level_std: Annotated[float, Within(1e-6, 1)] = 0.05
    slip_std: Annotated[float, Within(1e-6, 1)] = 0.004
    memory_s: Annotated[float, Within(0.01, 1e7)] = 60.0

    def __post_init__(self) -> None:
        require_ranges(self)


@dataclass(frozen=True, slots=True, kw_only=True)
class TrackerSettings(Value):
    """Settings of the tracker, with those of its parts.

    Attributes:
        curves: Number of weighted curves that represent the posterior of each fading memory; even.
            More curves: smoother intervals, proportionally more CPU.
        noise_std: Standard deviation of the adhesion noise before the first samples, where these
            carry no variance of their own, 1. It is then estimated; a larger value only makes the
            first updates less certain.
        errors_in_variables: Whether the variances of the slips are used (generalised least squares
            with corrected scores); False takes the slips as exact, which biases the peak where
            their errors are large.
        run_length: Settings of the detection of surface changes, section `[run_length]`.
        memory: Settings of the fading memories, section `[memory]`.
        prior: Settings of the prior of a new surface, section `[prior]`.
        axles: Settings of the deviations of single axles, section `[axles]`.
        known_surfaces: (c1, c2, c3) of surfaces that an earlier run identified; they enter the
            prior from the start. Not a key of the configuration file.

    """

    curves: Annotated[int, Within(64, 16384)] = 384
    noise_std: Annotated[float, Within(1e-6, 1)] = 0.003
    errors_in_variables: bool = True
    run_length: RunLengthSettings = field(default_factory=RunLengthSettings)
    memory: MemorySettings = field(default_factory=MemorySettings)
    prior: PriorSettings = field(default_factory=PriorSettings)
    axles: AxleSettings = field(default_factory=AxleSettings)
    known_surfaces: tuple[CurveParameters, ...] = field(default=(), metadata={"toml": False})

    def __post_init__(self) -> None:
        require_ranges(self)
        if self.curves % 2:
            raise ValueError(f"curves must be even, and is {self.curves}")
