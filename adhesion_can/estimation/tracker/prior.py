"""Prior distribution of an adhesion curve: a library of surfaces and a wide component.

A mixture of Student's t (4 degrees of freedom) in (ln c1, ln c2, ln s), s = c2 λ_m = ln(c1 c2/c3)
being the shape of the curve: 2.6 to 5.7 for the published ones. One wide component, and a narrow
one around each surface of the library. The heavy tails let data always outweigh the prior.
"""

from collections.abc import Iterable, Sequence
from math import gamma, log, pi

import numpy as np

from adhesion_can.arrays import Array
from adhesion_can.estimation.tracker.settings import C1_MAX, C2_RANGE, PriorSettings
from adhesion_can.values import Value

FREEDOM = 4.0
"""Degrees of freedom of the t distributions."""
_NORM = gamma((FREEDOM + 3) / 2) / (gamma(FREEDOM / 2) * (FREEDOM * pi) ** 1.5)


def shape_coordinates(theta: Array) -> Array:
    """(ln c1, ln c2, ln s) of (c1, c2, c3), shape (n, 3); NaN where the curve has no peak."""
    c1, c2, c3 = theta.T
    with np.errstate(invalid="ignore", divide="ignore"):
        s = np.log(c1 * c2 / c3)
        return np.column_stack([np.log(c1), np.log(c2), np.log(s)])


def from_shape_coordinates(phi: Array) -> Array:
    """Inverse of `shape_coordinates`, shape (n, 3)."""
    c1, c2, s = np.exp(phi).T
    return np.column_stack([c1, c2, c1 * c2 * np.exp(-s)])


class Prior(Value):
    """Prior density of curves: a mixture of Student's t distributions.

    Args:
        settings: Components of the prior.
        learned: (c1, c2, c3) of surfaces identified so far. With the library they share the weight
            that the wide component leaves, each with three times the weight of one of the library.

    """

    def __init__(self, settings: PriorSettings, learned: Iterable[Sequence[float]] = ()) -> None:
        known = [surface.theta for surface in settings.surfaces()]
        identified = [tuple(map(float, theta)) for theta in learned]
        c1, c2, s = settings.wide_theta
        wide = np.log([[c1, c2, s]])
        rest = np.array([*known, *identified], dtype=np.float64).reshape(-1, 3)
        self._centre = np.concatenate([wide, shape_coordinates(rest)])
        shares = np.array([1.0] * len(known) + [3.0] * len(identified))
        narrow = (1.0 - settings.wide_weight) * shares / max(shares.sum(), 1.0)
        self._weight = np.concatenate([[1.0 - narrow.sum()], narrow])
        self._std = np.array([settings.wide_std] + [settings.narrow_std] * len(rest))
        with np.errstate(divide="ignore"):  # of weight 0: no density anywhere
            self._log_scale = np.log(self._weight * _NORM / self._std.prod(axis=1))
        self._inverse = 1.0 / self._std
        self._precision = self._inverse**2
        self._pull = self._precision * self._centre
        self._square = (self._pull * self._centre).sum(axis=1)

    def log_density(self, phi: Array) -> Array:
        """Log density at points (ln c1, ln c2, ln s), shape (n,) from (n, 3)."""
        # The squares of the distances as products of matrices: many curves are asked at once.
        square = (phi * phi) @ self._precision.T - 2.0 * phi @ self._pull.T + self._square
        log_t = self._log_scale - (FREEDOM + 3) / 2 * np.log1p(square / FREEDOM)
        top = log_t.max(axis=1)
        return np.asarray(top + np.log(np.exp(log_t - top[:, None]).sum(axis=1)))

    def log_marginal(self, column: int, values: Array) -> Array:
        """Log marginal density of one of (ln c1, ln c2, ln s) at values (n,), shape (n,)."""
        z = (values[:, None] - self._centre[:, column]) * self._inverse[:, column]
        norm = gamma((FREEDOM + 1) / 2) / (gamma(FREEDOM / 2) * (FREEDOM * pi) ** 0.5)
        scale = self._weight * norm * self._inverse[:, column]
        density = scale * (1.0 + z * z / FREEDOM) ** (-(FREEDOM + 1) / 2)
        return np.asarray(np.log(density.sum(axis=1)))

    def sample(self, size: int, rng: np.random.Generator) -> Array:
        """Random curves (c1, c2, c3) with c1 < `C1_MAX`, c2 in `C2_RANGE`; shape (size, 3)."""
        low, high = log(C2_RANGE[0]), log(C2_RANGE[1])
        drawn = np.empty((0, 3))
        while len(drawn) < size:
            which = rng.choice(len(self._weight), size, p=self._weight / self._weight.sum())
            chi = np.sqrt(rng.chisquare(FREEDOM, size) / FREEDOM)
            step = rng.standard_normal((size, 3)) / chi[:, None]
            phi = self._centre[which] + self._std[which] * step
            inside = (phi[:, 0] < log(C1_MAX)) & (phi[:, 1] >= low) & (phi[:, 1] <= high)
            drawn = np.concatenate([drawn, phi[inside]])
        return from_shape_coordinates(drawn[:size])
