"""Invariance: whether a cause has the same size in every environment.

A mechanism has one size wherever it acts. What only imitates it, in the mix of conditions of one
drive, has another size at another speed, load or creep (Peters, Bühlmann and Meinshausen, Journal
of the Royal Statistical Society B 78 (2016); Pfister, Bühlmann and Peters, JASA 114 (2019)). The
columns of the cause's parameters are split by environment, the curves and the other causes stay
common, and one Gauss-Newton step gives the size in each environment. Cochran's Q tests whether the
sizes differ, and the variance between them by DerSimonian and Laird (Controlled Clinical Trials 7
(1986)) says by how much. Both must be clear: with enough data every small error of form makes sizes
differ for certain.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import scipy

from adhesion_can.arrays import Array
from adhesion_can.diagnosis.refutation.environments import Partition
from adhesion_can.diagnosis.regression.effect_derivatives import compute_effect_jacobian
from adhesion_can.diagnosis.regression.gram_matrices import (
    BlockGramMatrices,
    solve_normal_equations,
)
from adhesion_can.diagnosis.regression.model import Model, remove_effect
from adhesion_can.diagnosis.regression.whitened_regression import WhitenedRegression
from adhesion_can.physics.parameter import Parameter

LEVEL = 0.01
"""Significance level at which sizes differ, all partitions counted (Bonferroni)."""
MOST_SPREAD = 0.3
"""Largest standard deviation of the sizes of environments, relative to the size. A size that rests
on a noisy derivative, as an inertia does, varies by 0.25 where the cause is true."""
LEAST_INFORMATION = 0.03
"""Share of the information on the size, below which an environment says nothing about it."""


LEAST_VARIANCE = 1e-12
"""Least variance of a size, relative to the largest one of a partition."""


@dataclass(frozen=True, eq=False)
class SizesByEnvironment:
    """Size of a cause in the environments of one partition.

    Attributes:
        partition: Name of the partition.
        parameter: Place of the parameter that varies most among the effect's free ones.
        labels: Description of each environment that shows something about the size.
        sizes: Value of that parameter in each of them, in its unit; shape (k,).
        stds: Standard deviations of the values; shape (k,).
        p_value: P-value of the differences, all partitions and parameters counted.
        spread: Standard deviation between environments, relative to the value in all of them.

    """

    partition: str
    parameter: int
    labels: tuple[str, ...]
    sizes: Array
    stds: Array
    p_value: float
    spread: float

    @property
    def refutes(self) -> bool:
        """Whether the sizes differ, for certain and by much."""
        return self.p_value < LEVEL and self.spread > MOST_SPREAD


def compute_sizes(
    regression: WhitenedRegression, model: Model, place: int, partitions: Sequence[Partition]
) -> list[SizesByEnvironment]:
    """Size of one effect of a model in every environment of every partition.

    Args:
        regression: Rows with weights, filter and blocks.
        model: Fitted model.
        place: Place of the effect among the model's.
        partitions: Partitions of the rows.

    Returns:
        Sizes of the partitions that have at least two environments with information on the size.

    """
    columns = regression.build_columns(model)
    effect_columns = range(
        model.first_parameter(place), model.first_parameter(place) + model.candidates[place].size
    )
    common = np.delete(columns, list(effect_columns), axis=1)
    jacobian = compute_effect_jacobian(
        regression.data,
        *remove_effect(model, place),
        regression.slip_correction,
        regression.evaluate_corrected(model),
    )
    parameters = model.candidates[place].free_parameters
    split = (_split(regression, common, jacobian, partition) for partition in partitions)
    sizes = [
        of_part
        for part in split
        if (of_part := part.sizes(parameters, model.values[place], len(partitions))) is not None
    ]
    return sorted(sizes, key=lambda sizes_of: -sizes_of.spread)


@dataclass(frozen=True, eq=False)
class _SplitEffect:
    """Gram matrices with the columns of an effect split by environment.

    Attributes:
        partition: Partition by which they are split.
        grams: Gram matrices: common columns, m columns for each environment, residual.
        common: Number of common columns.
        parameters: Number m of the effect's parameters.

    """

    partition: Partition
    grams: BlockGramMatrices
    common: int
    parameters: int

    def sizes(
        self, parameters: Sequence[Parameter], values: Sequence[float], tests: int
    ) -> SizesByEnvironment | None:
        """Sizes by environment; None where fewer than two have information on the size.

        Args:
            parameters: The effect's parameters, the size first.
            values: Their values with one size everywhere.
            tests: Number of partitions.

        """
        p, m = self.common, self.parameters
        split = range(p, self.grams.matrices.shape[1] - 1)
        projected = self.grams.project_out(range(p), split)
        total = self.grams.total
        information = projected.T @ total @ projected
        of_size = np.maximum(information.diagonal()[::m], 0.0)
        informed = of_size > LEAST_INFORMATION * of_size.sum()
        if np.count_nonzero(informed) < 2:
            return None
        change = solve_normal_equations(total[:-1, :-1], total[:-1, -1])[p:]
        covariance = self._covariance(projected, information)
        kept = np.repeat(informed, m)
        estimates = (np.tile(np.array(values), len(informed)) + change)[kept].reshape(-1, m)
        covariance = covariance[np.ix_(kept, kept)]
        individual_sizes = [
            self._of_parameter(j, parameters[j], values[j], estimates[:, j], covariance[j::m, j::m])
            for j in range(m)
            if j == 0 or _is_within(estimates[:, j], parameters[j])
        ]
        # Each parameter answers for itself: one that varies by chance is not refuted by another.
        counted = [
            replace(sizes_of, p_value=min(1.0, tests * len(individual_sizes) * sizes_of.p_value))
            for sizes_of in individual_sizes
        ]
        varying = max(counted, key=lambda sizes_of: (sizes_of.refutes, sizes_of.spread))
        labels = zip(self.partition.labels, informed, strict=True)
        return replace(varying, labels=tuple(label for label, is_informed in labels if is_informed))

    def _of_parameter(
        self, place: int, parameter: Parameter, value: float, estimates: Array, covariance: Array
    ) -> SizesByEnvironment:
        """One parameter in the environments, without their labels; nothing else is counted."""
        variances = covariance.diagonal()
        # An angle has no size of its own: its spread is relative to 1 rad.
        own_size = 1.0 if parameter.unit == "rad" else value
        return SizesByEnvironment(
            self.partition.name,
            place,
            (),
            estimates,
            np.sqrt(variances),
            _cochran(estimates, covariance, len(self.grams.rows)),
            _spread(estimates, variances, own_size),
        )

    def _covariance(self, projected: Array, information: Array) -> Array:
        """Covariance of the split parameters with the blocks as clusters, never below the plain."""
        p = self.common
        size = self.grams.matrices.shape[1]
        rest = self.grams.project_out(range(size - 1), [size - 1])[:, 0]
        scores = np.einsum("bij,j->bi", self.grams.matrices, rest) @ projected
        blocks = len(scores)
        inverse = solve_normal_equations(information, np.eye(len(information)))
        robust = inverse @ (scores.T @ scores) @ inverse * (blocks / max(blocks - 1, 1))
        square = float(rest @ self.grams.total @ rest)
        freedom = max(float(self.grams.rows.sum()) - p - projected.shape[1], 1.0)
        plain = inverse * (square / freedom)
        ratio = robust.diagonal() / np.maximum(plain.diagonal(), 1e-300)
        scale = np.sqrt(np.maximum(ratio, 1.0))
        return np.asarray(plain * np.outer(scale, scale))


def _split(
    regression: WhitenedRegression, common: Array, jacobian: Array, partition: Partition
) -> _SplitEffect:
    """Columns of an effect split by environment, before they are whitened.

    A filter works across the border of two environments, so masks come first.

    Args:
        regression: Rows with weights, filter and blocks.
        common: Whitened columns of curves and other effects, the residual last.
        jacobian: Columns of the effect, adhesion; shape (n, m).
        partition: Partition of the rows.

    """
    members = [partition.number == k for k in range(len(partition.labels))]
    split = np.column_stack([jacobian * rows[:, None] for rows in members])
    columns = [common[:, :-1], regression.whiten(split), common[:, -1]]
    grams = regression.compute_grams(np.column_stack(columns))
    return _SplitEffect(partition, grams, common.shape[1] - 1, jacobian.shape[1])


def _is_within(values: Array, parameter: Parameter) -> bool:
    """Whether values are within a parameter's range.

    The prediction is nearly linear in a size. In a time constant it is not, and a step beyond its
    range says only that the environment does not show it.
    """
    return bool(values.min() >= parameter.lower and values.max() <= parameter.upper)


def _cochran(estimates: Array, covariance: Array, blocks: int) -> float:
    """P-value of Cochran's Q for correlated estimates, by the F distribution.

    Args:
        estimates: A parameter by environment, shape (k,).
        covariance: Its covariance, shape (k, k).
        blocks: Number of blocks from which the covariance comes.

    """
    weight = solve_normal_equations(covariance, np.eye(len(covariance)))
    rest = estimates - float(weight.sum(axis=0) @ estimates) / max(float(weight.sum()), 1e-300)
    freedom = len(estimates) - 1
    statistic = float(rest @ weight @ rest) / freedom
    return float(scipy.stats.f.sf(statistic, freedom, max(blocks - freedom - 1, 1)))


def _spread(sizes: Array, variances: Array, size: float) -> float:
    """Standard deviation between environments by DerSimonian and Laird, relative to the size."""
    scale = float(variances.max())
    if not scale or not size:
        return 0.0
    # Relative to the largest variance, so that no weight overflows.
    weight = 1.0 / np.maximum(variances / scale, LEAST_VARIANCE)
    mean = float(weight @ sizes / weight.sum())
    q = float(weight @ (sizes - mean) ** 2) / scale
    denominator = float(weight.sum() - (weight**2).sum() / weight.sum())
    between = scale * max((q - (len(sizes) - 1)) / max(denominator, 1e-300), 0.0)
    return float(np.sqrt(between)) / abs(size)


def find_refuting(sizes: Sequence[SizesByEnvironment]) -> SizesByEnvironment | None:
    """The partition whose sizes refute a cause by the largest spread; None where none does."""
    return next((sizes_of for sizes_of in sizes if sizes_of.refutes), None)
