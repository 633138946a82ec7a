"""Mutants of files and models through the command line; `tools/fuzz --files N` plays more."""

import gc

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from tests.fuzz.mutants import KINDS, mutant, play, seeds

pytest.importorskip("asammdf")
QUICK = settings(max_examples=25, deadline=None, suppress_health_check=[HealthCheck.too_slow])
AT_ONCE = {".mf4": 1, ".db": 1}
"""Mutants of an example; these are read by a process of their own, which takes long to start."""
FEW = settings(QUICK, max_examples=5)
IN_A_PROCESS = ".mf4"


EACH_KIND = [
    pytest.param(kind, marks=(pytest.mark.slow, pytest.mark.long)) if kind == IN_A_PROCESS else kind
    for kind in KINDS
]


@pytest.mark.parametrize("kind", EACH_KIND)
def test_seeds_are_sound(kind):
    outcomes = [play(kind, data) for data in seeds(kind)]
    assert {outcome.status for outcome in outcomes} <= {0, 1}


@pytest.fixture(scope="module")
def small_heap():
    """A heap in which the collector walks over what an example leaves, and nothing else."""
    gc.freeze()
    yield
    gc.unfreeze()


@pytest.mark.costly
@pytest.mark.timeout(900)
@pytest.mark.usefixtures("small_heap")
@pytest.mark.parametrize("kind", EACH_KIND)
@QUICK
@given(number=st.integers(0, 10**9), command=st.integers(0, 5))
def test_a_mutant_is_used_or_refused(kind, number, command):
    for place in range(AT_ONCE.get(kind, 4)):
        play(kind, mutant(kind, number + place), command)
    gc.collect()  # a file that was left open warns now


@pytest.mark.costly
@pytest.mark.timeout(300)
@FEW
@given(number=st.integers(0, 10**9), command=st.integers(0, 5))
def test_a_few_mutants_that_take_long_are_used_or_refused(number, command):
    play(IN_A_PROCESS, mutant(IN_A_PROCESS, number), command)
