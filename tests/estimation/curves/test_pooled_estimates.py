"""The doubting tracker on rails that are not Burckhardt's: its estimates are the families'."""

from itertools import pairwise

import numpy as np
import pytest

from adhesion_can.estimation.doubt.estimator import DoubtingTracker
from adhesion_can.estimation.doubt.settings import EXACT
from adhesion_can.estimation.tracker.tracker import Tracker
from adhesion_can.physics.doubt import Doubt
from adhesion_can.physics.samples import Samples
from tests.estimation.curves.family_helpers import AXLES, burckhardt, make_samples, polach, top
from tests.seeds import first_quick

STEP_S = 0.2


def run(samples):
    """Estimates at every fifth of a second, with the times, s, and the mean speeds."""
    estimator = DoubtingTracker(Tracker(), AXLES, instruments=EXACT)
    edges = np.arange(0.0, samples.t_us[-1] * 1e-6 + STEP_S, STEP_S)
    found = []
    for begin, end in pairwise(edges):
        part = samples.select((samples.t_us >= begin * 1e6) & (samples.t_us < end * 1e6))
        estimate = estimator.update(part, round(end * 1e6))
        found.append((end, float(part.speed.mean()), estimate))
    return found


@pytest.mark.costly
@pytest.mark.parametrize("law", first_quick([polach(), burckhardt(c4=0.15)]), ids=["polach", "c4"])
def test_setpoints_are_those_of_the_family(law):
    """From 30 s on, two drives: identifiable in 80 %, within 2 and 10 % of the truth."""
    known = 0
    for seed in range(2):
        samples = make_samples(law, np.random.default_rng(seed), 40.0)
        late = [one for one in run(samples) if one[0] > 30.0]
        pooled = [one for one in late if one[2].identifiable.both]
        known += len(pooled) / len(late)
        for _, speed, estimate in pooled:
            mu_max, lambda_m = top(law, speed)
            assert estimate.mu_max == pytest.approx(mu_max, rel=0.02)
            assert estimate.lambda_m == pytest.approx(lambda_m, rel=0.1)
            assert estimate.doubt is not Doubt.NONE
            low, high = estimate.lambda_m_interval
            assert low < estimate.lambda_m < high
            c1, c2, c3 = estimate.theta
            assert np.log(c1 * c2 / c3) / c2 == pytest.approx(estimate.lambda_m, rel=1e-6)
        assert late[-1][2].family in {"polach", "burckhardt_c4"}
    assert known / 2 > 0.8


@pytest.mark.costly
def test_after_a_change_of_the_rail_the_old_curve_is_not_sent():
    """Polach's curve for 30 s, then a wet one: from 2 s on the stated interval has the new peak.

    It is wide: the two curves differ in shape, and the families are pooled over both.
    """
    for seed in range(2):
        rng = np.random.default_rng(seed)
        dry, wet = polach(), polach(mu0=0.22, stiffness=40.0, left=0.35, rate=0.25)
        parts = [make_samples(dry, rng, 30.0), make_samples(wet, rng, 8.0, begin_s=30.0)]
        late = [one for one in run(Samples.concatenate(parts)) if one[0] > 32.0]
        assert len(late) == 30
        for _, speed, estimate in late:
            mu_max, _ = top(wet, speed)
            error = abs(estimate.mu_max - mu_max)
            assert error < 3 * estimate.mu_max_std + 0.02 * mu_max
            assert estimate.doubt is not Doubt.NONE


def test_burckhardts_rail_needs_no_other_family():
    samples = make_samples(burckhardt(), np.random.default_rng(4), 30.0)
    for time_s, _, estimate in run(samples):
        if time_s > 10.0:
            assert estimate.family == "burckhardt"
            assert estimate.doubt is Doubt.NONE


@pytest.mark.costly
def test_a_dip_beyond_the_peak_leaves_its_place_unknown():
    """No family has two humps: after a minute λ_m is as uncertain as the families are; two drives.

    The Burckhardt curve with the drive's tangents alone would state 8 % of λ_m.
    """
    whole = burckhardt(c1=0.455, c2=25.3, c3=0.26)

    def law(s, v):
        return whole(s, v) - 0.062 * np.exp(-0.5 * ((s - 0.19) / 0.0145) ** 2)

    for seed in range(2):
        samples = make_samples(law, np.random.default_rng(seed), 60.0, reach=0.24)
        _, _, estimate = run(samples)[-1]
        assert estimate.doubt is Doubt.SHAPE
        assert not estimate.identifiable.lambda_m
        assert estimate.lambda_m_std > 0.2 * estimate.lambda_m
