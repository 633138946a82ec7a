"""The simulated queue of tools/bench scale against closed forms."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tools.benchmarks._fleet_queue import Cost, Failures, Run, draw_lengths

SAFE = Failures(worker_life_h=1e9, restart_s=60.0, broken=0.0, deadly=0.0)
COST = Cost(
    fixed_s=1.0, per_hour_s=99.0, spread=0.0, bytes_per_hour=0.0, request_s=0.0,
    worker_bytes_per_s=1e9, store_bytes_per_s=1e12, dispatch_s=0.0,
)  # fmt: skip


def play(lengths, workers, cost=COST, failures=SAFE, window=2, seed=1):
    return Run(lengths, workers, cost, failures, window=window, seed=seed).play()


@given(st.integers(1, 60), st.integers(1, 9), st.integers(1, 4))
@settings(deadline=None, max_examples=40)
def test_equal_units_take_as_many_rounds_as_workers_need(units, workers, window):
    outcome = play([1.0] * units, workers, window=window)
    assert outcome.done == units
    # A worker that waits with a window of two may hold a unit that another could begin.
    rounds = math.ceil(units / workers)
    assert 100.0 * rounds <= outcome.makespan_s + 1e-6
    assert outcome.makespan_s <= 100.0 * (rounds + window - 1) + 1e-6
    assert outcome.useful_s == pytest.approx(100.0 * units)
    assert outcome.in_flight <= workers * window


@given(st.integers(0, 2**32 - 1), st.floats(0.05, 2.0), st.floats(0.0, 0.2), st.floats(0.0, 0.1))
@settings(deadline=None, max_examples=40)
def test_every_unit_ends_once_whatever_dies(seed, life_h, broken, deadly):
    lengths = draw_lengths(60, np.random.default_rng(seed)).clip(max=1.0)
    failures = Failures(life_h, 60.0, broken, deadly)
    outcome = play(lengths, 4, failures=failures, seed=seed)
    assert outcome.done + outcome.failed == 60
    assert outcome.in_flight <= 4 * 2
    busy = outcome.useful_s + outcome.lost_s
    assert busy <= 4 * outcome.makespan_s + 1e-6


def test_a_deadly_unit_costs_its_attempts_and_no_more():
    outcome = play([1.0], 3, failures=Failures(1e9, 60.0, 0.0, 1.0, attempts=3))
    assert (outcome.done, outcome.failed, outcome.deaths) == (0, 1, 3)
    assert outcome.lost_s == pytest.approx(300.0)


def test_a_slow_dispatcher_bounds_the_throughput():
    cost = Cost(**{**COST.__dict__, "per_hour_s": 0.0, "dispatch_s": 0.5})
    outcome = play([0.0] * 200, 50, cost=cost)
    assert outcome.makespan_s == pytest.approx(0.5 * 200 + 1.0, rel=0.05)
    assert outcome.dispatcher > 0.95


def test_workers_share_the_rate_of_the_store():
    cost = Cost(
        **{
            **COST.__dict__,
            "per_hour_s": 0.0,
            "bytes_per_hour": 1e9,
            "worker_bytes_per_s": 1e9,
            "store_bytes_per_s": 1e9,
        }
    )
    outcome = play([1.0] * 100, 10, cost=cost)
    assert outcome.makespan_s >= 50.0  # 100 s at 1 GB/s; rates are set when a transfer begins
