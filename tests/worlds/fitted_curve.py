"""Least squares of c1..c3 by variable projection, with SciPy."""

import numpy as np
from scipy.optimize import minimize_scalar

from tests.worlds.rail import Floats


def project(whole: Floats, factor: Floats, observed: Floats, weight: Floats) -> Floats:
    """c2 by search, c1 and c3 by least squares for each; c3 not below 0."""
    target, falls = weight * observed, -weight * factor * whole

    def best(log_c2: float) -> tuple[float, Floats]:
        rises = weight * factor * -np.expm1(-np.exp(log_c2) * whole)
        rr, rf, ff = rises @ rises, rises @ falls, falls @ falls
        rt, ft = rises @ target, falls @ target
        c1, c3 = np.linalg.solve([[rr, rf], [rf, ff + 1e-12]], [rt, ft])
        if c3 < 0:
            c1, c3 = rt / rr, 0.0
        left = target - c1 * rises - c3 * falls
        return float(left @ left), np.array([c1, np.exp(log_c2), c3])

    # A coarse look first: far off the sum of squares need not have one valley only.
    grid = np.linspace(np.log(5), np.log(600), 9)
    k = int(np.argmin([best(x)[0] for x in grid]))
    bounds = (grid[max(k - 1, 0)], grid[min(k + 1, len(grid) - 1)])
    found = minimize_scalar(
        lambda x: best(float(x))[0], bounds=bounds, method="bounded", options={"xatol": 2e-3}
    )
    return best(float(found.x))[1]
