"""First-order lags against SciPy's filters and integrators, whole and in pieces."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import solve_ivp
from scipy.signal import cont2discrete, lfilter, lfiltic

from adhesion_can.physics.effects import LagStates
from adhesion_can.physics.lag_states import FEW, PAUSE_S, RememberedLagStates

FIXED = settings(derandomize=True, deadline=None, max_examples=60)
ONE = np.ones


def follow(lags, times, target, rate, start=None, axle=None):
    axle = ONE(len(times)) if axle is None else axle
    return lags.follow("lag", axle, times, target, rate, start)


def drive(n, seed=1, dt=0.01):
    rng = np.random.default_rng(seed)
    return np.arange(n) * dt, np.cumsum(rng.standard_normal(n)) * 0.1


@pytest.mark.parametrize("n", [FEW - 1, FEW, FEW + 1, 5000])
@pytest.mark.parametrize("rate", [0.05, 3.0, 80.0, 4000.0])
@pytest.mark.parametrize("start", [None, 0.0, -2.5])
def test_a_constant_rate_is_a_digital_filter(n, rate, start):
    # x' = rate (u - x) with u in straight lines between its points: SciPy's first-order hold.
    times, u = drive(n)
    b, a, _ = cont2discrete(([rate], [1.0, rate]), 0.01, method="foh")
    first = u[0] if start is None else start
    zi = lfiltic(b.ravel(), a, y=[first], x=[u[0]])
    wanted = np.concatenate([[first], lfilter(b.ravel(), a, u[1:], zi=zi)[0]])
    assert follow(LagStates(), times, u, rate, start) == pytest.approx(wanted, abs=1e-9)


@pytest.mark.parametrize("n", [40, 120])
def test_a_varying_rate_and_uneven_steps_are_what_an_integrator_gives(n):
    rng = np.random.default_rng(5)
    times = np.cumsum(rng.uniform(0.001, 0.2, n))
    u, rates = rng.standard_normal(n), rng.uniform(0.2, 60.0, n)
    x = follow(LagStates(), times, u, rates)
    state = u[0]
    for k in range(1, n):
        span = (times[k - 1], times[k])
        out = solve_ivp(
            lambda t, y, k=k: rates[k] * (np.interp(t, times[k - 1 : k + 1], u[k - 1 : k + 1]) - y),
            span, [state], method="LSODA", rtol=1e-9, atol=1e-11,
        )  # fmt: skip
        state = out.y[0, -1]
        assert x[k] == pytest.approx(state, abs=1e-7), k


@FIXED
@given(
    st.integers(2, 400),
    st.lists(st.integers(1, 399), max_size=8),
    st.integers(1, 4),
    st.integers(0, 10**6),
    st.sampled_from([None, 0.0]),
)
def test_batch_by_batch_is_the_whole(n, cuts, axles, seed, start):
    rng = np.random.default_rng(seed)
    # Steps of 0, ordinary ones and pauses; the axles take turns at random.
    steps = rng.choice([0.0, 0.01, 0.02, 0.5, PAUSE_S + 0.01], n, p=[0.1, 0.4, 0.3, 0.15, 0.05])
    times, axle = np.cumsum(steps), rng.integers(1, axles + 1, n).astype(float)
    u, rates = rng.standard_normal(n), 10.0 ** rng.uniform(-3, 4, n)
    whole = follow(LagStates(), times, u, rates, start, axle)
    lags, parts = LagStates(), []
    edges = [0, *sorted({c for c in cuts if c < n}), n]
    for a, b in zip(edges, edges[1:], strict=False):
        parts.append(follow(lags, times[a:b], u[a:b], rates[a:b], start, axle[a:b]))
    assert np.concatenate(parts) == pytest.approx(whole, rel=1e-9, abs=1e-9)
    # x is a mean of the past: it never leaves what it has seen.
    reach = max(np.abs(u).max(), abs(start or 0.0))
    assert np.abs(whole).max() <= reach + 1e-9


@pytest.mark.parametrize("n", [6, 600])
def test_axles_know_nothing_of_each_other(n):
    times, _ = drive(n)
    us = [drive(n, seed)[1] for seed in (1, 2, 3)]
    axle = np.tile([1.0, 2.0, 3.0], n)
    mixed = follow(LagStates(), np.repeat(times, 3), np.stack(us, axis=1).ravel(), 5.0, axle=axle)
    for k, u in enumerate(us):
        assert mixed[k::3] == pytest.approx(follow(LagStates(), times, u, 5.0), abs=1e-12)


def test_names_know_nothing_of_each_other():
    lags, (times, u) = LagStates(), drive(20)
    one = lags.follow("one", ONE(20), times, u, 5.0)
    other = lags.follow("other", ONE(20), times, u, 5.0)
    assert np.array_equal(one, other)


@pytest.mark.parametrize("n", [10, 200])
@pytest.mark.parametrize("start", [None, 0.7])
@pytest.mark.parametrize("way", [PAUSE_S + 1e-3, -5.0], ids=["pause", "back in time"])
def test_after_a_pause_it_begins_anew(n, start, way):
    times, u = drive(2 * n)
    times[n:] += way
    x = follow(LagStates(), times, u, 2.0, start)
    fresh = follow(LagStates(), times[n:], u[n:], 2.0, start)
    assert x[n:] == pytest.approx(fresh, abs=1e-12)
    assert x[n] == (u[n] if start is None else start)


@pytest.mark.parametrize("n", [10, 200])
def test_a_gap_shorter_than_a_pause_is_one_long_step(n):
    times, u = np.arange(n) * 0.01, np.zeros(n)
    times[n // 2 :] += 0.9
    u[0] = 1.0
    x = follow(LagStates(), times, u, 1.5)
    # From the first step's end on the target is 0: what is left dies away as e^(-rate t).
    decayed = x[1] * np.exp(-1.5 * (times[1:] - times[1]))
    assert x[1:] == pytest.approx(decayed, rel=1e-9)


@pytest.mark.parametrize("n", [10, 200])
def test_a_rate_of_zero_holds_and_a_huge_one_follows(n):
    times, u = drive(n)
    assert follow(LagStates(), times, u, 0.0) == pytest.approx(np.full(n, u[0]), abs=1e-12)
    assert follow(LagStates(), times, u, 1e9) == pytest.approx(
        u, abs=0.1 * np.abs(np.diff(u)).max()
    )
    assert np.isfinite(follow(LagStates(), times, u, np.full(n, 1e300))).all()


def test_a_copy_goes_its_own_way():
    lags, (times, u) = LagStates(), drive(40)
    follow(lags, times[:20], u[:20], 3.0)
    other = lags.copy()
    disturbed = follow(other, times[20:], u[20:] + 1.0, 3.0)
    rest = follow(lags, times[20:], u[20:], 3.0)
    assert rest == pytest.approx(follow(LagStates(), times, u, 3.0)[20:], abs=1e-12)
    assert np.abs(disturbed - rest).min() > 1e-3


def test_nothing_comes_of_nothing():
    none = np.zeros(0)
    assert len(LagStates().follow("lag", none, none, none, none)) == 0


def test_remembered_lags_are_those_of_a_fresh_state():
    """Whatever was asked before, and however often."""
    rng = np.random.default_rng(21)
    axle, time_s = np.repeat([1.0, 2.0], 300), np.tile(0.02 * np.arange(300), 2)
    targets = [rng.standard_normal(600) for _ in range(3)]
    remembered = RememberedLagStates()
    for _ in range(40):
        target = targets[rng.integers(3)]
        rate = float(rng.choice([0.5, 2.0]))
        start = [None, 0.0][rng.integers(2)]
        asked = ("x", axle, time_s, target, rate, start)
        np.testing.assert_array_equal(remembered.follow(*asked), LagStates().follow(*asked))


def test_a_remembered_lag_follows_a_target_that_was_changed_in_place():
    axle, time_s, target = np.ones(100), 0.02 * np.arange(100), np.zeros(100)
    remembered = RememberedLagStates()
    remembered.follow("x", axle, time_s, target, 1.0)
    target[50:] = 1.0
    assert remembered.follow("x", axle, time_s, target, 1.0)[-1] > 0.5
