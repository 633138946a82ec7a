"""The simulated queue of tools/bench scale against closed forms."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from adhesion_can.fleet.dataset import DataSet
from adhesion_can.fleet.schema import STEPS, UNITS, seconds_column
from tools.benchmarks._fleet_queue import Cost, Failures, Run, draw_lengths
from tools.benchmarks.scale import fit_cost, fit_steps

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


FIXED, PER_HOUR = {"read": 0.1, "check": 0.4, "replay": 0.0}, {"read": 5.0, "replay": 90.0}


def write_units(out, durations_s, rng, spread=0.01):
    """A data set whose units took known times; two of them without one."""
    text = {c.name: "x" for c in UNITS.columns if c.required and c.type == "string"}
    for number, duration_s in enumerate(durations_s):
        row = text | {"unit_id": f"u{number}", "vehicle": "007", "steps": list(STEPS)}
        row |= {"status": "done", "duration_s": float(duration_s)}
        factor = np.exp(spread * rng.standard_normal())
        for step in ("read", "check", "replay"):
            seconds = FIXED.get(step, 0.0) + PER_HOUR.get(step, 0.0) * duration_s / 3600.0
            row[seconds_column(step)] = float(seconds * factor)
        DataSet(str(out)).write(row, {})
    for status, duration_s in (("failed", 60.0), ("done", None)):
        row = text | {"unit_id": status, "vehicle": "7", "steps": [], "read_seconds": 999.0}
        DataSet(str(out)).write(row | {"status": status, "duration_s": duration_s}, {})


def test_the_costs_of_a_data_set_are_those_that_its_units_took(tmp_path):
    rng = np.random.default_rng(4)
    write_units(tmp_path, np.geomspace(30.0, 4000.0, 40), rng)
    steps, spread = fit_steps(tmp_path)
    for step in ("read", *STEPS):
        fixed, per_hour = steps[step]
        assert fixed == pytest.approx(FIXED.get(step, 0.0), abs=0.05)
        assert per_hour == pytest.approx(PER_HOUR.get(step, 0.0), rel=0.05, abs=0.2)
    assert spread == pytest.approx(0.01, rel=0.5)
    cost = fit_cost(tmp_path, COST)
    assert cost.fixed_s == pytest.approx(0.5, rel=0.15)
    assert cost.per_hour_s == pytest.approx(95.0, rel=0.05)


def test_recordings_of_one_length_have_no_fixed_time(tmp_path):
    rng = np.random.default_rng(5)
    write_units(tmp_path, [100.0, 101.0, 99.0, 100.0], rng, spread=0.0)
    cost = fit_cost(tmp_path, COST)
    assert cost.fixed_s == 0.0
    assert cost.per_hour_s == pytest.approx(95.0 + 0.5 * 36.0, rel=0.02)


def test_a_data_set_without_a_finished_unit_says_so(tmp_path):
    write_units(tmp_path, [], np.random.default_rng(6))
    with pytest.raises(SystemExit, match="no finished unit of a known duration"):
        fit_steps(tmp_path)
