"""Explanations that are left of a diagnosis, each fitted to all drives."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from adhesion_can.arrays import Array
from adhesion_can.diagnosis.inference.findings import Findings
from adhesion_can.diagnosis.inference.model_comparison import ScoredModel, fit_and_score, is_worse
from adhesion_can.diagnosis.inference.propose_effects import propose_effects
from adhesion_can.diagnosis.inference.shape_finding import ShapeFinding
from adhesion_can.diagnosis.regression.candidate import Candidate
from adhesion_can.diagnosis.regression.gram_matrices import solve_normal_equations
from adhesion_can.diagnosis.regression.model import Model, remove_effect
from adhesion_can.diagnosis.regression.segment_curves import BURCKHARDT
from adhesion_can.diagnosis.regression.whitened_regression import (
    FittedModel,
    WhitenedRegression,
    fit_model,
)
from adhesion_can.physics.effects.shape_factor import CURVE_SHAPE

AS_GOOD = 0.9
"""Share of what a named effect explains, from which its rival can be planned with: less shows that
the rival means a law of its kind that the library does not have."""
MOST_EXPLANATIONS = 4
"""Largest number of explanations that a plan is to distinguish."""
PLAIN = "the plain curve"
"""Name of the explanation without effects."""


@dataclass(frozen=True, eq=False)
class Explanation:
    """An explanation of what was driven.

    Attributes:
        name: Ids of its effects with forms and axles; `PLAIN` for none.
        model: Effects with their estimates, and the curve of the rail with most rows.
        information: Information that the data hold about the effects' free parameters, the curve's
            eliminated, reciprocal squares of their units; shape (k, k).

    """

    name: str
    model: Model
    information: Array


def build_explanations(
    findings: Findings,
    *,
    is_confirmed: bool,
    rivals: Mapping[Candidate, Sequence[str]],
    others: Iterable[Model] = (),
) -> tuple[Explanation, ...]:
    """Explanations that the data cannot part, the best first.

    They are the selected model and its rivals, whatever made them rivals. Where nothing was
    confirmed on the held-out data, the models with one effect that are not worse than the best of
    them, and the plain curve.

    Args:
        findings: Findings of steps 2 to 6.
        is_confirmed: Whether the selected effects hold on the held-out data.
        rivals: Ids of the effects that the data cannot distinguish from each named one.
        others: Further models that are to be distinguished, such as refuted ones that help.

    """
    regression = findings.regression.last_fit
    selection = findings.selection
    if selection.best.candidates or findings.shape is not None:
        known = [selection.best, *selection.indistinguishable]
    else:
        plain_square = selection.plain.cross_validated_square
        known = [
            single for single in selection.singles if single.cross_validated_square < plain_square
        ]
    models = [known_model.model for known_model in known if not _is_at_bound(known_model.model)]
    if findings.shape is not None:
        models += _rivals_of_shape(regression, findings.shape, findings.prepared.candidates)
    scored = _without_duplicates(fit_and_score(regression, model) for model in (*models, *others))
    if scored:
        best = min(scored, key=lambda scored_model: scored_model.cross_validated_square)
        scored = [
            scored_model
            for scored_model in scored
            if scored_model is best or not is_worse(best, scored_model)
        ]
    # A rival has been called indistinguishable: no test of the blocks takes that back.
    named = (fit_and_score(regression, model) for model in _models_of_rivals(findings, rivals))
    scored = _without_duplicates([*scored, *named])[:MOST_EXPLANATIONS]
    if not is_confirmed and scored:
        plain = fit_and_score(regression, findings.baseline.model)
        scored = [*scored[: MOST_EXPLANATIONS - 1], plain]
    used = regression.data.surface[regression.used]
    surface = int(np.argmax(np.bincount(used))) if len(used) else 0  # that with most rows
    return tuple(_explain(scored_model.fitted, surface) for scored_model in scored)


def _is_at_bound(model: Model) -> bool:
    """Whether a size is at the end of its range, where no cause is named."""
    return any(
        parameter.is_at_bound(value)
        for candidate, values in model.estimates
        for parameter, value in zip(candidate.free_parameters, values, strict=True)
    )


def _rivals_of_shape(
    regression: WhitenedRegression, shape: ShapeFinding, candidates: Sequence[Candidate]
) -> list[Model]:
    """Models on Burckhardt's curve that the data cannot separate from another shape."""
    start = shape.burckhardt.model
    models: list[Model] = []
    for rival in shape.rivals:
        rival_candidates = [candidate for candidate in candidates if candidate.effect.id == rival]
        if rival_candidates:
            models += [
                proposal.model
                for proposal in propose_effects(regression, start, rival_candidates)[:1]
            ]
    return models


def _models_of_rivals(
    findings: Findings, rivals: Mapping[Candidate, Sequence[str]]
) -> Iterator[Model]:
    """The selected model with a named effect replaced by each of its rivals, where that fits."""
    regression, best = findings.regression.last_fit, findings.selection.best.model
    fitted = fit_model(regression, best)
    for candidate, ids in rivals.items():
        if candidate not in best.candidates:
            continue
        without = fit_model(regression, remove_effect(best, best.candidates.index(candidate))[0])
        square = without.cross_validated_square
        least = AS_GOOD * (square - fitted.cross_validated_square)
        for rival in ids:
            forms = [
                candidate
                for candidate in findings.prepared.candidates
                if candidate.effect.id == rival
            ]
            for proposal in propose_effects(regression, without.model, forms)[:1]:
                model = fit_model(regression, proposal.model)
                if square - model.cross_validated_square >= least and not _is_at_bound(model.model):
                    yield model.model


def _without_duplicates(models: Iterable[ScoredModel]) -> list[ScoredModel]:
    """The best model of each set of effects, best first: forms are no explanations of their own."""
    best: dict[tuple[str, tuple[tuple[str, int], ...]], ScoredModel] = {}
    for scored_model in sorted(models, key=lambda model: model.cross_validated_square):
        effects = tuple(sorted((c.effect.id, c.axle) for c in scored_model.candidates))
        best.setdefault((scored_model.model.curves.family.name, effects), scored_model)
    return list(best.values())


def _explain(fitted: FittedModel, surface: int) -> Explanation:
    model = fitted.model
    family = model.curves.family
    shape = [] if family is BURCKHARDT else [f"{CURVE_SHAPE} {family.name}"]
    name = " with ".join([*shape, *(c.name for c in model.candidates)]) or PLAIN
    alone = replace(model, curves=model.curves.select(surface))
    return Explanation(name, alone, _information(fitted))


def _information(fitted: FittedModel) -> Array:
    """Information about the effects' parameters, those of all curves eliminated; shape (k, k)."""
    total, curves = fitted.grams.total, fitted.model.curves.values.size
    rows = max(float(fitted.grams.rows.sum()) - len(total) + 1, 1.0)
    variance = max(float(total[-1, -1]) / rows, 1e-300)
    effect_gram, cross = total[curves:-1, curves:-1], total[:curves, curves:-1]
    if not effect_gram.size:
        return np.zeros((0, 0))
    left = effect_gram - cross.T @ solve_normal_equations(total[:curves, :curves], cross)
    return np.asarray((left + left.T) / 2 / variance)
