"""Reports of a learner to the service: values that go through a pipe as JSON, a line each."""

import json
from dataclasses import asdict, dataclass
from typing import Any

from adhesion_can.learning.confirmation import LearningState

_FAILED = "failed: "


@dataclass(frozen=True, slots=True)
class LearnedCause:
    """A cause of a learned model.

    Attributes:
        effect: Effect id.
        size: Value of its first parameter, in `unit`.
        std: Standard deviation of that value; None where it has none.
        unit: Unit of the value.

    """

    effect: str
    size: float
    std: float | None
    unit: str


@dataclass(frozen=True, slots=True, kw_only=True)
class LearningReport:
    """State of the learner, sent when something in it has changed.

    Attributes:
        t_us: Stamp of the latest reading, µs.
        state: State of what is learned.
        news: Sentence for the operator; '' where only numbers changed.
        found: What was learned, a clause; '' where there is nothing.
        causes: Causes of the learned model, the main one first.
        path: File of the model; '' where there is none.
        model: Text of the model where it has just been confirmed; else ''.
        examined: Number of diagnoses of the whole record.
        proposed: Number of models that were proposed.
        spans: Number of spans of fresh readings that distinguished the model from the plain curve.
        won: Number of those spans that the model predicted better.
        outcome: Outcome of the latest diagnosis, a clause; '' before the first.

    """

    t_us: int = 0
    state: LearningState = LearningState.UNESTIMATED
    news: str = ""
    found: str = ""
    causes: tuple[LearnedCause, ...] = ()
    path: str = ""
    model: str = ""
    examined: int = 0
    proposed: int = 0
    spans: int = 0
    won: int = 0
    outcome: str = ""

    @classmethod
    def from_failure(cls, error: Exception) -> "LearningReport":
        """Report of an error that ends the learner."""
        return cls(news=f"{_FAILED}{type(error).__name__}: {error}")

    @property
    def is_failure(self) -> bool:
        """Whether the learner has ended with an error."""
        return self.news.startswith(_FAILED)

    def to_dict(self) -> dict[str, Any]:
        """Fields as JSON has them, without the model's text."""
        fields = asdict(self) | {"state": self.state.value}
        del fields["model"]
        return fields

    def to_line(self) -> str:
        """One line of JSON, with the model's text."""
        return json.dumps(self.to_dict() | {"model": self.model}) + "\n"

    @classmethod
    def from_line(cls, line: str) -> "LearningReport":
        """Report from a line that `to_line` made.

        Raises:
            ValueError: The line is none.

        """
        fields = json.loads(line)
        fields["state"] = LearningState(fields["state"])
        fields["causes"] = tuple(LearnedCause(**cause) for cause in fields["causes"])
        return cls(**fields)
