"""What a wheel speed shows once a turn: order tracking by regression on the angle turned.

The regressors go through the same high-pass filter as the wheel speed, so that what the filter
takes off is taken off both. See Randall, Vibration-based Condition Monitoring, 2011, on order
tracking.
"""

from typing import NamedTuple

import numpy as np
import scipy

from adhesion_can.arrays import Array

WINDOW_S = 0.8
"""Width of the parabolas that are taken off, s: a wheel that turns slower shows no turn."""
LEAST_POINTS = 5
"""Least number of readings in a window."""
BLOCKS = 20
"""Blocks of time whose amplitudes give the standard deviation."""


class TurnSwing(NamedTuple):
    """Swing of a wheel speed once a turn, amplitude · sin(θ + phase) relative to the speed.

    Attributes:
        amplitude: Relative amplitude.
        phase: Phase at the first reading, rad.
        std: Standard deviation of the amplitude.

    """

    amplitude: float
    phase: float
    std: float


NO_SWING = TurnSwing(0.0, 0.0, 0.0)


def find_turn_swing(t_s: Array, wheel_speed: Array, angle: Array) -> TurnSwing:
    """Swing of a wheel speed once a turn.

    Args:
        t_s: Stamps, s, shape (n,).
        wheel_speed: Wheel speeds, rad/s, shape (n,).
        angle: Angle that the wheel has turned, rad, shape (n,).

    """
    cycle = float(np.median(np.diff(t_s))) if len(t_s) > 1 else 0.0
    points = round(WINDOW_S / cycle / 2) * 2 + 1 if cycle > 0.0 else 0
    if points < LEAST_POINTS or len(t_s) < BLOCKS * points:
        return NO_SWING
    sine, cosine = wheel_speed * np.sin(angle), wheel_speed * np.cos(angle)
    columns = np.stack([sine, cosine, wheel_speed])
    columns -= scipy.signal.savgol_filter(columns, points, 2, axis=1)
    grams = np.stack([part @ part.T for part in np.array_split(columns, BLOCKS, axis=1)])
    total = grams.sum(axis=0)
    try:
        inverse = np.linalg.inv(total[:2, :2])
    except np.linalg.LinAlgError:
        return NO_SWING
    by_sine, by_cosine = parts = inverse @ total[:2, 2]
    # Scores of the blocks, as in a cluster-robust covariance.
    scores = grams[:, :2, 2] - grams[:, :2, :2] @ parts
    covariance = inverse @ (scores.T @ scores) @ inverse
    return TurnSwing(
        float(np.hypot(by_sine, by_cosine)),
        float(np.arctan2(by_cosine, by_sine)),
        float(np.sqrt(np.trace(covariance) / 2.0)),
    )
