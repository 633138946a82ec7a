"""The paper's three experiments: rails of known truth, and every estimator over the same data.

Experiment 1 has one surface and a slip that rises through the run; experiments 2 and 3 have blocks
of data on a rail that switches suddenly, twice. The paper's N(0, 0.01) is read both ways, as a
standard deviation and as a variance. What its Table 1 does not tell, the surfaces, are ours.

Nothing here touches a file or a clock: the clock that times the updates is handed in.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from itertools import pairwise
from math import inf
from typing import Any

import numpy as np

from adhesion_can.arrays import Array
from adhesion_can.estimation.differential_evolution import (
    EvolutionSettings,
    identify_blocks,
    identify_sequence,
)
from adhesion_can.estimation.estimator import Estimator
from adhesion_can.estimation.identifiability import IdentifiabilitySettings
from adhesion_can.estimation.likelihood import standard_errors
from adhesion_can.estimation.registry import EstimatorSettings
from adhesion_can.physics.burckhardt import adhesion, peak
from adhesion_can.physics.samples import Samples

Theta = tuple[float, float, float]
Clock = Callable[[], float]
"""Seconds from any origin."""

Factory = Callable[[EstimatorSettings], Estimator]
ToldFactory = Callable[[EstimatorSettings, tuple[int, ...]], Estimator]
"""Makes an estimator that is told when the rail changes: stamps of the first samples after, µs."""

QUANTITIES = ("c1", "c2", "c3", "mu_max", "lambda_m")
"""What is compared, in the order of the columns of every array of values."""

MU_MAX = QUANTITIES.index("mu_max")
SURFACES: tuple[Theta, ...] = ((0.5, 30.0, 0.08), (0.25, 20.0, 0.10), (0.4, 40.0, 0.06))
SLIP_MAX = IdentifiabilitySettings().slip_max
"""End of the range in which a peak is looked for, as estimators have it."""

RATE_HZ = 600
"""Samples a second: six axles, 100 Hz each."""

WITHIN_SEQUENCE, WITHIN_BLOCKS = 0.10, 0.05
"""Shares of the truth within which a value counts as found: of experiment 1, of 2 and 3."""

FIRST_RUNS: Mapping[str, int] = {"scipy-de": 5}
"""Estimators that are so slow that they take part in the first runs only."""


@dataclass(frozen=True, slots=True)
class Experiment:
    """One of the paper's experiments.

    Attributes:
        number: the paper's.
        surfaces: (c1, c2, c3) of the rails, one after the other.
        blocks: on each surface.
        block: samples of a block.
        slip_max: end of the slips, which are uniform in 0..slip_max or rise to it.
        ramp: whether they rise; then estimators get single samples, else blocks.
        theta0: where an estimator that has a start starts; None: anywhere.
        noise_stds: standard deviations of the noise, one world each.
        detail: samples of an update in the closer look at a switch.
        detail_before: blocks before a switch that the closer look begins with.
        detail_after: blocks after it that it ends with.
        detail_runs: the first runs, which have the closer look.

    """

    number: int
    surfaces: tuple[Theta, ...]
    blocks: int
    block: int = 500
    slip_max: float = 0.2
    ramp: bool = False
    theta0: Theta | None = None
    noise_stds: tuple[float, ...] = (0.01, 0.1)
    detail: int = 12
    detail_before: int = 5
    detail_after: int = 3
    detail_runs: int = 20

    @property
    def update(self) -> int:
        """Samples of an update."""
        return 1 if self.ramp else self.block

    @property
    def updates(self) -> int:
        """Number of updates."""
        return len(self.surfaces) * self.blocks * self.block // self.update

    @property
    def switches(self) -> tuple[int, ...]:
        """Numbers of the samples that are the first on a new surface."""
        return tuple(i * self.blocks * self.block for i in range(1, len(self.surfaces)))

    def truth(self) -> Array:
        """True values of `QUANTITIES` at each update, shape (updates, 5)."""
        each = self.updates // len(self.surfaces)
        return np.repeat(with_peak(np.array(self.surfaces)), each, axis=0)


EXPERIMENTS: Mapping[int, Experiment] = {
    1: Experiment(1, SURFACES[:1], blocks=1, slip_max=0.5, ramp=True),
    2: Experiment(2, SURFACES, blocks=50, theta0=SURFACES[0]),
    3: Experiment(3, SURFACES, blocks=50, theta0=SURFACES[0]),
}


def with_peak(theta: Array) -> Array:
    """(c1, c2, c3) rows with their peak beside them (eq. 6): shape (n, 5) from (n, 3)."""
    c1, c2, c3 = theta.T
    top = peak(c1, c2, c3, SLIP_MAX)
    return np.column_stack([theta, top.mu_max, top.lambda_m])


@dataclass(frozen=True, slots=True)
class World:
    """Data of one run.

    Attributes:
        samples: in their order, `RATE_HZ` a second.
        block: samples of a block.
        theta0: true or not, where an estimator that has a start starts.
        changes_us: stamps of the first sample on each new surface, µs.
        seed: for estimators that draw random numbers.

    """

    samples: Samples
    block: int
    theta0: Theta | None
    changes_us: tuple[int, ...]
    seed: int


def world(experiment: Experiment, noise_std: float, run: int, seed: int) -> World:
    """Data of a run; slips and noise are the same for every noise level, but for its size."""
    rng = np.random.default_rng([seed, run])
    n = len(experiment.surfaces) * experiment.blocks * experiment.block
    if experiment.ramp:
        h = np.linspace(0.0, experiment.slip_max, n)
    else:
        h = rng.uniform(0.0, experiment.slip_max, n)
    theta = np.repeat(np.array(experiment.surfaces), n // len(experiment.surfaces), axis=0)
    z = adhesion(h, *theta.T) + noise_std * rng.standard_normal(n)
    stamps = np.round(np.arange(n) * (1e6 / RATE_HZ)).astype(np.int64)
    return World(
        samples=Samples.curve(h, z, stamps),
        block=experiment.block,
        theta0=experiment.theta0,
        changes_us=tuple(int(stamps[k]) for k in experiment.switches),
        seed=int(rng.integers(2**31)),
    )


# ------------------------------------------------------------------------- who takes part

Follow = Callable[[World, int, Clock], tuple[Array, Array]]
"""Runs over the samples of a world in updates of a size: values (updates, 5), NaN where there is no
estimate, and the seconds of each update (updates,)."""


@dataclass(frozen=True, slots=True)
class Contender:
    """One that takes part.

    Attributes:
        follow: see there.
        streams: whether it takes updates of any size, so that the closer look can be taken.
        first_runs: takes part in so many runs only.

    """

    follow: Follow
    streams: bool = True
    first_runs: float = inf


def contenders(
    experiment: Experiment, estimators: Mapping[str, Factory], oracle: ToldFactory | None = None
) -> dict[str, Contender]:
    """Everyone who takes part, by name: estimators, the bare paper, and who is told the changes.

    Args:
        experiment: see there.
        estimators: by name.
        oracle: our estimator, told when the rail changes; it shows what not knowing costs.

    """
    found = {
        name: Contender(online(factory), first_runs=FIRST_RUNS.get(name, inf))
        for name, factory in estimators.items()
    }
    if oracle is not None and not experiment.ramp:
        found["oracle"] = Contender(partial(_follow_online, oracle))
    for name, changes in _BARE[experiment.number].items():
        found[name] = Contender(partial(_follow_bare, changes), streams=False)
    return found


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
"""The paper's algorithm alone, without a service's doubt around it: settings of the search."""


def online(factory: Factory) -> Follow:
    """How an estimator behind the protocol follows a world."""
    return partial(_follow_online, lambda settings, _: factory(settings))


def _follow_online(
    factory: ToldFactory, world: World, size: int, clock: Clock
) -> tuple[Array, Array]:
    search = EvolutionSettings(theta0=world.theta0, seed=world.seed, block=world.block)
    estimator = factory(EstimatorSettings(evolution=search), world.changes_us)
    starts = range(0, len(world.samples), size)
    values, seconds = np.full((len(starts), len(QUANTITIES)), np.nan), np.empty(len(starts))
    for i, start in enumerate(starts):
        part = world.samples.select(slice(start, start + size))
        began = clock()
        e = estimator.update(part, int(part.t_us[-1]))
        seconds[i] = clock() - began
        if e is not None:
            values[i] = (*e.theta, e.mu_max, e.lambda_m)
    return values, seconds


def _follow_bare(
    changes: Mapping[str, Any], world: World, size: int, clock: Clock
) -> tuple[Array, Array]:
    settings = EvolutionSettings(theta0=world.theta0, seed=world.seed, block=size, **changes)
    identify = identify_sequence if size == 1 else identify_blocks
    began = clock()
    theta = identify(*world.samples.folded(), settings)
    mean = (clock() - began) / len(theta)
    return with_peak(theta), np.full(len(theta), mean)


# ---------------------------------------------------------------------------------- runs


@dataclass(frozen=True, slots=True)
class Track:
    """What one contender made of one world.

    Attributes:
        values: of `QUANTITIES` after each update, shape (updates, 5); NaN without an estimate.
        seconds: that each update took, shape (updates,).
        samples_needed: after each switch, until μ_max was found, shape (switches,); inf: not
            within the closer look. None where that was not taken.

    """

    values: Array
    seconds: Array
    samples_needed: Array | None = None


def run_once(
    experiment: Experiment,
    noise_std: float,
    run: int,
    seed: int,
    who: Mapping[str, Contender],
    clock: Clock,
) -> dict[str, Track]:
    """One run: all contenders over the same data.

    Args:
        experiment: see there.
        noise_std: standard deviation of the noise, in adhesion.
        run: its number, from 0.
        seed: of all runs.
        who: takes part, by name.
        clock: times the updates.

    """
    data = world(experiment, noise_std, run, seed)
    tracks = {}
    for name, contender in who.items():
        if run >= contender.first_runs:
            continue
        values, seconds = contender.follow(data, experiment.update, clock)
        needed = None
        if contender.streams and experiment.switches and run < experiment.detail_runs:
            looks = [_closer(experiment, data, contender, i, clock) for i in _switches(experiment)]
            needed = np.array(looks)
        tracks[name] = Track(values, seconds, needed)
    return tracks


def _switches(experiment: Experiment) -> range:
    return range(len(experiment.switches))


def _closer(
    experiment: Experiment, data: World, contender: Contender, switch: int, clock: Clock
) -> float:
    """Samples after a switch until μ_max is within reach of the truth and stays there."""
    at, size = experiment.switches[switch], experiment.detail
    begin = max(at - experiment.detail_before * experiment.block, 0)
    cut = slice(begin, at + experiment.detail_after * experiment.block)
    part = World(
        data.samples.select(cut),
        data.block,
        None if data.theta0 is None else experiment.surfaces[switch],
        (data.changes_us[switch],),
        data.seed,
    )
    values, _ = contender.follow(part, size, clock)
    # The first update that ends behind the switch.
    first = (at - begin) // size
    truth = with_peak(np.array(experiment.surfaces[switch + 1 : switch + 2]))[0, MU_MAX]
    updates = settling(values[first:, MU_MAX], truth, WITHIN_BLOCKS)
    return (first + updates) * size - (at - begin)


def settling(values: Array, truth: float, share: float) -> float:
    """Number of updates until a value is within a share of the truth and stays there; inf: never.

    Args:
        values: after each update, shape (n,); NaN is not within.
        truth: the true value.
        share: of it.

    """
    outside = np.flatnonzero(~(np.abs(values - truth) <= share * abs(truth)))
    last = int(outside[-1]) if len(outside) else -1
    return last + 2 if last + 1 < len(values) else inf


def bound(experiment: Experiment, noise_std: float, seed: int) -> Array:
    """Cramér-Rao bound of all samples since the last switch, as standard deviations.

    No unbiased estimator that is told the changes has a smaller variance; one that begins near the
    truth may.

    Returns:
        Of `QUANTITIES`, with the slips of the first run: shape (updates, 5), inf where unknown.

    """
    h, _ = world(experiment, noise_std, 0, seed).samples.folded()
    edges = (0, *experiment.switches, len(h))
    rows = []
    for theta, (begin, end) in zip(experiment.surfaces, pairwise(edges), strict=True):
        for k in range(begin + experiment.update, end + 1, experiment.update):
            errors = standard_errors(theta, h[begin:k], noise_std, SLIP_MAX)
            stds = np.sqrt(errors.covariance.diagonal())
            rows.append((*stds, errors.mu_max, errors.lambda_m))
    return np.array(rows)
