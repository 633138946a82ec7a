"""Shape before cause: the family of the base curve is judged before an effect answers for it.

Steps 3 to 6 run with Burckhardt's curve, and where another family may hold, with the best of the
others too. The two explanations are compared on the same weights, filter and blocks. Burckhardt's
stays where it is as good; of two that the blocks cannot separate the one with fewer errors of
instruments and vehicle is preferred, and then the one with fewer causes.
"""

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from adhesion_can.diagnosis.inference.find_residual_channels import ResidualChannel
from adhesion_can.diagnosis.inference.findings import Findings
from adhesion_can.diagnosis.inference.model_comparison import (
    LEAST_GAIN,
    LEAST_WHITENED_GAIN,
    SECOND_LEAST_GAIN,
    ScoredModel,
    fit_and_score,
    gain_p_value,
    is_improvement,
    is_worse,
)
from adhesion_can.diagnosis.inference.one_speed import is_at_one_speed
from adhesion_can.diagnosis.inference.select_effects import MOST_EFFECTS
from adhesion_can.diagnosis.inference.sensor_noise import compare_where_effort_is_noisy
from adhesion_can.diagnosis.inference.shape_finding import ScoredFamily, ShapeFinding
from adhesion_can.diagnosis.regression.fit_families import fit_family_curves
from adhesion_can.diagnosis.regression.model import Model, evaluate_model
from adhesion_can.diagnosis.regression.prepare_regression import FIRST_ITERATIONS
from adhesion_can.diagnosis.regression.segment_curves import SegmentCurves
from adhesion_can.diagnosis.regression.whitened_regression import WhitenedRegression
from adhesion_can.estimation.compare_directions import share_opposite
from adhesion_can.physics.curves import FAMILIES, CurveFamily
from adhesion_can.physics.effects import acts_in_contact
from adhesion_can.physics.effects.contact_factors import FALLING_FRICTION

OTHERS: tuple[CurveFamily, ...] = tuple(
    family for name, family in FAMILIES.items() if name not in ("burckhardt", "burckhardt_c4")
)
"""Families that may replace Burckhardt's. With c4 it is Burckhardt's with `falling_friction`."""
FREE = FAMILIES["free"]
LARGEST_LOSS = 0.02
"""Share by which the RMSE may rise for an explanation with fewer causes to be preferred."""
NEARLY_AS_GOOD = 0.1
"""Share by which the RMSE of a family alone may exceed that of named effects on Burckhardt's curve,
on the weights of the latter, for the family to be tried in their place."""
MOST_LEFT = 0.25
"""Largest share that a family leaves of what a slip spline explains on Burckhardt's curve."""
BESIDE_SHAPE = 0.05
"""Share by which an effect beside a shape must lower the cross-validated whitened square: the
family's own error of form must not get a name, nor a lag that averages noise of the slip."""
ABOVE_NOISE = 1.06
"""What Burckhardt's curve must leave over the sensors' noise for another shape. In six drives
without a mechanism it was 1.01 to 1.04, on four contacts of another shape 1.25 to 2.5."""


class FamilyChoice(NamedTuple):
    """Family that may replace Burckhardt's, and how far the search with it has to go.

    Attributes:
        curves: Curves of the family to start with.
        most_effects: Largest number of effects with which it can be preferred.

    """

    curves: SegmentCurves
    most_effects: int


def score_families(findings: Findings) -> tuple[ScoredFamily, ...]:
    """Burckhardt's curves and those of the other families, on one regression; Burckhardt first.

    Args:
        findings: Findings with Burckhardt's curve.

    """
    regression = findings.regression
    plain, best = findings.selection.plain, findings.selection.best
    fits = [ScoredFamily(plain.model.curves.family, plain, best)]
    for family in OTHERS:
        curves = fit_family_curves(regression.data, family)
        alone = _fit(regression, Model(curves))
        extended = alone
        if best.candidates:
            model = replace(best.model, curves=alone.model.curves)
            extended = _fit(regression, model)
        fits.append(ScoredFamily(family, alone, extended))
    return tuple(fits)


def choose_families(findings: Findings, fits: Sequence[ScoredFamily]) -> list[FamilyChoice]:
    """Families that may replace Burckhardt's, the preferred one first; often none.

    A family with a formula is preferred to the free curve where its held-out RMSE is within 2 %,
    and of several such families the one that needs no effect. A family that is no better with the
    effects that are named on Burckhardt's curve can replace some of them at most.

    Args:
        findings: Findings with Burckhardt's curve.
        fits: Fits of all families, Burckhardt's first.

    """
    plain, best = findings.selection.plain, findings.selection.best
    ranked = sorted(fits[1:], key=lambda fit: fit.cross_validated_square)
    limit = (1.0 + LARGEST_LOSS) ** 2 * ranked[0].cross_validated_square
    formulas = [
        family
        for family in ranked
        if family.cross_validated_square <= limit and family.family is not FREE
    ]
    formulas.sort(key=lambda family: family.scored.cross_validated_square)
    chosen = [*formulas[:1], *(family for family in ranked[:1] if family not in formulas[:1])]

    def most_effects(scored: ScoredFamily) -> int | None:
        """Largest number of effects beside the family; None where it cannot be preferred."""
        if not best.candidates:
            return MOST_EFFECTS if is_improvement(plain, scored.scored, len(OTHERS)) else None
        if is_improvement(best, scored.extended, len(OTHERS)):
            return MOST_EFFECTS
        fewer = len(best.candidates) - 1
        replaces = fewer > 0 or scored.scored.rmse <= (1.0 + NEARLY_AS_GOOD) * best.rmse
        return fewer if replaces and _is_worth(plain, scored.scored) else None

    choices = ((family.scored.model.curves, most_effects(family)) for family in chosen)
    return [FamilyChoice(curves, most) for curves, most in choices if most is not None]


def drop_doubtful_effects(shaped: Findings) -> Findings:
    """The findings without effects that are not significant, or not worth it beside a shape.

    Args:
        shaped: Findings with the curve of another family.

    """
    best, plain = shaped.selection.best, shaped.selection.plain
    worth = best.rmse < (1.0 - SECOND_LEAST_GAIN) * plain.rmse
    # Where the curve is steep, the RMSE is that of the slip's noise: whoever averages it gains.
    square = plain.cross_validated_square
    worth &= best.cross_validated_square < (1.0 - BESIDE_SHAPE) * square
    if worth and all(shaped.p_value(c) <= shaped.alpha for c in best.candidates):
        return shaped
    return shaped.with_best(plain)


def judge_shape(findings: Findings, shaped: Findings) -> ShapeFinding | None:
    """The shape as a finding where it is the better explanation; None where it is not.

    Args:
        findings: Findings with Burckhardt's curve.
        shaped: Findings with the curve of another family.

    """
    regression, best = shaped.regression, shaped.selection.best
    plain = _fit(regression, findings.selection.plain.model)
    burckhardt = plain
    if findings.selection.best.candidates:
        burckhardt = _fit(regression, findings.selection.best.model)
    same = plain
    if best.candidates:
        same = _fit(regression, replace(best.model, curves=plain.model.curves))
    if not _is_worth(same, best) or _leaves_slip(findings, shaped):
        return None
    if not _shows_in_adhesion(regression, same, best) or _is_of_no_contact(regression, best):
        return None
    tested = len(OTHERS)
    if burckhardt.candidates:
        preferred = is_improvement(same, best, tested) and is_improvement(burckhardt, best, tested)
        preferred |= _has_fewer_causes(burckhardt, best)
    else:
        preferred = is_improvement(same, best, tested)
    if not preferred:
        return None
    p_value = min(1.0, tested * gain_p_value(same.fitted, best.fitted))
    family = best.model.curves.family
    return ShapeFinding(family, plain, same, p_value, _find_rivals(shaped, burckhardt, best))


def _fit(regression: WhitenedRegression, model: Model) -> ScoredModel:
    return fit_and_score(regression, model, FIRST_ITERATIONS)


def _is_worth(small: ScoredModel, large: ScoredModel) -> bool:
    """Whether a gain is large enough to matter, significant or not."""
    square = small.cross_validated_square
    return (
        large.rmse < (1.0 - LEAST_GAIN) * small.rmse
        and large.cross_validated_square < (1.0 - LEAST_WHITENED_GAIN) * square
    )


def _shows_in_adhesion(
    regression: WhitenedRegression, small: ScoredModel, large: ScoredModel
) -> bool:
    """Whether a shape gains in the rows whose error is the adhesion's rather than the slip's.

    A curve that is flatter than the true one predicts better from a noisy slip, wherever many slips
    are about the same, as in coasting. That is no shape of the contact. Nor is one where the noise
    of the efforts explains what Burckhardt's curve leaves.
    """
    left, still_left = (
        compare_where_effort_is_noisy(regression, scored.model) for scored in (small, large)
    )
    if left is not None and still_left is not None:
        return left > ABOVE_NOISE and still_left < (1.0 - LEAST_GAIN) * left
    # In units of the variance of the effort's and the wheel speed's noise together.
    by_speed = ((regression.speed_error_design * regression.scale[:, None]) ** 2).sum(axis=1)
    of_slip = (regression.slip_variance_share + by_speed) / (1.0 + by_speed)
    rows = regression.used & (of_slip < 0.5)
    if not rows.any():
        return False
    before, after = (
        float(np.sqrt(np.mean(regression.residual(scored.model)[rows] ** 2)))
        for scored in (small, large)
    )
    return after < (1.0 - LEAST_GAIN) * before


def _is_of_no_contact(regression: WhitenedRegression, scored: ScoredModel) -> bool:
    """Whether slip and adhesion have opposite signs in many rows beyond the peak of a shape.

    A friction brake whose force is not measured, or a slip of bends, makes such a peak.
    """
    data, model = regression.data, scored.model
    evaluation = evaluate_model(data, model.curves, model.active_effects)
    slope = model.curves.slope(evaluation.slip, data.surface, evaluation.conditions)
    aligned = np.sign(evaluation.slip) * (evaluation.predicted + evaluation.residual)
    return share_opposite(aligned[regression.used & (slope < 0.0)]) > 0.0


def _leaves_slip(findings: Findings, shaped: Findings) -> bool:
    """Whether the residual still depends on the slip much: then the family is not the shape.

    Errors of the slip leave such a dependence on any steep curve. It does not count where the
    family explains more than any curve over slip could.
    """
    plain, best = findings.selection.plain, shaped.selection.best
    before = _explained_by_slip(findings.channels_of_plain, plain.rmse)
    if best.rmse**2 < plain.rmse**2 - before:
        return False
    left = [
        dependence
        for dependence in shaped.significant_channels_of_best
        if dependence.gain >= SECOND_LEAST_GAIN
    ]
    return _explained_by_slip(left, best.rmse) > MOST_LEFT * before


def _explained_by_slip(channels: Sequence[ResidualChannel], rmse: float) -> float:
    """Mean square of the adhesion that a spline in the slip takes off a residual."""
    by_slip = (
        channel.explained_square(rmse) for channel in channels if channel.channel.name == "slip"
    )
    return max(by_slip, default=0.0)


def _has_fewer_causes(burckhardt: ScoredModel, shaped: ScoredModel) -> bool:
    """Whether a shape explains as much as effects on Burckhardt's curve, with fewer causes."""
    if is_worse(burckhardt, shaped) or shaped.rmse > (1.0 + LARGEST_LOSS) * burckhardt.rmse:
        return False
    instruments = [
        sum(not acts_in_contact(c.effect) for c in scored.candidates)
        for scored in (burckhardt, shaped)
    ]
    causes = [len(burckhardt.candidates), 1 + len(shaped.candidates)]
    return (
        instruments[1] <= instruments[0]
        and causes[1] <= causes[0]
        and (instruments[1] < instruments[0] or causes[1] < causes[0])
    )


def _find_rivals(shaped: Findings, burckhardt: ScoredModel, best: ScoredModel) -> tuple[str, ...]:
    """Ids of effects that could stand for the shape."""
    rivals: set[str] = set()
    if burckhardt.candidates and not is_worse(best, burckhardt):
        rivals |= burckhardt.ids - best.ids
    drives = shaped.regression.data.drives
    if FALLING_FRICTION not in best.ids and is_at_one_speed(drives):
        rivals.add(FALLING_FRICTION)
    return tuple(sorted(rivals))
