"""Findings of the fleet-level diagnosis as plain values, from which report and JSON are made."""

from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from enum import StrEnum
from typing import Any

from adhesion_can.diagnosis.effect_grams import EffectKey
from adhesion_can.fleet.compare_vehicles import LEAST_VEHICLES
from adhesion_can.fleet.pooled_size import PooledSize


class Scope(StrEnum):
    """What a finding belongs to."""

    VEHICLE = "vehicle"
    LINE = "line"
    DAY = "day"
    FLEET = "fleet"


@dataclass(frozen=True, slots=True)
class FleetFinding(EffectKey):
    """One finding, of an effect.

    Attributes:
        scope: What it belongs to.
        where: Id of the vehicle, name of the line or date; of the fleet the kind of its vehicles
            where there are several, else ''.
        value: Size to first order, by which findings are found; of a vehicle or line its difference
            from the middle of the fleet.
        std: Standard error of `value`, without the error of the first order.
        fleet_value: Size in the middle of the fleet.
        p_value: P-value, all effects counted.
        gain_percent: Fall of the RMSE of the adhesion by the effect, %, on units that had no part
            in its size; None: there is no other unit, or the size comes from coasting.
        held_out: Whether `gain_percent` is of units that had no part in the size; else it is that
            of the same rows, less what chance gains.
        units: Number of units with an estimate.
        showing: Number of them in which the size has the same sign and exceeds two standard errors.
        source: 'regression' or 'coasting'.
        rivals: Effects that these data cannot distinguish from this one, by id.
        named_by: Number of units whose own diagnosis names the effect.
        pooled: Size by the units' own estimates, none of which is linearised; None where no unit
            has such an estimate.

    """

    scope: Scope
    where: str
    value: float
    std: float
    fleet_value: float
    p_value: float
    gain_percent: float | None
    held_out: bool
    units: int
    showing: int
    source: str = "regression"
    rivals: tuple[str, ...] = ()
    named_by: int = 0
    pooled: PooledSize | None = None

    @classmethod
    def of(cls, key: EffectKey, scope: Scope, where: str, **rest: Any) -> "FleetFinding":
        """Finding of an effect; `rest` has the other fields."""
        return cls(**asdict(key), scope=scope, where=where, **rest)

    def to_dict(self) -> dict[str, Any]:
        """The finding as JSON has it."""
        return (
            {"scope": str(self.scope), "where": self.where}
            | asdict(self)
            | {
                "scope": str(self.scope),
                "rivals": list(self.rivals),
                "pooled": None if self.pooled is None else self.pooled.to_dict(),
            }
        )


@dataclass(frozen=True, slots=True)
class VehicleSummary:
    """One vehicle of the fleet.

    Attributes:
        vehicle: Id of the vehicle.
        score: Cost of what is wrong, by which vehicles are sorted: the fall of the RMSE that its
            findings would bring, %, plus `FAILED_COST` for each share of failed units.
        findings: Findings of the vehicle, the largest gain first.
        units: Number of units.
        failed: Number of units that failed or cannot be used.
        reasons: Reasons of the failures, each once.
        causes: Number of units whose own diagnosis names an effect, by its id, the most first.
        causes_alone: Effects of `causes` that no finding of the vehicle, or of its kind, names or
            cannot distinguish from what it names.
        cause_sizes: Sizes of the effects of `causes`, that of the most units first; a wheel radius
            that was applied is not one of them.

    """

    vehicle: str
    score: float
    findings: tuple[FleetFinding, ...]
    units: int
    failed: int
    reasons: tuple[str, ...] = ()
    causes: Mapping[str, int] = field(default_factory=dict)
    causes_alone: tuple[str, ...] = ()
    cause_sizes: tuple[PooledSize, ...] = ()

    def to_dict(self) -> dict[str, Any]:
        """The vehicle as JSON has it."""
        return {
            "vehicle": self.vehicle,
            "score": self.score,
            "findings": [finding.to_dict() for finding in self.findings],
            "units": self.units,
            "failed": self.failed,
            "reasons": list(self.reasons),
            "causes": dict(self.causes),
            "cause_sizes": [size.to_dict() for size in self.cause_sizes],
        }


@dataclass(frozen=True, slots=True)
class KindSummary:
    """Vehicles that are compared with each other.

    Attributes:
        name: Name of the kind; '' where there is no other.
        vehicles: Number of vehicles.
        units: Number of units.

    """

    name: str
    vehicles: int
    units: int

    @property
    def compared(self) -> bool:
        """Whether there are vehicles enough to compare them with each other."""
        return self.vehicles >= LEAST_VEHICLES

    def to_dict(self) -> dict[str, Any]:
        """The kind as JSON has it."""
        return asdict(self) | {"compared": self.compared}


@dataclass(frozen=True, slots=True)
class FleetDiagnosis:
    """Result of the fleet-level diagnosis.

    Attributes:
        vehicles: All vehicles, the worst first.
        shared: Findings of the fleet, of lines and of days.
        kinds: Kinds of vehicles, that with the most vehicles first.
        units: Number of units.
        diagnosed: Number of units with Gram matrices.
        false_discovery_rate: Expected share of wrong vehicles among those with a finding.
        alpha: Probability of any wrong finding of the fleet, a line or a day.
        notes: What the data do not allow to show, a sentence each.
        spreads: Spread between units of each effect, in its unit, by its name.

    """

    vehicles: tuple[VehicleSummary, ...]
    shared: tuple[FleetFinding, ...]
    kinds: tuple[KindSummary, ...]
    units: int
    diagnosed: int
    false_discovery_rate: float
    alpha: float
    notes: tuple[str, ...] = ()
    spreads: Mapping[str, float] = field(default_factory=dict)

    @property
    def compared(self) -> bool:
        """Whether there are vehicles enough of any kind to compare them with each other."""
        return any(kind.compared for kind in self.kinds)

    @property
    def named(self) -> tuple[VehicleSummary, ...]:
        """Vehicles with a finding, the worst first."""
        return tuple(vehicle for vehicle in self.vehicles if vehicle.findings)

    @property
    def named_alone(self) -> tuple[tuple[VehicleSummary, str], ...]:
        """Vehicles and effects that their recordings name and no comparison does."""
        return tuple(
            (vehicle, effect) for vehicle in self.vehicles for effect in vehicle.causes_alone
        )

    @property
    def findings(self) -> tuple[FleetFinding, ...]:
        """All findings: those of the fleet, lines and days, then of the vehicles."""
        return (*self.shared, *(f for vehicle in self.vehicles for f in vehicle.findings))

    def to_dict(self) -> dict[str, Any]:
        """The result as JSON has it."""
        return {
            "units": self.units,
            "diagnosed": self.diagnosed,
            "kinds": [kind.to_dict() for kind in self.kinds],
            "false_discovery_rate": self.false_discovery_rate,
            "alpha": self.alpha,
            "shared": [finding.to_dict() for finding in self.shared],
            "vehicles": [vehicle.to_dict() for vehicle in self.vehicles],
            "notes": list(self.notes),
            "spreads": dict(self.spreads),
        }
