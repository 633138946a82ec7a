"""The worlds' own fit of c1..c3: variable projection with SciPy, weights from the noise."""

import numpy as np

from tests.worlds.fitted_curve import project
from tests.worlds.plant import View
from tests.worlds.rail import Floats, Ints

THIN = 5


def fit(view: View, rows: Ints | None = None) -> Floats:
    """c1, c2, c3 of one surface from the rows that can be used (each fifth of them).

    Twice: the second time the weights know the slope of the curve, and so what the noise of the
    slip adds.
    """
    if rows is None:
        rows = np.flatnonzero(view.use)
    v = view
    rows = rows[::THIN]
    whole, share = v.contact.entered()
    whole, share = whole[rows].ravel(), share[rows].ravel()
    factor = np.broadcast_to(v.contact.factor, v.adhesion.shape)[rows].ravel() * share
    observed = v.adhesion[rows].ravel() - factor * v.contact.second_hump(whole)
    std, slip_std = v.std[rows].ravel(), v.slip_std[rows].ravel()
    if v.limits is not None:
        # Readings that the sensor cut off carry no information about the curve.
        inside = (v.adhesion > v.limits[0] + 1e-3) & (v.adhesion < v.limits[1] - 1e-3)
        std = np.where(inside[rows].ravel(), std, 1e3)
    c = project(whole, factor, observed, 1 / std)
    for _ in range(2):
        slope = factor * (c[0] * c[1] * np.exp(-c[1] * whole) - c[2])
        c = project(whole, factor, observed, 1 / np.hypot(std, slope * slip_std))
    return c


def fitted_curves(view: View, surface: Ints, outside: Ints | None = None) -> dict[int, Floats]:
    """Curve of each surface, fitted to the rows given (all that can be used)."""
    rows = np.flatnonzero(view.use) if outside is None else outside
    curves = {}
    for number in np.unique(surface):
        own = rows[surface[rows] == number]
        # A surface that lies within what is held out altogether must be fitted there.
        own = own if len(own) > 200 else np.flatnonzero(view.use & (surface == number))
        curves[int(number)] = fit(view, own)
    return curves


def residual_of(view: View, surface: Ints, curves: dict[int, Floats]) -> Floats:
    """Residual (n, 6) of curves by surface."""
    c = np.empty((len(view.t), 3))
    for number in np.unique(surface):
        c[surface == number] = curves[int(number)]
    return view.residual(c)


def fitted_residual(view: View, surface: Ints, outside: Ints | None = None) -> Floats:
    """Residual (n, 6) of curves fitted to the rows given (all that can be used), by surface."""
    return residual_of(view, surface, fitted_curves(view, surface, outside))


def rmse(residual: Floats) -> float:
    """Root mean square."""
    return float(np.sqrt(np.mean(residual * residual)))
