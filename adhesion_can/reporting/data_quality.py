"""Quality of the frames of a recording: tables for a terminal and for pages."""

from collections.abc import Iterable, Mapping, Sequence

from adhesion_can.bus.message_record import MessageRecord
from adhesion_can.offline.check import mean_cycle_ms
from adhesion_can.reporting.page import Items, Part, Table, Text

MESSAGE_COLUMNS = (
    "message", "frames", "rejected", "lost", "n/a", "cycle ms", "nominal", "gap ms",
)  # fmt: skip


def message_rows(records: Iterable[MessageRecord]) -> list[tuple[str, ...]]:
    """Cells of the table of messages, a row each."""
    rows: list[tuple[str, ...]] = []
    for record in records:
        cycle, nominal = mean_cycle_ms(record), record.message.cycle_us
        rows.append(
            (
                f"{record.message.plan.name} {record.message.plan.frame_id:#x}",
                str(record.frames),
                str(sum(record.rejected.values())),
                str(record.lost),
                str(record.not_available),
                "-" if cycle is None else f"{cycle:.2f}",
                "-" if nominal is None else f"{nominal / 1e3:.0f}",
                f"{record.longest_gap_us / 1e3:.0f}",
            )
        )
    return rows


def message_table(records: Sequence[MessageRecord]) -> Table:
    """Table of the received messages for a page."""
    return Table(
        "Messages, their cycles and faults.",
        MESSAGE_COLUMNS,
        message_rows(records),
        "rejected: wrong checksum, counter, length or range. lost: missing according to the "
        "counter. n/a: readings marked 'not available'. cycle: mean time between accepted frames. "
        "gap: the longest one.",
    )


def quality_parts(
    records: Sequence[MessageRecord],
    counts: Mapping[str, int],
    dropped: Mapping[str, int],
    problems: Sequence[str],
) -> list[Part]:
    """Parts of the section on data quality.

    Args:
        records: Records of the received messages.
        counts: Numbers of frames and samples by what they are.
        dropped: Number of wheel-speed readings that gave no sample, by reason.
        problems: Sentence for each problem of the files or of the service.

    """
    parts: list[Part] = [message_table(records)]
    reasons = rejection_rows(records)
    if reasons:
        columns = ("message", "reason", "frames")
        parts.append(Table("Rejected frames by reason.", columns, reasons))
    rows = [(name, str(count)) for name, count in counts.items()]
    rows += [(f"wheel speeds without a sample: {why}", str(n)) for why, n in dropped.items() if n]
    parts.append(Table("Frames and samples.", ("what", "number"), rows))
    if problems:
        parts += [Text("Notes:"), Items(problems)]
    return parts


def rejection_rows(records: Iterable[MessageRecord]) -> list[tuple[str, str, str]]:
    """Cells of the table of rejected frames, a row for each message and reason."""
    return [
        (record.message.plan.name, str(reason), str(count))
        for record in records
        for reason, count in record.rejected.items()
        if count
    ]
