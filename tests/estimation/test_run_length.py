"""Bayes factors against SciPy's densities, false alarms by simulation, delays in the tracker."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import stats

from adhesion_can.estimation.tracker.curve_sums import Points
from adhesion_can.estimation.tracker.increment import increment
from adhesion_can.estimation.tracker.layout import (
    C2_NODES,
    CORRECTED,
    LENGTH,
    X_NODES,
)
from adhesion_can.estimation.tracker.prior import Prior
from adhesion_can.estimation.tracker.run_length import (
    NEW_MEAN,
    NEW_STD,
    Evidence,
    RunLengthHypotheses,
)
from adhesion_can.estimation.tracker.settings import PriorSettings, RunLengthSettings
from adhesion_can.estimation.tracker.tracker import Tracker
from adhesion_can.physics.burckhardt import RAIL, adhesion, peak
from adhesion_can.physics.samples import Samples

FIXED = settings(derandomize=True, deadline=None, max_examples=25)
DRY, WET, GREASY = (surface.theta for surface in RAIL)
SIZE, PERIOD_US = 12, 20_000


def sums_of(h, z):
    zero = np.zeros(len(h))
    points = Points(h, z, zero, zero, zero, np.zeros(len(h), dtype=np.int64), np.ones(len(h)))
    return increment(points, zero, 1.0, 0.5)[CORRECTED]


def evidence(sums, cost):
    return Evidence(np.stack([sums, sums]), np.full(2, cost))


def hypotheses(**chosen):
    return RunLengthHypotheses(RunLengthSettings(**chosen), Prior(PriorSettings()))


def update(k, theta, rng, *, sd=0.01, top=0.2, size=SIZE, second=None, axles=6):
    """One update of `size` samples, 20 ms after the last; the latter half from `second`."""
    h = rng.uniform(0.0, top, size)
    z = adhesion(h, *theta)
    if second is not None:
        z[size // 2 :] = adhesion(h[size // 2 :], *second)
    t = k * PERIOD_US + np.arange(size)
    samples = Samples.curve(h, z + sd * rng.standard_normal(size), t_us=t)
    samples.axle[:] = np.arange(size) % axles + 1
    return samples


def feed(tracker, updates, start=0):
    return [tracker.update(s, (start + k + 1) * PERIOD_US) for k, s in enumerate(updates)]


def declared(estimates):
    return [k for k, e in enumerate(estimates) if e.change_probability >= 0.5]


# ------------------------------------------------------------------------------- Bayes factors


@pytest.mark.parametrize(("factor", "is_declared"), [(1e8, False), (3e9, True)])
def test_a_change_needs_a_bayes_factor_of_a_billion(factor, is_declared):
    """It is declared from a probability of 1/2; before the data an update has 1e-9."""
    assert (hypotheses().probability(np.log([factor])) >= 0.5) == is_declared


@FIXED
@given(st.integers(0, 2**32 - 1), st.integers(1, 12), st.sampled_from([0.01, 0.1]))
def test_factor_is_that_of_the_written_out_densities(seed, n, sd):
    rng = np.random.default_rng(seed)
    h = rng.uniform(0, 0.2, n)
    z = adhesion(h, *GREASY) + sd * rng.standard_normal(n)
    r = z - adhesion(h, *DRY)
    prior = Prior(PriorSettings())
    ours = hypotheses()
    ours.add(evidence(sums_of(h, z), float(r @ r)), 0)
    weights = np.exp(prior.log_marginal(1, X_NODES)) * np.abs(np.gradient(X_NODES))
    weights /= weights.sum()
    # Its own design: 1 − e^(−c2 λ) and −λ, and a normal distribution of (c1, c3).
    parts = []
    for c2 in C2_NODES:
        f = np.column_stack([1 - np.exp(-c2 * h), -h])
        parts.append((f @ NEW_MEAN, (f * np.square(NEW_STD)) @ f.T + sd**2 * np.eye(n)))
    new = [stats.multivariate_normal.logpdf(z, mean, cov) for mean, cov in parts]
    old = stats.norm.logpdf(r, scale=sd).sum()
    exact = np.logaddexp.reduce(np.log(weights) + new) - old
    assert ours.log_factors(sd**2)[0] == pytest.approx(exact, abs=1e-5 + 1e-6 * abs(exact))
    # The noise known from 30 samples: a t distribution in place of the normal one, on both sides,
    # at each c2 where it gives the smaller factor.
    nu = 30.0
    known = np.array(new) - old
    new = [stats.multivariate_t.logpdf(z, mean, cov, df=nu) for mean, cov in parts]
    old = stats.multivariate_t.logpdf(r, np.zeros(n), sd**2 * np.eye(n), df=nu)
    exact = np.logaddexp.reduce(np.log(weights) + np.minimum(np.array(new) - old, known))
    assert ours.log_factors(sd**2, nu)[0] == pytest.approx(exact, abs=1e-5 + 1e-6 * abs(exact))


@FIXED
@given(st.integers(0, 2**32 - 1))
def test_a_change_needs_the_slips_as_measured_and_the_corrected_ones(seed):
    """Errors of the slips can imitate a new curve in either kind of sums, hardly in both."""
    rng = np.random.default_rng(seed)
    slips = rng.uniform(0.0, 0.2, (2, 12))
    kinds = []
    for h, theta in zip(slips, (DRY, GREASY), strict=True):
        z = adhesion(h, *theta) + 0.01 * rng.standard_normal(12)
        kinds.append((sums_of(h, z), float(((z - adhesion(h, *DRY)) ** 2).sum())))
    (same, same_cost), (other, other_cost) = kinds

    def factor(sums, costs):
        ours = hypotheses()
        ours.add(Evidence(np.stack(sums), np.array(costs)), 0)
        return ours.log_factors(1e-4)[0]

    none = factor([same, same], [same_cost, same_cost])
    assert factor([other, other], [other_cost, other_cost]) > none + 3.0
    for sums, costs in (
        ([same, other], [same_cost, other_cost]),
        ([other, same], [other_cost, same_cost]),
    ):
        assert factor(sums, costs) <= none + 1e-9


def test_a_hypothesis_has_the_samples_since_its_change():
    rng = np.random.default_rng(1)
    ours, added = hypotheses(), []
    for k in range(4):
        h = rng.uniform(0, 0.2, 5)
        added.append(sums_of(h, adhesion(h, *DRY)))
        ours.add(evidence(added[-1], 1.0), 100 * k)
    assert ours.since_us == [0, 100, 200, 300]
    for k in range(4):
        np.testing.assert_allclose(ours.sums[k], sum(added[k:]))


def test_noise_freedom_bounds_how_sure_of_the_noise_a_comparison_is():
    h = np.linspace(0.01, 0.2, 12)
    ours = hypotheses(noise_freedom=100.0)
    ours.add(evidence(sums_of(h, adhesion(h, *GREASY)), 0.5), 0)
    assert ours.log_factors(1e-4, 1e6)[0] == ours.log_factors(1e-4, 100.0)[0]
    assert ours.log_factors(1e-4, 20.0)[0] < ours.log_factors(1e-4, 100.0)[0]
    assert ours.log_factors(1e-4, 100.0)[0] < ours.log_factors(1e-4)[0]


def test_probability_is_that_of_the_odds():
    ours = hypotheses(false_alarm=1e-9)
    assert ours.probability(np.array([])) == 0.0
    assert ours.probability(np.array([np.log(1e9)])) == pytest.approx(0.5, abs=1e-6)
    assert ours.probability(np.full(10, np.log(1e8))) == pytest.approx(0.5, abs=1e-6)
    assert ours.probability(np.array([-1e5])) < 1e-300
    assert ours.probability(np.array([1e5])) == 1.0


def exceedances(runs, updates, level, sd):
    """Share of runs on a constant rail in which a hypothesis' factor ever passes `level`.

    A hypothesis that began with the first update is followed, its rail and noise being known.
    """
    count = 0
    for seed in range(runs):
        rng = np.random.default_rng(seed)
        ours = hypotheses(hypotheses=updates, dense=1)
        for k in range(updates):
            h = rng.uniform(0, 0.2, 4)
            r = sd * rng.standard_normal(4)
            ours.add(evidence(sums_of(h, adhesion(h, *WET) + r), float(r @ r)), k)
            if ours.log_factors(sd**2)[0] > np.log(level):
                count += 1
                break
    return count / runs


@pytest.mark.parametrize("level", [5.0, 20.0])
def test_false_alarms_keep_to_villes_bound(level):
    runs = 300
    share = exceedances(runs, 12, level, 0.01)
    # The share is binomial: five standard deviations.
    assert share <= 1 / level + 5 * np.sqrt(1 / level / runs)


def test_evidence_for_another_rail_grows_and_against_it_too():
    rng = np.random.default_rng(1)
    told = []
    for rail in (GREASY, DRY):
        ours = hypotheses()
        for k in range(4):
            h = rng.uniform(0, 0.2, SIZE)
            z = adhesion(h, *rail) + 0.01 * rng.standard_normal(SIZE)
            ours.add(evidence(sums_of(h, z), float(np.sum((z - adhesion(h, *DRY)) ** 2))), k)
        told.append(ours.log_factors(1e-4)[0])
    assert told[0] > 500
    assert told[1] < -5


# -------------------------------------------------------------------------------------- thinning


@FIXED
@given(st.integers(2, 12), st.integers(1, 12), st.integers(1, 400))
def test_number_stays_and_the_latest_are_all_kept(number, dense, updates):
    dense = min(dense, number - 1)
    ours = hypotheses(hypotheses=number, dense=dense)
    for k in range(updates):
        ours.add(evidence(np.zeros(LENGTH), 0.0), k)
        assert len(ours) == min(k + 1, number) == len(ours.sums) == len(ours.since_us)
    ages = sorted(updates - 1 - t for t in ours.since_us)
    latest = min(dense, updates)
    assert ages[:latest] == list(range(latest))
    assert len(set(ages)) == len(ages)


def test_ages_are_spread_evenly_for_ever():
    ours = hypotheses()
    reach = []
    for k in range(5000):
        ours.add(evidence(np.zeros(LENGTH), 0.0), k)
        if k > 200:
            ages = np.array(sorted(k + 1 - t for t in ours.since_us))
            reach.append(ages[-1])
            # From one age to the next never more than by a factor, so that none is far off.
            assert (ages[1:] / ages[:-1]).max() <= 6
    assert min(reach) >= 24  # half a second
    assert max(reach) < 5000


def test_close_makes_a_hypothesis_of_what_comes_next():
    rng = np.random.default_rng(1)
    h = rng.uniform(0, 0.2, 5)
    sums = sums_of(h, adhesion(h, *DRY))
    ours = hypotheses()
    ours.add(evidence(sums, 1.0), 10)
    ours.close(0, evidence(sums, 1.0), 0.01)
    assert len(ours) == 2
    ours.extend(evidence(sums, 0.0), 77)
    assert ours.since_us == [10, 77]
    np.testing.assert_allclose(ours.sums, [2 * sums, sums])
    ours.extend(evidence(sums, 0.0), 99)
    assert ours.since_us == [10, 77]
    ours.clear()
    assert len(ours) == 0


@pytest.mark.parametrize(
    "chosen",
    [
        {"false_alarm": 0.0},
        {"false_alarm": 1.0},
        {"dense": 0},
        {"dense": 11},
        {"noise_freedom": 0.0},
        {"settling_samples": -1},
    ],
)
def test_senseless_settings_are_refused(chosen):
    with pytest.raises(ValueError, match="must"):
        RunLengthSettings(**chosen)


# ------------------------------------------------------------------------- in the tracker: delay


def switch(before, after, *, sd, seed, at=40, more=40, mixed=False, top=0.2):
    """Estimates over a switch at the beginning of update `at`, or in the middle of it."""
    rng = np.random.default_rng(seed)
    updates = [update(k, before, rng, sd=sd, top=top) for k in range(at)]
    if mixed:
        updates.append(update(at, before, rng, sd=sd, top=top, second=after))
    first = len(updates)
    updates += [update(k, after, rng, sd=sd, top=top) for k in range(first, at + more)]
    return feed(Tracker(), updates)


PAIRS = [(DRY, WET), (WET, DRY), (WET, GREASY), (DRY, GREASY), (GREASY, DRY), (GREASY, WET)]


@pytest.mark.parametrize(("before", "after"), PAIRS, ids=str)
@pytest.mark.parametrize("seed", [1, 2])
def test_a_switch_is_declared_in_the_update_that_begins_with_it(before, after, seed):
    estimates = switch(before, after, sd=0.01, seed=seed)
    assert declared(estimates) == [40]
    last = estimates[-1]
    assert last.surface_since_us == 40 * PERIOD_US
    assert abs(last.mu_max - float(peak(*after).mu_max)) < 6 * last.mu_max_std
    assert last.samples == pytest.approx(40 * SIZE, rel=0.01)


@pytest.mark.parametrize(("before", "after"), [(DRY, GREASY), (GREASY, DRY), (DRY, WET)], ids=str)
def test_a_switch_in_much_noise_is_declared_soon(before, after):
    # Ten times the noise: a hundred times the samples for the same evidence, or a little more.
    estimates = switch(before, after, sd=0.1, seed=1, more=100)
    found = declared(estimates)
    assert len(found) == 1
    assert 40 <= found[0] <= 40 + (12 if GREASY in (before, after) else 40)
    last = estimates[-1]
    assert abs(last.mu_max - float(peak(*after).mu_max)) < 6 * last.mu_max_std
    assert abs(last.surface_since_us - 40 * PERIOD_US) <= 5 * PERIOD_US


@pytest.mark.parametrize(("before", "after"), [(DRY, WET), (WET, GREASY), (GREASY, DRY)], ids=str)
@pytest.mark.parametrize("seed", [1, 2])
def test_an_update_of_both_rails_does_not_spoil_the_new_estimate(before, after, seed):
    spoiled = switch(before, after, sd=0.01, seed=seed, mixed=True)
    found = declared(spoiled)
    assert len(found) == 1
    assert found[0] in (40, 41)
    last = spoiled[-1]
    assert last.surface_since_us in (40 * PERIOD_US, 41 * PERIOD_US)
    assert abs(last.mu_max - float(peak(*after).mu_max)) < 6 * last.mu_max_std
    assert last.mu_max == pytest.approx(float(peak(*after).mu_max), rel=0.03)


@pytest.mark.parametrize(("before", "after"), [(DRY, WET), (GREASY, DRY)], ids=str)
def test_the_noise_is_not_that_of_an_update_of_both_rails(before, after):
    told = [switch(before, after, sd=0.01, seed=k, mixed=True)[-1].noise_std for k in range(1, 7)]
    np.testing.assert_allclose(told, 0.01, rtol=0.15)


# ------------------------------------------------------------------ in the tracker: what is none


@pytest.mark.parametrize("sd", [0.001, 0.01, 0.1])
def test_a_constant_rail_is_one_rail(sd):
    rng = np.random.default_rng(1)
    estimates = feed(Tracker(), (update(k, WET, rng, sd=sd) for k in range(400)))
    assert declared(estimates) == []
    assert {e.surface_since_us for e in estimates} == {0}


@pytest.mark.slow
@pytest.mark.parametrize("sd", [0.001, 0.01, 0.1])
def test_no_false_declaration_in_many_samples(sd):
    rng = np.random.default_rng(1)
    for theta in (DRY, GREASY, (0.5, 30.0, 0.08)):
        tracker = Tracker()
        estimates = feed(tracker, (update(k, theta, rng, sd=sd) for k in range(5000)))
        assert declared(estimates) == []


@pytest.mark.parametrize("theta", [DRY, WET, GREASY], ids=str)
def test_slips_that_grow_are_no_change(theta):
    rng = np.random.default_rng(1)
    tops = np.linspace(0.002, 0.2, 200)
    updates = (update(k, theta, rng, sd=0.003, top=top) for k, top in enumerate(tops))
    assert declared(feed(Tracker(), updates)) == []


def test_noise_that_rises_fivefold_is_no_change():
    rng = np.random.default_rng(1)
    updates = [update(k, WET, rng, sd=0.005) for k in range(60)]
    updates += [update(k, WET, rng, sd=0.025) for k in range(60, 400)]
    estimates = feed(Tracker(), updates)
    assert declared(estimates) == []
    last = estimates[-1]
    assert abs(last.mu_max - float(peak(*WET).mu_max)) < 6 * last.mu_max_std
    assert last.noise_std > 0.015


@pytest.mark.parametrize("error", [0.5, -0.5, 5.0])
def test_a_glitch_of_one_axle_is_no_change(error):
    rng = np.random.default_rng(1)
    updates = [update(k, DRY, rng, sd=0.005) for k in range(80)]
    for k in (40, 41, 60):
        bad = updates[k].axle == 3
        updates[k].adhesion[bad] += error
    estimates = feed(Tracker(), updates)
    assert declared(estimates) == []
    last = estimates[-1]
    assert abs(last.mu_max - float(peak(*DRY).mu_max)) < 6 * last.mu_max_std
    assert last.noise_std == pytest.approx(0.005, rel=0.15)


def test_two_switches_in_a_row_are_two_changes():
    rng = np.random.default_rng(3)
    rails = [DRY] * 40 + [GREASY] * 40 + [WET] * 40
    estimates = feed(Tracker(), (update(k, rail, rng) for k, rail in enumerate(rails)))
    assert declared(estimates) == [40, 80]
