"""Tables of samples with a mechanism that no library has: the adhesion follows a column by a law.

Two columns, `wind` and `salt`, and the slip wander at paces of their own. The law is drawn: its
kind, its constants, and how large it is against the noise.
"""

from dataclasses import dataclass

import numpy as np

KINDS = ("power", "exponential", "saturation", "threshold", "lag", "product")
STEP_S = 0.02


@dataclass(frozen=True)
class Mechanism:
    """A table with a hidden mechanism.

    Attributes:
        kind: Kind of the law.
        constants: Constants of the law.
        columns: Columns of the table by name.
        law: Relative change of the adhesion in each row, mean 0.
        curve: Adhesion without it in each row.
        noise: Standard deviation of the adhesion's noise.

    """

    kind: str
    constants: tuple[float, ...]
    columns: dict
    law: np.ndarray
    curve: np.ndarray
    noise: float

    @property
    def ratio(self):
        """Size of the law over the error with which it can be measured at best."""
        return float(np.sqrt(np.sum((self.law * self.curve) ** 2)) / self.noise)


def wander(rng, rows, pace_s):
    """A smooth wandering between 0 and 1: white noise behind a Gaussian filter."""
    width = pace_s / STEP_S
    reach = int(4 * width)
    kernel = np.exp(-0.5 * (np.arange(-reach, reach + 1) / width) ** 2)
    path = np.convolve(rng.standard_normal(rows + 2 * reach), kernel, "valid")
    return (path - path.min()) / np.ptp(path)


def follow(target, time_s):
    """First-order lag of rows a step apart, begun at the first one."""
    out, state, share = np.empty(len(target)), target[0], 1.0 - np.exp(-STEP_S / time_s)
    for row, wanted in enumerate(target):
        state += share * (wanted - state)
        out[row] = state
    return out


def power_law(rng, x, _y):
    exponent = float(rng.choice([-2.0, -1.0, -0.5, 0.5, 2.0, 3.0]))
    return x**exponent, (exponent,)


def exponential_law(rng, x, _y):
    width = float(rng.uniform(0.12, 0.35)) * np.ptp(x)
    return np.exp((x - x.max()) / width), (width,)


def saturation_law(rng, x, _y):
    width = float(rng.uniform(0.08, 0.35)) * np.ptp(x)
    return 1.0 - np.exp(-(x - x.min()) / width), (width,)


def threshold_law(rng, x, _y):
    place = float(x.min() + rng.uniform(0.3, 0.7) * np.ptp(x))
    return np.maximum(x - place, 0.0), (place,)


def lag_law(rng, x, _y):
    time_s = float(np.exp(rng.uniform(np.log(2.0), np.log(12.0))))
    return follow(x, time_s), (time_s,)


def product_law(_rng, x, y):
    return x * y, ()


LAWS = {
    "power": power_law,
    "exponential": exponential_law,
    "saturation": saturation_law,
    "threshold": threshold_law,
    "lag": lag_law,
    "product": product_law,
}


def make_mechanism(seed, kind, *, size=None):
    """A table of a few minutes.

    Args:
        seed: Seed of all random numbers.
        kind: One of `KINDS`.
        size: Root mean square of the relative change; None: drawn from 0.2 to 10 %.

    """
    rng = np.random.default_rng(seed)
    rows = int(rng.integers(6_000, 12_000))
    t_s = STEP_S * np.arange(rows)
    # Slip swept up and down, in traction and in braking.
    sweep = np.abs((t_s / rng.uniform(5.0, 9.0)) % 2.0 - 1.0)
    slip = (0.001 + 0.12 * sweep) * np.where((t_s // rng.uniform(20.0, 35.0)) % 2 == 0, 1.0, -1.0)
    c1, c2, c3 = rng.uniform(0.2, 0.45), rng.uniform(30.0, 60.0), rng.uniform(0.2, 0.8)
    curve = np.sign(slip) * (c1 * (1.0 - np.exp(-c2 * np.abs(slip))) - c3 * np.abs(slip))
    low, span = rng.uniform(0.5, 3.0), rng.uniform(5.0, 12.0)
    wind = low + span * wander(rng, rows, rng.uniform(3.0, 7.0))
    salt = rng.uniform(10.0, 30.0) * (1.0 + 2.0 * wander(rng, rows, rng.uniform(3.0, 7.0)))
    shape, constants = LAWS[kind](rng, wind, salt)
    law = shape - shape.mean()
    drawn = float(np.exp(rng.uniform(np.log(0.002), np.log(0.1))))
    law = law / np.sqrt(np.mean(law**2)) * (drawn if size is None else size)
    noise = float(rng.uniform(0.002, 0.006))
    adhesion = (1.0 + law) * curve + noise * rng.standard_normal(rows)
    columns = {"time_s": t_s, "slip": slip, "adhesion": adhesion, "wind": wind, "salt": salt}
    return Mechanism(kind, constants, columns, law, curve, noise)


def write_mechanism(mechanism, path):
    """Write the table as CSV."""
    values = np.column_stack(list(mechanism.columns.values()))
    header = ",".join(mechanism.columns)
    np.savetxt(path, values, delimiter=",", header=header, comments="", fmt="%.9g")
    return path
