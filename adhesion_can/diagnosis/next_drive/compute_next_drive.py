"""Compute the next drive: which manoeuvre distinguishes the remaining explanations, and how."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import cache
from typing import TypeVar

import numpy as np
import scipy

from adhesion_can.arrays import Array
from adhesion_can.diagnosis.formatting import unit_text
from adhesion_can.diagnosis.inference.findings import Findings
from adhesion_can.diagnosis.inference.model_comparison import LEVEL
from adhesion_can.diagnosis.inference.split_hold_out import SHORT
from adhesion_can.diagnosis.next_drive.catalogue import QUICK_S, build_catalogue
from adhesion_can.diagnosis.next_drive.discrepancy import ExplanationComparison, FittedRival, Pair
from adhesion_can.diagnosis.next_drive.drive_setting import (
    DriveSetting,
    build_drive_setting,
    describe_setting,
)
from adhesion_can.diagnosis.next_drive.explanations import Explanation
from adhesion_can.diagnosis.next_drive.planned_drive import DriveStart
from adhesion_can.diagnosis.next_drive.result import NextDrive, PairDiscrepancy
from adhesion_can.diagnosis.next_drive.search import Compute, DriveSequence, find_shortest
from adhesion_can.diagnosis.regression.candidate import Candidate
from adhesion_can.diagnosis.regression.segment_curves import BURCKHARDT
from adhesion_can.estimation.curves.peak import nearest_burckhardt
from adhesion_can.physics.channels import COVARIATES
from adhesion_can.physics.curves import Conditions
from adhesion_can.physics.driving_plan import DrivingPlan, PlanLimits, PlanStep, Prediction
from adhesion_can.physics.effects import acts_in_contact, build_instruments
from adhesion_can.physics.readings import Role

Value = TypeVar("Value")

POWER = 0.95
"""Probability with which the plan is to refute each wrong explanation."""
SAFETY = 1.5
"""Factor of the discrepancy for what the prediction leaves out: the noise is estimated, blocks are
few, and a part of them is held out."""
CYCLE_S, STABLE_SHARE = 0.01, 0.8
"""Dead time of the creep speed control without delays, s, and share of its bandwidth below which it
holds no slip beyond the peak."""
LEAD_S, TAIL_S = 1.0, 1.5
"""Coasting before and after the manoeuvres, s: smoothing needs signals around every row."""
LEAST_BLOCKS = 3.5
"""Least duration of the manoeuvres, blocks: a test needs some of them."""
LEAST_SLIP = 5e-4
"""Slip ratio below which an axle rolls freely, for a reader."""
PARTS = 3
"""Parts of a step's slips among which the most informative one is sought."""


def compute_next_drive(
    findings: Findings,
    explanations: Sequence[Explanation],
    limits: PlanLimits,
    rivals: Sequence[str] = (),
) -> NextDrive:
    """The drive that would distinguish what is left of explanations.

    Args:
        findings: Findings of a diagnosis.
        explanations: Explanations that are left.
        limits: Limits within which the plan drives.
        rivals: Ids of the rivals of the named effects.

    """
    regression = findings.regression.last_fit
    fitted = findings.selection.best.fitted
    setting = build_drive_setting(regression, fitted, findings.block_length_s)
    if setting is None:
        return NextDrive((), None, f"No plan: {describe_setting(regression.data.drives)}.")
    # A longer one would not be taken for a drive that decides.
    longest_s = max(drive.driven_s for drive in regression.data.drives)
    longest_s = min(limits.duration_max, float(np.floor(SHORT * longest_s)))
    names = tuple(explanation.name for explanation in explanations)
    if len(names) == 1 and rivals:
        why = (
            f"No plan: no drive can be computed that distinguishes {names[0]} from "
            f"{' or '.join(rivals)}, since no form in the library of what is named last fits these "
            "data as well."
        )
        return NextDrive(names, None, why)
    return plan_drive(explanations, setting, replace(limits, duration_max=longest_s))


def plan_drive(
    explanations: Sequence[Explanation], setting: DriveSetting, limits: PlanLimits
) -> NextDrive:
    """The drive that would distinguish explanations in a setting.

    Args:
        explanations: Explanations that are left.
        setting: Vehicle, train, sensors and noise.
        limits: Limits within which the plan drives.

    """
    names = tuple(explanation.name for explanation in explanations)
    if len(explanations) < 2:
        return NextDrive(names, None, _describe_too_few(names))
    comparison = ExplanationComparison(explanations, setting)
    nearest = _nearest_curve(explanations[0], setting)
    c1, c2, c3 = curve = _with_peak(nearest)
    peak_slip = float(np.log(c1 * c2 / c3) / c2) if c3 > 0.0 else limits.slip_max
    speed = float(np.clip(setting.speed, limits.speed_min, limits.speed_max))
    share = CYCLE_S / (CYCLE_S + _longest_delay(explanations))
    manoeuvres = build_catalogue(
        limits,
        setting.vehicle.axles,
        peak_slip,
        sand=_depends_on_sand(explanations),
        stable=share < STABLE_SHARE,
        quick=not (_follows_speed(explanations) and setting.speed_error.window_s > QUICK_S),
    )
    wanted = SAFETY * needed_discrepancy()
    lead, tail = PlanStep(LEAD_S, "coast"), PlanStep(TAIL_S, "coast")
    build_part = cache(comparison.build_part)

    def search(compute: Compute) -> tuple[DriveSequence | None, DriveSequence | None]:
        return find_shortest(
            manoeuvres,
            DriveStart(LEAD_S + TAIL_S, speed),
            limits,
            wanted,
            LEAST_BLOCKS * setting.block_length_s,
            build_part,
            compute,
        )

    sequence, most = search(comparison.compute)
    missed: dict[Pair, float] = {}

    def compute_left(grams: Mapping[Pair, Array]) -> dict[Pair, float]:
        """Discrepancy of the pairs that are not missed."""
        return comparison.compute(_without(missed, grams))

    best = most
    # Where not every pair can be separated, drop the hardest one and try again.
    while sequence is None and best is not None and len(missed) < len(comparison.pairs):
        values = _without(missed, comparison.compute(best.grams))
        (a, b), least = min(values.items(), key=lambda item: item[1])
        missed |= {pair: least for pair in ((a, b), (b, a)) if pair in values}
        if len(missed) < len(comparison.pairs):
            sequence, best = search(compute_left)
    if sequence is None:
        reason = "no manoeuvre is within the limits of effort, speed and duration."
        if missed:
            reason = _describe_missed(names, limits, missed, 1)
        return NextDrive(names, None, f"No plan: {reason}", _list_pairs(comparison, most))
    steps = _join_alike((lead, *sequence.steps, tail))
    fits = comparison.refit(steps, DriveStart(0.0, speed))
    predictions = tuple(
        Prediction(explanation.name, text)
        for explanation, text in zip(explanations, _predict(explanations, steps, fits), strict=True)
    )
    plan = DrivingPlan(
        steps=steps,
        start_speed=round(speed, 1),
        curve=curve,
        limits=limits,
        purpose=f"which holds: {', or '.join(names)}",
        predictions=predictions,
        bandwidth_share=round(share, 3),
    )
    pairs = tuple(
        PairDiscrepancy(names[a], names[b], fit.discrepancy, power_of(fit.discrepancy))
        for (a, b), fit in fits.items()
    )
    sentence = _describe_plan(plan)
    if missed:
        said = _describe_missed(names, limits, missed, len(missed))
        sentence += f" What this drive cannot do: {said}"
    notes = [note for note in (setting.assumption, _describe_curve(nearest, curve)) if note]
    sentence = " ".join([sentence, *notes])
    return NextDrive(names, plan, sentence, pairs)


def needed_discrepancy() -> float:
    """Discrepancy at which a one-sided test of two models' squares at `LEVEL` has `POWER`.

    With a discrepancy T the difference of the two sums of squares has the mean T and, with white
    noise of variance 1, the variance 4 T (Cox, J. R. Statist. Soc. B 24 (1962) 406-424).

    """
    normal = scipy.stats.norm
    return float((2.0 * (normal.ppf(POWER) + normal.ppf(1.0 - LEVEL))) ** 2)


def power_of(discrepancy: float) -> float:
    """Probability that a rival at a discrepancy is refuted at `LEVEL`."""
    normal = scipy.stats.norm
    return float(normal.cdf(np.sqrt(discrepancy) / 2.0 - normal.ppf(1.0 - LEVEL)))


def _without(missed: Mapping[Pair, float], values: Mapping[Pair, Value]) -> dict[Pair, Value]:
    return {pair: value for pair, value in values.items() if pair not in missed}


def _nearest_curve(explanation: Explanation, setting: DriveSetting) -> tuple[float, float, float]:
    """(c1, c2, c3) of Burckhardt's curve nearest to the one that an explanation expects."""
    curves = explanation.model.curves
    values = curves.parameters[0]
    if curves.family is BURCKHARDT:
        c1, c2, c3 = map(float, values)
        return c1, c2, c3
    conditions = Conditions(setting.speed, float(setting.load.mean()))
    return nearest_burckhardt(curves.family, values, conditions)


def _with_peak(curve: tuple[float, float, float]) -> tuple[float, float, float]:
    """A curve (c1, c2, c3) that the controller can work with.

    A rise beyond the peak, c3 < 0, is taken as none: there is no peak, the controller needs none,
    and the plan bounds the slips. Where the curve falls almost from the start, c1·c2 < 2·c3, c2 is
    raised to 2·c3/c1, so that its slope at slip 0 is at least that of its fall.
    """
    c1, c2, c3 = curve
    c3 = max(c3, 0.0)
    return c1, max(c2, 2.0 * c3 / c1), c3


def _depends_on_sand(explanations: Sequence[Explanation]) -> bool:
    name = COVARIATES[Role.SANDING]
    return any(
        name in candidate.effect.requires.covariates
        for explanation in explanations
        for candidate in explanation.model.candidates
    )


def _follows_speed(explanations: Sequence[Explanation]) -> bool:
    """Whether an explanation says how the vehicle speed's reading follows the speed in time."""
    return any(
        _is_time_of_signal(candidate)
        and build_instruments([candidate.active(values)]).misread_speed
        for explanation in explanations
        for candidate, values in explanation.model.estimates
    )


def _is_time_of_signal(candidate: Candidate) -> bool:
    return candidate.free_parameters[0].unit == "s" and not acts_in_contact(candidate.effect)


def _longest_delay(explanations: Sequence[Explanation]) -> float:
    """Largest delay of a signal, or lead, that an explanation states, s."""
    return max(
        (
            abs(values[0])
            for explanation in explanations
            for c, values in explanation.model.estimates
            if _is_time_of_signal(c)
        ),
        default=0.0,
    )


def _join_alike(steps: Sequence[PlanStep]) -> tuple[PlanStep, ...]:
    """Steps of which neighbours that hold the same slip, or coast, are one step."""
    out: list[PlanStep] = []
    for step in steps:
        last = out[-1] if out else None
        holds = step.slip[0] == step.slip[1] and not step.period_s
        if last is not None and holds and step == replace(last, duration_s=step.duration_s):
            out[-1] = replace(last, duration_s=last.duration_s + step.duration_s)
        else:
            out.append(step)
    return tuple(out)


# ------------------------------------------------------------------------------- sentences


def _describe_too_few(names: Sequence[str]) -> str:
    if not names:
        return "No plan: no explanation remains that a drive could test."
    return (
        f"No plan: one explanation remains, {names[0]}; another drive passed with --holdout "
        "confirms or refutes it."
    )


def _list_pairs(
    comparison: ExplanationComparison, most: DriveSequence | None
) -> tuple[PairDiscrepancy, ...]:
    if most is None:
        return ()
    names = [explanation.name for explanation in comparison.explanations]
    return tuple(
        PairDiscrepancy(names[a], names[b], value, power_of(value))
        for (a, b), value in comparison.compute(most.grams).items()
    )


def _describe_missed(
    names: Sequence[str], limits: PlanLimits, missed: Mapping[Pair, float], most: int
) -> str:
    """Which pairs no drive within the limits distinguishes, the first so many."""
    said: dict[frozenset[int], str] = {}
    for (a, b), value in list(missed.items())[:most]:
        said.setdefault(
            frozenset((a, b)),
            f"within the limits, no drive of up to {limits.duration_max:g} s distinguishes "
            f"{names[b]} from {names[a]}: the best one found refutes it with a probability of "
            f"{100 * power_of(value):.0f} %",
        )
    return f"{'; '.join(said.values())}."


def _describe_curve(nearest: tuple[float, float, float], curve: tuple[float, float, float]) -> str:
    """How the controller's curve differs from the fitted one, a sentence; '' where it does not."""
    if curve[1] == nearest[1]:
        return ""
    return (
        f"The fitted curve falls almost from slip 0 on; the controller gets c2 = {curve[1]:.3g} "
        f"instead of {nearest[1]:.3g}."
    )


def _describe_plan(plan: DrivingPlan) -> str:
    steps = "; ".join(f"{step.duration_s:g} s {step.description}" for step in plan.steps)
    predicted = " ".join(
        f"If {prediction.name} holds, {prediction.predicts}." for prediction in plan.predictions
    )
    return f"Drive {plan.duration_s:g} s from {plan.start_speed:g} m/s: {steps}. {predicted}"


def _predict(
    explanations: Sequence[Explanation],
    steps: Sequence[PlanStep],
    fits: Mapping[Pair, FittedRival],
) -> list[str]:
    """What each explanation predicts where it differs most from its nearest rival, a clause."""
    out = []
    for place, explanation in enumerate(explanations):
        own_fits = {pair: fit for pair, fit in fits.items() if pair[0] == place}
        if not own_fits:
            rival = next(fit for pair, fit in fits.items() if pair[1] == place)
            out.append(f"{_where(steps, rival, of_rival=True)}")
            continue
        (_, b), fit = min(own_fits.items(), key=lambda item: item[1].discrepancy)
        text = _where(steps, fit, of_rival=False)
        size = _size(explanation)
        out.append(f"{text} than {explanations[b].name} fitted to it{size}")
    return out


def _size(explanation: Explanation) -> str:
    """The explanation's sizes in brackets; '' without effects."""
    parts = [
        f"{c.free_parameters[0].name} {values[0]:.3g} {unit_text(c.free_parameters[0].unit)}"
        for c, values in explanation.model.estimates
    ]
    return f" ({', '.join(part.strip() for part in parts)})" if parts else ""


def _where(steps: Sequence[PlanStep], fit: FittedRival, *, of_rival: bool) -> str:
    """The most telling part of a step's slips, and the adhesion there, a clause."""
    (drive,) = fit.drive.data.drives
    observed = drive.observe()
    best, clause = -1.0, ""
    for number, step in enumerate(steps):
        rows = np.flatnonzero(fit.drive.step == number)
        if not len(rows):
            continue
        order = rows[np.argsort(np.abs(observed.slip[rows]), kind="stable")]
        for part in np.array_split(order, PARTS):
            if not len(part):
                continue
            sign = step.sign or 1.0
            mean = sign * float(fit.residual[part].mean())
            weight = float(np.sum((mean * fit.scale[part]) ** 2))
            if weight > best:
                best = weight
                level = sign * float(observed.adhesion[part].mean()) - of_rival * mean
                low, high = (float(x) for x in np.quantile(np.abs(observed.slip[part]), [0, 1]))
                where = f"in step {number + 1} ({step.mode})"
                lowest, other = f"{low:.3f}", f"{high:.3f}"
                at = f"a slip of {lowest}" if lowest == other else f"slips of {lowest} to {other}"
                clause = f"the adhesion used {where} at {at}"
                if high < LEAST_SLIP:
                    clause = f"the adhesion of the axles that roll freely {where}"
                clause += f" is {level:.4f} on average"
                if not of_rival:
                    clause += f", {abs(mean):.4f} {'more' if mean > 0.0 else 'less'}"
    return clause
