"""A betting test of whether a model predicts fresh readings better than the plain curve does.

A test martingale (Shafer 2021, J. R. Stat. Soc. A 184, 407-431; Ville 1939): someone begins with a
wealth of 1 and, before each span of fresh readings, bets a fixed share of it that the model will
predict that span better. The wealth is multiplied by 1 + b where it does and by 1 - b where it does
not. If the model is no better, that is, if the chance of 'better' is at most a half whatever came
before, the wealth is a supermartingale, and it ever exceeds w with a probability of at most 1/w. So
one may look after each span and stop at will. The mirrored bet, on 'worse', drops a model.
"""

from enum import StrEnum

BET = 0.4
"""Share of the wealth that is bet: the best one where the model is better in 70 % of spans."""
PROVEN = 1000.0
"""Wealth at which a bet has proven its point: falsely once in a thousand times at most."""
SPAN_S = 5.0
"""Length of a span, s: errors of the vehicle speed do not last much longer."""
MOST_AGE_S = 1200.0
"""Time after which a model that is not confirmed is dropped, s."""


class LearningState(StrEnum):
    """State of what is learned."""

    UNESTIMATED = "unestimated"
    """No cause is proposed."""
    ESTIMATED = "estimated"
    """A model is proposed, and being confirmed on fresh readings."""
    CONFIRMED = "confirmed"
    """The model predicts fresh readings better than the plain curve."""
    INVALID = "invalid"
    """The model was dropped: it predicts worse, or could not be confirmed."""


class BettingTest:
    """Wealth of who bets that a model predicts better, and of who bets that it predicts worse."""

    def __init__(self) -> None:
        self.better = self.worse = 1.0
        self.spans = self.won = 0
        """Number of spans, and of those in which the model predicted better."""

    def add(self, *, is_better: bool) -> None:
        """Settle the bets on one span."""
        self.spans += 1
        self.won += is_better
        # Who has proven the point goes home: after hours the wealth would be no number any more.
        self.better = min(self.better * (1.0 + BET if is_better else 1.0 - BET), PROVEN**2)
        self.worse = min(self.worse * (1.0 - BET if is_better else 1.0 + BET), PROVEN**2)


class ModelConfirmation:
    """State of a proposed model as fresh readings come in.

    A confirmed model is watched on: whenever a bet on 'worse' has lost, it begins again with a
    wealth of 1 (Page's cumulative sum), so that a model that was right for hours is dropped soon
    after it is not.

    Args:
        since_us: Time from which readings are fresh, µs.
        most_age_s: Time after which a model that is not confirmed is dropped, s.

    """

    def __init__(self, since_us: int, most_age_s: float = MOST_AGE_S) -> None:
        self.state = LearningState.ESTIMATED
        self.reason = ""
        """Reason why the model was dropped, a clause."""
        self.checked_us = since_us
        """End of the latest span that distinguished the models, µs."""
        self._since_us = since_us
        self._most_age_us = most_age_s * 1e6
        self._test = BettingTest()

    @property
    def spans(self) -> int:
        """Number of spans of fresh readings that distinguished the models."""
        return self._test.spans

    @property
    def won(self) -> int:
        """Number of those spans that the model predicted better than the plain curve."""
        return self._test.won

    @property
    def wealth(self) -> float:
        """Wealth of who bets that the model predicts better."""
        return self._test.better

    def add(self, t_us: int, *, is_better: bool) -> None:
        """Take a span of fresh readings into account.

        Args:
            t_us: End of the span, µs.
            is_better: Whether the model predicted it better than the plain curve.

        """
        if self.state is LearningState.INVALID:
            return
        self._test.add(is_better=is_better)
        self.checked_us = t_us
        if self.state is LearningState.CONFIRMED:
            self._test.worse = max(self._test.worse, 1.0)
        if self._test.worse >= PROVEN:
            self._drop("it predicts fresh readings worse than the plain curve")
        elif self.state is LearningState.ESTIMATED and self._test.better >= PROVEN:
            self.state = LearningState.CONFIRMED
            self._test.worse = 1.0
        self.grow_old(t_us)

    def pause(self, duration_us: int) -> None:
        """Leave a time, µs, out of the age: readings came that predict nothing, as at a stand."""
        self._since_us += duration_us

    def grow_old(self, t_us: int) -> None:
        """Drop a model that is not confirmed by a time, µs, that is too late."""
        if self.state is LearningState.ESTIMATED and t_us - self._since_us > self._most_age_us:
            minutes = self._most_age_us / 60e6
            self._drop(f"{minutes:.0f} minutes of fresh readings did not confirm it")

    def _drop(self, reason: str) -> None:
        self.state, self.reason = LearningState.INVALID, reason
