"""The Burckhardt curve: adhesion over slip ratio, its peak and its inverse.

Sources: M. Burckhardt, "Fahrwerktechnik: Radschlupf-Regelsysteme", Vogel 1993; equation numbers
after He et al., IEEE Access 6 (2018), doi 10.1109/ACCESS.2018.2868177.

The curve is written for |λ| and carries the sign of λ, so traction and braking share it.
Every function broadcasts over its arguments; slips are ratios, adhesion is force over load.
"""

from dataclasses import dataclass
from math import exp, expm1, log
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from adhesion_can.arrays import Array

CurveParameters = tuple[float, float, float]
"""(c1, c2, c3) of a curve: level, steepness and fall beyond the peak, all without a unit."""

SLIP_MAX = 1.0
"""Largest slip ratio for which a peak is looked for: beyond it the wheel spins freely."""


def adhesion(slip: ArrayLike, c1: ArrayLike, c2: ArrayLike, c3: ArrayLike) -> Array:
    """Adhesion coefficient μ(λ) = c1(1 − e^(−c2 λ)) − c3 λ (eq. 5), with the sign of λ.

    Args:
        slip: Slip ratio λ, any shape.
        c1: Level of the curve, adhesion.
        c2: Steepness, per unit of slip; c1·c2 − c3 is the slope at λ = 0.
        c3: Fall beyond the peak, adhesion per unit of slip.

    Returns:
        μ, of the broadcast shape of all arguments.

    """
    lam = np.asarray(slip, dtype=np.float64)
    size = np.abs(lam)
    c2 = np.asarray(c2, dtype=np.float64)
    # expm1 keeps the digits that 1 - exp loses at small slip.
    curve = -np.asarray(c1, dtype=np.float64) * np.expm1(-c2 * size) - np.asarray(c3) * size
    return np.asarray(np.copysign(1.0, lam) * curve)


def adhesion_slope(slip: ArrayLike, c1: ArrayLike, c2: ArrayLike, c3: ArrayLike) -> Array:
    """Slope dμ/dλ = c1 c2 e^(−c2 |λ|) − c3 of `adhesion`; even in λ.

    Args:
        slip: Slip ratio λ, any shape.
        c1: Level of the curve, adhesion.
        c2: Steepness, per unit of slip.
        c3: Fall beyond the peak, adhesion per unit of slip.

    Returns:
        Slope, adhesion per unit of slip, of the broadcast shape of all arguments.

    """
    size = np.abs(np.asarray(slip, dtype=np.float64))
    c2 = np.asarray(c2, dtype=np.float64)
    return np.asarray(np.asarray(c1, dtype=np.float64) * c2 * np.exp(-c2 * size) - np.asarray(c3))


def falling_factor(creep_speed: ArrayLike, c4: ArrayLike) -> Array:
    """Factor e^(−c4 |λ V|) of eq. 4.

    Args:
        creep_speed: Creep speed λ·V = r·ω − v, m/s.
        c4: Fall of the adhesion with creep speed, s/m.

    """
    size = np.abs(np.asarray(creep_speed, dtype=np.float64))
    return np.asarray(np.exp(-np.asarray(c4, dtype=np.float64) * size))


def load_factor(load: ArrayLike, c5: ArrayLike) -> Array:
    """Factor 1 − c5 F_Z² of eq. 4.

    Args:
        load: Wheelset load F_Z, N.
        c5: Fall of the adhesion with the squared load, 1/N².

    """
    n = np.asarray(load, dtype=np.float64)
    return np.asarray(1.0 - np.asarray(c5, dtype=np.float64) * n * n)


def adhesion_full(
    slip: ArrayLike,
    speed: ArrayLike,
    load: ArrayLike,
    c1: ArrayLike,
    c2: ArrayLike,
    c3: ArrayLike,
    c4: ArrayLike = 0.0,
    c5: ArrayLike = 0.0,
) -> Array:
    """Full Burckhardt curve, eq. 4: eq. 5 times e^(−c4 λ V) times (1 − c5 F_Z²).

    Args:
        slip: Slip ratio λ.
        speed: Vehicle speed V, m/s.
        load: Wheelset load F_Z, N.
        c1: Level of the curve, adhesion.
        c2: Steepness, per unit of slip.
        c3: Fall beyond the peak, adhesion per unit of slip.
        c4: Fall of the adhesion with creep speed, s/m.
        c5: Fall of the adhesion with the squared load, 1/N².

    """
    creep = np.asarray(slip, dtype=np.float64) * np.asarray(speed, dtype=np.float64)
    return np.asarray(
        adhesion(slip, c1, c2, c3) * falling_factor(creep, c4) * load_factor(load, c5)
    )


class Peak(NamedTuple):
    """Largest adhesion of a curve and its place.

    Attributes:
        mu_max: Peak adhesion μ_m.
        lambda_m: Optimal slip ratio λ_m.
        interior: Whether the peak is a maximum. False where the curve still rises at `slip_max`,
            so that the values are those at the end of the valid range, or where it never rises.

    """

    mu_max: Array
    lambda_m: Array
    interior: NDArray[np.bool_]


def peak(c1: ArrayLike, c2: ArrayLike, c3: ArrayLike, slip_max: float = SLIP_MAX) -> Peak:
    """Peak of the curve in closed form, eq. 6, bounded by the valid range of slip.

    λ_m = (1/c2) ln(c1 c2/c3) and μ_m = c1 − (c3/c2)(1 + ln(c1 c2/c3)). Two limits:

    - c3 → 0, or a λ_m beyond `slip_max`: the curve still rises at the end of the range; the
      values there are returned and `interior` is False.
    - c1 c2 ≤ c3: the curve falls from the start; λ_m = μ_m = 0 and `interior` is False.

    Args:
        c1: Level of the curve, adhesion, any shape.
        c2: Steepness, per unit of slip, > 0.
        c3: Fall beyond the peak, adhesion per unit of slip.
        slip_max: End of the valid range, slip ratio.

    """
    c1, c2, c3 = np.broadcast_arrays(*(np.asarray(c, dtype=np.float64) for c in (c1, c2, c3)))
    rising = c1 * c2 > c3
    peaks = rising & (c3 > 0.0)
    # A sum of logarithms, since the ratio c1 c2/c3 overflows for a tiny c3.
    log1, log2, log3 = (
        np.log(c, out=np.zeros(c.shape), where=peaks) for c in (np.abs(c1), np.abs(c2), c3)
    )
    logs = np.where(peaks, log1 + log2 - log3, np.inf)
    free = np.divide(logs, c2, out=np.zeros(c1.shape), where=c2 > 0.0)
    inside = rising & (free <= slip_max)
    lambda_m = np.where(rising, np.minimum(free, slip_max), 0.0)
    return Peak(np.asarray(adhesion(lambda_m, c1, c2, c3)), lambda_m, inside)


def peak_of_one(c1: float, c2: float, c3: float, slip_max: float = SLIP_MAX) -> tuple[float, float]:
    """μ_m and λ_m of one curve as `peak` has them, for numbers: at a tenth of its cost."""
    if not (c1 * c2 > c3 and c2 > 0.0):
        return 0.0, 0.0
    lambda_m = slip_max
    if c3 > 0.0:
        lambda_m = min((log(c1) + log(c2) - log(c3)) / c2, slip_max)
    return -c1 * expm1(-c2 * lambda_m) - c3 * lambda_m, lambda_m


def peak_gradient(c1: float, c2: float, c3: float, slip_max: float = SLIP_MAX) -> Array:
    """Jacobian of (μ_m, λ_m) with respect to (c1, c2, c3), shape (2, 3).

    At an interior peak dμ/dλ = 0, so ∂μ_m/∂θ is ∂μ/∂θ at λ_m (envelope theorem). At the end of the
    range λ_m is fixed, so its row is NaN: the end of a range has no standard deviation.
    """
    at = peak(c1, c2, c3, slip_max)
    lam = float(at.lambda_m)
    e = float(np.exp(-c2 * lam))
    mu_row = [1.0 - e, c1 * lam * e, -lam]
    if not at.interior:
        return np.array([mu_row, [np.nan] * 3])
    return np.array([mu_row, [1 / (c1 * c2), (1 / c2 - lam) / c2, -1 / (c2 * c3)]])


def slip_at(
    mu: ArrayLike, c1: ArrayLike, c2: ArrayLike, c3: ArrayLike, slip_max: float = SLIP_MAX
) -> Array:
    """Inverse of the curve: the smallest λ ≥ 0 with μ(λ) ≥ `mu`; NaN above the peak.

    Args:
        mu: Adhesion, any shape, of either sign; the result carries its sign.
        c1: Level of the curve, adhesion.
        c2: Steepness, per unit of slip.
        c3: Fall beyond the peak, adhesion per unit of slip.
        slip_max: End of the valid range, slip ratio.

    """
    mu, c1, c2, c3 = np.broadcast_arrays(
        *(np.asarray(c, dtype=np.float64) for c in (mu, c1, c2, c3))
    )
    top = peak(c1, c2, c3, slip_max)
    target = np.minimum(np.abs(mu), top.mu_max)
    columns = (target, c1, c2, c3, top.lambda_m)
    numbers = zip(*(column.ravel().tolist() for column in columns), strict=True)
    lam = np.array([_solve_rising_branch(*row) for row in numbers]).reshape(mu.shape)
    # A rounding error above the peak is the peak.
    reachable = np.abs(mu) <= top.mu_max * (1 + 1e-12)
    return np.asarray(np.where(reachable, np.copysign(lam, mu), np.nan))


def slip_at_share(
    share: float, c1: float, c2: float, c3: float, slip_max: float = SLIP_MAX
) -> float:
    """Smallest slip ratio λ with μ(λ) ≥ `share` · μ_max.

    Args:
        share: Share of μ_max, above 0 and at most 1.
        c1: Level of the curve, adhesion.
        c2: Steepness, per unit of slip, > 0.
        c3: Fall beyond the peak, adhesion per unit of slip.
        slip_max: End of the valid range, slip ratio.

    """
    mu_max, lambda_m = peak_of_one(c1, c2, c3, slip_max)
    return _solve_rising_branch(share * mu_max, c1, c2, c3, lambda_m)


def _solve_rising_branch(target: float, c1: float, c2: float, c3: float, lambda_m: float) -> float:
    """Smallest slip in 0..λ_m at which the curve reaches a target that it does reach.

    Newton's method from λ = 0: the curve is concave there, so its tangents lie above it and the
    iteration rises to the root without ever passing it. On floats and not on arrays: the service
    needs one root for every setpoint, and an array of one number costs ten times as much.
    """
    lam = 0.0
    for _ in range(60):
        slope = c1 * c2 * exp(-c2 * lam) - c3
        missing = target + c1 * expm1(-c2 * lam) + c3 * lam
        if not (slope > 0.0 and missing > 0.0):
            break
        following = min(lam + missing / slope, lambda_m)
        if following == lam:
            break
        lam = following
    return lam


@dataclass(frozen=True, slots=True)
class Surface:
    """A named Burckhardt curve.

    Attributes:
        name: Name as in its source.
        c1: Level of the curve, adhesion.
        c2: Steepness, per unit of slip.
        c3: Fall beyond the peak, adhesion per unit of slip.
        source: Reference of the numbers.

    """

    name: str
    c1: float
    c2: float
    c3: float
    source: str

    @property
    def theta(self) -> CurveParameters:
        """(c1, c2, c3)."""
        return (self.c1, self.c2, self.c3)

    @property
    def mu_max(self) -> float:
        """Peak adhesion, eq. 6."""
        return float(peak(*self.theta).mu_max)

    @property
    def lambda_m(self) -> float:
        """Optimal slip ratio, eq. 6."""
        return float(peak(*self.theta).lambda_m)


_TYRE = "Burckhardt 1993, tyre on road"
PUBLISHED: tuple[Surface, ...] = (
    Surface("dry asphalt", 1.2801, 23.99, 0.52, _TYRE),
    Surface("wet asphalt", 0.857, 33.822, 0.347, _TYRE),
    Surface("dry cobble", 1.3713, 6.4565, 0.6691, _TYRE),
    Surface("snow", 0.1946, 94.129, 0.0646, _TYRE),
    Surface("ice", 0.05, 306.39, 0.0, _TYRE),
)
"""Published curves of tyres; a curve of wheel and rail is lower, with its peak at less slip."""

_OURS = "adhesion-can, shaped after Polach 2005 and Curtius-Kniffler 1950 at 10 m/s; not measured"
RAIL: tuple[Surface, ...] = (
    Surface("dry", 0.40, 60.0, 0.30, _OURS),
    Surface("wet", 0.27, 45.0, 0.22, _OURS),
    Surface("greasy", 0.15, 40.0, 0.12, _OURS),
)
"""Rail surfaces of the simulated scenarios."""
