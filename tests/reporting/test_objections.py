"""Objections of a drive: a wait for the vehicle's answer is none, whatever its share of time."""

import pytest

from adhesion_can.physics.objection import Objection
from adhesion_can.reporting.objections import ObjectionLog

CYCLE_US = 20_000
JUMP, NONE = Objection.EFFORTS_JUMP, Objection.NONE


def log(*spans):
    """A drive of spans: objection and seconds."""
    out, cycle = ObjectionLog(), 0
    for objection, seconds in spans:
        for _ in range(round(seconds * 1e6 / CYCLE_US)):
            out.add(cycle * CYCLE_US, objection)
            cycle += 1
    return out


def test_waits_for_an_answer_are_no_objection_however_many():
    found = log(*[(NONE, 1.0), (JUMP, 1.0)] * 5)
    assert found.foremost is None
    assert found.shares == {}
    (sentence,) = found.sentences()
    assert sentence.startswith("50.0 % of the time the service waited for the vehicle's answer")
    assert "(5 times, 1.0 s at most)" in sentence
    assert "no fault" in sentence


def test_efforts_that_nothing_answers_are_one_however_small_its_share():
    found = log((NONE, 200.0), (JUMP, 1.0), (NONE, 5.0), (JUMP, 3.0), (NONE, 20.0))
    assert (found.foremost.from_us, found.foremost.to_us) == (206_000_000, 208_980_000)
    first, second = found.sentences()
    assert first.startswith("1.3 % of the time all efforts jumped at once")
    assert "(1 time, 1.0 s at most)" in second


@pytest.mark.parametrize(("seconds", "lasts"), [(4.0, False), (6.0, True)])
def test_another_objection_comes_first_from_its_share_of_the_time(seconds, lasts):
    found = log((NONE, 100.0 - seconds), (Objection.LOADS_JUMP, seconds))
    assert (found.foremost is not None) is lasts
    assert len(found.sentences()) == 1


def test_the_most_frequent_objection_comes_first():
    spans = (Objection.LOADS_JUMP, 10.0), (Objection.SPEED_JUMP, 20.0), (NONE, 1.0)
    found = log(*spans, (Objection.LOADS_JUMP, 15.0))
    assert found.foremost.objection is Objection.LOADS_JUMP
    assert found.foremost.seconds == pytest.approx(15.0, abs=0.1)
    assert list(found.shares) == [Objection.LOADS_JUMP, Objection.SPEED_JUMP]
