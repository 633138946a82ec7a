"""Result of the batch fit of a recording: one curve for all of it, and one for each segment."""

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, NamedTuple

from adhesion_can.estimation.compare_directions import Directions
from adhesion_can.estimation.missing_peak import MissingPeak
from adhesion_can.normal_quantiles import NORMAL_95
from adhesion_can.physics.estimate import Estimate
from adhesion_can.result_text import TimeScale, html_table, plus_minus

if TYPE_CHECKING:
    from adhesion_can.estimation.curves.result import CurveComparison
    from adhesion_can.estimation.rail_peak import RailPeak

NOT_SHOWN = "not in data"
"""Text in place of a number of the peak that the data do not show."""


class Segment(NamedTuple):
    """Span of samples on one surface.

    Attributes:
        from_us: Stamp of its first sample, µs.
        to_us: Stamp of its last sample, µs.
        estimate: Estimate from its samples; its peak is not identifiable where directions differ.
        directions: What speaks against one curve for traction and braking.
        missing: What of the peak the samples do not show, and why.

    """

    from_us: int
    to_us: int
    estimate: Estimate
    directions: Directions = Directions()
    missing: MissingPeak = MissingPeak("")

    def sentence(self, times: TimeScale) -> str:
        """Why its peak is not known, with the times; '' where it is."""
        why = self.directions.sentence or self.missing.clause
        return why and f"{times.span(self.from_us, self.to_us)} s: {why}"


@dataclass(frozen=True, slots=True)
class BatchResult:
    """Result of a batch fit.

    Attributes:
        whole: Estimate of one curve for all samples; not identifiable where the surface changed.
        segments: Segments with one surface each, at least one.
        left_out: Number of samples outside the model's range, or not finite.
        curves: Comparison of curve families in each segment, None for one with too few samples;
            () where none was asked for.
        whole_curves: Comparison of curve families on all samples together; None without `curves`.
        rails: Peak of the rail in each segment by the curve families that hold, which its estimate
            states where Burckhardt's does not; None for a segment in which none are compared, ()
            where that was not asked for.

    """

    whole: Estimate
    segments: tuple[Segment, ...]
    left_out: int
    curves: "tuple[CurveComparison | None, ...]" = ()
    whole_curves: "CurveComparison | None" = None
    rails: "tuple[RailPeak | None, ...]" = ()

    @property
    def times(self) -> TimeScale:
        """Scale of the segments' times for people."""
        return TimeScale.beginning_at(self.segments[0].from_us)

    def to_dict(self) -> dict[str, Any]:
        """Estimates of all samples together and of each segment, as JSON has them."""
        segments: list[dict[str, Any]] = [
            {
                "from_s": s.from_us / 1e6,
                "to_s": s.to_us / 1e6,
                **_with_intervals(s.estimate),
                "directions": s.directions._asdict(),
                "missing": s.directions.sentence or s.missing.clause or None,
            }
            for s in self.segments
        ]
        whole = _with_intervals(self.whole)
        if self.rails:
            judged = [rail and rail.to_dict() for rail in self.rails]
            for segment, family in zip(segments, judged, strict=True):
                segment["family"] = family
            # The surface changed: no family holds for all of it.
            whole["family"] = judged[0] if len(judged) == 1 else None
        document = {**whole, "segments": segments, "left_out": self.left_out}
        if self.curves:
            curve_dicts = [None if c is None else c.to_dict() for c in self.curves]
            for segment, curves in zip(segments, curve_dicts, strict=True):
                segment["curves"] = curves
            document["curves"] = self.whole_curves and self.whole_curves.to_dict()
        return document

    def _repr_html_(self) -> str:
        rows = [
            (
                self.times.span(s.from_us, s.to_us),
                str(s.estimate.samples),
                *peak_cells(s.estimate),
                "yes" if s.estimate.identifiable.both else "no",
            )
            for s in self.segments
        ]
        columns = ("time s", "samples", "mu_max", "lambda_m", "identifiable")
        title = f"Batch fit by surface, ± standard deviation{self.times.note}"
        return html_table(title, columns, rows)


def peak_cells(estimate: Estimate) -> tuple[str, str]:
    """Texts of mu_max and lambda_m; of what the data do not show there is no number."""
    known = estimate.identifiable
    return (
        plus_minus(estimate.mu_max, estimate.mu_max_std) if known.mu_max else NOT_SHOWN,
        plus_minus(estimate.lambda_m, estimate.lambda_m_std) if known.lambda_m else NOT_SHOWN,
    )


def _with_intervals(estimate: Estimate) -> dict[str, Any]:
    """Estimate as JSON has it, with the 95 % intervals of the peak; None where unknown."""
    document = estimate.to_dict()
    for name in ("mu_max", "lambda_m"):
        value, std = document[name]["value"], document[name]["std"]
        ends = None if std is None else [value - NORMAL_95 * std, value + NORMAL_95 * std]
        document[name] = {**document[name], "interval": ends}
    return document
