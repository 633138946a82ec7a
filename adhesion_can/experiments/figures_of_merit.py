"""Figures of merit of the experiments: errors against the truth, and how fast it is found."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from adhesion_can.arrays import Array
from adhesion_can.experiments.runs import (
    MU_MAX,
    QUANTITIES,
    WITHIN_BLOCKS,
    WITHIN_SEQUENCE,
    Experiment,
    Track,
    bound,
    settling,
)


@dataclass(frozen=True, slots=True)
class Result:
    """One contender over all its runs at one noise level.

    Attributes:
        name: of the contender.
        values: shape (runs, updates, 5), as in `Track`.
        seconds: shape (runs, updates).
        samples_needed: shape (runs with the closer look, switches); None where there were none.

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
    def says_nothing(self) -> bool:
        """Whether there was no estimate in any run before its last update."""
        return not np.isfinite(self.values[:, :-1]).any()


@dataclass(frozen=True, slots=True)
class Outcome:
    """An experiment at one noise level.

    Attributes:
        experiment: see there.
        noise_std: of the noise, in adhesion.
        seed: of all runs.
        bound: the Cramér-Rao bound, shape (updates, 5).
        results: one for each contender.

    """

    experiment: Experiment
    noise_std: float
    seed: int
    bound: Array
    results: tuple[Result, ...]

    @property
    def truth(self) -> Array:
        """True values, shape (updates, 5)."""
        return self.experiment.truth()


def outcome(
    experiment: Experiment, noise_std: float, seed: int, runs: Sequence[Mapping[str, Track]]
) -> Outcome:
    """Runs of one noise level together, at least one, in the order of their numbers."""
    results = []
    for name in runs[0]:
        tracks = [run[name] for run in runs if name in run]
        needed = [t.samples_needed for t in tracks if t.samples_needed is not None]
        results.append(
            Result(
                name,
                np.array([t.values for t in tracks]),
                np.array([t.seconds for t in tracks]),
                np.array(needed) if needed else None,
            )
        )
    limit = bound(experiment, noise_std, seed)
    return Outcome(experiment, noise_std, seed, limit, tuple(results))


@dataclass(frozen=True)
class Merit:
    """Figures of merit of a set of runs; NaN where there was no estimate, inf: never.

    Attributes:
        rmse: of `QUANTITIES`, shape (5,): over all updates; in experiment 1 at the end of the run.
        rmse_steady: the same without the first update after each switch.
        blocks_needed: until μ_max was within 5 % and stayed there, after each switch, shape
            (runs, switches).
        samples_needed: the same in samples, from the closer look; None where it was not taken.
        slip_needed: in experiment 1, the slip at which each value was within 10 % and stayed
            there, shape (runs, 5); empty in the others.
        update_ms: median time of an update.
        answered: share of the updates after which there was an estimate.

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


def merit(result: Result, made: Outcome, runs: slice = slice(None)) -> Merit:
    """Figures of merit of one contender, over all its runs or some of them."""
    experiment, values = made.experiment, result.values[runs]
    errors = values - made.truth
    looked, needed = result.samples_needed, _updates_needed(values, made)
    if looked is not None:
        looked = looked[runs] if len(looked[runs]) else None
    if experiment.ramp:
        # The slip of the update that ended the search; NaN where it never ended.
        reached = np.where(np.isfinite(needed[:, 0]), needed[:, 0], np.nan) - 1
        slips = experiment.slip_max * reached / (experiment.updates - 1)
        slips = np.where(np.isnan(slips), np.inf, slips)
        errors = errors[:, -1:]
        kept = errors
    else:
        slips = np.empty((0, len(QUANTITIES)))
        kept = errors[:, steady(experiment)]
    return Merit(
        rmse=rms(errors, (0, 1)),
        rmse_steady=rms(kept, (0, 1)),
        blocks_needed=needed[:, 1:, MU_MAX],
        samples_needed=looked,
        slip_needed=slips,
        update_ms=1e3 * float(np.median(result.seconds[runs])),
        answered=float(np.isfinite(values[..., MU_MAX]).mean()),
    )


def mean(values: Array, axis: int | tuple[int, ...]) -> Array:
    """Mean of what there is; NaN where there is nothing."""
    known = np.isfinite(values)
    count = known.sum(axis)
    total = np.where(known, values, 0.0).sum(axis)
    nothing = np.full(count.shape, np.nan)
    return np.asarray(np.divide(total, count, out=nothing, where=count > 0))


def rms(errors: Array, axis: int | tuple[int, ...]) -> Array:
    """Root mean square of what there is; NaN where there is nothing."""
    return np.sqrt(mean(errors**2, axis))


def quartiles(values: Array) -> Array:
    """Quartiles of what may be inf, without interpolation, shape (3,); NaN where there is none."""
    if not values.size:
        return np.full(3, np.nan)
    return np.asarray(np.quantile(values, [0.25, 0.5, 0.75], method="inverted_cdf"))


def steady(experiment: Experiment) -> Array:
    """Numbers of the updates without the first one after each switch."""
    after = [k // experiment.update for k in experiment.switches]
    return np.setdiff1d(np.arange(experiment.updates), after)


def _updates_needed(values: Array, made: Outcome) -> Array:
    """Updates until each value is found and stays so, from the begin of each surface.

    Args:
        values: shape (runs, updates, 5).
        made: what they are of.

    Returns:
        Shape (runs, surfaces, 5); inf: never.

    """
    experiment, truth = made.experiment, made.truth
    share = WITHIN_SEQUENCE if experiment.ramp else WITHIN_BLOCKS
    each = experiment.updates // len(experiment.surfaces)
    needed = np.empty((len(values), len(experiment.surfaces), len(QUANTITIES)))
    for run, surface, q in np.ndindex(*needed.shape):
        k = surface * each
        needed[run, surface, q] = settling(values[run, k : k + each, q], truth[k, q], share)
    return needed


def bound_slip(made: Outcome) -> Array:
    """Slip of experiment 1 at which the bound's standard deviation falls below 10 %, shape (5,)."""
    share = made.bound / np.abs(made.truth)
    first = [settling(1.0 + column, 1.0, WITHIN_SEQUENCE) for column in share.T]
    return (np.array(first) - 1) * made.experiment.slip_max / (made.experiment.updates - 1)
