"""The bar of long work on stderr: from two seconds on, with the time left."""

import sys
from collections.abc import Iterator
from contextlib import contextmanager
from time import monotonic
from typing import TYPE_CHECKING

from adhesion_can.printable import say
from adhesion_can.reporting.text import console

if TYPE_CHECKING:
    from rich.progress import Progress, TaskID

SHOWN_AFTER_S = 2.0
"""Time after which work is long, s; and between two lines where stderr is no terminal."""


class Bar:
    """Progress of one piece of work.

    Args:
        what: Name of the work, in one or two words.

    """

    wanted: bool | None = None
    """What --progress or --no-progress said; None: neither."""

    def __init__(self, what: str) -> None:
        self.what = what
        self._console = console(sys.stderr)
        is_terminal = self._console.is_terminal
        self.is_shown = is_terminal if Bar.wanted is None else Bar.wanted
        """Whether the bar comes, if the work takes long."""
        self._as_lines = not is_terminal
        self._after_s = 0.0 if Bar.wanted and is_terminal else SHOWN_AFTER_S
        self._began_s = self._told_s = monotonic()
        self._progress: Progress | None = None
        self._task: TaskID | None = None

    def update(self, share: float, text: str = "", what: str | None = None) -> None:
        """Show how much is done.

        Args:
            share: Share of the work that is done, 0..1.
            text: A few words behind it.
            what: Name of what is being done now; None: as before.

        """
        self.what = what or self.what
        now_s = monotonic()
        if not self.is_shown or now_s - self._began_s < self._after_s:
            return
        if self._as_lines:
            if now_s - self._told_s >= SHOWN_AFTER_S:
                self._told_s = now_s
                left = (now_s - self._began_s) * (1.0 / share - 1.0) if share > 0 else None
                end = "" if left is None else f", {left:.0f} s left"
                say(f"{self.what}: {100 * share:.0f} %{end}")
            return
        if self._progress is None or self._task is None:
            self._begin(share)
        if self._progress is not None and self._task is not None:
            words = {"description": self.what, "text": text}
            self._progress.update(self._task, completed=share, **words)  # type: ignore[arg-type]

    def _begin(self, share: float) -> None:
        from rich.progress import (  # noqa: PLC0415  a fifth of the start of a short command
            BarColumn,
            Progress,
            TaskProgressColumn,
            TextColumn,
            TimeRemainingColumn,
        )

        self._progress = Progress(
            TextColumn("{task.description}"),
            BarColumn(),
            TaskProgressColumn(),
            TextColumn("{task.fields[text]}"),
            TimeRemainingColumn(),
            console=self._console,
            transient=True,
        )
        self._task = self._progress.add_task(self.what, total=1.0, text="")
        self._progress.update(self._task, completed=share)
        self._progress.start()

    def close(self) -> None:
        """Take the bar away."""
        if self._progress is not None:
            self._progress.stop()


@contextmanager
def bar(what: str) -> Iterator[Bar]:
    """A bar that is taken away at the end of the work."""
    progress_bar = Bar(what)
    try:
        yield progress_bar
    finally:
        progress_bar.close()
