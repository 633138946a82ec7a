"""Rules that the selected model must pass, each for its reason, in the order in which they apply.

A model is selected because it predicts blocks of the drives that decide. That proves no cause: a
rule takes away what gains for another reason than that which its name says, or puts a better
description in its place. Each starts from what the one before has left.
"""

from collections.abc import Callable
from dataclasses import replace
from functools import partial
from typing import NamedTuple

from adhesion_can.diagnosis.inference.delay_search import with_delay_for_lag, with_longer_delay
from adhesion_can.diagnosis.inference.findings import Findings
from adhesion_can.diagnosis.inference.model_comparison import (
    SECOND_LEAST_GAIN,
    ScoredModel,
    fit_and_score,
    is_worse,
)
from adhesion_can.diagnosis.inference.noise_averaging import averages_noise, without_short_delay
from adhesion_can.diagnosis.inference.propose_formula import propose_formula
from adhesion_can.diagnosis.refutation.refute import add_implausible_effects, drop_refuted
from adhesion_can.diagnosis.regression.whitened_regression import fit_model
from adhesion_can.normal_quantiles import NORMAL_95
from adhesion_can.physics.effects import acts_in_contact
from adhesion_can.physics.effects.channel_factor import PREFIX


def part_rivals(findings: Findings) -> Findings:
    """The findings with the rivals that all rows of all drives leave, the best one selected.

    A drive that was made to distinguish rivals is short, and a part of it is held out for the gain.
    The choice between models of one size needs no rows that were held out: every row of the drives
    that decide is used, and a rival that is significantly worse is dropped.

    Args:
        findings: Findings of steps 2 to 6; of a single drive they stay as they are.

    """
    regression, selection = findings.regression, findings.selection
    rivals = (selection.best, *selection.indistinguishable)
    if len(regression.data.drives) < 2 or len(rivals) < 2 or not selection.best.candidates:
        return findings
    everything = regression.last_fit
    fits = [fit_and_score(everything, rival.model) for rival in rivals]
    place = min(range(len(fits)), key=lambda k: fits[k].cross_validated_square)
    left: list[ScoredModel] = [
        rival
        for k, (rival, fit) in enumerate(zip(rivals, fits, strict=True))
        if k != place and not is_worse(fits[place], fit)
    ]
    # The selected model stays where it is as good: it was preferred for a reason.
    best = selection.best if selection.best in left else rivals[place]
    others = tuple(model for model in (rivals[place], *left) if model is not best)
    return replace(findings, selection=replace(selection, best=best, indistinguishable=others))


MOST_BENT = 0.25
"""Share of what a channel explains by a linear factor that a spline in it may explain besides."""


class Rule(NamedTuple):
    """What is done to findings, and why.

    Attributes:
        apply: Function that gives the findings as the rule leaves them.
        reason: Reason, a sentence.

    """

    apply: Callable[[Findings], Findings]
    reason: str


def drop_noise_averages(findings: Findings) -> Findings:
    """The findings without lags that average noise, and delays too short to be known."""
    best, regression = findings.selection.best, findings.regression
    lags = tuple(c for c in best.candidates if c.is_lag)
    if not lags:
        return findings
    groups = [lags, *((lag,) for lag in lags)] if len(lags) > 1 else [lags]
    delays = [c for c in findings.prepared.candidates if c.is_lag and not acts_in_contact(c.effect)]
    tests = (
        partial(without_short_delay, regression, best, lags),
        partial(with_longer_delay, regression, best),
        partial(with_delay_for_lag, regression, best, delays),
        *(partial(averages_noise, regression, best, group) for group in groups),
    )
    for test in tests:
        other = test()
        if other is not None:
            return drop_noise_averages(findings.with_best(other))
    return findings


def drop_bent_channel(findings: Findings) -> Findings:
    """The findings without a user's channel on which the residual still depends much."""
    best = findings.selection.best
    left = next(iter(findings.significant_channels_of_best), None)
    if left is None or left.gain < SECOND_LEAST_GAIN:
        return findings
    rest = tuple(c for c in best.candidates if c.effect.id != PREFIX + left.channel.name)
    without = findings.fitted_with(rest)
    if len(rest) == len(best.candidates) or without is None:
        return findings
    is_bent = left.explained_square(best.rmse) > MOST_BENT * (without.rmse**2 - best.rmse**2)
    return findings.with_best(without) if is_bent else findings


def drop_insignificant_sizes(findings: Findings) -> Findings:
    """The findings without effects whose 95 % interval holds 0, on the rows of the last fit too."""
    best, regression = findings.selection.best, findings.regression
    if not best.candidates:
        return findings
    fits = best.fitted, fit_model(regression.last_fit, best.model)
    size, place = min(
        (fitted.size_in_deviations(place), place)
        for fitted in fits
        for place in range(len(best.candidates))
    )
    if size > NORMAL_95:
        return findings
    return drop_insignificant_sizes(findings.without_effect(place))


RULES = (
    Rule(
        drop_noise_averages,
        "A lag that gains as much backwards in time averages noise of the slip, and no signal "
        "shows a delay of less than half its cycle.",
    ),
    Rule(
        propose_formula,
        "What depends on a channel has a law, and a straight line is the wrong one where the "
        "dependence is bent.",
    ),
    Rule(
        drop_bent_channel,
        "A factor that is linear in a channel is not the form of a dependence of which a spline in "
        "the channel still finds much.",
    ),
    Rule(
        drop_insignificant_sizes,
        "An effect that showed on the rows that decide may vanish on all rows, and a size that may "
        "be 0 is no cause.",
    ),
    Rule(
        part_rivals,
        "A drive that was made to distinguish rivals is short: all rows of all drives decide "
        "between models of one size.",
    ),
    Rule(
        drop_refuted,
        "A wrong cause can predict well, but it leaves structure in blocks of time, or has several "
        "sizes, or a size that is not possible.",
    ),
    Rule(
        add_implausible_effects,
        "What would explain the data by a size that no vehicle has is reported as refuted, and "
        "nothing else is put silently in its place.",
    ),
)
"""In the order in which they apply."""


def apply_rules(findings: Findings) -> Findings:
    """The findings as all rules leave them.

    Args:
        findings: Findings of steps 2 to 6.

    """
    for rule in RULES:
        findings = rule.apply(findings)
    return findings
