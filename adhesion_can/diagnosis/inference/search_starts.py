"""Where the search for an effect starts: multiples of typical values, or what the data give."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from adhesion_can.diagnosis.drive.drive_data import DriveData
from adhesion_can.diagnosis.drive.kinematics import TableKinematics
from adhesion_can.diagnosis.drive.turn_swing import NO_SWING, TurnSwing
from adhesion_can.diagnosis.regression.candidate import Candidate
from adhesion_can.physics.parameter import SearchStart

STEEP, LEAST_ROWS, EDGE = 0.6, 50, 20
"""Adhesion over the largest up to which slips show a step of the speed, the least number of such
rows, and the part of them at either end in which no step is looked for, one over."""
LEAST_SWING, LEAST_DEVIATIONS = 3e-4, 5.0
"""Relative swing of a wheel speed once a turn below which it matters to no slip, and least swing in
its standard deviations."""


def with_starts(
    candidate: Candidate, axles: Sequence[int], drives: Sequence[DriveData]
) -> tuple[list[Candidate], str]:
    """A candidate at each axle with its start values, and why none or not all are tested.

    Args:
        candidate: Effect as a candidate at no axle.
        axles: Axles at which it may be; 0 where it is at none.
        drives: Rows of the recordings.

    """
    candidates = [replace(candidate, axle=int(axle)) for axle in axles]
    kinds = {parameter.search for parameter in candidate.free_parameters[1:]}
    if SearchStart.STEP_TIME in kinds:
        return [
            replace(candidate, starts=((find_step_time(drives[0]),),)) for candidate in candidates
        ], ""
    if SearchStart.WHEEL_PHASE in kinds:
        return _with_phases(candidates, drives[0])
    return candidates, ""


def find_step_time(drive: DriveData) -> float:
    """Time at which the slips of all axles step most, where they are small, s.

    The slip is regressed on a polynomial of the adhesion below the peak and on a step at each time
    (least squares for one change point; Bai and Perron, Econometrica 66 (1998)).
    """
    observed = drive.observe()
    size = np.abs(observed.adhesion)
    rows = np.flatnonzero(size < STEEP * np.quantile(size, 0.95))
    rows = rows[np.argsort(drive.time_s[rows], kind="stable")]
    if len(rows) < LEAST_ROWS:
        return float(np.mean(drive.time_s))
    mu, slip = observed.adhesion[rows], observed.slip[rows]
    terms = np.stack([np.ones_like(mu), mu, mu * np.abs(mu), mu**3], axis=1)
    inverse = np.linalg.pinv(terms.T @ terms)
    residual = slip - terms @ (inverse @ (terms.T @ slip))
    # Sums over all rows from each one on: the step's products with the terms and the residual.
    later = np.cumsum(terms[::-1], axis=0)[::-1]
    score = np.cumsum(residual[::-1])[::-1]
    square = later[:, 0] - np.einsum("ij,jk,ik->i", later, inverse, later)
    inner = slice(len(rows) // EDGE, len(rows) - len(rows) // EDGE)
    gain = score[inner] ** 2 / np.maximum(square[inner], 1.0)
    return round(float(drive.time_s[rows[inner][int(np.argmax(gain))]]), 3)


def _with_phases(candidates: Sequence[Candidate], drive: DriveData) -> tuple[list[Candidate], str]:
    """Candidates at the axles whose wheel speeds swing once a turn, with the phase of the swing."""
    swinging, largest = [], 0.0
    for candidate in candidates:
        swing = _swing(drive, candidate.axle)
        if swing.amplitude >= max(LEAST_SWING, LEAST_DEVIATIONS * swing.std):
            swinging.append(replace(candidate, starts=((round(swing.phase, 6),),)))
        largest = max(largest, swing.amplitude)
    if swinging:
        return swinging, ""
    if largest == 0.0:
        return [], (
            "the recording is too short to show an oscillation once per turn, or no wheel turns"
        )
    return [], f"no wheel speed oscillates once per turn by more than {100.0 * largest:.2g} %"


def _swing(drive: DriveData, axle: int) -> TurnSwing:
    kinematics = drive.kinematics
    return NO_SWING if isinstance(kinematics, TableKinematics) else kinematics.once_per_turn(axle)
