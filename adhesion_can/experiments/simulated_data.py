"""The paper's three experiments: surfaces, slips and noise, and the data simulated from them.

Experiment 1 has one surface and a slip that rises through the run; experiments 2 and 3 have blocks
of data on a surface that switches suddenly, twice. The paper's N(0, 0.01) is read both ways, as a
standard deviation and as a variance. Its Table 1 is not available, so the surfaces are our choice.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from adhesion_can.arrays import Array
from adhesion_can.estimation.identifiability import IdentifiabilitySettings
from adhesion_can.physics.burckhardt import CurveParameters, adhesion, peak
from adhesion_can.physics.samples import Samples

QUANTITIES = ("c1", "c2", "c3", "mu_max", "lambda_m")
"""Quantities that are compared, in the order of the columns of every array of values."""

MU_MAX = QUANTITIES.index("mu_max")
SURFACES: tuple[CurveParameters, ...] = ((0.5, 30.0, 0.08), (0.25, 20.0, 0.10), (0.4, 40.0, 0.06))
SLIP_MAX = IdentifiabilitySettings().slip_max
"""End of the range of slip in which a peak is looked for; the default of the estimators."""

RATE_HZ = 600
"""Sampling rate, 1/s: six axles with 100 Hz each."""

WITHIN_SEQUENCE, WITHIN_BLOCKS = 0.10, 0.05
"""Relative error within which a value counts as found, in experiment 1 and in 2 and 3."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Experiment:
    """One of the paper's experiments.

    Attributes:
        number: Number of the experiment in the paper, 1..3.
        surfaces: Parameters (c1, c2, c3) of the surfaces, one after the other.
        blocks: Number of blocks on each surface.
        block: Number of samples of a block.
        slip_max: Largest slip ratio; slips are uniform in 0..slip_max, or rise to it.
        ramp: Whether the slip rises through the run; estimators then get single samples, else
            blocks.
        theta0: Parameters (c1, c2, c3) at which estimators with a start start; None: anywhere.
        noise_stds: Standard deviations of the adhesion noise, one experiment each, 1.
        detail: Number of samples per update in the fine-grained run over a switch.
        detail_before: Number of blocks before the switch at which the fine-grained run starts.
        detail_after: Number of blocks after the switch at which the fine-grained run ends.
        detail_runs: Number of runs, from the first, that have fine-grained runs.

    """

    number: int
    surfaces: tuple[CurveParameters, ...]
    blocks: int
    block: int = 500
    slip_max: float = 0.2
    ramp: bool = False
    theta0: CurveParameters | None = None
    noise_stds: tuple[float, ...] = (0.01, 0.1)
    detail: int = 12
    detail_before: int = 5
    detail_after: int = 3
    detail_runs: int = 20

    @property
    def update(self) -> int:
        """Number of samples of an update."""
        return 1 if self.ramp else self.block

    @property
    def updates(self) -> int:
        """Number of updates."""
        return len(self.surfaces) * self.blocks * self.block // self.update

    @property
    def switches(self) -> tuple[int, ...]:
        """Indices of the samples that are the first on a new surface."""
        return tuple(i * self.blocks * self.block for i in range(1, len(self.surfaces)))

    def truth(self) -> Array:
        """True values of `QUANTITIES` at each update, shape (updates, 5)."""
        each = self.updates // len(self.surfaces)
        return np.repeat(with_peak(np.array(self.surfaces)), each, axis=0)


EXPERIMENTS: Mapping[int, Experiment] = {
    1: Experiment(number=1, surfaces=SURFACES[:1], blocks=1, slip_max=0.5, ramp=True),
    2: Experiment(number=2, surfaces=SURFACES, blocks=50, theta0=SURFACES[0]),
    3: Experiment(number=3, surfaces=SURFACES, blocks=50, theta0=SURFACES[0]),
}


def with_peak(theta: Array) -> Array:
    """Rows (c1, c2, c3, μ_max, λ_m) from rows (c1, c2, c3) by eq. 6; shape (n, 5) from (n, 3)."""
    c1, c2, c3 = theta.T
    top = peak(c1, c2, c3, SLIP_MAX)
    return np.column_stack([theta, top.mu_max, top.lambda_m])


@dataclass(frozen=True, slots=True, kw_only=True)
class ExperimentData:
    """Simulated data of one run.

    Attributes:
        samples: Samples in the order of their stamps, `RATE_HZ` per second.
        block: Number of samples of a block.
        theta0: Parameters (c1, c2, c3) at which estimators with a start start, right or wrong;
            None: anywhere.
        changes_us: Stamps of the first sample on each new surface, µs.
        seed: Seed for estimators that draw random numbers.

    """

    samples: Samples
    block: int
    theta0: CurveParameters | None
    changes_us: tuple[int, ...]
    seed: int


def simulate_data(experiment: Experiment, noise_std: float, run: int, seed: int) -> ExperimentData:
    """Data of a run; slips and scaled noise are the same at every noise level."""
    rng = np.random.default_rng([seed, run])
    n = len(experiment.surfaces) * experiment.blocks * experiment.block
    if experiment.ramp:
        h = np.linspace(0.0, experiment.slip_max, n)
    else:
        h = rng.uniform(0.0, experiment.slip_max, n)
    theta = np.repeat(np.array(experiment.surfaces), n // len(experiment.surfaces), axis=0)
    z = adhesion(h, *theta.T) + noise_std * rng.standard_normal(n)
    stamps = np.round(np.arange(n) * (1e6 / RATE_HZ)).astype(np.int64)
    return ExperimentData(
        samples=Samples.curve(h, z, stamps),
        block=experiment.block,
        theta0=experiment.theta0,
        changes_us=tuple(int(stamps[k]) for k in experiment.switches),
        seed=int(rng.integers(2**31)),
    )
