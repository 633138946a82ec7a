"""Rail surfaces whose curve is of another family than Burckhardt's."""

from dataclasses import dataclass

from adhesion_can.physics.curves.base import CurveFamily
from adhesion_can.physics.curves.polach import Polach


@dataclass(frozen=True, slots=True)
class FamilySurface:
    """A named curve of a family.

    Attributes:
        name: Name of the surface.
        family: Family of its curve.
        values: Values of the family's parameters.
        source: Reference of the numbers.

    """

    name: str
    family: CurveFamily
    values: tuple[float, ...]
    source: str

    @property
    def parameters(self) -> dict[str, float]:
        """Values by the names of the family's parameters."""
        return {p.name: value for p, value in zip(self.family.parameters, self.values, strict=True)}


_POLACH = Polach()
_SOURCE = (
    "Polach, Wear 258 (2005) 992-1000, parameters recommended there, as later papers quote them"
)
POLACH_RAIL: tuple[FamilySurface, ...] = (
    FamilySurface("polach-dry", _POLACH, (1.00, 0.40, 0.55, 0.40, 0.60), _SOURCE),
    FamilySurface("polach-wet", _POLACH, (0.30, 0.10, 0.30, 0.40, 0.20), _SOURCE),
    FamilySurface("polach-low", _POLACH, (0.60, 0.20, 0.06, 0.20, 0.20), _SOURCE),
)
"""Rail surfaces in Polach's form: dry, wet, and of low adhesion; kA, kS, mu0, A, B."""
