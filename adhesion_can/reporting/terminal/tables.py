"""Tables of axles, of messages and of the service's own figures, as lines of a width."""

import textwrap
from collections.abc import Sequence

from rich.cells import cell_len, set_cell_size
from rich.text import Text

from adhesion_can.monitoring.latest_frames import MessageKey
from adhesion_can.monitoring.snapshot import (
    AxleView,
    MessageRole,
    MessageState,
    MessageView,
    Snapshot,
)
from adhesion_can.physics.objection import Objection
from adhesion_can.plurals import counted
from adhesion_can.reporting.terminal.boxes import boxed, wrapped

SIGNS = {
    MessageState.OK: (" ", ""),
    MessageState.FAULTY: ("!", "bold yellow"),
    MessageState.SILENT: ("x", "bold red"),
    MessageState.NEVER: ("-", "dim"),
}
"""Sign and style of each state of a message."""
CHOSEN = ">"
"""Sign of the selected message."""
LIST_LEGEND = (
    "Enter: signals   ! rejected or lost frames in the last 10 s   x silent for three cycles   "
    "- never received   rejected, lost: since the start"
)
_TROUBLE = {MessageState.SILENT: 0, MessageState.FAULTY: 1, MessageState.OK: 2}
NAME = 16
"""Width of a message's name in a narrow table, cells."""
WIDE = 68
"""Width from which a table of messages has all its columns, with its frame, cells."""
ENTRY = 10
"""Width of the name before a figure of the service, cells."""
LARGEST_TEXT = 5
"""Width of a count, cells."""


def axle_panel(snapshot: Snapshot, width: int, height: int) -> list[Text]:
    """Slip ratio, adhesion, peak and creep of each axle, with its setpoint."""
    lines: list[Text] = [Text("axle  slip adhes. lambda_m creep   set", "dim")]
    rows = [_axle_row(axle) for axle in snapshot.axles]
    room = height - 3
    if len(rows) > room:
        hidden = len(rows) - (room - 1)
        rows = [*rows[: room - 1], Text(f"+{hidden} axles: enlarge the terminal", "dim")]
    speed = "" if snapshot.speed is None else f", at {3.6 * snapshot.speed:.1f} km/h"
    if snapshot.is_speed_observed:
        speed = ", speed observed"
    return boxed(f"axles, creep in m/s{speed}", lines + rows, width, height)


def _axle_row(axle: AxleView) -> Text:
    return Text(
        f"{axle.axle:>3}{_number(axle.slip, 8, 4)}{_number(axle.adhesion, 7, 3)}"
        f"{_number(axle.lambda_m, 9, 4)}{_number(axle.creep_speed, 6, 2)}"
        f"{_number(axle.creep_setpoint, 6, 2)}"
    )


def _number(value: float | None, width: int, digits: int) -> str:
    """A number to the right of a width, with fewer digits where it is large; a dash for None."""
    if value is None:
        return "-".rjust(width)
    for places in range(digits, -1, -1):
        text = f"{value:.{places}f}"
        if len(text) < width:
            return text.rjust(width)
    return f"{value:.0e}".rjust(width)[:width] if abs(value) < 1e99 else "large".rjust(width)


def matching(messages: Sequence[MessageView], wanted: str) -> list[MessageView]:
    """Messages whose name or number contains a text, in any case; all for ''."""
    text = wanted.lower().removeprefix("0x")
    return [m for m in messages if text in m.name.lower() or text in m.number.lower()]


def selected_message(
    messages: Sequence[MessageView], wanted: str, key: MessageKey | None
) -> MessageView | None:
    """The message with a key among those that match, else the first of them; None for none."""
    matches = matching(messages, wanted)
    return next((view for view in matches if view.key == key), matches[0] if matches else None)


def message_panel(
    snapshot: Snapshot,
    width: int,
    height: int,
    wanted: str = "",
    first_row: int = 0,
    key: str = "",
) -> list[Text]:
    """Age, rate and faults of the messages; messages in trouble come first where room is short.

    Args:
        snapshot: What is shown.
        width: Width of the panel, cells.
        height: Height of the panel, lines.
        wanted: Part of the name or id of the messages to show; '' for all.
        first_row: Number of messages that are scrolled past.
        key: Key that shows all of them, for the line that counts the rest; '' for none.

    """
    matches = matching(snapshot.messages, wanted)
    room = height - 3
    rest = ""
    if len(matches) > room and first_row == 0:
        # Sorting is stable: within a state the order stays.
        matches.sort(key=lambda view: _TROUBLE.get(view.state, 3))
    shown = matches[first_row : first_row + room]
    if len(matches) - first_row > room:
        shown = shown[:-1]
        rest = _rest(matches[first_row + len(shown) :], width - 2, key)
    lines = _message_lines(shown, width, wanted, None)
    if rest:
        lines.append(Text(rest, "dim"))
    return _message_box(lines, width, height, wanted)


def message_list(
    snapshot: Snapshot, width: int, height: int, wanted: str, selected: MessageKey | None
) -> list[Text]:
    """All messages in their own order, with one selected, whose row is always visible.

    Args:
        snapshot: What is shown.
        width: Width of the panel, cells.
        height: Height of the panel, lines; 8 or more.
        wanted: Part of the name or id of the messages to show; '' for all.
        selected: Message that is selected; None, or one that does not match: the first one.

    """
    matches = matching(snapshot.messages, wanted)
    chosen = selected_message(snapshot.messages, wanted, selected)
    legend = wrapped([Text(LIST_LEGEND, "dim")], width - 2, 2)
    room = height - 4 - len(legend)
    index = 0 if chosen is None else matches.index(chosen)
    first = min(max(index - room // 2, 0), max(len(matches) - room, 0))
    lines = _message_lines(matches[first : first + room], width, wanted, chosen)
    hidden = len(matches) - room
    if hidden > 0:
        span = f"{first + 1} to {first + room} of {len(matches)} messages"
        lines.append(Text(f"{span}: arrow keys show the others", "dim"))
    lines += [Text()] * (height - 2 - len(legend) - len(lines))
    return _message_box([*lines, *legend], width, height, wanted)


def _message_lines(
    views: Sequence[MessageView], width: int, wanted: str, chosen: MessageView | None
) -> list[Text]:
    wide = width >= WIDE
    heading = _WIDE_HEADING if wide else _NARROW_HEADING
    rows = [_message_row(view, width, wide=wide, chosen=view is chosen) for view in views]
    none = [Text("no name or id contains this", "dim")] if wanted and not views else []
    return [Text(heading, "dim"), *rows, *none]


def _message_box(lines: Sequence[Text], width: int, height: int, wanted: str) -> list[Text]:
    title = f"messages with {wanted!r}" if wanted else "messages"
    if width < WIDE and not wanted:
        title = "messages; bad: rejected or lost"
    if len(title) > width - 6:
        title = "messages (filtered)" if wanted else "messages"
    return boxed(title, lines, width, height)


_NARROW_HEADING = f"  {'name':{NAME}}{'age ms':>7}{'1/s':>5}{'bad':>6}"
_WIDE_HEADING = (
    f"  {'id':8} {'name':{NAME}}{'age ms':>8}{'1/s':>7}{'rejected':>9}{'lost':>7}  state"
)


def _rest(views: Sequence[MessageView], width: int, key: str) -> str:
    trouble = sum(view.state in (MessageState.SILENT, MessageState.FAULTY) for view in views)
    never = sum(view.state is MessageState.NEVER for view in views)
    parts = [f"{trouble} in trouble"] if trouble else []
    parts += [f"{never} never received"] if never else []
    short = f"+{len(views)} more" + (f": {key}" if key else "")
    long = f"{short} ({', '.join(parts)})" if parts else short
    return long if len(long) <= width else short


def _message_row(view: MessageView, width: int, *, wide: bool, chosen: bool) -> Text:
    sign, style = SIGNS[view.state]
    if chosen:
        sign, style = f"{sign}{CHOSEN}", f"{style} reverse".strip()
    else:
        sign = f"{sign} "
    name = view.name or f"id {view.number}"
    age = "never" if view.age_us is None else _count(view.age_us // 1000)
    rate = "" if view.rate is None else _rate(view.rate)
    rejected = sum(view.rejected.values())
    if not wide:
        bad = rejected + view.lost
        text = f"{sign}{shortened(name, NAME)}{age:>7}{rate:>5}{_count(bad):>6}"
        return Text(text, style)
    text = (
        f"{sign}{view.number:8} {shortened(name, NAME)}{age:>8}{rate:>7}"
        f"{_count(rejected):>9}{_count(view.lost):>7}  {view.state}"
    )
    counts = sorted(view.rejected.items(), key=lambda item: -item[1])
    full = " ".join(f"{reason} {_count(number)}" for reason, number in counts)
    for reasons in (full, *(reason for reason, _ in counts[:1])):
        if len(text) + 2 + len(reasons) <= width - 2:
            text += f": {reasons}" if reasons else ""
            break
    return Text(text, style)


def shortened(name: str, width: int) -> str:
    """A name in a number of cells; of a longer one start and end, which mostly has the number."""
    if cell_len(name) > width:
        end = name[-3:] if cell_len(name[-3:]) <= 3 else name[-1:]
        name = f"{set_cell_size(name, width - 2 - cell_len(end))}..{end}"
    return set_cell_size(name, width)


def _count(number: int) -> str:
    """A count in at most five cells."""
    if number < 10**LARGEST_TEXT:
        return str(number)
    return f"{number // 1000}k" if number < 10_000_000 else f"{min(number // 10**6, 9999)}M"


def _rate(rate: float) -> str:
    return f"{rate:.0f}" if rate >= 9.95 else f"{rate:.1f}"


def service_panel(snapshot: Snapshot, width: int, height: int) -> list[Text]:
    """Curve parameters and figures of the service itself, for terminals with room for them."""
    service = snapshot.service
    entries: dict[str, str] = {}
    if service is not None:
        theta = service.theta
        curve = "-" if theta is None else f"c1 {theta[0]:.4f}, c2 {theta[1]:.2f}, c3 {theta[2]:.4f}"
        rejected, lost = _plain(service.rejected, "rejected", 0), _plain(service.lost, "lost", 0)
        entries = {
            "curve": curve,
            "surface": _plain(service.surface_age_s, "s since it changed", 1),
            "creep": _plain(service.creep_speed, "m/s, setpoint of all axles", 3),
            "doubt": service.doubt.name.lower().replace("_", " "),
            **_objection(service.objection),
            "inputs": f"{rejected}, {lost}, counted by the service",
            "loop": _plain(service.loop_time_us, "us for a frame, 99 % quantile", 0),
        }
    others = sum(view.kind is MessageRole.OTHER for view in snapshot.messages)
    entries["frames"] = (
        f"{snapshot.frames} received, {snapshot.frame_rate:.0f}/s; "
        f"{counted(others, 'id')} not in the configuration"
    )
    lines = [line for name, text in entries.items() for line in _entry(name, text, width - 2)]
    return boxed("the service", lines[: height - 2], width, height)


def _objection(objection: Objection) -> dict[str, str]:
    """Entry of an objection; none where there is none, as the panel has few lines."""
    if objection is Objection.NONE:
        return {}
    return {"readings": objection.name.lower().replace("_", " ")}


def _entry(name: str, text: str, width: int) -> list[str]:
    """Lines of a named text; one that is too long goes on below, where its first line starts."""
    first = f"{name:{ENTRY}}"
    return textwrap.wrap(text, width, initial_indent=first, subsequent_indent=" " * ENTRY)


def _plain(value: float | None, unit: str, digits: int) -> str:
    return f"- {unit}" if value is None else f"{value:.{digits}f} {unit}"
