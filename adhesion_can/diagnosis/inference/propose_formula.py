"""A formula for what a channel does to the adhesion where no effect of the library describes it.

Formulas of a small grammar compete by cross-validation, as effects do. One with more constants must
be better than all with fewer by more than chance allows, all formulas counted; those that are left
are reported as rivals. A formula beside which the residual still depends on the channel is none.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from adhesion_can.diagnosis.inference.find_residual_channels import ResidualChannel
from adhesion_can.diagnosis.inference.findings import Findings
from adhesion_can.diagnosis.inference.formula_candidates import (
    STRAIGHT,
    FormulaChannel,
    build_formulas,
)
from adhesion_can.diagnosis.inference.further_channels import drop_needless
from adhesion_can.diagnosis.inference.model_comparison import (
    INDISTINGUISHABLE_SHARE,
    LEVEL,
    SECOND_LEAST_GAIN,
    ScoredModel,
    gain_p_value,
    is_improvement,
    score_model,
)
from adhesion_can.diagnosis.inference.propose_effects import propose_effects
from adhesion_can.diagnosis.regression.candidate import Candidate
from adhesion_can.diagnosis.regression.channel_splines import Channel, ChannelKind, build_channels
from adhesion_can.diagnosis.regression.whitened_regression import fit_model
from adhesion_can.physics.channels import CHANNEL_BY_NAME, ChannelOrigin, model_channel
from adhesion_can.physics.effects.channel_factor import LINEAR, PREFIX
from adhesion_can.physics.effects.formula import CONTACT_CHANNELS, FORMULA, Formula

FORMULA_CHANNELS = tuple(CONTACT_CHANNELS[name] for name in ("speed", "load"))
"""Channels of every contact that a formula may depend on. The slip is the curve's own."""
LOAD = CONTACT_CHANNELS["load"]
MOST_FITS = 2
"""Formulas of one form that are fitted in full, from different places."""
MOST_LEFT = 0.1
"""Share of what a formula explains that a spline in its channel may explain besides."""


def propose_formula(findings: Findings) -> Findings:
    """The findings with a formula for a channel that matters; as they are where there is none.

    A formula takes the place of a factor that is linear in a user's channel, where that is not the
    form of the dependence; else it is added to what was selected. Beside a formula of the user's
    none is proposed: a model has one. Nor is one put in the place of an effect that explains the
    data by a size that no vehicle has.
    """
    best = findings.selection.best
    if any(candidate.effect.id == FORMULA for candidate in best.candidates):
        return findings
    if findings.selection.implausible and not best.candidates:
        return findings
    of_channels = [c for c in best.candidates if c.effect.id.startswith(PREFIX)]
    # The one with the largest part left to a spline first: another may have stood for its bend.
    left_to = {
        PREFIX + dependence.channel.name: dependence.gain
        for dependence in findings.channels_of_best
    }
    linear = [c for c in of_channels if c.effect.form == LINEAR]
    left = _left_over(findings)
    if not linear and left is None:
        return findings
    channels = _possible_channels(findings)
    for candidate in sorted(linear, key=lambda c: -left_to.get(c.effect.id, 0.0)):
        without = findings.fitted_with(tuple(c for c in best.candidates if c is not candidate))
        name = candidate.effect.id.removeprefix(PREFIX)
        if without is not None and name in channels:
            findings = _extended(findings, name, channels, without, best) or findings
            if findings.selection.best is not best:
                return findings
    if left is None or PREFIX + left.channel.name in {c.effect.id for c in of_channels}:
        return findings
    return _extended(findings, left.channel.name, channels, best, None) or findings


def _left_over(findings: Findings) -> ResidualChannel | None:
    """Channel on which the selected model's residual depends most, where a formula may have it."""
    if findings.oscillates or findings.saturated:
        return None
    # Time and position follow whatever varies slowly.
    possible = (
        dependence
        for dependence in findings.significant_channels_of_best
        if dependence.gain >= SECOND_LEAST_GAIN and _is_possible(dependence.channel, findings)
    )
    return next(possible, None)


def _is_possible(channel: Channel, findings: Findings) -> bool:
    """Whether a formula may depend on a channel: a quantity that an estimator online knows.

    A load that was computed from efforts and geometry is no measurement.
    """
    drives = findings.regression.data.drives
    if channel.name == LOAD and not all(drive.has_load for drive in drives):
        return False
    if channel.kind is not ChannelKind.FACTOR or channel.period or channel.levels is not None:
        return False
    known = CHANNEL_BY_NAME.get(channel.name)
    if known is None or known.origin is ChannelOrigin.COVARIATE:
        return True
    return channel.name in FORMULA_CHANNELS


def _possible_channels(findings: Findings) -> dict[str, FormulaChannel]:
    """Channels on which a formula may depend, by their names in reports."""
    regression, best = findings.regression, findings.selection.best.model
    channels = build_channels(regression.data, regression.evaluate_corrected(best))
    return {
        channel.name: FormulaChannel(model_channel(channel.name), channel.unit, channel.values)
        for channel in channels
        if _is_possible(channel, findings)
    }


def _extended(
    findings: Findings,
    channel: str,
    channels: Mapping[str, FormulaChannel],
    rest: ScoredModel,
    straight: ScoredModel | None,
) -> Findings | None:
    """The findings with a formula in a channel beside other effects; None without one.

    Args:
        findings: Findings of steps 2 to 6.
        channel: Name of the channel on which the formula depends.
        channels: Channels on which a formula may depend, by name.
        rest: Model without the channel.
        straight: Model with a factor that is linear in the channel; None: it is to be fitted.

    """
    fits = _fit_formulas(findings, channel, channels, rest)
    fits = [fit for fit in fits if straight is None or _kind(fit) != STRAIGHT]
    fits += [] if straight is None else [straight]
    chosen, rivals = _choose(fits)
    if chosen is None:
        return None
    if chosen is not straight:
        bent = _with_chosen(findings, channel, rest, chosen, rivals, len(fits))
        if bent is not None or straight is None:
            return bent
    # The straight line stays; what else it might be is told.
    others = tuple(_text(model) for model in (chosen, *rivals) if model is not straight)
    known = {**findings.selection.formulas, PREFIX + channel: others}
    return replace(findings, selection=replace(findings.selection, formulas=known))


def _with_chosen(
    findings: Findings,
    channel: str,
    rest: ScoredModel,
    chosen: ScoredModel,
    rivals: Sequence[ScoredModel],
    fitted: int,
) -> Findings | None:
    """The findings with a chosen formula; None where it gains too little, or leaves too much."""
    tested = len(findings.prepared.candidates) + fitted
    if not is_improvement(rest, chosen, tested):
        return None
    best, smaller = drop_needless(findings.regression, chosen, tested)
    known = findings.selection.all_rivals()
    # A formula in the place of a straight line has the line's rivals.
    known[FORMULA] = known.pop(PREFIX + channel, ())
    selection = replace(
        findings.selection,
        best=best,
        indistinguishable=(),
        smaller=(*smaller, rest),
        formulas={FORMULA: tuple(map(_text, rivals))},
        known_rivals=known,
    )
    extended = replace(findings, selection=selection)
    return extended if _describes(extended, channel, rest) else None


def _fit_formulas(
    findings: Findings, channel: str, channels: Mapping[str, FormulaChannel], rest: ScoredModel
) -> list[ScoredModel]:
    """Fitted models with one formula each beside other effects, the most promising of each form."""
    regression = findings.regression
    sequence = not any(drive.independent for drive in regression.data.drives)
    others = [other_channel for name, other_channel in channels.items() if name != channel]
    candidates = build_formulas(channels[channel], others, sequence=sequence)
    forms: dict[str, int] = {}
    fits = []
    for proposal in propose_effects(regression, rest.model, candidates):
        form = proposal.model.candidates[-1].effect.form
        if proposal.gain <= 0.0 or forms.get(form, 0) == MOST_FITS:
            continue
        forms[form] = forms.get(form, 0) + 1
        fitted = fit_model(regression, proposal.model)
        fits.append(score_model(regression, fitted, proposal.sign_flips))
    return fits


def _choose(fits: Sequence[ScoredModel]) -> tuple[ScoredModel | None, list[ScoredModel]]:
    """The formula with the fewest constants that none is better than, and those that are as good.

    Args:
        fits: Fitted models with one formula each, or with a linear factor.

    """
    if not fits:
        return None, []
    ranked = sorted(fits, key=lambda fit: fit.cross_validated_square)
    best = ranked[0]
    equal = [model for model in ranked if model is best or not _is_beaten(model, best, len(fits))]
    # Of those with as few constants a straight line is the simplest.
    chosen = min(
        equal,
        key=lambda model: (sum(c.size for c in model.candidates), _kind(model) != STRAIGHT),
    )
    rivals = {_kind(model): model for model in reversed(equal) if _kind(model) != _kind(chosen)}
    return chosen, list(reversed(rivals.values()))


def _is_beaten(scored: ScoredModel, best: ScoredModel, tested: int) -> bool:
    """Whether the best formula is better by more than chance allows, so many counted."""
    square = best.cross_validated_square
    if scored.cross_validated_square <= (1.0 + INDISTINGUISHABLE_SHARE) * square:
        return False
    return gain_p_value(scored.fitted, best.fitted) * tested <= LEVEL


def _describes(extended: Findings, channel: str, rest: ScoredModel) -> bool:
    """Whether a formula leaves little of what its channel does."""
    best = extended.selection.best
    of_channel = (
        dependence for dependence in extended.channels_of_best if dependence.channel.name == channel
    )
    left = next(of_channel, None)
    if left is None or (left.p_value > extended.channel_alpha and left.gain < SECOND_LEAST_GAIN):
        return True
    return left.explained_square(best.rmse) <= MOST_LEFT * (rest.rmse**2 - best.rmse**2)


def _kind(scored: ScoredModel) -> str:
    effect = scored.candidates[-1].effect
    return effect.kind if isinstance(effect, Formula) else STRAIGHT


def _text(scored: ScoredModel) -> str:
    """A fitted formula as text, its constants in it."""
    candidate: Candidate = scored.candidates[-1]
    model = scored.model
    values = model.values[-1]
    named = zip(candidate.free_parameters, values, strict=True)
    constants = ", ".join(f"{p.name} = {np.format_float_positional(v, 3, fractional=False)}"
                          for p, v in named)  # fmt: skip
    form = candidate.effect.form or candidate.effect.title
    return f"{form} with {constants}"
