"""The terminal program of `monitor`: keys, and ten drawings a second of the session's view.

Needs the extra `tui` (Textual); it is imported where a terminal is to be drawn on.
"""

import asyncio
import os
import signal
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from typing import ClassVar

from rich.text import Text
from textual.app import App, ComposeResult, RenderResult
from textual.binding import Binding, BindingType
from textual.widget import Widget
from textual.widgets import Input

from adhesion_can.cli.monitor_session import MonitorSession
from adhesion_can.errors import InputError
from adhesion_can.monitoring.snapshot import Snapshot
from adhesion_can.reporting.terminal.tables import matching, selected_message
from adhesion_can.reporting.terminal.view import ViewOptions, ViewPage, draw, last_row

PERIOD_S = 0.1
"""Time between two drawings, s."""
SCROLLED = 10
"""Number of rows that a page key scrolls."""
PROMPTS = {
    "filter": "filter: messages with this in name or id; empty: all",
    "jump": "jump to: 90 or 1:30 after the first frame; +10 or -10 from now",
}
BACK = {ViewPage.SIGNALS: ViewPage.MESSAGES}
"""Page behind another one; the overview where none is named."""
CSS = """
Screen { background: ansi_default; layers: view prompt; }
BusView { layer: view; }
Input {
    layer: prompt; dock: bottom; display: none; height: 1; border: none; padding: 0;
    background: ansi_default; color: ansi_default;
}
Input:focus { border: none; }
"""
"""The prompt lies over the line of keys: the view keeps its size, and so what it shows."""


class BusView(Widget):
    """The view of a bus, as large as it may be."""

    DEFAULT_CSS = "BusView { height: 1fr; }"

    def __init__(self) -> None:
        super().__init__()
        self.snapshot: Snapshot | None = None
        """What is shown; None before the first turn."""
        self.chosen = ViewOptions()
        """What somebody chose to see."""

    def render(self) -> RenderResult:
        """Lines of the latest snapshot."""
        width, height = self.size
        if self.snapshot is None or not (width and height):
            return Text()
        return Text("\n").join(draw(self.snapshot, width, height, self.chosen))


class MonitorApp(App[None]):
    """Draws a session and passes keys on to it.

    Args:
        session: Session; who made it closes it.
        duration_s: Time after which it ends by itself, s; None: it does not.
        parent: Process with which it ends; None: it ends with no other.

    """

    CSS = CSS
    TITLE = "adhesion-can monitor"
    ENABLE_COMMAND_PALETTE = False
    BINDINGS: ClassVar[list[BindingType]] = [
        Binding("q", "quit"),
        Binding("ctrl+c", "quit", priority=True),
        Binding("space", "pause"),
        Binding("full_stop", "step"),
        Binding("plus,equals_sign", "faster(2.0)"),
        Binding("minus", "faster(0.5)"),
        Binding("r", "record"),
        Binding("f,slash", "ask('filter')"),
        Binding("g", "ask('jump')"),
        Binding("m", "page('MESSAGES')"),
        Binding("w", "page('WORDS')"),
        Binding("question_mark,h,f1", "page('HELP')"),
        Binding("enter", "open"),
        Binding("escape", "leave"),
        Binding("down,j", "scroll_rows(1)"),
        Binding("up,k", "scroll_rows(-1)"),
        Binding("pagedown", f"scroll_rows({SCROLLED})"),
        Binding("pageup", f"scroll_rows(-{SCROLLED})"),
    ]

    def __init__(
        self,
        session: MonitorSession,
        duration_s: float | None = None,
        parent: int | None = None,
    ) -> None:
        super().__init__(ansi_color=True)
        self.session = session
        self.view = BusView()
        self._duration_s = duration_s
        self._ends_with = parent
        self._asked = ""

    def compose(self) -> ComposeResult:
        """The view, and a line for answers that is hidden until something is asked."""
        yield self.view
        yield Input()

    def on_mount(self) -> None:
        """Start to draw."""
        loop = asyncio.get_running_loop()
        for number in (signal.SIGTERM, signal.SIGHUP):
            # By itself an exception would end the loop, and leave the terminal as it is.
            loop.add_signal_handler(number, self.exit)
        self.view.can_focus = True
        self.view.focus()
        self.turn()
        self.set_interval(PERIOD_S, self.turn)
        if self._duration_s is not None:
            self.set_timer(self._duration_s, self.exit)

    def turn(self) -> None:
        """Take what came, and draw it."""
        if self._ends_with is not None and os.getppid() != self._ends_with:
            self.exit()
        self.view.snapshot = self.session.turn()
        self.view.refresh()

    def action_pause(self) -> None:
        """Stop or go on."""
        self.session.toggle_pause()
        self.turn()

    def action_step(self) -> None:
        """Show a little more."""
        self.session.step()
        self.turn()

    def action_faster(self, factor: float) -> None:
        """Change the speed of a recording."""
        self.session.faster(factor)
        self.turn()

    def action_record(self) -> None:
        """Start or end a recording."""
        self._guarded(self.session.toggle_recording)

    def action_page(self, name: str) -> None:
        """Show a page; the same once more: the overview."""
        page = ViewPage[name]
        self._show(ViewPage.OVERVIEW if self.view.chosen.page is page else page)

    def action_open(self) -> None:
        """Open the list of messages, and from it the signals of the selected one."""
        page = self.view.chosen.page
        self._show(
            ViewPage.SIGNALS if page in (ViewPage.MESSAGES, ViewPage.SIGNALS) else ViewPage.MESSAGES
        )

    def action_leave(self) -> None:
        """Leave the prompt without an answer, or go one page back."""
        if self.query_one(Input).display:
            self._hide_line()
            return
        self._show(BACK.get(self.view.chosen.page, ViewPage.OVERVIEW))

    def action_scroll_rows(self, rows: int) -> None:
        """Scroll the page, or select another message of the list; not past the last row."""
        shown, chosen = self.view.snapshot, self.view.chosen
        if shown is None:
            return
        if chosen.page is ViewPage.MESSAGES:
            views = matching(shown.messages, chosen.wanted)
            view = selected_message(shown.messages, chosen.wanted, chosen.selected)
            if view is not None:
                index = min(max(views.index(view) + rows, 0), len(views) - 1)
                self.view.chosen = replace(chosen, selected=views[index].key)
        else:
            last = last_row(shown, *self.view.size, chosen)
            first = min(max(chosen.first_row + rows, 0), last)
            self.view.chosen = replace(chosen, first_row=first)
        self.view.refresh()

    def _show(self, page: ViewPage) -> None:
        self.view.chosen = replace(self.view.chosen, page=page, first_row=0)
        self.view.refresh()

    def action_ask(self, what: str) -> None:
        """Ask for a filter or a time."""
        if what == "jump" and self.session.log is None:
            self.notify(
                "a bus has only the present; jump works in recordings",
                severity="warning",
                timeout=3,
            )
            return
        self._asked = what
        line = self.query_one(Input)
        line.placeholder = PROMPTS[what]
        line.value = self.view.chosen.wanted if what == "filter" else ""
        line.display = True
        line.focus()

    def on_input_submitted(self, event: Input.Submitted) -> None:
        """Take the answer."""
        if self._asked == "filter":
            self.view.chosen = replace(self.view.chosen, wanted=event.value.strip(), first_row=0)
        elif event.value.strip():
            self._guarded(partial(self.session.jump, event.value))
        self._hide_line()

    def _hide_line(self) -> None:
        self.query_one(Input).display = False
        self.view.focus()
        self.turn()

    def _guarded(self, work: Callable[[], None]) -> None:
        """Do what may be refused, and say why it was."""
        try:
            work()
        except InputError as error:
            self.notify(str(error), severity="error")
        self.turn()
