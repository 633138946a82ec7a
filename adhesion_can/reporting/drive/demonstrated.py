"""Texts of the page of the demo: what was simulated, and truth beside estimate."""

from collections.abc import Mapping, Sequence
from typing import Any

from adhesion_can.reporting.drive.page import DriveTexts
from adhesion_can.reporting.drive.replayed import core_quality, duration_text
from adhesion_can.reporting.page import Table
from adhesion_can.reporting.phases import PHASE_COLUMNS, Phase, phase_rows
from adhesion_can.service.core import ServiceCore


def demo_texts(
    truth: Mapping[str, Any],
    phases: Sequence[Phase],
    core: ServiceCore,
    provenance: Mapping[str, str],
) -> DriveTexts:
    """Texts of the page of the demo."""
    surfaces = truth["surfaces"]
    names = ", ".join(str(surface["name"]) for surface in surfaces)
    note = (
        "Estimates at the end of each surface, ± standard deviation. found: time until mu_max "
        "was within 5 % of the truth and the status TRACKING; used: mean adhesion as a share of "
        "mu_max."
    )
    caption = "Truth and estimate at the end of each surface."
    return DriveTexts(
        title="Demo: a simulated locomotive follows the service",
        lead=(
            "A simulated locomotive, the service and a creep controller on one bus, "
            f"{duration_text(surfaces[-1]['to_s'])}, on these surfaces: {names}."
        ),
        verdict=[_sentence(phase) for phase in phases],
        quality=core_quality(core, sum(record.frames for record in core.receiver.records)),
        truth=surfaces,
        comparison=[Table(caption, PHASE_COLUMNS, phase_rows(phases), note)],
        provenance=provenance,
    )


def _sentence(phase: Phase) -> str:
    name = f"{phase.truth['name']} rail from {phase.truth['from_s']:.1f} s"
    if phase.error is None or phase.last is None:
        return f"{name}: no estimate at the end."
    used = "" if phase.adhesion_used is None else f", {100 * phase.adhesion_used:.0f} % of it used"
    when = "never within 5 %"
    if phase.found_s is not None:
        when = f"within 5 % after {phase.found_s:.2f} s"
    return (
        f"{name}: μ_max {phase.truth['mu_max']:.4f}, {when}, {100 * phase.error:+.1f} % at the "
        f"end{used}."
    )
