"""Diagnosis of what the simulation gets wrong, from recordings or tables, in seven steps.

1. `split_hold_out`: keep a part of the data back, on which the gain alone is measured.
2. `find_surface_changes`: divide each drive into segments with one adhesion curve each.
3. `prepare_regression`: weight and whiten the rows, and fit the curves without effects.
4. `detect_effects`: is anything unexplained? Sign-flip test of every effect, largest statistic.
5. `select_effects`: which effects? Every one and every two of them, compared by cross-validation.
6. `find_residual_channels`: what remains? Splines in every channel, and waves along the rail.
7. `confirm_on_hold_out`: does it predict the data that were kept back better?

Each step has a file of its name. Steps 2 and 3 are in `regression`, the others in `inference`.
Between steps 6 and 7 the selected model must pass `rules`; `build_diagnosis` puts the findings into
sentences, an extended model and plot data.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cache, partial

import numpy as np
from numpy.typing import NDArray

from adhesion_can.diagnosis.build_diagnosis import build_diagnosis, build_empty_diagnosis
from adhesion_can.diagnosis.cause_result import Witness
from adhesion_can.diagnosis.drive.drive_data import DriveData
from adhesion_can.diagnosis.drive.thinning import RATE_HZ, thin_drives
from adhesion_can.diagnosis.evidence import Untested
from adhesion_can.diagnosis.inference.candidates import build_candidates
from adhesion_can.diagnosis.inference.compute_effect_grams import compute_effect_grams
from adhesion_can.diagnosis.inference.confirm_on_hold_out import (
    ConfirmedFindings,
    confirm_on_hold_out,
    drop_uncertain,
)
from adhesion_can.diagnosis.inference.curve_shape import (
    choose_families,
    drop_doubtful_effects,
    judge_shape,
    score_families,
)
from adhesion_can.diagnosis.inference.detect_effects import detect_effects
from adhesion_can.diagnosis.inference.find_residual_channels import (
    ResidualChannel,
    find_residual_channels,
)
from adhesion_can.diagnosis.inference.findings import NOISELESS, Findings
from adhesion_can.diagnosis.inference.insufficient_data import (
    describe_insufficient_data,
    find_untestable,
)
from adhesion_can.diagnosis.inference.judge_surface_changes import explains_without_changes
from adhesion_can.diagnosis.inference.select_effects import MOST_EFFECTS, select_effects
from adhesion_can.diagnosis.inference.signal_faults import (
    find_largest_oscillation,
    find_saturated_sensors,
)
from adhesion_can.diagnosis.inference.split_hold_out import (
    choose_held_out_drives,
    split_by_length,
    split_hold_out,
)
from adhesion_can.diagnosis.next_drive.apply_remaining import apply_remaining
from adhesion_can.diagnosis.next_drive.compute_next_drive import compute_next_drive
from adhesion_can.diagnosis.next_drive.explanations import build_explanations
from adhesion_can.diagnosis.next_drive.remaining import RemainingExplanations, find_remaining
from adhesion_can.diagnosis.refutation.refute import refute_by_witness, refute_shape
from adhesion_can.diagnosis.regression.candidate import Candidate
from adhesion_can.diagnosis.regression.find_surface_changes import (
    build_regression_data,
    find_surface_changes,
    fit_start_curves,
)
from adhesion_can.diagnosis.regression.prepare_regression import (
    choose_block_length,
    prepare_regression,
)
from adhesion_can.diagnosis.regression.segment_curves import SegmentCurves
from adhesion_can.diagnosis.regression.whitened_regression import FittedModel
from adhesion_can.diagnosis.result import Diagnosis, Verdict
from adhesion_can.diagnosis.rules import apply_rules
from adhesion_can.physics.driving_plan import PlanLimits
from adhesion_can.physics.effects.formula import AnyFormula
from adhesion_can.physics.effects.shape_factor import CURVE_SHAPE

ShowProgress = Callable[[str, float], None]
"""Callback with the name of the work in progress and the share that is done."""
AskWitness = Callable[[Diagnosis], Witness | None]
"""Callback with a diagnosis that names causes; None where the drives allow no witness."""


@dataclass(frozen=True, slots=True)
class DiagnosisSettings:
    """Settings of a diagnosis.

    Attributes:
        alpha: Significance level of effects that are named. They must also be worth naming, which
            makes false findings rarer than this.
        channel_alpha: Significance level of channels that a residual depends on.
        rate_hz: Rows per second and axle that are used for deciding.
        seed: Seed of the random signs.
        formulas: Formulas of the user's, tested as effects are.
        effect_grams: Whether the Gram matrices of the effects are wanted, for a diagnosis of many
            drives.
        limits: Limits of the drive that would distinguish the remaining explanations; None: none is
            computed.
        explanations: Whether the explanations that are left are wanted.

    """

    alpha: float = 0.01
    channel_alpha: float = 0.025
    rate_hz: float = RATE_HZ
    seed: int = 1
    formulas: tuple[AnyFormula, ...] = ()
    effect_grams: bool = False
    limits: PlanLimits | None = None
    explanations: bool = False


def _silent(_work: str, _share: float) -> None:
    pass


def diagnose(
    drives: Sequence[DriveData],
    holdout: Sequence[DriveData] = (),
    settings: DiagnosisSettings | None = None,
    show: ShowProgress = _silent,
    ask_witness: AskWitness | None = None,
) -> Diagnosis:
    """Diagnose recordings of one vehicle, or tables.

    Args:
        drives: Drives from which the diagnosis is made.
        holdout: Drives for the gain alone; none: a part of `drives` is held out.
        settings: Levels, rates and seeds; None: the defaults.
        show: Callback for the progress.
        ask_witness: Second witness of a diagnosis that names causes; None: there is none.

    """
    settings = settings or DiagnosisSettings()
    used = [drive for drive in (*drives, *holdout) if len(drive)]
    candidates, untested = build_candidates(used) if used else ((), [])
    candidates = (*candidates, *map(Candidate, settings.formulas))
    thin = thin_drives(used, settings.rate_hz)
    block_length_s = choose_block_length(thin) if thin else 1.0
    # Step 1
    held_out = choose_held_out_drives(used, [drive for drive in holdout if len(drive)])
    block = split_hold_out(thin, held_out, block_length_s)
    why = describe_insufficient_data(thin, block) if thin else "no usable row in any input"
    if why:
        return build_empty_diagnosis(drives, [*untested, Untested("everything", why)])
    # Step 2
    show("surface changes", 0.05)
    change_times = [find_surface_changes(drive, candidates) for drive in thin]
    # Steps 3 to 6
    analysis = _Analysis(thin, held_out, candidates, block, block_length_s, settings, show)
    findings, shaped = analysis.explain_changes(change_times)
    plain_found, grams = findings, None
    if settings.effect_grams:
        grams = compute_effect_grams(findings.prepared, findings.selection.plain.rmse)
    # Step 7
    show("gain", 0.85)
    if shaped is None:
        findings, dropped = drop_uncertain(findings)
        untested += dropped
    confirmed = confirm_on_hold_out(shaped or findings)
    if shaped is not None and confirmed.shape is None:
        rejected = confirmed.rejected
        confirmed = confirm_on_hold_out(findings)
        # What else was found or refuted beside that shape counts no longer.
        untested += [finding for finding in rejected if finding.what == CURVE_SHAPE]
    elif shaped is not None:
        findings = shaped
    untested += find_untestable(used)
    deciding = [drive for drive, held in zip(used, held_out, strict=True) if not held]
    remaining = _find_remaining(deciding, plain_found, settings, show)
    findings, confirmed = apply_remaining(findings, confirmed, plain_found, remaining)
    build = partial(build_diagnosis, used, untested=untested, remaining=remaining)
    diagnosis = build(findings, confirmed)
    witness = None
    if ask_witness is not None and diagnosis.causes:
        show("second witness", 0.92)
        witness = ask_witness(diagnosis)
    if witness is not None and witness.stays:
        findings = refute_by_witness(findings, plain_found, witness)
        confirmed = confirm_on_hold_out(findings)
        diagnosis = build(findings, confirmed)
    diagnosis = _with_remaining(diagnosis, remaining)
    diagnosis = _with_next_drive(diagnosis, findings, confirmed, settings, show)
    show("done", 1.0)
    return replace(diagnosis, effect_grams=grams, witness=witness)


def _with_remaining(diagnosis: Diagnosis, remaining: RemainingExplanations | None) -> Diagnosis:
    """The diagnosis with what a further drive left; the plain curve it refuted is no answer."""
    if remaining is None:
        return diagnosis
    verdict = diagnosis.verdict
    if remaining.refutes_plain and verdict is Verdict.NOTHING:
        verdict = Verdict.UNEXPLAINED
    if verdict is Verdict.UNEXPLAINED:
        remaining = remaining.without_plain()
    return replace(diagnosis, verdict=verdict, remaining=remaining)


def _with_next_drive(
    diagnosis: Diagnosis,
    findings: Findings,
    confirmed: ConfirmedFindings,
    settings: DiagnosisSettings,
    show: ShowProgress,
) -> Diagnosis:
    """The diagnosis with its explanations, and the drive that would distinguish them, if asked."""
    if not settings.explanations and settings.limits is None:
        return diagnosis
    show("next drive", 0.95)
    refuted = (cause.refuted.fitted.model for cause in confirmed.closest)
    by_effect = {cause.effect: cause.rivals for cause in diagnosis.causes}
    rivals = {candidate: by_effect.get(candidate.effect.id, ()) for candidate in confirmed.named}
    explanations = build_explanations(
        findings, is_confirmed=bool(diagnosis.causes), rivals=rivals, others=refuted
    )
    next_drive = None
    if settings.limits is not None:
        named = dict.fromkeys(rival for ids in rivals.values() for rival in ids)
        next_drive = compute_next_drive(findings, explanations, settings.limits, tuple(named))
    return replace(diagnosis, explanations=explanations, next_drive=next_drive)


def _find_remaining(
    drives: Sequence[DriveData], findings: Findings, settings: DiagnosisSettings, show: ShowProgress
) -> RemainingExplanations | None:
    """What short drives leave of the explanations of the long ones; None where none is short."""
    long, short = split_by_length(drives)
    if not short or any(drive.table for drive in drives):
        return None
    show("explanations before", 0.9)
    before = replace(settings, limits=None, effect_grams=False, explanations=True)
    explanations = diagnose(long, (), before).explanations
    if len(explanations) < 2:
        return None
    names = ([drive.name for drive in part] for part in (long, short))
    return find_remaining(explanations, findings.prepared, *names)


@dataclass(frozen=True)
class _Analysis:
    """Steps 3 to 6, for any surface changes.

    Attributes:
        drives: Drive data of each recording, thinned.
        held_out: Whether each drive is held out whole.
        candidates: Effects that can be tested.
        block: Block number of each row, −1 − number in rows that are held out; shape (n,).
        block_length_s: Length of a block, s.
        settings: Levels, rates and seeds.
        show: Callback for the progress.

    """

    drives: tuple[DriveData, ...]
    held_out: Sequence[bool]
    candidates: tuple[Candidate, ...]
    block: NDArray[np.int64]
    block_length_s: float
    settings: DiagnosisSettings
    show: ShowProgress

    def explain(self, change_times: list[list[float]]) -> tuple[Findings, Findings | None]:
        """Findings with Burckhardt's curve, and with one of another family where it is better.

        Args:
            change_times: Times of the surface changes in each drive, s.

        """
        findings = self.run(change_times)
        self.show("curve families", 0.75)
        return self._run_with_shape(replace(findings, families=score_families(findings)))

    def _run_with_shape(self, findings: Findings) -> tuple[Findings, Findings | None]:
        """Findings with a curve of another family; None where Burckhardt's is as good.

        The findings with Burckhardt's curve come first, with the shapes that were refuted.
        """
        if findings.selection.plain.rmse < NOISELESS:
            return findings, None
        for curves, most in choose_families(findings, findings.families):
            shaped = drop_doubtful_effects(self.run(findings.change_times, curves, most))
            shape = judge_shape(findings, shaped)
            if shape is None:
                continue
            shaped = replace(shaped, families=findings.families, shape=shape)
            if not shaped.explains:
                continue
            refuted = refute_shape(shaped)
            if refuted is None:
                return findings, shaped
            findings = replace(findings, refuted=(*findings.refuted, refuted))
        return findings, None

    def explain_changes(self, change_times: list[list[float]]) -> tuple[Findings, Findings | None]:
        """Findings as `explain` gives them, with the surface changes or without them.

        Args:
            change_times: Times of the surface changes in each drive, s.

        """
        findings, shaped = self.explain(change_times)
        # Drives that are held out decide nothing: what they are without changes is not asked.
        unchanged = [
            times if held else [] for times, held in zip(change_times, self.held_out, strict=True)
        ]
        if unchanged != change_times:
            # The other explanation of the same data: the surface never changed, effects or the
            # shape of the curve did it all.
            other, other_shaped = self.explain(unchanged)
            if explains_without_changes(shaped or findings, other_shaped or other):
                return other, other_shaped
        return findings, shaped

    def run(
        self,
        change_times: list[list[float]],
        curves: SegmentCurves | None = None,
        most_effects: int = MOST_EFFECTS,
    ) -> Findings:
        """Findings with given times of surface changes, s, for each drive.

        Args:
            change_times: Times of the surface changes in each drive, s.
            curves: Curves to start with; None: Burckhardt's.
            most_effects: Largest number of effects that are selected.

        """
        rng = np.random.default_rng(self.settings.seed)
        data = build_regression_data(self.drives, change_times)
        # Step 3
        self.show("regression", 0.15)
        prepared = prepare_regression(
            data, curves or fit_start_curves(data), self.block, self.candidates, self.block_length_s
        )
        # Step 4
        self.show("effects", 0.35)
        detection = detect_effects(prepared, rng)
        # Step 5
        selection = select_effects(prepared, detection.test, most_effects)
        channel_alpha, seed = self.settings.channel_alpha, self.settings.seed

        # Step 6, for the models whose residual is asked for
        @cache
        def search_channels(fitted: FittedModel) -> tuple[ResidualChannel, ...]:
            self.show("channels", 0.7)
            rng = np.random.default_rng(seed)
            return tuple(find_residual_channels(prepared.regression, fitted, channel_alpha, rng))

        selected = Findings(
            prepared=prepared,
            detection=detection,
            selection=selection,
            search_channels=search_channels,
            oscillation=find_largest_oscillation(self.drives),
            saturated=tuple(find_saturated_sensors(self.drives)),
            change_times=change_times,
            block_length_s=self.block_length_s,
            alpha=self.settings.alpha,
            channel_alpha=channel_alpha,
            other_drives=any(self.held_out),
        )
        return apply_rules(selected)
