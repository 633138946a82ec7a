"""What is left when no known effect explains it: channels, waves along the rail, bad signals."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import scipy

from adhesion_can.arrays import Array
from adhesion_can.diagnosis.drive.drive_data import Course
from adhesion_can.diagnosis.inference.channel_splines import Channel, Kind
from adhesion_can.diagnosis.inference.select_effects import detection_of
from adhesion_can.diagnosis.regression.gram_matrices import solve
from adhesion_can.diagnosis.regression.model import Evaluation, Model, evaluate
from adhesion_can.diagnosis.regression.whitened_regression import Fit, Stage

WAVES_M = np.geomspace(6.0, 300.0, 500)
"""Lengths of waves along the rail that are looked for, m."""
FLIPS = 999
PINNED_SHARE, PINNED_LEAST, NOISY = 0.002, 20, 0.9
"""Share of an axle's readings, and number, that stand at its largest value; share of the other
readings that differ from the one before."""
LINE_RATIO, LINE_SIZE = 2.0, 0.3
"""Power of a line over its surroundings, and its size in the noise of the adhesion."""
LINES_HZ, SEGMENT = (2.5, 45.0), 512


@dataclass(frozen=True, eq=False)
class Left:
    """What a channel explains of a model's residual.

    Attributes:
        channel: see there.
        p_value: with all channels counted.
        gain: share by which the RMSE of the adhesion falls with it, rows that are not kept back.
        columns: of its spline, adhesion, shape (n, columns).
        slopes: of the model's prediction, adhesion, shape (n, p), by which its curves move along.
        weights: of the slopes and of the columns, that take the least squares.

    """

    channel: Channel
    p_value: float
    gain: float
    columns: Array
    slopes: Array
    weights: Array

    @property
    def explained(self) -> Array:
        """What it adds to the prediction, the curves moved along; shape (n,)."""
        return np.asarray(np.column_stack([self.slopes, self.columns]) @ self.weights)

    @property
    def alone(self) -> Array:
        """What it adds to the prediction, the curves left as they are; shape (n,)."""
        return np.asarray(self.columns @ self.weights[self.slopes.shape[1] :])


def left_over(
    stage: Stage,
    found: Fit,
    channels: Sequence[Channel],
    columns: Sequence[Array],
    slopes: Array,
    rng: np.random.Generator,
) -> list[Left]:
    """Every channel against a model's residual, the one that gains most first.

    Args:
        stage: see there.
        found: the model.
        channels: that move.
        columns: of each one's spline, adhesion, shape (n, columns).
        slopes: of the model's prediction, adhesion, shape (n, p).
        rng: for the signs.

    """
    if not channels:
        return []
    detection, _, _ = detection_of(stage, found, columns, rng)
    residual = evaluate(stage.study, found.model.theta, found.model.actives).residual
    before = float(np.sqrt(np.mean(residual[stage.used] ** 2)))
    white = stage.white(np.column_stack([slopes, *columns, residual]))
    total = stage.ledger(white).total
    out, first = [], slopes.shape[1]
    for place, (channel, own) in enumerate(zip(channels, columns, strict=True)):
        of = [*range(slopes.shape[1]), *range(first, first + own.shape[1])]
        first += own.shape[1]
        weights = solve(total[np.ix_(of, of)], total[of, -1])
        left = residual - np.column_stack([slopes, own]) @ weights
        after = float(np.sqrt(np.mean(left[stage.used] ** 2)))
        gain = 1.0 - after / max(before, 1e-300)
        out.append(Left(channel, float(detection.p_value[place]), gain, own, slopes, weights))
    return sorted(out, key=lambda one: -one.gain)


def wave_channel(
    stage: Stage, model: Model, at: Evaluation, rng: np.random.Generator
) -> tuple[Channel, Array, float] | None:
    """The strongest wave of the adhesion along the rail: channel, columns, p-value.

    Amplitudes over blocks with their signs flipped tell how strong chance alone makes the
    strongest; the length is p-valued with all lengths counted.
    """
    position = stage.study.column("position")
    used = np.flatnonzero(stage.used)
    if len(used) < 1000 or float(np.ptp(position[used])) < 10 * WAVES_M[0]:
        return None
    residual = evaluate(stage.study, model.theta, model.actives).residual
    weight = stage.scale**2 * at.predicted
    order = used[np.argsort(stage.block[used], kind="stable")]
    starts = np.unique(stage.block[order], return_index=True)[1]
    lengths = WAVES_M[np.ptp(position[used]) / 6 > WAVES_M]
    power = np.zeros((len(starts), len(lengths)), dtype=np.complex128)
    for number, rows in enumerate(np.split(order, starts[1:])):
        # Rows within a quarter of a metre see the same phase of every wave that is looked for.
        cell = np.floor(position[rows] * 4).astype(np.int64)
        first = cell.min()
        sums = np.bincount(cell - first, weight[rows] * residual[rows])
        where = (np.arange(len(sums)) + first + 0.5) / 4
        full = sums != 0.0
        power[number] = sums[full] @ np.exp(2j * np.pi * where[full, None] / lengths)
    seen = np.abs(power.sum(axis=0))
    signs = np.where(rng.random((FLIPS, len(starts))) < 0.5, -1.0, 1.0)
    chance = np.abs(signs @ power)
    scale = np.sqrt(np.sum(np.abs(power) ** 2, axis=0))
    ratio = seen / np.maximum(scale, 1e-300)
    best = int(np.argmax(ratio))
    largest = (chance / np.maximum(scale, 1e-300)).max(axis=1)
    p_value = (1.0 + np.count_nonzero(largest >= ratio[best])) / (FLIPS + 1.0)
    phase = 2 * np.pi * position / lengths[best]
    columns = np.stack([np.cos(phase), np.sin(phase)], axis=1) * at.predicted[:, None]
    channel = Channel("position", "m", Kind.FACTOR, position % lengths[best], period=lengths[best])
    return channel, columns, float(p_value)


def pinned(course: Course, axle: int) -> tuple[float, float] | None:
    """Largest effort of an axle and the share of rows at it, where the signal is cut off there.

    A noisy reading that stands at its largest value again and again is one that is cut off.
    """
    effort = course.effort[course.axle == axle]
    if len(effort) < PINNED_LEAST:
        return None
    most = float(np.abs(effort).max())
    there = np.abs(effort) >= most * (1.0 - 1e-9)
    count = int(np.count_nonzero(there))
    away = ~there[1:] & ~there[:-1]
    noisy = np.mean(np.diff(effort)[away] != 0.0) > NOISY if away.any() else False
    if most <= 0.0 or not noisy or count < max(PINNED_LEAST, PINNED_SHARE * len(effort)):
        return None
    return most, count / len(effort)


@dataclass(frozen=True, slots=True)
class Line:
    """An oscillation of the wheel speeds.

    Attributes:
        frequency: Hz.
        amplitude: of the wheel speed, rad/s, where it swings most.
        adhesion: what it means for the adhesion by the wheelset's inertia, rms.

    """

    frequency: float
    amplitude: float
    adhesion: float


def line(course: Course) -> Line | None:
    """The strongest line in the wheel speeds' spectra, averaged over the axles."""
    stretches = [one for axle in course.source.rough.values() for one in axle]
    stretches = [(t_s, fast) for t_s, fast in stretches if len(t_s) >= 2 * SEGMENT]
    if not stretches:
        return None
    rate = 1.0 / float(np.median(np.diff(stretches[0][0])))
    spectra = [scipy.signal.welch(fast, rate, nperseg=SEGMENT) for _, fast in stretches]
    frequency = spectra[0][0]
    lengths = [len(t_s) for t_s, _ in stretches]
    mean = np.average([power for _, power in spectra], axis=0, weights=lengths)
    inside = (frequency >= LINES_HZ[0]) & (frequency <= min(LINES_HZ[1], 0.45 * rate))
    around = np.array([_around(frequency, mean, f) for f in frequency])
    ratio = np.where(inside, mean / np.maximum(around, 1e-300), 0.0)
    best = int(np.argmax(ratio))
    if ratio[best] < LINE_RATIO:
        return None
    near = np.abs(frequency - frequency[best]) < 1.0
    excess = np.maximum(mean - around, 0.0)
    variance = float(np.sum(excess[near]) * (frequency[1] - frequency[0]))
    load = float(np.mean(course.observe().load)) if len(course) else 1.0
    size = 2 * np.pi * frequency[best] * np.sqrt(variance) * course.inertia
    return Line(
        float(frequency[best]),
        float(np.sqrt(2 * variance)),
        float(size / (np.mean(course.radius) * load)),
    )


def _around(frequency: Array, power: Array, centre: float) -> float:
    away = np.abs(frequency - centre)
    return float(np.median(power[(away > 1.0) & (away < 6.0) & (frequency > LINES_HZ[0] - 1.0)]))
