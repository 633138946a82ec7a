"""Errors of readings by several laws at once."""

from dataclasses import dataclass

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from adhesion_can.physics.instrument_laws import (
    LEAST_SENSOR_GAIN,
    Quantity,
    ReadingError,
    total_error,
)
from adhesion_can.physics.lag_states import LagStates

NO_SITUATION = None


@dataclass(frozen=True)
class Law:
    """A law of three numbers."""

    relative: float
    absolute: float = 0.0
    relative_rate: float = 0.0
    quantity: Quantity = Quantity.EFFORT
    needs: frozenset = frozenset()
    covariates: tuple = ()

    def error(self, _situation, _lags):
        return ReadingError(self.relative, self.absolute, self.relative_rate)


def total(*laws):
    return total_error(laws, Quantity.EFFORT, NO_SITUATION, LagStates())


@given(st.lists(st.floats(-0.3, 0.3), max_size=3))
def test_gains_in_a_chain_multiply(errors):
    gain = 1.0 + total(*(Law(one) for one in errors)).relative
    assert gain == pytest.approx(max(np.prod([1.0 + one for one in errors]), LEAST_SENSOR_GAIN))


@given(st.lists(st.floats(-3.0, 3.0), max_size=4))
def test_no_reading_loses_its_whole_value(errors):
    """A drift of −0.002/s beside a brake of 0.6 was a gain of 0 after 200 s."""
    assert 1.0 + total(*(Law(one) for one in errors)).relative >= LEAST_SENSOR_GAIN - 1e-12


def test_zeros_add_up_and_other_quantities_do_not_count():
    other = Law(0.5, 7.0, quantity=Quantity.LOAD)
    found = total(Law(0.1, 2.0), Law(0.2, 3.0), other)
    assert found.absolute == pytest.approx(5.0)
    assert found.relative == pytest.approx(0.32)


def test_the_rate_is_that_of_the_product():
    """(1 + a)(1 + b) with a and b that change in time; the oracle is a difference quotient."""
    a, b, da, db, dt = 0.2, -0.1, 0.03, 0.05, 1e-6
    later = (1 + a + da * dt) * (1 + b + db * dt)
    expected = (later - (1 + a) * (1 + b)) / dt
    assert total(Law(a, 0.0, da), Law(b, 0.0, db)).relative_rate == pytest.approx(
        expected, rel=1e-6
    )
