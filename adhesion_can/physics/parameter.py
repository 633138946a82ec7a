"""One number of an effect or of a curve family, with unit, range and meaning."""

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Parameter:
    """One number of an effect or of a curve family.

    Attributes:
        name: Name as in the literature.
        unit: SI unit; '1' for a ratio.
        typical: Value where none is given.
        lower: Smallest value that makes sense.
        upper: Largest value that makes sense.
        meaning: Meaning in one line.
        axle: Whether the value is the number of an axle; the diagnosis tries each axle.
        given: Whether `typical` is the value in a diagnosis, which does not estimate it.

    """

    name: str
    unit: str
    typical: float
    lower: float
    upper: float
    meaning: str
    axle: bool = False
    given: bool = False

    @property
    def free(self) -> bool:
        """Whether a diagnosis estimates the value."""
        return not (self.axle or self.given)
