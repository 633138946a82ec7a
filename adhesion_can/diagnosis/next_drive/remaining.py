"""Which explanation is left after the drive that was to decide.

The explanations were there before that drive, so that none is chosen by it and few are compared:
each is fitted to all drives together, its effects common, the curves of the rails their own. One is
refuted where its cross-validated sum of squares exceeds that of the best by more than chance
allows: by the scatter of the blocks, or by that of the noise (Cox, J. R. Statist. Soc. B 24 (1962)
406-424), since a short drive has few blocks. What is left must withstand on all drives what every
cause must withstand (`refutation`): the best of several wrong explanations is still wrong.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from math import nan
from typing import Any, NamedTuple

import numpy as np
import scipy

from adhesion_can.diagnosis.formatting import p_equation
from adhesion_can.diagnosis.inference.model_comparison import (
    LEVEL,
    is_worse,
    score_model,
    worse_p_value,
)
from adhesion_can.diagnosis.next_drive.explanations import PLAIN, Explanation
from adhesion_can.diagnosis.refutation.refute import describe_refutation
from adhesion_can.diagnosis.regression.candidate import Candidate
from adhesion_can.diagnosis.regression.find_surface_changes import fit_start_curves
from adhesion_can.diagnosis.regression.fit_families import fit_family_curves
from adhesion_can.diagnosis.regression.model import Model, evaluate_model
from adhesion_can.diagnosis.regression.prepare_regression import PreparedRegression
from adhesion_can.diagnosis.regression.segment_curves import BURCKHARDT
from adhesion_can.diagnosis.regression.whitened_regression import (
    FittedModel,
    WhitenedRegression,
    fit_model,
)
from adhesion_can.normal_quantiles import NORMAL_95

FARTHEST = float(scipy.stats.norm.isf(LEVEL))
"""Excess of an explanation's misfit from which it is refuted, standard deviations of the noise."""


@dataclass(frozen=True, slots=True)
class RefutedExplanation:
    """An explanation that the drive refuted.

    Attributes:
        name: Name of the explanation.
        reason: Reason, a clause.

    """

    name: str
    reason: str


@dataclass(frozen=True, slots=True)
class RemainingExplanations:
    """What a further drive leaves of the explanations that were there before it.

    Attributes:
        before: Recordings that left the explanations.
        by: Recordings that were to distinguish them.
        left: Names of the explanations that are left, the best first; () where the data contradict
            all of them.
        refuted: Explanations that are not.
        winner: Explanation that alone is left; None where several are, or the plain curve.
        p_value: Probability with which chance would part the best from the nearest refuted
            one as clearly, by the test that refuted that one.
        refuted_effects: P-value of each effect that refuted explanations alone have, by its id and
            axle, by the test that refuted them; NaN where no test of the fits did.

    """

    before: tuple[str, ...]
    by: tuple[str, ...]
    left: tuple[str, ...]
    refuted: tuple[RefutedExplanation, ...]
    winner: Explanation | None = None
    p_value: float = 1.0
    refuted_effects: Mapping[tuple[str, int], float] = field(default_factory=dict)

    @property
    def refutes_plain(self) -> bool:
        """Whether the plain curve is among what was refuted."""
        return any(explanation.name == PLAIN for explanation in self.refuted)

    def without_plain(self) -> "RemainingExplanations":
        """The same where all drives leave more than noise of the plain curve, which is refuted.

        No test beside another explanation refutes it where that one turns out to have no size.
        """
        if self.left != (PLAIN,):
            return self
        plain = RefutedExplanation(PLAIN, "the residual is more than noise")
        return replace(self, left=(), refuted=(*self.refuted, plain))

    @property
    def sentence(self) -> str:
        """What is left, for a reader."""
        names = ", ".join((*self.left, *(explanation.name for explanation in self.refuted)))
        before, by = ", ".join(self.before), ", ".join(self.by)
        why = "; ".join(
            f"{explanation.name} is refuted: {explanation.reason}" for explanation in self.refuted
        )
        if not self.left:
            return (
                f"No explanation that remained after {before} ({names}) survives {by}: {why}. "
                "The cause is something else, or has another form."
            )
        begin = (
            f"Of the explanations that remained after {before} ({names}), {by} leaves "
            f"{' and '.join(self.left)}"
        )
        return f"{begin}: {why}." if why else f"{begin}: it refutes none."

    def to_dict(self) -> dict[str, Any]:
        """Fields of `diagnosis.json`."""
        return {
            "before": list(self.before),
            "by": list(self.by),
            "left": list(self.left),
            "refuted": [asdict(explanation) for explanation in self.refuted],
            "sentence": self.sentence,
        }


def find_remaining(
    explanations: Sequence[Explanation],
    prepared: PreparedRegression,
    before: Sequence[str],
    by: Sequence[str],
) -> RemainingExplanations:
    """Compare explanations on the drives that left them and on a further one.

    Args:
        explanations: Explanations, one at least.
        prepared: Regression on all of these drives.
        before: Recordings that left the explanations.
        by: Recordings that were to distinguish them.

    """
    regression = prepared.regression.last_fit
    fits = [fit_to_drives(regression, prepared, explanation.model) for explanation in explanations]
    order = sorted(range(len(fits)), key=lambda k: fits[k].cross_validated_square)
    refuted: dict[int, str] = {}
    standing = [k for k in order if not _is_sizeless(fits[k])]
    for k in order:
        if k not in standing and len(fits) > 1:
            refuted[k] = "its size is 0 within its error"
    best = next(iter(standing), order[0])
    p_values: dict[int, float] = {}
    for k in standing:
        if k == best:
            continue
        test = _compare(regression, fits[best], fits[k], explanations[best].name)
        if test is not None:
            p_values[k] = test.p_value
            refuted[k] = test.reason
    for k in order:
        if k not in refuted:
            reason = describe_refutation(regression, fits[k].model)
            if reason:
                refuted[k] = reason
    left = [explanations[k] for k in order if k not in refuted]
    possible = {key for explanation in left for key in effect_keys(explanation.model.candidates)}
    contradicted = {
        key: p_values.get(k, nan)
        for k in refuted
        for key in effect_keys(explanations[k].model.candidates)
        if key not in possible
    }
    return RemainingExplanations(
        tuple(before),
        tuple(by),
        tuple(explanation.name for explanation in left),
        tuple(RefutedExplanation(explanations[k].name, why) for k, why in refuted.items()),
        left[0] if len(left) == 1 and left[0].name != PLAIN else None,
        max(p_values.values(), default=1.0),
        contradicted,
    )


def effect_keys(candidates: Iterable[Candidate]) -> set[tuple[str, int]]:
    """Id and axle of effects: another form of an effect is no other explanation."""
    return {(candidate.effect.id, candidate.axle) for candidate in candidates}


def fit_to_drives(
    regression: WhitenedRegression, prepared: PreparedRegression, model: Model
) -> FittedModel:
    """A model's effects fitted to all drives, with curves of its family for every rail."""
    curves, family = prepared.plain.model.curves, model.curves.family
    if curves.family is not family:
        curves = (
            fit_start_curves(regression.data)
            if family is BURCKHARDT
            else fit_family_curves(regression.data, family)
        )
    return fit_model(regression, Model(curves, model.candidates, model.values))


def _is_sizeless(fitted: FittedModel) -> bool:
    """Whether the 95 % interval of an effect's size holds 0."""
    places = range(len(fitted.model.candidates))
    return any(fitted.size_in_deviations(place) <= NORMAL_95 for place in places)


class _Refutation(NamedTuple):
    """The test by which an explanation is worse than the best one.

    Attributes:
        reason: By how much it is worse, a clause.
        p_value: P-value of that.

    """

    reason: str
    p_value: float


def _compare(
    regression: WhitenedRegression, best: FittedModel, other: FittedModel, best_name: str
) -> _Refutation | None:
    """The test that refutes an explanation beside the best one; None where it may be as good."""
    away = _distance(regression, best, other)
    by_noise = float(scipy.stats.norm.sf(away))
    if by_noise < LEVEL:
        return _Refutation(
            f"its misfit is {away:.1f} standard deviations of the noise larger than that of "
            f"{best_name} (limit: {FARTHEST:.1f})",
            by_noise,
        )
    if not is_worse(score_model(regression, best), score_model(regression, other)):
        return None
    more = 100.0 * (other.cross_validated_square / best.cross_validated_square - 1.0)
    by_blocks = worse_p_value(best, other)
    return _Refutation(
        f"its sum of squares is {more:.1f} % above that of {best_name}, more than the scatter of "
        f"the blocks explains ({p_equation(by_blocks)}; limit: {LEVEL:g})",
        by_blocks,
    )


def _distance(regression: WhitenedRegression, best: FittedModel, other: FittedModel) -> float:
    """Excess of a model's sum of squares over the best one's, in standard deviations of the noise.

    Were the two alike, the difference would have a variance of four times that of the noise times
    the square of what their predictions differ by.
    """
    data = regression.data
    columns = [
        evaluate_model(data, fit.model.curves, fit.model.active_effects).residual
        for fit in (best, other)
    ]
    white = regression.whiten(np.column_stack([columns[1] - columns[0]]))
    apart = float(regression.compute_grams(white).total[-1, -1])
    rows = max(float(best.grams.rows.sum()), 1.0)
    noise = best.cross_validated_square / rows
    excess = other.cross_validated_square - best.cross_validated_square
    return excess / max(2.0 * float(np.sqrt(noise * apart)), 1e-300)
