"""What is said of a model by its gain on data that it has not seen."""

from types import SimpleNamespace

import pytest

from adhesion_can.reporting.evaluation import verdict


@pytest.mark.parametrize(
    ("percent", "interval", "said", "not_said"),
    [
        (-45.9, (-51.4, -40.6), "worse here: the whole interval is below 0", "includes 0"),
        (-2.0, (-6.0, 1.0), "the interval of the gain includes 0", "harm"),
        (3.0, (-1.0, 7.0), "the interval of the gain includes 0", "harm"),
        (30.0, (25.0, 35.0), "below the plain curve's", "not certain"),
    ],
)
def test_the_verdict_follows_the_interval(percent, interval, said, not_said):
    plain = 0.02
    one = SimpleNamespace(rmse=plain * (1 - percent / 100), percent=percent, interval=interval)
    found = SimpleNamespace(total=SimpleNamespace(plain=plain, as_written=one, refitted=one))
    sentence = verdict(found)
    assert said in sentence
    assert not_said not in sentence
