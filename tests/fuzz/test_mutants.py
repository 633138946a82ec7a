"""Mutants of files and models through the command line; `tools/fuzz --files N` plays more."""

import gc

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from tests.fuzz.mutants import KINDS, mutant, play, seeds

pytest.importorskip("asammdf")
QUICK = settings(max_examples=100, deadline=None, suppress_health_check=[HealthCheck.too_slow, *()])


@pytest.mark.parametrize("kind", KINDS)
def test_seeds_are_sound(kind):
    outcomes = [play(kind, data) for data in seeds(kind)]
    assert {outcome.status for outcome in outcomes} <= {0, 1}


@pytest.fixture(scope="module")
def small_heap():
    """A heap in which the collector walks over what an example leaves, and nothing else."""
    gc.freeze()
    yield
    gc.unfreeze()


@pytest.mark.timeout(900)
@pytest.mark.usefixtures("small_heap")
@pytest.mark.parametrize("kind", KINDS)
@QUICK
@given(number=st.integers(0, 10**9), command=st.integers(0, 5))
def test_a_mutant_is_used_or_refused(kind, number, command):
    play(kind, mutant(kind, number), command)
    gc.collect()  # a file that was left open warns now
