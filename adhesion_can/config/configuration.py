"""Everything that a user can set, as one frozen value."""

from dataclasses import dataclass, field, replace
from functools import cached_property, partial
from math import hypot, sqrt
from typing import TYPE_CHECKING, Annotated

from adhesion_can.bus.database import CanDatabase
from adhesion_can.bus.roles import (
    BoundMessage,
    SignalChoice,
    bind,
    cycles_by_role,
    resolutions_by_role,
)
from adhesion_can.errors import ConfigError
from adhesion_can.estimation.doubt.settings import EXACT
from adhesion_can.estimation.estimator import Estimator
from adhesion_can.estimation.registry import (
    DEFAULT,
    EstimatorSettings,
    MakeEstimator,
    estimator_by_name,
    known_estimators,
    make_default,
)
from adhesion_can.physics.channels import COVARIATES, UserChannel
from adhesion_can.physics.driving_plan import PlanLimits
from adhesion_can.physics.instruments import PERFECT
from adhesion_can.physics.readings import ROLE_UNITS, Role, role_name
from adhesion_can.physics.vehicle import Locomotive
from adhesion_can.ranges import Within, require_ranges
from adhesion_can.recordings.tables.choice import ColumnChoice
from adhesion_can.sampling.column_former import ColumnFormer
from adhesion_can.sampling.equations import (
    SamplingSettings,
    Sensors,
)
from adhesion_can.sampling.former import SampleFormer
from adhesion_can.sampling.rim_speed import RimSpeed

UNKNOWN_CYCLE = (
    "its cycle is unknown, so a stale input cannot be detected",
    "write cycle_ms at its role, or GenMsgCycleTime in the database",
)
"""What is wrong with a message without a cycle, and what to do about it."""
_SHARED = (Role.TRACTIVE_EFFORT, Role.AXLE_LOAD)
"""Roles of which several axles may have one signal."""
_SHARED_FIX = (
    "write a factor for each axle: 1 if the signal is the value of one axle, 0.25 if it is the "
    "sum of four; or map each role to its own signal"
)

# What concerns extended models is imported where there is one: it takes a tenth of a short command.
if TYPE_CHECKING:
    from adhesion_can.estimation.extended.model import ExtendedModel


@dataclass(frozen=True, slots=True, kw_only=True)
class ServiceSettings:
    """Settings of the service's setpoints and states.

    Attributes:
        target_share: Share of μ_max at which `CreepSpeedSetpoint` aims: 0.98 costs 2 % of the force
            and saves a third of the slip energy. Larger: more force, more slip.
        hold_s: Time for which the last values are held when an input is stale, s. Longer bridges
            more frame losses, and keeps an old setpoint on the bus for longer.
        change_s: Longest time for which the status SURFACE_CHANGE is shown after a change, s.
        estimate_s: Age of the latest sample beyond which the status is LOW_EXCITATION, s.
        restart_s: Gap between two stamps beyond which the service starts again, s.
        state_interval_s: Interval at which `run --state` writes what was learned, s.
        state_age_s: Age of a kept surface beyond which it is not used, s.

    """

    target_share: Annotated[float, Within(0.1, 1)] = 0.98
    hold_s: Annotated[float, Within(0, 3600)] = 1.0
    change_s: Annotated[float, Within(0, 3600)] = 5.0
    estimate_s: Annotated[float, Within(0, 3600)] = 2.0
    restart_s: Annotated[float, Within(0.1, 3600)] = 60.0
    state_interval_s: Annotated[float, Within(1, 86400)] = 10.0
    state_age_s: Annotated[float, Within(0, 1e9)] = 86_400.0

    def __post_init__(self) -> None:
        require_ranges(self)


@dataclass(frozen=True, kw_only=True)
class Configuration:
    """Everything that a user can set.

    Each field of settings is a section of the configuration file, or holds several. `load` derives
    the sections and their keys from these classes.

    Attributes:
        vehicle: Data of the locomotive.
        database: Messages and signals of the bus.
        choices: Signals with their roles; none of them before `load_configuration` has completed
            the defaults.
        channels: Further signals that may be a cause, section `[channels]`.
        columns: Columns of sample tables that stand for known ones, section `[table]`.
        assume_plausible: Whether data that look wrong are used all the same, with a warning.
        service: Settings of setpoints and states, section `[service]`.
        sampling: Limits of the formation of samples, section `[sampling]`.
        sensors: Standard deviations of the sensors' noise, section `[sensors]`.
        estimators: Settings of all estimators, each part of them a section.
        limits: Limits of the drive that `diagnose --next-drive` plans, section `[limits]`.
        estimator: Name of the estimator, a key of `known_estimators()`.
        model: Extended model whose effects are taken into account; None: the plain curve.
        where: Name of the configuration file, for errors.
        sha256: SHA-256 of that file, hex; '' for the defaults.
        vehicle_keys: Keys of [vehicle] that the file has; the others have default values.

    """

    vehicle: Locomotive
    database: CanDatabase
    choices: tuple[SignalChoice, ...]
    channels: tuple[UserChannel, ...] = ()
    columns: tuple[ColumnChoice, ...] = ()
    assume_plausible: bool = False
    service: ServiceSettings = field(default_factory=ServiceSettings)
    sampling: SamplingSettings = field(default_factory=SamplingSettings)
    sensors: Sensors = field(default_factory=Sensors)
    estimators: EstimatorSettings = field(default_factory=EstimatorSettings)
    limits: PlanLimits = field(default_factory=PlanLimits)
    estimator: str = DEFAULT
    model: "ExtendedModel | None" = None
    where: str = "defaults"
    sha256: str = ""
    vehicle_keys: frozenset[str] = frozenset()

    @cached_property
    def messages(self) -> tuple[BoundMessage, ...]:
        """Input messages, their signals bound to roles."""
        return bind(self.choices, self.database, self.vehicle.wheel_radius, self.where)

    @cached_property
    def sensors_as_sent(self) -> Sensors:
        """`sensors` with the quantisation of their signals: a raw step q adds a variance q²/12."""
        steps = resolutions_by_role(self.messages)

        def with_step(std: float, role: Role) -> float:
            return hypot(std, steps.get(role, 0.0) / sqrt(12.0))

        return Sensors(
            wheel_speed_std=with_step(self.sensors.wheel_speed_std, Role.WHEEL_SPEED),
            vehicle_speed_std=with_step(self.sensors.vehicle_speed_std, Role.VEHICLE_SPEED),
            effort_std=with_step(self.sensors.effort_std, Role.TRACTIVE_EFFORT),
        )

    def roles(self) -> set[Role]:
        """Roles that have a signal."""
        return {choice.role for choice in self.choices}

    def covariates(self) -> list[str]:
        """Names of the covariates that have a signal, those of `[channels]` last."""
        roles = self.roles()
        known = [name for role, name in COVARIATES.items() if role in roles]
        return [*known, *(channel.name for channel in self.channels)]

    def signal_unit(self, role: Role, axle: int) -> str:
        """Unit of the readings of a role, for `Role.CHANNEL` of a channel's number; '' for none."""
        if role is Role.CHANNEL:
            return self.channels[axle - 1].unit
        return ROLE_UNITS.get(role, "")

    @property
    def observes_speed(self) -> bool:
        """Whether the service observes the vehicle speed by the driven axles."""
        return self.estimators.observed_speed.enabled

    def missing_for_service(self) -> list[str]:
        """Inputs that the service needs and no role gives, by name."""
        missing = self.missing_for_identification()
        if not self.observes_speed:
            return missing
        given = {(choice.role, choice.axle) for choice in self.choices}
        axles = range(1, self.vehicle.axles + 1)
        needed = [(r, a) for r in (Role.WHEEL_SPEED, Role.TRACTIVE_EFFORT) for a in axles]
        return [role_name(*role_and_axle) for role_and_axle in needed if role_and_axle not in given]

    def missing_for_identification(self) -> list[str]:
        """Inputs that an adhesion coefficient needs and no role gives, by name."""
        given = {(choice.role, choice.axle) for choice in self.choices}
        missing = []
        wheels = {axle for role, axle in given if role is Role.WHEEL_SPEED}
        efforts = {axle for role, axle in given if role is Role.TRACTIVE_EFFORT}
        if not wheels:
            missing.append("wheel speed")
        if (Role.VEHICLE_SPEED, 0) not in given:
            missing.append("vehicle speed")
        if not efforts:
            missing.append("tractive effort")
        elif wheels and not wheels & efforts:
            missing.append("tractive effort and wheel speed of the same axle")
        return missing

    def shared_signals(self) -> list[tuple[str, str]]:
        """What is wrong with each signal that has two roles, and the fix.

        A force of several axles, or their load, may be shared by them where factors are stated.
        """
        conflicts: list[tuple[str, str]] = []
        first: dict[tuple[str, str, str | None], SignalChoice] = {}
        for choice in (mapped for mapped in self.choices if mapped.role is not Role.CHANNEL):
            place = choice.message, choice.signal, choice.channel
            other = first.setdefault(place, choice)
            if other is choice:
                continue
            may_share = other.role is choice.role and choice.role in _SHARED
            if may_share and choice.factor is not None:
                continue
            signal = f"{choice.message}.{choice.signal}"
            what = f"{other.name} and {choice.name} are the same signal, {signal}"
            conflicts.append(
                (what, _SHARED_FIX if may_share else "map each role to its own signal")
            )
        return conflicts

    def unknown_cycles(self) -> list[str]:
        """Names of the messages whose cycle neither the roles nor the database state."""
        return [message.plan.name for message in self.messages if message.cycle_us is None]

    def require_distinct_signals(self) -> None:
        """ConfigError where a signal has two roles that it cannot have."""
        for what, fix in self.shared_signals():
            raise ConfigError(f"{self.where}: roles", what, fix)

    def require_identification(self) -> None:
        """ConfigError where no adhesion can be computed, or a cycle time is unknown."""
        self._require(self.missing_for_identification())

    def require_service(self) -> None:
        """ConfigError where the service lacks an input, or a cycle time is unknown."""
        self._require(self.missing_for_service())

    def _require(self, missing: list[str]) -> None:
        self.require_distinct_signals()
        if missing:
            raise ConfigError(
                self.where,
                f"no role gives {' or '.join(missing)}, so adhesion cannot be estimated",
                "map the roles under [roles]",
            )
        for name in self.unknown_cycles():
            raise ConfigError(f"{self.where}: {name}", *UNKNOWN_CYCLE)
        self._require_model()

    def _require_model(self) -> None:
        """ConfigError where the extended model needs a channel or an axle that there is not."""
        if self.model is None:
            return
        from adhesion_can.estimation.extended.correction import (  # noqa: PLC0415
            require_axles,
            require_channels,
        )

        given = self.covariates()
        fix = "map its role under [roles], or remove the effect from the model"
        require_channels(self.model, given, f"no role for {self.where}", fix)
        require_axles(self.model, self.vehicle.axles)

    def make_former(self) -> SampleFormer:
        """New sample former for readings of these messages."""
        model, cycles = self.model, cycles_by_role(self.messages)
        if self.observes_speed:
            # The reference of the slips is the rim of a wheel.
            cycles = {**cycles, Role.VEHICLE_SPEED: cycles.get(Role.WHEEL_SPEED, 0)}
        return SampleFormer(
            self.vehicle,
            cycles,
            self.sampling,
            self.sensors_as_sent,
            PERFECT if model is None else model.instruments,
            with_travel=model is not None,
            channels=tuple(channel.name for channel in self.channels),
            with_aids=self.observes_speed,
        )

    def make_rim_speed(self) -> RimSpeed | None:
        """New reference of the samples' slips; None: the measured vehicle speed is theirs."""
        return RimSpeed(self.vehicle) if self.observes_speed else None

    def make_column_former(self) -> ColumnFormer:
        """New sample former for columns of readings."""
        return ColumnFormer(self.make_former().equations)

    def find_estimator(self, name: str | None = None) -> MakeEstimator:
        """Factory of an estimator by name; without a name of the configured one.

        Raises:
            ConfigError: No estimator has that name.

        """
        wanted = name or self.estimator
        try:
            return estimator_by_name(wanted)
        except KeyError as error:
            where = "--estimator" if name else f"{self.where}: estimator"
            known = ", ".join(known_estimators())
            raise ConfigError(where, f"no estimator {wanted!r}", f"known: {known}") from error

    def make_estimator(self, name: str | None = None) -> Estimator:
        """New estimator by name; without a name the configured one.

        With an extended model the estimator fits the base curve and gives the curve in the latest
        conditions.

        Raises:
            ConfigError: No estimator has that name.

        """
        if not self.observes_speed:
            return self._make_curve_estimator(name)
        from adhesion_can.estimation.observed_speed.estimator import (  # noqa: PLC0415
            ObservedSpeedEstimator,
        )

        return ObservedSpeedEstimator(
            partial(self._make_curve_estimator, name),
            self.vehicle,
            self.estimators.observed_speed.settings,
            cycles_by_role(self.messages)[Role.WHEEL_SPEED],
            largest_std=self.estimators.identifiability.lambda_m_std,
            tests_curve=self.find_estimator(name) is make_default and self.estimators.doubt.enabled,
        )

    def _make_curve_estimator(self, name: str | None) -> Estimator:
        """New estimator, without the stage that observes the vehicle speed."""
        make, settings = self.find_estimator(name), self.estimators
        axle_load = sum(self.vehicle.axle_load) / self.vehicle.axles
        settings = replace(settings, instruments=settings.instruments.on_load(axle_load))
        if self.model is not None:
            # The model corrects what the instruments are wrong by.
            settings = replace(settings, instruments=EXACT)
            if self.model.curve is not None:
                # The shape was measured, too; what the data contradict is doubted all the same.
                measured = replace(settings.doubt, shape_std=0.0, first_lambda_m_std=0.0)
                settings = replace(settings, doubt=measured)
        if self.observes_speed:
            # What is observed wanders by as much as it may be off while the slips are known.
            lasting = self.estimators.observed_speed.settings.slip_std
            error = max(settings.instruments.speed_error_std, lasting)
            wander = max(settings.instruments.speed_wander_std, lasting)
            instruments = replace(
                settings.instruments, speed_error_std=error, speed_wander_std=wander
            )
            settings = replace(settings, instruments=instruments)
        estimator = (
            make_default(settings, self.vehicle.axles) if make is make_default else make(settings)
        )
        limits = self.estimators.identifiability
        if self.model is not None and self.model.online:
            from adhesion_can.estimation.extended.estimator import (  # noqa: PLC0415
                ExtendedEstimator,
            )

            estimator = ExtendedEstimator(estimator, self.model, self.vehicle.axles, limits)
        plausibility = self.estimators.plausibility
        if not plausibility.enabled:
            return estimator
        from adhesion_can.estimation.plausibility.estimator import (  # noqa: PLC0415
            WatchedEstimator,
        )

        return WatchedEstimator(estimator, self.vehicle, plausibility, limits.slip_max)
