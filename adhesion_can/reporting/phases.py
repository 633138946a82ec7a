"""Comparison of estimates with the truth of a simulated run, surface by surface."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from adhesion_can.physics.doubt import DESCRIPTIONS
from adhesion_can.physics.status import Status
from adhesion_can.reporting.text import FittingTable
from adhesion_can.result_text import plus_minus
from adhesion_can.service.outputs import Outputs

WITHIN = 0.05
"""Largest relative error of μ_max at which a surface counts as found, in TRACKING."""


@dataclass(frozen=True, slots=True)
class Row:
    """A setpoint, and the adhesion used when it was sent.

    Attributes:
        t_us: Stamp of the setpoint, µs.
        outputs: Outputs of the service.
        adhesion_used: Adhesion coefficient of all axles together, Σ F / Σ N.

    """

    t_us: int
    outputs: Outputs
    adhesion_used: float


@dataclass(frozen=True, slots=True)
class Phase:
    """Segment of a simulated run on one surface, with the estimate at its end.

    Attributes:
        truth: Entry of the truth's `surfaces`.
        last: Outputs at the end of the segment; None where there were none.
        found_s: Time from the start of the segment until its surface was found, s; None where it
            never was.
        adhesion_used: Mean share of μ_max that was used in the segment; None without setpoints.

    """

    truth: dict[str, Any]
    last: Outputs | None
    found_s: float | None
    adhesion_used: float | None

    @property
    def error(self) -> float | None:
        """Relative error of μ_max at the end."""
        mu_max = self.last.setpoint.mu_max if self.last else None
        return None if mu_max is None else mu_max / float(self.truth["mu_max"]) - 1.0

    def to_dict(self) -> dict[str, Any]:
        """Entry for `--json`."""
        point = self.last.setpoint if self.last else None
        return {
            "surface": self.truth["name"],
            "from_s": self.truth["from_s"],
            "to_s": self.truth["to_s"],
            "true": {k: self.truth[k] for k in ("mu_max", "lambda_m")},
            "estimated": point and {"mu_max": point.mu_max, "lambda_m": point.lambda_m},
            "mu_max_std": self.last and self.last.mu_max_std,
            "lambda_m_std": self.last and self.last.lambda_m_std,
            "mu_max_error": self.error,
            "found_after_s": self.found_s,
            "adhesion_used": self.adhesion_used,
            "doubt": self.last and self.last.doubt.json_name,
        }


def phases(truth: dict[str, Any], rows: Sequence[Row]) -> list[Phase]:
    """Phases of a run: the surfaces of its truth with the estimates on them."""
    result = []
    for surface in truth["surfaces"]:
        inside = [r for r in rows if surface["from_s"] < r.t_us / 1e6 <= surface["to_s"]]
        found_row = next((r for r in inside if _found(r.outputs, surface["mu_max"])), None)
        used = [row.adhesion_used for row in inside]
        result.append(
            Phase(
                surface,
                inside[-1].outputs if inside else None,
                None if found_row is None else found_row.t_us / 1e6 - surface["from_s"],
                sum(used) / len(used) / surface["mu_max"] if used else None,
            )
        )
    return result


def _found(outputs: Outputs, mu_max: float) -> bool:
    estimate = outputs.setpoint.mu_max
    return (
        outputs.status is Status.TRACKING
        and estimate is not None
        and abs(estimate / mu_max - 1.0) <= WITHIN
    )


PHASE_COLUMNS = (
    "surface", "from s", "found", "doubt", "mu_max", "estimated", "error",
    "lambda_m", "estimated", "used",
)  # fmt: skip


def phase_rows(run_phases: Sequence[Phase]) -> list[tuple[str, ...]]:
    """Cells of truth and estimate, a row a surface."""
    rows: list[tuple[str, ...]] = []
    for phase in run_phases:
        out, true = phase.last or Outputs(), phase.truth
        point = out.setpoint
        rows.append(
            (
                str(true["name"]),
                f"{true['from_s']:.1f}",
                "not found" if phase.found_s is None else f"{phase.found_s:.2f} s",
                out.doubt.name.lower().replace("_", " ") if out.doubt in DESCRIPTIONS else "-",
                f"{true['mu_max']:.4f}",
                plus_minus(point.mu_max, out.mu_max_std),
                "-" if phase.error is None else f"{100 * phase.error:+.1f} %",
                f"{true['lambda_m']:.4f}",
                plus_minus(point.lambda_m, out.lambda_m_std),
                "-" if phase.adhesion_used is None else f"{100 * phase.adhesion_used:.0f} %",
            )
        )
    return rows


def phase_table(run_phases: Sequence[Phase]) -> FittingTable:
    """Table of truth and estimate, a row a surface; with a column of doubts where there are any."""
    rows = phase_rows(run_phases)
    doubtful = any(phase.last and phase.last.doubt in DESCRIPTIONS for phase in run_phases)
    shown = [i for i, name in enumerate(PHASE_COLUMNS) if doubtful or name != "doubt"]
    title = "Truth and estimate at the end of each surface"
    return FittingTable(
        title, [PHASE_COLUMNS[i] for i in shown], [[row[i] for i in shown] for row in rows]
    )
