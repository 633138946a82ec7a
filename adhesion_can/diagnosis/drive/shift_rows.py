"""Values of rows at another time: interpolation that does not average noise.

A straight line between two rows halves the variance of their noise in the middle, and none at the
rows: a fit of a delay is drawn to half rows by that alone. The Fourier transform shifts a run of
even rows by any fraction and leaves the power of what is in it as it was (Oppenheim and Schafer,
Discrete-Time Signal Processing, 3rd ed. 2010, sec. 4.2.2).
"""

from itertools import pairwise

import numpy as np
from scipy.fft import next_fast_len

from adhesion_can.arrays import Array

EVEN = 0.05
"""Largest difference of a step to the median one, as a share of it, in a run of even rows."""
LEAST_RUN = 16
"""Rows of a run, from which it is shifted by its transform."""
MARGIN = 32
"""Rows by which a run is continued on either side at least, by its image through the end point."""


def shift_rows(t_s: Array, values: Array, by_s: float) -> Array:
    """Values at the times of rows plus a shift.

    Beyond the ends of the rows they are those at the ends; between runs, on a straight line.

    Args:
        t_s: Times of the rows, s, ascending, shape (n,).
        values: Values at the rows, shape (n,).
        by_s: Shift, s.

    """
    at = t_s + by_s
    shifted_values = np.interp(at, t_s, values)
    steps = np.diff(t_s)
    if len(steps) < LEAST_RUN or not (step := float(np.median(steps))) > 0.0:
        return shifted_values
    breaks = np.flatnonzero(np.abs(steps - step) > EVEN * step) + 1
    ends = [0, *breaks.tolist(), len(t_s)]
    for first, last in pairwise(ends):
        if last - first < LEAST_RUN:
            continue
        # Its source is within the run for all but the rows at one end.
        inside = (at[first:last] >= t_s[first]) & (at[first:last] <= t_s[last - 1])
        shifted = _shift_run(values[first:last], by_s / step)
        shifted_values[first:last][inside] = shifted[inside]
    return shifted_values


def _shift_run(values: Array, by_rows: float) -> Array:
    """Values of even rows some rows later."""
    longest = len(values) - 1
    margin = min(MARGIN, longest)
    # Of a length whose transform is quick: one with a large prime factor takes ten times as long.
    behind = min(next_fast_len(len(values) + 2 * margin, real=True) - len(values) - margin, longest)
    front = 2.0 * values[0] - values[margin:0:-1]
    back = 2.0 * values[-1] - values[-2 : -behind - 2 : -1]
    whole = np.concatenate([front, values, back])
    # A straight line between the ends is shifted by itself: a jump there would ring.
    place = np.arange(len(whole))
    slope = (whole[-1] - whole[0]) / (len(whole) - 1)
    spectrum = np.fft.rfft(whole - slope * place)
    spectrum *= np.exp(2j * np.pi * np.fft.rfftfreq(len(whole)) * by_rows)
    level = np.fft.irfft(spectrum, len(whole)) + slope * (place + by_rows)
    return np.asarray(level[margin : margin + len(values)])
