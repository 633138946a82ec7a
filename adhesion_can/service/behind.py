"""Work behind the loop: a bounded queue, and a thread that empties it.

The loop waits for no disk, no pipe and no reader. What there is no room for is lost, and counted.
"""

import threading
from collections.abc import Callable
from queue import Empty, SimpleQueue
from typing import Generic, TypeVar

Item = TypeVar("Item")

STREAM_END_S = 0.5
"""Time at the end in which a reader must take what is left, s."""
DISK_END_S = 5.0
"""The same for a disk, s: one that is only slow loses nothing."""
MOST_AT_ONCE = 1024
"""Largest number of items that are handled together."""


class Behind(Generic[Item]):
    """Hands items to a function in a thread of its own.

    A queue that was full takes nothing until half of it is free again: what is lost is one hole,
    and not every other item.

    Args:
        name: Name of the thread.
        work: Function that handles items, oldest first, and may take its time.
        capacity: Largest number of items that wait.
        pause_s: Time for which items gather before they are handled, s: the loop need not wake the
            thread for each of them.
        finish: Function that is called in the thread after the last item, with whether the end is
            that of a failure.
        fills: Callback at the first item that is lost.
        flows: Callback with the number of items that were lost, when there is room again.

    """

    def __init__(
        self,
        name: str,
        work: Callable[[list[Item]], object],
        *,
        capacity: int,
        pause_s: float = 0.0,
        finish: Callable[[bool], object] = lambda _: None,
        fills: Callable[[], object] = lambda: None,
        flows: Callable[[int], object] = lambda _: None,
    ) -> None:
        self._work = work
        self._capacity = self._limit = capacity
        self._pause_s = pause_s
        self._finish = finish
        self._fills = fills
        self._flows = flows
        self.lost = 0
        """Number of items that were not handled; after a wait that was too long, those left too."""
        self._hole = 0
        """Number of items that were lost since there was room."""
        self._in_hand = 0
        """Number of items that are being handled."""
        self._failed = False
        self._ending = threading.Event()
        # Its `put` takes no lock that the thread could hold.
        self._queue: SimpleQueue[Item | None] = SimpleQueue()
        self._thread = threading.Thread(target=self._run, name=name, daemon=True)
        self._thread.start()

    @property
    def has_room(self) -> bool:
        """Whether the next item would be taken."""
        return self._queue.qsize() < self._limit

    def put(self, item: Item) -> bool:
        """Have an item handled; never waits. Returns whether there was room."""
        if self._queue.qsize() >= self._limit:
            self._limit = max(self._capacity // 2, 1)
            self._hole += 1
            self.lost += 1
            if self._hole == 1:
                self._fills()
            return False
        if self._hole:
            hole, self._hole, self._limit = self._hole, 0, self._capacity
            self._flows(hole)
        self._queue.put(item)
        return True

    def end(self, last: Item | None = None, *, failed: bool = False) -> None:
        """Have the rest handled and the thread ended; `last` is taken whether or not there is room.

        Returns at once.
        """
        if self._ending.is_set():
            return
        if last is not None:
            self._queue.put(last)
        self._failed = failed
        self._ending.set()
        self._queue.put(None)

    def wait(self, timeout_s: float) -> bool:
        """Wait for the thread's end, s; returns whether it has ended. Called once, after `end`."""
        self._thread.join(max(timeout_s, 0.0))
        if not self._thread.is_alive():
            return True
        # All but the mark of the end, which nobody has come to.
        self.lost += self._in_hand + max(self._queue.qsize() - 1, 0)
        return False

    def _run(self) -> None:
        while True:
            items = self._next_items()
            has_ended = items[-1] is None
            known = [item for item in items if item is not None]
            self._in_hand = len(known)
            if known:
                self._work(known)
            self._in_hand = 0
            if has_ended:
                self._finish(self._failed)
                return

    def _next_items(self) -> list[Item | None]:
        """Items that wait, at least one; after None none comes any more."""
        items = [self._queue.get()]
        if self._pause_s:
            self._ending.wait(self._pause_s)
        while items[-1] is not None and len(items) < MOST_AT_ONCE:
            try:
                items.append(self._queue.get_nowait())
            except Empty:
                break
        return items


def done_within(timeout_s: float, work: Callable[[], object]) -> bool:
    """Do something that may never end; returns whether it was done in time.

    Args:
        timeout_s: Longest time to wait, s.
        work: What is done, in a thread of its own; its error is raised here.

    """
    errors: list[Exception] = []

    def guarded() -> None:
        try:
            work()
        except Exception as error:  # noqa: BLE001  raised by who waits
            errors.append(error)

    thread = threading.Thread(target=guarded, name="end", daemon=True)
    thread.start()
    thread.join(timeout_s)
    if errors:
        raise errors[0]
    return not thread.is_alive()
