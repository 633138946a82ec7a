"""FadingMemories of several lengths, and what single axles have of their own."""

from copy import deepcopy
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from adhesion_can.estimation.tracker.axle_deviations import AxleDeviations
from adhesion_can.estimation.tracker.curve_sums import Points
from adhesion_can.estimation.tracker.increment import increment
from adhesion_can.estimation.tracker.layout import CORRECTED, DOF
from adhesion_can.estimation.tracker.memories import FadingMemories
from adhesion_can.estimation.tracker.posterior import (
    NoisePrior,
    log_weights,
    normalise,
)
from adhesion_can.estimation.tracker.prior import Prior
from adhesion_can.estimation.tracker.settings import (
    AxleSettings,
    MemorySettings,
    PriorSettings,
    TrackerSettings,
)
from adhesion_can.estimation.tracker.tracker import Tracker
from adhesion_can.physics.burckhardt import RAIL, adhesion, adhesion_slope, peak
from adhesion_can.physics.samples import Samples

FIXED = settings(derandomize=True, deadline=None, max_examples=25)
DRY, WET, GREASY = (surface.theta for surface in RAIL)
SLIP_MAX = 0.5
ONE_MEMORY = MemorySettings(times_s=(3600.0,))


def sums_of(h, z):
    zero = np.zeros(len(h))
    points = Points(h, z, zero, zero, zero, np.zeros(len(h), dtype=np.int64), np.ones(len(h)))
    return increment(points, zero, 1e-4, SLIP_MAX)[CORRECTED]


def both(sums):
    """The same sums with corrected scores and with the slips as measured."""
    return np.stack([sums, sums])


def memories(chosen=None, size=128):
    chosen = chosen or MemorySettings()
    return FadingMemories(chosen, Prior(PriorSettings()), NoisePrior(1e-4, 4.0), SLIP_MAX, size)


def begun(theta=DRY, n=60, **chosen):
    rng = np.random.default_rng(1)
    h = rng.uniform(0, 0.2, n)
    ours = memories(**chosen)
    ours.restart(sums_of(h, adhesion(h, *theta) + 0.01 * rng.standard_normal(n)), ours.noise)
    return ours


# ------------------------------------------------------------------------------------- memories


def test_sums_fade_by_the_time_of_each_memory():
    ours = begun()
    before = ours._sums.copy()
    ours.fade(2.0)
    for row, old, time in zip(ours._sums, before, MemorySettings().times_s, strict=True):
        np.testing.assert_allclose(row, old * np.exp(-2.0 / time), rtol=1e-12)
    at_once = ours._sums.copy()
    parts = begun()
    for _ in range(4):
        parts.fade(0.5)
    np.testing.assert_allclose(parts._sums, at_once, rtol=1e-12)
    ours.fade(0.0)
    np.testing.assert_array_equal(ours._sums, at_once)


def test_probabilities_return_to_their_prior():
    ours = begun()
    start = np.array(ours._probability)
    assert start[0] == pytest.approx(1 - MemorySettings().drift)
    away = []
    for _ in range(5):
        ours._probability = ours._probability if away else [0.0, 0.0, 1.0]
        ours.fade(60.0)
        assert sum(ours._probability) == pytest.approx(1)
        away.append(np.abs(np.array(ours._probability) - start).max())
    assert all(later < before for before, later in pairwise(away))


def test_probabilities_do_not_depend_on_the_update_rate():
    rare, often = begun(), begun()
    for ours, times in ((rare, 1), (often, 3000)):
        ours._probability = [0.0, 0.0, 1.0]
        for _ in range(times):
            ours.fade(60.0 / times)
    np.testing.assert_allclose(rare._probability, often._probability, atol=0.002)


def test_prediction_is_the_density_of_all_curves_of_all_memories():
    ours = begun()
    ours._probability = [0.5, 0.3, 0.2]
    probability, weights = np.array(ours._probability), ours._weights.copy()
    rng = np.random.default_rng(3)
    h = rng.uniform(0, 0.2, 3)
    z = adhesion(h, *DRY) + 0.01 * rng.standard_normal(3)
    costs, cost = ours.predict(both(sums_of(h, z)))
    density = np.zeros(3)
    for i, curves in enumerate(ours._curves):
        r = z[:, None] - adhesion(h[:, None], *curves.theta.T)
        np.testing.assert_allclose(costs[i], (r * r).sum(axis=0), rtol=1e-6, atol=1e-8)
        density[i] = weights[i] @ np.exp(-0.5 * (r * r).sum(axis=0) / ours.noise_var)
    assert cost == pytest.approx([-2 * ours.noise_var * np.log(probability @ density)] * 2)
    np.testing.assert_allclose(
        ours._probability, probability * density / (probability @ density), rtol=1e-6
    )


def test_no_single_update_decides_the_probabilities():
    ours = begun()
    ours._weights = ours._weights.copy()
    # The first memory is made to predict badly: its weight sits on its worst curve for the sample.
    h = np.array([0.1])
    added = sums_of(h, adhesion(h, *DRY))
    worst = np.argmax(ours._curves[0].costs(added))
    ours._weights[0] = 0.0
    ours._weights[0, worst] = 1.0
    before = ours._probability.copy()
    ours.predict(both(added))
    assert ours._probability[0] / ours._probability[1] >= np.exp(-3.0) * before[0] / before[1] * (
        1 - 1e-9
    )


def test_what_is_taken_is_in_all_memories_and_weighs_the_curves():
    ours = begun()
    rng = np.random.default_rng(5)
    h = rng.uniform(0, 0.2, 500)
    added = sums_of(h, adhesion(h, *DRY) + 0.01 * rng.standard_normal(500))
    before = ours._sums.copy()
    costs, _ = ours.predict(both(added))
    ours.add(added, costs)
    ours.refresh()
    np.testing.assert_allclose(ours._sums, before + added)
    assert ours.count == 560
    assert np.sqrt(ours.noise_var) == pytest.approx(0.01, rel=0.1)
    np.testing.assert_allclose(ours._weights.sum(axis=1), 1)
    # The costs kept are those of the curves kept.
    for i, curves in enumerate(ours._curves):
        np.testing.assert_allclose(ours._costs[i], curves.costs(ours._sums[i]), rtol=1e-6)
    parts = ours.leading(0.0)
    assert sum(w.sum() for _, w in parts) == pytest.approx(1)


def test_a_copy_is_not_changed_by_what_the_original_draws_and_shares_its_curves():
    ours = begun()
    twin, reference = deepcopy(ours), begun()
    assert twin._all.at_x is ours._all.at_x
    h = np.linspace(0.01, 0.2, 40)
    ours.restart(sums_of(h, adhesion(h, *WET)), ours.noise)
    more = both(sums_of(h, adhesion(h, *DRY)))
    for one, other in zip(twin.predict(more), reference.predict(more), strict=True):
        assert np.array_equal(one, other)
    assert not np.array_equal(twin._all.at_x, ours._all.at_x)


def test_curves_are_weighed_by_students_t_of_their_costs():
    ours = begun()
    ours._weigh()
    for i, curves in enumerate(ours._curves):
        wanted = log_weights(curves.log_base, ours._costs[i], ours._sums[i, DOF], ours.noise)
        np.testing.assert_allclose(ours._weights[i], normalise(wanted), rtol=1e-9, atol=1e-15)


def two_rails(leader):
    """Memories of which the longest holds another rail than the others, and the i-th leads."""
    ours = begun(WET)
    rng = np.random.default_rng(2)
    h = rng.uniform(0, 0.2, 400)
    ours._sums[0] = sums_of(h, adhesion(h, *DRY) + 0.01 * rng.standard_normal(400))
    ours._draw(0)
    ours._probability = [0.1] * 3
    ours._probability[leader] = 0.8
    ours._weigh()
    return ours


def test_a_shorter_memory_of_another_rail_is_a_lag_of_the_leading_one():
    """By the distance of the means, where it is more than two of the shorter one's deviations."""
    found = two_rails(0).lag()
    ours = two_rails(0)
    for k, name in enumerate(("mu_max", "lambda_m")):
        long, short = (getattr(ours._curves[i], name) for i in (0, 1))
        means = [np.average(values, weights=ours._weights[i])
                 for i, values in ((0, long), (1, short))]  # fmt: skip
        std = np.sqrt(np.cov(short, aweights=ours._weights[1], ddof=0))
        distance = abs(means[0] - means[1])
        assert found[k] == pytest.approx(distance if distance > 2 * std else 0.0)
    assert found[0] > 0.05


@pytest.mark.parametrize("leader", [1, 2])
def test_memories_of_one_rail_and_the_shortest_one_have_no_lag(leader):
    assert two_rails(leader).lag() == (0.0, 0.0)


def test_a_lag_within_the_shorter_memorys_own_uncertainty_is_none():
    ours = two_rails(0)
    size = len(ours._weights[1])
    ours._weights = ours._weights.copy()
    ours._weights[1] = 1.0 / size
    values = ours._curves[1].mu_max
    middle, std = values.mean(), values.std()
    for stds, shown in ((1.9, 0.0), (2.1, 2.1 * std)):
        object.__setattr__(ours._curves[0], "mu_max", np.full(size, middle + stds * std))
        assert ours.lag()[0] == pytest.approx(shown)


def test_a_longest_memory_that_is_nearly_sure_has_no_lag():
    ours = two_rails(0)
    ours._probability = [0.95, 0.04, 0.01]
    assert ours.lag() == (0.0, 0.0)
    ours._probability = [0.85, 0.1, 0.05]
    assert ours.lag()[0] > 0.0


@pytest.mark.parametrize(("share", "anew"), [(0.69, True), (0.71, False)])
def test_curves_are_drawn_anew_where_a_memory_has_lost_three_tenths_of_its_samples(share, anew):
    ours = begun()
    before = list(ours._curves)
    ours._sums *= share
    ours._costs *= share
    ours.refresh()
    assert all((now is not was) is anew for now, was in zip(ours._curves, before, strict=True))


def test_one_memory_has_nothing_to_choose():
    ours = begun(chosen=ONE_MEMORY)
    np.testing.assert_array_equal(ours._probability, [1.0])
    ours.predict(both(sums_of(np.array([0.1]), np.array([5.0]))))
    ours.fade(100.0)
    np.testing.assert_allclose(ours._probability, [1.0])
    assert len(ours.leading(0.01)) == 1


@pytest.mark.parametrize(
    "chosen",
    [{"times_s": ()}, {"times_s": (60.0, 0.0)}, {"switch_s": 0.0}, {"drift": 1.0}, {"drift": -0.1}],
)
def test_senseless_memories_are_refused(chosen):
    with pytest.raises(ValueError, match="must"):
        MemorySettings(**chosen)


def follow(tracker, theta_at, *, seconds, period, seed, sd=0.01, top=0.2, size=12):
    """Errors of μ_max, relative, after each update of `size` samples, and the estimates."""
    rng = np.random.default_rng(seed)
    errors, estimates = [], []
    for k in range(round(seconds / period)):
        theta = theta_at(k * period)
        h = rng.uniform(0, top, size)
        z = adhesion(h, *theta) + sd * rng.standard_normal(size)
        t = round(k * period * 1e6)
        e = tracker.update(Samples.curve(h, z, t_us=t + np.arange(size)), t)
        errors.append(e.mu_max / float(peak(*theta).mu_max) - 1)
        estimates.append(e)
    return np.array(errors), estimates


def drying(seconds):
    """Adhesion falls by 17 % in ten minutes, as humidity rises; the place of the peak stays."""
    share = 1 - 0.17 * seconds / 600
    return (0.40 * share, 60.0, 0.30 * share)


def rms(errors):
    return float(np.sqrt(np.mean(np.square(errors))))


@pytest.mark.costly
def test_a_rail_that_drifts_is_no_other_rail():
    _, estimates = follow(Tracker(), drying, seconds=600, period=1.0, seed=1)
    assert all(e.change_probability < 0.5 for e in estimates)


@pytest.mark.costly
def test_a_rail_that_drifts_is_followed():
    # Told that it is one rail, so that nothing but the memories follows it.
    chosen = {"seconds": 600, "period": 1.0, "seed": 2}
    errors, _ = follow(Tracker(known_changes_us=[]), drying, **chosen)
    alone, _ = follow(
        Tracker(TrackerSettings(memory=ONE_MEMORY), known_changes_us=[]), drying, **chosen
    )
    late = slice(120, None)
    assert rms(errors[late]) < 0.5 * rms(alone[late])
    assert rms(errors[late]) < 0.02


def test_a_constant_rail_is_not_estimated_worse_for_it():
    ours, alone = [], []
    for seed in range(3):
        chosen = {"seconds": 3, "period": 0.02, "seed": seed}
        ours.append(follow(Tracker(), lambda _: DRY, **chosen)[0])
        one = Tracker(TrackerSettings(memory=ONE_MEMORY))
        alone.append(follow(one, lambda _: DRY, **chosen)[0])
    late = slice(20, None)
    ours, alone = (np.concatenate([e[late] for e in errors]) for errors in (ours, alone))
    assert rms(ours) <= 1.1 * rms(alone)


# ---------------------------------------------------------------------------------------- axles


def deviating(rng, n, *, level=0.0, slip=0.0, sd=0.005, axle=2, top=0.1):
    """Axles, regressors, residual and weight of samples of which one axle deviates."""
    axles = np.arange(n) % 6 + 1
    h = rng.uniform(0, top, n)
    z = adhesion(h, *DRY)
    own = axles == axle
    z[own] = (1 + level) * adhesion(np.maximum(h[own] - slip, 0.0), *DRY)
    z += sd * rng.standard_normal(n)
    pool = adhesion(h, *DRY)
    return axles, pool, -adhesion_slope(h, *DRY), z - pool, np.ones(n)


@FIXED
@given(st.integers(0, 2**32 - 1), st.integers(1, 60), st.floats(0.001, 0.1))
def test_deviations_are_ridge_regression(seed, n, sd):
    rng = np.random.default_rng(seed)
    axles, *columns = deviating(rng, n, level=0.05, slip=0.003, sd=sd)
    columns[-1] = rng.uniform(0.1, 1.0, n)
    level, shifted, residual, weight = columns
    chosen = AxleSettings()
    ours = AxleDeviations(chosen)
    half = n // 2
    for rows in (slice(0, half), slice(half, n)):
        if len(axles[rows]):
            ours.add(axles[rows], *(column[rows] for column in columns))
    told = ours.estimate(0.37, 0.07, 1.0, sd**2)
    assert sorted(told) == sorted(set(axles.tolist()))
    for axle in told:
        own = axles == axle
        f = np.column_stack([level[own], shifted[own]])
        fw = f * weight[own, None]
        prior = np.diag([sd**2 / chosen.level_std**2, sd**2 / chosen.slip_std**2])
        g, d = np.linalg.solve(fw.T @ f + prior, fw.T @ residual[own])
        np.testing.assert_allclose(
            told[axle], [(1 + g) * 0.37, max(0.07 + d, 0.0)], rtol=1e-6, atol=1e-9
        )


@pytest.mark.parametrize(
    ("level", "slip"), [(0.05, 0.0), (-0.05, 0.0), (0.0, 0.004), (0.05, -0.004)]
)
def test_much_data_find_an_axle_of_its_own(level, slip):
    ours = AxleDeviations(AxleSettings())
    ours.add(*deviating(np.random.default_rng(1), 6000, level=level, slip=slip))
    told = ours.estimate(0.37, 0.07, 1.0, 0.005**2)
    # A shift of 0.004 is no small one on a slope of 24: first order tells it to a fifth.
    assert told[2][0] / 0.37 - 1 == pytest.approx(level, abs=0.012)
    assert told[2][1] - 0.07 == pytest.approx(slip, abs=0.0008)
    for axle in (1, 3, 4, 5, 6):
        assert told[axle][0] == pytest.approx(0.37, rel=0.004)
        assert told[axle][1] == pytest.approx(0.07, abs=0.0003)


def test_a_slip_of_its_own_has_the_other_sign_in_braking():
    ours = AxleDeviations(AxleSettings())
    ours.add(*deviating(np.random.default_rng(1), 6000, slip=0.003))
    assert ours.estimate(0.37, 0.07, 1.0, 0.005**2)[2][1] == pytest.approx(0.073, abs=0.0008)
    assert ours.estimate(0.37, 0.07, -1.0, 0.005**2)[2][1] == pytest.approx(0.067, abs=0.0008)


def test_little_data_shrink_to_the_pool():
    """An axle that is off by 0.5 and 0.02; over 200 seeds the worst axle is 0.04 and 0.004 from the
    pool in 90 %."""
    worst = []
    for seed in range(1, 41):
        few = AxleDeviations(AxleSettings())
        few.add(*deviating(np.random.default_rng(seed), 12, level=0.5, slip=0.02, sd=0.1))
        told = few.estimate(0.37, 0.07, 1.0, 0.1**2)
        worst.append(np.max([(abs(m / 0.37 - 1), abs(s - 0.07)) for m, s in told.values()], axis=0))
    assert (np.median(worst, axis=0) < (0.03, 0.003)).all()
    assert (np.max(worst, axis=0) < (0.1, 0.01)).all()
    few = AxleDeviations(AxleSettings())
    few.add(*deviating(np.random.default_rng(1), 12, level=0.5, slip=0.02, sd=0.1))
    told = few.estimate(0.37, 0.07, 1.0, 0.1**2)
    one = AxleDeviations(AxleSettings())
    one.add(*deviating(np.random.default_rng(1), 12, level=0.5, slip=0.02, sd=0.005))
    assert abs(told[2][0] - 0.37) < abs(one.estimate(0.37, 0.07, 1.0, 0.005**2)[2][0] - 0.37)


def test_what_fades_counts_as_much_less():
    """By e^(−t/60 s), and by the further share: as samples of that weight."""
    axles, *columns = deviating(np.random.default_rng(1), 40, level=0.05)
    faded, lighter = AxleDeviations(AxleSettings()), AxleDeviations(AxleSettings())
    faded.add(axles, *columns)
    faded.fade(45.0, 0.5)
    faded.fade(15.0)
    lighter.add(axles, *columns[:-1], 0.5 * np.exp(-1.0) * columns[-1])
    told, wanted = (one.estimate(0.37, 0.07, 1.0, 1e-4) for one in (faded, lighter))
    assert told.keys() == wanted.keys()
    for axle, peaks in told.items():
        assert peaks == pytest.approx(wanted[axle])


def test_what_was_seen_of_an_axle_fades_to_the_pool():
    ours = AxleDeviations(AxleSettings())
    ours.add(*deviating(np.random.default_rng(1), 6000, level=0.05))
    levels = []
    for _ in range(12):
        levels.append(ours.estimate(0.37, 0.07, 1.0, 0.005**2)[2][0] / 0.37 - 1)
        ours.fade(60.0)
    assert levels[0] > 0.04
    assert abs(levels[-1]) < 0.2 * levels[0]


def test_no_axle_is_no_deviation():
    ours = AxleDeviations(AxleSettings())
    assert ours.estimate(0.3, 0.05, 1.0, 1e-4) == {}
    ours.add(np.zeros(3, dtype=np.int64), np.full(3, 0.3), -np.ones(3), np.zeros(3), np.ones(3))
    assert ours.estimate(0.3, 0.05, 1.0, 1e-4) == {}
    ours.add(np.array([3]), np.array([0.3]), -np.ones(1), np.zeros(1), np.ones(1))
    assert list(ours.estimate(0.3, 0.05, 1.0, 1e-4)) == [3]
    ours.fade(1.0, share=0.1)
    assert list(ours.estimate(0.3, 0.05, 1.0, 1e-4)) == [3]


def test_place_of_an_axles_peak_is_never_negative():
    ours = AxleDeviations(AxleSettings(slip_std=1.0))
    ours.add(*deviating(np.random.default_rng(1), 600, slip=-0.05))
    assert ours.estimate(0.3, 0.001, 1.0, 1e-6)[2][1] >= 0.0


@pytest.mark.parametrize("name", ["level_std", "slip_std", "memory_s"])
def test_senseless_axles_are_refused(name):
    with pytest.raises(ValueError, match="must"):
        AxleSettings(**{name: 0.0})


def test_tracker_estimates_the_deviations_of_axles():
    rng = np.random.default_rng(2)
    tracker = Tracker()
    for k in range(300):
        axles = np.arange(12) % 6 + 1
        h = rng.uniform(0, 0.15, 12)
        z = adhesion(h, *DRY)
        z[axles == 2] *= 1.05
        z[axles == 5] = adhesion(np.maximum(h[axles == 5] - 0.004, 0), *DRY)
        samples = Samples.curve(h, z + 0.005 * rng.standard_normal(12), t_us=k * 20_000 + axles)
        samples.axle[:] = axles
        e = tracker.update(samples, (k + 1) * 20_000)
    assert sorted(e.per_axle) == [1, 2, 3, 4, 5, 6]
    others = [e.per_axle[k] for k in (1, 3, 4, 6)]
    assert e.per_axle[2][0] / np.mean([mu for mu, _ in others]) == pytest.approx(1.05, abs=0.015)
    ahead = e.per_axle[5][1] - np.mean([lam for _, lam in others])
    assert ahead == pytest.approx(0.004, abs=0.0015)


def test_levels_beyond_all_measure_leave_an_axle_its_pool():
    # A steep curve continued far below zero slip: rounding leaves nothing of the determinant.
    ours, one = AxleDeviations(AxleSettings()), np.ones(1)
    ours.add(np.array([1]), -1e10 * one, 3e12 * one, one, one)
    assert ours.estimate(0.3, 0.07, 1.0, 1e-8) == {1: (0.3, 0.07)}
