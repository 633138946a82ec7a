"""The tracker's sums, to the last bit, against loops that add in the order that is written down."""

from bisect import bisect_right
from math import expm1

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from adhesion_can.estimation.tracker.axle_deviations import AxleDeviations
from adhesion_can.estimation.tracker.curve_sums import Points
from adhesion_can.estimation.tracker.increment import increment
from adhesion_can.estimation.tracker.layout import (
    C2_NODES,
    CORRECTED,
    LENGTH,
    MEASURED,
    A,
    B,
    C,
    D,
    E,
    Z,
)
from adhesion_can.estimation.tracker.order_of_sums import sum_in_lanes, sum_in_order
from adhesion_can.estimation.tracker.points import CoastingGate
from adhesion_can.estimation.tracker.posterior import NoisePrior, draw, summarise
from adhesion_can.estimation.tracker.prior import Prior
from adhesion_can.estimation.tracker.settings import AxleSettings, PriorSettings
from adhesion_can.physics.samples import Samples

FIXED = settings(derandomize=True, deadline=None, max_examples=40)
SEEDS = st.integers(0, 2**32 - 1)
FAR = 16.0


def scattered(rng, *shape):
    """Numbers of many magnitudes and both signs: another order of their sum has other bits."""
    return rng.standard_normal(shape) * 10.0 ** rng.uniform(-6, 6, shape)


def added_up(values):
    total = values[0]
    for value in values[1:]:
        total = total + value
    return total


def added_up_in_lanes(values):
    lanes = [0.0] * 16
    for k, value in enumerate(values):
        lanes[k % 16] += value
    return added_up(lanes)


@FIXED
@given(SEEDS, st.integers(1, 4), st.sampled_from([1, 2, 7, 8, 9, 15, 16, 17, 130, 384]))
def test_sums_add_in_their_order(seed, rows, size):
    values = scattered(np.random.default_rng(seed), rows, size)
    assert sum_in_order(values).tolist() == [added_up(row) for row in values.tolist()]
    assert sum_in_lanes(values).tolist() == [added_up_in_lanes(row) for row in values.tolist()]


@FIXED
@given(SEEDS, st.integers(1, 40))
def test_an_increment_adds_one_sample_after_the_other(seed, n):
    rng, noise_var = np.random.default_rng(seed), 1e-4
    h, z, further = rng.uniform(0, 0.3, n), rng.normal(0.2, 0.3, n), rng.uniform(1e-6, 1e-2, n)
    zero, group = np.zeros(n), np.arange(n) // 3
    points = Points(h, z, zero, zero, further, group, np.ones(n))
    both = increment(points, rng.uniform(0.0, 20.0, n), noise_var, 0.5)
    w = 1.0 / (1.0 + (0.0 + further) / noise_var)
    e = np.exp(h[:, None] * -C2_NODES)

    def total(rows):
        return added_up(list(rows))

    assert both[CORRECTED].tobytes() == both[MEASURED].tobytes()
    sums = both[CORRECTED]
    w_e, w_e_e = total(w[:, None] * e), total(w[:, None] * (e * e))
    assert sums[A].tolist() == (total(w) - 2.0 * w_e + w_e_e).tolist()
    assert sums[B].tolist() == (total((w * h)[:, None] * e) - total(w * h)).tolist()
    assert sums[C].tolist() == (total(w * z) - total((w * z)[:, None] * e)).tolist()
    assert sums[D] == total(w * h * h)
    assert sums[E] == -total(w * h * z)
    assert sums[Z] == total(w * z * z)


@FIXED
@given(SEEDS, st.integers(1, 30))
def test_deviations_of_axles_add_one_sample_after_the_other(seed, n):
    rng = np.random.default_rng(seed)
    axle, (level, shifted, residual) = rng.integers(0, 5, n), scattered(rng, 3, n)
    weight = rng.uniform(0.1, 1.0, n)
    at_once, one_by_one = AxleDeviations(AxleSettings()), AxleDeviations(AxleSettings())
    at_once.add(axle, level, shifted, residual, weight)
    for k in range(n):
        row = slice(k, k + 1)
        one_by_one.add(axle[row], level[row], shifted[row], residual[row], weight[row])
    peaks = at_once.estimate(0.3, 0.05, 1.0, 1e-4)
    assert peaks == one_by_one.estimate(0.3, 0.05, 1.0, 1e-4)
    assert 0 not in peaks
    assert set(peaks) == set(axle[axle > 0].tolist())


class Coasting:
    """What `CoastingGate` does, sample by sample and axle by axle."""

    def __init__(self):
        self.latest_us, self.means = {}, {}

    def passes(self, samples):
        columns = (samples.axle, samples.t_us, samples.slip, samples.adhesion)
        columns = [column.tolist() for column in columns]
        of_axle = {}
        for axle, t_us, *values in zip(*columns, strict=True):
            of_axle.setdefault(axle, []).append((t_us, values))
        judged = {}
        for axle, seen in of_axle.items():
            age_s = (seen[-1][0] - self.latest_us.get(axle, -(1 << 60))) * 1e-6
            self.latest_us[axle] = seen[-1][0]
            known = 0.0 <= age_s <= 0.5
            judged[axle] = self.means[axle] if known else None
            gain = -expm1(age_s / -0.1) if known else 1.0
            old = self.means.get(axle, [0.0, 0.0])
            means = [added_up([row[k] for _, row in seen]) / len(seen) for k in (0, 1)]
            self.means[axle] = [a + gain * (b - a) for a, b in zip(old, means, strict=True)]
        found = []
        for k, (axle, _, *values) in enumerate(zip(*columns, strict=True)):
            slip, adhesion = judged[axle] or values
            slip_var = samples.slip_var[k] + samples.slip_common_var[k]
            by_adhesion = adhesion * adhesion > FAR * samples.adhesion_var[k]
            found.append(bool(slip * slip >= FAR * slip_var or by_adhesion))
        return found


def test_an_axle_coasts_by_its_own_means():
    rng, gate, loop = np.random.default_rng(4), CoastingGate(), Coasting()
    told, t_us = [], 0
    for _ in range(400):
        t_us += int(rng.choice([20_000, 100_000, 700_000], p=[0.9, 0.05, 0.05]))
        n = int(rng.integers(1, 13))
        samples = Samples.curve(
            rng.normal(0.004, 0.002, n), rng.normal(0.03, 0.02, n), np.full(n, t_us)
        )
        samples.axle[:] = rng.integers(1, 7, n)
        samples.slip_var[:], samples.slip_common_var[:], samples.adhesion_var[:] = 5e-7, 5e-7, 1e-4
        told += gate.passes(samples).tolist()
        assert told[-n:] == loop.passes(samples)
    assert 0.2 < np.mean(told) < 0.8


@pytest.mark.parametrize("seed", range(4))
def test_a_summary_adds_curves_in_lanes(seed):
    rng = np.random.default_rng(seed)
    curves = draw(np.zeros(LENGTH), NoisePrior(1e-4, 1.0), Prior(PriorSettings()), 0.5, 384)
    weights = rng.uniform(0.0, 1.0, 384) ** 8
    weights /= weights.sum()
    found = summarise(curves, weights)

    def quantile(probability, order, values):
        shares, below = [], 0.0
        for weight in weights[order].tolist():
            below += weight
            shares.append(below - 0.5 * weight)
        k = bisect_right(shares, probability) - 1
        low, high = values[order[k]], values[order[k + 1]]
        return (high - low) / (shares[k + 1] - shares[k]) * (probability - shares[k]) + low

    def mean(values):
        return added_up_in_lanes((weights * values).tolist())

    by_height, by_place, by_shape = (np.argsort(row) for row in curves.peaks)
    assert found.mu_m == quantile(0.5, by_height, curves.peaks[0])
    assert found.slip_m == quantile(0.5, by_place, curves.peaks[1])
    assert found.shape == quantile(0.5, by_shape, curves.peaks[2])
    probabilities = (0.05, 0.5, 0.95)
    assert found.mu_max == tuple(quantile(p, by_height, curves.mu_max) for p in probabilities)
    assert found.lambda_m == tuple(quantile(p, by_place, curves.lambda_m) for p in probabilities)
    columns = [*curves.theta.T, curves.mu_max, curves.lambda_m]
    apart = [column - mean(column) for column in columns]

    def covariance(i, k):
        return added_up_in_lanes((weights * apart[min(i, k)] * apart[max(i, k)]).tolist())

    assert found.covariance.tolist() == [[covariance(i, k) for k in range(3)] for i in range(3)]
    assert (found.mu_max_var, found.lambda_m_var) == (covariance(3, 3), covariance(4, 4))
    assert found.fall == mean(columns[2])
    assert found.effective == 1.0 / added_up_in_lanes((weights * weights).tolist())
