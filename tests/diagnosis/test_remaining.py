"""What a further drive leaves of explanations: each reason is that of the test that refuted it."""

import numpy as np
import pytest

from adhesion_can.diagnosis.next_drive import remaining
from adhesion_can.diagnosis.next_drive.explanations import PLAIN, Explanation
from adhesion_can.diagnosis.next_drive.remaining import (
    RefutedExplanation,
    RemainingExplanations,
    find_remaining,
)
from adhesion_can.diagnosis.regression.prepare_regression import PreparedRegression
from adhesion_can.diagnosis.regression.whitened_regression import fit_model
from tests.diagnosis.test_refutation import fitted, sweeps


def explain(regression, *effects):
    model = fitted(regression, *effects)
    return Explanation(" with ".join(effects) or PLAIN, model, np.zeros((0, 0)))


@pytest.fixture(scope="module")
def compared():
    """Humidity acts; the plain curve and a drift are the other explanations."""
    regression = sweeps(1, lambda *row: 1.0 - 0.003 * (row[3] - 60.0))
    plain = fit_model(regression, fitted(regression))
    prepared = PreparedRegression(regression, plain, (), ())
    explanations = [explain(regression, *own) for own in ((), ("slow_drift",), ("humidity",))]
    return lambda: find_remaining(explanations, prepared, ["first"], ["second"])


def test_the_noise_refutes_what_does_not_act(compared):
    found = compared()
    assert found.left == ("humidity",)
    assert found.p_value < 1e-6
    reasons = {one.name: one.reason for one in found.refuted}
    assert "standard deviations of the noise larger than that of humidity" in reasons[PLAIN]


def test_what_the_blocks_refute_has_the_reason_and_the_p_value_of_the_blocks(compared, monkeypatch):
    monkeypatch.setattr(remaining, "_distance", lambda *_: 0.0)
    found = compared()
    assert found.left == ("humidity",)
    (plain,) = (one for one in found.refuted if one.name == PLAIN)
    assert "above that of humidity, more than the scatter of the blocks" in plain.reason
    assert 0.0 < found.p_value < 0.05


def test_where_none_is_left_the_sentence_says_what_follows():
    refuted = (RefutedExplanation("humidity", "its size is 0 within its error"),
               RefutedExplanation(PLAIN, "it misses the data"))  # fmt: skip
    sentence = RemainingExplanations(("first",), ("second",), (), refuted).sentence
    assert sentence.startswith(
        "No explanation that remained after first (humidity, the plain curve) survives second"
    )
    assert "humidity is refuted: its size is 0 within its error; the plain curve" in sentence
    assert sentence.endswith("The cause is something else, or has another form.")


def test_the_plain_curve_alone_is_not_left_where_more_than_noise_is():
    other = RefutedExplanation("sanding", "its size is 0 within its error")
    found = RemainingExplanations(("first",), ("second",), (PLAIN,), (other,)).without_plain()
    plain = RefutedExplanation(PLAIN, "the residual is more than noise")
    assert (found.left, found.refuted) == ((), (other, plain))
    assert found.refutes_plain


@pytest.mark.parametrize("left", [(), ("sanding",), ("sanding", PLAIN)])
def test_beside_others_the_plain_curve_stays(left):
    found = RemainingExplanations(("first",), ("second",), left, ())
    assert found.without_plain() is found
