"""The whole view of a bus: a pure function of a snapshot, of width and height, and of a page."""

from dataclasses import dataclass, replace
from enum import Enum, auto
from math import isinf

from rich.cells import cell_len
from rich.console import Console, ConsoleOptions, RenderResult
from rich.text import Text

from adhesion_can.monitoring.latest_frames import MessageKey
from adhesion_can.monitoring.snapshot import Origin, Snapshot, Transport
from adhesion_can.printable import printable
from adhesion_can.reporting.terminal.boxes import padded, side_by_side, wrapped
from adhesion_can.reporting.terminal.curve_panel import curve_panel, history_panel
from adhesion_can.reporting.terminal.help_page import help_lines, help_page, last_help_row
from adhesion_can.reporting.terminal.signal_panel import last_signal_row, signal_panel
from adhesion_can.reporting.terminal.tables import (
    axle_panel,
    matching,
    message_list,
    message_panel,
    selected_message,
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
SPANS_S, LONG_SPAN_S, LONG_FROM = (20.0, 60.0), 120.0, 120
"""Times that a history may show, s; the long one, and the width from which it is one of them."""
LIVE_KEYS = "q quit  Enter messages  f filter  space pause  w words  r record  ? help"
LOG_KEYS = "q quit  Enter messages  f filter  space pause  +- speed  g jump  ? help"
LIST_KEYS = "q quit  Enter signals  arrows select  f filter  esc back  ? help"
PAGE_KEYS = "q quit  arrows scroll  space pause  esc back  ? help"
WORDS_KEYS = "q quit  space pause  esc back  ? help"


class ViewPage(Enum):
    """What fills the view."""

    OVERVIEW = auto()
    MESSAGES = auto()
    WORDS = auto()
    HELP = auto()
    SIGNALS = auto()


@dataclass(frozen=True, slots=True)
class ViewOptions:
    """What somebody chose to see.

    Attributes:
        page: What fills the view.
        wanted: Part of the name or id of the messages to show; '' for all.
        first_row: Number of messages, signals or lines of help that are scrolled past.
        selected: Message that is selected in the list, and whose signals are shown; None, or one
            that is not shown: the first one.
        title: Name of the program, in front of the header.
        keys: Line of the keys at the foot; None: that of a bus or of a recording; '' for none.

    """

    page: ViewPage = ViewPage.OVERVIEW
    wanted: str = ""
    first_row: int = 0
    selected: MessageKey | None = None
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
    keys = _keys(options, is_live=snapshot.transport.is_live)
    if len(keys) > width:
        keys = "q quit  ? help" if len("q quit  ? help") <= width else ""
    body = height - 1 - (1 if keys else 0)
    lines = [_header(snapshot, width, options.title)]
    if width < LEAST_WIDTH or height < LEAST_HEIGHT or options.page is ViewPage.WORDS:
        lines += _words(snapshot, width, body, options)
    else:
        lines += _page(snapshot, width, body, options)
    lines = lines[: height - (1 if keys else 0)]
    lines += [Text()] * (height - len(lines) - (1 if keys else 0))
    if keys:
        lines.append(Text(keys, "dim"))
    return [padded(line, width) for line in lines]


def _keys(options: ViewOptions, *, is_live: bool) -> str:
    """Line of the keys at the foot."""
    if options.keys is not None:
        return options.keys
    by_page = {
        ViewPage.MESSAGES: LIST_KEYS,
        ViewPage.SIGNALS: PAGE_KEYS,
        ViewPage.HELP: PAGE_KEYS,
        ViewPage.WORDS: WORDS_KEYS,
    }
    return by_page.get(options.page, LIVE_KEYS if is_live else LOG_KEYS)


def last_row(snapshot: Snapshot, width: int, height: int, options: ViewOptions) -> int:
    """Largest number of rows that can be scrolled past on a page of this size, cells."""
    body = height - 2
    if options.page is ViewPage.HELP:
        return last_help_row(width, body)
    if options.page is ViewPage.SIGNALS:
        view = selected_message(snapshot.messages, options.wanted, options.selected)
        return 0 if view is None else last_signal_row(snapshot, view, width, body)
    return max(len(matching(snapshot.messages, options.wanted)) - 1, 0)


def _words(snapshot: Snapshot, width: int, height: int, options: ViewOptions) -> list[Text]:
    """All sentences, or the lines of the help, of a terminal without room for more."""
    if options.page is ViewPage.HELP:
        return help_lines(width)[:height]
    small = Text(f"(plots and tables need {LEAST_WIDTH} x {LEAST_HEIGHT})", "dim")
    more = [] if options.page is ViewPage.WORDS else [small]
    return wrapped([*sentences(snapshot), *more], width, height)


def _page(snapshot: Snapshot, width: int, height: int, options: ViewOptions) -> list[Text]:
    if options.page is ViewPage.HELP:
        return help_page(width, height, options.first_row)
    if options.page is ViewPage.MESSAGES:
        return message_list(snapshot, width, height, options.wanted, options.selected)
    if options.page is ViewPage.SIGNALS:
        view = selected_message(snapshot.messages, options.wanted, options.selected)
        if view is None:
            return message_list(snapshot, width, height, options.wanted, None)
        return signal_panel(snapshot, view, width, height, options.first_row)
    return _overview(snapshot, width, height, options)


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
    words, rate = _state_of(snapshot, transport), f"{snapshot.frame_rate:.0f}"
    right = "  ".join([*words, f"{rate} frames/s"])
    if len(title) + len(right) + 4 > width:
        right = "  ".join([*words, f"{rate}/s"])
    room = width - len(title) - len(right) - 4
    name = transport.name
    if cell_len(name) > room:
        # The end of a path tells more than its begin.
        while room > 4 and cell_len(name) > room - 2:
            name = name[1:]
        name = f"..{name}" if room > 4 else ""
    left = f"{title}  {name}" if name else title
    between = " " * max(width - cell_len(left) - len(right), 2)
    text = Text(left + between + right, "bold reverse")
    return text if text.cell_len <= width else Text(right[-width:], "bold reverse")


def _state_of(snapshot: Snapshot, transport: Transport) -> list[str]:
    words = []
    if transport.recording:
        words.append("REC")
    if transport.paused:
        words.append("PAUSED")
    if transport.origin is Origin.ESTIMATED_HERE:
        words.append("estimated here")
    if transport.is_live:
        words.append("live" if transport.is_open else "BUS DOWN")
        words.append(f"{snapshot.time_s:.1f} s")
    else:
        end = "" if transport.duration_s is None else f" of {transport.duration_s:.1f}"
        words.append(f"{transport.position_s:.1f}{end} s")
        if transport.catching_up_s is not None:
            words.append("CATCHING UP")
        elif transport.is_at_end:
            words.append("END")
        else:
            words.append("max" if isinf(transport.speed) else f"x{transport.speed:g}")
    return words


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
