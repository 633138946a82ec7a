"""The tracker's arithmetic by NumPy and compiled: the same bits, whatever comes."""

import copy
import os
import subprocess
import sys
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from adhesion_can.cli.main import _compilation_told
from adhesion_can.estimation.tracker import kernels
from adhesion_can.estimation.tracker.kernels import SWITCH, choose, plain
from adhesion_can.estimation.tracker.tracker import Tracker
from adhesion_can.physics.burckhardt import RAIL, adhesion
from adhesion_can.physics.samples import Samples

compiled = pytest.importorskip(
    "adhesion_can.estimation.tracker.kernels.compiled", reason="needs the extra 'fast'"
)
NAMES = sorted(compiled.__all__)


def bits(value):
    """What a kernel gave or wrote to, as bytes."""
    if isinstance(value, tuple):
        return [bits(one) for one in value]
    array = np.asarray(value)
    return array.shape, array.dtype.kind, array.tobytes()


class Both:
    """Kernels that compute all by both implementations and compare."""

    def __init__(self):
        self.called = set()
        for name in NAMES:
            setattr(self, name, self._compare(name))

    def _compare(self, name):
        one, other = getattr(plain, name), getattr(compiled, name)

        def kernel(*arguments):
            again = copy.deepcopy(arguments)
            result, second = one(*arguments), other(*again)
            assert bits(result) == bits(second), name
            for number, (left, right) in enumerate(zip(arguments, again, strict=True)):
                assert bits(left) == bits(right), (name, number)
            self.called.add(name)
            return result

        return kernel


def samples_at(rng, k, theta, size, errors, sign):
    """Samples of an update, with errors of the slips where there are any."""
    h = rng.uniform(0.0, rng.choice([0.01, 0.2]), size)
    z = adhesion(h, *theta) + 0.01 * rng.standard_normal(size)
    h = h + errors * 0.01 * rng.standard_normal(size)
    samples = Samples.curve(sign * h, sign * z, t_us=k * 20_000 + np.arange(size))
    samples.axle[:] = np.arange(size) % 6 + 1
    if errors:
        samples.slip_var[:] = errors * rng.uniform(1e-6, 1e-4, size)
        samples.slip_common_var[:] = errors * 1e-5
        samples.adhesion_var[:] = rng.choice([0.0, 1e-4])
        samples.transient_var[:] = rng.choice([0.0, 1e-3], size)
        samples.speed_us[:] = k * 20_000 + 10_000 * rng.integers(0, 2, size).cumsum()
        samples.speed_share[:] = rng.choice([np.ones(size), rng.uniform(0.0, 1.0, size)])
    return samples


@settings(derandomize=True, deadline=None, max_examples=40)
@given(
    seed=st.integers(0, 2**32 - 1),
    size=st.integers(1, 14),
    errors=st.sampled_from([0.0, 0.1, 1.0, 30.0]),
    sign=st.sampled_from([-1.0, 1.0]),
)
def test_both_give_the_same_bits(seed, size, errors, sign):
    rng, both = np.random.default_rng(seed), Both()
    before, kernels.active = kernels.active, both
    try:
        tracker = Tracker()
        for k in range(60):
            theta = RAIL[int(rng.integers(3)) if k in (0, 30) else k // 30].theta
            tracker.update(samples_at(rng, k, theta, size, errors, sign), (k + 1) * 20_000)
    finally:
        kernels.active = before
    assert both.called


def test_every_kernel_is_compared():
    rng, both = np.random.default_rng(5), Both()
    before, kernels.active = kernels.active, both
    try:
        tracker = Tracker()
        for k in range(120):
            theta = RAIL[k // 60].theta
            errors = (0.0, 1.0)[k % 60 > 10]
            tracker.update(samples_at(rng, k, theta, 12, errors, 1.0), (k + 1) * 20_000)
    finally:
        kernels.active = before
    assert both.called == set(NAMES)


def test_without_numba_all_goes_on(caplog):
    def missing():
        raise ModuleNotFoundError("No module named 'numba'")

    assert choose(missing) is plain
    assert not caplog.records


def test_a_numba_that_cannot_be_used_is_told(caplog):
    def refusing():
        raise ImportError("Numba needs NumPy 2.2 or less")

    assert choose(refusing) is plain
    assert "the estimator continues without it: Numba needs NumPy 2.2 or less" in caplog.text


def test_the_switch_leaves_numba_alone(monkeypatch):
    monkeypatch.setenv(SWITCH, "0")
    assert choose(SimpleNamespace) is plain


def test_nothing_is_compiled_with_the_switch():
    told = subprocess.run(
        [
            sys.executable,
            "-c",
            "import sys, adhesion_can.estimation.tracker.tracker; print('numba' in sys.modules)",
        ],
        env=os.environ | {SWITCH: "0"},
        capture_output=True,
        text=True,
        check=True,
    )
    assert told.stdout.strip() == "False"


@pytest.mark.parametrize(
    ("hits", "wanted", "said"),
    [(0, True, True), (0, None, False), (0, False, False), (1, True, False)],
)
def test_the_first_compilation_is_told_once_where_somebody_looks(
    monkeypatch, capsys, hits, wanted, said
):
    from adhesion_can.estimation.tracker.kernels import jit

    made = SimpleNamespace(stats=SimpleNamespace(cache_hits={"a": 1} if hits else {}))
    monkeypatch.setattr(jit.numba, "njit", lambda *_, **__: lambda _: made)
    jit._log_compilation.cache_clear()
    with _compilation_told("replay", wanted=wanted):
        for _ in range(2):
            jit.compiled(lambda *_: None)(len)
    err = capsys.readouterr().err
    assert err.count("\n") == err.count("adhesion-can replay: compiling the estimator") == said
