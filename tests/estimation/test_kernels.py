"""Compiled kernels against those with NumPy: equal bits; and what is used without numba."""

import os
import subprocess
import sys

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from adhesion_can.estimation.tracker import kernels
from adhesion_can.estimation.tracker.kernels import plain
from adhesion_can.estimation.tracker.layout import LENGTH, NODES, SUMMARY_LENGTH

SEEDS = st.integers(0, 2**32 - 1)
FIXED = settings(derandomize=True, deadline=None, max_examples=60)


@pytest.fixture(scope="module", autouse=True)
def compiled():
    pytest.importorskip("numba", reason="extra 'fast'")
    from adhesion_can.estimation.tracker.kernels import compiled as found

    return found


def both(name, *arguments):
    """Results and changed arguments of both implementations are equal; gives the result."""
    from adhesion_can.estimation.tracker.kernels import compiled

    outcomes = []
    for module in (plain, compiled):
        own = [a.copy() if isinstance(a, np.ndarray) else a for a in arguments]
        result = getattr(module, name)(*own)
        parts = result if isinstance(result, tuple) else (result,)
        outcomes.append([*parts, *own])
    for one, other in zip(*outcomes, strict=True):
        if one is not None:
            np.testing.assert_array_equal(one, other)
    return outcomes[0][0]


def drawn_samples(rng):
    """Columns of some samples: slips of either sign, some without errors, some axles twice."""
    n = int(rng.integers(1, 30))
    slip = rng.normal(0.0, rng.choice([1e-4, 0.01, 0.1]), n)
    adhesion = rng.normal(0.1, 0.2, n)
    variances = [rng.choice([0.0, 1e-8, 1e-4]) * rng.random(n) for _ in range(4)]
    return n, slip, adhesion, *variances


@given(SEEDS)
@FIXED
def test_samples(seed):
    rng = np.random.default_rng(seed)
    n, slip, adhesion, private, common, own, transient = drawn_samples(rng)
    load_std = rng.choice([0.0, np.nan, 10.0], n)
    slip_max = float(rng.choice([0.05, 0.5]))
    both("find_valid", slip, adhesion, private, common, own, transient, load_std, slip_max)
    axle, t_us = rng.integers(1, 7, n), rng.integers(0, 10**6, n)
    latest = rng.choice([-(1 << 60), 0, 500_000], 7)
    age_s = both("pass_time", latest, axle, t_us)
    means, less = rng.normal(0.0, 0.1, (2, 7)), np.expm1(age_s / -0.1)
    both("judge_coasting", slip, adhesion, private, common, own, axle, age_s, less, means, 16.0)
    theta = (0.4, float(rng.uniform(2.0, 500.0)), float(rng.uniform(0.0, 2.0)))
    exponent = np.minimum(-theta[1] * slip, 8.0)
    less, decay = np.expm1(exponent), np.exp(exponent)
    both("judge_residuals", slip, adhesion, private, common, transient, theta, less, decay, 1e-4)
    normal, weight = rng.random((6, 5)), rng.random(n)
    axle[rng.random(n) < 0.2] = 0
    both("add_to_axles", normal, axle, slip, adhesion, decay, weight)


@given(SEEDS, st.booleans(), st.booleans())
@FIXED
def test_increment(seed, with_share, with_bend):
    rng = np.random.default_rng(seed)
    n, slip, adhesion, private, common, _, transient = drawn_samples(rng)
    decay = np.empty((n + 1, NODES))
    mean = both("node_exponents", slip, private, decay)
    plain.node_exponents(slip, private, decay)
    np.exp(decay, out=decay)
    group = np.cumsum(rng.random(n) < 0.2)
    share = rng.choice([rng.random(n), np.ones(n)]) if with_share else kernels.NONE
    bend = rng.normal(0.0, 50.0, n) if with_bend else kernels.NONE
    slope, own_slope = rng.normal(5.0, 5.0, (2, n))
    sums = both(
        "increment", slip, adhesion, private, common, transient, group,
        rng.choice([-1.0, 1.0], n), share, slope, own_slope, bend, np.abs(slip), decay,
        mean, 1e-4, 0.5,
    )  # fmt: skip
    assert sums.shape == (2, LENGTH)
    assert np.isfinite(sums).all()


@given(SEEDS, st.sampled_from([64, 66, 384, 390]))
@FIXED
def test_curves(seed, size):
    rng = np.random.default_rng(seed)
    memories = int(rng.integers(1, 4))
    nodal, factors = rng.random((6, memories * size)), rng.normal(size=(5, memories * size))
    costs, exponents = np.empty((2, 2, memories, size))
    both("cost_curves", nodal, factors, rng.random((2, LENGTH)), -50.0, costs, exponents)
    base = rng.normal(size=(memories, size))
    base[rng.random(base.shape) < 0.1] = -np.inf
    logs, out = rng.normal(size=(2, memories, size))
    both("weight_exponents", base, logs, rng.random(memories) * 1e3, out)
    weights = rng.random((memories, size)) ** 8
    both("normalise", weights, rng.normal(size=(memories, size)), memories - 1)
    weights = weights[0] / weights[0].sum()
    weights[rng.random(size) < 0.2] = 0.0
    values = rng.random((5, size))
    order = np.argsort(values[:3], axis=1)
    ordered = np.take_along_axis(values[:3], order, axis=1)
    found = both("summarise", weights, order, ordered, ordered[:2], values)
    assert found.shape == (SUMMARY_LENGTH,)


@given(SEEDS)
@FIXED
def test_reach_and_surface_changes(seed):
    rng = np.random.default_rng(seed)
    both("count_reached", rng.integers(0, 3, 64).astype(np.float64), float(rng.random()))
    count = int(rng.integers(1, 10))
    sums = rng.normal(1.0, 1.0, (2, count, LENGTH))
    old_cost = rng.normal(1.0, 1.0, (2, count))
    logs, gain = np.zeros((2, 2, count, NODES)), np.empty((2, count, NODES))
    freedom = float(rng.choice([-1.0, 10.0, 100.0]))
    both("score_terms", sums, old_cost, 1e-2, freedom, logs, gain)
    logs, gain = rng.normal(size=logs.shape), rng.normal(size=gain.shape)
    halves = rng.random(count) if freedom > 0.0 else kernels.NONE
    both("score", logs, gain, rng.normal(size=NODES), halves, np.empty((count, NODES)))


def test_columns_that_are_not_to_be_written_to(compiled):
    column = np.ones(5)
    column.flags.writeable = False
    assert compiled.find_valid(*[column] * 2, *[np.zeros(10)[::2]] * 5, 2.0).all()


def test_nothing_is_compiled_at_a_call(compiled):
    with pytest.raises(TypeError):
        compiled.count_reached("no histogram", 0.5)
    assert len(compiled.count_reached.signatures) == 1


DRIVE = """
import hashlib
from adhesion_can.config import load_configuration
from adhesion_can.service.core import ServiceCore
from adhesion_can.simulation.run import RunSettings, Simulation
from adhesion_can.simulation.scenarios import scenario_by_name
from adhesion_can.estimation.tracker import kernels
config = load_configuration()
run = Simulation(RunSettings(scenario_by_name("dry-wet-dry"), 8.0), config.database).run()
core = ServiceCore(config)
sent = [answer.data for step in run for frame in step for answer in core.feed(frame)]
print(kernels.active.__name__, core.estimate, hashlib.sha256(b"".join(sent)).hexdigest())
"""


def drive(switch):
    """Name of the kernels, estimate and digest of the frames of a drive in a fresh process."""
    environment = {**os.environ, kernels.SWITCH: switch}
    command = [sys.executable, "-c", DRIVE]
    done = subprocess.run(command, env=environment, capture_output=True, text=True, check=True)
    name, rest = done.stdout.split(" ", 1)
    return name.rpartition(".")[2], rest


def test_a_drive_has_the_same_estimate_and_frames():
    (one, without), (other, with_numba) = drive("0"), drive("1")
    assert (one, other) == ("plain", "compiled")
    assert without == with_numba


def test_switch(monkeypatch):
    monkeypatch.setenv(kernels.SWITCH, "0")
    assert kernels.choose() is plain
    monkeypatch.setenv(kernels.SWITCH, "1")
    assert kernels.choose() is not plain


@pytest.mark.parametrize("error", [ModuleNotFoundError("numba"), ImportError("NumPy is too new")])
def test_without_numba(monkeypatch, caplog, error):
    monkeypatch.delenv(kernels.SWITCH, raising=False)

    def fail():
        raise error

    assert kernels.choose(fail) is plain
    told = not isinstance(error, ModuleNotFoundError)
    assert ("numba cannot be used" in caplog.text) is told
