"""Least squares of the Burckhardt curve by variable projection.

For a given c2 the curve is linear in c1 and c3: their best values follow from a 2 × 2 system, and
what is left is a minimisation over c2 alone (Golub & Pereyra 1973, "The differentiation of
pseudo-inverses and nonlinear least squares problems whose variables separate", SIAM J. Numer. Anal.
10(2); the step is Kaufman's 1975). A scan over c2 finds the valley, Gauss-Newton steps its bottom.
"""

import numpy as np

from adhesion_can.arrays import Array

STEEPNESS = np.geomspace(2.0, 400.0, 60)
"""Values of c2 in the scan: 9 % apart, well within the convergence range of the refinement."""

LOWER, UPPER = np.array([1e-6, 1.0, 0.0]), np.array([10.0, 1000.0, 10.0])
"""Bounds of (c1, c2, c3), wide enough never to be active where data determine the curve."""

SCAN_SAMPLES = 20_000
ITERATIONS = 100
TOLERANCE = 1e-12
"""Change of ln c2 at which the iteration ends."""
ROUNDING = 1e-7
"""Change of ln c2 below which a rise of the cost is rounding: the cost is flat to 1e-14 there."""
LONGEST_STEP = 0.5
"""Largest change of ln c2 in one step."""


def fit_least_squares(h: Array, z: Array) -> Array:
    """Curve parameters (c1, c2, c3) of least squares within `LOWER` and `UPPER`, shape (3,).

    Args:
        h: Slip ratios, ≥ 0, finite, shape (n,).
        z: Adhesion coefficients, finite, shape (n,).

    """
    step = max(len(h) // SCAN_SAMPLES, 1)
    c2 = _scan(h[::step], z[::step])
    cost, c1, c3, change = _project(c2, h, z)
    for _ in range(ITERATIONS):
        if abs(change) <= TOLERANCE:
            break
        tried = float(np.clip(c2 * np.exp(change), LOWER[1], UPPER[1]))
        projection = _project(tried, h, z)
        if projection[0] <= cost and tried != c2:
            c2, (cost, c1, c3, change) = tried, projection
        elif abs(change) <= ROUNDING:
            break
        else:
            change *= 0.5
    return np.array([c1, c2, c3])


def solve_two_by_two(aa: Array, ab: Array, bb: Array, az: Array, bz: Array) -> tuple[Array, Array]:
    """c1 and c3 ≥ 0 of the normal equations; c3 = 0 where it would come out negative.

    Args:
        aa: Sum of squares of the column 1 − e^(−c2 h), any shape.
        ab: Sum of products of both columns, the shape of `aa`.
        bb: Sum of squares of the column −h, the shape of `aa`.
        az: Sum of products of the first column and the adhesion, the shape of `aa`.
        bz: Sum of products of the second column and the adhesion, the shape of `aa`.

    """
    det = aa * bb - ab * ab
    good = det > 1e-12 * np.maximum(aa * bb, 1e-300)
    safe = np.where(good, det, 1.0)
    c1, c3 = (bb * az - ab * bz) / safe, (aa * bz - ab * az) / safe
    plain = np.divide(az, aa, out=np.zeros_like(az), where=aa > 0)
    inside = good & (c3 >= 0)
    return np.where(inside, c1, plain), np.where(inside, c3, 0.0)


def _scan(h: Array, z: Array) -> float:
    """Best c2 of the scan."""
    a = -np.expm1(-np.multiply.outer(STEEPNESS, h))
    aa, ab = np.einsum("ij,ij->i", a, a), -(a @ h)
    c1, c3 = solve_two_by_two(aa, ab, np.full_like(aa, h @ h), a @ z, np.full_like(aa, -(h @ z)))
    return float(STEEPNESS[np.argmin(z @ z - c1 * (a @ z) + c3 * (h @ z))])


def _project(c2: float, h: Array, z: Array) -> tuple[float, float, float, float]:
    """Sum of squares at c2, its c1 and c3, and the Gauss-Newton change of ln c2."""
    decay = np.exp(-c2 * h)
    columns = np.stack([1.0 - decay, -h])
    gram, right = columns @ columns.T, columns @ z
    linear = _bounded_solution(gram, right)
    residual = z - linear @ columns
    slope = c2 * linear[0] * h * decay  # of the curve by ln c2
    free = (linear > LOWER[::2]) & (linear < UPPER[::2])
    for column in _orthonormal(columns[free]):
        slope = slope - (column @ slope) * column
    square = float(slope @ slope)
    change = float(slope @ residual) / square if square > 0.0 else 0.0
    change = float(np.clip(change, -LONGEST_STEP, LONGEST_STEP))
    if (c2 <= LOWER[1] and change < 0) or (c2 >= UPPER[1] and change > 0):
        change = 0.0
    return float(residual @ residual), float(linear[0]), float(linear[1]), change


def _bounded_solution(gram: Array, right: Array) -> Array:
    """(c1, c3) of least squares within their bounds, shape (2,).

    The cost is convex: outside the bounds, its minimum lies on one of their four edges.
    """
    lower, upper = LOWER[::2], UPPER[::2]
    det = gram[0, 0] * gram[1, 1] - gram[0, 1] ** 2
    if det > 1e-14 * gram[0, 0] * gram[1, 1]:
        inside = np.linalg.solve(gram, right)
        if np.all(inside >= lower) and np.all(inside <= upper):
            return np.asarray(inside)
    edges = []
    for fixed, free in ((0, 1), (1, 0)):
        for bound in (lower[fixed], upper[fixed]):
            point = np.full(2, bound)
            square = gram[free, free]
            best = (right[free] - gram[0, 1] * bound) / square if square > 0.0 else lower[free]
            point[free] = np.clip(best, lower[free], upper[free])
            edges.append(point)
    return min(edges, key=lambda point: float(point @ gram @ point - 2.0 * point @ right))


def _orthonormal(columns: Array) -> list[Array]:
    """Orthonormal basis of the rows of `columns` by Gram-Schmidt, without those near zero."""
    basis: list[Array] = []
    for column in columns:
        rest = column
        for other in basis:
            rest = rest - (other @ rest) * other
        length = float(np.sqrt(rest @ rest))
        if length > 1e-10 * float(np.sqrt(column @ column)):
            basis.append(rest / length)
    return basis
