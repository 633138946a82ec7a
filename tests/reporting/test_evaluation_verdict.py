"""What is said of a model by its gain on data that it has not seen."""

from math import inf
from types import SimpleNamespace

import pytest

from adhesion_can.diagnosis.gain_result import Comparison
from adhesion_can.diagnosis.model_worth import describe_gain
from adhesion_can.reporting.evaluation import verdict

PLAIN = 0.02


def compared(percent, interval):
    return Comparison(PLAIN * (1 - percent / 100), percent, interval, PLAIN)


@pytest.mark.parametrize(
    ("percent", "interval", "said"),
    [
        (-45.9, (-51.4, -40.6), "a loss: the whole interval is below 0."),
        (-2.0, (-6.0, 1.0), "not certain, because the interval includes 0."),
        (3.0, (-1.0, 7.0), "not certain, because the interval includes 0."),
        (3.0, (-inf, inf), "not certain, because the data have too few spans for an interval."),
        (30.0, (25.0, 35.0), "of practical use (0.5 % or more)."),
        (0.6, (0.1, 1.1), "of practical use (0.5 % or more)."),
        (0.4, (0.1, 0.7), "too small to be of practical use (less than 0.5 %)."),
        (0.1, (0.05, 0.15), "too small to be of practical use (less than 0.5 %)."),
        (-0.1, (-0.3, 0.2), "too small to be of practical use (less than 0.5 %)."),
    ],
)
def test_the_verdict_says_what_was_compared_and_what_the_gain_is_worth(percent, interval, said):
    one = compared(percent, interval)
    found = SimpleNamespace(total=SimpleNamespace(plain=PLAIN, as_written=one, refitted=one))
    sentence = verdict(found)
    assert f"the plain curve 0.02: gain {describe_gain(one)}, {said} As written" in sentence
    assert sentence.count("of practical use") == said.count("of practical use")


def test_a_curve_that_does_not_apply_is_named():
    refitted, written = compared(30.0, (25.0, 35.0)), compared(-3.0, (-5.0, -1.0))
    total = SimpleNamespace(plain=PLAIN, as_written=written, refitted=refitted)
    assert "its curve does not: the surface or the wheel differs." in verdict(
        SimpleNamespace(total=total)
    )


@pytest.mark.parametrize(
    ("percent", "interval", "text"),
    [
        (43.13, (36.4, 49.0), "43.1 % (95 % interval 36.4 to 49.0 %)"),
        (0.104, (0.05, 0.15), "0.10 % (95 % interval 0.05 to 0.15 %)"),
        (-0.001, (-0.004, 0.0), "0.00 % (95 % interval 0.00 to 0.00 %)"),
        (3.0, (-inf, inf), "3.0 %"),
    ],
)
def test_a_gain_has_its_interval_and_the_decimals_that_it_needs(percent, interval, text):
    assert describe_gain(compared(percent, interval)) == text
