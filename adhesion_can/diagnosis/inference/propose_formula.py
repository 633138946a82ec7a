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


def propose_formula(found: Findings) -> Findings:
    """The findings with a formula for a channel that matters; as they are where there is none.

    A formula takes the place of a factor that is linear in a user's channel, where that is not the
    form of the dependence; else it is added to what was selected. Beside a formula of the user's
    none is proposed: a model has one. Nor is one put in the place of an effect that explains the
    data by a size that no vehicle has.
    """
    best = found.selection.best
    if any(candidate.effect.id == FORMULA for candidate in best.candidates):
        return found
    if found.selection.implausible and not best.candidates:
        return found
    of_channels = [c for c in best.candidates if c.effect.id.startswith(PREFIX)]
    # The one with the largest part left to a spline first: another may have stood for its bend.
    left_to = {PREFIX + one.channel.name: one.gain for one in found.channels_of_best}
    linear = [c for c in of_channels if c.effect.form == LINEAR]
    left = _left_over(found)
    if not linear and left is None:
        return found
    channels = _possible_channels(found)
    for candidate in sorted(linear, key=lambda c: -left_to.get(c.effect.id, 0.0)):
        without = found.fitted_with(tuple(c for c in best.candidates if c is not candidate))
        name = candidate.effect.id.removeprefix(PREFIX)
        if without is not None and name in channels:
            found = _extended(found, name, channels, without, best) or found
            if found.selection.best is not best:
                return found
    if left is None or PREFIX + left.channel.name in {c.effect.id for c in of_channels}:
        return found
    return _extended(found, left.channel.name, channels, best, None) or found


def _left_over(found: Findings) -> ResidualChannel | None:
    """Channel on which the selected model's residual depends most, where a formula may have it."""
    if found.oscillates or found.saturated:
        return None
    # Time and position follow whatever varies slowly.
    possible = (
        one
        for one in found.significant_channels_of_best
        if one.gain >= SECOND_LEAST_GAIN and _is_possible(one.channel, found)
    )
    return next(possible, None)


def _is_possible(channel: Channel, found: Findings) -> bool:
    """Whether a formula may depend on a channel: a quantity that an estimator online knows.

    A load that was computed from efforts and geometry is no measurement.
    """
    drives = found.prepared.regression.data.drives
    if channel.name == LOAD and not all(drive.has_load for drive in drives):
        return False
    if channel.kind is not ChannelKind.FACTOR or channel.period or channel.levels is not None:
        return False
    known = CHANNEL_BY_NAME.get(channel.name)
    if known is None or known.origin is ChannelOrigin.COVARIATE:
        return True
    return channel.name in FORMULA_CHANNELS


def _possible_channels(found: Findings) -> dict[str, FormulaChannel]:
    """Channels on which a formula may depend, by their names in reports."""
    regression, best = found.prepared.regression, found.selection.best.fitted.model
    channels = build_channels(regression.data, regression.evaluate_corrected(best))
    return {
        one.name: FormulaChannel(model_channel(one.name), one.unit, one.values)
        for one in channels
        if _is_possible(one, found)
    }


def _extended(
    found: Findings,
    channel: str,
    channels: Mapping[str, FormulaChannel],
    rest: ScoredModel,
    straight: ScoredModel | None,
) -> Findings | None:
    """The findings with a formula in a channel beside other effects; None without one.

    Args:
        found: Findings of steps 2 to 6.
        channel: Name of the channel on which the formula depends.
        channels: Channels on which a formula may depend, by name.
        rest: Model without the channel.
        straight: Model with a factor that is linear in the channel; None: it is to be fitted.

    """
    fits = _fit_formulas(found, channel, channels, rest)
    fits = [one for one in fits if straight is None or _kind(one) != STRAIGHT]
    fits += [] if straight is None else [straight]
    chosen, rivals = _choose(fits)
    if chosen is None:
        return None
    if chosen is not straight:
        bent = _with_chosen(found, channel, rest, chosen, rivals, len(fits))
        if bent is not None or straight is None:
            return bent
    # The straight line stays; what else it might be is told.
    others = tuple(_text(one) for one in (chosen, *rivals) if one is not straight)
    known = {**found.selection.formulas, PREFIX + channel: others}
    return replace(found, selection=replace(found.selection, formulas=known))


def _with_chosen(
    found: Findings,
    channel: str,
    rest: ScoredModel,
    chosen: ScoredModel,
    rivals: Sequence[ScoredModel],
    fitted: int,
) -> Findings | None:
    """The findings with a chosen formula; None where it gains too little, or leaves too much."""
    tested = len(found.prepared.candidates) + fitted
    if not is_improvement(rest, chosen, tested):
        return None
    best, smaller = drop_needless(found.prepared.regression, chosen, tested)
    known = found.selection.all_rivals()
    # A formula in the place of a straight line has the line's rivals.
    known[FORMULA] = known.pop(PREFIX + channel, ())
    selection = replace(
        found.selection,
        best=best,
        indistinguishable=(),
        smaller=(*smaller, rest),
        formulas={FORMULA: tuple(map(_text, rivals))},
        known_rivals=known,
    )
    extended = replace(found, selection=selection)
    return extended if _describes(extended, channel, rest) else None


def _fit_formulas(
    found: Findings, channel: str, channels: Mapping[str, FormulaChannel], rest: ScoredModel
) -> list[ScoredModel]:
    """Fitted models with one formula each beside other effects, the most promising of each form."""
    regression = found.prepared.regression
    sequence = not any(drive.independent for drive in regression.data.drives)
    others = [one for name, one in channels.items() if name != channel]
    candidates = build_formulas(channels[channel], others, sequence=sequence)
    forms: dict[str, int] = {}
    fits = []
    for proposal in propose_effects(regression, rest.fitted.model, candidates):
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
    ranked = sorted(fits, key=lambda one: one.fitted.cross_validated_square)
    best = ranked[0]
    equal = [one for one in ranked if one is best or not _is_beaten(one, best, len(fits))]
    # Of those with as few constants a straight line is the simplest.
    chosen = min(
        equal, key=lambda one: (sum(c.size for c in one.candidates), not _is_straight(one))
    )
    rivals = {_kind(one): one for one in reversed(equal) if _kind(one) != _kind(chosen)}
    return chosen, list(reversed(rivals.values()))


def _is_beaten(one: ScoredModel, best: ScoredModel, tested: int) -> bool:
    """Whether the best formula is better by more than chance allows, so many counted."""
    square = best.fitted.cross_validated_square
    if one.fitted.cross_validated_square <= (1.0 + INDISTINGUISHABLE_SHARE) * square:
        return False
    return gain_p_value(one.fitted, best.fitted) * tested <= LEVEL


def _describes(extended: Findings, channel: str, rest: ScoredModel) -> bool:
    """Whether a formula leaves little of what its channel does."""
    best = extended.selection.best
    own = (one for one in extended.channels_of_best if one.channel.name == channel)
    left = next(own, None)
    if left is None or (left.p_value > extended.channel_alpha and left.gain < SECOND_LEAST_GAIN):
        return True
    return left.explained_square(best.rmse) <= MOST_LEFT * (rest.rmse**2 - best.rmse**2)


def _kind(one: ScoredModel) -> str:
    effect = one.candidates[-1].effect
    return effect.kind if isinstance(effect, Formula) else STRAIGHT


def _is_straight(one: ScoredModel) -> bool:
    return _kind(one) == STRAIGHT


def _text(one: ScoredModel) -> str:
    """A fitted formula as text, its constants in it."""
    candidate: Candidate = one.candidates[-1]
    model = one.fitted.model
    values = model.values[-1]
    named = zip(candidate.free_parameters, values, strict=True)
    constants = ", ".join(f"{p.name} = {np.format_float_positional(v, 3, fractional=False)}"
                          for p, v in named)  # fmt: skip
    form = candidate.effect.form or candidate.effect.title
    return f"{form} with {constants}"
