"""Result: the drive that would separate, as plain values."""

from dataclasses import asdict, dataclass
from typing import Any

from adhesion_can.physics.driving_plan import DrivingPlan


@dataclass(frozen=True, slots=True)
class PairDiscrepancy:
    """How far a rival stays from what an explanation predicts for the plan.

    Attributes:
        explanation: Name of the explanation that holds.
        rival: Name of the rival, fitted to it.
        discrepancy: Sum of squares that is left, in variances of the noise (noncentrality).
        power: Probability that the rival is refuted.

    """

    explanation: str
    rival: str
    discrepancy: float
    power: float


@dataclass(frozen=True, slots=True)
class NextDrive:
    """The drive that would distinguish the remaining explanations, or why there is none.

    Attributes:
        explanations: Names of the explanations.
        plan: Plan; None where there is none.
        sentence: What to drive and what each explanation predicts, or why there is no plan.
        pairs: Discrepancy of every pair on the plan, or on the most promising drive.

    """

    explanations: tuple[str, ...]
    plan: DrivingPlan | None
    sentence: str
    pairs: tuple[PairDiscrepancy, ...] = ()

    def to_dict(self) -> dict[str, Any]:
        """Fields of `diagnosis.json`."""
        plan = self.plan
        return {
            "explanations": list(self.explanations),
            "sentence": self.sentence,
            "duration_s": None if plan is None else plan.duration_s,
            "start_speed": None if plan is None else plan.start_speed,
            "steps": [] if plan is None else [step.description for step in plan.steps],
            "predictions": []
            if plan is None
            else [asdict(prediction) for prediction in plan.predictions],
            "pairs": [asdict(pair) for pair in self.pairs],
        }
