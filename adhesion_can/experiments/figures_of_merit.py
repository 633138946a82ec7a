"""Figures of merit of the experiments: errors against the truth, and how fast it is found."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from adhesion_can.arrays import Array
from adhesion_can.experiments.runs import EstimatorRun, cramer_rao_bound, updates_until_settled
from adhesion_can.experiments.simulated_data import (
    MU_MAX,
    QUANTITIES,
    WITHIN_BLOCKS,
    WITHIN_SEQUENCE,
    Experiment,
)


@dataclass(frozen=True, slots=True)
class EstimatorResult:
    """Results of one participant over all its runs at one noise level.

    Attributes:
        name: Name of the participant.
        values: `QUANTITIES` after each update of each run, shape (runs, updates, 5).
        seconds: Duration of each update, s, shape (runs, updates).
        samples_needed: Number of samples after each switch until μ_max is found, shape (runs with
            fine-grained runs, switches); None where there were none.

    """

    name: str
    values: Array
    seconds: Array
    samples_needed: Array | None

    @property
    def runs(self) -> int:
        """Number of runs."""
        return len(self.values)

    @property
    def is_late(self) -> bool:
        """Whether no run has an estimate before its last update."""
        return not np.isfinite(self.values[:, :-1]).any()


@dataclass(frozen=True, slots=True, kw_only=True)
class NoiseLevelResult:
    """Results of an experiment at one noise level.

    Attributes:
        experiment: Experiment that was run.
        noise_std: Standard deviation of the adhesion noise, 1.
        seed: Seed of all runs.
        bound: Cramér-Rao bound as standard deviations of `QUANTITIES`, shape (updates, 5).
        results: Results of each participant.

    """

    experiment: Experiment
    noise_std: float
    seed: int
    bound: Array
    results: tuple[EstimatorResult, ...]

    @property
    def truth(self) -> Array:
        """True values of `QUANTITIES`, shape (updates, 5)."""
        return self.experiment.truth()


def collect_runs(
    experiment: Experiment, noise_std: float, seed: int, runs: Sequence[Mapping[str, EstimatorRun]]
) -> NoiseLevelResult:
    """Result of one noise level from its runs, at least one, in the order of their numbers."""
    results = []
    for name in runs[0]:
        estimator_runs = [run[name] for run in runs if name in run]
        needed = [run.samples_needed for run in estimator_runs if run.samples_needed is not None]
        results.append(
            EstimatorResult(
                name,
                np.array([run.values for run in estimator_runs]),
                np.array([run.seconds for run in estimator_runs]),
                np.array(needed) if needed else None,
            )
        )
    return NoiseLevelResult(
        experiment=experiment,
        noise_std=noise_std,
        seed=seed,
        bound=cramer_rao_bound(experiment, noise_std, seed),
        results=tuple(results),
    )


@dataclass(frozen=True)
class FiguresOfMerit:
    """Figures of merit of a set of runs; NaN where there was no estimate, inf for never.

    Attributes:
        rmse: Root mean square errors of `QUANTITIES`, shape (5,): over all updates; in experiment 1
            at the end of the run.
        rmse_steady: Root mean square errors without the first update after each switch, shape (5,).
        blocks_needed: Number of blocks after each switch until μ_max is within 5 % and stays there,
            shape (runs, switches).
        samples_needed: Number of samples after each switch until μ_max is within 5 % and stays
            there, from the fine-grained runs, shape (runs, switches); None without such runs.
        slip_needed: Slip ratio of experiment 1 from which on each quantity is within 10 %, shape
            (runs, 5); empty in the other experiments.
        update_ms: Median duration of an update, ms.
        answered: Share of the updates after which there was an estimate.

    """

    rmse: Array
    rmse_steady: Array
    blocks_needed: Array
    samples_needed: Array | None
    slip_needed: Array
    update_ms: float
    answered: float

    @cached_property
    def slip_quartiles(self) -> Array:
        """Quartiles of `slip_needed`, shape (3, 5)."""
        return np.array([quartiles(column) for column in self.slip_needed.T]).T


def compute_figures(
    result: EstimatorResult, outcome: NoiseLevelResult, runs: slice = slice(None)
) -> FiguresOfMerit:
    """Figures of merit of one participant, over all its runs or some of them."""
    experiment, values = outcome.experiment, result.values[runs]
    errors = values - outcome.truth
    samples_needed, needed = result.samples_needed, _updates_needed(values, outcome)
    if samples_needed is not None:
        samples_needed = samples_needed[runs] if len(samples_needed[runs]) else None
    if experiment.ramp:
        # The slip of the update that ended the search; NaN where it never ended.
        reached = np.where(np.isfinite(needed[:, 0]), needed[:, 0], np.nan) - 1
        slips = experiment.slip_max * reached / (experiment.updates - 1)
        slips = np.where(np.isnan(slips), np.inf, slips)
        errors = errors[:, -1:]
        steady = errors
    else:
        slips = np.empty((0, len(QUANTITIES)))
        after = [k // experiment.update for k in experiment.switches]
        steady = errors[:, np.setdiff1d(np.arange(experiment.updates), after)]
    return FiguresOfMerit(
        rmse=rms(errors, (0, 1)),
        rmse_steady=rms(steady, (0, 1)),
        blocks_needed=needed[:, 1:, MU_MAX],
        samples_needed=samples_needed,
        slip_needed=slips,
        update_ms=1e3 * float(np.median(result.seconds[runs])),
        answered=float(np.isfinite(values[..., MU_MAX]).mean()),
    )


def mean(values: Array, axis: int | tuple[int, ...]) -> Array:
    """Mean of the finite values; NaN where there are none."""
    known = np.isfinite(values)
    count = known.sum(axis)
    total = np.where(known, values, 0.0).sum(axis)
    nothing = np.full(count.shape, np.nan)
    return np.asarray(np.divide(total, count, out=nothing, where=count > 0))


def rms(errors: Array, axis: int | tuple[int, ...]) -> Array:
    """Root mean square of the finite values; NaN where there are none."""
    return np.sqrt(mean(errors**2, axis))


def quartiles(values: Array) -> Array:
    """Quartiles without interpolation, as values may be inf, shape (3,); NaN without values."""
    if not values.size:
        return np.full(3, np.nan)
    return np.asarray(np.quantile(values, [0.25, 0.5, 0.75], method="inverted_cdf"))


def _updates_needed(values: Array, outcome: NoiseLevelResult) -> Array:
    """Number of updates until each value is found and stays so, from the start of each surface.

    Args:
        values: `QUANTITIES` after each update, shape (runs, updates, 5).
        outcome: Result of the noise level of these runs.

    Returns:
        Numbers of updates, shape (runs, surfaces, 5); inf: never.

    """
    experiment, truth = outcome.experiment, outcome.truth
    share = WITHIN_SEQUENCE if experiment.ramp else WITHIN_BLOCKS
    each = experiment.updates // len(experiment.surfaces)
    needed = np.empty((len(values), len(experiment.surfaces), len(QUANTITIES)))
    for run, surface, q in np.ndindex(*needed.shape):
        k = surface * each
        needed[run, surface, q] = updates_until_settled(
            values[run, k : k + each, q], truth[k, q], share
        )
    return needed


def bound_slip(outcome: NoiseLevelResult) -> Array:
    """Slip of experiment 1 at which the bound's standard deviation falls below 10 %, shape (5,)."""
    share = outcome.bound / np.abs(outcome.truth)
    first = [updates_until_settled(1.0 + column, 1.0, WITHIN_SEQUENCE) for column in share.T]
    return (np.array(first) - 1) * outcome.experiment.slip_max / (outcome.experiment.updates - 1)
