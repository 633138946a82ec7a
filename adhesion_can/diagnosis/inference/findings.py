"""Findings of steps 2 to 6, and what follows from them: named effects or an unexplained channel."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from adhesion_can.arrays import Array
from adhesion_can.diagnosis.inference.detect_effects import Detection
from adhesion_can.diagnosis.inference.find_residual_channels import ResidualChannel
from adhesion_can.diagnosis.inference.model_comparison import (
    SECOND_LEAST_GAIN,
    ScoredModel,
    fit_and_score,
)
from adhesion_can.diagnosis.inference.model_selection import ModelSelection
from adhesion_can.diagnosis.inference.sensor_noise import NoiseComparison, compare_with_sensors
from adhesion_can.diagnosis.inference.shape_finding import ScoredFamily, ShapeFinding
from adhesion_can.diagnosis.inference.signal_faults import DriveTrainOscillation, SaturatedSensor
from adhesion_can.diagnosis.refutation.invariance import SizesByEnvironment
from adhesion_can.diagnosis.refutation.refuted_cause import RefutedCause
from adhesion_can.diagnosis.regression.candidate import Candidate
from adhesion_can.diagnosis.regression.channel_splines import build_channels
from adhesion_can.diagnosis.regression.gram_matrices import solve_normal_equations
from adhesion_can.diagnosis.regression.model import (
    compute_curve_jacobian,
    evaluate_model,
    remove_effect,
)
from adhesion_can.diagnosis.regression.prepare_regression import PreparedRegression
from adhesion_can.diagnosis.regression.whitened_regression import FittedModel, WhitenedRegression

NOISELESS = 1e-6
"""RMSE of the adhesion below which there is nothing to explain, since no sensor is that good."""
LEAST_EXPLAINED = 0.5
"""Share that named effects must have in what effects and channels explain together."""
OSCILLATION_SIZE = 0.3
"""Size of an oscillation in the adhesion, relative to the noise floor, from which it matters."""


@dataclass(frozen=True, eq=False)
class Findings:
    """Results of steps 2 to 6.

    Attributes:
        prepared: Whitened regression with the plain fit and the candidates.
        detection: Sign-flip test of every candidate against the plain model.
        selection: Selected model and its competitors.
        search_channels: Function that gives the channels against a model's residual, largest gain
            first, and searches once a model.
        oscillation: Largest drive-train oscillation; None: there is none.
        saturated: Effort sensors whose readings are cut off at a limit.
        change_times: Times of the surface changes in each drive, s.
        block_length_s: Length of a block, s.
        alpha: Significance level of effects that are named.
        channel_alpha: Significance level of channels.
        other_drives: Whether whole recordings were held out.
        families: Fits of all curve families, Burckhardt's first; () where they were not compared.
        shape: Base curve of another family; None: it is Burckhardt's.
        refuted: Causes that helped and were refuted, the first one removed first.
        sizes_by_environment: Sizes of each effect of the selected model in the environments of
            every partition, the partition with the largest spread first.

    """

    prepared: PreparedRegression
    detection: Detection
    selection: ModelSelection
    search_channels: Callable[[FittedModel], tuple[ResidualChannel, ...]]
    oscillation: DriveTrainOscillation | None
    saturated: tuple[SaturatedSensor, ...]
    change_times: list[list[float]]
    block_length_s: float
    alpha: float
    channel_alpha: float
    other_drives: bool = False
    families: tuple[ScoredFamily, ...] = ()
    shape: ShapeFinding | None = None
    refuted: tuple[RefutedCause, ...] = ()
    sizes_by_environment: Mapping[Candidate, tuple[SizesByEnvironment, ...]] = field(
        default_factory=dict
    )

    @property
    def regression(self) -> WhitenedRegression:
        """Rows with weights, filter and blocks."""
        return self.prepared.regression

    @property
    def baseline(self) -> ScoredModel:
        """Burckhardt's curves without effects: the simulation as it is."""
        return self.selection.plain if self.shape is None else self.shape.burckhardt

    @property
    def channels_of_plain(self) -> tuple[ResidualChannel, ...]:
        """Channels against the plain model's residual, largest gain first."""
        return self.search_channels(self.selection.plain.fitted)

    @property
    def channels_of_best(self) -> tuple[ResidualChannel, ...]:
        """Channels against the selected model's residual, largest gain first."""
        return self.search_channels(self.selection.best.fitted)

    @property
    def significant_channels_of_best(self) -> tuple[ResidualChannel, ...]:
        """Those of them on which the residual depends significantly."""
        return tuple(
            dependence
            for dependence in self.channels_of_best
            if dependence.p_value <= self.channel_alpha
        )

    def p_value(self, candidate: Candidate) -> float:
        """P-value of a selected effect, all effects counted."""
        return self.selection.p_value(candidate, self.prepared.candidates)

    @cached_property
    def named(self) -> tuple[Candidate, ...]:
        """Effects that are significant and explain most of what can be explained."""
        best = self.selection.best
        if not best.candidates or any(self.p_value(c) > self.alpha for c in best.candidates):
            return ()
        return best.candidates if self.explains else ()

    @cached_property
    def explains(self) -> bool:
        """Whether the selected model explains most of what can be explained."""
        best, plain = self.selection.best, self.baseline
        if self.oscillates or self.saturated or plain.rmse < NOISELESS:
            return False
        explained = 1.0 - (best.rmse / plain.rmse) ** 2
        strongest = next(iter(self.significant_channels_of_best), None)
        by_channel = 0.0
        if strongest is not None:
            remaining = best.rmse * (1.0 - strongest.gain)
            by_channel = (best.rmse**2 - remaining**2) / plain.rmse**2
        return explained >= LEAST_EXPLAINED * (explained + by_channel)

    @cached_property
    def share_of_excess(self) -> float:
        """Share that the selected model has in what the sensors' noise does not explain.

        1 where it leaves nothing for certain.
        """
        best, plain = self.selection.best, self.baseline
        if not self.noise.leaves_more:
            return 1.0
        explained = max(plain.rmse**2 - best.rmse**2, 0.0)
        left = best.rmse**2 * (1.0 - 1.0 / self.noise.left**2)
        return explained / (explained + left)

    def without_effect(self, place: int) -> "Findings":
        """The findings without one effect of the selected model, the others fitted again."""
        best, regression = self.selection.best, self.regression
        rest = (*best.candidates[:place], *best.candidates[place + 1 :])
        smaller = remove_effect(best.model, place)[0]
        without = fit_and_score(regression, smaller)
        # The fit of the search may be better, or at a minimum that the model has left since.
        known = self.fitted_with(rest)
        if known is not None:
            without = min(known, without, key=lambda model: model.cross_validated_square)
        return self.with_best(without)

    def with_best(self, best: ScoredModel) -> "Findings":
        """The findings with another model selected, which has no rivals."""
        return replace(self, selection=replace(self.selection, best=best, indistinguishable=()))

    def fitted_with(self, candidates: tuple[Candidate, ...]) -> ScoredModel | None:
        """Fitted model with given effects; None where there is none."""
        selection = self.selection
        known = (selection.plain, *selection.singles, *selection.smaller)
        return next((model for model in known if model.candidates == candidates), None)

    @cached_property
    def oscillates(self) -> bool:
        """Whether the drive train oscillates enough to matter in the force balance."""
        limit = OSCILLATION_SIZE * self.noise_floor
        return self.oscillation is not None and self.oscillation.adhesion > limit

    @cached_property
    def unexplained_channel(self) -> ResidualChannel | None:
        """Channel that the plain model's residual depends on; None: there is none."""
        if self.selection.plain.rmse < NOISELESS:
            return None
        for dependence in self.channels_of_plain:
            possible = not self.saturated or dependence.channel.name == "tractive_effort"
            if (
                possible
                and dependence.p_value <= self.channel_alpha
                and dependence.gain >= SECOND_LEAST_GAIN
            ):
                return dependence
        return None

    @cached_property
    def noise(self) -> NoiseComparison:
        """The noise floor beside the noise of the sensors."""
        model = self.selection.best.model
        return compare_with_sensors(self.regression, model, self._noise)

    @cached_property
    def noise_floor(self) -> float:
        """RMSE of the adhesion with the selected effects and all channels, bias-corrected."""
        return float(np.sqrt(np.mean(self._noise**2)))

    @cached_property
    def _noise(self) -> Array:
        """What the selected effects and all channels leave of the adhesion, bias-corrected."""
        regression, best = self.regression, self.selection.best.model
        data, used = regression.data, regression.used
        effects = best.active_effects
        corrected = regression.evaluate_corrected(best)
        columns = [channel.build_basis(corrected) for channel in build_channels(data, corrected)]
        columns += [
            dependence.basis for dependence in self.channels_of_best if dependence.channel.period
        ]
        jacobian = compute_curve_jacobian(data, best.curves, corrected)
        design = np.column_stack([jacobian, *columns])[used]
        residual = evaluate_model(data, best.curves, effects).residual[used]
        answer = solve_normal_equations(design.T @ design, design.T @ residual)
        noise = residual - design @ answer
        freedom = max(len(noise) - design.shape[1], 1)
        return np.asarray(noise * np.sqrt(len(noise) / freedom))
