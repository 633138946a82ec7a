"""Runs of the paper's experiments: all estimators over the same simulated data.

Nothing here touches a file or a clock: the clock that times the updates is an argument.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from itertools import pairwise
from math import inf
from typing import Any

import numpy as np

from adhesion_can.arrays import Array
from adhesion_can.estimation.baselines.settings import EvolutionSettings
from adhesion_can.estimation.differential_evolution import (
    identify_all_data,
    identify_blocks,
    identify_sequence,
)
from adhesion_can.estimation.estimator import Estimator
from adhesion_can.estimation.likelihood import standard_errors
from adhesion_can.estimation.registry import EstimatorSettings, MakeEstimator
from adhesion_can.experiments.simulated_data import (
    MU_MAX,
    QUANTITIES,
    SLIP_MAX,
    WITHIN_BLOCKS,
    Experiment,
    ExperimentData,
    simulate_data,
    with_peak,
)

Clock = Callable[[], float]
"""Current time in seconds, from any origin."""

IdentifyBlocks = Callable[[Array, Array, EvolutionSettings], Array]
"""Estimates θ̂(k), shape (blocks, 3), from slip ratios and adhesion in blocks, shape (n,) each."""

MakeInformedEstimator = Callable[[EstimatorSettings, tuple[int, ...]], Estimator]
"""Factory of an estimator that knows the changes: stamps of the first sample after each, µs."""

FIRST_RUNS: Mapping[str, int] = {"scipy-de": 5}
"""Number of runs of the estimators that are too slow for all runs."""

RunEstimator = Callable[[ExperimentData, int, Clock], tuple[Array, Array]]
"""Runs an estimator over data in updates of a given number of samples.

Returns the values after each update, shape (updates, 5), NaN without an estimate, and the duration
of each update, s, shape (updates,).
"""


@dataclass(frozen=True, slots=True)
class Participant:
    """An estimator that takes part in an experiment.

    Attributes:
        run: Function that runs the estimator over the data of a run.
        streams: Whether the estimator accepts updates of any size, so that fine-grained runs are
            possible.
        first_runs: Number of runs, from the first, in which the estimator takes part.

    """

    run: RunEstimator
    streams: bool = True
    first_runs: float = inf


def participants(
    experiment: Experiment,
    estimators: Mapping[str, MakeEstimator],
    oracle: MakeInformedEstimator | None = None,
) -> dict[str, Participant]:
    """All participants by name: estimators, the bare algorithm of the paper, and the oracle.

    Args:
        experiment: Experiment in which they take part.
        estimators: Factories of the estimators by name.
        oracle: Factory of an estimator that knows when the surface changes; its lead over the same
            estimator without that knowledge is the cost of detection.

    """
    by_name = {
        name: Participant(streaming(factory), first_runs=FIRST_RUNS.get(name, inf))
        for name, factory in estimators.items()
    }
    if oracle is not None and not experiment.ramp:
        by_name["oracle"] = Participant(partial(_run_streaming, oracle))
    identify = identify_sequence if experiment.ramp else identify_blocks
    for name, overrides in _BARE[experiment.number].items():
        by_name[name] = Participant(partial(_run_search, identify, overrides), streams=False)
    if not experiment.ramp:
        for name, identify in ((ONE_SAMPLE, _identify_one_sample), (ALL_DATA, identify_all_data)):
            run = partial(_run_search, identify, _SEQUENCE[experiment.number])
            by_name[name] = Participant(run, streams=False)
    return by_name


_ORDINARY: Mapping[str, Any] = {"start": "uniform", "factor": 0.5}
_BARE: Mapping[int, Mapping[str, Mapping[str, Any]]] = {
    1: {"paper (sequence)": {}},
    2: {"paper (ordinary)": _ORDINARY},
    3: {
        "paper (ordinary)": _ORDINARY,
        "paper (mean)": {"innovation": "mean"},
        "paper (sum)": {"innovation": "sum"},
    },
}
"""Settings of the search for the paper's bare algorithm, without verdicts or change detection."""
ONE_SAMPLE, ALL_DATA = "paper (sequence)", "paper (all data)"
"""Sequence processing beside the blocks of experiments 2 and 3: a sample in place of each block,
and all samples of the blocks so far in one sum."""
_SEQUENCE: Mapping[int, Mapping[str, Any]] = {2: _ORDINARY, 3: {}}
"""Settings of the search for sequence processing, by experiment."""


def streaming(factory: MakeEstimator) -> RunEstimator:
    """Function that runs an `Estimator` over the data of a run."""
    return partial(_run_streaming, lambda settings, _: factory(settings))


def _run_streaming(
    factory: MakeInformedEstimator, data: ExperimentData, size: int, clock: Clock
) -> tuple[Array, Array]:
    search = EvolutionSettings(theta0=data.theta0, seed=data.seed, block=data.block)
    estimator = factory(EstimatorSettings(evolution=search), data.changes_us)
    starts = range(0, len(data.samples), size)
    values, seconds = np.full((len(starts), len(QUANTITIES)), np.nan), np.empty(len(starts))
    for i, start in enumerate(starts):
        part = data.samples.select(slice(start, start + size))
        began = clock()
        estimate = estimator.update(part, int(part.t_us[-1]))
        seconds[i] = clock() - began
        if estimate is not None:
            values[i] = (*estimate.theta, estimate.mu_max, estimate.lambda_m)
    return values, seconds


def _run_search(
    identify: IdentifyBlocks,
    overrides: Mapping[str, Any],
    data: ExperimentData,
    size: int,
    clock: Clock,
) -> tuple[Array, Array]:
    settings = EvolutionSettings(theta0=data.theta0, seed=data.seed, block=size, **overrides)
    began = clock()
    theta = identify(*data.samples.folded(), settings)
    mean = (clock() - began) / len(theta)
    return with_peak(theta), np.full(len(theta), mean)


def _identify_one_sample(h: Array, z: Array, settings: EvolutionSettings) -> Array:
    """Sequence processing with one sample, the first, of each block: θ̂(k) from k samples."""
    return identify_sequence(h[:: settings.block], z[:: settings.block], settings)


@dataclass(frozen=True, slots=True)
class EstimatorRun:
    """Results of one participant over the data of one run.

    Attributes:
        values: `QUANTITIES` after each update, shape (updates, 5); NaN without an estimate.
        seconds: Duration of each update, s, shape (updates,).
        samples_needed: Number of samples after each switch until μ_max is found, shape (switches,);
            inf: not within the fine-grained run. None where there was no such run.

    """

    values: Array
    seconds: Array
    samples_needed: Array | None = None


def run_once(
    experiment: Experiment,
    noise_std: float,
    run: int,
    seed: int,
    participants_by_name: Mapping[str, Participant],
    clock: Clock,
) -> dict[str, EstimatorRun]:
    """One run: all participants over the same data.

    Args:
        experiment: Experiment of which this is a run.
        noise_std: Standard deviation of the adhesion noise, 1.
        run: Number of the run, from 0.
        seed: Seed of all runs.
        participants_by_name: Participants by name.
        clock: Clock that times the updates.

    """
    data = simulate_data(experiment, noise_std, run, seed)
    runs = {}
    for name, participant in participants_by_name.items():
        if run >= participant.first_runs:
            continue
        values, seconds = participant.run(data, experiment.update, clock)
        needed = None
        if participant.streams and experiment.switches and run < experiment.detail_runs:
            needed = np.array(
                [
                    _samples_needed(experiment, data, participant, switch, clock)
                    for switch in range(len(experiment.switches))
                ]
            )
        runs[name] = EstimatorRun(values, seconds, needed)
    return runs


def _samples_needed(
    experiment: Experiment,
    data: ExperimentData,
    participant: Participant,
    switch: int,
    clock: Clock,
) -> float:
    """Samples after a switch until μ_max is within 5 % of the truth and stays there.

    The participant runs again over the blocks around the switch, in updates of few samples.
    """
    at, size = experiment.switches[switch], experiment.detail
    begin = max(at - experiment.detail_before * experiment.block, 0)
    cut = slice(begin, at + experiment.detail_after * experiment.block)
    part = ExperimentData(
        samples=data.samples.select(cut),
        block=data.block,
        theta0=None if data.theta0 is None else experiment.surfaces[switch],
        changes_us=(data.changes_us[switch],),
        seed=data.seed,
    )
    values, _ = participant.run(part, size, clock)
    # The first update that ends behind the switch.
    first = (at - begin) // size
    truth = with_peak(np.array(experiment.surfaces[switch + 1 : switch + 2]))[0, MU_MAX]
    updates = updates_until_settled(values[first:, MU_MAX], truth, WITHIN_BLOCKS)
    return (first + updates) * size - (at - begin)


def updates_until_settled(values: Array, truth: float, share: float) -> float:
    """Number of updates until a value is within a share of the truth and stays there; inf: never.

    Args:
        values: Values after each update, shape (n,); NaN counts as outside.
        truth: True value.
        share: Largest relative error.

    """
    outside = np.flatnonzero(~(np.abs(values - truth) <= share * abs(truth)))
    last = int(outside[-1]) if len(outside) else -1
    return last + 2 if last + 1 < len(values) else inf


def cramer_rao_bound(experiment: Experiment, noise_std: float, seed: int) -> Array:
    """Cramér-Rao bound of all samples since the last switch, as standard deviations.

    No unbiased estimator that knows the changes has a smaller variance; one that starts near the
    truth may.

    Returns:
        Standard deviations of `QUANTITIES` for the slips of the first run, shape (updates, 5); inf
        where the samples do not determine a quantity.

    """
    h, _ = simulate_data(experiment, noise_std, 0, seed).samples.folded()
    edges = (0, *experiment.switches, len(h))
    rows = []
    for theta, (begin, end) in zip(experiment.surfaces, pairwise(edges), strict=True):
        for k in range(begin + experiment.update, end + 1, experiment.update):
            errors = standard_errors(theta, h[begin:k], noise_std, SLIP_MAX)
            stds = np.sqrt(errors.covariance.diagonal())
            rows.append((*stds, errors.mu_max, errors.lambda_m))
    return np.array(rows)
