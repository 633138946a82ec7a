"""Evidence of one unit, as the fleet-level diagnosis takes it."""

from dataclasses import dataclass, field
from typing import NamedTuple

from adhesion_can.diagnosis.effect_grams import EffectGrams, EffectKey


@dataclass(frozen=True, slots=True)
class AxleDeviation:
    """Wheel radius of an axle from coasting, beside the configured one.

    Attributes:
        axle: Number of the axle, from 1.
        value: Estimated over configured radius, less 1.
        std: Standard error of it.

    """

    axle: int
    value: float
    std: float


@dataclass(frozen=True, slots=True)
class CauseSize(EffectKey):
    """Size of a cause that the diagnosis of one unit names.

    Attributes:
        value: Size.
        std: Its standard deviation; None at the end of its range.

    """

    value: float
    std: float | None


class VehicleForm(NamedTuple):
    """What must be the same of two vehicles before their effects can be compared.

    Attributes:
        data: Form of the data, 'recordings' or 'TABLEs'; '' where it is not known.
        axles: Number of axles; None where it is not known.
        vehicle_data: Hash of the configured vehicle and the model, wheel radii aside.

    """

    data: str = ""
    axles: int | None = None
    vehicle_data: str = ""


@dataclass(frozen=True, slots=True)
class UnitEvidence:
    """Evidence of one unit.

    Attributes:
        unit: Id of the unit.
        vehicle: Id of the vehicle.
        form: Form of the vehicle and of its data.
        line: Name of the line; '' where it is not known.
        day: Date, ISO 8601; '' where it is not known.
        grams: Gram matrices of the effects; None where the data allow no diagnosis.
        radii: Wheel radii from coasting; () without enough of it.
        radii_applied: Whether the effects were looked for with these radii.
        causes: Effect ids that the unit's own diagnosis names.
        cause_sizes: Sizes of the causes; a wheel radius that was applied is in `radii` instead.
        path: Path or URL of the recording.
        faults: Sentences of what makes the recording unusable; () for none.
        error: Error for which the unit failed; '' where it was worked through.

    """

    unit: str
    vehicle: str
    form: VehicleForm = field(default_factory=VehicleForm)
    line: str = ""
    day: str = ""
    grams: EffectGrams | None = None
    radii: tuple[AxleDeviation, ...] = ()
    radii_applied: bool = False
    causes: tuple[str, ...] = ()
    cause_sizes: tuple[CauseSize, ...] = ()
    path: str = ""
    faults: tuple[str, ...] = ()
    error: str = ""

    @property
    def has_effects(self) -> bool:
        """Whether there is evidence on any effect."""
        return self.grams is not None and bool(self.grams.keys)
