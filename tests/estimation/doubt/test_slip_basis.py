"""The slip basis holds every smooth curve through the origin."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from adhesion_can.estimation.doubt import slip_basis

SLIP = np.geomspace(1e-4, 0.49, 60)


@given(
    c1=st.floats(0.05, 1.0),
    c2=st.floats(3.0, 200.0),
    shape=st.floats(1.5, 6.0),
)
def test_a_curve_and_its_slope_lie_in_the_basis(c1: float, c2: float, shape: float) -> None:
    c3 = c1 * c2 * np.exp(-shape)

    def curve(slip: np.ndarray) -> np.ndarray:
        return np.asarray(-c1 * np.expm1(-c2 * slip) - c3 * slip)

    coefficients = slip_basis.projection() @ curve(slip_basis.GRID)
    values, slopes = slip_basis.evaluate(SLIP)
    assert values @ coefficients == pytest.approx(curve(SLIP), abs=1e-4 * c1)
    slope = c1 * c2 * np.exp(-c2 * SLIP) - c3
    assert slopes @ coefficients == pytest.approx(slope, abs=5e-3 * c1 * c2)


def test_no_function_has_adhesion_without_slip() -> None:
    values, slopes = slip_basis.evaluate(np.zeros(1))
    assert values == pytest.approx(0.0, abs=1e-12)
    assert slopes.max() > 1.0


def test_slopes_are_those_of_the_values() -> None:
    # By steps of x = ln(1 + slip/h) that are wide against those of the table.
    step = 0.02 * (slip_basis.H + SLIP[:, None])
    high, _ = slip_basis.evaluate(SLIP + step[:, 0])
    low, _ = slip_basis.evaluate(np.maximum(SLIP - step[:, 0], 0.0))
    span = SLIP + step[:, 0] - np.maximum(SLIP - step[:, 0], 0.0)
    _, slopes = slip_basis.evaluate(SLIP)
    scale = 1.0 / (slip_basis.H + SLIP[:, None])
    inside = step[:, 0] < SLIP
    found = ((high - low) / span[:, None] / scale)[inside]
    assert found == pytest.approx((slopes / scale)[inside], abs=0.1)


def test_a_local_bump_of_the_curve_can_be_shown() -> None:
    bump = np.exp(-0.5 * ((slip_basis.GRID - 0.08) / 0.015) ** 2)
    shown = slip_basis.grid_values() @ (slip_basis.projection() @ bump)
    assert shown == pytest.approx(bump, abs=0.1)
