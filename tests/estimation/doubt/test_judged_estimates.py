"""What a judged estimate makes of an assessment: standard deviations by hand, without a drive."""

from dataclasses import replace
from math import hypot, inf
from types import SimpleNamespace

import numpy as np
import pytest

from adhesion_can.estimation.doubt.assessment import UNKNOWN
from adhesion_can.estimation.doubt.estimator import DoubtingTracker
from adhesion_can.estimation.doubt.lasting_errors import LastingErrors
from adhesion_can.physics.curves import FAMILIES
from adhesion_can.physics.doubt import Doubt
from adhesion_can.physics.estimate import Estimate, Identifiable, PeakEstimate
from adhesion_can.physics.samples import Samples

NORMAL_90 = 1.645
MU, MU_STD, LAMBDA, LAMBDA_STD = 0.3, 0.002, 0.02, 0.0006
PLAIN = PeakEstimate(0.3, 0.02, 0.002, 0.0006)
POOLED = PeakEstimate(0.32, 0.024, 0.001, 0.0005)
NONE = Samples.curve(np.empty(0), np.empty(0))
SOME = replace(
    Samples.curve(np.full(4, 0.02), np.full(4, 0.3)),
    speed=np.array([9.0, 10.0, 11.0, 12.0]), load=np.full(4, 2e5),
)  # fmt: skip


def estimate(**changes):
    plain = Estimate(
        c1=0.35, c2=60.0, c3=0.3, covariance=np.diag([1e-6, 1.0, 1e-4]), mu_max=MU,
        mu_max_std=MU_STD, lambda_m=LAMBDA, lambda_m_std=LAMBDA_STD, noise_std=0.01, samples=500,
        identifiable=Identifiable(mu_max=True, lambda_m=True), surface_since_us=0,
        mu_max_interval=(MU - 0.003, MU + 0.004), lambda_m_interval=(0.0195, 0.0212),
        per_axle={1: (0.31, 0.021)},
    )  # fmt: skip
    return replace(plain, **changes)


class Monitor:
    """A monitor whose findings are given."""

    def __init__(self, assessment=UNKNOWN, **given):
        self.assessment, self.surface_holds, self.reached = assessment, True, 0.2
        self.level_std = self.level_scatter = self.slip = self.level = 0.0
        self.inflation = assessment.lasting.beyond_chance
        self.added = []
        for name, value in given.items():
            setattr(self, name, value)

    def slip_error(self, _):
        return self.slip

    def level_error(self, _):
        return self.level

    def add(self, samples, inner):
        self.added.append((samples, inner))
        return True


def judged(assessment=UNKNOWN, found=None, samples=NONE, **given):
    """The estimate that a tracker's one becomes."""
    inner = SimpleNamespace(update=lambda *_: found or estimate(), variance_inflation=1.0)
    tracker = DoubtingTracker(inner, 4)
    tracker._monitor = Monitor(assessment, **given)
    return tracker.update(samples, 0)


def assessed(doubt=Doubt.NONE, remaining=(1.0, 0.0), full=PLAIN, **more):
    return replace(
        UNKNOWN, doubt=doubt, remaining=LastingErrors(*remaining), plain=PLAIN, full=full, **more
    )


def test_before_the_first_assessment_the_place_is_as_uncertain_as_the_shape():
    found = judged()
    assert (found.mu_max, found.mu_max_std) == (MU, MU_STD)
    assert found.lambda_m_std == pytest.approx(hypot(LAMBDA_STD, 0.2 * LAMBDA))
    more = NORMAL_90 * 0.2 * LAMBDA
    assert found.lambda_m_interval == pytest.approx(
        (LAMBDA - hypot(0.0005, more), LAMBDA + hypot(0.0012, more))
    )
    assert found.doubt is Doubt.NOT_AVAILABLE
    assert found.family == "burckhardt"


def test_with_nothing_found_the_estimate_stays():
    found, before = judged(assessed()), estimate()
    assert found.doubt is Doubt.NONE
    for name in ("mu_max_std", "lambda_m_std"):
        assert getattr(found, name) == pytest.approx(getattr(before, name))
    for name in ("mu_max_interval", "lambda_m_interval"):
        assert getattr(found, name) == pytest.approx(getattr(before, name))
    assert found.identifiable == Identifiable(mu_max=True, lambda_m=True)


def test_errors_that_last_inflate_variances_and_intervals():
    """Nine times the variance, and a level that scatters by 0.006 of 0.3."""
    found = judged(assessed(remaining=(9.0, 0.006)))
    assert found.mu_max_std == pytest.approx(hypot(3.0 * MU_STD, 0.006))
    assert found.lambda_m_std == pytest.approx(3.0 * LAMBDA_STD)
    assert found.covariance == pytest.approx(9.0 * estimate().covariance)
    more = NORMAL_90 * 0.006
    assert found.mu_max_interval == pytest.approx(
        (MU - hypot(0.009, more), MU + hypot(0.012, more))
    )
    assert found.lambda_m_interval == pytest.approx((0.02 - 0.0015, 0.02 + 0.0036))
    # An interval that reaches far down is as many times as wide.
    low = judged(assessed(remaining=(9.0, 0.0)), estimate(mu_max_interval=(0.1, 0.304)))
    assert low.mu_max_interval == pytest.approx((MU - 0.6, MU + 0.012))
    # By chance alone nothing is inflated, and no level scatters.
    found = judged(assessed(remaining=(3.9, 0.006)))
    assert found.mu_max_std == pytest.approx(MU_STD)


def test_the_larger_one_of_two_scatters_of_the_level_counts():
    assert judged(assessed(), level_scatter=0.02).mu_max_std == pytest.approx(
        hypot(MU_STD, 0.02 * MU)
    )
    found = judged(assessed(remaining=(9.0, 0.006)), level_scatter=0.05)
    assert found.mu_max_std == pytest.approx(hypot(3.0 * MU_STD, 0.05 * MU))
    # With a doubt the distance to the full model is a part of that scatter.
    doubt = assessed(Doubt.SPEED, full=PeakEstimate(0.33, 0.02, 0.0, 0.0))
    assert judged(doubt, level_scatter=0.05).mu_max_std == pytest.approx(hypot(MU_STD, 0.1 * MU))
    assert judged(doubt, level_scatter=0.15).mu_max_std == pytest.approx(hypot(MU_STD, 0.15 * MU))


def test_the_larger_one_of_two_errors_of_the_place_counts():
    doubt = assessed(Doubt.SPEED, full=PeakEstimate(0.3, 0.022, 0.0, 0.0))
    for slip, share in ((0.05, 0.1), (0.15, 0.15)):
        found = judged(doubt, slip=slip)
        assert found.lambda_m_std == pytest.approx(hypot(LAMBDA_STD, share * LAMBDA))


def test_the_larger_one_of_two_errors_of_the_level_counts():
    doubt = assessed(Doubt.SPEED, full=PeakEstimate(0.33, 0.02, 0.0, 0.0))
    for level, share in ((0.05, 0.1), (0.15, 0.15)):
        found = judged(doubt, level=level)
        assert found.mu_max_std == pytest.approx(hypot(MU_STD, share * MU))


@pytest.mark.parametrize(
    ("scatter", "slip", "known"),
    [(0.029, 0.29, (True, True)), (0.031, 0.29, (False, True)), (0.029, 0.31, (True, False))],
)
def test_what_is_too_uncertain_is_not_identifiable(scatter, slip, known):
    """3 % of μ_max and 30 % of λ_m; what the tracker does not know stays unknown."""
    sure = estimate(mu_max_std=1e-6, lambda_m_std=1e-6)
    found = judged(assessed(), sure, level_scatter=scatter, slip=slip).identifiable
    assert (found.mu_max, found.lambda_m) == known
    nothing = replace(sure, identifiable=Identifiable(mu_max=False, lambda_m=False))
    found = judged(assessed(), nothing).identifiable
    assert not found.mu_max
    assert not found.lambda_m


def test_of_a_flat_curve_nothing_is_known():
    found = judged(assessed(), estimate(mu_max=0.0, lambda_m=0.0))
    assert (found.mu_max_std, found.lambda_m_std) == (inf, inf)
    assert found.identifiable == Identifiable(mu_max=False, lambda_m=False)


# ----------------------------------------------------------------- where families know it better


class Comparison:
    """Families whose leader has a peak."""

    def __init__(self, peak=POOLED):
        self.found, self.asked = peak, []
        magic = FAMILIES["magic_formula"]
        self.leader = SimpleNamespace(family=magic, values=(55.0, 1.4, 0.32, -0.7))

    def peak(self, conditions, end):
        self.asked.append((float(conditions.speed), float(conditions.load), end))
        return self.found


def test_the_pooled_peak_takes_the_place_of_the_trackers():
    comparison = Comparison()
    assessment = assessed(families=comparison, instrument_std=(0.003, 0.06))
    found = judged(assessment, samples=SOME, level_std=0.004)
    assert comparison.asked == [(10.5, 2e5, 0.5)]
    mu_std = hypot(0.001, 0.005 * 0.32)
    lambda_std = hypot(0.0005, 0.06 * 0.024)
    assert (found.mu_max, found.lambda_m) == (0.32, 0.024)
    assert found.mu_max_std == pytest.approx(mu_std)
    assert found.lambda_m_std == pytest.approx(lambda_std)
    assert found.mu_max_interval == pytest.approx(
        (0.32 - NORMAL_90 * mu_std, 0.32 + NORMAL_90 * mu_std)
    )
    assert found.lambda_m_interval == pytest.approx(
        (0.024 - NORMAL_90 * lambda_std, 0.024 + NORMAL_90 * lambda_std)
    )
    assert found.identifiable == Identifiable(mu_max=True, lambda_m=True)
    assert found.family == "magic_formula"
    # An axle differs from the pool by the same shares as before.
    assert found.per_axle[1] == pytest.approx((0.32 * 0.31 / 0.3, 0.024 * 0.021 / 0.02))
    # c1 and c2 are as uncertain as height and place, c3 as both.
    stds = np.sqrt(found.covariance.diagonal()) / found.theta
    level, place = mu_std / 0.32, lambda_std / 0.024
    assert stds == pytest.approx([level, place, hypot(level, place)])
    c1, c2, c3 = found.theta
    slip = np.linspace(1e-3, 0.2, 20_000)
    curve = c1 * (1.0 - np.exp(-c2 * slip)) - c3 * slip
    assert curve.max() == pytest.approx(0.32, rel=1e-6)
    assert slip[curve.argmax()] == pytest.approx(0.024, abs=2e-5)


@pytest.mark.parametrize(
    "given",
    [
        {"surface_holds": False},
        {"level_std": 0.04},
        {"reached": 0.0244},
        {"samples": NONE},  # no conditions yet
    ],
)
def test_the_trackers_peak_stays_where_families_do_not_know_it(given):
    assessment = assessed(families=Comparison())
    found = judged(assessment, **{"samples": SOME, **given})
    assert (found.mu_max, found.family) == (MU, "burckhardt")
    flat = assessed(families=Comparison(PeakEstimate(0.0, 0.02, 0.1, 0.1)))
    assert judged(flat, samples=SOME).mu_max == MU
    wide = assessed(families=Comparison(), instrument_std=(0.0, 0.31))
    assert judged(wide, samples=SOME).mu_max == MU


def test_what_no_family_knows_a_doubtful_shape_does_not_know_either():
    """At least as uncertain as the families' peak, which may lie beyond what was reached."""
    pooled = PeakEstimate(0.32, 0.024, 0.032, 0.006)
    full = PeakEstimate(0.3, 0.02, 0.0, 0.0)
    shape = assessed(Doubt.SHAPE, full=full, families=Comparison(pooled))
    found = judged(shape, samples=SOME)
    assert found.mu_max_std == pytest.approx(hypot(MU_STD, 0.1 * MU))
    assert found.lambda_m_std == pytest.approx(hypot(LAMBDA_STD, 0.25 * LAMBDA))
    speed = assessed(Doubt.SPEED, full=full, families=Comparison(pooled))
    assert judged(speed, samples=SOME).mu_max_std == pytest.approx(MU_STD)


# --------------------------------------------------------------------------------- from update


def updates(assessment, *calls, fresh=True):
    """A tracker after updates, and its monitor."""
    inner = SimpleNamespace(found=estimate(), variance_inflation=1.0)
    inner.update = lambda *_: inner.found
    tracker = DoubtingTracker(inner, 4)
    tracker._monitor = monitor = Monitor(assessment)
    monitor.add = lambda samples, one: monitor.added.append((samples, one)) or fresh
    return inner, tracker, monitor, [tracker.update(samples, 0) for samples in calls]


def test_the_tracker_learns_how_long_errors_last_from_a_new_assessment_alone():
    lasting = assessed(lasting=LastingErrors(7.0, 0.0))
    for fresh, samples, inflation in ((True, SOME, 7.0), (False, SOME, 1.0), (True, NONE, 1.0)):
        inner, _, monitor, _ = updates(lasting, samples, fresh=fresh)
        assert inner.variance_inflation == inflation
        assert len(monitor.added) == len(samples) // 4


def test_an_estimate_is_judged_again_when_it_or_its_assessment_is_another():
    comparison = Comparison()
    inner, tracker, _, (first,) = updates(assessed(families=comparison), SOME)
    assert tracker.update(SOME, 0) is not first  # a new assessment
    # The peak is computed again for another block or half a metre a second.
    assert len(comparison.asked) == 1
    faster = replace(SOME, speed=SOME.speed + 0.6)
    tracker.update(faster, 0)
    assert len(comparison.asked) == 2
    held = tracker.update(NONE, 0)
    assert tracker.update(NONE, 0) is held
    inner.found = estimate(samples=501)
    assert tracker.update(NONE, 0).samples == 501
    inner.found = None
    assert tracker.update(SOME, 0) is None
