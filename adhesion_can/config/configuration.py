"""All that a user can set, as one frozen value."""

from dataclasses import dataclass, field
from functools import cached_property
from math import hypot, sqrt

from adhesion_can.bus.database import CanDatabase
from adhesion_can.bus.roles import BoundMessage, SignalChoice, bind, cycles_of, resolutions_of
from adhesion_can.errors import ConfigError
from adhesion_can.estimation.baselines.paper import ChangeSettings
from adhesion_can.estimation.differential_evolution import EvolutionSettings
from adhesion_can.estimation.estimator import Estimator
from adhesion_can.estimation.extended.correction import require_axles, require_channels
from adhesion_can.estimation.extended.estimator import ExtendedEstimator, ExtendedModel
from adhesion_can.estimation.identifiability import IdentifiabilitySettings
from adhesion_can.estimation.registry import DEFAULT, ESTIMATORS, EstimatorSettings
from adhesion_can.estimation.tracker.axle_deviations import AxleSettings
from adhesion_can.estimation.tracker.curve_sums import Theta
from adhesion_can.estimation.tracker.memories import MemorySettings
from adhesion_can.estimation.tracker.prior import PriorSettings
from adhesion_can.estimation.tracker.run_length import RunLengthSettings
from adhesion_can.estimation.tracker.tracker import TrackerParts, TrackerSettings
from adhesion_can.physics.instruments import PERFECT
from adhesion_can.physics.readings import Role
from adhesion_can.physics.vehicle import Locomotive
from adhesion_can.sampling.column_former import ColumnFormer
from adhesion_can.sampling.equations import COVARIATES, SamplingSettings, Sensors
from adhesion_can.sampling.former import SampleFormer


@dataclass(frozen=True, slots=True)
class ServiceSettings:
    """Behaviour of the service.

    Attributes:
        target_share: share of μ_max that `CreepSpeedSetpoint` aims at: 0.98 costs 2 % of the
            force and saves a third of the slip energy.
        hold_s: how long the last values are held when an input is stale.
        change_s: how long SURFACE_CHANGE is shown at most.
        estimate_s: age of the last sample beyond which the status is LOW_EXCITATION.
        restart_s: a hole in time longer than this starts the service anew.

    """

    target_share: float = 0.98
    hold_s: float = 1.0
    change_s: float = 5.0
    estimate_s: float = 2.0
    restart_s: float = 60.0

    def __post_init__(self) -> None:
        if not 0 < self.target_share <= 1:
            raise ValueError("target_share must be in 0..1")
        if not (min(self.hold_s, self.change_s, self.estimate_s) >= 0 and self.restart_s > 0):
            raise ValueError("times must not be negative")


@dataclass(frozen=True)
class Configuration:
    """All that a user can set.

    Attributes:
        vehicle: the locomotive.
        database: of the bus.
        choices: roles with their signals.
        service: see there.
        sampling: see there.
        sensors: see there.
        identifiability: see there.
        tracker: see there.
        run_length: see there.
        memory: see there.
        prior: see there.
        axles: see there.
        evolution: see there.
        change: see there.
        estimator: name of the estimator.
        met: (c1, c2, c3) of surfaces that an earlier run met.
        model: extended model, whose effects are taken into account; None: the plain curve.
        where: file that it came from, for errors.
        sha256: of the file, hex; '' for the defaults.

    """

    vehicle: Locomotive
    database: CanDatabase
    choices: tuple[SignalChoice, ...]
    service: ServiceSettings = field(default_factory=ServiceSettings)
    sampling: SamplingSettings = field(default_factory=SamplingSettings)
    sensors: Sensors = field(default_factory=Sensors)
    identifiability: IdentifiabilitySettings = field(default_factory=IdentifiabilitySettings)
    tracker: TrackerSettings = field(default_factory=TrackerSettings)
    run_length: RunLengthSettings = field(default_factory=RunLengthSettings)
    memory: MemorySettings = field(default_factory=MemorySettings)
    prior: PriorSettings = field(default_factory=PriorSettings)
    axles: AxleSettings = field(default_factory=AxleSettings)
    evolution: EvolutionSettings = field(default_factory=EvolutionSettings)
    change: ChangeSettings = field(default_factory=ChangeSettings)
    estimator: str = DEFAULT
    met: tuple[Theta, ...] = ()
    model: ExtendedModel | None = None
    where: str = "defaults"
    sha256: str = ""

    @cached_property
    def messages(self) -> tuple[BoundMessage, ...]:
        """The messages heard, bound to their roles."""
        return bind(self.choices, self.database, self.vehicle.wheel_radius, self.where)

    @cached_property
    def sensors_as_sent(self) -> Sensors:
        """`sensors` with the resolution of their signals: a raw step q adds a variance of q²/12."""
        steps = resolutions_of(self.messages)

        def with_step(std: float, role: Role) -> float:
            return hypot(std, steps.get(role, 0.0) / sqrt(12.0))

        return Sensors(
            with_step(self.sensors.wheel_speed_std, Role.WHEEL_SPEED),
            with_step(self.sensors.vehicle_speed_std, Role.VEHICLE_SPEED),
            with_step(self.sensors.effort_std, Role.TRACTIVE_EFFORT),
        )

    def roles(self) -> set[Role]:
        """The roles that have a signal."""
        return {choice.role for choice in self.choices}

    def missing_for_identification(self) -> list[str]:
        """What an adhesion coefficient needs and no role gives, in words; empty: nothing."""
        heard = {(choice.role, choice.axle) for choice in self.choices}
        missing = []
        wheels = {axle for role, axle in heard if role is Role.WHEEL_SPEED}
        efforts = {axle for role, axle in heard if role is Role.TRACTIVE_EFFORT}
        if not wheels:
            missing.append("wheel speed")
        if (Role.VEHICLE_SPEED, 0) not in heard:
            missing.append("vehicle speed")
        if not efforts:
            missing.append("tractive effort")
        elif wheels and not wheels & efforts:
            missing.append("tractive effort and wheel speed of the same axle")
        return missing

    def require_identification(self) -> None:
        """Raise a ConfigError where adhesion cannot be formed, or a cycle is unknown."""
        missing = self.missing_for_identification()
        if missing:
            raise ConfigError(
                self.where,
                f"no role gives {' or '.join(missing)}, so adhesion cannot be estimated",
                "map the roles under [roles]",
            )
        for message in self.messages:
            if message.cycle_us is None:
                raise ConfigError(
                    f"{self.where}: {message.plan.name}",
                    "its cycle is unknown, so it cannot be told when it is stale",
                    "state cycle_ms at its role, or GenMsgCycleTime in the database",
                )
        self._require_model()

    def _require_model(self) -> None:
        """ConfigError where the extended model asks for what the vehicle or no role gives."""
        if self.model is None:
            return
        given = [COVARIATES[role] for role in self.roles() if role in COVARIATES]
        mend = "map its role under [roles], or take the effect out of the model"
        require_channels(self.model, given, f"no role of {self.where}", mend)
        require_axles(self.model, self.vehicle.axles)

    def make_former(self) -> SampleFormer:
        """Fresh, for readings of these messages."""
        model = self.model
        return SampleFormer(
            self.vehicle,
            cycles_of(self.messages),
            self.sampling,
            self.sensors_as_sent,
            PERFECT if model is None else model.instruments,
            with_travel=model is not None,
        )

    def make_column_former(self) -> ColumnFormer:
        """The same for columns of readings."""
        return ColumnFormer(self.make_former().by)

    @property
    def estimators(self) -> EstimatorSettings:
        """What the estimators are set by."""
        parts = TrackerParts(
            self.tracker,
            self.run_length,
            self.memory,
            self.prior,
            self.axles,
            self.identifiability,
            self.met,
        )
        return EstimatorSettings(parts, self.evolution, self.change)

    def make_estimator(self, name: str | None = None) -> Estimator:
        """A fresh estimator by name; the configured one where none is given.

        With an extended model it follows the base curve and says the curve that holds now.

        Raises:
            ConfigError: no estimator has that name.

        """
        wanted = name or self.estimator
        if wanted not in ESTIMATORS:
            where = "--estimator" if name else f"{self.where}: estimator"
            known = ", ".join(ESTIMATORS)
            raise ConfigError(where, f"no estimator {wanted!r}", f"known: {known}")
        estimator = ESTIMATORS[wanted](self.estimators)
        if self.model is None or not self.model.online:
            return estimator
        return ExtendedEstimator(estimator, self.model, self.vehicle.axles, self.identifiability)
