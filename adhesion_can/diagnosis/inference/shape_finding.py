"""Fits of the curve families, and a base curve that is of another family than Burckhardt's."""

from dataclasses import dataclass

from adhesion_can.diagnosis.inference.model_comparison import ScoredModel
from adhesion_can.physics.curves import CurveFamily


@dataclass(frozen=True, eq=False)
class ScoredFamily:
    """Curves of one family alone, fitted to the rows that decide.

    Attributes:
        family: Family of the curves.
        scored: Fitted curves without effects.
        extended: Fitted curves with the effects that are named on Burckhardt's curve; `scored`
            where there are none.

    """

    family: CurveFamily
    scored: ScoredModel
    extended: ScoredModel

    @property
    def cross_validated_square(self) -> float:
        """Cross-validated whitened square, the smaller one of both fits."""
        both = (self.scored, self.extended)
        return min(scored.cross_validated_square for scored in both)

    @property
    def held_out_rmse(self) -> float:
        """Cross-validated whitened RMSE of the curves alone, in standard deviations of noise."""
        return self.scored.held_out_rmse


@dataclass(frozen=True, eq=False)
class ShapeFinding:
    """A base curve that is of another family than Burckhardt's.

    Attributes:
        family: Family of the base curve.
        burckhardt: Burckhardt's curves without effects, on the same regression.
        same: Burckhardt's curves with the same effects, on the same regression.
        p_value: P-value of the gain over Burckhardt's curves with the same effects, all families
            counted.
        rivals: Ids of effects on Burckhardt's curve that the data cannot separate from the shape.

    """

    family: CurveFamily
    burckhardt: ScoredModel
    same: ScoredModel
    p_value: float
    rivals: tuple[str, ...]
