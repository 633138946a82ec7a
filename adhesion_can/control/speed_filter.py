"""Vehicle speed between its readings, by an alpha-beta filter."""

from adhesion_can.control.inputs import Measurement

ALPHA, BETA = 0.12, 0.008
"""Gains of the filter at readings 20 ms apart: a memory of some 0.3 s, and no error in steady
acceleration (Kalata, IEEE Trans. Aerosp. Electron. Syst. 20, 1984)."""
READING_S = 0.02


class SpeedFilter:
    """Speed and acceleration of the vehicle from its noisy speed.

    Args:
        timeout_s: Time for which a missing speed is extrapolated, s.

    """

    def __init__(self, timeout_s: float) -> None:
        self._timeout_s = timeout_s
        self._speed: float | None = None
        self._acceleration = 0.0
        self._time_s = 0.0
        self._read_s = 0.0

    def step(self, measured: Measurement) -> float | None:
        """Speed now, m/s; None where it is unknown, or was not received for too long."""
        now_s = measured.time_s
        if self._speed is None or now_s - self._read_s > self._timeout_s:
            if measured.speed is None:
                self._speed = None
                return None
            self._speed, self._acceleration = measured.speed, 0.0
            self._time_s = self._read_s = now_s
            return self._speed
        self._speed = max(self._speed + self._acceleration * (now_s - self._time_s), 0.0)
        self._time_s = now_s
        if measured.speed is not None:
            miss = measured.speed - self._speed
            self._speed += ALPHA * miss
            self._acceleration += BETA * miss / READING_S
            self._read_s = now_s
        return self._speed
