"""Comparison of fitted models by their cross-validated squares, block by block (for step 5).

Each block's sum of squares is taken with parameters from the other blocks, so a larger model is not
favoured by its size. The differences between two models over the blocks are tested by a paired t
test and by Wilcoxon's signed-rank test (Biometrics 1 (1945)).
"""

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
import scipy

from adhesion_can.diagnosis.regression.candidate import Candidate
from adhesion_can.diagnosis.regression.gram_matrices import solve_normal_equations
from adhesion_can.diagnosis.regression.model import Model
from adhesion_can.diagnosis.regression.whitened_regression import (
    ITERATIONS,
    FittedModel,
    WhitenedRegression,
    fit_model,
)
from adhesion_can.physics.effects.channel_factor import STEP

LEVEL = 0.05
"""Significance level of a difference between two models."""
LEAST_GAIN, SECOND_LEAST_GAIN = 0.01, 0.03
"""Share by which the RMSE of the adhesion must fall for an effect to be worth naming, and for one
beside another: the first one's error of form must not get a name."""
LEAST_WHITENED_GAIN = 0.005
"""Share by which the whitened sum of squares must fall besides."""
INDISTINGUISHABLE_SHARE = 0.002
"""Models whose sums of squares differ by a smaller share are indistinguishable."""


@dataclass(frozen=True, eq=False)
class ScoredModel:
    """A fitted model with its error.

    Attributes:
        fitted: Fitted model.
        rmse: RMSE of the adhesion on the rows that are not held out, errors of the vehicle speed
            that all axles share taken off.
        rmse_with_speed_errors: The same with these errors.
        sign_flips: P-value by sign flips of what the model adds to one with given effects, by these
            effects.

    """

    fitted: FittedModel
    rmse: float
    rmse_with_speed_errors: float
    sign_flips: Mapping[frozenset[Candidate], float] = field(default_factory=dict)

    @property
    def model(self) -> Model:
        """The model, fitted."""
        return self.fitted.model

    @property
    def cross_validated_square(self) -> float:
        """Sum of squares of the whitened residuals, each block predicted from the others."""
        return self.fitted.cross_validated_square

    @property
    def candidates(self) -> tuple[Candidate, ...]:
        """Effects of the model."""
        return self.model.candidates

    @property
    def ids(self) -> frozenset[str]:
        """Effect ids of the model."""
        return frozenset(candidate.effect.id for candidate in self.candidates)

    @property
    def held_out_rmse(self) -> float:
        """RMSE of the whitened residuals of blocks that were left out, in deviations of noise."""
        rows = max(float(self.fitted.grams.rows.sum()), 1.0)
        return float(np.sqrt(self.cross_validated_square / rows))

    @property
    def drifts(self) -> bool:
        """Whether one of its effects depends on time alone."""
        return any(c.effect.observability.drift for c in self.candidates)

    @property
    def free_sizes(self) -> tuple[float, ...]:
        """Size of each effect; of one at the end of its range what it would be without it."""
        model = self.model
        gram = self.fitted.grams.total
        sizes = [values[0] for values in model.values]
        pairs = zip(model.candidates, sizes, strict=True)
        at_end = [c.free_parameters[0].is_at_bound(size) for c, size in pairs]
        if any(at_end):
            step = solve_normal_equations(gram[:-1, :-1], gram[:-1, -1])
            for place in np.flatnonzero(at_end):
                sizes[place] += float(step[model.first_parameter(int(place))])
        return tuple(sizes)

    @property
    def is_plausible(self) -> bool:
        """Whether a vehicle may have every size."""
        pairs = zip(self.candidates, self.free_sizes, strict=True)
        return all(c.plausible[0] <= size <= c.plausible[1] for c, size in pairs)

    def admits(self, candidate: Candidate) -> bool:
        """Whether an effect can stand beside those of the model.

        Two forms of one mechanism exclude each other; two values of one channel do not, nor do two
        axles at each of which a mechanism acts.
        """
        same = [c for c in self.candidates if c.effect.id == candidate.effect.id]
        steps = all(c.effect.form == STEP for c in (*same, candidate))
        if steps:
            return candidate not in same
        forms = {c.effect.form for c in (*same, candidate)}
        axles = [c.axle for c in (*same, candidate)]
        return not same or (len(forms) == 1 and all(axles) and len(set(axles)) == len(axles))

    def candidates_missing_from(self, larger: "ScoredModel") -> tuple[Candidate, ...]:
        """Effects that a larger model adds to this one's; () where it lacks one of them."""
        if not set(self.candidates) <= set(larger.candidates):
            return ()
        return tuple(c for c in larger.candidates if c not in self.candidates)


def score_model(
    regression: WhitenedRegression,
    fitted: FittedModel,
    sign_flips: Mapping[frozenset[Candidate], float] | None = None,
) -> ScoredModel:
    """A fitted model with its RMSE, and its p-values by sign flips where there are some."""
    residual = regression.residual(fitted.model)
    both = (regression.without_speed_errors(residual), residual)
    rmse, with_errors = (float(np.sqrt(np.mean(scored[regression.used] ** 2))) for scored in both)
    return ScoredModel(fitted, rmse, with_errors, sign_flips or {})


def fit_and_score(
    regression: WhitenedRegression, model: Model, iterations: int = ITERATIONS
) -> ScoredModel:
    """A model, fitted in at most so many iterations, with its RMSE."""
    return score_model(regression, fit_model(regression, model, iterations))


def is_improvement(small: ScoredModel, large: ScoredModel, tested: float) -> bool:
    """Whether a larger model's gain is significant, with so many effects tested, and worth it."""
    return not find_shortfall(small, large, tested)


def find_shortfall(small: ScoredModel, large: ScoredModel, tested: float) -> str:
    """The first test of a gain that a larger model fails, as a clause; '' where it fails none.

    Sign flips count where they tested what the larger model adds to the smaller one: beside another
    model they tested something else.
    """
    least = SECOND_LEAST_GAIN if small.candidates else LEAST_GAIN
    # An effect on the vehicle speed looks like an error of it, and others drown in such an error.
    worth = (
        large.rmse < (1.0 - least) * small.rmse
        or large.rmse_with_speed_errors < (1.0 - least) * small.rmse_with_speed_errors
    )
    if not worth:
        return f"gain < {100 * least:g} %"
    limit = (1.0 - LEAST_WHITENED_GAIN) * small.cross_validated_square
    if large.cross_validated_square >= limit:
        return f"block gain < {100 * LEAST_WHITENED_GAIN:g} %"
    by_blocks = gain_p_value(small.fitted, large.fitted) * tested
    same_family = small.model.curves.family is large.model.curves.family
    by_signs = large.sign_flips.get(frozenset(small.candidates), 1.0) if same_family else 1.0
    p_value = min(2.0 * min(by_signs, by_blocks), 1.0)
    return "" if p_value <= LEVEL else f"gain p = {p_value:.2g}"


def is_worse(best: ScoredModel, other: ScoredModel) -> bool:
    """Whether another model of the same size has a significantly larger sum of squares."""
    limit = (1.0 + INDISTINGUISHABLE_SHARE) * best.cross_validated_square
    if other.cross_validated_square <= limit:
        return False
    return worse_p_value(best.fitted, other.fitted) < LEVEL


def worse_p_value(best: FittedModel, other: FittedModel) -> float:
    """One-sided p-value of another model's larger sum of squares, by a paired t test of blocks."""
    differences = other.cross_validated_squares - best.cross_validated_squares
    blocks = len(differences)
    if blocks < 2:
        return 1.0
    std_error = float(differences.std(ddof=1)) / np.sqrt(blocks)
    if std_error == 0.0:
        return 0.0 if differences.mean() > 0.0 else 1.0
    return float(scipy.stats.t.sf(differences.mean() / std_error, blocks - 1))


def gain_p_value(small: FittedModel, large: FittedModel) -> float:
    """One-sided p-value of a larger model's gain over a smaller one.

    It is twice the smaller one of two p-values (Bonferroni): of the mean gain of the blocks, which
    a few large gains can carry, and of their ranks, which many small gains can carry.
    """
    gains = small.cross_validated_squares - large.cross_validated_squares
    blocks = len(gains)
    std_error = float(gains.std(ddof=1)) / np.sqrt(blocks) if blocks > 1 else 0.0
    if std_error == 0.0:
        return 1.0
    by_mean = float(scipy.stats.t.sf(gains.mean() / std_error, blocks - 1))
    by_rank = float(scipy.stats.wilcoxon(gains, alternative="greater").pvalue)
    return min(1.0, 2.0 * min(by_mean, by_rank))
