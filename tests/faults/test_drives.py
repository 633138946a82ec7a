"""Fault drives through the core: never sure and wrong for longer than half a second."""

import pytest

from tests.faults.catalogue import KINDS, find, pair_name, title
from tests.faults.play import cases, make_case, play

MOST_WRONG = 0.01
"""Share of the time that may be TRACKING and wrong, half a second after the error became big."""
PAIRS = 20
QUICK = (
    "nothing",
    "real_wet_rail",
    "wheels_at_rest",
    "wheels_fast",
    "speed_less",
    "efforts_more",
)
"""Kinds that are played each time, in one drive each."""


@pytest.mark.parametrize("name", QUICK)
def test_a_fault_is_not_followed_for_long(name):
    one = play(name, make_case(name, KINDS[name].sizes[0], 2, stays=True))
    assert one.verdict.before > 0.95
    assert one.verdict.wrong_late <= MOST_WRONG
    if name == "nothing":
        assert one.verdict.tracking > 0.99
    if KINDS[name].event is not None:
        assert one.verdict.faults == 0.0


@pytest.mark.slow
@pytest.mark.timeout(3600)
@pytest.mark.parametrize("name", KINDS)
def test_each_kind(name):
    """What cannot be seen in principle is played too: it must not break anything."""
    verdicts = [play(name, case).verdict for case in cases(name, 2)]
    if not find(name).unseen:
        assert max(verdict.wrong_late for verdict in verdicts) <= MOST_WRONG
    if KINDS[name].event is not None:
        assert max(verdict.faults for verdict in verdicts) == 0.0


@pytest.mark.slow
@pytest.mark.timeout(3600)
@pytest.mark.parametrize("number", range(PAIRS))
def test_pairs(number):
    name = pair_name(number)
    one = play(name, cases(name, number)[0])
    if not find(name).unseen:
        assert one.verdict.wrong_late <= MOST_WRONG, title(name)
