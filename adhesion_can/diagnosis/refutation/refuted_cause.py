"""A cause that helped and was refuted, with the reason in a sentence."""

from dataclasses import dataclass

from adhesion_can.diagnosis.refutation.invariance import SizesByEnvironment
from adhesion_can.diagnosis.regression.candidate import Candidate
from adhesion_can.diagnosis.regression.model import Model
from adhesion_can.diagnosis.regression.whitened_regression import FittedModel


@dataclass(frozen=True, eq=False)
class RefutedCause:
    """A cause that describes the data better than none, and is none for a reason.

    Attributes:
        effect: Effect id.
        form: Form of the mechanism, or the family of a curve; '' where there is only one form.
        place: Place of the effect among those of the model; None for the shape of the curve.
        fitted: Fitted model with the cause.
        without: Model without it, fitted to the same rows.
        reason: Reason in one clause, with figures.
        sizes: Size of the cause by environment, the largest spread first; () where not asked for.

    """

    effect: str
    form: str
    place: int | None
    fitted: FittedModel
    without: Model
    reason: str
    sizes: tuple[SizesByEnvironment, ...] = ()

    @classmethod
    def of(
        cls,
        candidate: Candidate,
        place: int | None,
        fitted: FittedModel,
        without: Model,
        reason: str,
        sizes: tuple[SizesByEnvironment, ...] = (),
    ) -> "RefutedCause":
        """An effect as a refuted cause; the other arguments are its fields."""
        effect = candidate.effect
        return cls(effect.id, effect.form, place, fitted, without, reason, sizes)
