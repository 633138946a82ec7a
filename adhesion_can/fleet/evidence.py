"""Evidence of one unit, as the fleet-level diagnosis takes it."""

from dataclasses import dataclass

from adhesion_can.diagnosis.effect_grams import EffectGrams


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
class UnitEvidence:
    """Evidence of one unit.

    Attributes:
        unit: Id of the unit.
        vehicle: Id of the vehicle.
        kind: Kind of the vehicle and of its data: units are compared with others of their kind.
        line: Name of the line; '' where it is not known.
        day: Date, ISO 8601; '' where it is not known.
        grams: Gram matrices of the effects; None where the data allow no diagnosis.
        radii: Wheel radii from coasting; () without enough of it.
        causes: Effect ids that the unit's own diagnosis names.
        faults: Sentences of what makes the recording unusable; () for none.
        error: Error for which the unit failed; '' where it was worked through.

    """

    unit: str
    vehicle: str
    kind: str = ""
    line: str = ""
    day: str = ""
    grams: EffectGrams | None = None
    radii: tuple[AxleDeviation, ...] = ()
    causes: tuple[str, ...] = ()
    faults: tuple[str, ...] = ()
    error: str = ""
