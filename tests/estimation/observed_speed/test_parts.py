"""The Gaussian state against textbook formulas, and what efforts alone say about axles."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from adhesion_can.estimation.observed_speed.axle_efforts import EffortWatch
from adhesion_can.estimation.observed_speed.gaussian_state import GaussianState
from adhesion_can.estimation.observed_speed.settings import ObservedSpeedSettings

seeds = st.integers(0, 2**31)


def random_covariance(rng, n):
    root = rng.normal(size=(n, n))
    return root @ root.T + 0.1 * np.eye(n)


@given(seeds)
def test_an_update_is_that_of_the_information_form(seed):
    rng = np.random.default_rng(seed)
    n, m = 5, 3
    P, H, R = random_covariance(rng, n), rng.normal(size=(m, n)), rng.uniform(0.1, 2, m)
    # A considered state that neither correlates nor is measured leaves an ordinary Kalman filter.
    P[0, 1:] = P[1:, 0] = 0.0
    H[:, 0] = 0.0
    state = GaussianState(np.zeros((1, n)), P[None].copy(), considered=0)
    innovation = rng.normal(size=m)
    state.update(H[None], innovation[None], R[None])
    information = np.linalg.inv(P) + H.T @ np.diag(1 / R) @ H
    expected = np.linalg.inv(information)
    assert np.allclose(state.covariance[0], expected, rtol=1e-6, atol=1e-9)
    assert np.allclose(state.mean[0], expected @ H.T @ (innovation / R), rtol=1e-6, atol=1e-9)


@given(seeds)
def test_a_considered_state_is_kept_and_the_covariance_stays_positive(seed):
    rng = np.random.default_rng(seed)
    n, m = 5, 3
    state = GaussianState(np.zeros((2, n)), np.stack([random_covariance(rng, n)] * 2), considered=2)
    variance = state.covariance[:, 2, 2].copy()
    for _ in range(20):
        H = rng.normal(size=(2, m, n))
        state.update(H, rng.normal(size=(2, m)), rng.uniform(1e-6, 1, (2, m)))
    assert np.all(state.mean[:, 2] == 0.0)
    assert np.allclose(state.covariance[:, 2, 2], variance)
    assert np.linalg.eigvalsh(state.covariance).min() > 0.0


@given(seeds)
def test_rows_are_added_as_by_a_matrix(seed):
    rng = np.random.default_rng(seed)
    P, factor = random_covariance(rng, 4), rng.normal(size=2)
    state = GaussianState(np.zeros((1, 4)), P[None].copy(), considered=0)
    state.add_row(slice(2, 4), 1, factor[None])
    F = np.eye(4)
    F[2:, 1] = factor
    assert np.allclose(state.covariance[0], F @ P @ F.T)


@pytest.mark.slow
@given(seeds, st.floats(0.08, 0.35), st.sampled_from([-1.0, 1.0]))
def test_noise_of_a_steady_effort_is_no_way_along_the_curve(seed, adhesion, sign):
    rng = np.random.default_rng(seed)
    watch = EffortWatch(1, 6, ObservedSpeedSettings())
    noise = 0.0045
    way = np.zeros(6)
    for block in range(400):
        shown = sign * adhesion + noise * rng.standard_normal((1, 6))
        axles = watch.update(shown, 0.05, noise)
        if block >= 60:  # the first mean is a single block
            way += np.log(axles.ratio[0])
    assert np.abs(way).max() < 0.1


def test_a_relief_keeps_the_effort_that_the_slip_belongs_to():
    watch = EffortWatch(1, 2, ObservedSpeedSettings())
    ramp = [1.0] * 20 + [0.7, 0.3] + [0.0] * 18 + [0.3, 0.7] + [1.0] * 20
    states = [watch.update(np.array([[0.2 * share, 0.2]]), 0.05, 0.0045) for share in ramp]
    assert [bool(one.free[0, 0]) for one in states] == [share == 0.0 for share in ramp]
    assert not any(one.pulls[0, 0] for one, share in zip(states, ramp, strict=True) if share < 0.5)
    assert all(one.pulls[0, 1] for one in states)
    assert all(abs(one.mean[0, 0] - 0.2) < 0.02 for one in states)
    assert np.prod([one.ratio[0, 0] for one in states]) == np.float64(1.0)


def test_an_axle_that_has_not_pulled_has_no_mean():
    watch = EffortWatch(1, 1, ObservedSpeedSettings())
    first = watch.update(np.array([[0.0]]), 0.05, 0.0045)
    assert np.isnan(first.mean[0, 0])
    assert first.free[0, 0]
    started = watch.update(np.array([[0.1]]), 0.05, 0.0045)
    assert started.starts[0, 0]
    assert np.isclose(started.mean[0, 0], 0.1)
