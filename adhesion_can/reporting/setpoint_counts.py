"""Numbers of the setpoints of a drive by status, by doubt and by objection."""

from collections import Counter

from adhesion_can.physics.doubt import DESCRIPTIONS, Doubt
from adhesion_can.physics.objection import Objection
from adhesion_can.physics.status import Status
from adhesion_can.reporting.objections import ObjectionLog
from adhesion_can.service.outputs import Outputs


class SetpointCounts:
    """Numbers of setpoints by status, by doubt and by objection."""

    def __init__(self) -> None:
        self.by_status: Counter[Status] = Counter()
        self.by_doubt: Counter[Doubt] = Counter()
        self.by_objection: Counter[Objection] = Counter()
        self.objections = ObjectionLog()

    def add(self, t_us: int, outputs: Outputs) -> None:
        """Add the setpoint of a due time, µs."""
        self.by_status[outputs.status] += 1
        self.by_doubt[outputs.doubt] += 1
        self.by_objection[outputs.objection] += 1
        self.objections.add(t_us, outputs.objection)

    @property
    def doubts(self) -> list[Doubt]:
        """What was doubted, the most frequent first."""
        return [doubt for doubt, _ in self.by_doubt.most_common()]

    def share(self, count: int) -> str:
        """Share of a number of setpoints in all of them, as text."""
        return f"{100 * count / (self.by_status.total() or 1):.1f} %"

    def describe_doubts(self) -> list[str]:
        """Line with the share of the time with doubt and what it was about; none without doubt."""
        doubts = [(doubt, n) for doubt, n in self.by_doubt.most_common() if doubt in DESCRIPTIONS]
        if not doubts:
            return []
        whole = self.share(sum(n for _, n in doubts))
        shares = [f" ({self.share(n)})" if len(doubts) > 1 else "" for _, n in doubts]
        reasons = [
            DESCRIPTIONS[doubt] + share for (doubt, _), share in zip(doubts, shares, strict=True)
        ]
        return [f"doubt {whole} of the time ({', '.join(reasons)}): run `diagnose`"]
