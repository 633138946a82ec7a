"""Discrepancy between explanations on a planned drive: the criterion of T-optimal designs.

What one explanation predicts is fitted by its rival: the curve of the planned rail is free, the
effects' parameters are held by what the drives so far say of them. The weighted sum of squares that
is left is the noncentrality of the test that decides between the two (Atkinson and Fedorov,
Biometrika 62 (1975) 57-70; of several rivals the smallest one counts, as in their second paper,
pages 289-303). Linearised at the rival's estimates it follows from Gram matrices, which add up over
the parts of a drive.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from adhesion_can.arrays import Array
from adhesion_can.diagnosis.next_drive.drive_setting import DriveSetting
from adhesion_can.diagnosis.next_drive.explanations import Explanation
from adhesion_can.diagnosis.next_drive.planned_drive import DriveStart, PlannedDrive, predict_drive
from adhesion_can.diagnosis.regression.gram_matrices import number_blocks, solve_normal_equations
from adhesion_can.diagnosis.regression.model import Model, RegressionData, evaluate_model
from adhesion_can.diagnosis.regression.prepare_regression import design_speed_errors
from adhesion_can.diagnosis.regression.whitened_regression import WhitenedRegression
from adhesion_can.diagnosis.regression.whitening import ContiguousRuns, Whitener
from adhesion_can.physics.driving_plan import PlanStep

ITERATIONS = 6
"""Largest number of steps of a rival's fit."""
CURVE_STD = 0.3
"""Standard deviation of a curve's coordinates from rail to rail, relative to the larger of their
value and 1: a rail of another day is no other world."""

Pair = tuple[int, int]
"""Number of the explanation that holds, and of the rival that is fitted to it."""


@dataclass(frozen=True, eq=False)
class Part:
    """A part of a planned drive with the products that the criterion needs.

    Attributes:
        steps: Steps of the part.
        grams: Gram matrix of the rival's Jacobian and residual by pair, shape (p + 1, p + 1).
        end: State after the part, if the first explanation holds.
        effort_max: Largest effort of an axle, N.
        speeds: Lowest and highest speed, m/s.

    """

    steps: tuple[PlanStep, ...]
    grams: Mapping[Pair, Array]
    end: DriveStart
    effort_max: float
    speeds: tuple[float, float]


class ExplanationComparison:
    """Explanations that are compared on planned drives.

    Args:
        explanations: Explanations, two at least.
        setting: Vehicle, train, sensors and noise.

    """

    def __init__(self, explanations: Sequence[Explanation], setting: DriveSetting) -> None:
        self.explanations = tuple(explanations)
        self.setting = setting
        places = range(len(self.explanations))
        self.pairs: tuple[Pair, ...] = tuple(
            (a, b) for a in places for b in places
            if a != b and not _contains(self.explanations[b], self.explanations[a])
        )  # fmt: skip
        """Pairs of which the second cannot imitate the first by its own parameters."""

    def build_part(self, steps: Sequence[PlanStep], start: DriveStart) -> Part:
        """A part of a drive from a state on."""
        drives = [
            predict_drive(steps, start, self.setting, explanation)
            for explanation in self.explanations
        ]
        grams = {
            (a, b): self._regression(drives[a]).gram(self.explanations[b].model)
            for a, b in self.pairs
        }
        return Part(
            tuple(steps),
            grams,
            drives[0].end,
            max(drive.effort_max for drive in drives),
            (min(d.speeds[0] for d in drives), max(d.speeds[1] for d in drives)),
        )

    def compute(self, grams: Mapping[Pair, Array]) -> dict[Pair, float]:
        """Discrepancy of each pair from sums of Gram matrices, linearised."""
        return {
            (a, b): minimise(gram, _prior(self.explanations[b]))[1]
            for (a, b), gram in grams.items()
        }

    def refit(self, steps: Sequence[PlanStep], start: DriveStart) -> dict[Pair, "FittedRival"]:
        """Each rival fitted to what each explanation predicts for a whole drive."""
        drives = [
            predict_drive(steps, start, self.setting, explanation)
            for explanation in self.explanations
        ]
        return {
            (a, b): _fit_rival(self._regression(drives[a]), drives[a], self.explanations[b])
            for a, b in self.pairs
        }

    def _regression(self, drive: PlannedDrive) -> "_PlannedRegression":
        return _PlannedRegression(drive.data, self.setting)


@dataclass(frozen=True, eq=False)
class FittedRival:
    """A rival fitted to the prediction of another explanation.

    Attributes:
        discrepancy: Weighted sum of squares that is left.
        drive: Drive that the other explanation predicts.
        residual: Adhesion of the drive less that of the rival, shape (n,).
        scale: Reciprocal standard deviation of each row, shape (n,).

    """

    discrepancy: float
    drive: PlannedDrive
    residual: Array
    scale: Array


def minimise(gram: Array, prior: Array) -> tuple[Array, float]:
    """Least-squares change of parameters with prior information, and the square that is left.

    Args:
        gram: Gram matrix of the Jacobian and the residual, the residual last; (p + 1, p + 1).
        prior: Information about the parameters, shape (p, p).

    """
    change = solve_normal_equations(gram[:-1, :-1] + prior, np.ascontiguousarray(gram[:-1, -1]))
    return change, max(float(gram[-1, -1] - gram[:-1, -1] @ change), 0.0)


def _contains(larger: Explanation, smaller: Explanation) -> bool:
    """Whether an explanation has all effects of another one, which it then imitates.

    Of another family of curves it may be distinguished even so.
    """
    model, other = larger.model, smaller.model
    same = model.curves.family is other.curves.family
    return same and set(other.candidates) <= set(model.candidates)


def _prior(explanation: Explanation) -> Array:
    """Information about curve and effects before the planned drive, shape (p, p)."""
    curve = explanation.model.curves.values[0]
    known = 1.0 / (CURVE_STD * np.maximum(np.abs(curve), 1.0)) ** 2
    size = len(curve)
    prior = np.zeros((size + len(explanation.information),) * 2)
    prior[:size, :size] = np.diag(known)
    prior[size:, size:] = explanation.information
    return prior


class _PlannedRegression:
    """Rows of a predicted drive with the weights that real ones would get."""

    def __init__(self, data: RegressionData, setting: DriveSetting) -> None:
        (drive,) = data.drives
        self._data, self._setting = data, setting
        self._block = number_blocks(drive.t_s, setting.block_length_s)
        self._slip_std = drive.wheel_slip_std

    def scale(self, model: Model) -> Array:
        """Reciprocal standard deviation of each row's adhesion, shape (n,)."""
        evaluated = evaluate_model(self._data, model.curves, model.active_effects)
        slope = model.curves.slope(evaluated.slip, self._data.surface, evaluated.conditions)
        return np.asarray(1.0 / np.hypot(self._setting.noise, slope * self._slip_std))

    def gram(self, model: Model) -> Array:
        """Gram matrix of a model's whitened Jacobian and residual, shape (p + 1, p + 1)."""
        regression = self._build(model)
        return regression.compute_grams(regression.build_columns(model)).total

    def _build(self, model: Model) -> WhitenedRegression:
        data, size = self._data, len(self._data)
        evaluated = evaluate_model(data, model.curves)
        slope = model.curves.slope(evaluated.slip, data.surface, evaluated.conditions)
        ones, zeros = np.ones(size), np.zeros(size)
        (drive,) = data.drives
        runs = ContiguousRuns.find(
            drive.t_s, drive.axle.astype(np.float64), np.zeros(size, dtype=np.bool_)
        )
        return WhitenedRegression(
            data,
            self.scale(model),
            zeros,
            design_speed_errors(data, evaluated, slope, self._setting.block_length_s),
            np.array([self._setting.speed_error.std]),
            zeros,
            Whitener(np.array([1.0]), runs),
            ones,
            self._block,
        )


def _fit_rival(
    regression: _PlannedRegression, drive: PlannedDrive, rival: Explanation
) -> FittedRival:
    """Fit a rival by shortened Gauss-Newton steps; the prior holds it near its estimates."""
    prior, model = _prior(rival), rival.model
    before = model.parameter_vector

    def cost(model: Model) -> tuple[Array, float]:
        gram, away = regression.gram(model), model.parameter_vector - before
        gram = gram.copy()
        # The prior's pull belongs to the gradient and to the square.
        gram[:-1, -1] -= prior @ away
        gram[-1, :-1] = gram[:-1, -1]
        gram[-1, -1] += float(away @ prior @ away)
        return gram, float(gram[-1, -1])

    gram, square = cost(model)
    for _ in range(ITERATIONS):
        change, _left = minimise(gram, prior)
        tried, share = model, 1.0
        lower = False
        while share > 0.05 and not lower:
            tried = model.with_parameters(model.parameter_vector + share * change)
            tried_gram, tried_square = cost(tried)
            lower = tried_square < square
            share /= 3.0
        if not lower:
            break
        done = square - tried_square < 1e-3 * square
        model, gram, square = tried, tried_gram, tried_square
        if done:
            break
    evaluated = evaluate_model(drive.data, model.curves, model.active_effects)
    return FittedRival(square, drive, evaluated.residual, regression.scale(model))


def add_grams(grams: Mapping[Pair, Array], other: Mapping[Pair, Array]) -> dict[Pair, Array]:
    """Sums of the Gram matrices of two parts."""
    return {pair: gram + other[pair] for pair, gram in grams.items()}
