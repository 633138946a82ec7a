"""The monitor on made-up samples and given estimates: its blocks, and what it makes of them."""

from dataclasses import replace
from math import inf

import numpy as np
import pytest

from adhesion_can.estimation.doubt.blocks import CURVE, fit_blocks
from adhesion_can.estimation.doubt.directions import (
    EFFORT_BIAS,
    SPEED_SCALE,
    TIME,
    build_directions,
)
from adhesion_can.estimation.doubt.lasting_errors import estimate_lasting_errors
from adhesion_can.estimation.doubt.monitor import DoubtMonitor
from adhesion_can.estimation.doubt.pooled_curve import PooledCurve
from adhesion_can.estimation.doubt.settings import DoubtSettings, InstrumentUncertainty
from adhesion_can.estimation.doubt.surface_changes import _is_time
from adhesion_can.physics.doubt import Doubt
from adhesion_can.physics.estimate import Estimate, Identifiable
from adhesion_can.physics.samples import Samples
from tests.estimation.doubt.doubt_helpers import (
    AXLES,
    NOISE,
    THETA,
    curve,
    in_seconds,
    make_samples,
)

OTHER = (0.25, 90.0, 0.2)
LAMBDA_M = float(np.log(THETA[0] * THETA[1] / THETA[2]) / THETA[1])
MU_MAX = float(curve(np.array([LAMBDA_M]))[0])


def estimate(**changes):
    plain = Estimate(
        *THETA, covariance=np.diag([1e-6, 1.0, 1e-6]), mu_max=MU_MAX, mu_max_std=0.001,
        lambda_m=LAMBDA_M, lambda_m_std=0.001, noise_std=NOISE, samples=10_000,
        identifiable=Identifiable(mu_max=True, lambda_m=True), surface_since_us=0,
    )  # fmt: skip
    return replace(plain, **changes)


def monitor():
    return DoubtMonitor(AXLES, DoubtSettings(), InstrumentUncertainty(), 0.5)


def feed(found, samples, given=None):
    """Feed samples in updates of a tenth of a second; times of the new assessments, s."""
    given = given or estimate()
    return [
        float(part.t_us[-1]) * 1e-6 for part in in_seconds(samples, 0.1) if found.add(part, given)
    ]


@pytest.fixture(scope="module")
def plain():
    """Half a minute without an error, as it was assessed."""
    found = monitor()
    times = feed(found, make_samples(np.random.default_rng(1), 30.0))
    return found, times


def test_every_half_second_there_is_a_block_and_none_of_them_doubts(plain):
    found, times = plain
    # An update ends 80 ms after its first sample: six of them are more than half a second.
    assert np.diff([0.0, *times]) == pytest.approx([0.58, *[0.6] * 49], abs=1e-6)
    assert found.assessment.doubt is Doubt.NONE
    assert found.assessment.names == ()
    assert found.level_scatter == 0.0
    assert found.surface_holds


def test_both_peaks_are_that_of_the_curve_and_the_full_one_is_less_certain(plain):
    assessment = plain[0].assessment
    for peak in (assessment.plain, assessment.full):
        assert peak.mu_max == pytest.approx(MU_MAX, rel=0.02)
        assert peak.lambda_m == pytest.approx(LAMBDA_M, rel=0.08)
    assert assessment.full.mu_max_std > assessment.plain.mu_max_std
    assert assessment.full.lambda_m_std > assessment.plain.lambda_m_std
    assert assessment.lasting.inflation < 4.0


def test_what_the_wheels_have_reached_is_nearly_the_largest_slip_of_late(plain):
    assert plain[0].reached == pytest.approx(0.12, rel=0.03)


@pytest.mark.parametrize(
    ("hidden", "doubt"),
    [
        ({"load_exponent": 1.0}, Doubt.AXLE_LOAD),
        ({"effort_bias": 8e3}, Doubt.DIRECTION),
    ],
)
def test_an_error_of_the_model_is_doubted_under_its_name(hidden, doubt):
    found = monitor()
    feed(found, make_samples(np.random.default_rng(2), 30.0, **hidden))
    assert found.assessment.doubt is doubt
    assert found.assessment.names
    assert found.assessment.families is not None
    # Some ten comparisons of half a second, of as many as are kept.
    assert 10 <= len(found._level_squares) <= 40


def test_the_latest_samples_are_compared_with_the_families_each_half_second():
    found = monitor()
    samples = make_samples(np.random.default_rng(3), 30.0, load_exponent=1.0)
    feed(found, samples.select(samples.t_us < 25_000_000))
    assert found.assessment.families is not None
    found._level_squares.clear()
    feed(found, samples.select(samples.t_us >= 25_000_000))
    # Updates of 80 ms between their first and last stamp: five or six of them a comparison.
    assert 7 <= len(found._level_squares) <= 10
    later = make_samples(np.random.default_rng(4), 2.0, begin_s=30.0, theta=(0.2, 33.0, 0.19))
    seen = []
    for part in in_seconds(later, 0.1):
        found.add(part, estimate())
        seen.append(found.surface_holds)
    assert not all(seen)


@pytest.mark.parametrize(
    "unknown",
    [{"mu_max_std": inf}, {"c3": 0.0}, {"c3": 0.41 * 33.0}, {"c3": -0.1}],
)
def test_without_a_curve_that_has_a_peak_there_is_no_block(unknown):
    found = monitor()
    samples = make_samples(np.random.default_rng(1), 12.0)
    assert feed(found, samples, estimate(**unknown)) == []
    assert found.assessment.plain is None
    assert found.reached == 0.0


def test_a_block_of_few_usable_samples_is_none():
    found = monitor()
    samples = make_samples(np.random.default_rng(1), 10.0)
    few = replace(samples, slip=np.where(np.arange(len(samples)) % 10 == 0, samples.slip, 0.9))
    assert feed(found, few) == []


def test_errors_that_last_are_those_of_the_time_before_a_change_that_may_be_one():
    """The samples after it lie on another curve, which no error of that size makes."""
    found, rng = monitor(), np.random.default_rng(5)
    feed(found, make_samples(rng, 20.0))
    before = found.assessment.lasting.inflation
    changed = estimate(surface_since_us=20_000_000)
    seen = []
    for part in in_seconds(make_samples(rng, 1.5, begin_s=20.0, theta=OTHER), 0.1):
        found.add(part, changed)
        seen.append(found.assessment.lasting.inflation)
    assert max(seen) < 4.0
    assert before < 4.0


def test_two_blocks_before_a_possible_change_count_as_little_as_those_after_it():
    """With fewer than six blocks before them, what was known of the errors holds."""
    found = monitor()
    feed(found, make_samples(np.random.default_rng(5), 20.0))
    series, before, at = found._series, found.assessment.lasting, PooledCurve(THETA)
    series.candidates = [7]
    assert found._lasting_errors(series.reduced(at), at) is before
    series.candidates = [8]
    six = series.reduced(fit_blocks(series.blocks[:6], THETA))
    assert found._lasting_errors(series.reduced(at), at) == estimate_lasting_errors(six, 6)


@pytest.mark.parametrize("axles", [1, 4])
def test_a_change_may_look_like_the_time_alone(axles):
    directions = build_directions(axles)
    place = CURVE + [direction.name for direction in directions].index(TIME)
    size = CURVE + len(directions)
    assert [k for k in range(size) if _is_time(k, directions)] == [place]


def test_a_change_is_confirmed_and_the_new_curve_takes_its_place():
    found, rng = monitor(), np.random.default_rng(6)
    feed(found, make_samples(rng, 20.0))
    feed(found, make_samples(rng, 12.0, begin_s=20.0, theta=OTHER), estimate(surface_since_us=1))
    c1, c2, c3 = OTHER
    lambda_m = np.log(c1 * c2 / c3) / c2
    top = float(curve(np.array([lambda_m]), OTHER)[0])
    assert found.assessment.plain.mu_max == pytest.approx(top, rel=0.03)
    assert found.assessment.doubt is Doubt.NONE


def test_the_error_of_the_place_is_the_distance_and_the_scatter_unless_a_change_may_be(plain):
    found, _ = plain
    place, scatter = found.assessment.plain.lambda_m, found.assessment.lambda_m_scatter
    assert found.slip_error(place) == pytest.approx(scatter)
    assert found.slip_error(place / 1.5) == pytest.approx(np.hypot(0.5, scatter))
    assert monitor().slip_error(0.02) == 0.0


def test_what_instruments_may_be_wrong_by_is_in_the_units_of_the_directions():
    names = [direction.name for direction in build_directions(AXLES)]
    scale, bias = CURVE + names.index(SPEED_SCALE), CURVE + names.index(EFFORT_BIAS)

    def priors(**stds):
        instruments = InstrumentUncertainty(**stds)
        return DoubtMonitor(AXLES, DoubtSettings(), instruments, 0.5)._instruments

    assert priors(speed_error_std=0.004, effort_bias_std=2500.0) == {scale: 0.004, bias: 2.5}
    assert priors(speed_error_std=0.0, effort_bias_std=2500.0) == {bias: 2.5}
    assert priors(speed_error_std=0.0, effort_bias_std=0.0) == {}


def test_the_error_of_the_level_is_the_distance_to_the_plain_peak_while_the_speed_wanders(plain):
    assert plain[0].level_error(0.9 * MU_MAX) == 0.0
    wander = InstrumentUncertainty(speed_wander_std=0.003)
    found = DoubtMonitor(AXLES, DoubtSettings(), wander, 0.5)
    assert found.level_error(MU_MAX) == 0.0
    feed(found, make_samples(np.random.default_rng(8), 10.0))
    peak = found.assessment.plain
    wanted = np.hypot(0.25, 1.25 * peak.mu_max_std / peak.mu_max)
    assert found.level_error(0.8 * peak.mu_max) == pytest.approx(wanted)
    assert peak.mu_max_std > 0.0
    found._series.add_candidate()
    assert found.level_error(0.8 * peak.mu_max) == 0.0


def test_no_samples_at_all_are_no_block():
    found = monitor()
    assert found.level_std == 0.0
    one = make_samples(np.random.default_rng(1), 0.1)
    assert not found.add(one, estimate())
    assert len(Samples.concatenate(found._waiting)) == len(one)
