"""A page of `monitor --serve` that cannot show its source, and says why.

Needs the extra `serve`.
"""

from typing import ClassVar

from textual.app import App, ComposeResult
from textual.binding import Binding, BindingType
from textual.widgets import Static

from adhesion_can.printable import printable


class ErrorApp(App[None]):
    """Shows a sentence until somebody presses q.

    Args:
        sentence: What is wrong, and how to fix it.

    """

    ENABLE_COMMAND_PALETTE = False
    BINDINGS: ClassVar[list[BindingType]] = [Binding("q,escape", "quit")]

    def __init__(self, sentence: str) -> None:
        super().__init__(ansi_color=True)
        self._sentence = sentence

    def compose(self) -> ComposeResult:
        """The sentence, and the key that ends it."""
        yield Static(printable(self._sentence), markup=False)
        yield Static("\nReload the page to try again.", markup=False)
