"""Blocks of made-up samples for the tests of the doubt."""

from dataclasses import replace

import numpy as np

from adhesion_can.estimation.doubt.blocks import BlockSums
from adhesion_can.estimation.doubt.directions import ResidualDirection, build_directions
from adhesion_can.estimation.doubt.estimator import DoubtingTracker
from adhesion_can.estimation.doubt.rows import RowBuilder
from adhesion_can.estimation.tracker.tracker import Tracker
from adhesion_can.physics.burckhardt import peak
from adhesion_can.physics.estimate import Estimate
from adhesion_can.physics.samples import Samples

THETA = (0.41, 33.0, 0.38)
MU_MAX, LAMBDA_M = (float(x) for x in (peak(*THETA, 0.5).mu_max, peak(*THETA, 0.5).lambda_m))
STEP_S = 0.2
NOISE = 0.01
AXLES = 4
DIRECTIONS: tuple[ResidualDirection, ...] = build_directions(AXLES)
NAMES = [direction.name for direction in DIRECTIONS]


def curve(slip: np.ndarray, theta: tuple[float, float, float] = THETA) -> np.ndarray:
    """Signed adhesion of a curve."""
    c1, c2, c3 = theta
    size = np.abs(slip)
    return np.asarray(np.sign(slip) * (-c1 * np.expm1(-c2 * size) - c3 * size))


def make_samples(
    rng: np.random.Generator,
    seconds: float,
    *,
    begin_s: float = 0.0,
    lasting_s: float = 0.0,
    load_exponent: float = 0.0,
    speed_scale: float = 0.0,
    effort_bias: float = 0.0,
    theta: tuple[float, float, float] = THETA,
) -> Samples:
    """Samples of sweeps in traction and braking, 50 a second and axle.

    Args:
        rng: Random numbers.
        seconds: Duration, s.
        begin_s: Time of the first sample, s.
        lasting_s: Correlation time of the adhesion's errors, s; 0: they are independent.
        load_exponent: Exponent by which the adhesion falls with the load.
        speed_scale: Relative error of the vehicle speed.
        effort_bias: Bias of the effort, N.
        theta: Parameters of the curve.

    """
    t = begin_s + np.arange(round(50 * seconds)) / 50
    rows = np.repeat(t, AXLES)
    axle = np.tile(np.arange(1, AXLES + 1), len(t))
    direction = np.where(np.sin(2 * np.pi * rows / 23.0) >= 0.0, 1.0, -1.0)
    slip = direction * 0.12 * np.sin(2 * np.pi * rows / 7.0 + axle) ** 2
    speed = 10.0 + 4.0 * np.sin(2 * np.pi * rows / 41.0)
    load = 2.2e5 * (1.0 + 0.08 * np.sin(2 * np.pi * rows / 13.0 + 2.0 * axle))
    noise = rng.standard_normal((len(t), AXLES))
    if lasting_s:
        keep = np.exp(-1 / 50 / lasting_s)
        for k in range(1, len(noise)):
            noise[k] = keep * noise[k - 1] + np.sqrt(1 - keep**2) * noise[k]
    adhesion = curve(slip, theta) * (load / 2.2e5) ** -load_exponent
    adhesion = adhesion + effort_bias / load + NOISE * noise.ravel()
    measured = (1.0 + slip) / (1.0 + speed_scale) - 1.0
    stamps = np.round(rows * 1e6).astype(np.int64)
    return replace(
        Samples.curve(measured, adhesion, stamps),
        axle=axle.astype(np.int64),
        creep_speed=measured * speed,
        speed=speed,
        load=load,
        adhesion_var=np.full(len(rows), NOISE**2),
    )


def in_seconds(samples: Samples, seconds: float) -> list[Samples]:
    """Samples cut into parts of so many seconds."""
    part = ((samples.t_us - samples.t_us[0]) // round(seconds * 1e6)).astype(np.int64)
    return [samples.select(part == k) for k in np.unique(part)]


def make_blocks(
    samples: Samples, seconds: float = 1.0, theta: tuple[float, float, float] = THETA
) -> list[BlockSums]:
    """Blocks of so many seconds, with rows at the true curve."""
    builder = RowBuilder(DIRECTIONS, AXLES)
    return [
        BlockSums.from_rows(builder.build(part, theta, NOISE))
        for part in in_seconds(samples, seconds)
    ]


def run(
    estimator: DoubtingTracker | Tracker, samples: Samples, step_s: float = STEP_S
) -> list[Estimate]:
    """Estimates after each step of a drive."""
    found = []
    for part in in_seconds(samples, step_s):
        estimate = estimator.update(part, int(part.t_us[-1]) + 1)
        if estimate is not None:
            found.append(estimate)
    return found


def is_wrong(estimate: Estimate) -> bool:
    """Whether an identifiable peak is off by more than 3 standard deviations, 2 % and 5 %."""
    if not estimate.identifiable.both:
        return False
    mu, slip = abs(estimate.mu_max - MU_MAX), abs(estimate.lambda_m - LAMBDA_M)
    return (mu > 3 * estimate.mu_max_std and mu > 0.02 * MU_MAX) or (
        slip > 3 * estimate.lambda_m_std and slip > 0.05 * LAMBDA_M
    )
