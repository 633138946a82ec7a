"""What the model leaves out of a peak's standard deviation, by hand."""

from dataclasses import replace
from math import inf

import numpy as np
import pytest

from adhesion_can.estimation.doubt.assessment import UNKNOWN
from adhesion_can.estimation.doubt.monitor import further_std
from adhesion_can.physics.doubt import Doubt
from adhesion_can.physics.estimate import Estimate, Identifiable, PeakEstimate

PLAIN = PeakEstimate(0.30, 0.020, 0.003, 0.0005)
FULL = PeakEstimate(0.33, 0.023, 0.005, 0.0013)


def estimate(mu_max=0.25, lambda_m=0.016):
    return Estimate(
        c1=0.4, c2=60.0, c3=0.3, covariance=np.eye(3), mu_max=mu_max, mu_max_std=0.001,
        lambda_m=lambda_m, lambda_m_std=0.002, noise_std=0.01, samples=500,
        identifiable=Identifiable(mu_max=True, lambda_m=True), surface_since_us=0,
    )  # fmt: skip


def assessed(doubt, plain=PLAIN, full=FULL):
    return replace(UNKNOWN, doubt=doubt, plain=plain, full=full)


@pytest.mark.parametrize("doubt", [one for one in Doubt if one is not Doubt.NONE])
def test_with_a_doubt_it_is_the_distance_to_the_full_model_and_what_that_knows(doubt):
    found = further_std(assessed(doubt), estimate())
    wanted = ((0.08**2 + 0.005**2) ** 0.5 / 0.25, (0.007**2 + 0.0013**2) ** 0.5 / 0.016)
    assert found == pytest.approx(wanted)


def test_without_a_doubt_it_is_what_the_instruments_move_beside_what_the_plain_curve_knows():
    """3, 4 and 5: the plain curve's own variance does not count twice."""
    found = further_std(assessed(Doubt.NONE), estimate())
    assert found == pytest.approx(
        ((0.1**2 + (0.004 / 0.30) ** 2) ** 0.5, (0.15**2 + (0.0012 / 0.020) ** 2) ** 0.5)
    )
    # A fit that is more certain than the plain one adds its distance alone.
    surer = FULL._replace(mu_max_std=0.001, lambda_m_std=0.0001)
    assert further_std(assessed(Doubt.NONE, full=surer), estimate()) == pytest.approx((0.1, 0.15))
    assert further_std(assessed(Doubt.NONE, full=PLAIN), estimate()) == (0.0, 0.0)


def test_before_the_first_fits_nothing_is_added_and_a_flat_one_leaves_nothing_known():
    assert further_std(UNKNOWN, estimate()) == (0.0, 0.0)
    assert further_std(assessed(Doubt.NONE, plain=None), estimate()) == (0.0, 0.0)
    assert further_std(assessed(Doubt.SPEED, full=None), estimate()) == (0.0, 0.0)
    for flat in (PLAIN._replace(mu_max=0.0), PLAIN._replace(lambda_m=0.0)):
        for doubt in (Doubt.NONE, Doubt.SPEED):
            assert further_std(assessed(doubt, plain=flat), estimate()) == (inf, inf)
