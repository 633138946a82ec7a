"""Texts of the page of a replay: what was replayed, and the quality of its data."""

from collections.abc import Mapping, Sequence

from adhesion_can.reporting.data_quality import quality_parts
from adhesion_can.reporting.drive.page import DriveTexts
from adhesion_can.reporting.page import Part
from adhesion_can.service.core import ServiceCore
from adhesion_can.service.replay import ReplaySummary


def replay_texts(
    summary: ReplaySummary,
    core: ServiceCore,
    problems: Sequence[str],
    verdict: Sequence[str],
    provenance: Mapping[str, str],
) -> DriveTexts:
    """Texts of the page of a replay."""
    span_s = ((summary.last_us or 0) - (summary.first_us or 0)) / 1e6
    lead = (
        f"The service on {summary.frames} recorded frames ({duration_text(span_s)}), as it would "
        "have run live."
    )
    return DriveTexts(
        title="Replay of a drive",
        lead=lead,
        verdict=[*verdict, _quality_sentence(core, summary.frames)],
        quality=core_quality(core, summary.frames, summary.own_skipped, problems),
        provenance=provenance,
    )


def core_quality(
    core: ServiceCore, frames: int, own_skipped: int = 0, problems: Sequence[str] = ()
) -> list[Part]:
    """Parts of the section on data quality, of a core that went through a drive.

    Args:
        core: Core after the drive.
        frames: Number of frames.
        own_skipped: Number of recorded frames of our own ids.
        problems: Sentence for each problem of the recordings.

    """
    counts = {
        "frames": frames,
        "frames with other ids": core.counts.foreign,
        "frames with the service's own ids, skipped": own_skipped,
        "frames rejected": core.receiver.rejected,
        "frames lost": core.receiver.lost,
        "frames stamped earlier than the previous frame": core.counts.clamped,
        "restarts of the service after a gap in time": core.counts.restarts,
        "samples": core.counts.samples,
    }
    dropped = core.dropped_samples | core.left_out_samples
    notes = [*problems, *core.receiver.stuck_sentences, *core.faults]
    return quality_parts(core.receiver.records, counts, dropped, notes)


def duration_text(seconds: float) -> str:
    """Duration as a text: seconds, or minutes from two of them on."""
    return f"{seconds:.1f} s" if seconds < 120 else f"{seconds / 60:.1f} min"


def _quality_sentence(core: ServiceCore, frames: int) -> str:
    rejected, lost = core.receiver.rejected, core.receiver.lost
    if not rejected and not lost:
        return "Data: no frame was rejected, and no counter shows a missing one."
    return (
        f"Data: {rejected} of {frames} frames rejected, {lost} missing according to their counters."
    )
