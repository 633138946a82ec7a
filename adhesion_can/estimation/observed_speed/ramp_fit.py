"""The curve that the ramps of a relief show: adhesion of the axle against its slip.

While an axle gives its effort up and takes it back, its rim speed beside those of the others shows
its slip, from that of the effort held down to none. Wheel speeds are far more exact than efforts:
the adhesion is regressed on the slip, m λ/(a + λ) with m by linear least squares, at each a of a
grid (variable projection; Golub and Pereyra 1973).
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from adhesion_can.arrays import Array

GRID = np.geomspace(0.08, 12.0, 30)
"""Elasticities less 1, at the effort held, that are tried."""
SHARE_FREE, SHARE_HELD = 0.12, 0.85
"""Adhesion over the one held below which the axle is free, and above which it holds it."""
LEAST_EACH = 4
"""Least number of samples that are free, held, and on the ramps."""
LEAST_SLIP = 3e-4
"""Smallest slip held that shows a curve, 1."""
DEPENDENCE = 3.0
"""Factor of the variance, since errors by the rail are alike in neighbouring samples."""
SMOOTHED = 15
"""Samples over which the common effort is smoothed."""
STRAIGHT = 0.4
"""Error of ln a by a curve that is no hyperbola, where it was seen up to an elasticity of 2."""
WORST_FIT, WORST_SHARE = 2.0, 0.25
"""Largest residual over the noise of the effort, and over the adhesion held: by noise of wheels."""


@dataclass(frozen=True, slots=True)
class RampSamples:
    """Samples around a relief, of one drive.

    Attributes:
        log_rim: ln(r ω) of each axle, shape (n, axles).
        adhesion: Adhesion used by each axle, 1, along the direction in which it is positive.
        others: Axles that pulled all the time, apart from the one relieved.
        slip: Slip of each axle at the end of the samples, as far as it is known, shape (axles,).

    """

    log_rim: Array
    adhesion: Array
    others: list[int]
    slip: Array


@dataclass(frozen=True, slots=True)
class RampCurve:
    """Curve by the ramps.

    Attributes:
        log_half: Logarithm of the slip a of the hyperbola.
        variance: Variance of that logarithm by the noise of the efforts, and by the form of the
            curve: its straight part does not show where it bends.

    """

    log_half: float
    variance: float


def fit_ramps(samples: RampSamples, axle: int, noise: float) -> RampCurve | None:
    """The curve of a relieved axle; None where the samples show none.

    Args:
        samples: Samples from before the first ramp until after the second.
        axle: Place of the axle that was relieved.
        noise: Standard deviation of the adhesion of a sample, 1.

    """
    level = _common_level(samples)
    relative = samples.adhesion[:, axle] / level
    top = float(np.median(relative[relative > 0.5 * np.quantile(relative, 0.9)]))
    if top <= 0:
        return None
    free, held = relative < SHARE_FREE * top, relative > SHARE_HELD * top
    if min(free.sum(), held.sum(), (~free & ~held).sum()) < LEAST_EACH:
        return None
    apart = samples.log_rim[:, axle] - samples.log_rim[:, samples.others].mean(axis=1)
    apart = apart * np.sign(np.median(apart[held]) - np.median(apart[free]))
    costs = np.full(len(GRID), np.inf)
    halves = np.full(len(GRID), np.nan)
    for k, steep in enumerate(GRID):
        half_and_cost = _residual(samples, apart, level, free, held, axle, float(steep))
        if half_and_cost is not None:
            halves[k], costs[k] = half_and_cost
    if not np.isfinite(costs).any():
        return None
    white = max(noise**2, float(costs.min()) / max(int((~free).sum()) - 2, 1))
    if white > (WORST_FIT * noise) ** 2 + (WORST_SHARE * top) ** 2:
        return None
    return _posterior(costs / white / DEPENDENCE, halves)


def _common_level(samples: RampSamples) -> Array:
    """Mean adhesion of the others, smoothed, over its last value."""
    mean = samples.adhesion[:, samples.others].mean(axis=1)
    width = min(SMOOTHED, len(mean))
    window = np.ones(width)
    count = np.convolve(np.ones_like(mean), window, mode="same")
    level = np.convolve(mean, window, mode="same") / count
    end = float(np.mean(mean[-width:]))
    return np.asarray(np.maximum(level / end, 0.2)) if end > 0 else np.ones_like(mean)


def _residual(
    samples: RampSamples,
    apart: Array,
    level: Array,
    free: NDArray[np.bool_],
    held: NDArray[np.bool_],
    axle: int,
    steep: float,
) -> tuple[float, float] | None:
    """Logarithm of a and sum of squares, where the elasticity at the effort held is 1 + `steep`."""
    slip = float(np.mean(np.abs(samples.slip[samples.others])))
    # The slips of the others follow their own efforts meanwhile, along the same curve.
    moved = slip * (level / np.maximum(1.0 + steep * (1.0 - level), 0.15) - 1.0)
    shown = apart + moved
    shown = shown - shown[free].mean()
    top = float(shown[held].mean())
    if top < LEAST_SLIP:
        return None
    half = top / steep
    # The free samples have set the zero, and their noise would pull a upwards.
    basis = (shown / (half + np.abs(shown)))[~free]
    used = samples.adhesion[~free, axle]
    m = float(basis @ used / (basis @ basis))
    return float(np.log(half)), float(np.sum((used - m * basis) ** 2))


def _posterior(costs: Array, halves: Array) -> RampCurve:
    """Mean and variance over the grid; it is even in ln a but for the ends."""
    weight = np.exp(-0.5 * (costs - costs.min()))
    weight = weight / weight.sum()
    values = np.where(weight > 0, halves, 0.0)
    centre = float(weight @ values)
    form = STRAIGHT / float(np.exp(weight @ np.log(GRID)))
    return RampCurve(centre, float(weight @ (values - centre) ** 2) + form**2)
