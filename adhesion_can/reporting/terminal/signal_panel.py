"""One message: its bytes, counts and signals, as lines of a width."""

from collections.abc import Sequence

from rich.text import Text

from adhesion_can.monitoring.latest_frames import LatestFrames, SignalView
from adhesion_can.monitoring.snapshot import MessageView, Snapshot
from adhesion_can.printable import printable
from adhesion_can.reporting.terminal.boxes import boxed, wrapped
from adhesion_can.reporting.terminal.tables import shortened

VALUE, UNIT, RAW, AGE = 11, 6, 8, 7
"""Width of the columns of a value, cells."""
MOST_NAME, LEAST_NOTE = 40, 17
"""Largest width of a signal's name, and smallest of the last column, cells."""
TABLE_HEADING = 2
"""Number of lines above the first signal: a blank one, and the names of the columns."""
LEAST_TABLE = 7
"""Number of lines that are left to the frame and to a table of signals."""


def signal_panel(
    snapshot: Snapshot, view: MessageView, width: int, height: int, first_row: int = 0
) -> list[Text]:
    """What a message carries: raw bytes, age, and every signal with value, unit and raw value.

    Args:
        snapshot: What is shown.
        view: The message.
        width: Width of the panel, cells; 80 or more.
        height: Height of the panel, lines; 12 or more.
        first_row: Number of signals that are scrolled past; at most as many as there are.

    """
    latest = snapshot.latest.get(view.key)
    lines = _heading(snapshot, view, latest, width, height)
    signals = () if latest is None else latest.signals(snapshot.t_us)
    if signals:
        lines += _table(signals, width - 2, height - 2 - len(lines), first_row)
    name = shortened(view.name or "unknown", width - 20).rstrip()
    return boxed(f"{name}, id {view.number}", lines, width, height)


def last_signal_row(snapshot: Snapshot, view: MessageView, width: int, height: int) -> int:
    """Largest number of signals that can be scrolled past on a panel of this size, cells."""
    latest = snapshot.latest.get(view.key)
    count = 0 if latest is None or latest.layout is None else len(latest.layout.plan.signals)
    used = len(_heading(snapshot, view, latest, width, height))
    room = height - 2 - used - TABLE_HEADING
    return 0 if count <= room else count - (room - 1)


def _heading(
    snapshot: Snapshot, view: MessageView, latest: LatestFrames | None, width: int, height: int
) -> list[Text]:
    """Lines about the frames; at most so many that some signals have room below."""
    facts = _facts(snapshot, view, latest)
    lines = [line for fact in facts for line in wrapped([fact], width - 2, height)]
    return lines[: height - LEAST_TABLE]


def _facts(snapshot: Snapshot, view: MessageView, latest: LatestFrames | None) -> list[Text]:
    """What is known of the frames: bytes, age, rate, counts, and what is wrong."""
    if latest is None:
        return [Text("No frame of this message has been received.", "yellow")]
    frame = latest.latest
    age_ms = max(snapshot.t_us - frame.t_us, 0) / 1000
    facts = [
        Text.assemble(
            (f"{len(frame.data)} bytes  ", "dim"), (frame.data.hex(" ").upper() or "-", "bold")
        ),
        Text(f"{age_ms:.0f} ms old; {_pace(view)}"),
        Text(_counts(view)),
    ]
    if latest.rejection is not None:
        facts.append(Text(f"The service rejects the latest frame: {latest.rejection}.", "yellow"))
    if latest.layout is None:
        facts.append(Text("The database does not have this id: only the bytes are known.", "dim"))
    elif len(frame.data) != latest.layout.plan.size:
        size = latest.layout.plan.size
        what = "nothing is decoded" if len(frame.data) < size else "the first ones are decoded"
        facts.append(Text(f"The database says {size} bytes: {what}.", "yellow"))
    return facts


def _pace(view: MessageView) -> str:
    rate = "too early for a rate" if view.rate is None else f"{view.rate:.1f} accepted frames/s"
    return rate if not view.cycle_us else f"{rate}, {1e6 / view.cycle_us:.4g} expected"


def _counts(view: MessageView) -> str:
    reasons = ", ".join(f"{number} {reason}" for reason, number in view.rejected.items())
    rejected = f"{sum(view.rejected.values())} rejected" + (f" ({reasons})" if reasons else "")
    return f"since the start: {view.accepted} accepted, {rejected}, {view.lost} lost"


def _table(signals: Sequence[SignalView], width: int, height: int, first_row: int) -> list[Text]:
    free = width - VALUE - UNIT - RAW - AGE - 4
    name = min(free - LEAST_NOTE, MOST_NAME)
    heading = (
        f"{'signal':{name}} {'value':>{VALUE}} {'unit':{UNIT}}{'raw':>{RAW}}"
        f"{'age ms':>{AGE}}  meaning or role"
    )
    room, first = height - TABLE_HEADING, 0
    rest = []
    if len(signals) > room:
        room -= 1
        first = min(first_row, len(signals) - room)
        span = f"{first + 1} to {first + room} of {len(signals)} signals"
        rest = [Text(f"{span}: arrow keys show the others", "dim")]
    shown = signals[first : first + room]
    head = [Text(), Text(heading, "dim")]
    return [*head, *(_row(signal, name, free - name) for signal in shown), *rest]


def _row(signal: SignalView, name_width: int, note_width: int) -> Text:
    unit = "" if signal.unit == "-" else printable(signal.unit)
    age = "-" if signal.age_us is None else str(signal.age_us // 1000)
    raw = "-" if signal.raw is None else str(signal.raw)
    note, style = _note(signal)
    text = (
        f"{shortened(printable(signal.name), name_width)} {_value(signal):>{VALUE}} "
        f"{shortened(unit, UNIT)}{_cut(raw, RAW):>{RAW}}{_cut(age, AGE):>{AGE}}  "
        f"{shortened(printable(note), note_width)}"
    )
    return Text(text, style)


def _value(signal: SignalView) -> str:
    if signal.value is None:
        return "-"
    if signal.digits is not None:
        text = f"{signal.value:.{signal.digits}f}"
        if len(text) < VALUE:
            return text
    return f"{signal.value:.5g}"


def _note(signal: SignalView) -> tuple[str, str]:
    """What the value means, and the style of its row."""
    if signal.raw is None:
        return "not received yet", "dim"
    if signal.value is None:
        return "not available", "dim"
    if not signal.is_in_range:
        return "out of range", "yellow"
    return signal.choice or signal.role, ""


def _cut(number: str, width: int) -> str:
    """A number in fewer cells than the width; a larger one by its power of ten."""
    return number if len(number) < width else f"{float(number):.1e}"
