"""Variables of a slave: what a master sets and what it gets, with units and descriptions."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from enum import StrEnum
from math import isfinite, isnan, nan

from adhesion_can.physics.doubt import DESCRIPTIONS as DOUBTS
from adhesion_can.physics.doubt import Doubt
from adhesion_can.physics.objection import WORDINGS, Objection
from adhesion_can.physics.readings import Direction, SpeedSource
from adhesion_can.physics.status import DESCRIPTIONS as STATUSES
from adhesion_can.physics.status import Status


class Causality(StrEnum):
    """Who gives a variable its value, in the words of FMI."""

    PARAMETER = "parameter"
    INPUT = "input"
    OUTPUT = "output"


class VariableType(StrEnum):
    """Type of a variable, in the words of FMI."""

    REAL = "Real"
    INTEGER = "Integer"
    BOOLEAN = "Boolean"
    ENUMERATION = "Enumeration"


@dataclass(frozen=True, slots=True)
class EnumerationType:
    """An enumeration.

    Attributes:
        name: Name of the type.
        items: Name, number and description of each item.

    """

    name: str
    items: tuple[tuple[str, int, str], ...]

    @property
    def legend(self) -> str:
        """Numbers with their names, as a clause."""
        return ", ".join(f"{number} {name}" for name, number, _ in self.items)


STATUS = EnumerationType("Status", tuple((s.name, s.value, STATUSES[s]) for s in Status))
DOUBT = EnumerationType(
    "Doubt",
    tuple(
        (d.name, d.value, DOUBTS.get(d, "no doubt" if d is Doubt.NONE else "not tested"))
        for d in Doubt
    ),
)
OBJECTION = EnumerationType(
    "Objection",
    tuple(
        (o.name, o.value, WORDINGS[o].what if o in WORDINGS else "no objection") for o in Objection
    ),
)
SPEED_SOURCE = EnumerationType(
    "SpeedSource",
    (
        ("UNKNOWN", SpeedSource.UNKNOWN, "not stated; taken as independent of the driven axles"),
        ("RADAR", SpeedSource.RADAR, "radar"),
        ("GNSS", SpeedSource.GNSS, "satellites"),
        ("TRAILING_AXLE", SpeedSource.TRAILING_AXLE, "an axle without drive"),
        ("DRIVEN_AXLES", SpeedSource.DRIVEN_AXLES, "the driven axles: never TRACKING"),
    ),
)
DIRECTION = EnumerationType(
    "Direction",
    (
        ("UNKNOWN", Direction.UNKNOWN, "not known"),
        ("FORWARD", Direction.FORWARD, "forward, axle 1 leads"),
        ("REVERSE", Direction.REVERSE, "reverse, the last axle leads"),
        ("NOT_AVAILABLE", Direction.NOT_AVAILABLE, "not available"),
    ),
)


@dataclass(frozen=True, slots=True)
class Variable:
    """A variable; its value reference is its place among the slave's variables, from 0.

    Attributes:
        name: Name.
        causality: Who gives it its value.
        description: Meaning, one line.
        unit: SI unit; '' for none.
        start: Value before anything is set; NaN for not available.
        type: Type of its values.
        enumeration: Its items; None for other types.

    """

    name: str
    causality: Causality
    description: str
    unit: str = ""
    start: float = nan
    type: VariableType = VariableType.REAL
    enumeration: EnumerationType | None = None

    @property
    def is_set(self) -> bool:
        """Whether the master gives it its value."""
        return self.causality is not Causality.OUTPUT


def enumerated(
    name: str, causality: Causality, kind: EnumerationType, description: str, start: int
) -> Variable:
    """A variable whose values are the items of an enumeration."""
    return Variable(name, causality, description, "", float(start), VariableType.ENUMERATION, kind)


def in_order(variables: Iterable[Variable]) -> tuple[Variable, ...]:
    """Variables as a slave numbers them: parameters, inputs, outputs."""
    order = list(Causality)
    return tuple(sorted(variables, key=lambda variable: order.index(variable.causality)))


def with_integers(variables: Iterable[Variable]) -> tuple[Variable, ...]:
    """The same with an Integer in place of each enumeration, its numbers in the description.

    For masters that pass over variables of enumerations.
    """
    return tuple(
        variable
        if variable.enumeration is None
        else replace(
            variable,
            type=VariableType.INTEGER,
            enumeration=None,
            description=f"{variable.description}: {variable.enumeration.legend}",
        )
        for variable in variables
    )


def available(value: float | None) -> float:
    """A number as a variable carries it: NaN for not available."""
    return nan if value is None else value


def known(value: float) -> float | None:
    """A variable's value; None where it is not available."""
    return None if isnan(value) else value


def finite(value: float) -> float | None:
    """A variable's value; None where it is not available, or infinite: no bus carries that."""
    return value if isfinite(value) else None


Values = Mapping[str, float]
"""Value of each variable by its name; NaN: not available."""
