"""Variable projection against SciPy's bounded least squares on all three parameters."""

import numpy as np
import pytest
import scipy

from adhesion_can.estimation.likelihood import innovation, sensitivity, sum_of_squares
from adhesion_can.estimation.variable_projection import LOWER, UPPER, fit_least_squares
from adhesion_can.physics.burckhardt import adhesion


def least_squares(h, z, start):
    """Curve parameters by SciPy's trust-region reflective algorithm."""
    return scipy.optimize.least_squares(
        lambda theta: innovation(theta, h, z),
        np.clip(start, 1.001 * LOWER + 1e-6, 0.999 * UPPER),
        jac=lambda theta: -sensitivity(theta, h),
        bounds=(LOWER, UPPER),
        xtol=1e-12,
        ftol=1e-12,
        gtol=1e-12,
    ).x


def draw(rng, n, slip_max):
    """Slips and the adhesion of a random curve at them."""
    h = rng.uniform(0.0, slip_max, n)
    theta = (rng.uniform(0.05, 1.2), np.exp(rng.uniform(1.0, 6.0)), rng.uniform(0.0, 1.0))
    return h, adhesion(h, *theta), theta


@pytest.mark.parametrize("seed", range(20))
def test_as_scipy_from_the_truth(seed):
    rng = np.random.default_rng(seed)
    h, z, theta = draw(rng, 500, 0.3)
    z = z + rng.normal(0.0, 0.01, len(h))
    found = fit_least_squares(h, z)
    expected = least_squares(h, z, theta)
    ours, scipys = (sum_of_squares(values, h, z) for values in (found, expected))
    # Its valley may be another one: then it is the better one.
    assert ours <= scipys * (1.0 + 1e-9)
    if ours > scipys * (1.0 - 1e-6):
        assert found[0] == pytest.approx(expected[0], rel=1e-3)


@pytest.mark.parametrize("seed", range(20))
def test_without_noise_the_curve_itself(seed):
    h, z, theta = draw(np.random.default_rng(seed), 60, 0.3)
    assert fit_least_squares(h, z) == pytest.approx(theta, rel=1e-5, abs=1e-7)


@pytest.mark.parametrize("kind", ["noise", "negative", "line", "one slip", "no slip", "falling"])
@pytest.mark.parametrize("n", [1, 2, 3, 50])
@pytest.mark.parametrize("seed", range(5))
def test_data_that_no_curve_fits(kind, n, seed):
    rng = np.random.default_rng(seed)
    h = rng.uniform(0.0, 0.1, n)
    z = rng.normal(0.0, 0.1, n)
    if kind == "negative":
        z = -adhesion(h, 0.4, 40.0, 0.3)
    elif kind == "line":
        z = 50.0 * h
    elif kind == "one slip":
        h[:] = 0.02
    elif kind == "no slip":
        h[:] = 0.0
    elif kind == "falling":
        z = 0.3 * np.exp(-h / 0.05)
    found = fit_least_squares(h, z)
    assert np.all(found >= LOWER)
    assert np.all(found <= UPPER)
    for start in ([0.3, 30.0, 0.1], [1e-3, 2.0, 1e-3], [5.0, 300.0, 5.0]):
        best = sum_of_squares(least_squares(h, z, start), h, z)
        assert sum_of_squares(found, h, z) <= best * (1.0 + 1e-4) + 1e-12
