"""Selected model and its competitors: rivals and p-values of its effects."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

from adhesion_can.diagnosis.inference.detect_effects import SignFlipTest
from adhesion_can.diagnosis.inference.model_comparison import ScoredModel, gain_p_value
from adhesion_can.diagnosis.regression.candidate import Candidate


@dataclass(frozen=True, eq=False)
class ModelSelection:
    """Selected model and its competitors.

    Attributes:
        plain: Model without effects.
        best: Selected model; `plain` where no effect is worth naming.
        indistinguishable: Models of the same size that the data cannot call worse than `best`.
        singles: Models with one effect that were fitted, best first.
        test: Sign-flip test of every candidate against the plain model.
        smaller: Models with one effect less than `best`, where that has more than two.
        implausible: Models with one effect that fitted better than any of `singles`, of a size that
            no vehicle has.
        formulas: Formulas that describe the data as well as an effect of `best`, as text, by its
            id.
        known_rivals: Rivals of effects of `best` that were found before it was extended, by id.
        planned_p_value: P-value of `best` against the explanations that were there before the drive
            that decided, where it is one of them: nothing was searched then. None: it was searched.

    """

    plain: ScoredModel
    best: ScoredModel
    indistinguishable: tuple[ScoredModel, ...]
    singles: tuple[ScoredModel, ...]
    test: SignFlipTest
    smaller: tuple[ScoredModel, ...] = ()
    implausible: tuple[ScoredModel, ...] = ()
    formulas: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    known_rivals: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    planned_p_value: float | None = None

    def rivals(self, candidate: Candidate) -> tuple[str, ...]:
        """Effect ids that can replace one of the best model's effects."""
        others = self.best.ids - {candidate.effect.id}
        replacing = {
            effect
            for other in self.indistinguishable
            if others <= other.ids
            for effect in other.ids - others
            if effect != candidate.effect.id
        }
        known = set(self.known_rivals.get(candidate.effect.id, ())) - self.best.ids
        return tuple(sorted(replacing | known))

    def all_rivals(self) -> dict[str, tuple[str, ...]]:
        """Rivals of every effect of the best model, by id."""
        return {candidate.effect.id: self.rivals(candidate) for candidate in self.best.candidates}

    def p_value(self, candidate: Candidate, tested: Sequence[Candidate]) -> float:
        """P-value of a selected effect, all effects counted.

        Of several tests the smallest p-value counts, times the number of tests (Bonferroni): sign
        flips against the plain model and against the model without the effect, and the gain over
        that model, block by block.

        Args:
            candidate: Effect of the best model.
            tested: Effects that were tested.

        """
        if self.planned_p_value is not None:
            return self.planned_p_value
        # A formula was proposed for what the tested effects left.
        by_signs = (
            [float(self.test.p_value[list(tested).index(candidate)])] if candidate in tested else []
        )
        smaller = [
            model
            for model in (self.plain, *self.singles, *self.smaller)
            if model.candidates_missing_from(self.best) == (candidate,)
        ]
        values = [
            *by_signs,
            *(
                gain_p_value(model.fitted, self.best.fitted) * self.test.independent
                for model in smaller
            ),
        ]
        others = frozenset(self.best.candidates) - {candidate}
        if others in self.best.sign_flips:
            values.append(self.best.sign_flips[others])
        return min(1.0, len(values) * min(values))
