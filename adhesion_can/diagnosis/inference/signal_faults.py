"""Signal faults that the model cannot express: saturated sensors and drive-train oscillations.

They are looked for beside step 6. An oscillation is a line in the wheel speeds' power spectrum
(Welch, IEEE Trans. Audio Electroacoust. 15 (1967)).
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import scipy

from adhesion_can.arrays import Array
from adhesion_can.diagnosis.drive.drive_data import DriveData

SATURATED_SHARE, SATURATED_LEAST = 0.002, 20
"""Least share of an axle's readings, and least number, that equal its largest value."""
VARYING_SHARE = 0.9
"""Share of the other readings that must differ from the one before: the signal is noisy."""
OSCILLATION_RATIO = 2.0
"""Least power of a line, relative to the spectrum around it."""
OSCILLATIONS_HZ, SEGMENT_ROWS = (2.5, 45.0), 512
"""Range of frequencies, Hz, and readings in a segment of Welch's method."""
LINE_WIDTH_HZ, SURROUNDINGS_HZ = 1.0, 6.0
"""Half widths of a line and of its surroundings, Hz."""


class SaturatedSensor(NamedTuple):
    """An effort sensor whose readings are cut off at a limit.

    Attributes:
        recording: Name of the recording.
        axle: Axle number.
        effort: Limit of the readings, N.
        share: Share of the axle's readings at the limit.

    """

    recording: str
    axle: int
    effort: float
    share: float


@dataclass(frozen=True, slots=True)
class DriveTrainOscillation:
    """An oscillation of the wheel speeds.

    Attributes:
        frequency: Frequency, Hz.
        amplitude: Amplitude of the wheel speed, rad/s.
        adhesion: Effect of the wheelset's inertia on the adhesion, rms.

    """

    frequency: float
    amplitude: float
    adhesion: float


def find_saturated_sensors(drives: Sequence[DriveData]) -> list[SaturatedSensor]:
    """Axles whose effort is cut off at a limit, in the recordings among the drives."""
    saturated = []
    for drive in drives:
        axles = [] if drive.table else np.unique(drive.axle).tolist()
        limits = {axle: find_saturation(drive.effort[drive.axle == axle]) for axle in axles}
        saturated += [
            SaturatedSensor(drive.name, axle, *limit)
            for axle, limit in limits.items()
            if limit is not None
        ]
    return saturated


def find_saturation(effort: Array) -> tuple[float, float] | None:
    """Limit at which a signal is cut off, and the share of readings there; None where it is not.

    A noisy signal that equals its largest value again and again is cut off there.

    Args:
        effort: Tractive effort of one axle, N; shape (n,).

    """
    if len(effort) < SATURATED_LEAST:
        return None
    largest = float(np.abs(effort).max())
    at_limit = np.abs(effort) >= largest * (1.0 - 1e-9)
    count = int(np.count_nonzero(at_limit))
    away = ~at_limit[1:] & ~at_limit[:-1]
    noisy = np.mean(np.diff(effort)[away] != 0.0) > VARYING_SHARE if away.any() else False
    if largest <= 0.0 or not noisy:
        return None
    if count < max(SATURATED_LEAST, SATURATED_SHARE * len(effort)):
        return None
    return largest, count / len(effort)


def find_largest_oscillation(drives: Sequence[DriveData]) -> DriveTrainOscillation | None:
    """Oscillation with the largest effect on the adhesion in any drive; None: no drive has one."""
    oscillations = [
        drive_oscillation
        for drive in drives
        if (drive_oscillation := find_oscillation(drive)) is not None
    ]
    return max(oscillations, key=lambda oscillation: oscillation.adhesion, default=None)


def find_oscillation(drive: DriveData) -> DriveTrainOscillation | None:
    """Strongest line in the wheel speeds' power spectra, averaged over the axles; None: no line."""
    runs = [run for axle_runs in drive.kinematics.high_pass.values() for run in axle_runs]
    runs = [(t_s, fast) for t_s, fast in runs if len(t_s) >= 2 * SEGMENT_ROWS]
    if not runs:
        return None
    rate = 1.0 / float(np.median(np.diff(runs[0][0])))
    spectra = [scipy.signal.welch(fast, rate, nperseg=SEGMENT_ROWS) for _, fast in runs]
    frequency = spectra[0][0]
    lengths = [len(t_s) for t_s, _ in runs]
    mean = np.average([power for _, power in spectra], axis=0, weights=lengths)
    inside = (frequency >= OSCILLATIONS_HZ[0]) & (frequency <= min(OSCILLATIONS_HZ[1], 0.45 * rate))
    around = np.array([_surrounding_power(frequency, mean, f) for f in frequency])
    ratio = np.where(inside, mean / np.maximum(around, 1e-300), 0.0)
    best = int(np.argmax(ratio))
    if ratio[best] < OSCILLATION_RATIO:
        return None
    near = np.abs(frequency - frequency[best]) < LINE_WIDTH_HZ
    excess = np.maximum(mean - around, 0.0)
    variance = float(np.sum(excess[near]) * (frequency[1] - frequency[0]))
    load = float(np.mean(drive.observe().load)) if len(drive) else 1.0
    torque = 2 * np.pi * frequency[best] * np.sqrt(variance) * drive.inertia
    return DriveTrainOscillation(
        float(frequency[best]),
        float(np.sqrt(2 * variance)),
        float(torque / (np.mean(drive.radius) * load)),
    )


def _surrounding_power(frequency: Array, power: Array, centre: float) -> float:
    """Median power around a frequency, Hz, the line itself left out."""
    away = np.abs(frequency - centre)
    around = (away > LINE_WIDTH_HZ) & (away < SURROUNDINGS_HZ)
    return float(np.median(power[around & (frequency > OSCILLATIONS_HZ[0] - 1.0)]))
