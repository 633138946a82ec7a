"""The whole view of a bus: a pure function of a snapshot, of width and height, and of a page."""

from dataclasses import dataclass, replace
from enum import Enum, auto
from math import isinf

from rich.cells import cell_len
from rich.console import Console, ConsoleOptions, RenderResult
from rich.text import Text

from adhesion_can.monitoring.snapshot import Origin, Snapshot, Transport
from adhesion_can.printable import printable
from adhesion_can.reporting.terminal.boxes import boxed, fitted, side_by_side, wrapped
from adhesion_can.reporting.terminal.curve_panel import curve_panel, history_panel
from adhesion_can.reporting.terminal.tables import (
    axle_panel,
    matching,
    message_panel,
    service_panel,
)
from adhesion_can.reporting.terminal.words import sentences

LEAST_WIDTH, LEAST_HEIGHT = 80, 24
"""Size of the smallest terminal that shows plots and tables; a smaller one shows words."""
LEFT = 41
"""Width of the table of axles."""
TALL = 32
"""Height from which more lines of words are shown."""
LEAST_SERVICE = 9
"""Smallest height of the panel about the service."""
KEY_WIDTH = 7
"""Width of the keys in the help, cells."""
SPANS_S, LONG_SPAN_S, LONG_FROM = (20.0, 60.0), 120.0, 120
"""Times that a history may show, s; the long one, and the width from which it is one of them."""
LIVE_KEYS = "q quit  space pause  . step  f filter  m messages  w words  r record  ? help"
LOG_KEYS = "q quit  space pause  . step  +/- speed  g jump  f filter  m w  r record  ? help"
HELP = (
    ("q", "quit"),
    ("space", "pause: a recording stops; a bus continues in the background"),
    (".", "one step of 0.1 s while paused"),
    ("+ -", "double or halve the speed of a recording"),
    ("g", "jump to a time in a recording, s; +10 and -10 are relative"),
    ("f", "filter messages by part of the name or id; empty: all"),
    ("m", "messages only; the arrow keys scroll"),
    ("w", "words only"),
    ("r", "record as candump from now on; press again to stop"),
    ("esc", "back to the overview"),
)
SIGNS_HELP = """\
Messages: ! rejected or lost frames in the last 10 s; x silent for three cycles; - never came. \
'bad' counts rejected and lost frames since the start.
Curve: line: identified curve; ░ its 95 % band from the deviations of the peak; ◆ peak; ┊ creep \
setpoint as slip; dots: samples of 5 s; digits: axles now.
Status: T tracking, l low excitation, C surface change, i init, s stale input, F fault.
The monitor never sends."""


class Page(Enum):
    """What fills the view."""

    OVERVIEW = auto()
    MESSAGES = auto()
    WORDS = auto()
    HELP = auto()


@dataclass(frozen=True, slots=True)
class ViewOptions:
    """What somebody chose to see.

    Attributes:
        page: What fills the view.
        wanted: Part of the name or id of the messages to show; '' for all.
        first_row: Number of messages that are scrolled past.
        title: Name of the program, in front of the header.
        keys: Line of the keys at the foot; None: that of a bus or of a recording; '' for none.

    """

    page: Page = Page.OVERVIEW
    wanted: str = ""
    first_row: int = 0
    title: str = "adhesion-can monitor"
    keys: str | None = None


def draw(
    snapshot: Snapshot, width: int, height: int, options: ViewOptions | None = None
) -> list[Text]:
    """Lines of the view.

    Args:
        snapshot: What is shown.
        width: Width of each line, cells.
        height: Number of lines.
        options: What somebody chose to see.

    Returns:
        Lines, as many as `height`, each of `width` cells.

    """
    options = options or ViewOptions()
    snapshot = _printable(snapshot)
    keys = options.keys
    if keys is None:
        keys = LIVE_KEYS if snapshot.transport.is_live else LOG_KEYS
    if len(keys) > width:
        keys = "q quit  ? help" if len("q quit  ? help") <= width else ""
    body = height - 1 - (1 if keys else 0)
    lines = [_header(snapshot, width, options.title)]
    if options.page is Page.HELP:
        lines += _help(width, body)
    elif width < LEAST_WIDTH or height < LEAST_HEIGHT or options.page is Page.WORDS:
        small = Text(f"(plots and tables need {LEAST_WIDTH} x {LEAST_HEIGHT})", "dim")
        more = [] if options.page is Page.WORDS else [small]
        lines += wrapped([*sentences(snapshot), *more], width, body)
    elif options.page is Page.MESSAGES:
        last = max(len(matching(snapshot.messages, options.wanted)) - (body - 3), 0)
        first_row = min(options.first_row, last)
        lines += message_panel(snapshot, width, body, options.wanted, first_row)
    else:
        lines += _overview(snapshot, width, body, options)
    lines = lines[: height - (1 if keys else 0)]
    lines += [Text()] * (height - len(lines) - (1 if keys else 0))
    if keys:
        lines.append(Text(keys, "dim"))
    return [fitted(line, width) for line in lines]


@dataclass(frozen=True, slots=True)
class MonitorView:
    """The view as something that Rich prints: as wide as the console, and as high as it may be.

    Attributes:
        snapshot: What is shown.
        options: What somebody chose to see.

    """

    snapshot: Snapshot
    options: ViewOptions

    def __rich_console__(self, console: Console, options: ConsoleOptions) -> RenderResult:
        height = options.height or console.height
        yield from draw(self.snapshot, options.max_width, height, self.options)


def _printable(snapshot: Snapshot) -> Snapshot:
    """The snapshot with names and notes that do nothing to a terminal."""
    transport = replace(
        snapshot.transport,
        name=printable(snapshot.transport.name),
        recording=printable(snapshot.transport.recording),
        notes=tuple(map(printable, snapshot.transport.notes)),
    )
    messages = tuple(replace(view, name=printable(view.name)) for view in snapshot.messages)
    remarks = tuple(map(printable, snapshot.remarks))
    return replace(snapshot, transport=transport, messages=messages, remarks=remarks)


def _header(snapshot: Snapshot, width: int, title: str) -> Text:
    transport = snapshot.transport
    right = "  ".join(_state_of(snapshot, transport))
    room = width - len(title) - len(right) - 4
    name = transport.name
    if cell_len(name) > room:
        # The end of a path tells more than its begin.
        name = f"..{_end(name, room - 2)}" if room > 4 else ""
    left = f"{title}  {name}"
    between = " " * max(width - cell_len(left) - len(right), 2)
    text = Text(left + between + right, "bold reverse")
    return text if text.cell_len <= width else Text(right[-width:], "bold reverse")


def _end(text: str, width: int) -> str:
    """End of a text that fills a number of cells at most."""
    while cell_len(text) > width:
        text = text[1:]
    return text


def _state_of(snapshot: Snapshot, transport: Transport) -> list[str]:
    found = []
    if transport.recording:
        found.append("REC")
    if transport.paused:
        found.append("PAUSED")
    if transport.origin is Origin.ESTIMATED_HERE:
        found.append("estimated here")
    if transport.is_live:
        found.append("live" if transport.is_open else "BUS DOWN")
        found.append(f"{snapshot.time_s:.1f} s")
    else:
        end = "" if transport.duration_s is None else f" of {transport.duration_s:.1f}"
        found.append(f"{transport.position_s:.1f}{end} s")
        if transport.is_at_end:
            found.append("END")
        else:
            found.append("max" if isinf(transport.speed) else f"x{transport.speed:g}")
    found.append(f"{snapshot.frame_rate:.0f}/s")
    return found


def _overview(snapshot: Snapshot, width: int, height: int, options: ViewOptions) -> list[Text]:
    word_lines = 5 if height >= TALL else 3 + (options.keys == "")
    said = wrapped(sentences(snapshot), width, word_lines, "" if options.keys == "" else "w")
    said += [Text()] * (word_lines - len(said))
    room = height - word_lines
    left = max(LEFT, width // 2)
    axles = len(snapshot.axles) + 3
    messages = len(matching(snapshot.messages, options.wanted)) + 3
    tables = max(min(max(axles + LEAST_SERVICE, messages), room // 2), min(axles, room // 2))
    plots = room - tables
    spans = (*SPANS_S, LONG_SPAN_S) if width >= LONG_FROM else SPANS_S
    span_s = next((span for span in spans if span >= snapshot.time_s), spans[-1])
    upper = side_by_side(
        curve_panel(snapshot, left, plots),
        history_panel(snapshot, width - left, plots, span_s),
    )
    if tables - axles >= LEAST_SERVICE:
        column = axle_panel(snapshot, left, axles)
        column += service_panel(snapshot, left, tables - axles)
    else:
        column = axle_panel(snapshot, left, tables)
    key = "" if options.keys == "" else "m"
    table = message_panel(snapshot, width - left, tables, options.wanted, options.first_row, key)
    return [*said, *upper, *side_by_side(column, table)]


def _help(width: int, height: int) -> list[Text]:
    if width < LEAST_WIDTH or height < LEAST_HEIGHT - 2:
        return wrapped([Text(f"{key}: {meaning}") for key, meaning in HELP], width, height)
    inner = width - 2
    lines: list[Text] = []
    for key, meaning in HELP:
        parts = wrapped([Text(meaning)], inner - KEY_WIDTH, height)
        names = [key, *[""] * (len(parts) - 1)]
        for name, part in zip(names, parts, strict=True):
            lines.append(Text.assemble((f"{name:>{KEY_WIDTH - 2}}  ", "bold"), part))
    signs = [Text(line) for line in SIGNS_HELP.splitlines()]
    lines += wrapped(signs, inner, height - 2 - len(lines))
    return boxed("help", lines, width, height)
